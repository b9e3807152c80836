//! Numbers that formulas are written in.
//!
//! [`Scalar`] is what a formula needs, so that one formula serves plain numbers, vector lanes and derivatives
//! ([`Jet`](super::jet::Jet)). [`Real`] adds comparisons and the binary representation, for branch-free algorithms.

use super::elementary;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

/// A field with the elementary functions that energies are made of.
pub trait Scalar:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    fn constant(value: f64) -> Self;
    fn sqrt(self) -> Self;
    fn exp(self) -> Self;
    /// Natural logarithm: minus infinity at 0, not-a-number below.
    fn ln(self) -> Self;
    /// `self` to a constant power; `self` must be positive.
    fn powf(self, exponent: f64) -> Self;
    /// `negative` where `self < 0`, else `otherwise`.
    fn where_negative(self, negative: Self, otherwise: Self) -> Self;

    #[inline(always)]
    fn square(self) -> Self {
        self * self
    }
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self * Self::constant(factor)
    }
}

/// A [`Scalar`] that stands for one or several floating-point numbers, compared element by element.
pub trait Real: Scalar {
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    fn abs(self) -> Self;
    /// Whether `self < other`; false where either is not a number.
    fn less(self, other: Self) -> Self::Mask;
    /// `yes` where the mask holds, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn any(mask: Self::Mask) -> bool;
    /// `(m, e)` with `self = m 2^e` and `1 <= m < 2`, for positive normal numbers; unspecified for others.
    fn split(self) -> (Self, Self);
    /// `self 2^exponent` for a whole `exponent` in `[-1022, 1023]`; unspecified for others.
    fn scale_binary(self, exponent: Self) -> Self;

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(self.less(other), other, self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(other.less(self), other, self)
    }
    /// The nearest whole number, for `|self| < 2^51`.
    #[inline(always)]
    fn round_to_whole(self) -> Self {
        // At 1.5 * 2^52 the spacing of doubles is 1, so the sum rounds.
        let shift = Self::constant(6_755_399_441_055_744.0);
        (self + shift) - shift
    }
}

/// 2^52: doubles from here on are whole numbers, and their low bits are an integer.
pub(super) const WHOLE: u64 = 0x4330_0000_0000_0000;
pub(super) const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
pub(super) const ONE: u64 = 0x3ff0_0000_0000_0000;
/// 2^52 + 1023, removes the marker of [`WHOLE`] and the exponent's bias.
pub(super) const WHOLE_BIAS: f64 = 4_503_599_627_370_496.0 + 1023.0;

impl Scalar for f64 {
    #[inline(always)]
    fn constant(value: f64) -> f64 {
        value
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn exp(self) -> f64 {
        elementary::exp(self)
    }
    #[inline(always)]
    fn ln(self) -> f64 {
        elementary::ln(self)
    }
    #[inline(always)]
    fn powf(self, exponent: f64) -> f64 {
        elementary::powf(self, exponent)
    }
    #[inline(always)]
    fn where_negative(self, negative: f64, otherwise: f64) -> f64 {
        if self < 0.0 { negative } else { otherwise }
    }
}

impl Real for f64 {
    type Mask = bool;

    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }
    #[inline(always)]
    fn less(self, other: f64) -> bool {
        self < other
    }
    #[inline(always)]
    fn select(mask: bool, yes: f64, no: f64) -> f64 {
        if mask { yes } else { no }
    }
    #[inline(always)]
    fn any(mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn split(self) -> (f64, f64) {
        let bits = self.to_bits();
        let exponent = f64::from_bits((bits >> 52) | WHOLE) - WHOLE_BIAS;
        (f64::from_bits((bits & MANTISSA) | ONE), exponent)
    }
    #[inline(always)]
    fn scale_binary(self, exponent: f64) -> f64 {
        let bits = (exponent + WHOLE_BIAS).to_bits();
        self * f64::from_bits(bits << 52)
    }
}
