//! Surfaces given by a formula, as the zero set of a smooth function that is negative inside.

use crate::linalg::jet::{Jet, SYMMETRIC};
use crate::linalg::scalar::Scalar;
use crate::linalg::vector3::{dot, subtract};
use crate::mesh::length;
use nalgebra::{Matrix4, Vector4};

/// A bump on a star-shaped surface: the radius in the unit direction `q` grows by `height exp(sharpness (q . direction
/// - 1))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bump {
    /// Of length 1.
    pub direction: [f64; 3],
    pub height: f64,
    pub sharpness: f64,
}

/// A surface given by a formula.
#[derive(Clone, Debug, PartialEq)]
pub enum Analytic {
    /// With these half axes, about the origin.
    Ellipsoid { axes: [f64; 3] },
    /// About the z-axis: the tube of radius `tube` around a circle of radius `ring`.
    Torus { ring: f64, tube: f64 },
    /// The surface of radius `1 + sum of bumps` in every direction, stretched by `axes`.
    Star { axes: [f64; 3], bumps: Vec<Bump> },
    /// The graph `z = height (x^2 - y^2 + x y^2)`, an open surface.
    Saddle { height: f64 },
    /// `sum weights (x - centre)^2 + linear . x = constant`: a plane, a sphere, a cylinder.
    Quadric {
        weights: [f64; 3],
        centre: [f64; 3],
        linear: [f64; 3],
        constant: f64,
    },
    /// The graph `z = -bowl (x^2 + y^2) - height side x max(y, 0)^3`: one side of a crease that fades out.
    Ridge { height: f64, bowl: f64, side: f64 },
}

/// The level function of an [`Analytic`] surface and its derivatives at a point.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    pub value: f64,
    pub gradient: [f64; 3],
    pub hessian: [[f64; 3]; 3],
}

impl Analytic {
    /// The function whose zero set is the surface: negative inside (below, for a graph).
    fn level<S: Scalar>(&self, x: [S; 3]) -> S {
        let one = S::constant(1.0);
        match self {
            Analytic::Ellipsoid { axes } => {
                x[0].scale(1.0 / axes[0]).square()
                    + x[1].scale(1.0 / axes[1]).square()
                    + x[2].scale(1.0 / axes[2]).square()
                    - one
            }
            Analytic::Torus { ring, tube } => {
                let radius = (x[0].square() + x[1].square()).sqrt();
                (radius - S::constant(*ring)).square() + x[2].square() - S::constant(tube * tube)
            }
            Analytic::Star { axes, bumps } => {
                let y: [S; 3] = std::array::from_fn(|axis| x[axis].scale(1.0 / axes[axis]));
                let radius = (y[0].square() + y[1].square() + y[2].square()).sqrt();
                let mut allowed = one;
                for bump in bumps {
                    let along =
                        y[0].scale(bump.direction[0]) + y[1].scale(bump.direction[1]) + y[2].scale(bump.direction[2]);
                    allowed = allowed + (along / radius - one).scale(bump.sharpness).exp().scale(bump.height);
                }
                radius - allowed
            }
            Analytic::Quadric {
                weights,
                centre,
                linear,
                constant,
            } => {
                let mut sum = S::constant(-constant);
                for axis in 0..3 {
                    let away = x[axis] - S::constant(centre[axis]);
                    sum = sum + away.square().scale(weights[axis]) + x[axis].scale(linear[axis]);
                }
                sum
            }
            Analytic::Ridge { height, bowl, side } => {
                let rise = x[1].where_negative(S::constant(0.0), x[1] * x[1].square());
                x[2] + (x[0].square() + x[1].square()).scale(*bowl) + (x[0] * rise).scale(height * side)
            }
            Analytic::Saddle { height } => x[2] - (x[0].square() - x[1].square() + x[0] * x[1].square()).scale(*height),
        }
    }

    /// The level function with its gradient and Hessian.
    pub fn derivatives(&self, x: [f64; 3]) -> Level {
        let jet = self.level::<Jet<f64>>(std::array::from_fn(|axis| Jet::variable(x[axis], axis)));
        let mut hessian = [[0.0; 3]; 3];
        for (&(row, column), value) in SYMMETRIC.iter().zip(jet.hessian) {
            hessian[row][column] = value;
            hessian[column][row] = value;
        }
        Level {
            value: jet.value,
            gradient: jet.gradient,
            hessian,
        }
    }

    /// The unit normal at a point of the surface, outward (upward for a graph).
    pub fn normal(&self, x: [f64; 3]) -> [f64; 3] {
        let gradient = self.derivatives(x).gradient;
        let size = length(gradient);
        gradient.map(|component| component / size)
    }

    /// The divergence of the unit normal at a point of the surface: the sum of the principal curvatures, positive for a
    /// sphere.
    pub fn mean_curvature(&self, x: [f64; 3]) -> f64 {
        let Level { gradient, hessian, .. } = self.derivatives(x);
        let size = length(gradient);
        let trace = hessian[0][0] + hessian[1][1] + hessian[2][2];
        let along: f64 = (0..3)
            .map(|row| {
                (0..3)
                    .map(|column| gradient[row] * hessian[row][column] * gradient[column])
                    .sum::<f64>()
            })
            .sum();
        (trace - along / (size * size)) / size
    }

    /// The nearest point of the surface to a point near it, by Newton's method on the conditions `y - x + m grad = 0`,
    /// `level = 0`. Far away (beyond the nearest centre of curvature) it may be another stationary point.
    pub fn closest(&self, x: [f64; 3]) -> [f64; 3] {
        let mut y = x;
        // Along the gradient onto the surface, roughly: Newton's method then starts with a foot and a multiplier that
        // fit.
        let mut first = self.derivatives(y);
        for _ in 0..4 {
            let square = dot(first.gradient, first.gradient);
            let step = first.value / square;
            y = std::array::from_fn(|axis| y[axis] - step * first.gradient[axis]);
            first = self.derivatives(y);
            if step * step * square <= 1e-6 * dot(y, y) {
                break;
            }
        }
        let mut multiplier = dot(subtract(x, y), first.gradient) / dot(first.gradient, first.gradient);
        for _ in 0..20 {
            let Level {
                value,
                gradient,
                hessian,
            } = self.derivatives(y);
            let mut matrix = Matrix4::zeros();
            let mut residual = Vector4::zeros();
            for row in 0..3 {
                for column in 0..3 {
                    matrix[(row, column)] = multiplier * hessian[row][column] + f64::from(u8::from(row == column));
                }
                matrix[(row, 3)] = gradient[row];
                matrix[(3, row)] = gradient[row];
                residual[row] = y[row] - x[row] + multiplier * gradient[row];
            }
            residual[3] = value;
            let Some(step) = matrix.lu().solve(&residual) else {
                break;
            };
            if !step.iter().all(|component| component.is_finite()) {
                break;
            }
            y = std::array::from_fn(|axis| y[axis] - step[axis]);
            multiplier -= step[3];
            // Convergence is quadratic: the next step would be lost in rounding.
            if step.fixed_rows::<3>(0).norm() <= 1e-9 * length(y) {
                break;
            }
        }
        y
    }

    /// The distance of a point near the surface.
    pub fn distance(&self, x: [f64; 3]) -> f64 {
        length(subtract(x, self.closest(x)))
    }
}
