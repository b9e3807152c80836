//! A tree over points for nearest neighbours and range searches: bounding boxes, eight to a node, over the points' order
//! along a Hilbert curve.
//!
//! Building is a sort and one sweep, so that a tree for moving points can be built anew for every evaluation. Answers do
//! not depend on the shape of the tree: they are exact in the rounded squared distances, and ties go to the smaller
//! index. Of several points in one place only the one with the smallest index is in the tree; the others are its
//! twins.

use super::hilbert;
use crate::linalg::lanes::{Lanes, Vector, WIDTH};

use rayon::prelude::*;

/// From this number on, threads share the work of building.
const MANY: usize = 4096;
/// Enough for the pending children of eight a level and 2^32 points.
const STACK: usize = 128;
/// No twin.
const NONE: u32 = u32::MAX;

/// Coordinates must stay below this, so that no squared distance overflows.
pub const LARGEST: f64 = 1e150;

/// True when every coordinate is a number below [`LARGEST`] in magnitude.
pub fn within_reach(points: &[[f64; 3]]) -> bool {
    let run = |points: &[[f64; 3]]| points.iter().flatten().all(|x| x.abs() < LARGEST);
    if points.len() >= MANY && rayon::current_num_threads() > 1 {
        points.par_chunks(MANY).all(run)
    } else {
        run(points)
    }
}

/// Eight boxes side by side. An absent box lies at infinity.
#[derive(Clone, Copy, Debug)]
struct Boxes {
    low: [Lanes; 3],
    high: [Lanes; 3],
}

const FAR: Lanes = Lanes([f64::INFINITY; WIDTH]);

/// Eight points side by side. An absent point lies at infinity.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    points: [Lanes; 3],
    indices: [u32; WIDTH],
}

/// Points and the tree over them. All memory is reused by [`PointTree::set`].
#[derive(Clone, Debug, Default)]
pub struct PointTree {
    points: Vec<[f64; 3]>,
    leaves: Vec<Leaf>,
    /// `levels[0]` holds the boxes of the leaves, eight a node; `levels[l]` the boxes of the nodes of `levels[l - 1]`.
    levels: Vec<Vec<Boxes>>,
    /// The next larger index in the same place. Empty when all places differ.
    twins: Vec<u32>,
    keys: Vec<u64>,
    order: Vec<u32>,
    finite: bool,
}

impl PointTree {
    pub fn new(points: &[[f64; 3]]) -> PointTree {
        let mut tree = PointTree::default();
        tree.set(points);
        tree
    }

    /// The points, in the order given.
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// True when every coordinate is a number below [`LARGEST`] in magnitude. Searches need this.
    pub fn is_finite(&self) -> bool {
        self.finite
    }

    /// The next larger index of a point in the same place.
    pub fn twin(&self, index: u32) -> Option<u32> {
        self.twins.get(index as usize).copied().filter(|&twin| twin != NONE)
    }

    /// Builds the tree over other points.
    pub fn set(&mut self, points: &[[f64; 3]]) {
        self.points.clear();
        self.points.extend_from_slice(points);
        self.finite = within_reach(points);
        self.twins.clear();
        if hilbert::order(points, &mut self.keys, &mut self.order) {
            self.remove_twins();
        }
        let leaf = |group: &[u32]| {
            let mut leaf = Leaf {
                points: [FAR; 3],
                indices: [NONE; WIDTH],
            };
            for (lane, &index) in group.iter().enumerate() {
                leaf.indices[lane] = index;
                for axis in 0..3 {
                    leaf.points[axis].0[lane] = points[index as usize][axis];
                }
            }
            leaf
        };
        if points.len() >= MANY && rayon::current_num_threads() > 1 {
            (self.order.par_chunks(WIDTH).map(leaf)).collect_into_vec(&mut self.leaves);
        } else {
            self.leaves.clear();
            self.leaves.extend(self.order.chunks(WIDTH).map(leaf));
        }
        let mut depth = 0;
        // Boxes to make on this level, and things in the last of them.
        let mut count = self.leaves.len();
        let mut things = self.order.len();
        loop {
            if self.levels.len() == depth {
                self.levels.push(Vec::new());
            }
            let (below, level) = self.levels.split_at_mut(depth);
            let level = &mut level[0];
            level.clear();
            level.resize(
                count.div_ceil(WIDTH),
                Boxes {
                    low: [FAR; 3],
                    high: [FAR; 3],
                },
            );
            let leaves = &self.leaves;
            let fill = |(node, boxes): (usize, &mut Boxes)| {
                for child in node * WIDTH..count.min((node + 1) * WIDTH) {
                    let present = (things - child * WIDTH).min(WIDTH);
                    for axis in 0..3 {
                        let (low, high) = match below.last() {
                            None => {
                                let leaf = &leaves[child];
                                (&leaf.points[axis], &leaf.points[axis])
                            }
                            Some(below) => (&below[child].low[axis], &below[child].high[axis]),
                        };
                        boxes.low[axis].0[child % WIDTH] =
                            low.0[..present].iter().copied().fold(f64::INFINITY, f64::min);
                        boxes.high[axis].0[child % WIDTH] =
                            high.0[..present].iter().copied().fold(f64::NEG_INFINITY, f64::max);
                    }
                }
            };
            if count >= MANY && rayon::current_num_threads() > 1 {
                level.par_iter_mut().enumerate().for_each(fill);
            } else {
                level.iter_mut().enumerate().for_each(fill);
            }
            depth += 1;
            things = count;
            count = level.len();
            if count <= 1 {
                break;
            }
        }
        self.levels.truncate(depth);
    }

