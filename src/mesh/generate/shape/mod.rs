//! Target shapes for surface fitting: triangle surfaces, clean or damaged, so that no file is needed.
//!
//! Sizes are asked for in triangles; the result has about as many. Clean shapes are closed and oriented outward; the
//! same parameters give the same bits. Sharp features lie on edges of the mesh.

pub mod damage;

use super::{Arguments, Parameter};
use crate::mesh::{TriangleMesh, cross, length, subtract};
use serde_json::Value;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// A kind of target, as named in `shape = "torus"`.
#[derive(Debug)]
pub struct Shape {
    pub name: &'static str,
    pub doc: &'static str,
    /// Its own; those of [`damage::PARAMETERS`] come on top.
    own: &'static [Parameter],
    build: fn(&Arguments) -> TriangleMesh,
}

impl Shape {
    /// The shape's own parameters and those of the damage.
    pub fn parameters(&self) -> Vec<Parameter> {
        [self.own, &damage::PARAMETERS].concat()
    }
}

/// Every shape, in the order of the documentation.
pub fn shapes() -> &'static [Shape] {
    const ALL: &[Shape] = &[
        Shape {
            name: "ellipsoid",
            doc: "An ellipsoid.",
            own: &[TRIANGLES, half("a", 1.0), half("b", 0.8), half("c", 0.6)],
            build: ellipsoid,
        },
        Shape {
            name: "torus",
            doc: "A torus with waves along its tube.",
            own: &[TRIANGLES, TUBE, WAVES],
            build: torus,
        },
        Shape {
            name: "knot",
            doc: "A tube around a torus knot: a ring with waves when it runs along the torus once.",
            own: &[TRIANGLES, TUBE, TURNS, WINDINGS],
            build: knot,
        },
        Shape {
            name: "cuboid",
            doc: "A box with sharp edges and corners.",
            own: &[TRIANGLES, half("a", 1.0), half("b", 0.8), half("c", 0.6)],
            build: cuboid,
        },
        Shape {
            name: "sharp-sphere",
            doc: "A sphere with six flat sides, which meet the rest in sharp circles.",
            own: &[TRIANGLES, CUT],
            build: sharp_sphere,
        },
        Shape {
            name: "flower",
            doc: "A sphere with petals that meet in sharp valleys along its meridians.",
            own: &[TRIANGLES, PETALS, DEPTH],
            build: flower,
        },
        Shape {
            name: "double-torus",
            doc: "A thick plate with two square holes: genus two, with sharp edges.",
            own: &[TRIANGLES],
            build: double_torus,
        },
        Shape {
            name: "bowl",
            doc: "A thin curved sheet: half a sphere of some thickness.",
            own: &[TRIANGLES, THICKNESS],
            build: bowl,
        },
    ];
    ALL
}

/// Runs the shape of this name.
///
/// # Errors
/// For an unknown name or a bad parameter, with the mend.
pub fn generate_shape(name: &str, parameters: &Value) -> Result<TriangleMesh, String> {
    let shape = shapes().iter().find(|shape| shape.name == name).ok_or_else(|| {
        let known: Vec<&str> = shapes().iter().map(|shape| shape.name).collect();
        format!("unknown shape `{name}`; there are `{}`", known.join("`, `"))
    })?;
    let arguments = Arguments::read("shape", name, &shape.parameters(), parameters)?;
    let mut mesh = (shape.build)(&arguments);
    damage::damage(&mut mesh, &arguments);
    Ok(mesh)
}

