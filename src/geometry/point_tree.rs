//! A tree over points for nearest neighbours and range searches: bounding boxes, eight to a node, over the points' order
//! along a Hilbert curve.
//!
//! Building is a sort and one sweep, so that a tree for moving points can be built anew for every evaluation. Answers do
//! not depend on the shape of the tree: they are exact in the rounded squared distances, and ties go to the smaller index.

use super::hilbert;

/// Points in a leaf, and children of a node.
pub const WIDTH: usize = 8;
/// Enough for two pending nodes of eight children a level and 2^32 points.
const STACK: usize = 128;

/// Eight boxes side by side. An absent box lies at infinity.
#[derive(Clone, Copy, Debug)]
struct Boxes {
    low: [[f64; WIDTH]; 3],
    high: [[f64; WIDTH]; 3],
}

const NO_BOXES: Boxes = Boxes {
    low: [[f64::INFINITY; WIDTH]; 3],
    high: [[f64::INFINITY; WIDTH]; 3],
};

/// Eight points side by side. An absent point lies at infinity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaf {
    pub(crate) points: [[f64; WIDTH]; 3],
    pub(crate) indices: [u32; WIDTH],
}

/// Points and the tree over them. All memory is reused by [`PointTree::set`].
#[derive(Clone, Debug, Default)]
pub struct PointTree {
    points: Vec<[f64; 3]>,
    leaves: Vec<Leaf>,
    /// `levels[0]` holds the boxes of the leaves, eight a node; `levels[l]` the boxes of the nodes of `levels[l - 1]`.
    levels: Vec<Vec<Boxes>>,
    keys: Vec<(u64, u32)>,
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

    /// True when every coordinate is a finite number. Searches need this.
    pub fn is_finite(&self) -> bool {
        self.finite
    }

    /// The points' indices along the Hilbert curve.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Builds the tree over other points.
    pub fn set(&mut self, points: &[[f64; 3]]) {
        self.points.clear();
        self.points.extend_from_slice(points);
        self.finite = points.iter().flatten().all(|x| x.is_finite());
        hilbert::order(points, &mut self.keys, &mut self.order);
        self.leaves.clear();
        for group in self.order.chunks(WIDTH) {
            let mut leaf = Leaf {
                points: [[f64::INFINITY; WIDTH]; 3],
                indices: [u32::MAX; WIDTH],
            };
            for (lane, &index) in group.iter().enumerate() {
                leaf.indices[lane] = index;
                for axis in 0..3 {
                    leaf.points[axis][lane] = points[index as usize][axis];
                }
            }
            self.leaves.push(leaf);
        }
        let mut depth = 0;
        let mut count = self.leaves.len();
        loop {
            if self.levels.len() == depth {
                self.levels.push(Vec::new());
            }
            let (below, level) = self.levels.split_at_mut(depth);
            let level = &mut level[0];
            level.clear();
            level.resize(count.div_ceil(WIDTH), NO_BOXES);
            for child in 0..count {
                let boxes = &mut level[child / WIDTH];
                for axis in 0..3 {
                    let (low, high) = match below.last() {
                        None => {
                            let x = &self.leaves[child].points[axis];
                            let present = (points.len() - child * WIDTH).min(WIDTH);
                            (&x[..present], &x[..present])
                        }
                        Some(below) => {
                            let present = (below_count(self.leaves.len(), depth) - child * WIDTH).min(WIDTH);
                            (&below[child].low[axis][..present], &below[child].high[axis][..present])
                        }
                    };
                    boxes.low[axis][child % WIDTH] = low.iter().copied().fold(f64::INFINITY, f64::min);
                    boxes.high[axis][child % WIDTH] = high.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                }
            }
            depth += 1;
            count = level.len();
            if count <= 1 {
                break;
            }
        }
        self.levels.truncate(depth);
    }

