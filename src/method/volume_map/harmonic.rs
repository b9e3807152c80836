//! Harmonic extension of boundary values into the interior of a tetrahedral mesh.
//!
//! Piecewise linear elements: the interior values minimize the Dirichlet energy under the given boundary values, one
//! sparse Cholesky factorization for all components. The result of three components is the minimizer of the energy
//! `dirichlet` with volume weighting. Not guaranteed: a map without inversions; in three dimensions harmonic maps onto
//! convex targets fold.

use crate::linalg::sparse::{BlockCholesky, BlockPattern, FIXED};
use crate::mesh::{self, TetrahedralMesh};
use crate::method::Failure;
use rayon::prelude::*;

/// Stiffness of one tetrahedron for its four vertices.
type Stiffness = [[f64; 4]; 4];

/// Interior values that minimize the Dirichlet energy; `values` holds the boundary's and receives the interior's.
pub fn extend<const C: usize>(
    source: &TetrahedralMesh,
    on_boundary: &[bool],
    values: &mut [[f64; C]],
) -> Result<(), Failure> {
    let stiffness = |cell: &[u32; 4]| {
        let corners = source.corners(*cell);
        let six_volumes = mesh::determinant(corners);
        // Area vectors of the faces are the gradients of the barycentric coordinates times the determinant.
        let opposite = |face: [usize; 3]| mesh::area_vector(face.map(|corner| corners[corner]));
        let gradients = [
            opposite([1, 3, 2]),
            opposite([0, 2, 3]),
            opposite([0, 3, 1]),
            opposite([0, 1, 2]),
        ];
        std::array::from_fn(|a| std::array::from_fn(|b| mesh::dot(gradients[a], gradients[b]) / (6.0 * six_volumes)))
    };
    solve(source, on_boundary, values, stiffness)
}

/// The same over the graph of the edges, every tetrahedron counting each of its edges once: a smooth interpolation that
/// keeps within the range of the boundary values.
pub fn extend_over_graph<const C: usize>(
    source: &TetrahedralMesh,
    on_boundary: &[bool],
    values: &mut [[f64; C]],
) -> Result<(), Failure> {
    let stiffness = |_: &[u32; 4]| std::array::from_fn(|a| std::array::from_fn(|b| if a == b { 3.0 } else { -1.0 }));
    solve(source, on_boundary, values, stiffness)
}

fn solve<const C: usize>(
    source: &TetrahedralMesh,
    on_boundary: &[bool],
    values: &mut [[f64; C]],
    stiffness: impl Fn(&[u32; 4]) -> Stiffness + Sync,
) -> Result<(), Failure> {
    let free: Vec<bool> = on_boundary.iter().map(|&fixed| !fixed).collect();
    let pattern = BlockPattern::<1>::new(&source.points, &source.cells, &free)
        .map_err(|error| Failure::invalid(format!("the source mesh gives no linear system: {error}")))?;
    let unknowns = pattern.dimension();
    if unknowns == 0 {
        return Ok(());
    }
    let mut parts = vec![0.0; pattern.parts_len()];
    parts.par_chunks_mut(10).zip(&source.cells).for_each(|(parts, cell)| {
        let stiffness = stiffness(cell);
        let mut part = parts.iter_mut();
        for a in 0..4 {
            for (b, part) in (a..4).zip(part.by_ref()) {
                *part = stiffness[a][b];
            }
        }
    });
    let mut matrix = vec![0.0; pattern.values_len()];
    pattern.assemble(&parts, &mut matrix);

    let mut right = vec![0.0; C * unknowns];
    for (cell, parts) in source.cells.iter().zip(parts.chunks_exact(10)) {
        let mut part = parts.iter();
        for a in 0..4 {
            for (b, &entry) in (a..4).zip(part.by_ref()) {
                let row = pattern.free_index()[cell[a] as usize];
                let column = pattern.free_index()[cell[b] as usize];
                for (free, fixed) in [(row, cell[b]), (column, cell[a])] {
                    if free != FIXED && on_boundary[fixed as usize] {
                        for component in 0..C {
                            right[component * unknowns + free as usize] -= entry * values[fixed as usize][component];
                        }
                    }
                }
            }
        }
    }
    let mut cholesky = BlockCholesky::new(pattern);
    cholesky.factorize(&matrix, 0.0).map_err(|error| {
        Failure::invalid(format!(
            "the interior has no harmonic extension ({error}); every part of the mesh needs a boundary and tetrahedra \
             of positive volume"
        ))
    })?;
    cholesky.solve_many_in_place(&mut right, C);
    for (free, &vertex) in cholesky.pattern().vertices().iter().enumerate() {
        values[vertex as usize] = std::array::from_fn(|component| right[component * unknowns + free]);
    }
    Ok(())
}
