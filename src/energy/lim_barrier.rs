//! The barrier of locally injective mappings (Schueller et al. 2013), for energies that have none of their own.

use super::spectrum::{Spectrum, spectrum_by_invariants};
use crate::linalg::scalar::Real;

/// `phi(x) = 1 / g(t) - 1` with `t = x / w`, `g = t^3 - 3 t^2 + 3 t`; 0 for `x >= w`, plus infinity for `x <= 0`.
///
/// Here `x = D - epsilon` and `w = gamma (1 - epsilon)`: the paper's signed volume and width, both divided by the cell's
/// volume at rest. `phi` is twice continuously differentiable, also at `w`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimBarrier {
    /// The determinant from which on the barrier is not felt: 1 in the paper, the volume ratio of target and source in
    /// Jin et al. 2015.
    pub gamma: f64,
    /// The determinant at which the barrier is infinite, in `[0, 1)`.
    pub epsilon: f64,
}

impl LimBarrier {
    /// The barrier that starts at the determinant `gamma` and ends at 0.
    pub fn new(gamma: f64) -> LimBarrier {
        LimBarrier { gamma, epsilon: 0.0 }
    }

    /// Value, first and second derivative at a determinant.
    #[inline(always)]
    pub fn evaluate<R: Real>(&self, determinant: R) -> [R; 3] {
        let zero = R::constant(0.0);
        let width = self.gamma * (1.0 - self.epsilon);
        let t = (determinant - R::constant(self.epsilon)) / R::constant(width);
        // g = 1 - (1 - t)^3, so that 1/g - 1 = (1 - t)^3 / g needs no subtraction.
        let rest = R::constant(1.0) - t;
        let square = rest * rest;
        let g = t * (R::constant(3.0) - t.scale(3.0) + t * t);
        let first = square.scale(3.0 / width);
        let second = rest.scale(-6.0 / (width * width));
        let inverse = R::constant(1.0) / g;
        let inverse_square = inverse * inverse;
        let value = rest * square * inverse;
        let slope = -(first * inverse_square);
        let curvature = first.square().scale(2.0) * inverse_square * inverse - second * inverse_square;
        let felt = zero.less(rest);
        let inside = zero.less(t);
        let value = R::select(felt, value, zero);
        [
            R::select(inside, value, R::constant(f64::INFINITY)),
            R::select(felt, slope, zero),
            R::select(felt, curvature, zero),
        ]
    }

    /// The barrier's part of the Hessian at singular values s; `partials` are by the invariants.
    #[inline(always)]
    pub fn spectrum<R: Real>(&self, s: [R; 3], determinant: R) -> Spectrum<R> {
        let zero = R::constant(0.0);
        let [value, slope, curvature] = self.evaluate(determinant);
        spectrum_by_invariants(s, value, [zero, zero, slope], [zero, zero, zero, zero, zero, curvature])
    }
}
