//! The restricted cells within one triangle, as the lower envelope of affine functions.
//!
//! On the triangle's plane the squared distance to a site differs from that to a reference site by an affine function,
//! the site's *height function* `W_i`. The cell of site `i` is where `W_i` is smallest: a convex polygon, cut from the
//! triangle by the lines `W_i = W_j`. A constant added to a squared distance (a power diagram) changes nothing in
//! this.
//!
//! A polygon starts as the whole triangle. At a vertex where another height function is lower than the owner's, the
//! lowest one cuts the polygon; when no vertex is left with a lower one, the polygon is the cell, by convexity.
//! Finding the lowest of eight functions takes a handful of vector instructions, so that no order of the neighbours
//! and no security radius is needed.

use super::frame::Frame;
use crate::linalg::lanes::{Lanes, Vector, WIDTH};

/// What lies across an edge of a polygon: an edge of the triangle (`-1 - k` for the edge from corner `k` to `k + 1`) or a
/// candidate.
pub(crate) type Mark = i32;

/// No site is known that is lower at the vertex than the owner.
const UNKNOWN: i32 = -2;
/// The owner is lowest at the vertex.
pub(super) const SETTLED: i32 = -1;

/// The number of every lane.
const LANE: Lanes = Lanes([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);

#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    pub(crate) u: f64,
    pub(crate) v: f64,
    /// Mark of the edge that leaves the vertex.
    pub(crate) mark: Mark,
    /// A lower candidate, or one of the constants above.
    pub(super) rival: i32,
}

impl Corner {
    pub(super) const EMPTY: Corner = Corner {
        u: 0.0,
        v: 0.0,
        mark: 0,
        rival: SETTLED,
    };
}

/// A site that may own a part of the triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) site: u32,
    /// The height function `height[0] u + height[1] v + height[2]`.
    pub(crate) height: [f64; 3],
    /// The site in the triangle's frame, relative to its origin.
    pub(crate) local: [f64; 3],
    /// What is added to the squared distance.
    pub(crate) offset: f64,
}

/// Height functions, eight side by side.
#[derive(Debug, Default)]
pub(super) struct Heights {
    groups: Vec<[Lanes; 3]>,
    count: usize,
}

impl Heights {
    pub(super) fn clear(&mut self) {
        self.groups.clear();
        self.count = 0;
    }

