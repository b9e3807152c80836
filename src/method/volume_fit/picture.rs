//! The picture of a fit: every element cut evenly into linear cells.

use super::invalid;
use crate::fem::batches::Batches;
use crate::fem::quadrature::Rule;
use crate::fem::space::Space;
use crate::linalg::processor::Processor;
use crate::linalg::vector3::Columns;
use crate::mesh;
use crate::mesh::format::{Cells, vtu};
use crate::mesh::mixed::{MixedMesh, Shape};
use crate::method::Failure;
use std::collections::BTreeMap;

/// Cells of the picture at most, where elements may be cut coarser.
const MOST_CELLS: usize = 60_000;

/// The volume as a VTU file of linear cells, every element cut evenly.
pub fn picture(
    space: &Space,
    references: &[Columns<f64>],
    x: &[f64],
    volume: &MixedMesh,
    fields: &[(&str, Vec<f64>)],
) -> Result<Vec<u8>, Failure> {
    let cells = volume.cells();
    let highest = space.orders.iter().copied().max().unwrap_or(1);
    let mut cuts = if highest == 1 { 1 } else { (2 * highest).clamp(4, 8) };
    while cuts > 1 && cells * cuts * cuts * cuts > MOST_CELLS {
        cuts -= 1;
    }
    let m = cuts;
    let batches = Batches::new(space, references, &|kind| Rule::Trapezoid.cell(kind.shape, m + 1)).map_err(invalid)?;
    let lattices = Shape::ALL.map(|shape| lattice(shape, m));
    // A point's name: its weights over the vertices, times m^3. Elements that share a point share its name.
    let mut names: BTreeMap<Vec<(u32, u32)>, u32> = BTreeMap::new();
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut numbers: Vec<Vec<u32>> = vec![Vec::new(); cells];
    let processor = Processor::detect();
    for place in batches.list() {
        batches.visit_places(processor, place, x, |cell, point, position| {
            let (shape, corners) = volume.cell(cell);
            let frame = &space.cells[cell].corners;
            let weights = &lattices[shape as usize].0[point];
            let mut name: Vec<(u32, u32)> = weights
                .iter()
                .enumerate()
                .filter(|(_, weight)| **weight > 0)
                .map(|(corner, &weight)| (corners[frame[corner] as usize], weight))
                .collect();
            name.sort_unstable();
            let number = *names.entry(name).or_insert_with(|| {
                points.push(position);
                points.len() as u32 - 1
            });
            numbers[cell].push(number);
        });
    }
    let mut hexahedra: Vec<[u32; 8]> = Vec::new();
    let mut prisms: Vec<[u32; 6]> = Vec::new();
    let mut tetrahedra: Vec<[u32; 4]> = Vec::new();
    let mut owners: [Vec<usize>; 3] = Default::default();
    for cell in 0..cells {
        let (shape, _) = volume.cell(cell);
        let own = &numbers[cell];
        // The lattice is the functions' frame, which for a tetrahedron may be a reflection of the element.
        let odd = shape == Shape::Tetrahedron && odd_permutation(&space.cells[cell].corners[..4]);
        for part in &lattices[shape as usize].1 {
            let at = |place: usize| own[part[place] as usize];
            match shape {
                Shape::Hexahedron => hexahedra.push(std::array::from_fn(at)),
                Shape::Prism => prisms.push(std::array::from_fn(at)),
                Shape::Tetrahedron if odd => tetrahedra.push([at(0), at(1), at(3), at(2)]),
                Shape::Tetrahedron => tetrahedra.push(std::array::from_fn(at)),
            }
            owners[shape as usize].push(cell);
        }
    }
    // The file lists tetrahedra, then hexahedra, then prisms.
    let order = [Shape::Tetrahedron, Shape::Hexahedron, Shape::Prism];
    let spread: Vec<(&str, Vec<f64>)> = fields
        .iter()
        .map(|(name, values)| {
            let rows = order.iter().flat_map(|&shape| &owners[shape as usize]);
            (*name, rows.map(|&cell| values[cell]).collect())
        })
        .collect();
    let views: Vec<(&str, usize, &[f64])> = spread
        .iter()
        .map(|(name, values)| (*name, 1, values.as_slice()))
        .collect();
    Ok(vtu::write(
        &points,
        Cells {
            hexahedra: &hexahedra,
            prisms: &prisms,
            tetrahedra: &tetrahedra,
            ..Cells::default()
        },
        &[],
        &views,
    ))
}

