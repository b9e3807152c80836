//! A bar, straight, twisted or bent.

use super::{Arguments, Generated, Generator, Grid, JITTER, Parameter, SEED, TETRAHEDRA, bend_lattice};

/// A bar along x with a rectangular section, twisted about its axis, then bent in the plane of x and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bar {
    pub grid: Grid,
    /// Extents along x, y, z before twisting and bending, in model units.
    pub extents: [f64; 3],
    /// Angle between the two ends' sections, in degrees.
    pub twist: f64,
    /// Angle between the two ends' axes, in degrees.
    pub bend: f64,
}

const fn extent(name: &'static str, default: f64, doc: &'static str) -> Parameter {
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
    name: "bar",
    doc: "a bar along x, centred at the origin, that can be twisted about its axis and bent",
    parameters: &[
        TETRAHEDRA,
        extent("length", 4.0, "extent along x, in model units"),
        extent("width", 1.0, "extent along y, in model units"),
        extent("height", 1.0, "extent along z, in model units"),
        Parameter {
            name: "twist",
            whole: false,
            default: 0.0,
            min: -3600.0,
            max: 3600.0,
            doc: "angle by which one end is turned against the other, in degrees",
        },
        Parameter {
            name: "bend",
            whole: false,
            default: 0.0,
            min: -330.0,
            max: 330.0,
            doc: "angle between the axes of the two ends, in degrees; the bar keeps its length along the axis",
        },
        JITTER,
        SEED,
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<Generated, String> {
    let extents = ["length", "width", "height"].map(|name| arguments.number(name));
    let (twist, bend) = (arguments.number("twist"), arguments.number("bend"));
    Bar {
        grid: arguments.grid(),
        extents,
        twist,
        bend,
    }
    .generate()
}

impl Bar {
    /// # Errors
    /// When the bar is too thick for its bend, or has too few tetrahedra for its twist.
    pub fn generate(&self) -> Result<Generated, String> {
        let [length, width, height] = self.extents;
        let (twist, bend) = (self.twist.to_radians(), self.bend.to_radians());
        let reach = if twist == 0.0 {
            height / 2.0
        } else {
            width.hypot(height) / 2.0
        };
        if bend.abs() * reach >= 0.95 * length {
            return Err(format!(
                "a bend of {} degrees is too tight for a bar of length {length}, width {width} and height {height}; \
                 lower `bend` or raise `length`",
                self.bend
            ));
        }
        bend_lattice(&self.grid, self.extents, |[x, y, z]| {
            let (along, y, z) = (0.5 * x, 0.5 * width * y, 0.5 * height * z);
            let (sine, cosine) = (twist * along).sin_cos();
            let (y, z) = (cosine * y - sine * z, sine * y + cosine * z);
            if bend == 0.0 {
                return [length * along, y, z];
            }
            // The axis becomes an arc of radius length / bend around a centre above the middle of the bar.
            let radius = length / bend;
            let (sine, cosine) = (bend * along).sin_cos();
            [(radius - z) * sine, y, radius - (radius - z) * cosine]
        })
    }
}
