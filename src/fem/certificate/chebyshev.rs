//! How well polynomials can stand for the functions of triangles and tetrahedra on a part of the cell.
//!
//! Every such function is a product of functions of one linear coordinate each. On a part that coordinate runs through an
//! interval, on which a function analytic within the ellipse of sum of semi-axes rho (in half lengths) and bounded by M
//! there has Chebyshev coefficients `|a_i| <= 2 M rho^-i` (Bernstein 1912). So a product is a series of polynomials by
//! ascending total degree whose sizes are bounded by the convolution of these sequences, and what lies above a degree
//! bounds the distance to the polynomials of that degree.
//!
//! The kernels of sines need a bound for complex arguments: with `x = (1 + s) / 2`,
//! `kappa(s) = sqrt(2) sin(a x) / (a x (1 - x))`; as `|sin(z) / z| <= cosh(Im z)`, and as the same holds from the
//! other end, `|kappa(s)| <= 2 sqrt(2) cosh(a Im x)`; the derivative by Cauchy's formula on a circle of radius
//! `2 / a`.

use super::bernstein::Conversion;
use crate::fem::basis::Basis;
use crate::fem::functions::{tetrahedron_row, triangle_row};
use std::f64::consts::{PI, SQRT_2};
use std::ops::{Add, Mul};

/// Terms that are kept apart.
const TERMS: usize = 26;

/// Bounds of the parts of a function by degree, and of all that is of higher degree.
#[derive(Clone, Copy, Debug)]
struct Series {
    terms: [f64; TERMS],
    rest: f64,
}

impl Series {
    const ZERO: Series = Series {
        terms: [0.0; TERMS],
        rest: 0.0,
    };

    fn constant(value: f64) -> Series {
        let mut result = Series::ZERO;
        result.terms[0] = value.abs();
        result
    }

    /// A linear function between these values.
    fn linear(low: f64, high: f64) -> Series {
        let mut result = Series::constant(0.5 * (low + high));
        result.terms[1] = 0.5 * (high - low).abs();
        result
    }

    /// A polynomial of this degree, from its values on the interval.
    fn polynomial(degree: usize, low: f64, high: f64, value: impl Fn(f64) -> f64) -> Series {
        let count = degree + 1;
        let angle = |point: usize| (2 * point + 1) as f64 * PI / (2 * count) as f64;
        let values: Vec<f64> = (0..count)
            .map(|point| value(0.5 * (low + high) + 0.5 * (high - low) * angle(point).cos()))
            .collect();
        let mut result = Series::ZERO;
        for (term, out) in result.terms.iter_mut().take(count).enumerate() {
            let sum: f64 = (0..count)
                .map(|point| values[point] * (term as f64 * angle(point)).cos())
                .sum();
            *out = (if term == 0 { 1.0 } else { 2.0 } / count as f64 * sum).abs();
        }
        result
    }

    /// A function bounded by `most(height)` at distances up to `height` half lengths from the interval's line.
    fn entire(most: impl Fn(f64) -> f64) -> Series {
        let mut result = Series::constant(most(0.0));
        result.terms[1..].fill(2.0 * most(0.0));
        result.rest = f64::INFINITY;
        // A geometric range of ellipses: the best for each degree is within a small factor.
        for step in 1..=20 {
            let rho = 2.0_f64.powf(0.4 * f64::from(step));
            let bound = most(0.5 * (rho - 1.0 / rho));
            let mut power = 2.0 * bound;
            for term in &mut result.terms[1..] {
                power /= rho;
                *term = term.min(power);
            }
            result.rest = result.rest.min(power / rho / (1.0 - 1.0 / rho));
        }
        result
    }

    fn times(mut self, factor: f64) -> Series {
        for term in &mut self.terms {
            *term *= factor.abs();
        }
        self.rest *= factor.abs();
        self
    }

