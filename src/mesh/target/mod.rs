//! Targets of a map: a position for every boundary vertex of a tetrahedral mesh, from a second mesh, from a list, or on
//! a generated shape.
//!
//! A generated shape is checked: every boundary triangle has positive area on its side, seen from outside. Positions from
//! files are only checked to be complete and finite; whether a map onto them can be free of folds is for the method.

mod harmonic;
mod layout;
pub mod list;
pub mod polyhedron;

use super::connectivity::Boundary;
use super::generate::{Arguments, Parameter};
use super::{TetrahedralMesh, determinant};
use serde_json::Value;
use std::f64::consts::PI;

/// Where the boundary goes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Target {
    /// One position for each of [`Boundary::vertices`], in that order.
    pub positions: Vec<[f64; 3]>,
    /// Positions for all vertices, when the source of the target has them: a start, not a constraint, and not
    /// necessarily free of folds.
    pub interior: Option<Vec<[f64; 3]>>,
}

/// Takes the boundary positions from a second mesh with the same tetrahedra over the same vertex numbers. The order of
/// the tetrahedra and of the vertices within them does not matter.
///
/// # Errors
/// Says how the two meshes differ, with the first tetrahedron that only one of them has, or which position is not finite.
pub fn from_mesh(source: &TetrahedralMesh, boundary: &Boundary, target: &TetrahedralMesh) -> Result<Target, String> {
    let (ours, theirs) = (source.points.len(), target.points.len());
    if ours != theirs {
        return Err(format!(
            "the target has {theirs} vertices but the mesh has {ours}; both must have the same vertices and tetrahedra"
        ));
    }
    let (ours, theirs) = (source.cells.len(), target.cells.len());
    if ours != theirs {
        return Err(format!(
            "the target has {theirs} tetrahedra but the mesh has {ours}; both must have the same vertices and tetrahedra"
        ));
    }
    let sorted = |mesh: &TetrahedralMesh| {
        let mut cells: Vec<([u32; 4], u32)> = mesh
            .cells
            .iter()
            .enumerate()
            .map(|(index, cell)| {
                let mut cell = *cell;
                cell.sort_unstable();
                (cell, index as u32)
            })
            .collect();
        cells.sort_unstable();
        cells
    };
    let (ours, theirs) = (sorted(source), sorted(target));
    let differing = ours.iter().zip(&theirs).filter(|(a, b)| a.0 != b.0).count();
    if let Some((a, b)) = ours.iter().zip(&theirs).find(|(a, b)| a.0 != b.0) {
        // The smaller of the two is the one that the other mesh lacks.
        let (owner, (vertices, index)) = if a.0 < b.0 { ("mesh", a) } else { ("target", b) };
        return Err(format!(
            "the target's tetrahedra are not those of the mesh ({differing} of {} differ): only the {owner} has \
             tetrahedron {index} with vertices {vertices:?}; both must have the same connectivity",
            ours.len()
        ));
    }
    if let Some(vertex) = target
        .points
        .iter()
        .position(|point| !point.iter().all(|c| c.is_finite()))
    {
        return Err(format!(
            "the target's vertex {vertex} has a coordinate that is not finite"
        ));
    }
    let positions = boundary
        .vertices
        .iter()
        .map(|&vertex| target.points[vertex as usize])
        .collect();
    Ok(Target {
        positions,
        interior: Some(target.points.clone()),
    })
}

/// A kind of target shape, as named in `shape = "cube"`.
#[derive(Debug)]
pub struct Shape {
    pub name: &'static str,
    pub doc: &'static str,
    pub parameters: &'static [Parameter],
    build: fn(&Surface, &Arguments) -> Result<Target, String>,
}

/// What a shape is made for.
struct Surface<'a> {
    mesh: &'a TetrahedralMesh,
    boundary: &'a Boundary,
    natural: Option<&'a [[f64; 3]]>,
}

