//! Eight numbers in one 512-bit register.
//!
//! Safety of every `unsafe` block here: the values exist only inside [`Processor::run`](super::processor::Processor::run)
//! on a processor that was found to have AVX-512 F and DQ.

use super::elementary;
use super::lanes::{Lanes, Vector};
use super::scalar::{MANTISSA, ONE, Real, Scalar, WHOLE, WHOLE_BIAS};
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

#[derive(Clone, Copy)]
pub struct Register(__m512d);

#[derive(Clone, Copy)]
pub struct Mask(__mmask8);

macro_rules! operator {
    ($trait:ident, $method:ident, $instruction:ident) => {
        impl $trait for Register {
            type Output = Register;
            #[inline(always)]
            fn $method(self, other: Register) -> Register {
                Register(unsafe { $instruction(self.0, other.0) })
            }
        }
    };
}
operator!(Add, add, _mm512_add_pd);
operator!(Sub, sub, _mm512_sub_pd);
operator!(Mul, mul, _mm512_mul_pd);
operator!(Div, div, _mm512_div_pd);

impl Neg for Register {
    type Output = Register;
    #[inline(always)]
    fn neg(self) -> Register {
        Register(unsafe { _mm512_xor_pd(self.0, _mm512_set1_pd(-0.0)) })
    }
}
impl BitAnd for Mask {
    type Output = Mask;
    #[inline(always)]
    fn bitand(self, other: Mask) -> Mask {
        Mask(self.0 & other.0)
    }
}
impl BitOr for Mask {
    type Output = Mask;
    #[inline(always)]
    fn bitor(self, other: Mask) -> Mask {
        Mask(self.0 | other.0)
    }
}

impl Scalar for Register {
    #[inline(always)]
    fn constant(value: f64) -> Register {
        Register(unsafe { _mm512_set1_pd(value) })
    }
    #[inline(always)]
    fn sqrt(self) -> Register {
        Register(unsafe { _mm512_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn exp(self) -> Register {
        elementary::exp(self)
    }
    #[inline(always)]
    fn ln(self) -> Register {
        elementary::ln(self)
    }
    #[inline(always)]
    fn powf(self, exponent: f64) -> Register {
        elementary::powf(self, exponent)
    }
    #[inline(always)]
    fn where_negative(self, negative: Register, otherwise: Register) -> Register {
        Real::select(self.less(Register::constant(0.0)), negative, otherwise)
    }
}

impl Real for Register {
    type Mask = Mask;

    #[inline(always)]
    fn abs(self) -> Register {
        Register(unsafe { _mm512_andnot_pd(_mm512_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    fn less(self, other: Register) -> Mask {
        Mask(unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn select(mask: Mask, yes: Register, no: Register) -> Register {
        Register(unsafe { _mm512_mask_blend_pd(mask.0, no.0, yes.0) })
    }
    #[inline(always)]
    fn any(mask: Mask) -> bool {
        mask.0 != 0
    }
    #[inline(always)]
    fn split(self) -> (Register, Register) {
        unsafe {
            let bits = _mm512_castpd_si512(self.0);
            let whole = _mm512_or_si512(_mm512_srli_epi64::<52>(bits), _mm512_set1_epi64(WHOLE as i64));
            let exponent = _mm512_sub_pd(_mm512_castsi512_pd(whole), _mm512_set1_pd(WHOLE_BIAS));
            let mantissa = _mm512_and_si512(bits, _mm512_set1_epi64(MANTISSA as i64));
            let mantissa = _mm512_or_si512(mantissa, _mm512_set1_epi64(ONE as i64));
            (Register(_mm512_castsi512_pd(mantissa)), Register(exponent))
        }
    }
    #[inline(always)]
    fn scale_binary(self, exponent: Register) -> Register {
        unsafe {
            let whole = _mm512_castpd_si512(_mm512_add_pd(exponent.0, _mm512_set1_pd(WHOLE_BIAS)));
            let power = _mm512_castsi512_pd(_mm512_slli_epi64::<52>(whole));
            Register(_mm512_mul_pd(self.0, power))
        }
    }
}

impl Vector for Register {
    #[inline(always)]
    fn load(lanes: &Lanes) -> Register {
        // Lanes are aligned to 64 bytes.
        Register(unsafe { _mm512_load_pd(lanes.0.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, lanes: &mut Lanes) {
        unsafe { _mm512_store_pd(lanes.0.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn bits(mask: Mask) -> u8 {
        mask.0
    }
    #[inline(always)]
    fn smallest(self) -> f64 {
        unsafe { _mm512_reduce_min_pd(self.0) }
    }
}
