//! The distance of a target's crease lines to a fit: how far sharp edges are rounded off.
//!
//! Creases are the inner edges whose faces' normals differ by more than an angle, vertices in one place counted as one.
//! They are measured in the middles of parts of each edge, at least four and none longer than a five-hundredth of the
//! diagonal unless an edge is longer than eight diagonals, and at their ends: the mean is a midpoint rule over the length,
//! the largest that of these samples. Not guaranteed: that nothing between samples is farther; a distance changes by no
//! more than the way along the edge, so by a thousandth of the diagonal at most.

use super::distance;
use crate::geometry::closest_point::ClosestPoint;
use crate::mesh::surface::Surface;
use crate::mesh::{self, TriangleMesh, length, subtract};

/// Fewest and most parts of an edge.
const PARTS: [f64; 2] = [4.0, 4096.0];
/// Longest part as a share of the diagonal.
const LONGEST_PART: f64 = 1.0 / 500.0;

/// Distances in units of the meshes.
#[derive(Clone, Copy, Debug)]
pub struct CreaseDistance {
    pub max: f64,
    /// Over the length of the creases.
    pub mean: f64,
}

/// The distance to `fit` of the edges of `target` that are bent by more than `angle` degrees; none without such edges.
pub fn crease_distance(target: &TriangleMesh, fit: &TriangleMesh, angle: f64) -> Option<CreaseDistance> {
    // Soups have no connectivity: vertices in one place count as one.
    let welded = Surface::welded(target);
    let edges = welded.edges();
    // Boundaries are edges of the data, not of the shape.
    let inner = |ends: &[u32; 2]| {
        edges
            .binary_search_by_key(ends, |edge| edge.ends)
            .is_ok_and(|edge| edges[edge].faces.len() == 2)
    };
    let creases: Vec<[u32; 2]> = welded.creases(angle).into_iter().filter(inner).collect();
    if creases.is_empty() {
        return None;
    }
    let longest_part = LONGEST_PART * mesh::diagonal(&welded.points);
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for &ends in &creases {
        let [a, b] = ends.map(|end| welded.points[end as usize]);
        let extent = length(subtract(b, a));
        let parts = (extent / longest_part).ceil().clamp(PARTS[0], PARTS[1]) as usize;
        for part in 0..parts {
            let t = (part as f64 + 0.5) / parts as f64;
            points.push(std::array::from_fn(|axis| a[axis] + t * (b[axis] - a[axis])));
            weights.push(extent / parts as f64);
        }
        points.extend([a, b]);
        weights.extend([0.0; 2]);
    }
    let distances = distance::of_points(&points, &ClosestPoint::new(fit));
    let total: f64 = weights.iter().sum();
    Some(CreaseDistance {
        max: distances.iter().copied().fold(0.0, f64::max),
        mean: distances.iter().zip(&weights).map(|(d, w)| d * w).sum::<f64>() / total,
    })
}
