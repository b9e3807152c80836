//! Result meshes in few bytes: connectivity once per distinct mesh, positions in 13 bits, fields in 5 to 7, deflated,
//! base64.
//!
//! Cells are sorted along a space-filling curve and points numbered as the cells first use them, so that differences of
//! neighbours are small. Byte planes are stored one after the other, which deflate likes. Exact figures are in the VTU
//! file.

use crate::mesh::bounding_box;
use crate::report::picture::colour::Scale;
use crate::report::picture::solid::Solid;
use base64::Engine;
use flate2::{Compression, write::DeflateEncoder};
use std::io::Write;

/// Steps of a coordinate within its bounds.
pub const STEPS: f64 = 8_191.0;

/// The level of an undefined value.
const UNDEFINED: u8 = 127;

/// The highest level of a field's values: finer where a page has few of them.
pub fn levels(values: usize) -> u8 {
    match values {
        0..250_000 => 126,
        250_000..500_000 => 62,
        _ => 30,
    }
}

/// A mesh in the order in which it is stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// Cells of the solid in their new order.
    cells: Vec<u32>,
    /// Points of the solid by new number; points that no cell uses are left out.
    points: Vec<u32>,
}

/// Bytes and what is needed to read them.
#[derive(Clone, Debug)]
pub struct Packed {
    pub base64: String,
    /// Lowest and highest coordinate along each axis.
    pub boxes: Vec<[[f64; 3]; 2]>,
}

fn deflate(bytes: &[u8]) -> String {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    // Writing into memory does not fail.
    let packed = encoder
        .write_all(bytes)
        .and_then(|()| encoder.finish())
        .unwrap_or_default();
    base64::engine::general_purpose::STANDARD_NO_PAD.encode(packed)
}

fn bounds(points: &[[f64; 3]]) -> [[f64; 3]; 2] {
    bounding_box(points).unwrap_or([[0.0; 3], [1.0; 3]])
}

/// A coordinate between the bounds as a whole number up to `levels`.
fn level(value: f64, low: f64, high: f64, levels: f64) -> f64 {
    if high > low {
        ((value - low) / (high - low) * levels).round().clamp(0.0, levels)
    } else {
        0.0
    }
}

/// Interleaves ten bits of each coordinate.
fn curve(point: [f64; 3], bounds: &[[f64; 3]; 2]) -> u32 {
    let mut key = 0;
    let levels = [0, 1, 2].map(|axis| level(point[axis], bounds[0][axis], bounds[1][axis], 1023.0) as u32);
    for bit in (0..10).rev() {
        for part in levels {
            key = key << 1 | (part >> bit & 1);
        }
    }
    key
}

fn corners(solid: &Solid, cell: u32) -> &[u32] {
    if solid.is_volume() {
        &solid.tetrahedra[cell as usize]
    } else {
        &solid.triangles[cell as usize]
    }
}

/// The order of a mesh by its source positions, so that all images of one mesh share it.
pub fn order(solid: &Solid) -> Order {
    let points = solid.source.as_ref().unwrap_or(&solid.points);
    let bounds = bounds(points);
    let mut cells: Vec<u32> = (0..solid.count() as u32).collect();
    cells.sort_by_cached_key(|&cell| {
        let corners = corners(solid, cell);
        let mut centre = [0.0; 3];
        for &corner in corners {
            for axis in 0..3 {
                centre[axis] += points[corner as usize][axis] / corners.len() as f64;
            }
        }
        curve(centre, &bounds)
    });
    let mut seen = vec![false; solid.points.len()];
    let mut used = Vec::new();
    for &cell in &cells {
        for &corner in corners(solid, cell) {
            if !std::mem::replace(&mut seen[corner as usize], true) {
                used.push(corner);
            }
        }
    }
    Order { cells, points: used }
}

