//! Normals at the vertices of a quadrilateral surface, estimated from the quads around them.

use crate::linalg::vector3::{add, cross, dot, subtract, times};
use crate::mesh::quadrilateral::{Connectivity, QuadrilateralMesh, quad_and_corner};

/// A normal for every vertex: the sum of the unit normals of the quads around it (those of the plane of both diagonals),
/// weighted by their angles at the vertex. Source: Thürmer and Wüthrich 1998, Computing vertex normals from polygonal
/// facets.
///
/// # Errors
/// Names a vertex where the sum vanishes.
pub fn estimate(mesh: &QuadrilateralMesh, connectivity: &Connectivity) -> Result<Vec<[f64; 3]>, String> {
    let mut normals = Vec::with_capacity(mesh.points.len());
    let faces: Vec<[f64; 3]> = mesh
        .quads
        .iter()
        .map(|&quad| {
            let corners = mesh.corners(quad);
            let face = cross(subtract(corners[2], corners[0]), subtract(corners[3], corners[1]));
            times(face, 1.0 / dot(face, face).sqrt().max(f64::MIN_POSITIVE))
        })
        .collect();
    for (vertex, &here) in mesh.points.iter().enumerate() {
        let mut sum = [0.0; 3];
        let mut size = 0.0;
        for &corner in connectivity.stars.row(vertex) {
            let (quad, place) = quad_and_corner(corner);
            let corners = mesh.corners(mesh.quads[quad]);
            let (a, b) = (
                subtract(corners[(place + 1) % 4], here),
                subtract(corners[(place + 3) % 4], here),
            );
            let normal = cross(a, b);
            let angle = dot(normal, normal).sqrt().atan2(dot(a, b));
            sum = add(sum, times(faces[quad], angle));
            size += angle;
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
