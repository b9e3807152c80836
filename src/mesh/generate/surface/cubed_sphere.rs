//! Spheres, ellipsoids and a head-like shape over the subdivided cube: eight vertices of valence 3, the others of
//! valence 4.

use super::analytic::{Analytic, Bump};
use super::{
    AXES, GeneratedSurface, JITTER, Parameter, SEED, SurfaceGenerator, normalized, on, refine, shake_directions,
};
use crate::mesh::generate::Arguments;

const CELLS: Parameter = Parameter {
    name: "cells",
    whole: true,
    default: 8.0,
    min: 1.0,
    max: 2000.0,
    doc: "quadrilaterals along an edge of the cube; the surface has 6 cells^2 of them",
};

pub(super) const SPHERE: SurfaceGenerator = SurfaceGenerator {
    name: "sphere",
    doc: "the sphere of radius 1, from a cube with subdivided faces",
    parameters: &[CELLS, JITTER, SEED],
    build: sphere,
};

pub(super) const ELLIPSOID: SurfaceGenerator = SurfaceGenerator {
    name: "ellipsoid",
    doc: "an ellipsoid, from a cube with subdivided faces",
    parameters: &[CELLS, AXES[0], AXES[1], AXES[2], JITTER, SEED],
    build: ellipsoid,
};

pub(super) const HEAD: SurfaceGenerator = SurfaceGenerator {
    name: "head",
    doc: "a star-shaped head with nose, ears, brows and chin, from a cube with subdivided faces",
    parameters: &[
        Parameter { default: 16.0, ..CELLS },
        Parameter {
            name: "features",
            whole: false,
            default: 1.0,
            min: 0.0,
            max: 2.0,
            doc: "factor for the height of nose, ears, brows and chin",
        },
        JITTER,
        SEED,
    ],
    build: head,
};

/// The faces of the cube `[-1, 1]^3`, outward.
pub(super) const FACES: [[u32; 4]; 6] = [
    [0, 2, 3, 1],
    [4, 5, 7, 6],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 4, 6, 2],
    [1, 3, 7, 5],
];

/// Unit vectors and quads of the cube with `cells` by `cells` quads a face.
pub fn directions(cells: usize) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let corners: Vec<[f64; 3]> = (0..8u32)
        .map(|corner| std::array::from_fn(|axis| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 }))
        .collect();
    let (mut points, quads) = refine(&corners, &FACES, cells);
    for point in &mut points {
        *point = normalized(*point);
    }
    (points, quads)
}

/// The same with the jitter of a generator's arguments.
fn shaken(arguments: &Arguments) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let cells = arguments.number("cells") as usize;
    let (mut points, quads) = directions(cells);
    let reach = arguments.number("jitter") * 1.5 / cells as f64;
    shake_directions(&mut points, reach, arguments.number("seed") as u64);
    (points, quads)
}

fn stretched(points: Vec<[f64; 3]>, axes: [f64; 3]) -> Vec<[f64; 3]> {
    points
        .into_iter()
        .map(|point| std::array::from_fn(|axis| axes[axis] * point[axis]))
        .collect()
}

fn sphere(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let (points, quads) = shaken(arguments);
    Ok(on(Analytic::Ellipsoid { axes: [1.0; 3] }, points, quads))
}

fn ellipsoid(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let (points, quads) = shaken(arguments);
    let axes = arguments.axes();
    Ok(on(Analytic::Ellipsoid { axes }, stretched(points, axes), quads))
}

fn head(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let (points, quads) = shaken(arguments);
    let features = arguments.number("features");
    // Face towards -y, crown towards z.
    let bump = |direction: [f64; 3], height: f64, sharpness: f64| Bump {
        direction: normalized(direction),
        height: features * height,
        sharpness,
    };
    let bumps = vec![
        bump([0.0, -1.0, -0.1], 0.28, 45.0),
        bump([0.0, -1.0, -0.32], 0.10, 60.0),
        bump([0.0, -1.0, -0.75], 0.16, 25.0),
        bump([0.42, -1.0, 0.28], 0.06, 35.0),
        bump([-0.42, -1.0, 0.28], 0.06, 35.0),
        bump([0.35, -1.0, 0.1], -0.08, 60.0),
        bump([-0.35, -1.0, 0.1], -0.08, 60.0),
        bump([1.0, 0.1, 0.0], 0.22, 50.0),
        bump([-1.0, 0.1, 0.0], 0.22, 50.0),
        bump([0.0, 1.0, 0.25], 0.12, 4.0),
        bump([0.0, 0.2, -1.0], 0.25, 8.0),
    ];
    let axes = [0.78, 0.95, 1.1];
    let exact = Analytic::Star {
        axes,
        bumps: bumps.clone(),
    };
    let scaled = points
        .into_iter()
        .map(|direction| {
            let rise: f64 = bumps
                .iter()
                .map(|bump| {
                    let along = crate::mesh::dot(direction, bump.direction);
                    bump.height * crate::linalg::elementary::exp(bump.sharpness * (along - 1.0))
                })
                .sum();
            direction.map(|component| (1.0 + rise) * component)
        })
        .collect();
    Ok(on(exact, stretched(scaled, axes), quads))
}
