//! A bumpy, twisted, elongated ball: the standard hard case, on which maps onto a cube by Dirichlet or ARAP fold.

use super::{Arguments, Generated, Generator, Grid, JITTER, Parameter, SEED, TETRAHEDRA, ball, bend_lattice};
use crate::mesh::length;

/// A ball whose radius in direction `q` is `1 + amplitude (sin 3 q_x cos 4 q_y + 0.6 q_z^3)`, twisted about z, then
/// stretched along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bumpy {
    pub grid: Grid,
    /// Height of the bumps as a fraction of the radius.
    pub amplitude: f64,
    /// Angle between the two poles of the ball, in degrees.
    pub twist: f64,
    /// Factor along z.
    pub elongation: f64,
}

pub(super) const AMPLITUDE: Parameter = Parameter {
    name: "amplitude",
    whole: false,
    default: 0.2,
    min: 0.0,
    max: 0.35,
    doc: "height of the bumps as a fraction of the radius",
};

pub(super) const GENERATOR: Generator = Generator {
    name: "bumpy",
    doc: "a ball of radius 1 with bumps and dents, twisted about z and stretched along it",
    parameters: &[
        TETRAHEDRA,
        AMPLITUDE,
        Parameter {
            name: "twist",
            whole: false,
            default: 137.5,
            min: -720.0,
            max: 720.0,
            doc: "angle by which the upper pole is turned against the lower, in degrees",
        },
        Parameter {
            name: "elongation",
            whole: false,
            default: 1.5,
            min: 0.1,
            max: 10.0,
            doc: "factor by which the ball is stretched along z",
        },
        JITTER,
        SEED,
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<Generated, String> {
    let [amplitude, twist, elongation] = ["amplitude", "twist", "elongation"].map(|name| arguments.number(name));
    Bumpy {
        grid: arguments.grid(),
        amplitude,
        twist,
        elongation,
    }
    .generate()
}

impl Bumpy {
    /// # Errors
    /// When there are too few tetrahedra for the bumps or the twist.
    pub fn generate(&self) -> Result<Generated, String> {
        let rate = self.twist.to_radians() / 2.0;
        bend_lattice(&self.grid, [1.0, 1.0, self.elongation], |point| {
            let [x, y, z] = swell(ball::from_cube(point), |direction| {
                1.0 + self.amplitude * bumps(direction)
            });
            let (sine, cosine) = (rate * z).sin_cos();
            [cosine * x - sine * y, sine * x + cosine * y, self.elongation * z]
        })
    }
}

/// The bumps on the sphere, between -1.6 and 1.6.
pub(super) fn bumps([x, y, z]: [f64; 3]) -> f64 {
    (3.0 * x).sin() * (4.0 * y).cos() + 0.6 * (z * z * z)
}

/// Moves a point of the unit ball along its ray so that the sphere gets the radius `radius(direction)`; the centre stays
/// as it is and the change is blended in by the polynomial `3 r^2 - 2 r^3`. One to one while the radius exceeds 0.41.
pub(super) fn swell(point: [f64; 3], radius: impl Fn([f64; 3]) -> f64) -> [f64; 3] {
    let distance = length(point);
    if distance == 0.0 {
        return point;
    }
    let direction = point.map(|coordinate| coordinate / distance);
    let reach = distance.min(1.0);
    let blend = reach * reach * (3.0 - 2.0 * reach);
    let factor = 1.0 + (radius(direction) - 1.0) * blend;
    point.map(|coordinate| factor * coordinate)
}
