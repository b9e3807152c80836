//! `L B L^T` factorization of a mixed system with Bunch-Kaufman pivots within the supernodes of its own order.

use super::factorization::{Factorized, too_large};
use super::mixed_system::LowerMatrix;
use crate::method::Failure;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, IntranodeLbltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// A matrix with its factor. A factor that is not finite shows in the solution's residual.
pub(super) struct Lblt {
    matrix: LowerMatrix,
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    subdiagonal: Vec<f64>,
    forward: Vec<usize>,
    inverse: Vec<usize>,
}

/// The structure of a mixed system, analysed once.
pub struct Analysis(SymbolicCholesky<usize>);

/// Analyses the `L B L^T` factorization of a matrix in its own order.
///
/// # Errors
/// When memory runs out.
pub fn analyse(matrix: &LowerMatrix) -> Result<Analysis, Failure> {
    let dimension = matrix.dimension();
    // The analysis reads the upper triangle by columns, which is the lower one by rows.
    let mut offsets = vec![0usize; dimension + 1];
    for &row in &matrix.rows {
        offsets[row + 1] += 1;
    }
    for row in 0..dimension {
        offsets[row + 1] += offsets[row];
    }
    let mut next = offsets.clone();
    let mut columns = vec![0usize; matrix.rows.len()];
    for column in 0..dimension {
        for &row in &matrix.rows[matrix.offsets[column]..matrix.offsets[column + 1]] {
            columns[next[row]] = column;
            next[row] += 1;
        }
    }
    let symbolic = SymbolicSparseColMatRef::new_checked(dimension, dimension, &offsets, None, &columns);
    let parameters = CholeskySymbolicParams {
        // Without supernodes there is no pivoting.
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
        ..Default::default()
    };
    factorize_symbolic_cholesky(symbolic, Side::Upper, SymmetricOrdering::Identity, parameters)
        .map(Analysis)
        .map_err(|_| too_large("the structure of the factor"))
}

impl Lblt {
    /// Factorizes a matrix of the analysed structure.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn new(matrix: LowerMatrix, Analysis(symbolic): Analysis) -> Result<Self, Failure> {
        let dimension = matrix.dimension();
        let mut factor = Lblt {
            values: vec![0.0; symbolic.len_val()],
            subdiagonal: vec![0.0; dimension],
            forward: vec![0; dimension],
            inverse: vec![0; dimension],
            symbolic,
            matrix,
        };
        let scratch = factor
            .symbolic
            .factorize_numeric_intranode_lblt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large("the factorization"))?;
        let structure = SymbolicSparseColMatRef::new_checked(
            dimension,
            dimension,
            &factor.matrix.offsets,
            None,
            &factor.matrix.rows,
        );
        factor.symbolic.factorize_numeric_intranode_lblt(
            &mut factor.values,
            &mut factor.subdiagonal,
            &mut factor.forward,
            &mut factor.inverse,
            SparseColMatRef::new(structure, &factor.matrix.values),
            Side::Lower,
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        Ok(factor)
    }
}

impl Factorized for Lblt {
    fn name(&self) -> &'static str {
        "lblt"
    }

    fn dimension(&self) -> usize {
        self.matrix.dimension()
    }

    fn matrix_entries(&self) -> usize {
        self.matrix.values.len()
    }

    fn factor_entries(&self) -> Option<usize> {
        Some(self.values.len())
    }

    fn multiply(&self, x: &[f64]) -> Vec<f64> {
        self.matrix.multiply(x)
    }

    fn multiply_magnitudes(&self, x: &[f64]) -> Vec<f64> {
        self.matrix.multiply_magnitudes(x)
    }

    fn apply(&self, right: &mut [f64], count: usize) -> Result<(), Failure> {
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq);
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large("the solution"))?;
        // Sound: the factorization filled both with a permutation and its inverse.
        let permutation = PermRef::new_checked(&self.forward, &self.inverse, self.dimension());
        IntranodeLbltRef::new(&self.symbolic, &self.values, &self.subdiagonal, permutation).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(right, self.dimension(), count),
            Par::Seq,
            MemStack::new(&mut memory),
        );
        Ok(())
    }
}
