//! Normals at the vertices of a quadrilateral surface, estimated from the quads around them.

use crate::linalg::vector3::{add, cross, dot, subtract, times};
use crate::mesh::quadrilateral::{Connectivity, QuadrilateralMesh};

/// A normal for every vertex: the sum over its corners of `a x b / (|a|^2 |b|^2)`, with the edges `a`, `b` of the corner; for
/// points on a sphere it is exact. Source: Max 1999, Weights for computing vertex normals from facet normals.
///
/// # Errors
/// Names a vertex where the sum vanishes.
pub fn estimate(mesh: &QuadrilateralMesh, connectivity: &Connectivity) -> Result<Vec<[f64; 3]>, String> {
    let mut normals = Vec::with_capacity(mesh.points.len());
    let mut edges: Vec<[f64; 3]> = Vec::new();
    for (vertex, &here) in mesh.points.iter().enumerate() {
        edges.clear();
        edges.extend(connectivity.spokes(vertex).map(|edge| {
            let other = connectivity.other_end(edge, vertex as u32);
            subtract(mesh.points[other as usize], here)
        }));
        let mut sum = [0.0; 3];
        let mut size = 0.0;
        for corner in 0..connectivity.stars.row(vertex).len() {
            let (a, b) = (edges[corner], edges[(corner + 1) % edges.len()]);
            let squares = dot(a, a) * dot(b, b);
            sum = add(sum, times(cross(a, b), 1.0 / squares));
            size += 1.0 / squares.sqrt();
        }
        let length = dot(sum, sum).sqrt();
        if !(length > 1e-9 * size) {
            return Err(format!(
                "no normal can be estimated at vertex {vertex} (from 0): the quadrilaterals around it cancel out; give \
                 normals in the file, or move the vertex"
            ));
        }
        normals.push(times(sum, 1.0 / length));
    }
    Ok(normals)
}
