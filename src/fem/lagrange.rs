//! A map in Lagrange form: its values on an even lattice of every cell, as other programs store curved cells.
//!
//! Exact, but for rounding, for polynomial functions written with the cell's own order. Other functions, and orders cut
//! down to what a format knows, become the polynomial through the lattice points: an approximation that still joins
//! continuously where neighbours have the same order.

use super::batches::Batches;
use super::quadrature::Rule;
use super::space::{Kind, Space};
use crate::linalg::processor::Processor;
use crate::linalg::vector3::Columns;
use crate::mesh::curved::{CurvedCell, CurvedMesh, lattice};
use crate::mesh::mixed::{MixedMesh, Shape};
use std::collections::BTreeMap;

/// A map in Lagrange form.
#[derive(Clone, Debug, PartialEq)]
pub struct Lagrange {
    pub mesh: CurvedMesh,
    /// Cells that are approximated only.
    pub approximated: usize,
    /// Cells of a lower order than they need.
    pub cut: usize,
}

/// Orders added to cells with functions that are no polynomials.
const ADDED: usize = 6;

/// The Lagrange form of a map with orders of at most `highest`.
///
/// # Errors
/// When the reference of a cell is flat.
pub fn lagrange(
    volume: &MixedMesh,
    space: &Space,
    references: &[Columns<f64>],
    x: &[f64],
    highest: usize,
) -> Result<Lagrange, String> {
    let polynomial = space.basis.is_polynomial();
    let is_exact = |kind: Kind| polynomial || kind.order == 1;
    let needed = |kind: Kind| kind.order + if is_exact(kind) { 0 } else { ADDED };
    let count = |test: &dyn Fn(Kind) -> bool| space.cells.iter().filter(|cell| test(cell.kind)).count();
    Ok(Lagrange {
        mesh: sampled(volume, space, references, x, &|kind| needed(kind).min(highest))?,
        approximated: count(&|kind| !is_exact(kind) || needed(kind) > highest),
        cut: count(&|kind| needed(kind) > highest),
    })
}

/// The values of a map on an even lattice of every cell, of the order that its kind is to have. Cells that share a point
/// share its number.
///
/// # Errors
/// When the reference of a cell is flat.
pub fn sampled(
    volume: &MixedMesh,
    space: &Space,
    references: &[Columns<f64>],
    x: &[f64],
    order: &dyn Fn(Kind) -> usize,
) -> Result<CurvedMesh, String> {
    let batches = Batches::new(space, references, &|kind| {
        Rule::Trapezoid.cell(kind.shape, order(kind) + 1)
    })?;
    let mut cells: Vec<CurvedCell> = space
        .cells
        .iter()
        .map(|cell| CurvedCell {
            shape: cell.kind.shape,
            order: order(cell.kind),
            nodes: vec![0; lattice(cell.kind.shape, order(cell.kind)).len()],
        })
        .collect();
    // Of every kind: for each quadrature point its lattice coordinates in the functions' frame.
    let mut kinds: BTreeMap<Kind, Vec<[usize; 3]>> = BTreeMap::new();
    let mut finds: BTreeMap<(Shape, usize), BTreeMap<[usize; 3], usize>> = BTreeMap::new();
    for cell in &space.cells {
        let m = order(cell.kind);
        kinds.entry(cell.kind).or_insert_with(|| {
            let nodes = Rule::Trapezoid.cell(cell.kind.shape, m + 1).nodes();
            let coordinates = nodes
                .into_iter()
                .map(|(point, _)| point.map(|u| (u * m as f64).round() as usize));
            coordinates.collect()
        });
        finds.entry((cell.kind.shape, m)).or_insert_with(|| {
            let points = lattice(cell.kind.shape, m).into_iter().enumerate();
            points.map(|(place, point)| (point, place)).collect()
        });
    }
    // A point's name: its weights over the vertices as reduced fractions. Cells that share a point share its name.
    let mut names: BTreeMap<Vec<(u32, u32)>, u32> = BTreeMap::new();
    let mut points: Vec<[f64; 3]> = Vec::new();
    let processor = Processor::detect();
    for place in batches.list() {
        batches.visit_places(processor, place, x, |cell, point, position| {
            let slots = &space.cells[cell];
            let (shape, corners) = volume.cell(cell);
            let m = order(slots.kind);
            let mut coordinates = kinds[&slots.kind][point];
            if shape == Shape::Tetrahedron {
                // From the functions' frame of ascending vertices to the cell's own.
                let [u, v, w] = coordinates;
                let mut barycentric = [0; 4];
                for (value, &corner) in [m - u - v - w, u, v, w].into_iter().zip(&slots.corners) {
                    barycentric[corner as usize] = value;
                }
                coordinates = [barycentric[1], barycentric[2], barycentric[3]];
            }
            let number = *names.entry(name(shape, corners, m, coordinates)).or_insert_with(|| {
                points.push(position);
                points.len() as u32 - 1
            });
            cells[cell].nodes[finds[&(shape, m)][&coordinates]] = number;
        });
    }
    Ok(CurvedMesh { points, cells })
}

/// The weights of a lattice point over a cell's vertices, in lowest terms.
fn name(shape: Shape, corners: &[u32], m: usize, [i, j, k]: [usize; 3]) -> Vec<(u32, u32)> {
    let line = |index: usize, end: f64| if end == 0.0 { m - index } else { index };
    let weight = |corner: [f64; 3]| match shape {
        Shape::Hexahedron => line(i, corner[0]) * line(j, corner[1]) * line(k, corner[2]),
        Shape::Prism => {
            let triangle = match corner {
                [0.0, 0.0, _] => m - i - j,
                [1.0, _, _] => i,
                _ => j,
            };
            triangle * line(k, corner[2])
        }
        Shape::Tetrahedron => match corner {
            [1.0, _, _] => i,
            [_, 1.0, _] => j,
            [_, _, 1.0] => k,
            _ => m - i - j - k,
        },
    };
    let weights = shape.canonical().iter().map(|&corner| weight(corner) as u32);
    let mut name: Vec<(u32, u32)> = corners
        .iter()
        .copied()
        .zip(weights)
        .filter(|entry| entry.1 > 0)
        .collect();
    let common = name
        .iter()
        .fold(0, |divisor, entry| greatest_common_divisor(divisor, entry.1));
    for entry in &mut name {
        entry.1 /= common.max(1);
    }
    name.sort_unstable();
    name
}

fn greatest_common_divisor(mut a: u32, mut b: u32) -> u32 {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}
