//! Surfaces with creases: smooth pieces that meet at an angle, given by a formula each.

use super::analytic::Analytic;
use super::{Creased, GeneratedSurface, Parameter, SurfaceGenerator, refine};
use crate::mesh::generate::Arguments;
use crate::mesh::length;
use crate::mesh::quadrilateral::QuadrilateralMesh;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

pub(super) const CYLINDER: SurfaceGenerator = SurfaceGenerator {
    name: "cylinder",
    doc: "a closed cylinder about the z-axis: two flat caps and a wall that meet in circular creases",
    parameters: &[
        Parameter {
            name: "cells",
            whole: true,
            default: 4.0,
            min: 1.0,
            max: 1000.0,
            doc: "quadrilaterals along a quarter of the circle; the surface has 14 cells^2 of them",
        },
        Parameter {
            name: "radius",
            whole: false,
            default: 1.0,
            min: 1e-3,
            max: 1e3,
            doc: "radius of the wall",
        },
        Parameter {
            name: "height",
            whole: false,
            default: 1.6,
            min: 1e-3,
            max: 1e3,
            doc: "distance of the caps",
        },
    ],
    build: cylinder,
};

pub(super) const CUBE: SurfaceGenerator = SurfaceGenerator {
    name: "cube",
    doc: "the cube [-1, 1]^3 with bulging faces, parts of spheres through its corners: twelve creases, three at a corner",
    parameters: &[
        Parameter {
            name: "cells",
            whole: true,
            default: 4.0,
            min: 1.0,
            max: 1000.0,
            doc: "quadrilaterals along an edge; the surface has 6 cells^2 of them",
        },
        Parameter {
            name: "bulge",
            whole: false,
            default: 0.5,
            min: 0.0,
            max: 0.95,
            doc: "0 for flat faces; towards 1 the faces become parts of one sphere and the creases vanish",
        },
    ],
    build: cube,
};

pub(super) const RIDGE: SurfaceGenerator = SurfaceGenerator {
    name: "ridge",
    doc: "an open surface over [-1, 1]^2 with a crease that fades out in its middle: z = -bowl (x^2 + y^2) - height |x| y^3 \
          where y > 0",
    parameters: &[
        Parameter {
            name: "cells",
            whole: true,
            default: 4.0,
            min: 1.0,
            max: 1000.0,
            doc: "quadrilaterals along half an edge of the square",
        },
        Parameter {
            name: "height",
            whole: false,
            default: 0.8,
            min: 0.0,
            max: 10.0,
            doc: "slope of both sides where the crease meets the boundary",
        },
        Parameter {
            name: "bowl",
            whole: false,
            default: 0.3,
            min: 0.0,
            max: 10.0,
            doc: "half the curvature of the whole",
        },
    ],
    build: ridge,
};

/// Puts a surface together: a normal a vertex is the mean of those of its pieces.
fn assemble(
    points: Vec<[f64; 3]>,
    quads: Vec<[u32; 4]>,
    pieces: Vec<Analytic>,
    piece_of: Vec<u32>,
    sharp: Vec<[u32; 2]>,
) -> GeneratedSurface {
    let mut touched: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    for (quad, &piece) in quads.iter().zip(&piece_of) {
        for &vertex in quad {
            let list = &mut touched[vertex as usize];
            if !list.contains(&piece) {
                list.push(piece);
            }
        }
    }
    let normal = |(point, pieces_here): (&[f64; 3], &Vec<u32>)| {
        let mut sum = [0.0; 3];
        for &piece in pieces_here {
            let normal = pieces[piece as usize].normal(*point);
            sum = std::array::from_fn(|axis| sum[axis] + normal[axis]);
        }
        let size = length(sum);
        sum.map(|component| component / size)
    };
    let normals = points.iter().zip(&touched).map(normal).collect();
    GeneratedSurface {
        mesh: QuadrilateralMesh {
            points,
            quads,
            normals: Some(normals),
        },
        exact: None,
        creased: Some(Creased {
            sharp,
            pieces,
            piece_of,
        }),
    }
}

/// The edges between quads of different pieces.
fn between(quads: &[[u32; 4]], piece_of: &[u32]) -> Vec<[u32; 2]> {
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(4 * quads.len());
    for (quad, &piece) in quads.iter().zip(piece_of) {
        for corner in 0..4 {
            let (a, b) = (quad[corner], quad[(corner + 1) % 4]);
            sides.push(([a.min(b), a.max(b)], piece));
        }
    }
    sides.sort_unstable();
    let shared = sides
        .windows(2)
        .filter(|pair| pair[0].0 == pair[1].0 && pair[0].1 != pair[1].1);
    shared.map(|pair| pair[0].0).collect()
}

/// The plane with this coordinate times `side` equal to `place`, outward.
fn plane(axis: usize, side: f64, place: f64) -> Analytic {
    let mut linear = [0.0; 3];
    linear[axis] = side;
    Analytic::Quadric {
        weights: [0.0; 3],
        centre: [0.0; 3],
        linear,
        constant: place,
    }
}

/// The direction in the plane that belongs to a point on the boundary of the square, equal lengths to equal angles.
fn on_circle(x: f64, y: f64) -> [f64; 2] {
    let angle = if x.abs() >= y.abs() {
        let turn = FRAC_PI_4 * y / x.abs();
        if x > 0.0 { turn } else { PI - turn }
    } else {
        let turn = FRAC_PI_4 * x / y.abs();
        if y > 0.0 { FRAC_PI_2 - turn } else { turn - FRAC_PI_2 }
    };
    [angle.cos(), angle.sin()]
}

