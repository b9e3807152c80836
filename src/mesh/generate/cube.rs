//! A solid cube.

use super::{Arguments, Generated, Generator, Grid, JITTER, Parameter, SEED, TETRAHEDRA, bend_lattice};

/// The cube `[0, edge]^3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube {
    pub grid: Grid,
    /// In model units.
    pub edge: f64,
}

pub(super) const GENERATOR: Generator = Generator {
    name: "cube",
    doc: "the cube from the origin to (edge, edge, edge)",
    parameters: &[
        TETRAHEDRA,
        Parameter {
            name: "edge",
            whole: false,
            default: 1.0,
            min: 1e-6,
            max: 1e6,
            doc: "edge length, in model units",
        },
        JITTER,
        SEED,
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<Generated, String> {
    Cube {
        grid: arguments.grid(),
        edge: arguments.number("edge"),
    }
    .generate()
}

impl Cube {
    /// # Errors
    /// None for valid parameters; the signature is that of all generators.
    pub fn generate(&self) -> Result<Generated, String> {
        let half = 0.5 * self.edge;
        bend_lattice(&self.grid, [1.0; 3], |point| {
            point.map(|coordinate| half * (coordinate + 1.0))
        })
    }
}
