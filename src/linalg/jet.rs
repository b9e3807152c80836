//! Value, gradient and Hessian of a formula in three variables, by forward differentiation.

use super::scalar::Scalar;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A second-order Taylor expansion in three variables.
#[derive(Clone, Copy, Debug)]
pub struct Jet<T> {
    pub value: T,
    pub gradient: [T; 3],
    /// Second derivatives in the order 00, 01, 02, 11, 12, 22.
    pub hessian: [T; 6],
}

/// Row and column of the entries of a symmetric 3x3 matrix stored as six numbers.
pub const SYMMETRIC: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

impl<T: Scalar> Jet<T> {
    /// The variable number `index` with this value.
    #[inline(always)]
    pub fn variable(value: T, index: usize) -> Jet<T> {
        let mut jet = Jet::constant(0.0);
        jet.value = value;
        jet.gradient[index] = T::constant(1.0);
        jet
    }

    /// `f(self)` from `f` and its first two derivatives at `self.value`.
    #[inline(always)]
    fn chain(self, value: T, first: T, second: T) -> Jet<T> {
        let mut result = Jet {
            value,
            gradient: self.gradient,
            hessian: self.hessian,
        };
        for i in 0..3 {
            result.gradient[i] = first * self.gradient[i];
        }
        for (k, &(i, j)) in SYMMETRIC.iter().enumerate() {
            result.hessian[k] = first * self.hessian[k] + second * self.gradient[i] * self.gradient[j];
        }
        result
    }
}

impl<T: Scalar> Add for Jet<T> {
    type Output = Jet<T>;
    #[inline(always)]
    fn add(mut self, other: Jet<T>) -> Jet<T> {
        self.value = self.value + other.value;
        for i in 0..3 {
            self.gradient[i] = self.gradient[i] + other.gradient[i];
        }
        for k in 0..6 {
            self.hessian[k] = self.hessian[k] + other.hessian[k];
        }
        self
    }
}

impl<T: Scalar> Neg for Jet<T> {
    type Output = Jet<T>;
    #[inline(always)]
    fn neg(mut self) -> Jet<T> {
        self.value = -self.value;
        for i in 0..3 {
            self.gradient[i] = -self.gradient[i];
        }
        for k in 0..6 {
            self.hessian[k] = -self.hessian[k];
        }
        self
    }
}

impl<T: Scalar> Sub for Jet<T> {
    type Output = Jet<T>;
    #[inline(always)]
    fn sub(self, other: Jet<T>) -> Jet<T> {
        self + (-other)
    }
}

impl<T: Scalar> Mul for Jet<T> {
    type Output = Jet<T>;
    #[inline(always)]
    fn mul(self, other: Jet<T>) -> Jet<T> {
        let (a, b) = (self, other);
        let mut result = a;
        result.value = a.value * b.value;
        for i in 0..3 {
            result.gradient[i] = a.gradient[i] * b.value + a.value * b.gradient[i];
        }
        for (k, &(i, j)) in SYMMETRIC.iter().enumerate() {
            let cross = a.gradient[i] * b.gradient[j] + a.gradient[j] * b.gradient[i];
            result.hessian[k] = a.hessian[k] * b.value + cross + a.value * b.hessian[k];
        }
        result
    }
}

impl<T: Scalar> Div for Jet<T> {
    type Output = Jet<T>;
    #[inline(always)]
    fn div(self, other: Jet<T>) -> Jet<T> {
        let inverse = T::constant(1.0) / other.value;
        let square = inverse * inverse;
        let mut result = self * other.chain(inverse, -square, (square * inverse).scale(2.0));
        // The quotient itself with one rounding, as on plain numbers.
        result.value = self.value / other.value;
        result
    }
}

impl<T: Scalar> Scalar for Jet<T> {
    #[inline(always)]
    fn constant(value: f64) -> Jet<T> {
        let zero = T::constant(0.0);
        Jet {
            value: T::constant(value),
            gradient: [zero; 3],
            hessian: [zero; 6],
        }
    }
    #[inline(always)]
    fn sqrt(self) -> Jet<T> {
        let root = self.value.sqrt();
        let first = T::constant(0.5) / root;
        self.chain(root, first, -(first.scale(0.5) / self.value))
    }
    #[inline(always)]
    fn exp(self) -> Jet<T> {
        let value = self.value.exp();
        self.chain(value, value, value)
    }
    #[inline(always)]
    fn ln(self) -> Jet<T> {
        let inverse = T::constant(1.0) / self.value;
        self.chain(self.value.ln(), inverse, -(inverse * inverse))
    }
    #[inline(always)]
    fn powf(self, exponent: f64) -> Jet<T> {
        let value = self.value.powf(exponent);
        let first = value.scale(exponent) / self.value;
        self.chain(value, first, first.scale(exponent - 1.0) / self.value)
    }
    #[inline(always)]
    fn where_negative(self, negative: Jet<T>, otherwise: Jet<T>) -> Jet<T> {
        let mut result = otherwise;
        result.value = self.value.where_negative(negative.value, otherwise.value);
        for i in 0..3 {
            result.gradient[i] = self.value.where_negative(negative.gradient[i], otherwise.gradient[i]);
        }
        for k in 0..6 {
            result.hessian[k] = self.value.where_negative(negative.hessian[k], otherwise.hessian[k]);
        }
        result
    }
    /// Shares the products that are equal.
    #[inline(always)]
    fn square(self) -> Jet<T> {
        self.chain(self.value * self.value, self.value + self.value, T::constant(2.0))
    }
    #[inline(always)]
    fn scale(mut self, factor: f64) -> Jet<T> {
        self.value = self.value.scale(factor);
        for i in 0..3 {
            self.gradient[i] = self.gradient[i].scale(factor);
        }
        for k in 0..6 {
            self.hessian[k] = self.hessian[k].scale(factor);
        }
        self
    }
}