    /// Leaves one index a place in `order`, and links the others to it.
    fn remove_twins(&mut self) {
        let (points, twins) = (&self.points, &mut self.twins);
        let mut last: Option<u32> = None;
        self.order.retain(|&index| {
            let twin = last.replace(index).filter(|&previous| {
                hilbert::place(points[previous as usize]) == hilbert::place(points[index as usize])
            });
            if let Some(previous) = twin {
                if twins.is_empty() {
                    twins.resize(points.len(), NONE);
                }
                twins[previous as usize] = index;
            }
            twin.is_none()
        });
    }

    /// Squared distances from `x` to eight boxes; infinite for an absent box.
    #[inline(always)]
    fn distances<V: Vector>(boxes: &Boxes, x: [f64; 3]) -> V {
        let zero = V::constant(0.0);
        let mut sum = zero;
        for axis in 0..3 {
            let here = V::constant(x[axis]);
            let below = V::load(&boxes.low[axis]) - here;
            let above = here - V::load(&boxes.high[axis]);
            let outside = below.max(above).max(zero);
            sum = sum + outside * outside;
        }
        sum
    }

    /// Squared distances from `x` to eight points; infinite for an absent point.
    #[inline(always)]
    fn squares<V: Vector>(leaf: &Leaf, x: [f64; 3]) -> V {
        let mut sum = V::constant(0.0);
        for axis in 0..3 {
            let difference = V::load(&leaf.points[axis]) - V::constant(x[axis]);
            sum = sum + difference * difference;
        }
        sum
    }

    /// The point nearest to `x` and its squared distance; among equally near points the one with the smallest index.
    /// `hint` is the index of a point expected to be near: a good one saves time and nothing else. `None` without points.
    pub fn nearest(&self, x: [f64; 3], hint: Option<u32>) -> Option<(u32, f64)> {
        self.nearest_in::<Lanes>(x, hint)
    }

    /// [`PointTree::nearest`] in vector registers.
    #[inline(always)]
    pub(crate) fn nearest_in<V: Vector>(&self, x: [f64; 3], hint: Option<u32>) -> Option<(u32, f64)> {
        let start = hint.or(self.order.first().copied())?;
        let [a, b, c] = self.points[start as usize];
        let mut best = (
            (a - x[0]) * (a - x[0]) + (b - x[1]) * (b - x[1]) + (c - x[2]) * (c - x[2]),
            start,
        );
        let mut lanes = Lanes::ZERO;
        let mut stack = [(0.0f64, 0u32, 0u32); STACK];
        let mut height = 1;
        stack[0] = (0.0, self.levels.len() as u32, 0);
        while height > 0 {
            height -= 1;
            let (bound, level, node) = stack[height];
            if bound > best.0 {
                continue;
            }
            if level == 0 {
                let leaf = &self.leaves[node as usize];
                let squares = Self::squares::<V>(leaf, x);
                // Not farther than the best.
                let mut near = !V::bits(V::constant(best.0).less(squares));
                squares.store(&mut lanes);
                while near != 0 {
                    let lane = near.trailing_zeros() as usize;
                    near &= near - 1;
                    if (lanes.0[lane], leaf.indices[lane]) < best {
                        best = (lanes.0[lane], leaf.indices[lane]);
                    }
                }
                continue;
            }
            let distances = Self::distances::<V>(&self.levels[level as usize - 1][node as usize], x);
            let mut near = !V::bits(V::constant(best.0).less(distances));
            distances.store(&mut lanes);
            let base = height;
            while near != 0 {
                let lane = near.trailing_zeros() as usize;
                near &= near - 1;
                let distance = lanes.0[lane];
                // Kept in falling order of distance, so that the nearest child is visited first.
                let mut slot = height;
                while slot > base && stack[slot - 1].0 < distance {
                    stack[slot] = stack[slot - 1];
                    slot -= 1;
                }
                stack[slot] = (distance, level - 1, node * WIDTH as u32 + lane as u32);
                height += 1;
            }
        }
        Some((best.1, best.0))
    }

