//! A bumpy twisted ball on a Kuhn grid: the mesh on which published figures of foldings are compared.

use super::{Arguments, Generated, Generator, Parameter, bumpy, lattice, valid};
use crate::mesh::{length, split};

/// A Kuhn grid of the cube, rounded halfway into a ball, given bumps, twisted and stretched; then freed from its boundary
/// by [`split::separate_boundary`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistedGrid {
    /// Boxes along each axis; about `6 divisions^3` tetrahedra and those from splitting.
    pub divisions: usize,
    /// Height of the bumps as a fraction of the radius.
    pub amplitude: f64,
}

pub(super) const GENERATOR: Generator = Generator {
    name: "twisted-grid",
    doc: "a bumpy twisted ball from a regular grid of six tetrahedra a box, coarse at the former edges of the cube",
    parameters: &[
        Parameter {
            name: "divisions",
            whole: true,
            default: 6.0,
            min: 2.0,
            max: 200.0,
            doc: "boxes along each axis; 6 gives 1596 tetrahedra, 8 gives 3492, 12 about 11,400",
        },
        Parameter {
            max: 0.25,
            ..bumpy::AMPLITUDE
        },
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<Generated, String> {
    TwistedGrid {
        divisions: arguments.number("divisions") as usize,
        amplitude: arguments.number("amplitude"),
    }
    .generate()
}

impl TwistedGrid {
    /// # Errors
    /// When the bumps are too high for the number of divisions.
    pub fn generate(&self) -> Result<Generated, String> {
        let mut mesh = lattice::kuhn(self.divisions);
        let mut natural = mesh.points.clone();
        for point in &mut mesh.points {
            *point = bend(*point, self.amplitude);
        }
        let refined = split::separate_boundary(&mesh);
        refined.carry(&mut natural);
        valid(refined.mesh, natural)
    }
}

/// From the unit cube to the shape.
fn bend(point: [f64; 3], amplitude: f64) -> [f64; 3] {
    let cube = point.map(|coordinate| 2.0 * coordinate - 1.0);
    let [x, y, z] = cube;
    // The cube onto the ball by x sqrt(1 - y^2/2 - z^2/2 + y^2 z^2 / 3), taken only 55 % of the way.
    let round = |a: f64, b: f64, c: f64| a * (1.0 - b * b / 2.0 - c * c / 2.0 + b * b * c * c / 3.0).sqrt();
    let ball = [round(x, y, z), round(y, z, x), round(z, x, y)];
    let half: [f64; 3] = std::array::from_fn(|axis| 0.45 * cube[axis] + 0.55 * ball[axis]);
    let radius = length(half);
    let direction = half.map(|coordinate| coordinate / radius.max(1e-12));
    let reach = radius.min(1.0);
    let factor = 1.0 + amplitude * bumpy::bumps(direction) * (reach * reach);
    let [x, y, z] = half.map(|coordinate| factor * coordinate);
    // 1.2 radians to a unit of height.
    let (sine, cosine) = (1.2 * z).sin_cos();
    [cosine * x - sine * y, sine * x + cosine * y, 1.5 * z]
}
