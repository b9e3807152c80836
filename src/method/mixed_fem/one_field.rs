//! The system in `u` alone, after elimination of the other fields: symmetric and positive definite for lumped masses.
//!
//! Order 2: `B^T D^-1 B u = ...` with `B = L` from the unknown `u` to the unknown `v` (system 11). Order 3:
//! `(P^T (-L) P + C^T S^-1 C) u = ...` with `P = D^-1 B` and `C = L` from the unknown `u` to the relaxed boundary rows,
//! where `S` is diagonal.

use super::scheme::Discretization;
use crate::linalg::sparse::{BlockPattern, FIXED, Graph, geometric_dissection};
use crate::optimize::Observer;

/// A one-field system: structure and matrix.
pub struct OneField {
    pub pattern: BlockPattern<1>,
    pub values: Vec<f64>,
}

/// Rows of a matrix from vertices to unknowns.
struct Rows {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl Rows {
    fn with_capacity(rows: usize, entries: usize) -> Self {
        let mut offsets = Vec::with_capacity(rows + 1);
        offsets.push(0);
        Self {
            offsets,
            columns: Vec::with_capacity(entries),
            values: Vec::with_capacity(entries),
        }
    }

    fn row(&self, row: usize) -> impl Iterator<Item = (u32, f64)> {
        let range = self.offsets[row]..self.offsets[row + 1];
        self.columns[range.clone()]
            .iter()
            .copied()
            .zip(self.values[range].iter().copied())
    }
}

/// Sums sparse rows in a dense one.
struct Accumulator {
    values: Vec<f64>,
    touched: Vec<u32>,
    marked: Vec<bool>,
}

impl Accumulator {
    fn new(size: usize) -> Self {
        Self {
            values: vec![0.0; size],
            touched: Vec::new(),
            marked: vec![false; size],
        }
    }

    fn add(&mut self, column: u32, value: f64) {
        let at = column as usize;
        if !self.marked[at] {
            self.marked[at] = true;
            self.touched.push(column);
        }
        self.values[at] += value;
    }

