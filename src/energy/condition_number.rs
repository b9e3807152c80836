//! Condition number of the Jacobian in the Frobenius norm, 1 for similarities.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct ConditionNumber;

impl Isotropic for ConditionNumber {
    fn description(&self) -> Description {
        Description {
            name: "condition-number",
            formula: "|J| |J^-1| / 3 = sqrt(A B) / (3 D)",
            source: "Freitag, Knupp 2002",
            is_barrier: true,
            needs_rest_scale: false,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, b, d] = invariants;
        (a * b).sqrt() / d.scale(3.0)
    }
}