    fn sum(&self) -> f64 {
        self.terms.iter().sum::<f64>() + self.rest
    }

    /// Bounds the distance to the polynomials of a degree.
    fn above(&self, degree: usize) -> f64 {
        self.terms[(degree + 1).min(TERMS)..].iter().sum::<f64>() + self.rest
    }
}

impl Add for Series {
    type Output = Series;
    fn add(mut self, other: Series) -> Series {
        for (term, value) in self.terms.iter_mut().zip(other.terms) {
            *term += value;
        }
        self.rest += other.rest;
        self
    }
}

impl Mul for Series {
    type Output = Series;
    fn mul(self, other: Series) -> Series {
        let mut result = Series::ZERO;
        let whole = other.sum();
        // What the terms beyond the list come to is the whole product less those within.
        let mut beyond = self.rest * whole + (self.sum() - self.rest) * other.rest;
        let last = self
            .terms
            .iter()
            .rposition(|term| *term != 0.0)
            .map_or(0, |last| last + 1);
        let other_last = other
            .terms
            .iter()
            .rposition(|term| *term != 0.0)
            .map_or(0, |last| last + 1);
        for (i, a) in self.terms[..last].iter().enumerate() {
            for (k, b) in other.terms[..other_last].iter().enumerate() {
                match result.terms.get_mut(i + k) {
                    Some(term) => *term += a * b,
                    None => beyond += a * b,
                }
            }
        }
        result.rest = beyond;
        result
    }
}

/// A function and its derivatives by N coordinates.
#[derive(Clone, Copy, Debug)]
struct Bounds<const N: usize> {
    value: Series,
    slopes: [Series; N],
}

impl<const N: usize> Mul for Bounds<N> {
    type Output = Self;
    // The product rule is a sum.
    #[allow(clippy::suspicious_arithmetic_impl)]
    fn mul(self, other: Self) -> Self {
        Bounds {
            value: self.value * other.value,
            slopes: std::array::from_fn(|d| self.slopes[d] * other.value + self.value * other.slopes[d]),
        }
    }
}

/// The kernel of an edge's j-th bubble where its argument runs from `low` to `high`, and its derivative.
fn kernel(basis: &dyn Basis, j: usize, low: f64, high: f64) -> [Series; 2] {
    let half = 0.5 * (high - low);
    match basis.frequency(j) {
        Some(frequency) if frequency > 0.0 => {
            let a = frequency * PI;
            // Half as high in x as in s.
            [
                Series::entire(|height| 2.0 * SQRT_2 * (0.5 * a * half * height).cosh()),
                Series::entire(|height| SQRT_2 * a * (0.5 * a * half * height + 1.0).cosh()),
            ]
        }
        _ => [0, 1].map(|part| Series::polynomial(j - 1, low, high, |s| basis.kernel(j, s)[part])),
    }
}

/// The k-th factor where its argument runs from `low` to `high`, and its derivative.
fn factor(basis: &dyn Basis, k: usize, low: f64, high: f64) -> [Series; 2] {
    let half = 0.5 * (high - low);
    match basis.factor_frequency(k) {
        Some(frequency) if frequency > 0.0 => {
            let a = frequency * PI;
            [SQRT_2, SQRT_2 * a].map(|size| Series::entire(|height| size * (a * half * height).cosh()))
        }
        _ => [0, 1].map(|part| Series::polynomial(k, low, high, |x| basis.factor(k, x)[part])),
    }
}

/// Sizes and errors of interpolants of one function: of the value, and of the derivatives by N coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interpolated<const N: usize> {
    pub(super) size: f64,
    pub(super) error: f64,
    pub(super) slope_sizes: [f64; N],
    pub(super) slope_errors: [f64; N],
}

/// The barycentric coordinates on a part with these corners, their ranges and derivatives.
struct Part<const N: usize, const M: usize> {
    /// At the corners of the part.
    weights: Vec<[f64; M]>,
}

