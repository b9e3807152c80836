//! The nearest triangle of a surface to a point, by a tree of boxes with eight children a node.
//!
//! Guaranteed: the smallest distance over all triangles, each computed with vectors (never as a difference of large
//! squares), so distances far below the size of the surface keep their digits; triangles without area count as the
//! segments or points that they are; the same input gives the same bits on every processor. Connectivity and orientation
//! play no part. Not guaranteed: which of several equally near triangles is named. A triangle narrower than 1e-10 of its
//! longest edge is measured by its edges alone, an error below that width.
//!
//! Eight boxes or eight triangles are tested at a time. A query may start from the triangle that a neighbouring query
//! found; then most of the tree is never looked at.

use crate::linalg::lanes::{Lanes, Vector, WIDTH, load};
use crate::linalg::processor::{Kernel, Processor};
use crate::linalg::vector3;
use crate::mesh::{TriangleMesh, cross, dot, subtract};

/// Children of a node, and triangles of a leaf.
const ARITY: usize = WIDTH;
/// Levels of boxes at most: 8^11 leaves are more than indices can name.
const LEVELS: usize = 11;
/// Relative width below which a triangle is taken for its edges.
const NARROW: f64 = 1e-10;

/// Eight triangles with all that their distances need.
#[derive(Clone)]
struct Leaf {
    /// First corner, and the edges from it to the second and the third.
    corner: [Lanes; 3],
    first: [Lanes; 3],
    second: [Lanes; 3],
    /// `v = first_dual . p`, `w = second_dual . p` are the barycentric coordinates of the foot of `p`.
    first_dual: [Lanes; 3],
    second_dual: [Lanes; 3],
    normal: [Lanes; 3],
    /// Inverse squared lengths of the two edges and of the third; 0 for an edge without length.
    inverses: [Lanes; 3],
    triangles: [u32; WIDTH],
}

/// Eight boxes. Lanes beyond the last child hold boxes at infinity.
#[derive(Clone)]
struct Boxes {
    low: [Lanes; 3],
    high: [Lanes; 3],
}

/// The nearest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    pub squared_distance: f64,
    /// Index of the triangle.
    pub triangle: u32,
}

/// A surface made ready for closest-point queries.
pub struct ClosestPoint {
    /// `levels[0]` bounds the leaves, eight a node; the last level has one node.
    levels: Vec<Vec<Boxes>>,
    leaves: Vec<Leaf>,
    /// The place of every triangle: leaf times eight plus lane.
    places: Vec<u32>,
    corners: Vec<[[f64; 3]; 3]>,
    processor: Processor,
}

impl ClosestPoint {
    /// Of a surface; triangles may be degenerate, repeated or unconnected.
    ///
    /// # Panics
    /// Without triangles, or with an index out of range.
    pub fn new(surface: &TriangleMesh) -> ClosestPoint {
        assert!(!surface.cells.is_empty(), "a surface with at least one triangle");
        let corners: Vec<[[f64; 3]; 3]> = surface.cells.iter().map(|&cell| surface.corners(cell)).collect();
        let centres: Vec<[f64; 3]> = corners
            .iter()
            .map(|[a, b, c]| std::array::from_fn(|axis| a[axis] + b[axis] + c[axis]))
            .collect();
        let mut order: Vec<u32> = (0..corners.len() as u32).collect();
        let mut span = ARITY;
        while span < order.len() {
            span *= ARITY;
        }
        arrange(&mut order, span / ARITY, &centres);

        let mut places = vec![0; corners.len()];
        let leaves: Vec<Leaf> = order
            .chunks(ARITY)
            .enumerate()
            .map(|(index, triangles)| {
                for (lane, &triangle) in triangles.iter().enumerate() {
                    places[triangle as usize] = (index * ARITY + lane) as u32;
                }
                Leaf::new(triangles, &corners)
            })
            .collect();
        let mut bounds: Vec<[[f64; 3]; 2]> = order
            .chunks(ARITY)
            .map(|triangles| {
                around(triangles.iter().flat_map(|&triangle| {
                    let corners = corners[triangle as usize];
                    corners.map(|corner| [corner, corner])
                }))
            })
            .collect();
        let mut levels: Vec<Vec<Boxes>> = Vec::new();
        loop {
            levels.push(bounds.chunks(ARITY).map(Boxes::new).collect());
            bounds = bounds
                .chunks(ARITY)
                .map(|children| around(children.iter().copied()))
                .collect();
            if bounds.len() == 1 {
                break;
            }
        }
        assert!(levels.len() <= LEVELS, "indices of 32 bits");
        ClosestPoint {
            levels,
            leaves,
            places,
            corners,
            processor: Processor::detect(),
        }
    }

