//! Signed singular value decomposition of a 3x3 matrix.
//!
//! One-sided Jacobi rotations of the columns (Hestenes 1958): small singular values keep their relative accuracy, and
//! every step is branch-free, so that eight matrices go side by side. Converged matrices are left alone, therefore a
//! matrix gives the same bits alone and among others.

use super::scalar::Real;
use super::vector3::{Columns, Vector3, add, cross, dot, subtract, times};

/// `matrix = U diag(s) V^T` with `U` and `V` rotations and `s0 >= s1 >= |s2|`; `s2` has the sign of the determinant.
#[derive(Clone, Copy, Debug)]
pub struct SignedSvd<R> {
    pub u: Columns<R>,
    pub s: Vector3<R>,
    pub v: Columns<R>,
}

/// Three or four sweeps are usual; more only help matrices at the edge of the number range.
const SWEEPS: usize = 12;
/// Square of the largest cosine between columns that counts as orthogonal.
const ORTHOGONAL: f64 = 1e-30;

/// A power of two near `largest` and its inverse, 1 for numbers that have none.
#[inline(always)]
pub(super) fn binary_scale<R: Real>(largest: R) -> (R, R) {
    let one = R::constant(1.0);
    let usable = R::constant(1e-290).less(largest) & largest.less(R::constant(1e290));
    let (_, exponent) = R::select(usable, largest, one).split();
    (one.scale_binary(exponent), one.scale_binary(-exponent))
}

/// Cosine and sine that make columns with squared norms `alpha`, `beta` and product `gamma` orthogonal.
#[inline(always)]
pub(super) fn rotation<R: Real>(alpha: R, beta: R, gamma: R) -> (R, R) {
    let one = R::constant(1.0);
    let difference = beta - alpha;
    let twice = gamma + gamma;
    // tan(2 angle) = twice / difference, the smaller angle: t = twice / (d + sign(d) sqrt(d^2 + twice^2)).
    let root = (difference * difference + twice * twice).sqrt();
    let t = twice / difference.where_negative(difference - root, difference + root);
    let cosine = one / (one + t * t).sqrt();
    (cosine, cosine * t)
}

#[inline(always)]
fn rotate<R: Real>(columns: &mut Columns<R>, p: usize, q: usize, cosine: R, sine: R) {
    let (a, b) = (columns[p], columns[q]);
    columns[p] = subtract(times(a, cosine), times(b, sine));
    columns[q] = add(times(a, sine), times(b, cosine));
}

/// Exchanges columns `p` and `q` where `swap`, with one sign so that the determinant stays.
#[inline(always)]
fn exchange<R: Real>(columns: &mut Columns<R>, p: usize, q: usize, swap: R::Mask) {
    for row in 0..3 {
        let (a, b) = (columns[p][row], columns[q][row]);
        columns[p][row] = R::select(swap, b, a);
        columns[q][row] = R::select(swap, -a, b);
    }
}

/// Any unit vector orthogonal to the unit vector `n` (Duff et al. 2017, Building an orthonormal basis, revisited).
#[inline(always)]
fn perpendicular<R: Real>(n: Vector3<R>) -> Vector3<R> {
    let one = R::constant(1.0);
    let sign = n[2].where_negative(-one, one);
    let a = -(one / (sign + n[2]));
    [one + sign * n[0] * n[0] * a, sign * n[0] * n[1] * a, -(sign * n[0])]
}

/// The decomposition of any finite matrix, singular ones included.
#[inline(always)]
pub fn signed_svd<R: Real>(matrix: &Columns<R>) -> SignedSvd<R> {
    let (zero, one) = (R::constant(0.0), R::constant(1.0));
    let mut largest = zero;
    for column in matrix {
        for &entry in column {
            largest = largest.max(entry.abs());
        }
    }
    let (scale, inverse) = binary_scale(largest);
    let mut b = *matrix;
    for column in &mut b {
        *column = times(*column, inverse);
    }
    let mut v = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (alpha, beta, gamma) = (dot(b[p], b[p]), dot(b[q], b[q]), dot(b[p], b[q]));
            let needed = (alpha * beta).scale(ORTHOGONAL).less(gamma * gamma);
            if R::any(needed) {
                rotated = true;
                let (cosine, sine) = rotation(alpha, beta, gamma);
                let (cosine, sine) = (R::select(needed, cosine, one), R::select(needed, sine, zero));
                rotate(&mut b, p, q, cosine, sine);
                rotate(&mut v, p, q, cosine, sine);
            }
        }
        if !rotated {
            break;
        }
    }
    let mut norms = [dot(b[0], b[0]), dot(b[1], b[1]), dot(b[2], b[2])];
    for (p, q) in [(0, 1), (1, 2), (0, 1)] {
        let swap = norms[p].less(norms[q]);
        exchange(&mut b, p, q, swap);
        exchange(&mut v, p, q, swap);
        let (a, c) = (norms[p], norms[q]);
        norms[p] = R::select(swap, c, a);
        norms[q] = R::select(swap, a, c);
    }
    let tiny = R::constant(1e-300);
    let some = tiny.less(norms[0]);
    let first = times(b[0], one / norms[0].sqrt());
    let u0 = [
        R::select(some, first[0], one),
        R::select(some, first[1], zero),
        R::select(some, first[2], zero),
    ];
    let rest = subtract(b[1], times(u0, dot(u0, b[1])));
    let square = dot(rest, rest);
    let some = tiny.less(square);
    let second = times(rest, one / square.sqrt());
    let other = perpendicular(u0);
    let u1 = [
        R::select(some, second[0], other[0]),
        R::select(some, second[1], other[1]),
        R::select(some, second[2], other[2]),
    ];
    let u2 = cross(u0, u1);
    let s2 = dot(u2, b[2]);
    let s1 = dot(u1, b[1]).max(s2.abs());
    let s0 = dot(u0, b[0]).max(s1);
    SignedSvd {
        u: [u0, u1, u2],
        s: [s0 * scale, s1 * scale, s2 * scale],
        v,
    }
}
