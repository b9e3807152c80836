//! Dirichlet energy: the squared norm of the Jacobian. Quadratic, so its minimizer is the harmonic map; folds.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct Dirichlet;

impl Isotropic for Dirichlet {
    fn description(&self) -> Description {
        Description {
            name: "dirichlet",
            formula: "|J|^2 = A",
            source: "Dirichlet energy; Pinkall, Polthier 1993 for meshes",
            is_barrier: false,
            needs_rest_scale: false,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, _, _] = invariants;
        a
    }
}