    /// The same with another instruction set; results do not change.
    pub fn with_processor(mut self, processor: Processor) -> ClosestPoint {
        self.processor = processor;
        self
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.corners.len()
    }

    /// The nearest triangle to a point. `hint` is a triangle that is likely to be near.
    pub fn nearest(&self, point: [f64; 3], hint: Option<u32>) -> Nearest {
        let mut found = [Nearest {
            squared_distance: f64::INFINITY,
            triangle: 0,
        }];
        self.nearest_each(&[point], hint, &mut found);
        found[0]
    }

    /// The nearest triangles to points that lie near each other in this order: each query starts from the answer of the
    /// one before, the first from `hint`.
    ///
    /// # Panics
    /// When `found` is not as long as `points`.
    pub fn nearest_each(&self, points: &[[f64; 3]], hint: Option<u32>, found: &mut [Nearest]) {
        assert_eq!(points.len(), found.len(), "an answer for every point");
        self.processor.run(Search {
            tree: self,
            points,
            hint,
            found,
        });
    }

    /// The point of a triangle that is nearest to `point`.
    pub fn foot(&self, triangle: u32, point: [f64; 3]) -> [f64; 3] {
        foot(self.corners[triangle as usize], point)
    }

    /// Squared distance to one triangle.
    pub fn squared_distance_to(&self, triangle: u32, point: [f64; 3]) -> f64 {
        let away = subtract(point, self.foot(triangle, point));
        dot(away, away)
    }
}

/// Orders triangles so that every aligned run of `span`, `span / 8`, ... of them lies together: splits at medians along
/// the longest side of the box of their centres.
fn arrange(order: &mut [u32], span: usize, centres: &[[f64; 3]]) {
    if order.len() <= ARITY || span < ARITY {
        return;
    }
    // Eight children in three halvings, each at a multiple of the children's size.
    fn halve(order: &mut [u32], child: usize, children: usize, centres: &[[f64; 3]]) {
        if children > 1 && order.len() > child {
            let left = (child * children / 2).min(order.len());
            if left < order.len() {
                let [low, high] = around(order.iter().map(|&triangle| [centres[triangle as usize]; 2]));
                let extent: [f64; 3] = std::array::from_fn(|axis| high[axis] - low[axis]);
                let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
                let place = |triangle: &u32| centres[*triangle as usize][axis];
                order.select_nth_unstable_by(left, |a, b| place(a).total_cmp(&place(b)).then(a.cmp(b)));
            }
            let (first, second) = order.split_at_mut(left);
            rayon::join(
                || halve(first, child, children / 2, centres),
                || halve(second, child, children / 2, centres),
            );
        } else if child > ARITY {
            halve(order, child / ARITY, ARITY, centres);
        }
    }
    halve(order, span, ARITY, centres);
}

