//! Which vertices of a surface are fixed, moved or free.

use super::model::Model;
use super::settings::{Handle, Role, Select};
use crate::linalg::sparse::Graph;
use crate::mesh::{self, TriangleMesh, bounding_box, diagonal, dot, length, subtract};
use crate::method::Failure;
use nalgebra::{Rotation3, Vector3};

/// What the handles say of every vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct Roles {
    pub free: Vec<bool>,
    /// Where a vertex goes, less where it is.
    pub motion: Vec<[f64; 3]>,
}

/// The boundary loops of a manifold, each as its vertices in the order of the triangles' edges, the longest first; of two
/// equally long ones that with the smaller first vertex.
pub fn boundary_loops(mesh: &TriangleMesh) -> Vec<Vec<u32>> {
    let facets = mesh::connectivity::facets(&mesh.cells, mesh.points.len());
    let mut next = vec![u32::MAX; mesh.points.len()];
    for (cell, neighbours) in mesh.cells.iter().zip(&facets.neighbours) {
        for (corner, &neighbour) in neighbours.iter().enumerate() {
            if neighbour == mesh::connectivity::NONE {
                next[cell[(corner + 1) % 3] as usize] = cell[(corner + 2) % 3];
            }
        }
    }
    let mut loops: Vec<(f64, Vec<u32>)> = Vec::new();
    for start in 0..next.len() {
        let mut vertices = Vec::new();
        let mut size = 0.0;
        let mut vertex = start;
        while next[vertex] != u32::MAX {
            vertices.push(vertex as u32);
            let follower = std::mem::replace(&mut next[vertex], u32::MAX) as usize;
            size += length(subtract(mesh.points[follower], mesh.points[vertex]));
            vertex = follower;
        }
        if !vertices.is_empty() {
            loops.push((size, vertices));
        }
    }
    loops.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1[0].cmp(&b.1[0])));
    loops.into_iter().map(|(_, vertices)| vertices).collect()
}

/// Applies the handles in order to vertices that start as `free` says.
///
/// # Errors
/// Names the handle that selects nothing, or a loop or a selection that is not there.
pub fn resolve(model: &Model, handles: &[Handle], mut free: Vec<bool>) -> Result<Roles, Failure> {
    let mesh = &model.mesh;
    let vertices = mesh.points.len();
    let mut motion = vec![[0.0; 3]; vertices];
    let size = diagonal(&mesh.points);
    let corners = bounding_box(&mesh.points).unwrap_or_default();
    let loops = boundary_loops(mesh);
    let graph = Graph::of_cells(vertices, &mesh.cells, Some);
    for (index, handle) in handles.iter().enumerate() {
        let place = |point: Option<[f64; 3]>| -> [f64; 3] {
            let point = point.unwrap_or_default();
            if !handle.relative {
                return point;
            }
            std::array::from_fn(|axis| corners[0][axis] + point[axis] * (corners[1][axis] - corners[0][axis]))
        };
        let unit = if handle.relative { size } else { 1.0 };
        let mut selected: Vec<bool> = match handle.select {
            Select::All => vec![true; vertices],
            Select::Box => {
                let (low, high) = (place(handle.min), place(handle.max));
                let within = |point: &[f64; 3]| (0..3).all(|axis| (low[axis]..=high[axis]).contains(&point[axis]));
                mesh.points.iter().map(within).collect()
            }
            Select::Sphere => {
                let (center, radius) = (place(handle.center), handle.radius.unwrap_or_default() * unit);
                let within = |point: &[f64; 3]| length(subtract(*point, center)) <= radius;
                mesh.points.iter().map(within).collect()
            }
            Select::Plane => {
                let (center, normal) = (place(handle.center), handle.normal.unwrap_or_default());
                if length(normal) == 0.0 {
                    return Err(Failure::invalid(format!(
                        "handle {index} (from 0): the plane's normal is zero"
                    )));
                }
                let above = |point: &[f64; 3]| dot(subtract(*point, center), normal) >= 0.0;
                mesh.points.iter().map(above).collect()
            }
            Select::Nearest => {
                let center = place(handle.center);
                let distance = |vertex: &usize| length(subtract(mesh.points[*vertex], center));
                let nearest = (0..vertices).min_by(|a, b| distance(a).total_cmp(&distance(b)));
                (0..vertices).map(|vertex| Some(vertex) == nearest).collect()
            }
            Select::Boundary => {
                let mut on = vec![false; vertices];
                loops.iter().flatten().for_each(|&vertex| on[vertex as usize] = true);
                on
            }
            Select::Loop => {
                let wanted = loops.get(handle.boundary_loop as usize).ok_or_else(|| {
                    Failure::invalid(format!(
                        "handle {index} (from 0): there is no boundary loop {} (from 0); the mesh has {}",
                        handle.boundary_loop,
                        loops.len()
                    ))
                })?;
                let mut on = vec![false; vertices];
                wanted.iter().for_each(|&vertex| on[vertex as usize] = true);
                on
            }
            Select::File => {
                let numbers = model.selection.as_ref().ok_or_else(|| {
                    Failure::invalid(format!(
                        "handle {index} (from 0): the model has no `selection`; give it a file with a number for every vertex"
                    ))
                })?;
                // A patch has no numbers.
                (0..vertices)
                    .map(|vertex| numbers.get(vertex) == Some(&handle.value))
                    .collect()
            }
        };
        for _ in 0..handle.rings {
            let before = selected.clone();
            for vertex in 0..vertices {
                let near = graph
                    .neighbours(vertex as u32)
                    .iter()
                    .any(|&other| before[other as usize]);
                selected[vertex] |= near;
            }
        }
        let chosen: Vec<usize> = (0..vertices).filter(|&vertex| selected[vertex]).collect();
        if chosen.is_empty() {
            return Err(Failure::invalid(format!(
                "handle {index} (from 0) selects no vertex; the mesh's box is from {:?} to {:?}",
                corners[0], corners[1]
            )));
        }
        let mut centroid = Vector3::zeros();
        for &vertex in &chosen {
            centroid += Vector3::from(mesh.points[vertex]) / chosen.len() as f64;
        }
        let turn = Vector3::from(handle.turn.unwrap_or_default()).map(f64::to_radians);
        let rotation = Rotation3::from_scaled_axis(turn);
        let shift = Vector3::from(handle.translate.unwrap_or_default()) * unit;
        for &vertex in &chosen {
            free[vertex] = handle.role == Role::Free;
            motion[vertex] = [0.0; 3];
            if handle.role == Role::Moved {
                let offset = Vector3::from(mesh.points[vertex]) - centroid;
                motion[vertex] = (rotation * offset * handle.stretch - offset + shift).into();
            }
        }
    }
    Ok(Roles { free, motion })
}
