//! Length preserving map: how far the squared singular values are from 1, the St. Venant-Kirchhoff energy without its
//! trace term. Zero for isometries, reflections included; folds.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct Lpm;

impl Isotropic for Lpm {
    fn description(&self) -> Description {
        Description {
            name: "lpm",
            formula: "sum (s_i^2 - 1)^2 = A^2 - 2 B - 2 A + 3",
            source: "Jin et al. 2015, eq. (6)",
            is_barrier: false,
            needs_rest_scale: true,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, b, _] = invariants;
        a.square() - (a + b).scale(2.0) + S::constant(3.0)
    }
}