    /// Writes the points that are at most the square root of `bound` away from a box. False, with nothing useful written,
    /// when there are more than `most`.
    #[inline(always)]
    pub(crate) fn gather<V: Vector>(
        &self,
        low: [f64; 3],
        high: [f64; 3],
        bound: f64,
        most: usize,
        some: &mut SomePoints,
    ) -> bool {
        some.clear();
        self.search::<V>(&mut Gather {
            low,
            high,
            bound,
            most,
            some,
        })
    }

    /// Appends, in no particular order, the points that for every row `bound` of `bounds` are less than the square
    /// root of `bound[k]` away from `centres[k]` for some `k`.
    #[inline(always)]
    pub(crate) fn contenders<V: Vector>(&self, centres: &[[f64; 3]; 3], bounds: &[[f64; 3]], found: &mut Vec<u32>) {
        self.search::<V>(&mut Contend { centres, bounds, found });
    }

    /// Goes through the leaves that a search wants, in a fixed order, until it has enough. False when it had.
    #[inline(always)]
    fn search<V: Vector>(&self, search: &mut impl Search) -> bool {
        if self.order.is_empty() {
            return true;
        }
        let mut stack = [(0u32, 0u32); STACK];
        let mut height = 1;
        stack[0] = (self.levels.len() as u32, 0);
        while height > 0 {
            height -= 1;
            let (level, node) = stack[height];
            let mut near = search.wants::<V>(&self.levels[level as usize - 1][node as usize]);
            while near != 0 {
                let child = node * WIDTH as u32 + near.trailing_zeros();
                near &= near - 1;
                if level > 1 {
                    stack[height] = (level - 1, child);
                    height += 1;
                } else if !search.take::<V>(&self.leaves[child as usize]) {
                    return false;
                }
            }
        }
        true
    }
}

/// What a search does at the nodes of the tree. No closures: they would not inherit the instruction set.
trait Search {
    /// The boxes to go into.
    fn wants<V: Vector>(&self, boxes: &Boxes) -> u8;

    /// Takes what it wants of a leaf. False when that is enough.
    fn take<V: Vector>(&mut self, leaf: &Leaf) -> bool;
}

/// See [`PointTree::gather`].
struct Gather<'a> {
    low: [f64; 3],
    high: [f64; 3],
    bound: f64,
    most: usize,
    some: &'a mut SomePoints,
}

impl Gather<'_> {
    #[inline(always)]
    fn reaches<V: Vector>(&self, lows: &[Lanes; 3], highs: &[Lanes; 3]) -> u8 {
        !V::bits(V::constant(self.bound).less(gap::<V>(lows, highs, self.low, self.high)))
    }
}

impl Search for Gather<'_> {
    #[inline(always)]
    fn wants<V: Vector>(&self, boxes: &Boxes) -> u8 {
        self.reaches::<V>(&boxes.low, &boxes.high)
    }

    #[inline(always)]
    fn take<V: Vector>(&mut self, leaf: &Leaf) -> bool {
        let mut inside = self.reaches::<V>(&leaf.points, &leaf.points);
        while inside != 0 {
            let lane = inside.trailing_zeros() as usize;
            inside &= inside - 1;
            if leaf.indices[lane] != NONE {
                self.some.push(leaf, lane);
            }
        }
        self.some.count <= self.most
    }
}

