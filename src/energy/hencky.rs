//! Hencky energy: the squared norm of the logarithmic strain. Zero at rotations. Its barrier is weak, a determinant of
//! 1e-8 costs 57 at most, and it is not convex for singular values above e.

use super::Description;
use super::separable::Separable;
use crate::linalg::elementary::ln_divided_difference;
use crate::linalg::scalar::{Real, Scalar};

pub struct Hencky;

impl Separable for Hencky {
    fn description(&self) -> Description {
        Description {
            name: "hencky",
            formula: "|ln(J^T J) / 2|^2 / 2 = sum ln(s_i)^2 / 2",
            source: "Hencky 1928; Jin et al. 2013, appendix A",
            is_barrier: true,
            needs_rest_scale: true,
        }
    }

    #[inline(always)]
    fn term<S: Scalar>(&self, s: S) -> S {
        s.ln().square().scale(0.5)
    }

    /// With `d = (ln a - ln b) / (a - b)`: `(ln a / a - ln b / b) / (a - b) = (d b - ln b) / (a b)`.
    #[inline(always)]
    fn slope_difference<R: Real>(&self, a: R, b: R) -> R {
        (ln_divided_difference(a, b) * b - b.ln()) / (a * b)
    }
}
