//! Patches for holes: triangles of about the mesh's edge length over a loop of boundary edges.
//!
//! The loop is laid around a circle by arc length and the disk triangulated; the new vertices then take the harmonic
//! extension of the loop's places, a surface like a soap film. It only serves as the domain of the problem to be solved.

use super::handles::boundary_loops;
use super::model::Model;
use crate::linalg::sparse::{BlockCholesky, BlockPattern, FIXED};
use crate::mesh::planar::fill_polygon;
use crate::mesh::{TriangleMesh, cross, dot, length, subtract};
use crate::method::Failure;
use std::f64::consts::TAU;

/// Fills the longest loop or all of them; the patches become the model's domain.
///
/// # Errors
/// When there is no hole, or a patch cannot be made.
pub fn fill(model: &mut Model, all: bool) -> Result<(), Failure> {
    let mut loops = boundary_loops(&model.mesh);
    if loops.is_empty() {
        return Err(Failure::invalid(
            "the mesh has no boundary, so there is no hole to fill; use fill = \"none\"",
        ));
    }
    if !all {
        loops.truncate(1);
    }
    let mut inside = vec![false; model.mesh.cells.len()];
    let mut free = vec![false; model.mesh.points.len()];
    for vertices in &loops {
        let before = (model.mesh.points.len(), model.mesh.cells.len());
        patch(&mut model.mesh, vertices)?;
        inside.resize(model.mesh.cells.len(), true);
        free.resize(model.mesh.points.len(), true);
        model.notices.push(format!(
            "a hole with {} edges filled with {} triangles and {} vertices",
            vertices.len(),
            model.mesh.cells.len() - before.1,
            model.mesh.points.len() - before.0
        ));
    }
    model.inside = Some(inside);
    model.free = Some(free);
    Ok(())
}

fn patch(mesh: &mut TriangleMesh, boundary: &[u32]) -> Result<(), Failure> {
    // Against the direction of the mesh's own triangles.
    let rim: Vec<u32> = boundary.iter().rev().copied().collect();
    let places: Vec<[f64; 3]> = rim.iter().map(|&vertex| mesh.points[vertex as usize]).collect();
    let count = rim.len();
    let sides: Vec<f64> = (0..count)
        .map(|side| length(subtract(places[(side + 1) % count], places[side])))
        .collect();
    let perimeter: f64 = sides.iter().sum();
    if count < 3 || !(perimeter > 0.0) {
        return Err(Failure::invalid(format!("a hole with {count} edges cannot be filled")));
    }
    let radius = perimeter / TAU;
    let mut along = 0.0;
    let polygon: Vec<[f64; 2]> = sides
        .iter()
        .map(|side| {
            let angle = TAU * along / perimeter;
            along += side;
            [radius * angle.cos(), radius * angle.sin()]
        })
        .collect();
    let flat = fill_polygon(&polygon, perimeter / count as f64)
        .map_err(|reason| Failure::invalid(format!("the hole at vertex {} (counted from 0): {reason}", rim[0])))?;
    if flat.points.len() < count {
        return Err(Failure::invalid(format!(
            "the hole at vertex {} (counted from 0) degenerates",
            rim[0]
        )));
    }
    let lifted = extend(&flat, &places)?;
    let first = mesh.points.len();
    mesh.points.extend_from_slice(&lifted[count..]);
    mesh.cells.extend(flat.cells.iter().map(|cell| {
        cell.map(|vertex| match rim.get(vertex as usize) {
            Some(&name) => name,
            None => (first + vertex as usize - count) as u32,
        })
    }));
    Ok(())
}

/// Harmonic extension of the places of the first vertices to the others.
fn extend(flat: &TriangleMesh, places: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, Failure> {
    let failure = |error: String| Failure::invalid(format!("a patch has no harmonic extension: {error}"));
    let free: Vec<bool> = (0..flat.points.len()).map(|vertex| vertex >= places.len()).collect();
    let mut all = places.to_vec();
    all.resize(flat.points.len(), [0.0; 3]);
    let pattern =
        BlockPattern::<1>::new(&flat.points, &flat.cells, &free).map_err(|error| failure(error.to_string()))?;
    let unknowns = pattern.dimension();
    if unknowns == 0 {
        return Ok(all);
    }
    let mut parts = Vec::with_capacity(pattern.parts_len());
    let mut right = vec![0.0; 3 * unknowns];
    for &cell in &flat.cells {
        let corners = flat.corners(cell);
        let edges: [[f64; 3]; 3] = std::array::from_fn(|i| subtract(corners[(i + 2) % 3], corners[(i + 1) % 3]));
        let doubled = length(cross(edges[0], edges[1]));
        for a in 0..3 {
            for b in a..3 {
                let entry = dot(edges[a], edges[b]) / (2.0 * doubled);
                parts.push(entry);
                for (row, column) in [(a, b), (b, a)] {
                    let (unknown, known) = (pattern.free_index()[cell[row] as usize], cell[column] as usize);
                    if unknown != FIXED && !free[known] {
                        for axis in 0..3 {
                            right[axis * unknowns + unknown as usize] -= entry * all[known][axis];
                        }
                    }
                }
            }
        }
    }
    let mut matrix = vec![0.0; pattern.values_len()];
    pattern.assemble(&parts, &mut matrix);
    let mut cholesky = BlockCholesky::new(pattern);
    cholesky
        .factorize(&matrix, 0.0)
        .map_err(|error| failure(error.to_string()))?;
    cholesky.solve_many_in_place(&mut right, 3);
    for (unknown, &vertex) in cholesky.pattern().vertices().iter().enumerate() {
        all[vertex as usize] = std::array::from_fn(|axis| right[axis * unknowns + unknown]);
    }
    Ok(all)
}
