//! Inverse mean ratio: the squared norm against the volume, 1 for similarities. Its inverse is the mean ratio quality.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct MeanRatio;

impl Isotropic for MeanRatio {
    fn description(&self) -> Description {
        Description {
            name: "mean-ratio",
            formula: "|J|^2 / (3 D^(2/3)) = A / (3 D^(2/3))",
            source: "Liu, Joe 1994; Knupp 2001",
            is_barrier: true,
            needs_rest_scale: false,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, _, d] = invariants;
        (a * d.powf(-2.0 / 3.0)).scale(1.0 / 3.0)
    }
}
