//! Advanced MIPS: the exponential of the mean of MIPS and volume distortion, which punishes the worst elements. Least,
//! e^2, at rotations. Overflows to plus infinity where the mean exceeds about 350.

use super::Description;
use super::isotropic::Isotropic;
use crate::linalg::scalar::Scalar;

pub struct Amips;

impl Isotropic for Amips {
    fn description(&self) -> Description {
        Description {
            name: "amips",
            formula: "exp(2 (mips + (D + 1/D) / 2) / 2)",
            source: "Fu, Liu, Guo 2015, with exponent factor 2",
            is_barrier: true,
            needs_rest_scale: true,
        }
    }

    #[inline(always)]
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S {
        let [a, b, d] = invariants;
        ((a * b / d.square() - S::constant(1.0)).scale(0.125) + (d + S::constant(1.0) / d).scale(0.5)).exp()
    }
}
