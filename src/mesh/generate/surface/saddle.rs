//! An open surface: the graph of a cubic polynomial over a square.

use super::analytic::Analytic;
use super::{GeneratedSurface, JITTER, Parameter, SEED, SurfaceGenerator, on};
use crate::mesh::generate::{Arguments, SplitMix};

pub(super) const GENERATOR: SurfaceGenerator = SurfaceGenerator {
    name: "saddle",
    doc: "an open surface: the graph of height (x^2 - y^2 + x y^2) over the square [-1, 1]^2",
    parameters: &[
        Parameter {
            name: "cells",
            whole: true,
            default: 8.0,
            min: 1.0,
            max: 3000.0,
            doc: "quadrilaterals along an edge of the square",
        },
        Parameter {
            name: "height",
            whole: false,
            default: 0.5,
            min: 0.0,
            max: 10.0,
            doc: "factor of the polynomial; 0 is the plane",
        },
        JITTER,
        SEED,
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let cells = arguments.number("cells") as usize;
    let [height, jitter] = ["height", "jitter"].map(|name| arguments.number(name));
    let mut random = SplitMix(arguments.number("seed") as u64);
    let mut points = Vec::with_capacity((cells + 1) * (cells + 1));
    for j in 0..=cells {
        for i in 0..=cells {
            let mut place = |index: usize| {
                let shift = jitter * (2.0 * random.unit() - 1.0);
                // The boundary stays where it is.
                let shift = if index == 0 || index == cells { 0.0 } else { shift };
                2.0 * (index as f64 + shift) / cells as f64 - 1.0
            };
            let (x, y) = (place(i), place(j));
            points.push([x, y, height * (x * x - y * y + x * y * y)]);
        }
    }
    let name = |i: usize, j: usize| (j * (cells + 1) + i) as u32;
    let quads = (0..cells)
        .flat_map(|j| (0..cells).map(move |i| (i, j)))
        .map(|(i, j)| [name(i, j), name(i + 1, j), name(i + 1, j + 1), name(i, j + 1)])
        .collect();
    Ok(on(Analytic::Saddle { height }, points, quads))
}