const TRIANGLES: Parameter = Parameter {
    name: "triangles",
    whole: true,
    default: 20_000.0,
    min: 24.0,
    max: 20_000_000.0,
    doc: "number of triangles wanted; the result is as near as the grid allows",
};
const TUBE: Parameter = Parameter {
    name: "tube",
    whole: false,
    default: 0.3,
    min: 0.01,
    max: 0.9,
    doc: "radius of the tube over the radius of the ring",
};
const WAVES: Parameter = Parameter {
    name: "waves",
    whole: true,
    default: 0.0,
    min: 0.0,
    max: 50.0,
    doc: "bulges along the ring, each of a quarter of the tube's radius",
};
const TURNS: Parameter = Parameter {
    name: "turns",
    whole: true,
    default: 2.0,
    min: 1.0,
    max: 20.0,
    doc: "how often the knot runs along the torus",
};
const WINDINGS: Parameter = Parameter {
    name: "windings",
    whole: true,
    default: 3.0,
    min: 0.0,
    max: 20.0,
    doc: "how often the knot runs around the torus's tube; without a common divisor with the turns",
};
const CUT: Parameter = Parameter {
    name: "cut",
    whole: false,
    default: 0.8,
    min: 0.72,
    max: 0.99,
    doc: "distance of the flat sides from the centre over the radius",
};
const PETALS: Parameter = Parameter {
    name: "petals",
    whole: true,
    default: 8.0,
    min: 2.0,
    max: 40.0,
    doc: "number of petals",
};
const DEPTH: Parameter = Parameter {
    name: "depth",
    whole: false,
    default: 0.25,
    min: 0.0,
    max: 0.8,
    doc: "depth of the valleys at the equator over the radius",
};
const THICKNESS: Parameter = Parameter {
    name: "thickness",
    whole: false,
    default: 0.06,
    min: 1e-4,
    max: 0.9,
    doc: "thickness over the outer radius",
};

const fn half(name: &'static str, default: f64) -> Parameter {
    Parameter {
        name,
        whole: false,
        default,
        min: 1e-3,
        max: 1e3,
        doc: "half axis",
    }
}

