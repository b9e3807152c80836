//! A solid ellipsoid.

use super::{Arguments, Generated, Generator, Grid, JITTER, Parameter, SEED, TETRAHEDRA, ball, bend_lattice};

/// An ellipsoid around the origin with its axes along the coordinate axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    pub grid: Grid,
    /// Semi-axes along x, y, z, in model units.
    pub semi_axes: [f64; 3],
}

const fn semi_axis(name: &'static str, default: f64, doc: &'static str) -> Parameter {
    Parameter {
        name,
        whole: false,
        default,
        min: 1e-6,
        max: 1e6,
        doc,
    }
}

pub(super) const GENERATOR: Generator = Generator {
    name: "ellipsoid",
    doc: "an ellipsoid around the origin; the cells keep their shape when the semi-axes differ",
    parameters: &[
        TETRAHEDRA,
        semi_axis("a", 1.0, "semi-axis along x, in model units"),
        semi_axis("b", 0.7, "semi-axis along y, in model units"),
        semi_axis("c", 0.5, "semi-axis along z, in model units"),
        JITTER,
        SEED,
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<Generated, String> {
    let semi_axes = ["a", "b", "c"].map(|name| arguments.number(name));
    Ellipsoid {
        grid: arguments.grid(),
        semi_axes,
    }
    .generate()
}

impl Ellipsoid {
    /// # Errors
    /// When the semi-axes differ so much that tetrahedra become flat.
    pub fn generate(&self) -> Result<Generated, String> {
        let semi_axes = self.semi_axes;
        bend_lattice(&self.grid, semi_axes, |point| {
            let round = ball::from_cube(point);
            std::array::from_fn(|axis| semi_axes[axis] * round[axis])
        })
    }
}
