//! A ball with spikes.

use super::{Arguments, Generated, Generator, Grid, JITTER, Parameter, SEED, TETRAHEDRA, ball, bend_lattice, bumpy};
use crate::mesh::dot;
use std::f64::consts::PI;

/// A ball of radius 1 from which spikes rise by `height` in evenly spread directions `d`: the radius in direction `q` is
/// `1 + height * s`, where `s^4` is the sum over the directions of `exp(4 sharpness (q . d - 1))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Star {
    pub grid: Grid,
    pub spikes: usize,
    /// Rise of a spike over the ball, in radii.
    pub height: f64,
    /// Larger is thinner: a spike falls to 1/e of its height at the angle `acos(1 - 1 / sharpness)`.
    pub sharpness: f64,
}

pub(super) const GENERATOR: Generator = Generator {
    name: "star",
    doc: "a ball of radius 1 with evenly spread spikes; long or sharp ones make very hard maps",
    parameters: &[
        TETRAHEDRA,
        Parameter {
            name: "spikes",
            whole: true,
            default: 9.0,
            min: 1.0,
            max: 60.0,
            doc: "number of spikes",
        },
        Parameter {
            name: "height",
            whole: false,
            default: 0.8,
            min: 0.0,
            max: 5.0,
            doc: "rise of a spike over the ball, in radii",
        },
        Parameter {
            name: "sharpness",
            whole: false,
            default: 8.0,
            min: 0.5,
            max: 60.0,
            doc: "larger is thinner: a spike falls to 1/e of its height at the angle acos(1 - 1 / sharpness)",
        },
        JITTER,
        SEED,
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<Generated, String> {
    let [spikes, height, sharpness] = ["spikes", "height", "sharpness"].map(|name| arguments.number(name));
    Star {
        grid: arguments.grid(),
        spikes: spikes as usize,
        height,
        sharpness,
    }
    .generate()
}

impl Star {
    /// # Errors
    /// When there are too few tetrahedra for the spikes.
    pub fn generate(&self) -> Result<Generated, String> {
        // Points of the Fibonacci spiral: nearly even for any number.
        let golden = PI * (3.0 - 5.0f64.sqrt());
        let directions: Vec<[f64; 3]> = (0..self.spikes)
            .map(|index| {
                let z = 1.0 - (2 * index + 1) as f64 / self.spikes as f64;
                let (sine, cosine) = (golden * index as f64).sin_cos();
                let across = (1.0 - z * z).sqrt();
                [across * cosine, across * sine, z]
            })
            .collect();
        bend_lattice(&self.grid, [1.0; 3], |point| {
            bumpy::swell(ball::from_cube(point), |direction| {
                // The root of a sum of fourth powers stands for the maximum: smooth where two spikes meet.
                let powers = directions
                    .iter()
                    .map(|&axis| (4.0 * self.sharpness * (dot(direction, axis) - 1.0)).exp());
                1.0 + self.height * powers.sum::<f64>().sqrt().sqrt()
            })
        })
    }
}
