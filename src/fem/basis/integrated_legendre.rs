//! Integrated Legendre polynomials, orthonormal in the derivative (Szabo and Babuska 2011).

use super::Basis;
use super::legendre::legendre;

pub struct IntegratedLegendre;

impl Basis for IntegratedLegendre {
    fn name(&self) -> &'static str {
        "integrated-legendre"
    }

    fn summary(&self) -> &'static str {
        "b_j = (P_(j+1)(s) - P_(j-1)(s)) / (2 sqrt(2j+1)), s = 2x - 1 (Szabo and Babuska 2011): polynomials"
    }

    fn bubble(&self, j: usize, x: f64) -> [f64; 2] {
        let s = 2.0 * x - 1.0;
        let root = ((2 * j + 1) as f64).sqrt();
        // (P_(j+1) - P_(j-1)) = -(2j+1)/(j(j+1)) (1 - s^2) P_j', without cancellation at the ends.
        let [value, slope, _] = legendre(j, s);
        let scale = -2.0 * root / ((j * (j + 1)) as f64);
        [scale * x * (1.0 - x) * slope, root * value]
    }

    fn kernel(&self, j: usize, s: f64) -> [f64; 2] {
        let scale = -2.0 * ((2 * j + 1) as f64).sqrt() / ((j * (j + 1)) as f64);
        let [_, slope, bend] = legendre(j, s);
        [scale * slope, scale * bend]
    }

    fn factor(&self, k: usize, x: f64) -> [f64; 2] {
        let root = ((2 * k + 1) as f64).sqrt();
        let [value, slope, _] = legendre(k, 2.0 * x - 1.0);
        [root * value, 2.0 * root * slope]
    }

    fn is_polynomial(&self) -> bool {
        true
    }

    fn frequency(&self, _: usize) -> Option<f64> {
        None
    }

    fn factor_frequency(&self, _: usize) -> Option<f64> {
        None
    }
}
