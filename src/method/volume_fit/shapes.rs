//! Generated targets: smooth or creased solids made of cubes, and spheres with bumps.

use crate::mesh::mixed::MixedMesh;
use crate::mesh::template::grid::selected;
use crate::mesh::template::sweep::{Sweep, sweep};
use crate::mesh::{self, TriangleMesh};
use serde_json::Value;
use std::collections::BTreeMap;

/// A generated surface.
pub fn generate(name: &str, parameters: &Value, wanted: usize) -> TriangleMesh {
    let number = |name: &str, default: f64| parameters.get(name).and_then(Value::as_f64).unwrap_or(default);
    let cube = |points: &mut Vec<[f64; 3]>| {
        // The tangent spreads the points of a cube's faces evenly over the sphere.
        for point in points {
            let bent = point.map(|c| ((c / 0.5 - 1.0) * std::f64::consts::FRAC_PI_4).tan());
            let size = mesh::length(bent);
            *point = bent.map(|c| c / size);
        }
    };
    match name {
        "ellipsoid" | "pebble" => {
            let mut surface = quads_to_triangles(subdivided([1, 1, 1], |_| true, wanted, false));
            cube(&mut surface.points);
            if name == "ellipsoid" {
                let axes = [number("a", 1.0), number("b", 0.8), number("c", 0.6)];
                for point in &mut surface.points {
                    *point = std::array::from_fn(|axis| point[axis] * axes[axis]);
                }
            } else {
                let amplitude = number("amplitude", 0.15);
                for point in &mut surface.points {
                    let [x, y, z] = *point;
                    let bumps = (3.0 * x + 0.5).sin() * (2.6 * y - 0.3).cos() + 0.6 * (4.1 * z + 1.0 + x).sin();
                    *point = point.map(|c| c * (1.0 + amplitude * bumps));
                }
            }
            surface
        }
        "block" => {
            let mut surface = quads_to_triangles(subdivided([3, 2, 2], |[i, _, k]| !(i > 0 && k == 1), wanted, false));
            stretch(&mut surface, [1.0, 1.0, 0.7]);
            let bend = number("bend", 0.0);
            for point in &mut surface.points {
                point[2] += bend * (point[0] - 1.5) * (point[0] - 1.5);
            }
            surface
        }
        "joint" => {
            let part = |[i, j, k]: [usize; 3]| {
                let hole = (1..3).contains(&i) && (1..3).contains(&j);
                if k == 0 { !hole } else { i >= 4 }
            };
            let mut surface = quads_to_triangles(subdivided([6, 4, 3], part, wanted, false));
            stretch(&mut surface, [1.0, 1.0, 0.9]);
            surface
        }
        "double-torus" => {
            let mut surface = quads_to_triangles(subdivided(
                [5, 3, 1],
                |[i, j, _]| !((i == 1 || i == 3) && j == 1),
                wanted,
                true,
            ));
            stretch(&mut surface, [1.0, 1.0, 0.9]);
            surface
        }
        "bone" => {
            let part = |[i, j, k]: [usize; 3]| !(2..7).contains(&i) || (j == 1 && k == 1);
            let mut surface = quads_to_triangles(subdivided([9, 3, 3], part, wanted, true));
            for point in &mut surface.points {
                let [x, y, z] = *point;
                *point = [x, y + 0.02 * (x - 4.5) * (x - 4.5), z];
            }
            surface
        }
        "hanger" => {
            let paths = HANGER.map(|path| path.iter().map(|&[x, y]| [x, y, 0.0]).collect());
            let volume = sweep(
                &paths,
                Sweep {
                    width: 1.0,
                    step: 1.0,
                    bend: 1.0,
                },
            );
            quads_to_triangles(cut(volume.unwrap_or_default(), wanted, true))
        }
        "hand" => {
            let part = |[i, j, _]: [usize; 3]| {
                let finger = i >= 3 && (i - 3) % 2 == 0;
                match j {
                    0 => i >= 3,
                    1 => true,
                    2 | 3 => i >= 3,
                    4..6 => finger,
                    6 | 7 => (5..9).contains(&i) && finger || j == 6 && i == 9,
                    _ => i == 5,
                }
            };
            let mut surface = quads_to_triangles(subdivided([10, 9, 1], part, wanted, true));
            stretch(&mut surface, [1.0, 1.0, 1.3]);
            for point in &mut surface.points {
                let [x, y, z] = *point;
                *point = [x, y, z + 0.015 * (y - 4.0) * (y - 4.0)];
            }
            surface
        }
        "relief" => {
            let mut surface = quads_to_triangles(subdivided([9, 9, 4], |_| true, wanted, true));
            for point in &mut surface.points {
                let [x, y, z] = *point;
                let waves = (1.1 * x).sin() * (0.9 * y + 0.4).cos() + 0.5 * (2.1 * x - 1.3 * y).sin();
                let hill = 1.6 * (-0.12 * ((x - 4.5).powi(2) + (y - 4.0).powi(2))).exp();
                let high = (z / 4.0).clamp(0.0, 1.0);
                *point = [x, y, z + high * high * (0.3 * waves + hill)];
            }
            surface
        }
        "figure" => {
            let mut surface = quads_to_triangles(subdivided([7, 1, 8], figure, wanted, true));
            for point in &mut surface.points {
                let [x, y, z] = *point;
                // A bow forward, shoulders back.
                *point = [x, 1.4 * y + 0.03 * (z - 4.0) * (z - 4.0), z];
            }
            surface
        }
        _ => {
            let part = |[i, j, k]: [usize; 3]| k < 3 || (i != 1 && j != 1);
            quads_to_triangles(subdivided([3, 3, 4], part, wanted, true))
        }
    }
}

