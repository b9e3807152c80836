//! Rays against triangles: the farthest and the nearest hit, by a tree of boxes.
//!
//! Guaranteed: the same hits whatever the order of the triangles, up to rounding; triangles without area are never
//! hit. Not guaranteed: that a ray exactly through an edge hits either of its triangles; the margin that is given
//! makes it hit both.

use crate::mesh::{TriangleMesh, cross, dot, subtract};

/// A triangle hit by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The point is origin plus this multiple of the direction.
    pub distance: f64,
    pub triangle: u32,
    /// Weights of the triangle's corners.
    pub weights: [f64; 3],
}

struct Node {
    low: [f64; 3],
    high: [f64; 3],
    /// First child (the second follows) of an inner node, or the first triangle of a leaf.
    first: u32,
    /// Number of triangles; 0 for inner nodes.
    count: u32,
}

/// A surface made ready for rays.
pub struct Rays<'a> {
    surface: &'a TriangleMesh,
    nodes: Vec<Node>,
    order: Vec<u32>,
}

/// Triangles of a leaf at most.
const LEAF: usize = 4;
/// How far outside a triangle, in its weights, a ray still hits it.
const MARGIN: f64 = 1e-9;

impl<'a> Rays<'a> {
    pub fn new(surface: &'a TriangleMesh) -> Self {
        let mut rays = Self {
            surface,
            nodes: Vec::new(),
            order: (0..surface.cells.len() as u32).collect(),
        };
        let centres: Vec<[f64; 3]> = surface
            .cells
            .iter()
            .map(|&cell| {
                let corners = surface.corners(cell);
                std::array::from_fn(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / 3.0)
            })
            .collect();
        rays.nodes.push(Node {
            low: [0.0; 3],
            high: [0.0; 3],
            first: 0,
            count: surface.cells.len() as u32,
        });
        let mut pending = vec![0usize];
        while let Some(node) = pending.pop() {
            let (first, count) = (rays.nodes[node].first as usize, rays.nodes[node].count as usize);
            let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for &triangle in &rays.order[first..first + count] {
                for corner in surface.corners(surface.cells[triangle as usize]) {
                    for axis in 0..3 {
                        low[axis] = low[axis].min(corner[axis]);
                        high[axis] = high[axis].max(corner[axis]);
                    }
                }
            }
            (rays.nodes[node].low, rays.nodes[node].high) = (low, high);
            if count <= LEAF {
                continue;
            }
            let axis = (0..3)
                .max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b])))
                .unwrap_or(0);
            let half = count / 2;
            rays.order[first..first + count].select_nth_unstable_by(half, |&a, &b| {
                centres[a as usize][axis]
                    .total_cmp(&centres[b as usize][axis])
                    .then(a.cmp(&b))
            });
            let child = rays.nodes.len();
            for (first, count) in [(first, half), (first + half, count - half)] {
                rays.nodes.push(Node {
                    low,
                    high,
                    first: first as u32,
                    count: count as u32,
                });
            }
            rays.nodes[node].first = child as u32;
            rays.nodes[node].count = 0;
            pending.extend([child, child + 1]);
        }
        rays
    }

    /// All hits at positive distances, in increasing order of distance.
    pub fn hits(&self, origin: [f64; 3], direction: [f64; 3]) -> Vec<Hit> {
        let mut found = Vec::new();
        let mut stack = vec![0u32];
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if !crosses(node, origin, direction) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
                continue;
            }
            for &triangle in &self.order[node.first as usize..(node.first + node.count) as usize] {
                found.extend(self.hit(triangle, origin, direction));
            }
        }
        found.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.triangle.cmp(&b.triangle)));
        found
    }

    /// The hit of one triangle, by the volumes that the ray spans with its edges.
    fn hit(&self, triangle: u32, origin: [f64; 3], direction: [f64; 3]) -> Option<Hit> {
        let corners = self.surface.corners(self.surface.cells[triangle as usize]);
        let [a, b, c] = corners.map(|corner| subtract(corner, origin));
        let volumes = [
            dot(direction, cross(b, c)),
            dot(direction, cross(c, a)),
            dot(direction, cross(a, b)),
        ];
        let total: f64 = volumes.iter().sum();
        if total == 0.0 {
            return None;
        }
        let weights = volumes.map(|volume| volume / total);
        if weights.iter().any(|&weight| !(weight >= -MARGIN)) {
            return None;
        }
        let point: [f64; 3] =
            std::array::from_fn(|axis| weights[0] * a[axis] + weights[1] * b[axis] + weights[2] * c[axis]);
        let distance = dot(point, direction) / dot(direction, direction);
        (distance > 0.0).then_some(Hit {
            distance,
            triangle,
            weights,
        })
    }
}

/// Whether the ray meets a box, with a little room around it.
fn crosses(node: &Node, origin: [f64; 3], direction: [f64; 3]) -> bool {
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let room = 1e-9 * (node.high[axis] - node.low[axis]).abs() + 1e-300;
        let (low, high) = (
            node.low[axis] - room - origin[axis],
            node.high[axis] + room - origin[axis],
        );
        if direction[axis] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return false;
            }
            continue;
        }
        let (a, b) = (low / direction[axis], high / direction[axis]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    near <= far
}
