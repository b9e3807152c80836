//! The cells of a space sorted by kind and packed eight to a batch, with what is needed to form their Jacobians.
//!
//! The Jacobian of a cell is taken against its reference shape, `J = J_h A^-1`: A has the reference's edges as
//! columns, so a cell that equals its reference up to a rotation has a rotation as Jacobian. (The paper prints `A^-T`,
//! with which the ideal prism and tetrahedron would have energy.)

use super::element::{Element, Room};
use super::quadrature::CellQuadrature;
use super::space::{Kind, Slot, Space};
use crate::linalg::lanes::{Lanes, WIDTH};
use crate::linalg::processor::Processor;
use crate::linalg::vector3::{Columns, apply, cofactor, dot, subtract, times};
use crate::mesh::mixed::Shape;
use std::collections::BTreeMap;

/// Columns of the reference shape with unit edges: cube, prism over the regular triangle, regular tetrahedron.
pub fn unit_reference(shape: Shape) -> Columns<f64> {
    let root3 = 3.0_f64.sqrt();
    match shape {
        Shape::Hexahedron => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        Shape::Prism => [[1.0, 0.0, 0.0], [0.5, root3 / 2.0, 0.0], [0.0, 0.0, 1.0]],
        Shape::Tetrahedron => [
            [1.0, 0.0, 0.0],
            [0.5, root3 / 2.0, 0.0],
            [0.5, root3 / 6.0, 6.0_f64.sqrt() / 3.0],
        ],
    }
}

/// Unit references scaled so that all together have this volume.
pub fn references_of_volume(shapes: impl Iterator<Item = Shape>, volume: f64) -> Vec<Columns<f64>> {
    let shapes: Vec<Shape> = shapes.collect();
    let unit: f64 = shapes
        .iter()
        .map(|&shape| reference_volume(shape, &unit_reference(shape)))
        .sum();
    let scale = (volume / unit).cbrt();
    shapes
        .into_iter()
        .map(|shape| unit_reference(shape).map(|column| times(column, scale)))
        .collect()
}

/// Volume of a reference cell.
pub fn reference_volume(shape: Shape, reference: &Columns<f64>) -> f64 {
    dot(reference[0], cofactor(reference)[0]).abs() * shape.canonical_volume()
}

/// Eight cells of one kind.
pub struct Batch {
    /// The slot of function f in lane l at `8 f + l`.
    pub slots: Vec<Slot>,
    /// Entry (row, column) of the inverse of the reference at `3 row + column`.
    pub inverse: [Lanes; 9],
    /// Reference volume over canonical volume; 0 in lanes that only repeat the last cell.
    pub scale: Lanes,
    pub cells: [u32; WIDTH],
    /// Lanes in use.
    pub filled: usize,
}

/// Cells of one kind.
pub struct Group {
    pub element: Element,
    /// Weights of the points.
    pub weights: Vec<f64>,
    pub batches: Vec<Batch>,
    /// Where the coefficients of the first batch begin when those of all batches are listed.
    pub start: usize,
}

impl Group {
    /// Lanes that hold the coefficients of one batch: function f, component c at `3 f + c`.
    pub fn coefficients(&self) -> usize {
        3 * self.element.kind().functions()
    }
}

/// All cells of a space.
pub struct Batches {
    pub groups: Vec<Group>,
    /// Number of coefficient lanes of all batches.
    pub coefficients: usize,
    pub cells: usize,
    pub nodes: usize,
}

impl Batches {
    /// Packs the cells; `quadrature` gives the points for a kind of cell.
    ///
    /// # Errors
    /// When the reference of a cell is flat.
    pub fn new(
        space: &Space,
        references: &[Columns<f64>],
        quadrature: &dyn Fn(Kind) -> CellQuadrature,
    ) -> Result<Batches, String> {
        assert_eq!(references.len(), space.cells.len(), "one reference a cell");
        let mut kinds: BTreeMap<Kind, Vec<usize>> = BTreeMap::new();
        for (cell, slots) in space.cells.iter().enumerate() {
            kinds.entry(slots.kind).or_default().push(cell);
        }
        let mut groups = Vec::with_capacity(kinds.len());
        let mut start = 0;
        for (kind, members) in kinds {
            let points = quadrature(kind);
            let element = Element::new(space.basis, kind, &points);
            let weights = points.nodes().iter().map(|node| node.1).collect();
            let mut batches = Vec::with_capacity(members.len().div_ceil(WIDTH));
            for chunk in members.chunks(WIDTH) {
                batches.push(batch(space, references, kind, chunk)?);
            }
            let group = Group {
                element,
                weights,
                batches,
                start,
            };
            start += group.coefficients() * group.batches.len();
            groups.push(group);
        }
        Ok(Batches {
            groups,
            coefficients: start,
            cells: space.cells.len(),
            nodes: space.nodes,
        })
    }

