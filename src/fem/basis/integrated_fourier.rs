//! Integrated modified Fourier series (Iserles and Norsett 2008), the basis of Jin et al. 2013, section 3.2.

use super::Basis;
use std::f64::consts::{PI, SQRT_2};

pub struct IntegratedFourier;

impl Basis for IntegratedFourier {
    fn name(&self) -> &'static str {
        "integrated-fourier"
    }

    fn summary(&self) -> &'static str {
        "b_j = sqrt(2) sin(j pi x) / (j pi) (integrated modified Fourier series; Jin et al. 2013, section 3.2)"
    }

    fn bubble(&self, j: usize, x: f64) -> [f64; 2] {
        // From the nearer end, so that both ends are exact.
        let (y, sign) = mirrored(j, x);
        let a = j as f64 * PI;
        [
            sign * SQRT_2 * (a * y).sin() / a,
            (if x <= 0.5 { 1.0 } else { -sign }) * SQRT_2 * (a * y).cos(),
        ]
    }

    fn kernel(&self, j: usize, s: f64) -> [f64; 2] {
        // Both by x: it may round to 0.5 where s is not 0 but tiny.
        let x = 0.5 * (1.0 + s);
        let (y, sign) = mirrored(j, x);
        let turn = if x <= 0.5 { 1.0 } else { -1.0 };
        let frequency = j as f64 * PI;
        let a = frequency * y;
        let (sinc, slope) = if a.abs() < 0.1 {
            let b = a * a;
            (
                1.0 - b / 6.0 * (1.0 - b / 20.0 * (1.0 - b / 42.0 * (1.0 - b / 72.0))),
                -a / 3.0 * (1.0 - b / 10.0 * (1.0 - b / 28.0 * (1.0 - b / 54.0 * (1.0 - b / 88.0)))),
            )
        } else {
            (a.sin() / a, (a * a.cos() - a.sin()) / (a * a))
        };
        let rest = 1.0 - y;
        let value = SQRT_2 * sinc / rest;
        let derivative = SQRT_2 * (frequency * slope / rest + sinc / (rest * rest));
        [sign * value, sign * turn * derivative / 2.0]
    }

    fn factor(&self, k: usize, x: f64) -> [f64; 2] {
        if k == 0 {
            return [1.0, 0.0];
        }
        let a = k as f64 * PI;
        [SQRT_2 * (a * x).cos(), -SQRT_2 * a * (a * x).sin()]
    }

    fn is_polynomial(&self) -> bool {
        false
    }

    fn frequency(&self, j: usize) -> Option<f64> {
        Some(j as f64)
    }

    fn factor_frequency(&self, k: usize) -> Option<f64> {
        Some(k as f64)
    }
}

/// The distance to the nearer end, and the sign of `b_j(x)` against `b_j` there.
fn mirrored(j: usize, x: f64) -> (f64, f64) {
    if x <= 0.5 {
        (x, 1.0)
    } else {
        (1.0 - x, if j.is_multiple_of(2) { -1.0 } else { 1.0 })
    }
}