    #[inline(always)]
    pub(super) fn push(&mut self, height: [f64; 3]) {
        let lane = self.count % WIDTH;
        if lane == 0 {
            // Absent functions are infinite everywhere.
            self.groups
                .push([Lanes::ZERO, Lanes::ZERO, Lanes([f64::INFINITY; WIDTH])]);
        }
        if let Some(group) = self.groups.last_mut() {
            for k in 0..3 {
                group[k].0[lane] = height[k];
            }
        }
        self.count += 1;
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    #[inline(always)]
    pub(super) fn get(&self, index: usize) -> [f64; 3] {
        let group = &self.groups[index / WIDTH];
        std::array::from_fn(|k| group[k].0[index % WIDTH])
    }

    /// Whether function `i` is lowest in the middle of a polygon. A polygon that was cut by some of the functions only
    /// may belong to one that is nowhere lowest.
    #[inline(always)]
    pub(super) fn owns<V: Vector>(&self, polygon: &[Corner], i: usize, tolerance: f64) -> bool {
        let share = 1.0 / polygon.len() as f64;
        let (mut u, mut v) = (0.0, 0.0);
        for corner in polygon {
            u += share * corner.u;
            v += share * corner.v;
        }
        let [a, b, c] = self.get(i);
        self.lowest::<V>(u, v).0 >= a * u + b * v + c - tolerance
    }

    /// Walking from `from` along `direction`, where another function becomes as low as `own` first: the length walked, in
    /// units of `direction`, and the function. Infinite when none does. `besides` is left out.
    #[inline(always)]
    pub(super) fn rise<V: Vector>(&self, own: u32, besides: u32, from: [f64; 2], direction: [f64; 2]) -> (f64, u32) {
        let [a, b, c] = self.get(own as usize);
        let (a, b, c) = (V::constant(a), V::constant(b), V::constant(c));
        let (u, v) = (V::constant(from[0]), V::constant(from[1]));
        let (du, dv) = (V::constant(direction[0]), V::constant(direction[1]));
        let zero = V::constant(0.0);
        let never = V::constant(f64::INFINITY);
        let mut best = never;
        let mut place = zero;
        let mut index = 0.0;
        for (number, group) in self.groups.iter().enumerate() {
            let (p, q) = (V::load(&group[0]) - a, V::load(&group[1]) - b);
            let above = p * u + q * v + (V::load(&group[2]) - c);
            let fall = zero - (p * du + q * dv);
            let mut approaches = zero.less(fall);
            if number == besides as usize / WIDTH {
                let lanes = V::load(&LANE);
                let lane = V::constant((besides as usize % WIDTH) as f64);
                approaches = approaches & (lanes.less(lane) | lane.less(lanes));
            }
            let length = V::select(approaches, above / fall, never);
            let sooner = length.less(best);
            best = V::select(sooner, length, best);
            place = V::select(sooner, V::constant(index), place);
            index += 1.0;
        }
        let soonest = best.smallest();
        let lane = (!V::bits(V::constant(soonest).less(best))).trailing_zeros() as usize % WIDTH;
        if self.groups.len() == 1 {
            return (soonest, lane as u32);
        }
        let mut places = Lanes::ZERO;
        place.store(&mut places);
        (soonest, (places.0[lane] as usize * WIDTH + lane) as u32)
    }

    /// The smallest value at a point, and the first function that takes it.
    #[inline(always)]
    pub(super) fn lowest<V: Vector>(&self, u: f64, v: f64) -> (f64, usize) {
        let (u, v) = (V::constant(u), V::constant(v));
        let mut best = value(&self.groups[0], u, v);
        let mut place = V::constant(0.0);
        let mut index = 1.0;
        for group in &self.groups[1..] {
            let value = value(group, u, v);
            let lower = value.less(best);
            best = V::select(lower, value, best);
            place = V::select(lower, V::constant(index), place);
            index += 1.0;
        }
        let smallest = best.smallest();
        // Not above the smallest.
        let lane = (!V::bits(V::constant(smallest).less(best))).trailing_zeros() as usize;
        if self.groups.len() == 1 {
            return (smallest, lane);
        }
        let mut places = Lanes::ZERO;
        place.store(&mut places);
        (smallest, places.0[lane % WIDTH] as usize * WIDTH + lane)
    }
}

// No closure: it would not inherit the instruction set.
#[inline(always)]
fn value<V: Vector>(group: &[Lanes; 3], u: V, v: V) -> V {
    V::load(&group[0]) * u + V::load(&group[1]) * v + V::load(&group[2])
}

/// Convex polygons of one triangle in a flat array.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    /// The polygons' corners, and room for more.
    pub(super) corners: Vec<Corner>,
    used: usize,
    /// Owner, first corner and end of every polygon.
    pub(super) parts: Vec<(u32, u32, u32)>,
    /// Sum of the polygons' areas.
    pub(super) area: f64,
}

impl Polygons {
    pub(super) fn clear(&mut self) {
        self.used = 0;
        self.parts.clear();
        self.area = 0.0;
    }

    #[inline(always)]
    pub(super) fn push(&mut self, owner: usize, polygon: &[Corner]) {
        self.room(polygon.len())[..polygon.len()].copy_from_slice(polygon);
        self.close(owner, 0, polygon.len());
        self.used += polygon.len();
    }

    /// Room for so many corners, to write polygons to without a copy. What was there is of no use.
    #[inline(always)]
    pub(super) fn room(&mut self, size: usize) -> &mut [Corner] {
        let end = self.used + size;
        if self.corners.len() < end {
            self.corners.resize(end, Corner::EMPTY);
        }
        &mut self.corners[self.used..end]
    }

    /// Makes a polygon of the corners from `start` to `end` in the room.
    #[inline(always)]
    pub(super) fn close(&mut self, owner: usize, start: usize, end: usize) {
        let (start, end) = (self.used + start, self.used + end);
        let polygon = &self.corners[start..end];
        self.parts.push((owner as u32, start as u32, end as u32));
        let first = polygon[0];
        let mut doubled = 0.0;
        let (mut x, mut y) = (polygon[1].u - first.u, polygon[1].v - first.v);
        for corner in &polygon[2..] {
            let (a, b) = (corner.u - first.u, corner.v - first.v);
            doubled += x * b - y * a;
            (x, y) = (a, b);
        }
        self.area += 0.5 * doubled;
    }
}