/// A grid that closes in both directions, by a function of two angles' fractions.
fn ring(rows: usize, columns: usize, point: impl Fn(f64, f64) -> [f64; 3]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..rows {
        for j in 0..columns {
            mesh.points
                .push(point(i as f64 / rows as f64, j as f64 / columns as f64));
            let at = |i: usize, j: usize| (i % rows * columns + j % columns) as u32;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.cells.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// Circles from a lower pole to an upper one; `point` takes the height fraction and the angle's fraction.
fn poles(rows: usize, columns: usize, point: impl Fn(f64, f64) -> [f64; 3]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    mesh.points.push(point(0.0, 0.0));
    for row in 1..rows {
        for column in 0..columns {
            mesh.points
                .push(point(row as f64 / rows as f64, column as f64 / columns as f64));
        }
    }
    mesh.points.push(point(1.0, 0.0));
    let at = |row: usize, column: usize| (1 + (row - 1) * columns + column % columns) as u32;
    let last = mesh.points.len() as u32 - 1;
    for column in 0..columns {
        mesh.cells.push([0, at(1, column + 1), at(1, column)]);
        for row in 1..rows - 1 {
            let [a, b, c, d] = [
                at(row, column),
                at(row, column + 1),
                at(row + 1, column + 1),
                at(row + 1, column),
            ];
            mesh.cells.extend([[a, b, c], [a, c, d]]);
        }
        mesh.cells.push([at(rows - 1, column), at(rows - 1, column + 1), last]);
    }
    mesh
}

/// The surface of a union of unit cells of a grid, each side cut into `parts` by `parts` squares.
fn cells(inside: impl Fn([i64; 3]) -> bool, counts: [i64; 3], parts: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut index: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let parts = parts as i64;
    for x in 0..counts[0] {
        for y in 0..counts[1] {
            for z in 0..counts[2] {
                let cell = [x, y, z];
                if !inside(cell) {
                    continue;
                }
                for axis in 0..3 {
                    for side in [0, 1] {
                        let mut beyond = cell;
                        beyond[axis] += 2 * side - 1;
                        let within = (0..3).all(|axis| (0..counts[axis]).contains(&beyond[axis]));
                        if within && inside(beyond) {
                            continue;
                        }
                        let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
                        for i in 0..parts {
                            for j in 0..parts {
                                let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[di, dj]| {
                                    let mut place = cell.map(|x| x * parts);
                                    place[axis] += side * parts;
                                    place[first] += i + di;
                                    place[second] += j + dj;
                                    *index.entry(place).or_insert_with(|| {
                                        mesh.points.push(place.map(|x| x as f64 / parts as f64));
                                        mesh.points.len() as u32 - 1
                                    })
                                });
                                if side == 0 {
                                    quad.reverse();
                                }
                                let [a, b, c, d] = quad;
                                mesh.cells.extend([[a, b, c], [a, c, d]]);
                            }
                        }
                    }
                }
            }
        }
    }
    mesh
}

fn triangles(arguments: &Arguments) -> f64 {
    arguments.number("triangles")
}

fn axes(arguments: &Arguments) -> [f64; 3] {
    ["a", "b", "c"].map(|name| arguments.number(name))
}

/// A grid over the cube `[-1, 1]^3`, `parts` along each side.
fn cube(parts: usize) -> TriangleMesh {
    let mut mesh = cells(|_| true, [1; 3], parts);
    for x in mesh.points.as_flattened_mut() {
        *x = 2.0 * *x - 1.0;
    }
    mesh
}

fn cube_parts(arguments: &Arguments) -> usize {
    ((triangles(arguments) / 12.0).sqrt().round() as usize).max(2)
}

/// The direction of a point of the cube, with equal angles along its sides.
fn direction(point: [f64; 3]) -> [f64; 3] {
    let bent = point.map(|x| (PI / 4.0 * x).tan());
    let norm = length(bent);
    bent.map(|x| x / norm)
}

fn ellipsoid(arguments: &Arguments) -> TriangleMesh {
    let axes = axes(arguments);
    let mut mesh = cube(cube_parts(arguments));
    for point in &mut mesh.points {
        let unit = direction(*point);
        *point = std::array::from_fn(|axis| axes[axis] * unit[axis]);
    }
    mesh
}

fn cuboid(arguments: &Arguments) -> TriangleMesh {
    let axes = axes(arguments);
    let mut mesh = cube(cube_parts(arguments));
    for point in &mut mesh.points {
        *point = std::array::from_fn(|axis| axes[axis] * point[axis]);
    }
    mesh
}

fn sharp_sphere(arguments: &Arguments) -> TriangleMesh {
    let cut = arguments.number("cut");
    let radius = (1.0 - cut * cut).sqrt();
    let mut mesh = cube(2 * cube_parts(arguments).div_ceil(2));
    let parts = 2 * cube_parts(arguments).div_ceil(2);
    for point in &mut mesh.points {
        // On each side of the cube the middle squares become the flat disc, ring by ring, and the rest the sphere.
        let side = (0..3).fold(0, |best, axis| {
            if point[axis].abs() > point[best].abs() {
                axis
            } else {
                best
            }
        });
        let (first, second) = ((side + 1) % 3, (side + 2) % 3);
        let (x, y) = (point[first], point[second]);
        let square = x.abs().max(y.abs());
        // The share of the side that the disc gets, at a line of the grid.
        let share = (0.6 * parts as f64 / 2.0).round() / (parts as f64 / 2.0);
        if square <= share + 1e-9 {
            let norm = x.hypot(y);
            let scale = if norm > 0.0 {
                radius * square / share / norm
            } else {
                0.0
            };
            let sign = point[side].signum();
            point[first] = scale * x;
            point[second] = scale * y;
            point[side] = sign * cut;
        } else {
            // Between the circle at the disc and the edge of the side, on the sphere.
            let t = (square - share) / (1.0 - share);
            let norm = x.hypot(y);
            let mut circle = [0.0; 3];
            circle[first] = radius * x / norm;
            circle[second] = radius * y / norm;
            circle[side] = point[side].signum() * cut;
            let mut edge = *point;
            edge[first] = x / square;
            edge[second] = y / square;
            let edge = direction(edge);
            let mixed: [f64; 3] = std::array::from_fn(|axis| (1.0 - t) * circle[axis] + t * edge[axis]);
            let norm = length(mixed);
            *point = mixed.map(|x| x / norm);
        }
    }
    mesh
}

fn torus(arguments: &Arguments) -> TriangleMesh {
    let tube = arguments.number("tube");
    let waves = arguments.number("waves");
    let rows = ((triangles(arguments) / (2.0 * tube)).sqrt().round() as usize).max(3);
    let columns = ((triangles(arguments) / (2.0 * rows as f64)).round() as usize).max(3);
    ring(rows, columns, |s, t| {
        let (u, v) = (TAU * s, TAU * t);
        let radius = tube * (1.0 + 0.25 * (waves * u).sin());
        let ring = 1.0 + radius * v.cos();
        [ring * u.cos(), ring * u.sin(), radius * v.sin()]
    })
}

fn knot(arguments: &Arguments) -> TriangleMesh {
    let (turns, windings) = (arguments.number("turns"), arguments.number("windings"));
    // The torus that the knot lies on has the tube 0.4; the knot's own is a share of the room there.
    let (around, radius) = (0.4, arguments.number("tube") * 0.5);
    let centre = |s: f64| -> [f64; 3] {
        let (u, v) = (TAU * turns * s, TAU * windings * s);
        let ring = 1.0 + around * v.cos();
        [ring * u.cos(), ring * u.sin(), around * v.sin()]
    };
    // A frame that closes: the torus's own normal, made perpendicular to the curve.
    let frame = |s: f64| -> ([f64; 3], [f64; 3]) {
        let step = 1e-5;
        let tangent = subtract(centre(s + step), centre(s - step));
        let norm = length(tangent);
        let tangent = tangent.map(|x| x / norm);
        let (u, v) = (TAU * turns * s, TAU * windings * s);
        let outward = if windings > 0.0 {
            [v.cos() * u.cos(), v.cos() * u.sin(), v.sin()]
        } else {
            [0.0, 0.0, 1.0]
        };
        let side = cross(tangent, outward);
        let norm = length(side);
        let side = side.map(|x| x / norm);
        (cross(side, tangent), side)
    };
    let curve = (0..512)
        .map(|k| length(subtract(centre((k + 1) as f64 / 512.0), centre(k as f64 / 512.0))))
        .sum::<f64>();
    let ratio = TAU * radius / curve;
    let rows = ((triangles(arguments) / (2.0 * ratio)).sqrt().round() as usize).max(3);
    let columns = ((triangles(arguments) / (2.0 * rows as f64)).round() as usize).max(3);
    ring(rows, columns, |s, t| {
        let middle = centre(s);
        let (normal, side) = frame(s);
        let v = TAU * t;
        std::array::from_fn(|axis| middle[axis] + radius * (v.cos() * normal[axis] - v.sin() * side[axis]))
    })
}

fn flower(arguments: &Arguments) -> TriangleMesh {
    let (petals, depth) = (arguments.number("petals"), arguments.number("depth"));
    let rows = ((triangles(arguments) / 4.0).sqrt().round() as usize).max(3);
    // A multiple of the petals, so that the valleys lie on edges.
    let per_petal = (triangles(arguments) / (2.0 * rows as f64 * petals)).round().max(2.0);
    poles(rows, (per_petal * petals) as usize, |s, t| {
        let (theta, phi) = (PI * s, TAU * t);
        // Down at the valleys, and smooth at the poles, where all petals meet.
        let radius = 1.0 - depth * theta.sin().powi(2) * (1.0 - (0.5 * petals * phi).sin().abs());
        [
            radius * theta.sin() * phi.cos(),
            radius * theta.sin() * phi.sin(),
            -radius * theta.cos(),
        ]
    })
}

fn double_torus(arguments: &Arguments) -> TriangleMesh {
    // A plate of 5 by 3 by 1 cells without two of the inner ones: 46 sides and 8 in the holes.
    let parts = ((triangles(arguments) / (2.0 * 50.0)).sqrt().round() as usize).max(1);
    cells(|[x, y, _]| !(y == 1 && (x == 1 || x == 3)), [5, 3, 1], parts)
}

fn bowl(arguments: &Arguments) -> TriangleMesh {
    let thickness = arguments.number("thickness");
    // Down the outside from the pole to the rim, across the rim, up the inside.
    let rows = ((triangles(arguments) / 4.0).sqrt().round() as usize).max(6);
    let columns = ((triangles(arguments) / (2.0 * rows as f64)).round() as usize).max(6);
    let rim = (thickness * rows as f64 / PI).ceil() / rows as f64;
    poles(rows, columns, |s, t| {
        let phi = TAU * t;
        let outer = (0.5 - rim / 2.0).max(0.1);
        let (radius, theta) = if s <= outer {
            (1.0, PI / 2.0 * s / outer)
        } else if s < 1.0 - outer {
            (1.0 - thickness * (s - outer) / (1.0 - 2.0 * outer), PI / 2.0)
        } else {
            (1.0 - thickness, PI / 2.0 * (1.0 - s) / outer)
        };
        [
            radius * theta.sin() * phi.cos(),
            radius * theta.sin() * phi.sin(),
            -radius * theta.cos(),
        ]
    })
}
