//! `L U` factorization of a mixed system with partial pivoting.

use super::factorization::{Factorized, singular, too_large};
use super::mixed_system::LowerMatrix;
use crate::method::Failure;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par};

/// A matrix with its factors.
pub(super) struct Lu {
    matrix: LowerMatrix,
    symbolic: SymbolicLu<usize>,
    numeric: NumericLu<usize, f64>,
}

impl Lu {
    /// Factorizes, columns ordered by minimum degree.
    ///
    /// # Errors
    /// When the matrix is singular in structure or memory runs out.
    pub fn new(matrix: LowerMatrix) -> Result<Self, Failure> {
        let dimension = matrix.dimension();
        // Both triangles: rows above the diagonal of a column come first and ascend, because columns do.
        let mut above = vec![0usize; dimension + 1];
        for column in 0..dimension {
            for &row in &matrix.rows[matrix.offsets[column] + 1..matrix.offsets[column + 1]] {
                above[row + 1] += 1;
            }
        }
        let mut offsets = vec![0usize; dimension + 1];
        for column in 0..dimension {
            let below = matrix.offsets[column + 1] - matrix.offsets[column];
            offsets[column + 1] = offsets[column] + above[column + 1] + below;
        }
        let mut next = offsets.clone();
        let mut rows = vec![0usize; offsets[dimension]];
        let mut values = vec![0.0; offsets[dimension]];
        for column in 0..dimension {
            for place in matrix.offsets[column] + 1..matrix.offsets[column + 1] {
                let target = &mut next[matrix.rows[place]];
                rows[*target] = column;
                values[*target] = matrix.values[place];
                *target += 1;
            }
        }
        for column in 0..dimension {
            let range = matrix.offsets[column]..matrix.offsets[column + 1];
            let start = next[column];
            rows[start..start + range.len()].copy_from_slice(&matrix.rows[range.clone()]);
            values[start..start + range.len()].copy_from_slice(&matrix.values[range]);
        }
        let structure = SymbolicSparseColMatRef::new_checked(dimension, dimension, &offsets, None, &rows);
        let symbolic = factorize_symbolic_lu(structure, Default::default())
            .map_err(|_| too_large("the structure of the factor"))?;
        let mut numeric = NumericLu::new();
        let scratch = symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large("the factorization"))?;
        symbolic
            .factorize_numeric_lu(
                &mut numeric,
                SparseColMatRef::new(structure, &values),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|error| {
                singular(format!(
                    "the LU factorization broke down ({error:?}): the system is singular"
                ))
            })?;
        Ok(Self {
            matrix,
            symbolic,
            numeric,
        })
    }
}

impl Factorized for Lu {
    fn name(&self) -> &'static str {
        "lu"
    }

    fn dimension(&self) -> usize {
        self.matrix.dimension()
    }

    fn matrix_entries(&self) -> usize {
        self.matrix.values.len()
    }

    fn factor_entries(&self) -> Option<usize> {
        None
    }

    fn multiply(&self, x: &[f64]) -> Vec<f64> {
        self.matrix.multiply(x)
    }

    fn multiply_magnitudes(&self, x: &[f64]) -> Vec<f64> {
        self.matrix.multiply_magnitudes(x)
    }

    fn apply(&self, right: &mut [f64], count: usize) -> Result<(), Failure> {
        let dimension = self.dimension();
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq);
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large("the solution"))?;
        LuRef::new_unchecked(&self.symbolic, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(right, dimension, count),
            Par::Seq,
            MemStack::new(&mut memory),
        );
        Ok(())
    }
}
