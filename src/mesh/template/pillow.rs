//! A layer of cells around the whole boundary, which takes singular edges off the surface (Mitchell and Tautges 1995).

use super::{centroid, check_count};
use crate::mesh::mixed::{MixedMesh, Shape};

/// Every boundary face gets a cell: the old boundary vertices move inward by `thickness` of the way to the mean of their
/// cells, new vertices take their places.
///
/// # Errors
/// When the mesh is not valid, or the result would have too many cells.
pub fn pillow(mesh: &MixedMesh, thickness: f64) -> Result<MixedMesh, String> {
    let topology = mesh.topology()?;
    check_count(
        mesh.cells() + topology.boundary().count(),
        "pillow a coarser template, or fewer times",
    )?;
    let vertices = mesh.points.len();
    let mut outer = vec![u32::MAX; vertices];
    let mut result = mesh.clone();
    for (_, face) in topology.boundary() {
        for &corner in face.corners() {
            if outer[corner as usize] == u32::MAX {
                outer[corner as usize] = result.points.len() as u32;
                result.points.push(mesh.points[corner as usize]);
            }
        }
    }
    let mut sums = vec![([0.0; 3], 0.0); vertices];
    for (_, corners) in mesh.iter() {
        let middle = centroid(&mesh.points, corners);
        for &corner in corners {
            let (sum, count) = &mut sums[corner as usize];
            *count += 1.0;
            for axis in 0..3 {
                sum[axis] += middle[axis];
            }
        }
    }
    for vertex in 0..vertices {
        if outer[vertex] != u32::MAX {
            let (sum, count) = sums[vertex];
            for axis in 0..3 {
                let point = &mut result.points[vertex][axis];
                *point += thickness * (sum[axis] / count - *point);
            }
        }
    }
    for (_, face) in topology.boundary() {
        // Counter-clockwise seen from outside is the bottom's sense: inner corners below, new ones on top.
        let inner = face.corners();
        let mut corners = inner.to_vec();
        corners.extend(inner.iter().map(|&corner| outer[corner as usize]));
        let shape = if inner.len() == 4 {
            Shape::Hexahedron
        } else {
            Shape::Prism
        };
        result.push(shape, &corners);
    }
    Ok(result)
}
