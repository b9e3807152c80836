//! A positive definite model of the Hessian, constant from one refreshment to the next: stiffness of the cells as they
//! are, and the mass of the boundary along its normals.
//!
//! The volume energy is one of logarithmic strains, or grows like one, so that it bends like
//! `lambda / |Omega| int |grad_x u|^2 dX`: gradients by the place in space, volume of the reference. A cell that is
//! crushed to a share c of its thickness is 1 / c^2 times as stiff. With the mean over the cell of the metric `G =
//! J^-1 J^-T` in canonical coordinates that is `sum_ij G_ij int dN_a/du_i dN_b/du_j`. The surface energy bends like `4
//! / (A L^2) int (n . u)^2`, and a share `1 / s^2` of it along the surface. Functions up to some order are factorized
//! together, those above are divided by their diagonal: hierarchical bases are nearly orthogonal between orders.

use crate::fem::batches::{Batches, in_frame};
use crate::fem::boundary::Boundary;
use crate::fem::functions::cell_table;
use crate::fem::quadrature::Rule;
use crate::fem::space::{Kind, Slot, Space};
use crate::linalg::processor::Processor;
use crate::linalg::sparse::{BlockCholesky, BlockPattern};
use crate::linalg::vector3::{Columns, add as plus, cofactor, dot, times, upper_entries};
use crate::mesh::mixed::{MixedMesh, Topology};
use crate::mesh::{area_vector, length};
use std::collections::BTreeMap;

/// Most nodes that are factorized together.
const MOST_NODES: usize = 24_000;

/// Inverse of the model.
pub struct Preconditioner {
    /// Numbers of the factorized nodes in the whole space.
    nodes: Vec<u32>,
    cholesky: BlockCholesky<3>,
    /// One over the diagonal of the others; 0 for the factorized ones.
    inverse: Vec<f64>,
    room: Vec<f64>,
}

/// What the model is made of.
pub struct Model<'a> {
    pub mesh: &'a MixedMesh,
    pub topology: &'a Topology,
    pub space: &'a Space,
    pub boundary: &'a Boundary,
    /// Samples and triangles of the boundary as they are now.
    pub samples: &'a [[f64; 3]],
    /// The nodes as they are now.
    pub x: &'a [f64],
    pub references: &'a [Columns<f64>],
    pub lambda: f64,
    /// Volume of all references.
    pub volume: f64,
    /// Weight of the squared normal displacement in the surface energy.
    pub surface: f64,
    pub anisotropy: f64,
}