impl Polygons {
    /// Adds a polygon that was cut among the functions `names`, and calls those by their names.
    pub(super) fn push_renamed(&mut self, owner: usize, polygon: &[Corner], names: &[u32]) {
        self.push(owner, polygon);
        let start = self.used - polygon.len();
        for corner in &mut self.corners[start..self.used] {
            if corner.mark >= 0 {
                corner.mark = names[corner.mark as usize] as i32;
            }
        }
    }
}

/// Memory for cutting one polygon.
#[derive(Debug, Default)]
pub(super) struct Clipper {
    polygon: Vec<Corner>,
    other: Vec<Corner>,
    signs: Vec<f64>,
}

impl Clipper {
    /// The triangle itself, with the lowest functions at its corners.
    #[inline(always)]
    pub(super) fn corners<V: Vector>(frame: &Frame, heights: &Heights) -> [(Corner, f64); 3] {
        let mut corners = Clipper::triangle(frame).map(|corner| (corner, 0.0));
        for (corner, value) in &mut corners {
            let (lowest, rival) = heights.lowest::<V>(corner.u, corner.v);
            corner.rival = rival as i32;
            *value = lowest;
        }
        corners
    }

    /// The whole triangle as a polygon.
    pub(super) fn triangle(frame: &Frame) -> [Corner; 3] {
        std::array::from_fn(|k| Corner {
            u: frame.corners[k][0],
            v: frame.corners[k][1],
            mark: -1 - k as i32,
            rival: SETTLED,
        })
    }

    /// The polygon of function `i`, counter-clockwise; empty when it owns nothing. A function must be lower by more than
    /// `tolerance` to cut.
    #[inline(always)]
    pub(super) fn cell<V: Vector>(
        &mut self,
        corners: &[(Corner, f64); 3],
        heights: &Heights,
        i: usize,
        tolerance: f64,
    ) -> &[Corner] {
        let own = heights.get(i);
        let height = |function: [f64; 3], u: f64, v: f64| function[0] * u + function[1] * v + function[2];
        self.polygon.clear();
        for &(mut corner, value) in corners {
            if value >= height(own, corner.u, corner.v) - tolerance {
                corner.rival = SETTLED;
            }
            self.polygon.push(corner);
        }
        // Every round settles a vertex or cuts it off, and every function cuts once at most up to rounding.
        let mut rounds = 4 * heights.len() + 8;
        'search: while rounds > 0 {
            rounds -= 1;
            for k in 0..self.polygon.len() {
                let corner = &mut self.polygon[k];
                if corner.rival == SETTLED {
                    continue;
                }
                if corner.rival == UNKNOWN {
                    let (value, rival) = heights.lowest::<V>(corner.u, corner.v);
                    if value >= height(own, corner.u, corner.v) - tolerance {
                        corner.rival = SETTLED;
                        continue;
                    }
                    corner.rival = rival as i32;
                }
                let rival = corner.rival;
                if !self.cut(own, heights.get(rival as usize), rival) {
                    self.polygon.clear();
                    break 'search;
                }
                continue 'search;
            }
            break;
        }
        &self.polygon
    }

    /// Cuts off where `other` is lower than `own`. False when nothing remains.
    #[inline(always)]
    fn cut(&mut self, own: [f64; 3], other: [f64; 3], mark: Mark) -> bool {
        let [a, b, c] = [own[0] - other[0], own[1] - other[1], own[2] - other[2]];
        self.signs.clear();
        self.signs
            .extend(self.polygon.iter().map(|corner| a * corner.u + b * corner.v + c));
        self.other.clear();
        let size = self.polygon.len();
        let (mut from, mut start) = (self.polygon[size - 1], self.signs[size - 1]);
        for (&to, &end) in self.polygon.iter().zip(&self.signs) {
            if (start > 0.0) != (end > 0.0) {
                let t = start / (start - end);
                self.other.push(Corner {
                    u: from.u + t * (to.u - from.u),
                    v: from.v + t * (to.v - from.v),
                    // Leaving the cell: the bisector follows. Entering it: the old edge goes on.
                    mark: if start > 0.0 { from.mark } else { mark },
                    rival: UNKNOWN,
                });
            }
            if !(end > 0.0) {
                self.other.push(to);
            }
            (from, start) = (to, end);
        }
        std::mem::swap(&mut self.polygon, &mut self.other);
        self.polygon.len() >= 3
    }
}