const RADIUS: Parameter = Parameter {
    name: "radius",
    whole: false,
    default: 1.0,
    min: 1e-6,
    max: 1e6,
    doc: "distance of the corners from the centre, in model units",
};
const SWIRL: Parameter = Parameter {
    name: "swirl",
    whole: false,
    default: 0.0,
    min: -20.0,
    max: 20.0,
    doc: "angle by which the middles of the upper and lower side are turned, in opposite senses, in radians",
};
const WARP: Parameter = Parameter {
    name: "warp",
    whole: false,
    default: 0.0,
    min: -0.15,
    max: 0.15,
    doc: "crowds the vertices within the sides: s becomes s + warp sin(2 pi s) along x and z, and y is bent by x",
};

/// Every shape, in the order of the documentation.
pub fn shapes() -> &'static [Shape] {
    const ALL: &[Shape] = &[
        Shape {
            name: "cube",
            doc: "the cube from the origin to (edge, edge, edge)",
            parameters: &[
                Parameter {
                    name: "edge",
                    whole: false,
                    default: 1.0,
                    min: 1e-6,
                    max: 1e6,
                    doc: "edge length, in model units",
                },
                SWIRL,
                WARP,
            ],
            build: cube,
        },
        Shape {
            name: "sphere",
            doc: "a sphere around the origin: the cube projected from its centre",
            parameters: &[
                Parameter {
                    name: "radius",
                    whole: false,
                    default: 1.0,
                    min: 1e-6,
                    max: 1e6,
                    doc: "radius, in model units",
                },
                SWIRL,
                WARP,
            ],
            build: sphere,
        },
        Shape {
            name: "octahedron",
            doc: "the octahedron around the origin, laid over the surface",
            parameters: &[RADIUS],
            build: |surface, arguments| scaled(surface, &polyhedron::OCTAHEDRON, arguments.number("radius")),
        },
        Shape {
            name: "tetrahedron",
            doc: "the regular tetrahedron around the origin, laid over the surface",
            parameters: &[RADIUS],
            build: |surface, arguments| {
                scaled(
                    surface,
                    &polyhedron::TETRAHEDRON,
                    arguments.number("radius") / 3.0f64.sqrt(),
                )
            },
        },
    ];
    ALL
}

/// Puts the boundary of a mesh onto the shape of this name, with parameters from a table of numbers.
///
/// `natural` are the positions in the unit cube that come with a generated mesh; without them the cube's edges are laid
/// over the surface first.
///
/// # Errors
/// For an unknown name, a bad parameter, a surface that is not a topological sphere, or a boundary triangle that would
/// be inverted; each with the mend.
pub fn shape(
    name: &str,
    parameters: &Value,
    mesh: &TetrahedralMesh,
    boundary: &Boundary,
    natural: Option<&[[f64; 3]]>,
) -> Result<Target, String> {
    let shape = shapes().iter().find(|shape| shape.name == name).ok_or_else(|| {
        let known: Vec<&str> = shapes().iter().map(|shape| shape.name).collect();
        format!("unknown target shape `{name}`; there are `{}`", known.join("`, `"))
    })?;
    let arguments = Arguments::read("shape", shape.name, shape.parameters, parameters)?;
    (shape.build)(
        &Surface {
            mesh,
            boundary,
            natural,
        },
        &arguments,
    )
}

/// Positions on the unit cube for the boundary vertices, swirled and warped as asked.
fn unit_cube(surface: &Surface, arguments: &Arguments) -> Result<Vec<[f64; 3]>, String> {
    let plain = match surface.natural {
        Some(natural) if natural.len() != surface.mesh.points.len() => {
            let (given, wanted) = (natural.len(), surface.mesh.points.len());
            return Err(format!(
                "{given} positions on the cube are given for a mesh with {wanted} vertices"
            ));
        }
        Some(natural) => surface
            .boundary
            .vertices
            .iter()
            .map(|&vertex| natural[vertex as usize])
            .collect(),
        None => laid(surface, &polyhedron::CUBE)?
            .iter()
            .map(|point| point.map(|coordinate| 0.5 * (coordinate + 1.0)))
            .collect::<Vec<_>>(),
    };
    let (swirl, warp) = (arguments.number("swirl"), arguments.number("warp"));
    if swirl == 0.0 && warp == 0.0 {
        return valid(surface, plain, [0.5; 3], "refine the mesh");
    }
    let mut disturbed: Vec<[f64; 3]> = plain.iter().map(|&point| disturb(point, swirl, warp)).collect();
    if !inverted_about(surface.boundary, &disturbed, [0.5; 3]).is_empty() {
        unfold(surface.boundary, &mut disturbed);
    }
    valid(
        surface,
        disturbed,
        [0.5; 3],
        "lower `swirl` and `warp` or refine the mesh",
    )
}

