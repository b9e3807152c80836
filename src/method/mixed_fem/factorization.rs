//! Direct factorizations of the systems, and solutions with iterative refinement.
//!
//! The one-field system takes a Cholesky factorization, the mixed one `L B L^T` with Bunch-Kaufman pivots within the
//! supernodes of a nested-dissection order, or an `LU` factorization where that breaks down. All run on one thread, so the
//! bits do not depend on the number of threads. A factorization serves any number of right-hand sides.

use super::mixed_system::LowerMatrix;
use super::one_field::OneField;
use crate::linalg::sparse::{BlockCholesky, BlockPattern};
use crate::method::Failure;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, IntranodeLbltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// Refinement ends when the residual does not halve, and after this many steps at the latest.
const REFINEMENTS: usize = 4;

/// A factorized system.
pub struct Factorization {
    matrix: Matrix,
    factor: Factor,
}

enum Matrix {
    Mixed(LowerMatrix),
    /// The matrix in the order of its pattern, which the factor holds.
    OneField(Vec<f64>),
}

enum Factor {
    Cholesky(Box<BlockCholesky<1>>),
    Lblt(Box<Lblt>),
    Lu(Box<Lu>),
}

struct Lblt {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    subdiagonal: Vec<f64>,
    forward: Vec<usize>,
    inverse: Vec<usize>,
}

struct Lu {
    symbolic: SymbolicLu<usize>,
    numeric: NumericLu<usize, f64>,
}

fn singular(reason: String) -> Failure {
    Failure {
        kind: "singular".to_string(),
        reason,
    }
}

