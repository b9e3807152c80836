//! Numbers of twice the digits as unevaluated sums of two (Dekker 1971), for sums that cancel.

use std::ops::{Add, Div, Mul};

/// `high + low` with `|low|` at most half a unit in the last place of `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DoubleDouble {
    pub(super) high: f64,
    low: f64,
}

impl From<f64> for DoubleDouble {
    fn from(high: f64) -> Self {
        DoubleDouble { high, low: 0.0 }
    }
}

/// `a + b` where `|a| >= |b|`.
fn renormalized(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble {
        high,
        low: b - (high - a),
    }
}

/// A number as the sum of two with half the digits each.
fn split(a: f64) -> [f64; 2] {
    // 2^27 + 1.
    let c = 134_217_729.0 * a;
    let high = c - (c - a);
    [high, a - high]
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let sum = self.high + other.high;
        let part = sum - self.high;
        let error = (self.high - (sum - part)) + (other.high - part);
        renormalized(sum, error + self.low + other.low)
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let product = self.high * other.high;
        let ([a, b], [c, d]) = (split(self.high), split(other.high));
        let error = ((a * c - product) + a * d + b * c) + b * d;
        renormalized(product, error + self.high * other.low + self.low * other.high)
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        // Two steps of long division.
        let first = self.high / other.high;
        let negated = |value: f64| DoubleDouble::from(-value);
        let rest = self + other * negated(first);
        let second = rest.high / other.high;
        let rest = rest + other * negated(second);
        renormalized(first, second) + DoubleDouble::from(rest.high / other.high)
    }
}