/// Moves vertices within the sides of the unit cube until no triangle is inverted, if it can: a disturbance that is
/// one to one for points may be more than large triangles can follow.
///
/// Only vertices of poor triangles (shape below 0.05) move, each to where the smallest shape around it is largest, by a
/// search along the two axes of its side with falling steps.
fn unfold(boundary: &Boundary, positions: &mut [[f64; 3]]) {
    const POOR: f64 = 0.05;
    let place = boundary.places();
    let triangles: Vec<[u32; 3]> = boundary
        .triangles
        .iter()
        .map(|t| t.map(|vertex| place[vertex as usize]))
        .collect();
    let around = super::connectivity::incidence(&triangles, positions.len());
    // Twice the area towards the outside of the cube over the mean squared edge: about 1 for a good triangle.
    let shape = |positions: &[[f64; 3]], triangle: u32| {
        let corners = triangles[triangle as usize].map(|vertex| positions[vertex as usize]);
        let squares = (0..3).map(|i| {
            let edge = super::subtract(corners[(i + 1) % 3], corners[i]);
            super::dot(edge, edge)
        });
        let middle: [f64; 3] = std::array::from_fn(|axis| corners.iter().map(|p| p[axis]).sum::<f64>() / 3.0 - 0.5);
        let normal = super::area_vector(corners);
        let turned = if super::dot(normal, middle) > 0.0 { 1.0 } else { -1.0 };
        turned * super::length(normal) * 3.0 / squares.sum::<f64>().max(f64::MIN_POSITIVE)
    };
    let worst = |positions: &[[f64; 3]], vertex: usize| {
        around
            .row(vertex)
            .iter()
            .map(|&triangle| shape(positions, triangle))
            .fold(f64::INFINITY, f64::min)
    };
    for _ in 0..200 {
        let mut moved = false;
        for vertex in 0..positions.len() {
            // On an edge or corner of the cube more than one coordinate is held.
            let free: Vec<usize> = (0..3)
                .filter(|&a| positions[vertex][a] != 0.0 && positions[vertex][a] != 1.0)
                .collect();
            let mut best = worst(positions, vertex);
            if free.len() != 2 || best >= POOR {
                continue;
            }
            let edges = around
                .row(vertex)
                .iter()
                .flat_map(|&triangle| triangles[triangle as usize]);
            let reach = edges.map(|v| super::length(super::subtract(positions[v as usize], positions[vertex])));
            let mut step = 0.5 * reach.fold(0.0, f64::max);
            for _ in 0..12 {
                let before = best;
                for &axis in &free {
                    for sign in [-1.0, 1.0] {
                        let here = positions[vertex];
                        positions[vertex][axis] = (here[axis] + sign * step).clamp(1e-6, 1.0 - 1e-6);
                        let reached = worst(positions, vertex);
                        if reached > best + 1e-6 {
                            best = reached;
                            moved = true;
                        } else {
                            positions[vertex] = here;
                        }
                    }
                }
                if best == before {
                    step /= 2.0;
                }
            }
        }
        if !moved {
            return;
        }
    }
}

/// Positions on a polyhedron around the origin for the boundary vertices.
fn laid(surface: &Surface, polyhedron: &polyhedron::Polyhedron) -> Result<Vec<[f64; 3]>, String> {
    let vertices = &surface.boundary.vertices;
    let place = surface.boundary.places();
    let points: Vec<[f64; 3]> = vertices
        .iter()
        .map(|&vertex| surface.mesh.points[vertex as usize])
        .collect();
    let triangles = surface
        .boundary
        .triangles
        .iter()
        .map(|triangle| triangle.map(|vertex| place[vertex as usize]));
    let positions = polyhedron::lay(polyhedron, &points, &triangles.collect::<Vec<_>>())?;
    valid(
        surface,
        positions,
        [0.0; 3],
        "refine the mesh or give the target as a file of boundary positions",
    )
}

