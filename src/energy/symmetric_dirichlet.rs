//! Symmetric Dirichlet energy: Dirichlet plus stretch, the coercive one of the two. Least, 6, at rotations.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct SymmetricDirichlet;

impl Isotropic for SymmetricDirichlet {
    fn description(&self) -> Description {
        Description {
            name: "symmetric-dirichlet",
            formula: "|J|^2 + |J^-1|^2 = A + B / D^2",
            source: "Smith, Schaefer 2015; Schreiner et al. 2004",
            is_barrier: true,
            needs_rest_scale: true,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, b, d] = invariants;
        a + b / d.square()
    }
}
