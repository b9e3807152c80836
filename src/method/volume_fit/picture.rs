//! The picture of a fit: every element cut evenly into linear cells.

use crate::fem::lagrange::sampled;
use crate::fem::space::Space;
use crate::linalg::vector3::Columns;
use crate::mesh;
use crate::mesh::curved::lattice;
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
    let highest = space.highest_order();
    let mut cuts = if highest == 1 { 1 } else { (2 * highest).clamp(4, 8) };
    while cuts > 1 && cells * cuts * cuts * cuts > MOST_CELLS {
        cuts -= 1;
    }
    let m = cuts;
    let mesh = sampled(volume, space, references, x, &|_| m).map_err(Failure::invalid)?;
    let parts = Shape::ALL.map(|shape| parts(shape, m));
    let mut hexahedra: Vec<[u32; 8]> = Vec::new();
    let mut prisms: Vec<[u32; 6]> = Vec::new();
    let mut tetrahedra: Vec<[u32; 4]> = Vec::new();
    let mut owners: [Vec<usize>; 3] = Default::default();
    for (index, cell) in mesh.cells.iter().enumerate() {
        for part in &parts[cell.shape as usize] {
            let at = |place: usize| cell.nodes[part[place]];
            match cell.shape {
                Shape::Hexahedron => hexahedra.push(std::array::from_fn(at)),
                Shape::Prism => prisms.push(std::array::from_fn(at)),
                Shape::Tetrahedron => tetrahedra.push(std::array::from_fn(at)),
            }
            owners[cell.shape as usize].push(index);
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
        &mesh.points,
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

/// The small cells that a cell with this many intervals a side is cut into, over the points of its lattice.
fn parts(shape: Shape, m: usize) -> Vec<Vec<usize>> {
    let points = lattice(shape, m);
    let find: BTreeMap<[usize; 3], usize> = points.iter().enumerate().map(|(at, &key)| (key, at)).collect();
    let mut parts = Vec::new();
    let at = |i: usize, j: usize, k: usize| find.get(&[i, j, k]).copied();
    let mut push = |corners: &[[usize; 3]]| {
        let found: Option<Vec<usize>> = corners.iter().map(|&[i, j, k]| at(i, j, k)).collect();
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
            let corners = [0, 1, 2, 3].map(|place| points[part[place]].map(|index| index as f64));
            if mesh::determinant(corners) < 0.0 {
                part.swap(2, 3);
            }
        }
    }
    parts
}
