//! The density that moves inverted cells back (Garanzha et al. 2021, Foldover-free maps in 50 lines of code).
//!
//! The determinant in the denominators of shape and volume distortion is replaced by the positive
//! `chi(D) = (D + sqrt(epsilon^2 + D^2)) / 2`, which tends to `max(D, 0)` as epsilon tends to 0. So the density is finite
//! for every Jacobian, and the smaller epsilon, the higher the price of a negative determinant.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

/// `A / chi^(2/3) + lambda (D^2 + 1) / chi`, with `A = |J|^2` and `D = det J`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Untangling {
    /// Positive; the density falls short of a barrier by this.
    pub epsilon: f64,
    /// Weight of volume against shape.
    pub lambda: f64,
}

impl Untangling {
    /// `chi` of a determinant: positive, also where `D + sqrt(epsilon^2 + D^2)` would cancel.
    #[inline(always)]
    pub fn chi<S: Scalar>(&self, determinant: S) -> S {
        let square = S::constant(self.epsilon * self.epsilon);
        let root = (determinant.square() + square).sqrt();
        let size = determinant.where_negative(-determinant, determinant);
        let large = (root + size).scale(0.5);
        // chi(D) chi(-D) = epsilon^2 / 4.
        determinant.where_negative(square.scale(0.25) / large, large)
    }
}

impl Isotropic for Untangling {
    fn description(&self) -> Description {
        Description {
            name: "untangling",
            formula: "A / chi^(2/3) + lambda (D^2 + 1) / chi, chi = (D + sqrt(epsilon^2 + D^2)) / 2",
            source: "Garanzha et al. 2021",
            is_barrier: false,
            needs_rest_scale: true,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, _, d] = invariants;
        let chi = self.chi(d);
        a * chi.powf(-2.0 / 3.0) + ((d.square() + S::constant(1.0)) / chi).scale(self.lambda)
    }
}