    /// Hands out the sum with ascending columns and starts anew.
    fn drain(&mut self, mut visit: impl FnMut(u32, f64)) {
        self.touched.sort_unstable();
        for &column in &self.touched {
            visit(column, self.values[column as usize]);
            self.values[column as usize] = 0.0;
            self.marked[column as usize] = false;
        }
        self.touched.clear();
    }
}

impl OneField {
    /// Assembles the matrix. The mass must be lumped.
    pub fn new(discretization: &Discretization<'_>, observer: &mut dyn Observer) -> Self {
        observer.phase("assemble");
        let domain = discretization.domain;
        let pattern = &discretization.operators.pattern;
        let laplacian = &discretization.operators.laplacian;
        let lumped = discretization.lumped();
        let penalty = discretization.penalty_diagonal();
        let [u, v, _] = &discretization.unknown;
        let vertices = domain.places.len();
        let mut name = vec![FIXED; vertices];
        let mut free = Vec::new();
        for vertex in (0..vertices).filter(|&vertex| u[vertex]) {
            name[vertex] = free.len() as u32;
            free.push(vertex as u32);
        }
        // B, or for order 3 (-L) D^-1 B, on the rows where v is unknown.
        let entries = pattern.columns.len();
        let mut image = Rows::with_capacity(vertices, entries);
        let mut sum = Accumulator::new(free.len());
        for vertex in 0..vertices as u32 {
            if v[vertex as usize] {
                for place in pattern.row(vertex) {
                    let other = pattern.columns[place] as usize;
                    if discretization.order == 2 {
                        if u[other] {
                            sum.add(name[other], laplacian[place]);
                        }
                    } else if v[other] {
                        let factor = -laplacian[place] / lumped[other];
                        for inner in pattern.row(other as u32) {
                            let column = pattern.columns[inner] as usize;
                            if u[column] {
                                sum.add(name[column], factor * laplacian[inner]);
                            }
                        }
                    }
                }
            }
            sum.drain(|column, value| {
                image.columns.push(column);
                image.values.push(value);
            });
            image.offsets.push(image.columns.len());
        }
        let mut edges: Vec<[u32; 2]> = Vec::new();
        let mut entries: Vec<f64> = Vec::new();
        let mut diagonal = vec![0.0; free.len()];
        for (row, &vertex) in free.iter().enumerate() {
            for place in pattern.row(vertex) {
                let other = pattern.columns[place] as usize;
                if v[other] {
                    let factor = laplacian[place] / lumped[other];
                    for (column, value) in image.row(other) {
                        if column as usize >= row {
                            sum.add(column, factor * value);
                        }
                    }
                }
                if penalty[other] > 0.0 {
                    let factor = laplacian[place] / penalty[other];
                    for inner in pattern.row(other as u32) {
                        let column = name[pattern.columns[inner] as usize];
                        if column != FIXED && column as usize >= row {
                            sum.add(column, factor * laplacian[inner]);
                        }
                    }
                }
            }
            sum.drain(|column, value| {
                if column as usize == row {
                    diagonal[row] = value;
                } else {
                    edges.push([row as u32, column]);
                    entries.push(value);
                }
            });
        }
        let points: Vec<[f64; 3]> = free.iter().map(|&vertex| domain.mesh.points[vertex as usize]).collect();
        observer.phase("order");
        let graph = Graph::of_cells(points.len(), &edges, Some);
        let pattern = BlockPattern::<1>::of_graph(&graph, &geometric_dissection(&graph, &points));
        observer.phase("assemble");
        let mut values = vec![0.0; pattern.values_len()];
        let mut set = |row: usize, column: usize, value: f64| {
            if let Some((place, _)) = pattern.block(row, column) {
                values[place] = value;
            }
        };
        for (vertex, &value) in diagonal.iter().enumerate() {
            set(vertex, vertex, value);
        }
        for (&[row, column], &value) in edges.iter().zip(&entries) {
            set(row as usize, column as usize, value);
        }
        Self { pattern, values }
    }
}

/// What the eliminated fields are at `u = 0` where `u` is unknown, and the right-hand side, `components` columns.
pub fn right_side(discretization: &Discretization<'_>) -> Vec<f64> {
    let components = discretization.components;
    let [u, v, w] = &discretization.unknown;
    let lumped = discretization.lumped();
    let vertices = v.len();
    let image = discretization.multiply_laplacian(&discretization.known[0]);
    let mut laplacian = discretization.known[1].clone();
    for vertex in (0..vertices).filter(|&vertex| v[vertex]) {
        for c in 0..components {
            let at = vertex * components + c;
            laplacian[at] = (image[at] + discretization.flux[at]) / lumped[vertex];
        }
    }
    let (last, sign) = if discretization.order == 2 {
        (laplacian, 1.0)
    } else {
        let second = discretization.multiply_laplacian(&laplacian);
        let mut bilaplacian = discretization.known[2].clone();
        let penalty = discretization.penalty_diagonal();
        for vertex in (0..vertices).filter(|&vertex| w[vertex]) {
            for c in 0..components {
                let at = vertex * components + c;
                bilaplacian[at] = if penalty[vertex] > 0.0 {
                    let rest = lumped[vertex] * laplacian[at] - image[at] - discretization.flux[at];
                    rest / penalty[vertex]
                } else {
                    second[at] / lumped[vertex]
                };
            }
        }
        (bilaplacian, -1.0)
    };
    let image = discretization.multiply_laplacian(&last);
    let free: Vec<usize> = (0..vertices).filter(|&vertex| u[vertex]).collect();
    let mut right = vec![0.0; free.len() * components];
    for (row, &vertex) in free.iter().enumerate() {
        for c in 0..components {
            let at = vertex * components + c;
            right[c * free.len() + row] = sign * (discretization.load[at] - image[at]);
        }
    }
    right
}

/// The field `u` from a solution with `components` columns.
pub fn field(discretization: &Discretization<'_>, solution: &[f64]) -> Vec<f64> {
    let components = discretization.components;
    let u = &discretization.unknown[0];
    let count = u.iter().filter(|&&unknown| unknown).count();
    let mut values = discretization.known[0].clone();
    for (row, vertex) in (0..u.len()).filter(|&vertex| u[vertex]).enumerate() {
        for c in 0..components {
            values[vertex * components + c] = solution[c * count + row];
        }
    }
    values
}