/// The smallest box around boxes.
fn around(boxes: impl Iterator<Item = [[f64; 3]; 2]>) -> [[f64; 3]; 2] {
    boxes.fold(
        [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
        |[low, high], [other_low, other_high]| {
            [
                std::array::from_fn(|axis| low[axis].min(other_low[axis])),
                std::array::from_fn(|axis| high[axis].max(other_high[axis])),
            ]
        },
    )
}

impl Boxes {
    fn new(children: &[[[f64; 3]; 2]]) -> Boxes {
        let mut boxes = Boxes {
            low: [Lanes([f64::INFINITY; WIDTH]); 3],
            high: [Lanes([f64::INFINITY; WIDTH]); 3],
        };
        for (lane, [low, high]) in children.iter().enumerate() {
            for axis in 0..3 {
                boxes.low[axis].0[lane] = low[axis];
                boxes.high[axis].0[lane] = high[axis];
            }
        }
        boxes
    }

    /// Squared distances of a point to the boxes.
    #[inline(always)]
    fn squared_distances<V: Vector>(&self, point: [V; 3]) -> V {
        let zero = V::constant(0.0);
        let mut sum = zero;
        for axis in 0..3 {
            let below = V::load(&self.low[axis]) - point[axis];
            let above = point[axis] - V::load(&self.high[axis]);
            sum = sum + below.max(above).max(zero).square();
        }
        sum
    }
}

impl Leaf {
    fn new(triangles: &[u32], corners: &[[[f64; 3]; 3]]) -> Leaf {
        let far = Lanes::ZERO;
        let mut leaf = Leaf {
            corner: [far; 3],
            first: [far; 3],
            second: [far; 3],
            first_dual: [far; 3],
            second_dual: [far; 3],
            normal: [far; 3],
            inverses: [far; 3],
            triangles: [0; WIDTH],
        };
        for lane in 0..WIDTH {
            // A leaf that is not full repeats its last triangle.
            let triangle = triangles[lane.min(triangles.len() - 1)];
            leaf.triangles[lane] = triangle;
            let [a, b, c] = corners[triangle as usize];
            let (first, second) = (subtract(b, a), subtract(c, a));
            let third = subtract(c, b);
            let normal = cross(first, second);
            let doubled = dot(normal, normal);
            let squares = [first, second, third].map(|edge| dot(edge, edge));
            let longest = squares.into_iter().fold(0.0, f64::max);
            // Not-a-number is never inside.
            let (mut duals, mut unit) = ([[f64::NAN; 3]; 2], [0.0; 3]);
            if doubled > (NARROW * longest).powi(2) {
                duals = [cross(second, normal), cross(normal, first)].map(|dual| dual.map(|entry| entry / doubled));
                unit = normal.map(|entry| entry / doubled.sqrt());
            }
            for axis in 0..3 {
                leaf.corner[axis].0[lane] = a[axis];
                leaf.first[axis].0[lane] = first[axis];
                leaf.second[axis].0[lane] = second[axis];
                leaf.first_dual[axis].0[lane] = duals[0][axis];
                leaf.second_dual[axis].0[lane] = duals[1][axis];
                leaf.normal[axis].0[lane] = unit[axis];
                leaf.inverses[axis].0[lane] = if squares[axis] > 0.0 { 1.0 / squares[axis] } else { 0.0 };
            }
        }
        leaf
    }

    /// Squared distances of a point to the triangles: to the plane where the foot lies inside, to the nearest edge
    /// elsewhere.
    #[inline(always)]
    fn squared_distances<V: Vector>(&self, point: [V; 3]) -> V {
        let (zero, one) = (V::constant(0.0), V::constant(1.0));
        let p = vector3::subtract(point, load(&self.corner));
        let (first, second): ([V; 3], [V; 3]) = (load(&self.first), load(&self.second));
        let edges = to_segment(p, first, V::load(&self.inverses[0]))
            .min(to_segment(p, second, V::load(&self.inverses[1])))
            .min(to_segment(
                vector3::subtract(p, first),
                vector3::subtract(second, first),
                V::load(&self.inverses[2]),
            ));
        let v = vector3::dot(p, load(&self.first_dual));
        let w = vector3::dot(p, load(&self.second_dual));
        let inside = zero.less(v) & zero.less(w) & (v + w).less(one);
        V::select(inside, vector3::dot(p, load(&self.normal)).square(), edges)
    }
}

/// Squared distances to segments from the origin along `edge`, of the given inverse squared lengths.
// No closure: those are compiled without the instruction set of the kernel around them.
#[inline(always)]
fn to_segment<V: Vector>(p: [V; 3], edge: [V; 3], inverse: V) -> V {
    let share = (vector3::dot(p, edge) * inverse)
        .max(V::constant(0.0))
        .min(V::constant(1.0));
    let away = vector3::subtract(p, vector3::times(edge, share));
    vector3::dot(away, away)
}

/// A run of queries.
struct Search<'a> {
    tree: &'a ClosestPoint,
    points: &'a [[f64; 3]],
    hint: Option<u32>,
    found: &'a mut [Nearest],
}

/// A node or leaf still to be looked at.
#[derive(Clone, Copy)]
struct Due {
    squared_distance: f64,
    /// Its level plus one: 0 for a leaf.
    level: u32,
    index: u32,
}