impl<const N: usize, const M: usize> Part<N, M> {
    fn new(corners: &[[f64; N]]) -> Self {
        let weights = corners.iter().map(|corner| {
            std::array::from_fn(|place| match place {
                0 => 1.0 - corner.iter().sum::<f64>(),
                _ => corner[place - 1],
            })
        });
        Part {
            weights: weights.collect(),
        }
    }

    fn range(&self, form: impl Fn(&[f64; M]) -> f64) -> [f64; 2] {
        let values = self.weights.iter().map(form);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    }

    /// Derivative of a barycentric coordinate.
    fn slope(corner: usize, direction: usize) -> f64 {
        match corner {
            0 => -1.0,
            _ => f64::from(u8::from(corner == direction + 1)),
        }
    }

    fn corner(&self, corner: usize) -> Bounds<N> {
        let [low, high] = self.range(|weights| weights[corner]);
        Bounds {
            value: Series::linear(low, high),
            slopes: std::array::from_fn(|direction| Series::constant(Self::slope(corner, direction))),
        }
    }

    fn edge(&self, basis: &dyn Basis, a: usize, b: usize, j: usize) -> Bounds<N> {
        let [low, high] = self.range(|weights| weights[b] - weights[a]);
        let [value, slope] = kernel(basis, j, low, high);
        let along = Bounds {
            value,
            slopes: std::array::from_fn(|d| slope.times(Self::slope(b, d) - Self::slope(a, d))),
        };
        self.corner(a) * self.corner(b) * along
    }

    fn weighted(&self, basis: &dyn Basis, corner: usize, k: usize) -> Bounds<N> {
        let [low, high] = self.range(|weights| weights[corner]);
        let [value, slope] = factor(basis, k, low, high);
        self.corner(corner)
            * Bounds {
                value,
                slopes: std::array::from_fn(|d| slope.times(Self::slope(corner, d))),
            }
    }
}

/// Bounds for interpolation at the points of a conversion, on top of the distance to polynomials of its degree.
fn interpolated<const N: usize>(
    rows: Vec<Bounds<N>>,
    degree: usize,
    conversion: &Conversion<N>,
) -> Vec<Interpolated<N>> {
    let error = |series: &Series| (1.0 + conversion.lebesgue) * series.above(degree);
    rows.iter()
        .map(|bounds| Interpolated {
            size: bounds.value.sum(),
            error: error(&bounds.value),
            slope_sizes: bounds.slopes.map(|slope| slope.sum()),
            slope_errors: bounds.slopes.map(|slope| error(&slope)),
        })
        .collect()
}

/// For each function of a triangle, in the order of the table, on a part of it.
pub(super) fn triangle_errors(
    basis: &dyn Basis,
    order: usize,
    last: usize,
    corners: &[[f64; 2]; 3],
    degree: usize,
    conversion: &Conversion<2>,
) -> Vec<Interpolated<2>> {
    let part = Part::<2, 3>::new(corners);
    let rows = triangle_row(
        order,
        last,
        &[0, 1, 2].map(|corner| part.corner(corner)),
        |a, b, j| part.edge(basis, a, b, j),
        |corner, k| part.weighted(basis, corner, k),
    );
    interpolated(rows, degree, conversion)
}

/// For each function of a tetrahedron, in the order of the table, on a part of it.
pub(super) fn tetrahedron_errors(
    basis: &dyn Basis,
    order: usize,
    corners: &[[f64; 3]; 4],
    degree: usize,
    conversion: &Conversion<3>,
) -> Vec<Interpolated<3>> {
    let part = Part::<3, 4>::new(corners);
    let rows = tetrahedron_row(
        order,
        &[0, 1, 2, 3].map(|corner| part.corner(corner)),
        |a, b, j| part.edge(basis, a, b, j),
        |corner, k| part.weighted(basis, corner, k),
    );
    interpolated(rows, degree, conversion)
}
