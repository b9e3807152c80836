//! The first moment at which a moving tetrahedron is flat (Smith, Schaefer 2015): a root of a cubic polynomial.

use crate::linalg::elementary::powf;

/// The smaller of `least` and the smallest positive root of `p(t) = 1 + a t + b t^2 + c t^3`; 0 where a coefficient is
/// not finite.
pub fn smallest_positive_root(a: f64, b: f64, c: f64, least: f64) -> f64 {
    if !(a.is_finite() && b.is_finite() && c.is_finite()) {
        return 0.0;
    }
    if (a >= 0.0 && b >= 0.0 && c >= 0.0) || positive_until(a, b, c, least) {
        return least;
    }
    let p = |t: f64| ((c * t + b) * t + a) * t + 1.0;
    // Between the zeros of p' the polynomial is monotonic.
    let mut ends = [f64::INFINITY; 3];
    let discriminant = b * b - 3.0 * a * c;
    if discriminant > 0.0 {
        let q = -(b + discriminant.sqrt().copysign(b));
        let (x, y) = (q / (3.0 * c), a / q);
        let positive = |t: f64| if t > 0.0 { t } else { f64::INFINITY };
        let (x, y) = (positive(x), positive(y));
        (ends[0], ends[1]) = (x.min(y), x.max(y));
    }
    // No root is nearer than this, for there the three terms sum to at most 1.
    let near = 1.0 / (a.abs() + b.abs().sqrt() + if c == 0.0 { 0.0 } else { powf(c.abs(), 1.0 / 3.0) });
    let mut low = 0.0;
    for end in ends {
        if end.is_finite() {
            if p(end) <= 0.0 {
                return least.min(refine(a, b, c, low, end));
            }
            low = end;
            continue;
        }
        let falls = if c != 0.0 {
            c < 0.0
        } else if b != 0.0 {
            b < 0.0
        } else {
            a < 0.0
        };
        if !falls {
            return least;
        }
        let mut high = near.max(low);
        while p(high) > 0.0 && high < f64::MAX {
            low = high;
            high *= 2.0;
        }
        return if p(high) > 0.0 {
            least
        } else {
            least.min(refine(a, b, c, low, high))
        };
    }
    least
}

/// Whether `p > 0` on `[0, end]` for sure, by its Bernstein coefficients; rounding is far below the margin.
fn positive_until(a: f64, b: f64, c: f64, end: f64) -> bool {
    const MARGIN: f64 = 1e-9;
    if end == f64::INFINITY {
        return false;
    }
    let (x, y, z) = (a * end, b * end * end, c * end * end * end);
    let least = (1.0 + x / 3.0).min(1.0 + (2.0 * x + y) / 3.0).min(1.0 + x + y + z);
    least > MARGIN * (1.0 + x.abs() + y.abs() + z.abs())
}

/// The root in `[low, high]` where `p(low) > 0 >= p(high)` and p is monotonic: Newton steps kept inside by bisection.
fn refine(a: f64, b: f64, c: f64, mut low: f64, mut high: f64) -> f64 {
    let mut t = 0.5 * (low + high);
    for _ in 0..200 {
        let value = ((c * t + b) * t + a) * t + 1.0;
        if value > 0.0 {
            low = t;
        } else {
            high = t;
        }
        let slope = (3.0 * c * t + 2.0 * b) * t + a;
        let newton = t - value / slope;
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - t).abs() <= 2e-16 * t || next <= low || next >= high {
            return next;
        }
        t = next;
    }
    low
}