impl Preconditioner {
    /// Factorizes the model.
    ///
    /// # Errors
    /// When the system cannot be factorized.
    pub fn new(model: &Model<'_>) -> Result<Preconditioner, String> {
        let space = model.space;
        let highest = space.highest_order();
        let capped = |cap: usize| -> Result<Space, String> {
            let orders: Vec<usize> = space.orders.iter().map(|&order| order.min(cap)).collect();
            Space::new(model.mesh, model.topology, space.basis, &orders)
        };
        let mut low = capped(1)?;
        for cap in 2..=highest.min(6) {
            let next = capped(cap)?;
            if next.nodes > MOST_NODES {
                break;
            }
            low = next;
        }
        let nodes: Vec<u32> = low
            .counterparts(space)
            .into_iter()
            .map(|node| node.ok_or("a function of low order is missing"))
            .collect::<Result<_, _>>()?;

        // Entries of the lower space, 00 01 02 11 12 22 of a symmetric block each.
        let mut entries: Vec<(u64, [f64; 6])> = Vec::new();
        let mut add = |a: usize, b: usize, block: [f64; 6]| {
            let key = ((a.min(b) as u64) << 32) | a.max(b) as u64;
            entries.push((key, block));
        };
        let metrics = metrics(model)?;
        let mut kinds: BTreeMap<Kind, [Vec<f64>; 6]> = BTreeMap::new();
        for (cell, metric) in low.cells.iter().zip(&metrics) {
            let stiffness = kinds.entry(cell.kind).or_insert_with(|| stiffness(&low, cell.kind));
            let count = cell.slots.len();
            let largest = (0..count)
                .map(|i| contract(stiffness, metric, i * count + i))
                .fold(0.0, f64::max);
            for (i, a) in cell.slots.iter().enumerate() {
                let Some((node, sign)) = a.node() else { continue };
                for (j, b) in cell.slots.iter().enumerate().skip(i) {
                    let value = contract(stiffness, metric, i * count + j);
                    if value.abs() <= NEGLIGIBLE * largest {
                        continue;
                    }
                    let Some((other, turn)) = b.node() else { continue };
                    let value = sign * turn * value;
                    add(node, other, [value, 0.0, 0.0, value, 0.0, value]);
                }
            }
        }
        let blocks = sample_blocks(model);
        if model.surface > 0.0 {
            let boundary = Boundary::new(model.mesh, model.topology, &low, model.boundary.intervals());
            // Sums over the samples of one face before they are listed: all of a face's samples come in a row.
            let mut face: Vec<Slot> = Vec::new();
            let mut sums: Vec<[f64; 6]> = Vec::new();
            let mut flush = |face: &[Slot], sums: &[[f64; 6]]| {
                for (i, a) in face.iter().enumerate() {
                    let Some((node, sign)) = a.node() else { continue };
                    for (j, b) in face.iter().enumerate().skip(i) {
                        let Some((other, turn)) = b.node() else { continue };
                        add(node, other, sums[i * face.len() + j].map(|value| sign * turn * value));
                    }
                }
            };
            boundary.each_row(|slots, row, sample| {
                if slots != face.as_slice() {
                    flush(&face, &sums);
                    face = slots.to_vec();
                    sums = vec![[0.0; 6]; face.len() * face.len()];
                }
                let block = blocks[sample];
                for i in 0..face.len() {
                    if row[i] == 0.0 {
                        continue;
                    }
                    for j in i..face.len() {
                        let weight = row[i] * row[j];
                        for (sum, entry) in sums[i * face.len() + j].iter_mut().zip(&block) {
                            *sum += weight * entry;
                        }
                    }
                }
            });
            flush(&face, &sums);
        }
        entries.sort_by_key(|entry| entry.0);
        let mut merged: Vec<(u64, [f64; 6])> = Vec::new();
        for (key, block) in entries {
            match merged.last_mut() {
                Some((last, sum)) if *last == key => {
                    for (sum, value) in sum.iter_mut().zip(block) {
                        *sum += value;
                    }
                }
                _ => merged.push((key, block)),
            }
        }
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        let mut parts: Vec<f64> = Vec::new();
        let mut diagonals = vec![[0.0; 6]; low.nodes];
        for (key, block) in &merged {
            let (a, b) = ((key >> 32) as u32, *key as u32);
            if a == b {
                diagonals[a as usize] = *block;
            }
        }
        let mut placed = vec![false; low.nodes];
        let full = |[a, b, c, d, e, f]: [f64; 6]| [a, b, c, b, d, e, c, e, f];
        let diagonal_part = |node: u32, placed: &mut Vec<bool>| {
            let first = !std::mem::replace(&mut placed[node as usize], true);
            full(if first { diagonals[node as usize] } else { [0.0; 6] })
        };
        let mut push = |a: u32, b: u32, block: [f64; 6], placed: &mut Vec<bool>| {
            pairs.push([a, b]);
            parts.extend(diagonal_part(a, placed));
            parts.extend(full(block));
            parts.extend(diagonal_part(b, placed));
        };
        for (key, block) in &merged {
            let (a, b) = ((key >> 32) as u32, *key as u32);
            if a != b {
                push(a, b, *block, &mut placed);
            }
        }
        // A node coupled to nothing is tied to another one by an empty block.
        for node in 0..low.nodes as u32 {
            if !placed[node as usize] {
                let other = if node == 0 { 1 } else { 0 };
                push(node, other, [0.0; 6], &mut placed);
            }
        }
        let places = node_places(model.mesh, &low);
        let free = vec![true; low.nodes];
        let pattern = BlockPattern::<3>::new(&places, &pairs, &free).map_err(|error| error.to_string())?;
        let mut values = vec![0.0; pattern.values_len()];
        pattern.assemble(&parts, &mut values);
        let mean = pattern.diagonal(&values).iter().sum::<f64>() / (3 * low.nodes) as f64;
        let mut cholesky = BlockCholesky::new(pattern);
        // Translations cost nothing where no surface holds the volume.
        let mut shift = 1e-6 * mean;
        while let Err(error) = cholesky.factorize(&values, shift) {
            shift *= 100.0;
            // Not-a-number or zero as well.
            if !(shift > 0.0 && shift <= mean) {
                return Err(format!("the preconditioner could not be factorized: {error}"));
            }
        }

        let mut inverse = vec![0.0; space.nodes];
        if space.nodes > low.nodes {
            for (inverse, value) in inverse.iter_mut().zip(diagonal_with(model, &metrics)?) {
                *inverse = 1.0 / value.max(f64::MIN_POSITIVE);
            }
            for &node in &nodes {
                inverse[node as usize] = 0.0;
            }
        }
        Ok(Preconditioner {
            room: vec![0.0; 3 * nodes.len()],
            nodes,
            cholesky,
            inverse,
        })
    }

