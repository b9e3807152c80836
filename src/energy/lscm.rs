//! Least squares conformal map: differences of the squared singular values. Zero for similarities and for J = 0; folds.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct Lscm;

impl Isotropic for Lscm {
    fn description(&self) -> Description {
        Description {
            name: "lscm",
            formula: "sum_{i<j} (s_i^2 - s_j^2)^2 = 2 A^2 - 6 B",
            source: "Levy et al. 2002 in two dimensions; Jin et al. 2015, eq. (5)",
            is_barrier: false,
            needs_rest_scale: false,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, b, _] = invariants;
        a.square().scale(2.0) - b.scale(6.0)
    }
}