    /// Squared distances from `x` to the eight boxes of a node; infinite for an absent box.
    #[inline(always)]
    fn distances(boxes: &Boxes, x: [f64; 3]) -> [f64; WIDTH] {
        let mut sum = [0.0; WIDTH];
        for axis in 0..3 {
            for lane in 0..WIDTH {
                let below = boxes.low[axis][lane] - x[axis];
                let above = x[axis] - boxes.high[axis][lane];
                let outside = if below > above { below } else { above };
                let outside = if outside > 0.0 { outside } else { 0.0 };
                sum[lane] += outside * outside;
            }
        }
        sum
    }

    /// The point nearest to `x` and its squared distance; among equally near points the one with the smallest index.
    /// `hint` is the index of a point expected to be near: a good one saves time and nothing else. `None` without points.
    pub fn nearest(&self, x: [f64; 3], hint: Option<u32>) -> Option<(u32, f64)> {
        if self.points.is_empty() {
            return None;
        }
        let start = hint.unwrap_or(self.order[0]);
        let distance = |index: u32| {
            let [a, b, c] = self.points[index as usize];
            (a - x[0]) * (a - x[0]) + (b - x[1]) * (b - x[1]) + (c - x[2]) * (c - x[2])
        };
        let mut best = (distance(start), start);
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
                let mut squares = [0.0; WIDTH];
                for axis in 0..3 {
                    for lane in 0..WIDTH {
                        let difference = leaf.points[axis][lane] - x[axis];
                        squares[lane] += difference * difference;
                    }
                }
                for lane in 0..WIDTH {
                    if squares[lane] <= best.0 && (squares[lane], leaf.indices[lane]) < best {
                        best = (squares[lane], leaf.indices[lane]);
                    }
                }
                continue;
            }
            let distances = Self::distances(&self.levels[level as usize - 1][node as usize], x);
            let base = height;
            for lane in 0..WIDTH {
                if distances[lane] <= best.0 && distances[lane] < f64::INFINITY {
                    // Kept in falling order of distance, so that the nearest child is visited first.
                    let mut slot = height;
                    while slot > base && stack[slot - 1].0 < distances[lane] {
                        stack[slot] = stack[slot - 1];
                        slot -= 1;
                    }
                    stack[slot] = (distances[lane], level - 1, node * WIDTH as u32 + lane as u32);
                    height += 1;
                }
            }
        }
        Some((best.1, best.0))
    }

    /// Appends, in no particular order, the points that lie less than the square root of `squares[k]` from `centres[k]`
    /// for some `k`.
    pub fn within_any(&self, centres: &[[f64; 3]; 3], squares: [f64; 3], found: &mut Vec<u32>) {
        let mut stack = [(0u32, 0u32); STACK];
        let mut height = 1;
        stack[0] = (self.levels.len() as u32, 0);
        if self.points.is_empty() {
            return;
        }
        while height > 0 {
            height -= 1;
            let (level, node) = stack[height];
            let mut near = [false; WIDTH];
            if level == 0 {
                let leaf = &self.leaves[node as usize];
                for ball in 0..3 {
                    let mut sum = [0.0; WIDTH];
                    for axis in 0..3 {
                        for lane in 0..WIDTH {
                            let difference = leaf.points[axis][lane] - centres[ball][axis];
                            sum[lane] += difference * difference;
                        }
                    }
                    for lane in 0..WIDTH {
                        near[lane] |= sum[lane] < squares[ball];
                    }
                }
                for lane in 0..WIDTH {
                    if near[lane] {
                        found.push(leaf.indices[lane]);
                    }
                }
                continue;
            }
            let boxes = &self.levels[level as usize - 1][node as usize];
            for ball in 0..3 {
                let distances = Self::distances(boxes, centres[ball]);
                for lane in 0..WIDTH {
                    near[lane] |= distances[lane] < squares[ball];
                }
            }
            for lane in 0..WIDTH {
                if near[lane] {
                    stack[height] = (level - 1, node * WIDTH as u32 + lane as u32);
                    height += 1;
                }
            }
        }
    }
}

/// Boxes in the level below `depth`, when there are `leaves` leaves.
fn below_count(leaves: usize, depth: usize) -> usize {
    (1..depth).fold(leaves, |count, _| count.div_ceil(WIDTH))
}
