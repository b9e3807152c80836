//! Direct factorizations of the systems, and solutions with iterative refinement.
//!
//! The one-field system takes a Cholesky factorization; the mixed one `L D L^T` with pivots of known signs, `L B L^T`
//! with Bunch-Kaufman pivots within the supernodes of a nested-dissection order, or `LU` where these break down. All
//! run on one thread or in fixed pieces, so the bits do not depend on the number of threads. A factorization serves
//! any number of right-hand sides.

use super::block_factor::BlockFactor;
use super::lblt::{self, Lblt};
use super::lu::Lu;
use super::mixed_system::LowerMatrix;
use super::one_field::OneField;
use super::signed_system::SignedSystem;
use crate::linalg::sparse::BlockCholesky;
use crate::method::Failure;

/// A backward error that more steps in the same precision do not improve.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// Refinement ends when the backward error is down to rounding or does not halve, and after this many steps at the
/// latest.
const REFINEMENTS: usize = 8;

/// A symmetric matrix with a factor that solves for it.
pub(super) trait Factorized {
    /// The name among the settings: `cholesky`, `ldlt`, `lblt` or `lu`.
    fn name(&self) -> &'static str;
    fn dimension(&self) -> usize;
    /// Numbers stored for the matrix's lower triangle, zeros included.
    fn matrix_entries(&self) -> usize;
    /// Numbers stored for the factor; `None` where the factorization does not tell.
    fn factor_entries(&self) -> Option<usize>;
    /// `A x`.
    fn multiply(&self, x: &[f64]) -> Vec<f64>;
    /// `|A| x` with the magnitudes of the matrix's entries.
    fn multiply_magnitudes(&self, x: &[f64]) -> Vec<f64>;
    /// Replaces `count` right-hand sides, one after another, by what the factor makes of them.
    fn apply(&self, right: &mut [f64], count: usize) -> Result<(), Failure>;
}

/// A factorized system.
pub struct Factorization(Box<dyn Factorized>);

pub(super) fn singular(reason: String) -> Failure {
    Failure {
        kind: "singular".to_string(),
        reason,
    }
}

pub(super) fn too_large(what: &str) -> Failure {
    Failure {
        kind: "out-of-memory".to_string(),
        reason: format!("there is not enough memory for {what}; take a coarser mesh"),
    }
}

impl Factorization {
    /// Cholesky factorization of a one-field system.
    ///
    /// # Errors
    /// When the matrix is not positive definite.
    pub fn cholesky(system: OneField, vertices: &[u32]) -> Result<Self, Failure> {
        let factor = BlockCholesky::new(system.pattern);
        let factor = BlockFactor::new("cholesky", factor, system.values).map_err(|place| {
            let vertex = vertices.get(place as usize).copied().unwrap_or(place);
            singular(format!(
                "the one-field matrix is not positive definite: a pivot at vertex {vertex} (counted from 0) is not positive; \
                 very thin triangles there have a negative lumped mass or too large cotangents: use mass = \
                 \"barycentric\" or improve them"
            ))
        })?;
        Ok(Self(Box::new(factor)))
    }

    /// `L D L^T` factorization of a mixed system. `Err`: the place in the numbering's order of a vertex where a pivot
    /// has not the sign that it should have.
    pub fn ldlt(system: SignedSystem) -> Result<Self, u32> {
        let factor: Result<Box<dyn Factorized>, u32> = match system {
            SignedSystem::Two(factor, values) => {
                BlockFactor::new("ldlt", *factor, values).map(|factor| Box::new(factor) as _)
            }
            SignedSystem::Three(factor, values) => {
                BlockFactor::new("ldlt", *factor, values).map(|factor| Box::new(factor) as _)
            }
        };
        factor.map(Self)
    }

