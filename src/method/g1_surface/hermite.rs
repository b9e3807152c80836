//! The five functions of one variable that curves and patches are made of: the cubic Hermite functions and a bubble.
//!
//! `psi_1..psi_4` carry the value at 0, the value at 1, the slope at 0 and the slope at 1; `psi_5 = x^2 (1-x)^2` has
//! neither value nor slope at the ends. Source: Xue, Demkowicz, Bajaj 2004, equation 4 and Figure 2.

/// The five functions at `x`.
#[inline]
pub fn values(x: f64) -> [f64; 5] {
    let y = 1.0 - x;
    [
        y * y * (1.0 + 2.0 * x),
        x * x * (3.0 - 2.0 * x),
        x * y * y,
        -x * x * y,
        x * x * y * y,
    ]
}

/// Their first derivatives.
#[inline]
pub fn slopes(x: f64) -> [f64; 5] {
    let y = 1.0 - x;
    [
        -6.0 * x * y,
        6.0 * x * y,
        y * (1.0 - 3.0 * x),
        x * (3.0 * x - 2.0),
        2.0 * x * y * (1.0 - 2.0 * x),
    ]
}

/// Their second derivatives.
#[inline]
pub fn second_derivatives(x: f64) -> [f64; 5] {
    [
        12.0 * x - 6.0,
        6.0 - 12.0 * x,
        6.0 * x - 4.0,
        6.0 * x - 2.0,
        2.0 - 12.0 * x + 12.0 * x * x,
    ]
}

/// The coefficients of the five functions over the Bernstein polynomials of degree 4, `B_k = C(4,k) x^k (1-x)^(4-k)`.
pub const BERNSTEIN: [[f64; 5]; 5] = [
    [1.0, 1.0, 0.5, 0.0, 0.0],
    [0.0, 0.0, 0.5, 1.0, 1.0],
    [0.0, 0.25, 1.0 / 6.0, 0.0, 0.0],
    [0.0, 0.0, -1.0 / 6.0, -0.25, 0.0],
    [0.0, 0.0, 1.0 / 6.0, 0.0, 0.0],
];

/// A combination of the first four functions with vector coefficients.
#[inline]
pub fn combine(functions: &[f64; 5], coefficients: &[[f64; 3]; 4]) -> [f64; 3] {
    std::array::from_fn(|axis| {
        functions[0] * coefficients[0][axis]
            + functions[1] * coefficients[1][axis]
            + functions[2] * coefficients[2][axis]
            + functions[3] * coefficients[3][axis]
    })
}
