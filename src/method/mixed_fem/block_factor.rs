//! Factorization `L J L^T` of systems with a block of unknowns for every vertex, along a nested dissection of the mesh.
//!
//! The one-field system is positive definite: `J` is the identity. In a mixed system with the unknowns of a vertex kept
//! together in the order `v`, `w`, `u`, the signs of all pivots are known whatever the order of the vertices, so that no
//! pivoting is needed (see [`super::signed_system`]).

use super::factorization::Factorized;
use crate::linalg::sparse::BlockCholesky;
use crate::method::Failure;

/// A matrix with its factor.
pub(super) struct BlockFactor<const B: usize> {
    name: &'static str,
    values: Vec<f64>,
    magnitudes: Vec<f64>,
    factor: BlockCholesky<B>,
}

impl<const B: usize> BlockFactor<B> {
    /// Factorizes a matrix of the factor's structure. `Err`: the vertex of the structure where a pivot has the wrong
    /// sign.
    pub fn new(name: &'static str, mut factor: BlockCholesky<B>, values: Vec<f64>) -> Result<Self, u32> {
        factor.factorize(&values, 0.0).map_err(|error| error.vertex)?;
        let magnitudes = values.iter().map(|value| value.abs()).collect();
        Ok(Self {
            name,
            values,
            magnitudes,
            factor,
        })
    }
}

impl<const B: usize> Factorized for BlockFactor<B> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn dimension(&self) -> usize {
        self.factor.pattern().dimension()
    }

    fn matrix_entries(&self) -> usize {
        self.values.len()
    }

    fn factor_entries(&self) -> Option<usize> {
        Some(self.factor.pattern().elimination().factor_scalars())
    }

    fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let mut result = vec![0.0; x.len()];
        self.factor.pattern().multiply(&self.values, x, &mut result);
        result
    }

    fn multiply_magnitudes(&self, x: &[f64]) -> Vec<f64> {
        let mut result = vec![0.0; x.len()];
        self.factor.pattern().multiply(&self.magnitudes, x, &mut result);
        result
    }

    fn apply(&self, right: &mut [f64], count: usize) -> Result<(), Failure> {
        self.factor.solve_many_in_place(right, count);
        Ok(())
    }
}
