//! Exponential, logarithm and power for any [`Real`], branch-free.
//!
//! Written out here because a system's mathematical library differs between machines and cannot run in vector lanes.
//! Errors are at most 2 units in the last place for `exp` and `ln`, and about `|exponent ln x|` units for `powf`.

use super::scalar::Real;

const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// `1 + z/3 + z^2/5 + ...`, that is `atanh(f)/f` at `z = f^2`, to rounding for `z <= 0.0295`.
#[inline(always)]
fn atanh_over_argument<R: Real>(z: R) -> R {
    let mut sum = R::constant(1.0 / 23.0);
    for n in (0..11).rev() {
        sum = sum * z + R::constant(1.0 / (2 * n + 1) as f64);
    }
    sum
}

/// Natural logarithm: minus infinity at 0, not-a-number below.
///
/// `x = m 2^e` with `m` in `[sqrt(1/2), sqrt 2]`, and `ln m = 2 atanh((m-1)/(m+1))`.
#[inline(always)]
pub fn ln<R: Real>(x: R) -> R {
    let tiny = x.less(R::constant(f64::MIN_POSITIVE));
    let normal = R::select(tiny, x.scale(18_014_398_509_481_984.0), x); // 2^54
    let (m, e) = normal.split();
    let e = R::select(tiny, e - R::constant(54.0), e);
    let large = R::constant(std::f64::consts::SQRT_2).less(m);
    let m = R::select(large, m.scale(0.5), m);
    let e = R::select(large, e + R::constant(1.0), e);
    let f = (m - R::constant(1.0)) / (m + R::constant(1.0));
    let z = f * f;
    let twice = f + f;
    // 2 atanh f = 2f + 2f (z/3 + ...): the large part is added last.
    let rest = twice * (atanh_over_argument(z) - R::constant(1.0));
    let result = e.scale(LN2_HIGH) + (twice + (rest + e.scale(LN2_LOW)));
    let zero = R::constant(0.0);
    let result = R::select(
        zero.less(x),
        result,
        R::select(x.less(zero), R::constant(f64::NAN), R::constant(f64::NEG_INFINITY)),
    );
    // Infinity and not-a-number stay what they are.
    R::select(x.less(R::constant(f64::INFINITY)), result, x)
}

/// Exponential: 0 below -745.2, infinity above 709.8.
///
/// `x = k ln 2 + r` with `|r| <= ln(2)/2`, and the Taylor polynomial of degree 13 at `r`.
#[inline(always)]
pub fn exp<R: Real>(x: R) -> R {
    let lowest = R::constant(-746.0);
    let highest = R::constant(710.0);
    let y = R::select(x.less(lowest), lowest, R::select(highest.less(x), highest, x));
    let k = y.scale(std::f64::consts::LOG2_E).round_to_whole();
    let r = (y - k.scale(LN2_HIGH)) - k.scale(LN2_LOW);
    let mut sum = R::constant(1.0 / 6_227_020_800.0);
    let mut factorial = 6_227_020_800.0;
    for n in (2..13).rev() {
        factorial /= (n + 1) as f64;
        sum = sum * r + R::constant(1.0 / factorial);
    }
    let power = R::constant(1.0) + (r + r * r * sum);
    // In two steps, because 2^k itself may be out of range where the result is not.
    let half = k.scale(0.5).round_to_whole();
    power.scale_binary(half).scale_binary(k - half)
}

/// `x^exponent` for positive `x`.
#[inline(always)]
pub fn powf<R: Real>(x: R, exponent: f64) -> R {
    exp(ln(x).scale(exponent))
}

/// The divided difference `(ln a - ln b) / (a - b)` of positive numbers, `1/a` where they are equal, without
/// cancellation.
#[inline(always)]
pub fn ln_divided_difference<R: Real>(a: R, b: R) -> R {
    let sum = a + b;
    let difference = a - b;
    let w = difference / sum;
    let near = w.abs().less(R::constant(0.171));
    // ln a - ln b = 2 atanh(w); near 0 the series has no cancellation, elsewhere the logarithms differ enough.
    let z = R::select(near, w * w, R::constant(0.0));
    let series = (atanh_over_argument(z) + atanh_over_argument(z)) / sum;
    R::select(near, series, (ln(a) - ln(b)) / difference)
}