fn odd_permutation(order: &[u8]) -> bool {
    let swaps = (0..order.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    swaps.filter(|&(i, j)| order[j] > order[i]).count() % 2 == 1
}

/// Weights of every lattice point over the corners times m^3, and the small cells over the points.
fn lattice(shape: Shape, m: usize) -> (Vec<Vec<u32>>, Vec<Vec<u32>>) {
    let nodes = Rule::Trapezoid.cell(shape, m + 1).nodes();
    let index: Vec<[usize; 3]> = nodes
        .iter()
        .map(|(point, _)| point.map(|coordinate| (coordinate * m as f64).round() as usize))
        .collect();
    let find: BTreeMap<[usize; 3], u32> = index.iter().enumerate().map(|(at, &key)| (key, at as u32)).collect();
    let canonical = shape.canonical();
    let weights = index
        .iter()
        .map(|&[i, j, k]| {
            let line = |index: usize, end: f64| if end == 0.0 { m - index } else { index };
            let simplex =
                |first: usize, corner: [f64; 3], axes: usize| match (0..axes).find(|&axis| corner[axis] == 1.0) {
                    None => m - first,
                    Some(axis) => [i, j, k][axis],
                };
            canonical
                .iter()
                .map(|&corner| match shape {
                    Shape::Hexahedron => (line(i, corner[0]) * line(j, corner[1]) * line(k, corner[2])) as u32,
                    Shape::Prism => (simplex(i + j, corner, 2) * line(k, corner[2]) * m) as u32,
                    Shape::Tetrahedron => (simplex(i + j + k, corner, 3) * m * m) as u32,
                })
                .collect()
        })
        .collect();
    let mut parts = Vec::new();
    let at = |i: usize, j: usize, k: usize| find.get(&[i, j, k]).copied();
    let mut push = |corners: &[[usize; 3]]| {
        let found: Option<Vec<u32>> = corners.iter().map(|&[i, j, k]| at(i, j, k)).collect();
        if let Some(found) = found {
            parts.push(found);
        }
    };
    for i in 0..m {
        for j in 0..m {
            for k in 0..m {
                let p = |a: usize, b: usize, c: usize| [i + a, j + b, k + c];
                match shape {
                    Shape::Hexahedron => push(&[
                        p(0, 0, 0),
                        p(1, 0, 0),
                        p(1, 1, 0),
                        p(0, 1, 0),
                        p(0, 0, 1),
                        p(1, 0, 1),
                        p(1, 1, 1),
                        p(0, 1, 1),
                    ]),
                    Shape::Prism => {
                        push(&[p(0, 0, 0), p(1, 0, 0), p(0, 1, 0), p(0, 0, 1), p(1, 0, 1), p(0, 1, 1)]);
                        push(&[p(1, 0, 0), p(1, 1, 0), p(0, 1, 0), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)]);
                    }
                    Shape::Tetrahedron => {
                        push(&[p(0, 0, 0), p(1, 0, 0), p(0, 1, 0), p(0, 0, 1)]);
                        // The octahedron between, about its diagonal from (1,0,0) to (0,1,1).
                        let ring = [p(0, 1, 0), p(1, 1, 0), p(1, 0, 1), p(0, 0, 1)];
                        for side in 0..4 {
                            push(&[p(1, 0, 0), ring[side], p(0, 1, 1), ring[(side + 1) % 4]]);
                        }
                        push(&[p(1, 1, 0), p(0, 1, 1), p(1, 0, 1), p(1, 1, 1)]);
                    }
                }
            }
        }
    }
    // Right-handed throughout: small tetrahedra of the other sense are turned.
    if shape == Shape::Tetrahedron {
        for part in &mut parts {
            let corners = [0, 1, 2, 3].map(|place| nodes[part[place] as usize].0);
            if mesh::determinant(corners) < 0.0 {
                part.swap(2, 3);
            }
        }
    }
    (weights, parts)
}
