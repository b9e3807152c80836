//! Rules on the interval `[0, 1]`.

use super::Line;
use crate::fem::basis::legendre::legendre;
use std::f64::consts::PI;

/// Gauss-Legendre: exact to degree `2n - 1`.
pub fn gauss(n: usize) -> Line {
    gauss_jacobi(n, 0)
}

/// Gauss-Jacobi for the weight `(1 - x)^alpha`: exact to degree `2n - 1` beside the weight; weights sum to
/// `1 / (alpha + 1)`.
pub fn gauss_jacobi(n: usize, alpha: u32) -> Line {
    assert!(n > 0, "at least one point");
    let mut roots: Vec<f64> = Vec::with_capacity(n);
    for k in 0..n {
        let mut s = -((2 * k + 1) as f64 / (2 * n) as f64 * PI).cos();
        if let Some(last) = roots.last() {
            s = 0.5 * (s + last);
        }
        // Newton's method on the polynomial without the roots found so far.
        for _ in 0..100 {
            let [value, slope] = jacobi(n, alpha, s);
            let known: f64 = roots.iter().map(|root| 1.0 / (s - root)).sum();
            let step = value / (slope - known * value);
            s -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        // One undeflated step removes what the deflation left of rounding.
        let [value, slope] = jacobi(n, alpha, s);
        roots.push(s - value / slope);
    }
    let weights = roots.iter().map(|&s| {
        let [_, slope] = jacobi(n, alpha, s);
        1.0 / ((1.0 - s * s) * slope * slope)
    });
    Line {
        weights: weights.collect(),
        points: roots.iter().map(|s| 0.5 * (1.0 + s)).collect(),
    }
}

/// Value and derivative of the Jacobi polynomial `P_n^(alpha, 0)`.
fn jacobi(n: usize, alpha: u32, s: f64) -> [f64; 2] {
    let a = f64::from(alpha);
    let mut before = [0.0, 0.0];
    let mut here = [1.0, 0.0];
    for k in 0..n {
        let m = k as f64;
        // Abramowitz and Stegun 22.7.1 with beta = 0.
        let next = if k == 0 {
            [0.5 * (a + (a + 2.0) * s), 0.5 * (a + 2.0)]
        } else {
            let c = 2.0 * m + a;
            let lead = 2.0 * (m + 1.0) * (m + a + 1.0) * c;
            let shift = (c + 1.0) * a * a;
            let tilt = c * (c + 1.0) * (c + 2.0);
            let back = 2.0 * (m + a) * m * (c + 2.0);
            [
                ((shift + tilt * s) * here[0] - back * before[0]) / lead,
                ((shift + tilt * s) * here[1] + tilt * here[0] - back * before[1]) / lead,
            ]
        };
        before = here;
        here = next;
    }
    here
}

/// Gauss-Lobatto, both ends among the points: exact to degree `2n - 3`.
pub fn lobatto(n: usize) -> Line {
    assert!(n > 1, "at least two points");
    let order = n - 1;
    let mut line = Line {
        points: Vec::with_capacity(n),
        weights: Vec::with_capacity(n),
    };
    for k in 0..n {
        let mut s = -(PI * k as f64 / order as f64).cos();
        if k == 0 || k == order {
            s = s.signum();
        } else {
            // Roots of P'_order, by Newton's method.
            for _ in 0..100 {
                let [_, slope, bend] = legendre(order, s);
                let step = slope / bend;
                s -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
        }
        let [value, _, _] = legendre(order, s);
        line.points.push(0.5 * (1.0 + s));
        line.weights.push(1.0 / ((n * order) as f64 * value * value));
    }
    line
}

/// Equally spaced points with half weights at both ends.
pub fn trapezoid(n: usize) -> Line {
    assert!(n > 1, "at least two points");
    let step = 1.0 / (n - 1) as f64;
    Line {
        points: (0..n).map(|k| k as f64 / (n - 1) as f64).collect(),
        weights: (0..n)
            .map(|k| if k == 0 || k == n - 1 { 0.5 * step } else { step })
            .collect(),
    }
}
