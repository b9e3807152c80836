//! Stretch: the squared norm of the inverse Jacobian, Sander's texture stretch in three dimensions. A barrier that
//! vanishes at infinite size, so it needs a fixed boundary.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct Stretch;

impl Isotropic for Stretch {
    fn description(&self) -> Description {
        Description {
            name: "stretch",
            formula: "|J^-1|^2 = B / D^2",
            source: "Sander et al. 2001 in two dimensions; Jin et al. 2015, eq. (4)",
            is_barrier: true,
            needs_rest_scale: false,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [_, b, d] = invariants;
        b / d.square()
    }
}
