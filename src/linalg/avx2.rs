//! Eight numbers in two 256-bit registers.
//!
//! Safety of every `unsafe` block here: the values exist only inside [`Processor::run`](super::processor::Processor::run)
//! on a processor that was found to have AVX2.

use super::elementary;
use super::lanes::{Lanes, Vector};
use super::scalar::{MANTISSA, ONE, Real, Scalar, WHOLE, WHOLE_BIAS};
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

#[derive(Clone, Copy)]
pub struct Registers(__m256d, __m256d);

/// All bits set where true.
#[derive(Clone, Copy)]
pub struct Mask(__m256d, __m256d);

macro_rules! operator {
    ($trait:ident, $method:ident, $type:ident, $instruction:ident) => {
        impl $trait for $type {
            type Output = $type;
            #[inline(always)]
            fn $method(self, other: $type) -> $type {
                unsafe { $type($instruction(self.0, other.0), $instruction(self.1, other.1)) }
            }
        }
    };
}
operator!(Add, add, Registers, _mm256_add_pd);
operator!(Sub, sub, Registers, _mm256_sub_pd);
operator!(Mul, mul, Registers, _mm256_mul_pd);
operator!(Div, div, Registers, _mm256_div_pd);
operator!(BitAnd, bitand, Mask, _mm256_and_pd);
operator!(BitOr, bitor, Mask, _mm256_or_pd);

impl Neg for Registers {
    type Output = Registers;
    #[inline(always)]
    fn neg(self) -> Registers {
        let sign = Registers::constant(-0.0);
        unsafe { Registers(_mm256_xor_pd(self.0, sign.0), _mm256_xor_pd(self.1, sign.1)) }
    }
}

impl Scalar for Registers {
    #[inline(always)]
    fn constant(value: f64) -> Registers {
        unsafe { Registers(_mm256_set1_pd(value), _mm256_set1_pd(value)) }
    }
    #[inline(always)]
    fn sqrt(self) -> Registers {
        unsafe { Registers(_mm256_sqrt_pd(self.0), _mm256_sqrt_pd(self.1)) }
    }
    #[inline(always)]
    fn exp(self) -> Registers {
        elementary::exp(self)
    }
    #[inline(always)]
    fn ln(self) -> Registers {
        elementary::ln(self)
    }
    #[inline(always)]
    fn powf(self, exponent: f64) -> Registers {
        elementary::powf(self, exponent)
    }
    #[inline(always)]
    fn where_negative(self, negative: Registers, otherwise: Registers) -> Registers {
        Real::select(self.less(Registers::constant(0.0)), negative, otherwise)
    }
}

#[inline(always)]
fn split(x: __m256d) -> (__m256d, __m256d) {
    unsafe {
        let bits = _mm256_castpd_si256(x);
        let whole = _mm256_or_si256(_mm256_srli_epi64::<52>(bits), _mm256_set1_epi64x(WHOLE as i64));
        let exponent = _mm256_sub_pd(_mm256_castsi256_pd(whole), _mm256_set1_pd(WHOLE_BIAS));
        let mantissa = _mm256_and_si256(bits, _mm256_set1_epi64x(MANTISSA as i64));
        let mantissa = _mm256_or_si256(mantissa, _mm256_set1_epi64x(ONE as i64));
        (_mm256_castsi256_pd(mantissa), exponent)
    }
}

#[inline(always)]
fn power_of_two(exponent: __m256d) -> __m256d {
    unsafe {
        let whole = _mm256_castpd_si256(_mm256_add_pd(exponent, _mm256_set1_pd(WHOLE_BIAS)));
        _mm256_castsi256_pd(_mm256_slli_epi64::<52>(whole))
    }
}

impl Real for Registers {
    type Mask = Mask;

    #[inline(always)]
    fn abs(self) -> Registers {
        let sign = Registers::constant(-0.0);
        unsafe { Registers(_mm256_andnot_pd(sign.0, self.0), _mm256_andnot_pd(sign.1, self.1)) }
    }
    #[inline(always)]
    fn less(self, other: Registers) -> Mask {
        unsafe {
            Mask(
                _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0),
                _mm256_cmp_pd::<_CMP_LT_OQ>(self.1, other.1),
            )
        }
    }
    #[inline(always)]
    fn select(mask: Mask, yes: Registers, no: Registers) -> Registers {
        unsafe {
            Registers(
                _mm256_blendv_pd(no.0, yes.0, mask.0),
                _mm256_blendv_pd(no.1, yes.1, mask.1),
            )
        }
    }
    #[inline(always)]
    fn any(mask: Mask) -> bool {
        unsafe { _mm256_movemask_pd(_mm256_or_pd(mask.0, mask.1)) != 0 }
    }
    #[inline(always)]
    fn split(self) -> (Registers, Registers) {
        let (low, high) = (split(self.0), split(self.1));
        (Registers(low.0, high.0), Registers(low.1, high.1))
    }
    #[inline(always)]
    fn scale_binary(self, exponent: Registers) -> Registers {
        self * Registers(power_of_two(exponent.0), power_of_two(exponent.1))
    }
}

impl Vector for Registers {
    #[inline(always)]
    fn load(lanes: &Lanes) -> Registers {
        let start = lanes.0.as_ptr();
        // Lanes are aligned to 64 bytes and hold eight numbers.
        unsafe { Registers(_mm256_load_pd(start), _mm256_load_pd(start.add(4))) }
    }
    #[inline(always)]
    fn store(self, lanes: &mut Lanes) {
        let start = lanes.0.as_mut_ptr();
        unsafe {
            _mm256_store_pd(start, self.0);
            _mm256_store_pd(start.add(4), self.1);
        }
    }
    #[inline(always)]
    fn bits(mask: Mask) -> u8 {
        unsafe { (_mm256_movemask_pd(mask.0) | _mm256_movemask_pd(mask.1) << 4) as u8 }
    }
}