/// See [`PointTree::contenders`].
struct Contend<'a> {
    centres: &'a [[f64; 3]; 3],
    bounds: &'a [[f64; 3]],
    found: &'a mut Vec<u32>,
}

impl Search for Contend<'_> {
    #[inline(always)]
    fn wants<V: Vector>(&self, boxes: &Boxes) -> u8 {
        let [a, b, c] = *self.centres;
        let distances = [
            PointTree::distances::<V>(boxes, a),
            PointTree::distances::<V>(boxes, b),
            PointTree::distances::<V>(boxes, c),
        ];
        contend(&distances, self.bounds)
    }

    #[inline(always)]
    fn take<V: Vector>(&mut self, leaf: &Leaf) -> bool {
        let [a, b, c] = *self.centres;
        let squares = [
            PointTree::squares::<V>(leaf, a),
            PointTree::squares::<V>(leaf, b),
            PointTree::squares::<V>(leaf, c),
        ];
        let mut inside = contend(&squares, self.bounds);
        while inside != 0 {
            self.found.push(leaf.indices[inside.trailing_zeros() as usize]);
            inside &= inside - 1;
        }
        true
    }
}

/// A few points of a tree, eight side by side.
#[derive(Debug, Default)]
pub(crate) struct SomePoints {
    leaves: Vec<Leaf>,
    count: usize,
}

impl SomePoints {
    fn clear(&mut self) {
        self.leaves.clear();
        self.count = 0;
    }

    #[inline(always)]
    fn push(&mut self, from: &Leaf, lane: usize) {
        let place = self.count % WIDTH;
        if place == 0 {
            self.leaves.push(Leaf {
                points: [FAR; 3],
                indices: [NONE; WIDTH],
            });
        }
        if let Some(leaf) = self.leaves.last_mut() {
            leaf.indices[place] = from.indices[lane];
            for axis in 0..3 {
                leaf.points[axis].0[place] = from.points[axis].0[lane];
            }
        }
        self.count += 1;
    }

    /// [`PointTree::contenders`] among these points.
    #[inline(always)]
    pub(crate) fn contenders<V: Vector>(&self, centres: &[[f64; 3]; 3], bounds: &[[f64; 3]], found: &mut Vec<u32>) {
        let mut contend = Contend { centres, bounds, found };
        for leaf in &self.leaves {
            contend.take::<V>(leaf);
        }
    }

    /// The nearer of `best`, a squared distance and an index, and these points; the smaller index among equally near
    /// ones.
    #[inline(always)]
    pub(crate) fn nearest<V: Vector>(&self, x: [f64; 3], mut best: (f64, u32)) -> (f64, u32) {
        let mut lanes = Lanes::ZERO;
        for leaf in &self.leaves {
            let squares = PointTree::squares::<V>(leaf, x);
            // Not farther than the best.
            let mut near = !V::bits(V::constant(best.0).less(squares));
            if near == 0 {
                continue;
            }
            squares.store(&mut lanes);
            while near != 0 {
                let lane = near.trailing_zeros() as usize;
                near &= near - 1;
                if (lanes.0[lane], leaf.indices[lane]) < best {
                    best = (lanes.0[lane], leaf.indices[lane]);
                }
            }
        }
        best
    }
}

/// Squared distances of eight boxes to one; infinite for an absent box.
#[inline(always)]
fn gap<V: Vector>(lows: &[Lanes; 3], highs: &[Lanes; 3], low: [f64; 3], high: [f64; 3]) -> V {
    let zero = V::constant(0.0);
    let mut sum = zero;
    for axis in 0..3 {
        let below = V::load(&lows[axis]) - V::constant(high[axis]);
        let above = V::constant(low[axis]) - V::load(&highs[axis]);
        let outside = below.max(above).max(zero);
        sum = sum + outside * outside;
    }
    sum
}

/// The lanes that for every row of bounds are below one of its entries.
#[inline(always)]
fn contend<V: Vector>(squares: &[V; 3], bounds: &[[f64; 3]]) -> u8 {
    let mut all = u8::MAX;
    for bound in bounds {
        let below = squares[0].less(V::constant(bound[0]))
            | squares[1].less(V::constant(bound[1]))
            | squares[2].less(V::constant(bound[2]));
        all &= V::bits(below);
    }
    all
}
