//! Layers of cells on boundary faces or on a surface.

use super::{centroid, within};
use crate::mesh::mixed::{MixedMesh, Shape};
use crate::mesh::{add_scaled, cross, length, subtract};

/// Adds `layers` of cells of total height `distance` on the boundary faces whose centroid lies in the box, along the mean
/// normals of these faces at each vertex.
///
/// # Errors
/// When no boundary face lies there, the distance is 0, or the mesh is not valid.
pub fn extrude(mesh: &MixedMesh, region: [[f64; 3]; 2], distance: f64, layers: usize) -> Result<MixedMesh, String> {
    check(distance)?;
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
    let mut result = mesh.clone();
    stack(&mut result, &faces, distance, layers);
    Ok(result)
}

fn check(distance: f64) -> Result<(), String> {
    if distance == 0.0 {
        return Err("an extrusion by the distance 0 has no volume; give a distance above or below".to_string());
    }
    Ok(())
}

/// Cells on the triangles and quads of a surface whose centroid lies in the box, outward for a positive distance, inward for
/// a negative one.
///
/// # Errors
/// When no face lies there, one names a vertex that is not there, or the distance is 0.
pub fn thicken(
    points: &[[f64; 3]],
    faces: &[Vec<u32>],
    region: [[f64; 3]; 2],
    distance: f64,
    layers: usize,
) -> Result<MixedMesh, String> {
    check(distance)?;
    if let Some(face) = faces
        .iter()
        .find(|face| face.iter().any(|&corner| corner as usize >= points.len()))
    {
        return Err(format!(
            "the face {face:?} names a vertex that is not among the {}",
            points.len()
        ));
    }
    let inside = |face: &&Vec<u32>| within(centroid(points, face), region);
    let faces: Vec<Vec<u32>> = faces.iter().filter(inside).cloned().collect();
    if faces.is_empty() {
        return Err(format!(
            "no triangle or quad has its centroid between {:?} and {:?}, so there is nothing to extrude",
            region[0], region[1]
        ));
    }
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
