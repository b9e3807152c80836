//! Direct factorizations of the systems, and solutions with iterative refinement.
//!
//! The one-field system takes a Cholesky factorization; the mixed one `L D L^T` with pivots of known signs, `L B L^T` with
//! Bunch-Kaufman pivots within the supernodes of a nested-dissection order, or `LU` where these break down. All run on one
//! thread or in fixed pieces, so the bits do not depend on the number of threads. A factorization serves any number of
//! right-hand sides.

use super::block_factor::BlockFactor;
use super::lblt::{self, Lblt};
use super::lu::Lu;
use super::mixed_system::LowerMatrix;
use super::one_field::OneField;
use super::signed_system::SignedSystem;
use crate::linalg::sparse::BlockCholesky;
use crate::method::Failure;

/// Refinement ends when the residual is down to rounding or does not halve, and after this many steps at the latest.
const REFINEMENTS: usize = 4;

/// A symmetric matrix with a factor that solves for it.
pub(super) trait Factorized {
    /// The name among the settings: `cholesky`, `ldlt`, `lblt` or `lu`.
    fn name(&self) -> &'static str;
    fn dimension(&self) -> usize;
    /// Numbers stored for the matrix's lower triangle, zeros included.
    fn matrix_entries(&self) -> usize;
    /// Numbers stored for the factor; `None` where the factorization does not tell.
    fn factor_entries(&self) -> Option<usize>;
    /// Largest sum of magnitudes in a row.
    fn norm(&self) -> f64;
    /// `A x`.
    fn multiply(&self, x: &[f64]) -> Vec<f64>;
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

    /// `L D L^T` factorization of a mixed system; `None` where a pivot has not the sign that it should have.
    pub fn ldlt(system: SignedSystem) -> Option<Self> {
        let factor: Result<Box<dyn Factorized>, u32> = match system {
            SignedSystem::Two(factor, values) => {
                BlockFactor::new("ldlt", *factor, values).map(|factor| Box::new(factor) as _)
            }
            SignedSystem::Three(factor, values) => {
                BlockFactor::new("ldlt", *factor, values).map(|factor| Box::new(factor) as _)
            }
        };
        factor.ok().map(Self)
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

    /// Solves for `count` right-hand sides in place, with refinement; the largest relative residual
    /// `|b - A x| / (|A| |x| + |b|)` in the maximum norm, not-a-number where the solution is not finite.
    ///
    /// # Errors
    /// When memory runs out.
    pub fn solve(&self, right: &mut [f64], count: usize) -> Result<f64, Failure> {
        let dimension = self.dimension();
        let wanted = right.to_vec();
        self.0.apply(right, count)?;
        let norm = self.0.norm();
        let mut worst = 0.0f64;
        for column in 0..count {
            let range = column * dimension..(column + 1) * dimension;
            let wanted = &wanted[range.clone()];
            let x = &mut right[range];
            let measure = |x: &[f64]| {
                let image = self.0.multiply(x);
                let residual: Vec<f64> = wanted.iter().zip(&image).map(|(b, image)| b - image).collect();
                let size = norm * largest(x) + largest(wanted);
                let relative = if size == 0.0 { 0.0 } else { largest(&residual) / size };
                (residual, relative)
            };
            let (mut residual, mut relative) = measure(x);
            for _ in 0..REFINEMENTS {
                if !relative.is_finite() || relative <= f64::EPSILON {
                    break;
                }
                let mut step = residual.clone();
                self.0.apply(&mut step, 1)?;
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
