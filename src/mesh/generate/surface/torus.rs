//! The torus: every vertex has valence 4.

use super::analytic::Analytic;
use super::{GeneratedSurface, JITTER, Parameter, SEED, SurfaceGenerator, on};
use crate::mesh::generate::{Arguments, SplitMix};
use std::f64::consts::TAU;

pub(super) const GENERATOR: SurfaceGenerator = SurfaceGenerator {
    name: "torus",
    doc: "a torus about the z-axis, divided evenly in both angles; jitter moves vertices in both angles",
    parameters: &[
        Parameter {
            name: "around",
            whole: true,
            default: 12.0,
            min: 3.0,
            max: 5000.0,
            doc: "quadrilaterals around the axis",
        },
        Parameter {
            name: "across",
            whole: true,
            default: 8.0,
            min: 3.0,
            max: 5000.0,
            doc: "quadrilaterals around the tube",
        },
        Parameter {
            name: "ring",
            whole: false,
            default: 2.0,
            min: 1e-3,
            max: 1e3,
            doc: "distance of the tube's centre from the axis",
        },
        Parameter {
            name: "tube",
            whole: false,
            default: 0.7,
            min: 1e-3,
            max: 1e3,
            doc: "radius of the tube; less than `ring`",
        },
        JITTER,
        SEED,
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let [around, across] = ["around", "across"].map(|name| arguments.number(name) as usize);
    let [ring, tube, jitter] = ["ring", "tube", "jitter"].map(|name| arguments.number(name));
    if tube >= ring {
        return Err(format!(
            "parameter `tube` is {tube} and `ring` {ring}; the tube must be thinner than the ring is wide"
        ));
    }
    let mut random = SplitMix(arguments.number("seed") as u64);
    let mut points = Vec::with_capacity(around * across);
    for i in 0..around {
        for j in 0..across {
            let mut angle =
                |index: usize, count: usize| TAU * (index as f64 + jitter * (2.0 * random.unit() - 1.0)) / count as f64;
            let (a, b) = (angle(i, around), angle(j, across));
            let radius = ring + tube * b.cos();
            points.push([radius * a.cos(), radius * a.sin(), tube * b.sin()]);
        }
    }
    let name = |i: usize, j: usize| (i % around * across + j % across) as u32;
    let quads = (0..around)
        .flat_map(|i| (0..across).map(move |j| (i, j)))
        .map(|(i, j)| [name(i, j), name(i + 1, j), name(i + 1, j + 1), name(i, j + 1)])
        .collect();
    Ok(on(Analytic::Torus { ring, tube }, points, quads))
}
