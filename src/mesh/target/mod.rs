//! Targets of a map: a position for every boundary vertex of a tetrahedral mesh, from a second mesh, from a list, or on
//! a generated shape.
//!
//! A generated shape is checked: every boundary triangle has positive area on its side, seen from outside. Positions from
//! files are only checked to be complete and finite; whether a map onto them can be free of folds is for the method.

pub mod list;

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
    let natural = surface.natural.ok_or("this mesh has no natural position on a cube")?;
    if natural.len() != surface.mesh.points.len() {
        let (given, wanted) = (natural.len(), surface.mesh.points.len());
        return Err(format!(
            "{given} positions on the cube are given for a mesh with {wanted} vertices"
        ));
    }
    let plain = surface.boundary.vertices.iter().map(|&vertex| natural[vertex as usize]);
    let (swirl, warp) = (arguments.number("swirl"), arguments.number("warp"));
    let positions: Vec<[f64; 3]> = plain.map(|point| disturb(point, swirl, warp)).collect();
    let inverted = inverted_about(surface.boundary, &positions, [0.5; 3]);
    match inverted.first() {
        None => Ok(positions),
        Some(first) => Err(format!(
            "{} boundary triangles are inverted or flat on the cube, the first with vertices {:?}; lower `swirl` and \
             `warp` or refine the mesh",
            inverted.len(),
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
    let mut place = vec![0u32; boundary.mask.len()];
    for (index, &vertex) in boundary.vertices.iter().enumerate() {
        place[vertex as usize] = index as u32;
    }
    (0..boundary.triangles.len() as u32)
        .filter(|&triangle| {
            let [a, b, c] =
                boundary.triangles[triangle as usize].map(|vertex| positions[place[vertex as usize] as usize]);
            let volume = determinant([centre, a, b, c]);
            !(volume > 0.0)
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