    /// Multiplies by the inverse.
    pub fn apply(&mut self, vector: &mut [f64]) {
        for (place, &node) in self.nodes.iter().enumerate() {
            let start = 3 * node as usize;
            self.room[3 * place..3 * place + 3].copy_from_slice(&vector[start..start + 3]);
        }
        self.cholesky.solve_in_place(&mut self.room);
        for (values, &inverse) in vector.chunks_exact_mut(3).zip(&self.inverse) {
            for value in values {
                *value *= inverse;
            }
        }
        for (place, &node) in self.nodes.iter().enumerate() {
            let start = 3 * node as usize;
            vector[start..start + 3].copy_from_slice(&self.room[3 * place..3 * place + 3]);
        }
    }
}

/// Couplings below this share of a cell's largest are left out.
const NEGLIGIBLE: f64 = 1e-11;

/// Points a direction over which the metric is averaged, ends included: cells are crushed at corners first.
const POINTS: usize = 4;

/// A cell counts as crushed to this share of its thickness at most, or nothing would move it any more.
const THINNEST: f64 = 0.01;

/// The six entries of a symmetric matrix, 00 01 02 11 12 22.
const ENTRIES: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];

/// Weighted mean of `J^-1 J^-T` of every cell, in canonical coordinates.
fn metrics(model: &Model<'_>) -> Result<Vec<[f64; 6]>, String> {
    let space = model.space;
    let batches = Batches::new(space, model.references, &|kind| Rule::Lobatto.cell(kind.shape, POINTS))?;
    let processor = Processor::detect();
    let inverses: Vec<(Columns<f64>, f64)> = space
        .cells
        .iter()
        .zip(model.references)
        .map(|(cell, reference)| {
            let framed = in_frame(cell.kind.shape, &cell.corners, reference);
            let cof = cofactor(&framed);
            let determinant = dot(framed[0], cof[0]);
            // Row r of the inverse is cof[r] / det.
            (cof.map(|row| times(row, 1.0 / determinant)), determinant.abs())
        })
        .collect();
    let mut sums = vec![([0.0; 6], 0.0); space.cells.len()];
    for place in batches.list() {
        batches.visit(processor, place, model.x, |cell, _, jacobian| {
            // Rows of the deformation's inverse, held down where a point is crushed.
            let cof = cofactor(&jacobian);
            let determinant = dot(jacobian[0], cof[0]);
            let size = cof.iter().map(|row| dot(*row, *row)).sum::<f64>().sqrt();
            let factor = 1.0 / determinant.abs().max(THINNEST * size);
            // J^-1 of the canonical map is the inverse reference times that of the deformation.
            let rows = cof.map(|row| times(row, factor));
            let inverse = &inverses[cell].0;
            let product = inverse.map(|row| {
                let parts = [0, 1, 2].map(|k| times(rows[k], row[k]));
                plus(plus(parts[0], parts[1]), parts[2])
            });
            let (sum, count) = &mut sums[cell];
            for (sum, [i, j]) in sum.iter_mut().zip(ENTRIES) {
                *sum += dot(product[i], product[j]);
            }
            *count += 1.0;
        });
    }
    let bulk = model.lambda / model.volume;
    let scaled = sums.iter().zip(&inverses).map(|((sum, count), (_, determinant))| {
        let factor = bulk * determinant / f64::max(*count, 1.0);
        sum.map(|entry| factor * entry)
    });
    Ok(scaled.collect())
}

/// `sum_ij G_ij S_ij` at one place of the six matrices.
fn contract(parts: &[Vec<f64>; 6], metric: &[f64; 6], place: usize) -> f64 {
    let mut sum = 0.0;
    for (entry, [i, j]) in ENTRIES.into_iter().enumerate() {
        // What stands off the diagonal stands there twice; the parts are symmetrized.
        sum += if i == j { 1.0 } else { 2.0 } * metric[entry] * parts[entry][place];
    }
    sum
}

/// Derivatives of the local functions by canonical coordinates at quadrature points, and the weights.
fn gradients(space: &Space, kind: Kind) -> (Vec<[f64; 3]>, Vec<f64>) {
    let quadrature = Rule::Gauss.cell(kind.shape, kind.order + 2);
    let table = cell_table(space.basis, kind, &quadrature);
    let [u, v, w] = &table.derivatives;
    let gradients = (0..u.len()).map(|place| [u[place], v[place], w[place]]);
    let weights = quadrature.nodes().iter().map(|node| node.1).collect();
    (gradients.collect(), weights)
}

