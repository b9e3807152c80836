//! Most isometric parametrization, in three dimensions: the product of the ratios of singular values, 1 for similarities.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct Mips;

impl Isotropic for Mips {
    fn description(&self) -> Description {
        Description {
            name: "mips",
            formula: "prod_{i<j} (s_i/s_j + s_j/s_i) / 8 = (A B / D^2 - 1) / 8",
            source: "Hormann, Greiner 2000; Fu, Liu, Guo 2015 in three dimensions",
            is_barrier: true,
            needs_rest_scale: false,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, b, d] = invariants;
        (a * b / d.square() - S::constant(1.0)).scale(0.125)
    }
}
