//! Eight numbers side by side: the storage of all vector kernels, and their portable arithmetic.

use super::elementary;
use super::scalar::{Real, Scalar};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

/// Numbers per [`Lanes`].
pub const WIDTH: usize = 8;

/// Eight `f64` in one cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; WIDTH]);

impl Lanes {
    pub const ZERO: Lanes = Lanes([0.0; WIDTH]);
}

/// Eight numbers in the registers of some processor; reads and writes [`Lanes`].
pub trait Vector: Real {
    fn load(lanes: &Lanes) -> Self;
    fn store(self, lanes: &mut Lanes);
    /// Bit `i` tells of lane `i`.
    fn bits(mask: Self::Mask) -> u8;

    /// The smallest of the eight numbers, which must not be not-a-number.
    #[inline(always)]
    fn smallest(self) -> f64 {
        let mut lanes = Lanes::ZERO;
        self.store(&mut lanes);
        let [a, b, c, d, e, f, g, h] = lanes.0;
        let lower = |x: f64, y: f64| if y < x { y } else { x };
        lower(lower(lower(a, b), lower(c, d)), lower(lower(e, f), lower(g, h)))
    }
}

/// Loads every element of an array.
#[inline(always)]
pub fn load<V: Vector, const N: usize>(lanes: &[Lanes; N]) -> [V; N] {
    let mut result = [V::constant(0.0); N];
    for i in 0..N {
        result[i] = V::load(&lanes[i]);
    }
    result
}

/// Stores every element of an array.
#[inline(always)]
pub fn store<V: Vector, const N: usize>(values: [V; N], lanes: &mut [Lanes; N]) {
    for i in 0..N {
        values[i].store(&mut lanes[i]);
    }
}

/// One truth value a lane.
#[derive(Clone, Copy, Debug)]
pub struct LanesMask([bool; WIDTH]);

#[inline(always)]
fn each(mut f: impl FnMut(usize) -> f64) -> Lanes {
    let mut result = [0.0; WIDTH];
    for (i, entry) in result.iter_mut().enumerate() {
        *entry = f(i);
    }
    Lanes(result)
}

#[inline(always)]
fn each_mask(mut f: impl FnMut(usize) -> bool) -> LanesMask {
    let mut result = [false; WIDTH];
    for (i, entry) in result.iter_mut().enumerate() {
        *entry = f(i);
    }
    LanesMask(result)
}

impl Add for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn add(self, other: Lanes) -> Lanes {
        each(|i| self.0[i] + other.0[i])
    }
}
impl Sub for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn sub(self, other: Lanes) -> Lanes {
        each(|i| self.0[i] - other.0[i])
    }
}
impl Mul for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, other: Lanes) -> Lanes {
        each(|i| self.0[i] * other.0[i])
    }
}
impl Div for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn div(self, other: Lanes) -> Lanes {
        each(|i| self.0[i] / other.0[i])
    }
}
impl Neg for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn neg(self) -> Lanes {
        each(|i| -self.0[i])
    }
}
impl BitAnd for LanesMask {
    type Output = LanesMask;
    #[inline(always)]
    fn bitand(self, other: LanesMask) -> LanesMask {
        each_mask(|i| self.0[i] & other.0[i])
    }
}
impl BitOr for LanesMask {
    type Output = LanesMask;
    #[inline(always)]
    fn bitor(self, other: LanesMask) -> LanesMask {
        each_mask(|i| self.0[i] | other.0[i])
    }
}

impl Scalar for Lanes {
    #[inline(always)]
    fn constant(value: f64) -> Lanes {
        Lanes([value; WIDTH])
    }
    #[inline(always)]
    fn sqrt(self) -> Lanes {
        each(|i| self.0[i].sqrt())
    }
    #[inline(always)]
    fn exp(self) -> Lanes {
        elementary::exp(self)
    }
    #[inline(always)]
    fn ln(self) -> Lanes {
        elementary::ln(self)
    }
    #[inline(always)]
    fn powf(self, exponent: f64) -> Lanes {
        elementary::powf(self, exponent)
    }
    #[inline(always)]
    fn where_negative(self, negative: Lanes, otherwise: Lanes) -> Lanes {
        each(|i| if self.0[i] < 0.0 { negative.0[i] } else { otherwise.0[i] })
    }
}

impl Real for Lanes {
    type Mask = LanesMask;

    #[inline(always)]
    fn abs(self) -> Lanes {
        each(|i| self.0[i].abs())
    }
    #[inline(always)]
    fn less(self, other: Lanes) -> LanesMask {
        each_mask(|i| self.0[i] < other.0[i])
    }
    #[inline(always)]
    fn select(mask: LanesMask, yes: Lanes, no: Lanes) -> Lanes {
        each(|i| if mask.0[i] { yes.0[i] } else { no.0[i] })
    }
    #[inline(always)]
    fn any(mask: LanesMask) -> bool {
        mask.0.iter().fold(false, |any, &lane| any | lane)
    }
    #[inline(always)]
    fn split(self) -> (Lanes, Lanes) {
        (each(|i| self.0[i].split().0), each(|i| self.0[i].split().1))
    }
    #[inline(always)]
    fn scale_binary(self, exponent: Lanes) -> Lanes {
        each(|i| self.0[i].scale_binary(exponent.0[i]))
    }
}

impl Vector for Lanes {
    #[inline(always)]
    fn load(lanes: &Lanes) -> Lanes {
        *lanes
    }
    #[inline(always)]
    fn store(self, lanes: &mut Lanes) {
        *lanes = self;
    }
    #[inline(always)]
    fn bits(mask: LanesMask) -> u8 {
        (0..WIDTH).fold(0, |bits, i| bits | u8::from(mask.0[i]) << i)
    }
}
