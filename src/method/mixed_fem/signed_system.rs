//! The mixed system with a block of unknowns for every vertex, whose pivots have signs that are known beforehand.
//!
//! Within a vertex the unknowns stand in the order `v`, `w`, `u`, and where a field is known its place holds an
//! equation of its own that keeps it zero. Take the leading part of the matrix up to any unknown, whatever the order
//! of the vertices. Of order 2 it is `[-M, L; L^T, 0]`: `M` is positive, and every vertex with `u` has its `v`, so `L`
//! has full column rank, because a Laplacian on part of a mesh is definite. There are as many negative eigenvalues as
//! `v` and positive ones as `u`. Of order 3 `L` in the rows of `v` is negative, what is left for `w` is `S + M (-L)^-1
//! M`, positive, and then `u` is negative. One more unknown adds one eigenvalue of its sign, so every pivot has that
//! sign, and `L J L^T` with the signs in `J` exists without pivoting. There are two exceptions, of which the
//! factorization tells. The unstabilised curve conditions of order 3 leave `w` on the boundary without a diagonal. And
//! on a closed surface with a single fixed point `v` is unknown everywhere, so that `L` is only semidefinite: if that
//! point comes last, its `v` meets a zero pivot.
//!
//! Guaranteed: existence in exact arithmetic under these conditions. Not guaranteed: an error as small as with
//! pivoting; the residual tells, and refinement halves it as long as it can.

use super::mixed_system::{NONE, Numbering, coefficients, vertex_graph};
use super::scheme::Discretization;
use crate::linalg::sparse::{BlockCholesky, BlockPattern, geometric_dissection};

/// Structure and matrix, with two unknowns a vertex for order 2 and three for order 3.
pub enum SignedSystem {
    Two(Box<BlockCholesky<2>>, Vec<f64>),
    Three(Box<BlockCholesky<3>>, Vec<f64>),
}

impl SignedSystem {
    /// Assembles the matrix.
    pub fn new(discretization: &Discretization<'_>) -> (Self, Numbering) {
        if discretization.order == 2 {
            let (factor, values, numbering) = assemble(discretization, [-1.0, 1.0]);
            (Self::Two(factor, values), numbering)
        } else {
            let (factor, values, numbering) = assemble(discretization, [-1.0, 1.0, -1.0]);
            (Self::Three(factor, values), numbering)
        }
    }
}

fn assemble<const B: usize>(
    discretization: &Discretization<'_>,
    signs: [f64; B],
) -> (Box<BlockCholesky<B>>, Vec<f64>, Numbering) {
    let (with, graph, points) = vertex_graph(discretization);
    let numbering = Numbering::in_blocks(discretization, &with);
    let pattern = BlockPattern::<B>::of_graph(&graph, &geometric_dissection(&graph, &points));
    let mut values = vec![0.0; pattern.values_len()];
    let mut place = vec![NONE; discretization.domain.places.len()];
    for (index, &vertex) in with.iter().enumerate() {
        place[vertex as usize] = index as u32;
    }
    for (row, &vertex) in with.iter().enumerate() {
        let own = numbering.unknowns(vertex);
        let known = (B * row..B * (row + 1)).filter(|&unknown| !own.contains(&(unknown as u32)));
        let diagonal = pattern.block(row, row).map_or(0, |(start, _)| start);
        for unknown in known {
            let slot = unknown - B * row;
            values[diagonal + slot * (B + 1)] = signs[slot];
        }
        let mut target = (NONE, None);
        coefficients(discretization, vertex, |field, other, column, value| {
            let index = numbering.unknowns(other as u32)[column];
            if own[field] == NONE || index == NONE {
                return;
            }
            if target.0 != place[other] {
                let block = pattern.block(row, place[other] as usize);
                // Each block is stored once: the other vertex's rows hold the same numbers.
                target = (place[other], block.filter(|&(_, exchanged)| !exchanged));
            }
            if let Some((start, _)) = target.1 {
                let (r, c) = (own[field] as usize - B * row, index as usize % B);
                values[start + r * B + c] += numbering.scale[field] * value * numbering.scale[column];
            }
        });
    }
    (Box::new(BlockCholesky::with_signs(pattern, signs)), values, numbering)
}
