//! A solid ball.

use super::{Arguments, Generated, Generator, Grid, JITTER, Parameter, SEED, TETRAHEDRA, bend_lattice};
use crate::mesh::dot;

/// A ball around the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    pub grid: Grid,
    /// In model units.
    pub radius: f64,
}

pub(super) const GENERATOR: Generator = Generator {
    name: "ball",
    doc: "a ball around the origin; its boundary vertices lie on the sphere",
    parameters: &[
        TETRAHEDRA,
        Parameter {
            name: "radius",
            whole: false,
            default: 1.0,
            min: 1e-6,
            max: 1e6,
            doc: "radius, in model units",
        },
        JITTER,
        SEED,
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<Generated, String> {
    Ball {
        grid: arguments.grid(),
        radius: arguments.number("radius"),
    }
    .generate()
}

impl Ball {
    /// # Errors
    /// None for valid parameters; the signature is that of all generators.
    pub fn generate(&self) -> Result<Generated, String> {
        bend_lattice(&self.grid, [1.0; 3], |point| {
            from_cube(point).map(|coordinate| self.radius * coordinate)
        })
    }
}

/// Maps the cube `[-1, 1]^3` one to one onto the unit ball: `x / sqrt(|x|^2 + 1.75 (1 - r^2))` with `r` the largest
/// coordinate of `x`.
///
/// Radial, the identity up to a factor 0.76 at the centre, and the projection onto the sphere on the cube's surface. Of
/// several such maps and factors this one has nearly the best smallest scaled Jacobian on body-centred lattices with
/// equal and unequal counts; the factor lies between 1.5, better on equal counts, and 2, better on unequal ones.
pub(super) fn from_cube(point: [f64; 3]) -> [f64; 3] {
    let reach = point
        .iter()
        .fold(0.0, |largest: f64, &coordinate| largest.max(coordinate.abs()));
    let scale = (dot(point, point) + 1.75 * (1.0 - reach * reach)).sqrt();
    point.map(|coordinate| coordinate / scale)
}