fn too_large(what: &str) -> Failure {
    Failure {
        kind: "out-of-memory".to_string(),
        reason: format!("there is not enough memory for {what}; take a coarser mesh"),
    }
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

impl Factorization {
    /// Cholesky factorization of a one-field system.
    ///
    /// # Errors
    /// When the matrix is not positive definite.
    pub fn cholesky(system: OneField, vertices: &[u32]) -> Result<Self, Failure> {
        let mut factor = BlockCholesky::new(system.pattern);
        factor.factorize(&system.values, 0.0).map_err(|error| {
            let vertex = vertices.get(error.vertex as usize).copied().unwrap_or(error.vertex);
            singular(format!(
                "the one-field matrix is not positive definite: a pivot at vertex {vertex} (counted from 0) is not positive; \
                 very thin triangles there have a negative lumped mass or too large cotangents: use mass = \
                 \"barycentric\" or improve them"
            ))
        })?;
        Ok(Self {
            matrix: Matrix::OneField(system.values),
            factor: Factor::Cholesky(Box::new(factor)),
        })
    }

    /// `L B L^T` factorization of a mixed system. A factor that is not finite shows in the solution's residual.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn lblt(matrix: LowerMatrix, Analysis(symbolic): Analysis) -> Result<Self, Failure> {
        let dimension = matrix.dimension();
        let mut factor = Lblt {
            values: vec![0.0; symbolic.len_val()],
            subdiagonal: vec![0.0; dimension],
            forward: vec![0; dimension],
            inverse: vec![0; dimension],
            symbolic,
        };
        let scratch = factor
            .symbolic
            .factorize_numeric_intranode_lblt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large("the factorization"))?;
        let structure = SymbolicSparseColMatRef::new_checked(dimension, dimension, &matrix.offsets, None, &matrix.rows);
        factor.symbolic.factorize_numeric_intranode_lblt(
            &mut factor.values,
            &mut factor.subdiagonal,
            &mut factor.forward,
            &mut factor.inverse,
            SparseColMatRef::new(structure, &matrix.values),
            Side::Lower,
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        Ok(Self {
            matrix: Matrix::Mixed(matrix),
            factor: Factor::Lblt(Box::new(factor)),
        })
    }

    /// `LU` factorization with partial pivoting of a mixed system.
    ///
    /// # Errors
    /// When the matrix is singular in structure or memory runs out.
    pub fn lu(matrix: LowerMatrix) -> Result<Self, Failure> {
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
            matrix: Matrix::Mixed(matrix),
            factor: Factor::Lu(Box::new(Lu { symbolic, numeric })),
        })
    }

    /// Gives the matrix of a mixed system back, to be factorized in another way.
    pub fn into_mixed(self) -> Option<LowerMatrix> {
        match self.matrix {
            Matrix::Mixed(matrix) => Some(matrix),
            Matrix::OneField(_) => None,
        }
    }

    /// `cholesky`, `lblt` or `lu`.
    pub fn name(&self) -> &'static str {
        match &self.factor {
            Factor::Cholesky(_) => "cholesky",
            Factor::Lblt(_) => "lblt",
            Factor::Lu(_) => "lu",
        }
    }

    fn pattern(&self) -> Option<&BlockPattern<1>> {
        match &self.factor {
            Factor::Cholesky(factor) => Some(factor.pattern()),
            _ => None,
        }
    }

    pub fn dimension(&self) -> usize {
        match &self.matrix {
            Matrix::Mixed(matrix) => matrix.dimension(),
            Matrix::OneField(_) => self.pattern().map_or(0, BlockPattern::dimension),
        }
    }

    /// Numbers stored for the matrix's lower triangle, zeros of the diagonal included.
    pub fn matrix_entries(&self) -> usize {
        match &self.matrix {
            Matrix::Mixed(matrix) => matrix.values.len(),
            Matrix::OneField(values) => values.len(),
        }
    }

    /// Numbers stored for the factor; `None` where the factorization does not tell.
    pub fn factor_entries(&self) -> Option<usize> {
        match &self.factor {
            Factor::Cholesky(factor) => Some(factor.pattern().elimination().factor_scalars()),
            Factor::Lblt(factor) => Some(factor.values.len()),
            Factor::Lu(_) => None,
        }
    }

    fn multiply(&self, x: &[f64]) -> Vec<f64> {
        match (&self.matrix, self.pattern()) {
            (Matrix::Mixed(matrix), _) => matrix.multiply(x),
            (Matrix::OneField(values), Some(pattern)) => {
                let mut result = vec![0.0; x.len()];
                pattern.multiply(values, x, &mut result);
                result
            }
            (Matrix::OneField(_), None) => Vec::new(),
        }
    }

    fn norm(&self) -> f64 {
        match &self.matrix {
            Matrix::Mixed(matrix) => matrix.norm(),
            // By the Frobenius norm, which is at least the spectral one.
            Matrix::OneField(values) => 2f64.sqrt() * values.iter().map(|value| value * value).sum::<f64>().sqrt(),
        }
    }

    /// Solves for `count` right-hand sides in place, with refinement; the largest relative residual
    /// `|b - A x| / (|A| |x| + |b|)` in the maximum norm, not-a-number where the solution is not finite.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn solve(&self, right: &mut [f64], count: usize) -> Result<f64, Failure> {
        let dimension = self.dimension();
        let wanted = right.to_vec();
        self.apply(right, count)?;
        let norm = self.norm();
        let mut worst = 0.0f64;
        for column in 0..count {
            let range = column * dimension..(column + 1) * dimension;
            let wanted = &wanted[range.clone()];
            let x = &mut right[range];
            let measure = |x: &[f64]| {
                let image = self.multiply(x);
                let residual: Vec<f64> = wanted.iter().zip(&image).map(|(b, image)| b - image).collect();
                let size = norm * largest(x) + largest(wanted);
                let relative = if size == 0.0 { 0.0 } else { largest(&residual) / size };
                (residual, relative)
            };
            let (mut residual, mut relative) = measure(x);
            for _ in 0..REFINEMENTS {
                if !relative.is_finite() || relative < 1e-17 {
                    break;
                }
                let mut step = residual.clone();
                self.apply(&mut step, 1)?;
                let better: Vec<f64> = x.iter().zip(&step).map(|(x, step)| x + step).collect();
                let (next, less) = measure(&better);
                if !(less < 0.5 * relative) {
                    break;
                }
                x.copy_from_slice(&better);
                (residual, relative) = (next, less);
            }
            // `max` would pass over not-a-number.
            worst = if relative.is_finite() {
                worst.max(relative)
            } else {
                f64::NAN
            };
            if worst.is_nan() {
                return Ok(f64::NAN);
            }
        }
        Ok(worst)
    }

    fn apply(&self, right: &mut [f64], count: usize) -> Result<(), Failure> {
        let dimension = self.dimension();
        if dimension == 0 || count == 0 {
            return Ok(());
        }
        match &self.factor {
            Factor::Cholesky(factor) => factor.solve_many_in_place(right, count),
            Factor::Lblt(factor) => {
                let scratch = factor.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq);
                let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large("the solution"))?;
                // Sound: the factorization filled both with a permutation and its inverse.
                let permutation = PermRef::new_checked(&factor.forward, &factor.inverse, dimension);
                IntranodeLbltRef::new(&factor.symbolic, &factor.values, &factor.subdiagonal, permutation)
                    .solve_in_place_with_conj(
                        Conj::No,
                        MatMut::from_column_major_slice_mut(right, dimension, count),
                        Par::Seq,
                        MemStack::new(&mut memory),
                    );
            }
            Factor::Lu(factor) => {
                let scratch = factor.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq);
                let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large("the solution"))?;
                LuRef::new_unchecked(&factor.symbolic, &factor.numeric).solve_in_place_with_conj(
                    Conj::No,
                    MatMut::from_column_major_slice_mut(right, dimension, count),
                    Par::Seq,
                    MemStack::new(&mut memory),
                );
            }
        }
        Ok(())
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |worst: f64, value| {
        if worst.is_nan() || value.is_nan() {
            f64::NAN
        } else {
            worst.max(value.abs())
        }
    })
}

/// The number of singular values below 1e-10 of the largest; `None` for more than 600 unknowns, which would take too long.
pub fn nullity(matrix: &LowerMatrix) -> Option<usize> {
    let dimension = matrix.dimension();
    if dimension > 600 {
        return None;
    }
    let mut dense = faer::Mat::<f64>::zeros(dimension, dimension);
    for column in 0..dimension {
        for place in matrix.offsets[column]..matrix.offsets[column + 1] {
            dense[(matrix.rows[place], column)] = matrix.values[place];
            dense[(column, matrix.rows[place])] = matrix.values[place];
        }
    }
    let values = dense.singular_values().ok()?;
    let largest = values.iter().copied().fold(0.0, f64::max);
    Some(values.iter().filter(|&&value| value < 1e-10 * largest).count())
}