/// `int (dN_a/du_i dN_b/du_j + dN_a/du_j dN_b/du_i) / 2` over the canonical cell, for `a <= b`.
fn stiffness(space: &Space, kind: Kind) -> [Vec<f64>; 6] {
    let (gradients, weights) = gradients(space, kind);
    let count = kind.functions();
    let mut result: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; count * count]);
    for (point, &weight) in weights.iter().enumerate() {
        let row = &gradients[point * count..(point + 1) * count];
        for a in 0..count {
            let scaled = times(row[a], 0.5 * weight);
            for b in a..count {
                for (part, [i, j]) in result.iter_mut().zip(ENTRIES) {
                    part[a * count + b] += scaled[i] * row[b][j] + scaled[j] * row[b][i];
                }
            }
        }
    }
    result
}

/// The diagonals of [`stiffness`].
fn stiffness_diagonal(space: &Space, kind: Kind) -> [Vec<f64>; 6] {
    let (gradients, weights) = gradients(space, kind);
    let count = kind.functions();
    let mut result: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; count]);
    for (point, &weight) in weights.iter().enumerate() {
        for (place, &gradient) in gradients[point * count..(point + 1) * count].iter().enumerate() {
            for (part, [i, j]) in result.iter_mut().zip(ENTRIES) {
                part[place] += weight * gradient[i] * gradient[j];
            }
        }
    }
    result
}

/// The diagonal of the model, a number a node.
///
/// # Errors
/// When the reference of a cell is flat.
pub fn diagonal(model: &Model<'_>) -> Result<Vec<f64>, String> {
    diagonal_with(model, &metrics(model)?)
}

fn diagonal_with(model: &Model<'_>, metrics: &[[f64; 6]]) -> Result<Vec<f64>, String> {
    let space = model.space;
    let mut diagonal = vec![0.0; space.nodes];
    let mut kinds: BTreeMap<Kind, [Vec<f64>; 6]> = BTreeMap::new();
    for (cell, metric) in space.cells.iter().zip(metrics) {
        let own = kinds
            .entry(cell.kind)
            .or_insert_with(|| stiffness_diagonal(space, cell.kind));
        for (place, slot) in cell.slots.iter().enumerate() {
            if let Some((node, _)) = slot.node() {
                diagonal[node] += contract(own, metric, place);
            }
        }
    }
    if model.surface > 0.0 {
        let blocks = sample_blocks(model);
        model.boundary.each_row(|slots, row, sample| {
            let block = blocks[sample];
            let mean = (block[0] + block[3] + block[5]) / 3.0;
            for (slot, weight) in slots.iter().zip(row) {
                if let Some((node, _)) = slot.node() {
                    diagonal[node] += weight * weight * mean;
                }
            }
        });
    }
    Ok(diagonal)
}

/// How the surface energy bends by every sample: `n n^T` and a share of the rest, times the sample's area.
pub(super) fn sample_blocks(model: &Model<'_>) -> Vec<[f64; 6]> {
    let mut sums = vec![[0.0; 3]; model.samples.len()];
    let mut areas = vec![0.0; model.samples.len()];
    for triangle in &model.boundary.triangles {
        let vector = area_vector(triangle.map(|sample| model.samples[sample as usize]));
        let area = length(vector) / 6.0;
        for &sample in triangle {
            areas[sample as usize] += area;
            for axis in 0..3 {
                sums[sample as usize][axis] += vector[axis];
            }
        }
    }
    let tangential = 1.0 / (model.anisotropy * model.anisotropy);
    sums.iter()
        .zip(areas)
        .map(|(sum, area)| {
            let n = times(*sum, 1.0 / length(*sum).max(f64::MIN_POSITIVE));
            let weight = 4.0 * model.surface * area;
            upper_entries(|i, j| {
                let along = if i == j { tangential } else { 0.0 };
                weight * ((1.0 - tangential) * n[i] * n[j] + along)
            })
        })
        .collect()
}

/// A place for every node, for the order of elimination: the middle of the vertices of the first cell that has it, drawn
/// to the node's own vertex where it is one.
fn node_places(mesh: &MixedMesh, space: &Space) -> Vec<[f64; 3]> {
    let mut sums = vec![([0.0; 3], 0.0); space.nodes];
    for (cell, (_, corners)) in space.cells.iter().zip(mesh.iter()) {
        let mut middle = [0.0; 3];
        for &corner in corners {
            for axis in 0..3 {
                middle[axis] += mesh.points[corner as usize][axis] / corners.len() as f64;
            }
        }
        for slot in &cell.slots {
            if let Some((node, _)) = slot.node() {
                let (sum, count) = &mut sums[node];
                *count += 1.0;
                for axis in 0..3 {
                    sum[axis] += middle[axis];
                }
            }
        }
    }
    let mut places: Vec<[f64; 3]> = sums
        .iter()
        .map(|(sum, count)| times(*sum, 1.0 / f64::max(*count, 1.0)))
        .collect();
    places[..mesh.points.len()].copy_from_slice(&mesh.points);
    places
}