fn cylinder(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let cells = arguments.number("cells") as usize;
    let [radius, height] = ["radius", "height"].map(|name| arguments.number(name));
    // Inner and outer squares of the bottom, then of the top.
    let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut corners: Vec<[f64; 3]> = Vec::new();
    for z in [-1.0, 1.0] {
        for size in [0.5, 1.0] {
            corners.extend(square.map(|[x, y]| [size * x, size * y, z]));
        }
    }
    let mut coarse: Vec<[u32; 4]> = vec![[3, 2, 1, 0], [8, 9, 10, 11]];
    for here in 0..4u32 {
        let next = (here + 1) % 4;
        coarse.push([here, next, 4 + next, 4 + here]);
        coarse.push([8 + next, 8 + here, 12 + here, 12 + next]);
        coarse.push([4 + here, 4 + next, 12 + next, 12 + here]);
    }
    let piece = |block: usize| match block {
        0 | 1 => block as u32,
        block => ((block - 2) % 3) as u32,
    };
    let (mut points, quads) = refine(&corners, &coarse, cells);
    for point in &mut points {
        let [x, y, z] = *point;
        let reach = x.abs().max(y.abs());
        // Within the inner square as it is, then over to the circle.
        let share = ((reach - 0.5) / 0.5).clamp(0.0, 1.0);
        let inner = 0.9 * if reach > 0.5 { 0.5 / reach } else { 1.0 };
        let [c, s] = if share > 0.0 { on_circle(x, y) } else { [0.0, 0.0] };
        *point = [
            radius * ((1.0 - share) * inner * x + share * c),
            radius * ((1.0 - share) * inner * y + share * s),
            0.5 * height * z,
        ];
    }
    let piece_of: Vec<u32> = (0..quads.len()).map(|quad| piece(quad / (cells * cells))).collect();
    let wall = Analytic::Quadric {
        weights: [1.0, 1.0, 0.0],
        centre: [0.0; 3],
        linear: [0.0; 3],
        constant: radius * radius,
    };
    let pieces = vec![plane(2, -1.0, 0.5 * height), plane(2, 1.0, 0.5 * height), wall];
    let sharp = between(&quads, &piece_of);
    Ok(assemble(points, quads, pieces, piece_of, sharp))
}

fn cube(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let cells = arguments.number("cells") as usize;
    let bulge = arguments.number("bulge");
    let corners: Vec<[f64; 3]> = (0..8u32)
        .map(|corner| std::array::from_fn(|axis| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 }))
        .collect();
    let (mut points, quads) = refine(&corners, &super::cubed_sphere::FACES, cells);
    // Spheres about `-back` times the faces' normals through the corners.
    let back = if bulge > 0.0 { (1.0 - bulge) / bulge } else { 0.0 };
    let square = (1.0 + back) * (1.0 + back) + 2.0;
    if bulge > 0.0 {
        for point in &mut points {
            let size: f64 = point.iter().map(|component| component * component).sum();
            let along = ((back * back + size * (square - back * back)).sqrt() - back) / size;
            *point = point.map(|component| along * component);
        }
    }
    let faces = [(2, -1.0), (2, 1.0), (1, -1.0), (1, 1.0), (0, -1.0), (0, 1.0)];
    let pieces = faces
        .map(|(axis, side)| {
            if bulge == 0.0 {
                return plane(axis, side, 1.0);
            }
            let mut centre = [0.0; 3];
            centre[axis] = -side * back;
            Analytic::Quadric {
                weights: [1.0; 3],
                centre,
                linear: [0.0; 3],
                constant: square,
            }
        })
        .to_vec();
    let piece_of: Vec<u32> = (0..quads.len()).map(|quad| (quad / (cells * cells)) as u32).collect();
    let sharp = between(&quads, &piece_of);
    Ok(assemble(points, quads, pieces, piece_of, sharp))
}

fn ridge(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let half = arguments.number("cells") as usize;
    let [height, bowl] = ["height", "bowl"].map(|name| arguments.number(name));
    let side = 2 * half;
    let mut points = Vec::with_capacity((side + 1) * (side + 1));
    for j in 0..=side {
        for i in 0..=side {
            let [x, y] = [i, j].map(|index| index as f64 / half as f64 - 1.0);
            let slope = y.max(0.0) * y * y;
            points.push([x, y, -bowl * (x * x + y * y) - height * x.abs() * slope]);
        }
    }
    let name = |i: usize, j: usize| (j * (side + 1) + i) as u32;
    let places = || (0..side).flat_map(|j| (0..side).map(move |i| (i, j)));
    let quads = places()
        .map(|(i, j)| [name(i, j), name(i + 1, j), name(i + 1, j + 1), name(i, j + 1)])
        .collect();
    let piece_of = places().map(|(i, _)| u32::from(i >= half)).collect();
    let sharp = (half..side).map(|j| [name(half, j), name(half, j + 1)]).collect();
    let pieces = [-1.0, 1.0].map(|side| Analytic::Ridge { height, bowl, side }).to_vec();
    Ok(assemble(points, quads, pieces, piece_of, sharp))
}
