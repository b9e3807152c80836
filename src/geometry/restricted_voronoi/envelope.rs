//! All cells of a triangle at once: the subdivision of the triangle by the lower envelope of its height functions.
//!
//! The cells are walked along their edges. Along the triangle's border and along every bisector the next vertex is where
//! another function becomes as low as the owner's first: one quotient a function, taken eight by eight. Every vertex is
//! found once and tells three cells, so that no polygon is cut again and again.
//!
//! Cells are convex, so two of them share one edge at most. Rounding that breaks the combinatorics therefore shows: an
//! edge ends twice, a cell's border does not close, or a cell turns the wrong way. The walk then gives up, and the
//! caller cuts the cells one by one.

use super::clip::{Corner, Heights, Polygons, SETTLED};
use super::frame::Frame;
use crate::linalg::lanes::Vector;

/// No edge.
const NONE: u32 = u32::MAX;

/// One side of an edge: a cell, and what lies across it, another cell or an edge of the triangle.
#[derive(Clone, Copy, Debug, Default)]
struct Side {
    /// Where the edge ends, walked with the cell on the left.
    end: [f64; 2],
    /// What lies across the cell's next edge.
    next: u32,
    /// The triangle for which this was found.
    stamp: u32,
}

/// Memory for one triangle.
#[derive(Debug, Default)]
pub(super) struct Envelope {
    /// `sides[i * width + across]`: functions first, then the triangle's edges.
    sides: Vec<Side>,
    width: usize,
    stamp: u32,
    /// Something across every cell.
    first: Vec<u32>,
    /// Bisectors, as cells on the left and on the right, whose starts are known.
    due: Vec<(u32, u32)>,
    polygon: Vec<Corner>,
}

impl Envelope {
    /// Writes the cells of all functions in the triangle, by rising index. False when rounding got in the way; what was
    /// written is then void.
    #[inline(always)]
    pub(super) fn cells<V: Vector>(&mut self, frame: &Frame, heights: &Heights, polygons: &mut Polygons) -> bool {
        // Cells that close, turn the right way and fill the triangle overlap nowhere.
        self.walk::<V>(frame, heights) && self.collect(heights.len(), polygons, allowed(frame))
    }

    #[inline(always)]
    fn side(&self, cell: u32, across: u32) -> Option<&Side> {
        let side = &self.sides[cell as usize * self.width + across as usize];
        (side.stamp == self.stamp).then_some(side)
    }

    /// False when the side has been found before.
    #[inline(always)]
    fn set(&mut self, cell: u32, across: u32, end: [f64; 2], next: u32) -> bool {
        let side = &mut self.sides[cell as usize * self.width + across as usize];
        let fresh = side.stamp != self.stamp;
        *side = Side {
            end,
            next,
            stamp: self.stamp,
        };
        self.first[cell as usize] = across;
        fresh
    }

    /// Finds all vertices.
    #[inline(always)]
    fn walk<V: Vector>(&mut self, frame: &Frame, heights: &Heights) -> bool {
        let count = heights.len();
        self.width = count + 3;
        if self.sides.len() < count * self.width {
            self.sides.resize(count * self.width, Side::default());
        }
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.sides.fill(Side::default());
            self.stamp = 1;
        }
        self.first.clear();
        self.first.resize(count, NONE);
        self.due.clear();

        let [start, ..] = frame.corners;
        let first = heights.lowest::<V>(start[0], start[1]).1 as u32;
        let mut own = first;
        // Every function comes up once at most along an edge.
        let mut steps = 3 * count;
        for k in 0..3 {
            let from = frame.corners[k];
            let last = (k + 1) % 3;
            let to = frame.corners[last];
            let direction = [to[0] - from[0], to[1] - from[1]];
            let edge = (count + k) as u32;
            let mut place = 0.0;
            loop {
                let (t, next) = heights.rise::<V>(own, own, from, direction);
                if !(t < 1.0) {
                    if !self.set(own, edge, to, (count + last) as u32) {
                        return false;
                    }
                    break;
                }
                if steps == 0 || !(t >= place) {
                    return false;
                }
                steps -= 1;
                place = t;
                let at = [from[0] + t * direction[0], from[1] + t * direction[1]];
                if !(self.set(own, edge, at, next) && self.set(next, own, at, edge)) {
                    return false;
                }
                self.due.push((own, next));
                own = next;
            }
        }
        if own != first {
            return false;
        }
        // A planar subdivision has fewer than twice as many vertices as cells.
        let mut steps = 2 * count;
        while let Some((left, right)) = self.due.pop() {
            if self.side(left, right).is_some() {
                continue;
            }
            let Some(&Side { end: from, .. }) = self.side(right, left) else {
                return false;
            };
            let (a, b) = (heights.get(left as usize), heights.get(right as usize));
            // The right function is lower on the right.
            let direction = [b[1] - a[1], a[0] - b[0]];
            let (t, ahead) = heights.rise::<V>(left, right, from, direction);
            if steps == 0 || !t.is_finite() {
                return false;
            }
            steps -= 1;
            let at = [from[0] + t * direction[0], from[1] + t * direction[1]];
            if !(self.set(left, right, at, ahead)
                && self.set(ahead, left, at, right)
                && self.set(right, ahead, at, left))
            {
                return false;
            }
            if self.side(left, ahead).is_none() {
                self.due.push((left, ahead));
            }
            if self.side(ahead, right).is_none() {
                self.due.push((ahead, right));
            }
        }
        true
    }

    /// Walks around every cell.
    #[inline(always)]
    fn collect(&mut self, count: usize, polygons: &mut Polygons, allowed: f64) -> bool {
        for cell in 0..count as u32 {
            let first = self.first[cell as usize];
            if first == NONE {
                continue;
            }
            self.polygon.clear();
            let mut across = first;
            loop {
                let Some(&Side { end, next, .. }) = self.side(cell, across) else {
                    return false;
                };
                if self.polygon.len() >= self.width {
                    return false;
                }
                self.polygon.push(Corner {
                    u: end[0],
                    v: end[1],
                    mark: if (next as usize) < count {
                        next as i32
                    } else {
                        count as i32 - 1 - next as i32
                    },
                    rival: SETTLED,
                });
                across = next;
                if across == first {
                    break;
                }
            }
            if self.polygon.len() >= 3 {
                if !counter_clockwise(&self.polygon, allowed) {
                    return false;
                }
                polygons.push(cell as usize, &self.polygon);
            }
        }
        true
    }
}

/// By how much area a part of a cell may be turned over.
#[inline(always)]
pub(super) fn allowed(frame: &Frame) -> f64 {
    1e-12 * frame.area + 1e-14 * frame.diameter * frame.diameter
}

/// Whether no triangle of the fan at the first vertex is turned over by more than the allowed area.
#[inline(always)]
pub(super) fn counter_clockwise(polygon: &[Corner], allowed: f64) -> bool {
    let first = polygon[0];
    let (mut x, mut y) = (polygon[1].u - first.u, polygon[1].v - first.v);
    let mut least = f64::INFINITY;
    for corner in &polygon[2..] {
        let (a, b) = (corner.u - first.u, corner.v - first.v);
        least = least.min(x * b - y * a);
        (x, y) = (a, b);
    }
    least >= -allowed
}