/// The frame of a clothes hanger, and its hook, which starts on the frame's highest cell.
const HANGER: [&[[f64; 2]]; 2] = [
    &[
        [-0.5, 5.0],
        [0.5, 5.0],
        [1.5, 5.0],
        [7.0, 2.0],
        [7.0, 0.0],
        [-7.0, 0.0],
        [-7.0, 2.0],
        [-1.5, 5.0],
        [-0.5, 5.0],
    ],
    &[
        [0.0, 5.5],
        [0.0, 7.0],
        [2.0, 7.0],
        [2.0, 10.0],
        [-1.0, 10.0],
        [-1.0, 9.0],
    ],
];

/// The cubes of a figure with legs, arms and a head.
fn figure([i, _, k]: [usize; 3]) -> bool {
    match k {
        0 | 1 => i == 2 || i == 4,
        2..5 => (2..5).contains(&i),
        5 => true,
        _ => i == 3,
    }
}

fn stretch(surface: &mut TriangleMesh, factors: [f64; 3]) {
    for point in &mut surface.points {
        *point = std::array::from_fn(|axis| point[axis] * factors[axis]);
    }
}

fn quads_to_triangles((points, quads): (Vec<[f64; 3]>, Vec<[u32; 4]>)) -> TriangleMesh {
    let cells = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriangleMesh { points, cells }
}

/// The boundary of some cubes of a grid, cut into quads until there are `wanted` triangles; smoothed in the first rounds
/// by averaging, which tends to a bicubic spline.
fn subdivided(
    counts: [usize; 3],
    part: impl Fn([usize; 3]) -> bool,
    wanted: usize,
    smooth: bool,
) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    cut(selected(counts, part), wanted, smooth)
}

/// The same of any volume of hexahedra.
fn cut(volume: MixedMesh, wanted: usize, smooth: bool) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let faces = volume.topology().map(|topology| {
        let corners = topology.boundary().map(|(_, face)| face.corners);
        corners.collect::<Vec<[u32; 4]>>()
    });
    let mut quads = faces.unwrap_or_default();
    let mut points = volume.points;
    while !quads.is_empty() && 4 * quads.len() <= wanted {
        (points, quads) = split(&points, &quads);
        if smooth {
            average(&mut points, &quads);
        }
    }
    // Points inside the volume belong to no quad.
    let mut names = vec![u32::MAX; points.len()];
    let mut kept = Vec::new();
    for corner in quads.iter_mut().flatten() {
        if names[*corner as usize] == u32::MAX {
            names[*corner as usize] = kept.len() as u32;
            kept.push(points[*corner as usize]);
        }
        *corner = names[*corner as usize];
    }
    (kept, quads)
}

/// Every quad cut into four.
fn split(points: &[[f64; 3]], quads: &[[u32; 4]]) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let mut points = points.to_vec();
    let mut middles = BTreeMap::new();
    let mut result = Vec::with_capacity(4 * quads.len());
    for &[a, b, c, d] in quads {
        let mut middle = |corners: &[u32]| {
            let mut key = corners.to_vec();
            key.sort_unstable();
            *middles.entry(key).or_insert_with(|| {
                let point = std::array::from_fn(|axis| {
                    corners.iter().map(|&corner| points[corner as usize][axis]).sum::<f64>() / corners.len() as f64
                });
                points.push(point);
                points.len() as u32 - 1
            })
        };
        let [ab, bc, cd, da, centre] = [
            middle(&[a, b]),
            middle(&[b, c]),
            middle(&[c, d]),
            middle(&[d, a]),
            middle(&[a, b, c, d]),
        ];
        result.extend([
            [a, ab, centre, da],
            [ab, b, bc, centre],
            [centre, bc, c, cd],
            [da, centre, cd, d],
        ]);
    }
    (points, result)
}

/// Every vertex to the mean of its quads' centroids.
fn average(points: &mut [[f64; 3]], quads: &[[u32; 4]]) {
    let mut sums = vec![([0.0; 3], 0.0); points.len()];
    for quad in quads {
        for &corner in quad {
            let (sum, count) = &mut sums[corner as usize];
            *count += 1.0;
            for axis in 0..3 {
                sum[axis] += quad.iter().map(|&corner| points[corner as usize][axis]).sum::<f64>() / 4.0;
            }
        }
    }
    for (point, (sum, count)) in points.iter_mut().zip(sums) {
        if count > 0.0 {
            *point = sum.map(|coordinate| coordinate / count);
        }
    }
}
