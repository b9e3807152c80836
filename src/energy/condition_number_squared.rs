//! Squared condition number of the Jacobian in the Frobenius norm, 9 for similarities; smoother than its root.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct ConditionNumberSquared;

impl Isotropic for ConditionNumberSquared {
    fn description(&self) -> Description {
        Description {
            name: "condition-number-squared",
            formula: "|J|^2 |J^-1|^2 = A B / D^2",
            source: "Freitag, Knupp 2002, squared",
            is_barrier: true,
            needs_rest_scale: false,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, b, d] = invariants;
        a * b / d.square()
    }
}