/// Connectivity and source positions (the only positions where there is no source).
///
/// Layout: for each corner number `next - number`, where `next` is the count of points seen so far, as 16 or 32 bits in
/// byte planes; then, where the solid has diagonals, a byte for each cell whose bits tell which pairs of its corners are
/// no edges, (0,1), (0,2), (1,2), (0,3), (1,3), (2,3) from the lowest on; then the positions.
pub fn topology(solid: &Solid, order: &Order) -> Packed {
    let mut number = vec![0u32; solid.points.len()];
    for (new, &old) in order.points.iter().enumerate() {
        number[old as usize] = new as u32;
    }
    let mut next = 0u32;
    let mut codes = Vec::with_capacity(order.cells.len() * 4);
    let mut hidden = Vec::new();
    for &cell in &order.cells {
        let mut sorted = corners(solid, cell).to_vec();
        sorted.sort_unstable_by_key(|&corner| number[corner as usize]);
        if !solid.diagonals.is_empty() {
            let pairs = [(0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3)];
            let within = pairs.iter().enumerate().filter(|(_, pair)| pair.1 < sorted.len());
            hidden.push(within.fold(0u8, |bits, (bit, pair)| {
                bits | u8::from(!solid.is_edge(sorted[pair.0], sorted[pair.1])) << bit
            }));
        }
        for corner in sorted.into_iter().map(|corner| number[corner as usize]) {
            codes.push(next - corner);
            next = next.max(corner + 1);
        }
    }
    let planes = if order.points.len() < 65_536 { 2 } else { 4 };
    let mut bytes = Vec::with_capacity(codes.len() * planes + order.points.len() * 6);
    for plane in 0..planes {
        bytes.extend(codes.iter().map(|code| (code >> (8 * plane)) as u8));
    }
    bytes.extend(hidden);
    let points = solid.source.as_ref().unwrap_or(&solid.points);
    let bounds = positions(points, order, &mut bytes);
    Packed {
        base64: deflate(&bytes),
        boxes: vec![bounds],
    }
}

/// Image positions (where there is a source), fields as differences from the cell before, and the marks of inverted
/// cells.
pub fn image(solid: &Solid, order: &Order, ranges: &[Scale], levels: u8) -> Packed {
    let mut bytes = Vec::new();
    let mut boxes = Vec::new();
    if solid.source.is_some() {
        boxes.push(positions(&solid.points, order, &mut bytes));
    }
    for (field, range) in solid.fields.iter().zip(ranges) {
        let mut before = 0u8;
        bytes.extend(order.cells.iter().map(|&cell| {
            let place = range.position(field.values[cell as usize]);
            let level = if place.is_nan() {
                UNDEFINED
            } else {
                (place * f64::from(levels)).round() as u8
            };
            let step = level.wrapping_sub(before);
            before = level;
            step
        }));
    }
    bytes.extend(order.cells.iter().map(|&cell| u8::from(solid.inverted[cell as usize])));
    Packed {
        base64: deflate(&bytes),
        boxes,
    }
}

/// Appends each coordinate as the difference from the point before, in two bytes, low bytes of an axis and then high
/// ones.
fn positions(points: &[[f64; 3]], order: &Order, bytes: &mut Vec<u8>) -> [[f64; 3]; 2] {
    let used: Vec<[f64; 3]> = order.points.iter().map(|&point| points[point as usize]).collect();
    let bounds = bounds(&used);
    for axis in 0..3 {
        let levels: Vec<u16> = used
            .iter()
            .map(|point| level(point[axis], bounds[0][axis], bounds[1][axis], STEPS) as u16)
            .collect();
        let mut before = 0u16;
        let steps: Vec<u16> = levels
            .iter()
            .map(|&level| {
                let step = level.wrapping_sub(before) as i16;
                before = level;
                // Small steps of either sign become small numbers.
                ((step << 1) ^ (step >> 15)) as u16
            })
            .collect();
        bytes.extend(steps.iter().map(|step| *step as u8));
        bytes.extend(steps.iter().map(|step| (step >> 8) as u8));
    }
    bounds
}

impl Order {
    /// Numbers of points and cells as stored.
    pub fn counts(&self) -> (usize, usize) {
        (self.points.len(), self.cells.len())
    }
}

/// What makes two solids one mesh: connectivity and source positions.
pub fn same_mesh(left: &Solid, right: &Solid) -> bool {
    left.source.is_some()
        && left.tetrahedra == right.tetrahedra
        && left.triangles == right.triangles
        && left.diagonals == right.diagonals
        && left.source == right.source
}
