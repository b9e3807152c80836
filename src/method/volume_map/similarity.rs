//! The similarity that carries a set of points closest to another: a rotation, a scale and a translation.
//!
//! Two fits: the closed form of Umeyama (1991), exact and independent of units; and the fit with thirteen variables of
//! the volume-map paper (section 4.2), kept to compare with it. The latter is not independent of units, since its
//! second term does not grow with the number of points.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// `x -> scale * rotation * x + translation`; `rotation` has determinant 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Similarity {
    pub scale: f64,
    pub rotation: Matrix3<f64>,
    pub translation: Vector3<f64>,
}

impl Similarity {
    pub fn apply(&self, point: [f64; 3]) -> [f64; 3] {
        (self.scale * (self.rotation * Vector3::from(point)) + self.translation).into()
    }
}

/// Sums over the pairs of points, about their means.
struct Moments {
    from_mean: Vector3<f64>,
    to_mean: Vector3<f64>,
    /// Sum of `x x^T`.
    from_from: Matrix3<f64>,
    /// Sum of `y x^T`.
    to_from: Matrix3<f64>,
}

fn moments(from: &[[f64; 3]], to: &[[f64; 3]]) -> Moments {
    let count = from.len().max(1) as f64;
    let mean = |points: &[[f64; 3]]| points.iter().fold(Vector3::zeros(), |sum, &p| sum + Vector3::from(p)) / count;
    let (from_mean, to_mean) = (mean(from), mean(to));
    let mut from_from = Matrix3::zeros();
    let mut to_from = Matrix3::zeros();
    for (&x, &y) in from.iter().zip(to) {
        let x = Vector3::from(x) - from_mean;
        let y = Vector3::from(y) - to_mean;
        from_from += x * x.transpose();
        to_from += y * x.transpose();
    }
    Moments {
        from_mean,
        to_mean,
        from_from,
        to_from,
    }
}

/// The rotation `U V^T` nearest to `matrix`, its last column negated where the determinant asks for it, and the sum of
/// the singular values with that sign.
fn nearest_rotation(matrix: &Matrix3<f64>) -> (Matrix3<f64>, f64) {
    let svd = matrix.svd(true, true);
    let u = svd.u.unwrap_or_else(Matrix3::identity);
    let v_t = svd.v_t.unwrap_or_else(Matrix3::identity);
    let mut signs = Vector3::new(1.0, 1.0, 1.0);
    if (u * v_t).determinant() < 0.0 {
        // The smallest singular value is the cheapest to turn over.
        let smallest = svd.singular_values.imin();
        signs[smallest] = -1.0;
    }
    (
        u * Matrix3::from_diagonal(&signs) * v_t,
        svd.singular_values.dot(&signs),
    )
}

/// Least squares over all similarities: `min sum |s R x + t - y|^2` (Umeyama 1991).
pub fn closed_form(from: &[[f64; 3]], to: &[[f64; 3]]) -> Similarity {
    let moments = moments(from, to);
    let (rotation, trace) = nearest_rotation(&moments.to_from);
    let spread = moments.from_from.trace();
    let scale = if spread > 0.0 { trace / spread } else { 1.0 };
    let translation = moments.to_mean - scale * (rotation * moments.from_mean);
    Similarity {
        scale,
        rotation,
        translation,
    }
}

/// The paper's fit: `min sum |Q x + t - y|^2 + |Q^T Q - s^2 I|^2` over matrix, translation and scale, then the
/// rotation nearest to `Q` and the scale `|s|`.
///
/// Translation and scale are eliminated: `t` joins the means and `s^2 = tr(Q^T Q) / 3`, which leaves
/// `f(Q) = |Q X - Y|^2 + |Q^T Q|^2 - tr(Q^T Q)^2 / 3`. Newton's method with a Levenberg shift from the closed form.
pub fn thirteen_variables(from: &[[f64; 3]], to: &[[f64; 3]]) -> Similarity {
    let moments = moments(from, to);
    let (a, b) = (moments.from_from, moments.to_from);
    let start = closed_form(from, to);
    let mut q = start.scale * start.rotation;
    // Constant |Y|^2 left out.
    let value = |q: &Matrix3<f64>| {
        let gram = q.transpose() * q;
        (q * a).dot(q) - 2.0 * q.dot(&b) + gram.norm_squared() - gram.trace().powi(2) / 3.0
    };
    let gradient = |q: &Matrix3<f64>| {
        let gram = q.transpose() * q;
        2.0 * (q * a - b) + 4.0 * q * gram - 4.0 / 3.0 * gram.trace() * q
    };
    for _ in 0..200 {
        let g = gradient(&q);
        if g.norm() <= 1e-13 * (1.0 + b.norm()) {
            break;
        }
        let gram = q.transpose() * q;
        let mut hessian = DMatrix::<f64>::zeros(9, 9);
        for column in 0..9 {
            let mut d = Matrix3::zeros();
            d[column] = 1.0;
            let change = 2.0 * d * a + 4.0 * (d * gram + q * d.transpose() * q + q * q.transpose() * d)
                - 4.0 / 3.0 * (2.0 * q.dot(&d) * q + gram.trace() * d);
            hessian.column_mut(column).copy_from_slice(change.as_slice());
        }
        let right = DVector::from_column_slice((-g).as_slice());
        let mut shift = 0.0;
        let size = hessian.norm();
        let mut step = None;
        for _ in 0..60 {
            let shifted = &hessian + shift * DMatrix::<f64>::identity(9, 9);
            if let Some(factor) = shifted.cholesky() {
                step = Some(factor.solve(&right));
                break;
            }
            shift = if shift == 0.0 { 1e-12 * size } else { 10.0 * shift };
        }
        let Some(step) = step else { break };
        let direction = Matrix3::from_column_slice(step.as_slice());
        let slope = g.dot(&direction);
        let before = value(&q);
        let mut length = 1.0;
        let mut accepted = false;
        for _ in 0..60 {
            let next = q + length * direction;
            // The margin lets the last steps through, whose decrease is below rounding.
            if value(&next) <= before + 1e-4 * length * slope + 1e-15 * before.abs() {
                q = next;
                accepted = true;
                break;
            }
            length *= 0.5;
        }
        if !accepted || length * direction.norm() <= 1e-15 * q.norm() {
            break;
        }
    }
    let (rotation, _) = nearest_rotation(&q);
    let translation = moments.to_mean - q * moments.from_mean;
    Similarity {
        scale: ((q.transpose() * q).trace() / 3.0).sqrt(),
        rotation,
        translation,
    }
}
