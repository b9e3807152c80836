//! A surface of biquartic patches: evaluation with derivatives to second order, curvatures, tessellation.

use super::hermite;
use super::patch::Patch;
use crate::linalg::vector3::{cross, dot};
use crate::mesh::length;

/// Position and derivatives of a patch at a point of the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jet {
    pub position: [f64; 3],
    pub u: [f64; 3],
    pub v: [f64; 3],
    pub uu: [f64; 3],
    pub uv: [f64; 3],
    pub vv: [f64; 3],
}

impl Jet {
    /// `X_u x X_v`: the normal, as long as the area element.
    pub fn area_vector(&self) -> [f64; 3] {
        cross(self.u, self.v)
    }

    /// The principal curvatures' sum and product; positive sums where the surface bends away from its normal, as a sphere
    /// with outward normal does.
    pub fn curvatures(&self) -> [f64; 2] {
        let area = self.area_vector();
        let size = length(area);
        let normal = area.map(|component| component / size);
        let (e, f, g) = (dot(self.u, self.u), dot(self.u, self.v), dot(self.v, self.v));
        let (l, m, n) = (dot(self.uu, normal), dot(self.uv, normal), dot(self.vv, normal));
        let determinant = e * g - f * f;
        [
            -(e * n - 2.0 * f * m + g * l) / determinant,
            (l * n - m * m) / determinant,
        ]
    }
}

/// `sum C_ab f_a g_b`.
#[inline]
fn tensor(patch: &Patch, f: &[f64; 5], g: &[f64; 5]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for a in 0..5 {
        for axis in 0..3 {
            let row = g[0] * patch[5 * a][axis]
                + g[1] * patch[5 * a + 1][axis]
                + g[2] * patch[5 * a + 2][axis]
                + g[3] * patch[5 * a + 3][axis]
                + g[4] * patch[5 * a + 4][axis];
            sum[axis] += f[a] * row;
        }
    }
    sum
}

/// The five functions and their first two derivatives at a place, to be shared among patches.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub values: [f64; 5],
    pub slopes: [f64; 5],
    pub seconds: [f64; 5],
}

impl Place {
    pub fn new(x: f64) -> Self {
        Self {
            values: hermite::values(x),
            slopes: hermite::slopes(x),
            seconds: hermite::second_derivatives(x),
        }
    }
}

/// The position at `(u, v)`.
pub fn position(patch: &Patch, u: &Place, v: &Place) -> [f64; 3] {
    tensor(patch, &u.values, &v.values)
}

/// Position and first derivatives; the second ones are zero.
pub fn first_derivatives(patch: &Patch, u: &Place, v: &Place) -> Jet {
    Jet {
        position: tensor(patch, &u.values, &v.values),
        u: tensor(patch, &u.slopes, &v.values),
        v: tensor(patch, &u.values, &v.slopes),
        ..Jet::default()
    }
}

/// Position with derivatives to second order.
pub fn evaluate(patch: &Patch, u: &Place, v: &Place) -> Jet {
    Jet {
        uu: tensor(patch, &u.seconds, &v.values),
        uv: tensor(patch, &u.slopes, &v.slopes),
        vv: tensor(patch, &u.values, &v.seconds),
        ..first_derivatives(patch, u, v)
    }
}

/// Control points over the Bernstein polynomials of degree 4: entry `5 i + j` belongs to `B_i(u) B_j(v)`.
pub fn control_points(patch: &Patch) -> Patch {
    let mut rows = [[0.0; 3]; 25];
    for i in 0..5 {
        for b in 0..5 {
            for a in 0..5 {
                for axis in 0..3 {
                    rows[5 * i + b][axis] += hermite::BERNSTEIN[a][i] * patch[5 * a + b][axis];
                }
            }
        }
    }
    let mut points = [[0.0; 3]; 25];
    for i in 0..5 {
        for j in 0..5 {
            for b in 0..5 {
                for axis in 0..3 {
                    points[5 * i + j][axis] += hermite::BERNSTEIN[b][j] * rows[5 * i + b][axis];
                }
            }
        }
    }
    points
}