/// Passes positions on that turn every boundary triangle's front away from `centre`.
fn valid(surface: &Surface, positions: Vec<[f64; 3]>, centre: [f64; 3], mend: &str) -> Result<Vec<[f64; 3]>, String> {
    let inverted = inverted_about(surface.boundary, &positions, centre);
    match inverted.first() {
        None => Ok(positions),
        Some(first) => Err(format!(
            "{} of {} boundary triangles are inverted or flat on the target, the first with vertices {:?}; {mend}",
            inverted.len(),
            surface.boundary.triangles.len(),
            surface.boundary.triangles[*first as usize]
        )),
    }
}

/// Moves a point of the unit cube within the cube's sides: the warp first, then the swirl of the upper and lower side.
fn disturb(point: [f64; 3], swirl: f64, warp: f64) -> [f64; 3] {
    let [x, y, z] = point;
    let crowd = |s: f64| s + warp * (2.0 * PI * s).sin();
    // The shear of y by x keeps the proportion of 0.10 to 0.12 to the crowding.
    let bent = y + 0.1 * (warp / 0.12) * (PI * y).sin() * (2.0 * PI * x).sin();
    let warped = [crowd(x), bent, crowd(z)];
    // What lies on a side stays on it exactly.
    let on = |axis: usize| point[axis] < 1e-12 || point[axis] > 1.0 - 1e-12;
    let [x, y, top]: [f64; 3] = std::array::from_fn(|axis| if on(axis) { point[axis] } else { warped[axis] });
    let (dx, dy) = (x - 0.5, y - 0.5);
    let bump = (1.0 - 4.0 * dx * dx - 4.0 * dy * dy).clamp(0.0, 1.0);
    let angle = swirl * (bump * bump) * (2.0 * z - 1.0);
    let (sine, cosine) = angle.sin_cos();
    [0.5 + (cosine * dx - sine * dy), 0.5 + (sine * dx + cosine * dy), top]
}

/// Boundary triangles that do not turn their front away from `centre`. For positions on a surface that is star-shaped
/// around it, such as a convex one, a map without any is locally one to one.
pub fn inverted_about(boundary: &Boundary, positions: &[[f64; 3]], centre: [f64; 3]) -> Vec<u32> {
    let place = boundary.places();
    (0..boundary.triangles.len() as u32)
        .filter(|&triangle| {
            let [a, b, c] =
                boundary.triangles[triangle as usize].map(|vertex| positions[place[vertex as usize] as usize]);
            let volume = determinant([centre, a, b, c]);
            volume.is_nan() || volume <= 0.0
        })
        .collect()
}

fn cube(surface: &Surface, arguments: &Arguments) -> Result<Target, String> {
    let edge = arguments.number("edge");
    let mut positions = unit_cube(surface, arguments)?;
    for point in &mut positions {
        *point = point.map(|coordinate| edge * coordinate);
    }
    Ok(Target {
        positions,
        interior: None,
    })
}

fn sphere(surface: &Surface, arguments: &Arguments) -> Result<Target, String> {
    let radius = arguments.number("radius");
    let mut positions = unit_cube(surface, arguments)?;
    // A projection from the centre takes the planes through it to themselves: orientation is kept.
    for point in &mut positions {
        let direction = point.map(|coordinate| 2.0 * coordinate - 1.0);
        let scale = radius / super::length(direction);
        *point = direction.map(|coordinate| scale * coordinate);
    }
    Ok(Target {
        positions,
        interior: None,
    })
}

/// The polyhedron with its coordinates multiplied by `scale`.
fn scaled(surface: &Surface, polyhedron: &polyhedron::Polyhedron, scale: f64) -> Result<Target, String> {
    let mut positions = laid(surface, polyhedron)?;
    for point in &mut positions {
        *point = point.map(|coordinate| scale * coordinate);
    }
    Ok(Target {
        positions,
        interior: None,
    })
}