impl Kernel for Search<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let tree = self.tree;
        let mut distances = Lanes::ZERO;
        let mut hint = self.hint.filter(|&hint| (hint as usize) < tree.places.len());
        // Each level leaves at most seven brothers behind.
        let mut stack = [Due {
            squared_distance: 0.0,
            level: 0,
            index: 0,
        }; ARITY * (LEVELS + 1)];
        for (point, found) in self.points.iter().zip(self.found.iter_mut()) {
            let spread = [V::constant(point[0]), V::constant(point[1]), V::constant(point[2])];
            let mut best = Nearest {
                squared_distance: f64::INFINITY,
                triangle: 0,
            };
            if let Some(hint) = hint {
                let leaf = &tree.leaves[tree.places[hint as usize] as usize / ARITY];
                leaf.squared_distances(spread).store(&mut distances);
                improve(&mut best, &distances, &leaf.triangles);
            }
            let mut waiting = 1;
            stack[0] = Due {
                squared_distance: 0.0,
                level: tree.levels.len() as u32,
                index: 0,
            };
            while waiting > 0 {
                waiting -= 1;
                let due = stack[waiting];
                if due.squared_distance >= best.squared_distance {
                    continue;
                }
                if due.level == 0 {
                    let leaf = &tree.leaves[due.index as usize];
                    let squared = leaf.squared_distances(spread);
                    if V::any(squared.less(V::constant(best.squared_distance))) {
                        squared.store(&mut distances);
                        improve(&mut best, &distances, &leaf.triangles);
                    }
                    continue;
                }
                let boxes = &tree.levels[due.level as usize - 1][due.index as usize];
                let squared = boxes.squared_distances(spread);
                if !V::any(squared.less(V::constant(best.squared_distance))) {
                    continue;
                }
                squared.store(&mut distances);
                let base = waiting;
                for (lane, &squared_distance) in distances.0.iter().enumerate() {
                    if squared_distance < best.squared_distance {
                        // Nearest on top, by insertion.
                        let mut place = waiting;
                        while place > base && stack[place - 1].squared_distance < squared_distance {
                            stack[place] = stack[place - 1];
                            place -= 1;
                        }
                        stack[place] = Due {
                            squared_distance,
                            level: due.level - 1,
                            index: due.index * ARITY as u32 + lane as u32,
                        };
                        waiting += 1;
                    }
                }
            }
            *found = best;
            hint = Some(best.triangle);
        }
    }
}

#[inline(always)]
fn improve(best: &mut Nearest, distances: &Lanes, triangles: &[u32; WIDTH]) {
    for (&squared_distance, &triangle) in distances.0.iter().zip(triangles) {
        if squared_distance < best.squared_distance {
            *best = Nearest {
                squared_distance,
                triangle,
            };
        }
    }
}

/// The point of a triangle that is nearest to `point`; a triangle without area is the segment or point that it is.
pub fn foot([a, b, c]: [[f64; 3]; 3], point: [f64; 3]) -> [f64; 3] {
    let (first, second) = (subtract(b, a), subtract(c, a));
    let normal = cross(first, second);
    let doubled = dot(normal, normal);
    let p = subtract(point, a);
    let longest = dot(first, first)
        .max(dot(second, second))
        .max(dot(subtract(c, b), subtract(c, b)));
    if doubled > (NARROW * longest).powi(2) {
        let v = dot(p, cross(second, normal)) / doubled;
        let w = dot(p, cross(normal, first)) / doubled;
        if v > 0.0 && w > 0.0 && v + w < 1.0 {
            let height = dot(p, normal) / doubled;
            return std::array::from_fn(|axis| point[axis] - height * normal[axis]);
        }
    }
    let on_segment = |from: [f64; 3], to: [f64; 3]| -> [f64; 3] {
        let edge = subtract(to, from);
        let square = dot(edge, edge);
        let share = if square > 0.0 {
            (dot(subtract(point, from), edge) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        std::array::from_fn(|axis| from[axis] + share * edge[axis])
    };
    let far = |foot: &[f64; 3]| dot(subtract(point, *foot), subtract(point, *foot));
    let [mut best, second, third] = [on_segment(a, b), on_segment(a, c), on_segment(b, c)];
    for other in [second, third] {
        if far(&other) < far(&best) {
            best = other;
        }
    }
    best
}
