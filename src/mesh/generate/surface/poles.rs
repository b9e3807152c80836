//! Ellipsoids over a trapezohedron: two poles of any valence, and a ring of vertices of valence 3 between them.

use super::analytic::Analytic;
use super::{AXES, GeneratedSurface, Parameter, SurfaceGenerator, normalized, on, refine};
use crate::mesh::generate::Arguments;
use std::f64::consts::TAU;

pub(super) const GENERATOR: SurfaceGenerator = SurfaceGenerator {
    name: "poles",
    doc: "an ellipsoid with two poles of a given valence, subdivided",
    parameters: &[
        Parameter {
            name: "valence",
            whole: true,
            default: 8.0,
            min: 3.0,
            max: 64.0,
            doc: "quadrilaterals at each pole",
        },
        Parameter {
            name: "cells",
            whole: true,
            default: 3.0,
            min: 1.0,
            max: 1000.0,
            doc: "quadrilaterals along an edge of the coarse surface; the surface has 2 valence cells^2 of them",
        },
        AXES[0],
        AXES[1],
        AXES[2],
    ],
    build,
};

fn build(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let [valence, cells] = ["valence", "cells"].map(|name| arguments.number(name) as usize);
    // The ring alternates between above and below the equator by the height of a cube's vertices.
    let height = 1.0 / 3.0;
    let radius = (1.0f64 - height * height).sqrt();
    let mut points = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for index in 0..2 * valence {
        let angle = TAU * index as f64 / (2 * valence) as f64;
        let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
        points.push([radius * angle.cos(), radius * angle.sin(), sign * height]);
    }
    let ring = |index: usize| (2 + index % (2 * valence)) as u32;
    let quads: Vec<[u32; 4]> = (0..valence)
        .flat_map(|index| {
            let even = 2 * index;
            [
                [0, ring(even), ring(even + 1), ring(even + 2)],
                [1, ring(even + 3), ring(even + 2), ring(even + 1)],
            ]
        })
        .collect();
    let (points, quads) = refine(&points, &quads, cells);
    let axes = arguments.axes();
    let points = points
        .into_iter()
        .map(normalized)
        .map(|point| std::array::from_fn(|axis| axes[axis] * point[axis]))
        .collect();
    Ok(on(Analytic::Ellipsoid { axes }, points, quads))
}
