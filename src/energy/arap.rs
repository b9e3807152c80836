//! As rigid as possible: the squared distance of the Jacobian to the nearest rotation. Zero at rotations; sees
//! reflections, because the singular values are signed, but does not prevent them.

use super::Description;
use super::separable::Separable;
use crate::linalg::scalar::{Real, Scalar};

pub struct Arap;

impl Separable for Arap {
    fn description(&self) -> Description {
        Description {
            name: "arap",
            formula: "sum (s_i - 1)^2",
            source: "Sorkine, Alexa 2007; Liu et al. 2008",
            is_barrier: false,
            needs_rest_scale: true,
        }
    }

    #[inline(always)]
    fn term<S: Scalar>(&self, s: S) -> S {
        (s - S::constant(1.0)).square()
    }

    #[inline(always)]
    fn slope_difference<R: Real>(&self, _a: R, _b: R) -> R {
        R::constant(2.0)
    }
}
