//! Layers of cells on boundary faces or on a surface.

use super::{centroid, check_count, within};
use crate::mesh::mixed::{MixedMesh, Shape};
use crate::mesh::{add_scaled, cross, diagonal, length, subtract};

/// Adds `layers` of cells of total height `distance` on the boundary faces whose centroid lies in the box, along the mean
/// normals of these faces at each vertex.
///
/// # Errors
/// When no boundary face lies there, a layer is too thin to have a volume, there are too many cells, or the mesh is not valid.
pub fn extrude(mesh: &MixedMesh, region: [[f64; 3]; 2], distance: f64, layers: usize) -> Result<MixedMesh, String> {
    let topology = mesh.topology()?;
    let faces: Vec<Vec<u32>> = topology
        .boundary()
        .map(|(_, face)| face.corners().to_vec())
        .filter(|corners| within(centroid(&mesh.points, corners), region))
        .collect();
    if faces.is_empty() {
        return Err(format!(
            "no boundary face has its centroid between {:?} and {:?}, so there is nothing to extrude",
            region[0], region[1]
        ));
    }
    check(&mesh.points, mesh.cells(), faces.len(), distance, layers)?;
    let mut result = mesh.clone();
    stack(&mut result, &faces, distance, layers);
    Ok(result)
}

/// Whether every layer has a height that rounding leaves, and there are not too many cells.
fn check(points: &[[f64; 3]], cells: usize, faces: usize, distance: f64, layers: usize) -> Result<(), String> {
    let least = 1e-9 * diagonal(points);
    let height = distance.abs() / layers as f64;
    if height <= least {
        return Err(format!(
            "an extrusion by the distance {distance} in {layers} layers has no volume beside a mesh of that size; give layers \
             of more than {least:e}"
        ));
    }
    check_count(
        cells.saturating_add(faces.saturating_mul(layers)),
        "lower `layers`, or narrow the box",
    )
}

/// Cells on the triangles and quads of a surface whose centroid lies in the box, outward for a positive distance, inward for
/// a negative one.
///
/// # Errors
/// When no face lies there, one names a vertex that is not there or one twice, a layer is too thin to have a volume, or there
/// are too many cells.
pub fn thicken(
    points: &[[f64; 3]],
    faces: &[Vec<u32>],
    region: [[f64; 3]; 2],
    distance: f64,
    layers: usize,
) -> Result<MixedMesh, String> {
    for face in faces {
        if face.iter().any(|&corner| corner as usize >= points.len()) {
            return Err(format!(
                "the face {face:?} names a vertex that is not among the {}",
                points.len()
            ));
        }
        if (1..face.len()).any(|place| face[..place].contains(&face[place])) {
            return Err(format!("the face {face:?} (vertices from 0) names a vertex twice"));
        }
    }
    let mut sides = std::collections::HashMap::new();
    for (index, face) in faces.iter().enumerate() {
        for (place, &corner) in face.iter().enumerate() {
            let next = face[(place + 1) % face.len()];
            if let Some(other) = sides.insert((corner, next), index) {
                return Err(format!(
                    "the faces {:?} and {face:?} (vertices from 0) both run from vertex {corner} to {next}, so they look to \
                     opposite sides; turn one over",
                    faces[other]
                ));
            }
        }
    }
    let inside = |face: &&Vec<u32>| within(centroid(points, face), region);
    let faces: Vec<Vec<u32>> = faces.iter().filter(inside).cloned().collect();
    if faces.is_empty() {
        return Err(format!(
            "no triangle or quad has its centroid between {:?} and {:?}, so there is nothing to extrude",
            region[0], region[1]
        ));
    }
    check(points, 0, faces.len(), distance, layers)?;
    let mut result = MixedMesh {
        points: points.to_vec(),
        ..MixedMesh::default()
    };
    stack(&mut result, &faces, distance, layers);
    result.drop_unused_points();
    Ok(result)
}

/// Cells over `faces`, whose corners run counter-clockwise seen from where a positive distance leads.
fn stack(mesh: &mut MixedMesh, faces: &[Vec<u32>], distance: f64, layers: usize) {
    let mut normals = std::collections::BTreeMap::<u32, [f64; 3]>::new();
    for corners in faces {
        let count = corners.len();
        for place in 0..count {
            let at = |step: usize| mesh.points[corners[(place + step) % count] as usize];
            let (here, next, last) = (at(0), at(1), at(count - 1));
            let normal = cross(subtract(next, here), subtract(last, here));
            let size = length(normal).max(f64::MIN_POSITIVE);
            let sum = normals.entry(corners[place]).or_default();
            *sum = add_scaled(*sum, normal, 1.0 / size);
        }
    }
    let step = distance / layers as f64;
    let mut level: std::collections::BTreeMap<u32, u32> = normals.keys().map(|&vertex| (vertex, vertex)).collect();
    for _ in 0..layers {
        let mut above = std::collections::BTreeMap::new();
        for (&vertex, &below) in &level {
            let normal = normals[&vertex];
            let size = length(normal).max(f64::MIN_POSITIVE);
            above.insert(vertex, mesh.points.len() as u32);
            mesh.points
                .push(add_scaled(mesh.points[below as usize], normal, step / size));
        }
        for corners in faces {
            let lower = corners.iter().map(|corner| level[corner]);
            let upper = corners.iter().map(|corner| above[corner]);
            let cell: Vec<u32> = if step > 0.0 {
                lower.chain(upper).collect()
            } else {
                upper.chain(lower).collect()
            };
            let shape = if corners.len() == 4 {
                Shape::Hexahedron
            } else {
                Shape::Prism
            };
            mesh.push(shape, &cell);
        }
        level = above;
    }
}