    /// `L B L^T` factorization of a mixed system, with its analysis told by `analysed`.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn lblt(matrix: LowerMatrix, analysed: impl FnOnce()) -> Result<Self, Failure> {
        let analysis = lblt::analyse(&matrix)?;
        analysed();
        Ok(Self(Box::new(Lblt::new(matrix, analysis)?)))
    }

    /// `L U` factorization with partial pivoting of a mixed system.
    ///
    /// # Errors
    /// When the matrix is singular in structure or memory runs out.
    pub fn lu(matrix: LowerMatrix) -> Result<Self, Failure> {
        Ok(Self(Box::new(Lu::new(matrix)?)))
    }

    /// `cholesky`, `ldlt`, `lblt` or `lu`.
    pub fn name(&self) -> &'static str {
        self.0.name()
    }

    pub fn dimension(&self) -> usize {
        self.0.dimension()
    }

    /// Numbers stored for the matrix's lower triangle, zeros included.
    pub fn matrix_entries(&self) -> usize {
        self.0.matrix_entries()
    }

    /// Numbers stored for the factor; `None` where the factorization does not tell.
    pub fn factor_entries(&self) -> Option<usize> {
        self.0.factor_entries()
    }

    /// Solves for `count` right-hand sides in place, with refinement.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn solve(&self, right: &mut [f64], count: usize) -> Result<Accuracy, Failure> {
        let dimension = self.dimension();
        let wanted = right.to_vec();
        self.0.apply(right, count)?;
        let row_sums = self.0.multiply_magnitudes(&vec![1.0; dimension]);
        let mut found = Accuracy::default();
        for column in 0..count {
            let range = column * dimension..(column + 1) * dimension;
            let (wanted, x) = (&wanted[range.clone()], &mut right[range]);
            let (mut residual, mut sizes, mut backward) = self.backward_error(x, wanted, &row_sums);
            for _ in 0..REFINEMENTS {
                if !backward.is_finite() || backward <= ROUNDING {
                    break;
                }
                let mut step = residual.clone();
                self.0.apply(&mut step, 1)?;
                let better: Vec<f64> = x.iter().zip(&step).map(|(x, step)| x + step).collect();
                let (next, next_sizes, less) = self.backward_error(&better, wanted, &row_sums);
                if !(less < backward) {
                    break;
                }
                let halved = less < 0.5 * backward;
                x.copy_from_slice(&better);
                (residual, sizes, backward) = (next, next_sizes, less);
                if !halved {
                    break;
                }
            }
            // What rounding of the coefficients alone does, with signs as good as random.
            for (row, size) in sizes.iter_mut().enumerate() {
                let sign = (row as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63;
                *size *= if sign == 0 { f64::EPSILON } else { -f64::EPSILON };
            }
            self.0.apply(&mut sizes, 1)?;
            let size = largest(x);
            let forward = if size > 0.0 { largest(&sizes) / size } else { 0.0 };
            found = Accuracy {
                backward: larger(found.backward, backward),
                forward: larger(found.forward, forward),
            };
        }
        Ok(found)
    }

    /// The residual `b - A x`, `|A| |x| + |b|` row by row, and the smallest relative change of every coefficient of
    /// `A` and `b` that makes `x` exact: the maximum of `|b - A x| / (|A| |x| + |b|)` over the rows (Oettli and Prager
    /// 1964). Rows whose denominator is rounding itself are measured against the size of the row and of `x` (Arioli,
    /// Demmel and Duff 1989).
    fn backward_error(&self, x: &[f64], wanted: &[f64], row_sums: &[f64]) -> (Vec<f64>, Vec<f64>, f64) {
        let image = self.0.multiply(x);
        let residual: Vec<f64> = wanted.iter().zip(&image).map(|(b, image)| b - image).collect();
        let magnitudes: Vec<f64> = x.iter().map(|x| x.abs()).collect();
        let mut sizes = self.0.multiply_magnitudes(&magnitudes);
        sizes.iter_mut().zip(wanted).for_each(|(size, b)| *size += b.abs());
        let norm = largest(x);
        let error = (0..x.len())
            .map(|row| {
                let (size, whole) = (sizes[row], row_sums[row] * norm + wanted[row].abs());
                let size = if size > 1e3 * f64::EPSILON * whole { size } else { whole };
                if residual[row] == 0.0 {
                    0.0
                } else {
                    residual[row].abs() / size
                }
            })
            .fold(0.0, larger);
        (residual, sizes, error)
    }
}

/// How good a solution is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accuracy {
    /// Componentwise relative backward error; not-a-number where the solution is not finite.
    pub backward: f64,
    /// How much relative changes of all coefficients by the rounding unit, with random signs, change the solution
    /// against its size: an estimate of what rounding may have done to it.
    pub forward: f64,
}

/// The larger one, not-a-number where one is.
fn larger(left: f64, right: f64) -> f64 {
    if left.is_nan() || right.is_nan() {
        f64::NAN
    } else {
        left.max(right)
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |worst, value| larger(worst, value.abs()))
}