    /// Group and number within it of every batch.
    pub fn list(&self) -> Vec<(usize, usize)> {
        let groups = self.groups.iter().enumerate();
        groups
            .flat_map(|(group, members)| (0..members.batches.len()).map(move |batch| (group, batch)))
            .collect()
    }

    /// Calls `visit(cell, point, place)` for every point of every cell of a batch.
    pub fn visit_places(
        &self,
        processor: Processor,
        (group, batch): (usize, usize),
        x: &[f64],
        mut visit: impl FnMut(usize, usize, [f64; 3]),
    ) {
        let group = &self.groups[group];
        let batch = &group.batches[batch];
        let mut coefficients = vec![Lanes::ZERO; group.coefficients()];
        load_coefficients(batch, x, &mut coefficients);
        let mut places = vec![Lanes::ZERO; 3 * group.element.points()];
        group
            .element
            .places(processor, &coefficients, &mut places, &mut Room::default());
        for lane in 0..batch.filled {
            for (point, place) in places.chunks_exact(3).enumerate() {
                let place = std::array::from_fn(|component| place[component].0[lane]);
                visit(batch.cells[lane] as usize, point, place);
            }
        }
    }

    /// Calls `visit(cell, point, J)` for every point of every cell of a batch, J against the reference.
    pub fn visit(
        &self,
        processor: Processor,
        (group, batch): (usize, usize),
        x: &[f64],
        mut visit: impl FnMut(usize, usize, Columns<f64>),
    ) {
        let group = &self.groups[group];
        let batch = &group.batches[batch];
        let mut coefficients = vec![Lanes::ZERO; group.coefficients()];
        let mut jacobians = [Vec::new(), Vec::new(), Vec::new()];
        load_coefficients(batch, x, &mut coefficients);
        let mut rooms = Room::default();
        group
            .element
            .jacobians(processor, &coefficients, &mut jacobians, &mut rooms);
        for lane in 0..batch.filled {
            let inverse: [f64; 9] = std::array::from_fn(|entry| batch.inverse[entry].0[lane]);
            for point in 0..group.element.points() {
                let raw: Columns<f64> = std::array::from_fn(|direction| {
                    std::array::from_fn(|component| jacobians[direction][3 * point + component].0[lane])
                });
                let jacobian = std::array::from_fn(|column| {
                    apply(&raw, [inverse[column], inverse[3 + column], inverse[6 + column]])
                });
                visit(batch.cells[lane] as usize, point, jacobian);
            }
        }
    }
}

fn batch(space: &Space, references: &[Columns<f64>], kind: Kind, members: &[usize]) -> Result<Batch, String> {
    let functions = kind.functions();
    let mut result = Batch {
        slots: vec![Slot::ABSENT; functions * WIDTH],
        inverse: [Lanes::ZERO; 9],
        scale: Lanes::ZERO,
        cells: [0; WIDTH],
        filled: members.len(),
    };
    for lane in 0..WIDTH {
        let cell = members[lane.min(members.len() - 1)];
        let slots = &space.cells[cell];
        for (function, &slot) in slots.slots.iter().enumerate() {
            result.slots[WIDTH * function + lane] = slot;
        }
        let reference = in_frame(kind.shape, &slots.corners, &references[cell]);
        let cof = cofactor(&reference);
        let determinant = dot(reference[0], cof[0]);
        if !(determinant.abs() > 0.0 && determinant.is_finite()) {
            return Err(format!("the reference shape of cell {cell} has no volume"));
        }
        for row in 0..3 {
            for column in 0..3 {
                result.inverse[3 * row + column].0[lane] = cof[row][column] / determinant;
            }
        }
        result.cells[lane] = cell as u32;
        result.scale.0[lane] = if lane < members.len() { determinant.abs() } else { 0.0 };
    }
    Ok(result)
}

/// The reference for the functions' own frame of corners, which for a tetrahedron may be a reflection.
pub fn in_frame(shape: Shape, corners: &[u8; 8], reference: &Columns<f64>) -> Columns<f64> {
    let canonical = shape.canonical();
    let at = |place: usize| apply(reference, canonical[corners[place] as usize]);
    match shape {
        Shape::Tetrahedron => [1, 2, 3].map(|place| subtract(at(place), at(0))),
        Shape::Hexahedron | Shape::Prism => *reference,
    }
}

/// Gathers the coefficients of eight cells.
pub fn load_coefficients(batch: &Batch, x: &[f64], coefficients: &mut [Lanes]) {
    for (slots, out) in batch.slots.chunks_exact(WIDTH).zip(coefficients.chunks_exact_mut(3)) {
        for (lane, slot) in slots.iter().enumerate() {
            let values = match slot.node() {
                Some((node, sign)) => {
                    let start = 3 * node;
                    [sign * x[start], sign * x[start + 1], sign * x[start + 2]]
                }
                None => [0.0; 3],
            };
            for component in 0..3 {
                out[component].0[lane] = values[component];
            }
        }
    }
}
