//! The symmetric indefinite system in all fields at once, its unknowns numbered vertex by vertex.
//!
//! The vertices follow an order of nested dissection of the mesh, and the fields of a vertex stand side by side, so that
//! pivots of size two stay within a vertex.

use super::scheme::{Discretization, Mass};
use crate::linalg::sparse::{Elimination, Graph, geometric_dissection};

/// No unknown.
pub(super) const NONE: u32 = u32::MAX;

/// A symmetric matrix: its lower triangle by columns, rows ascending, the diagonal first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LowerMatrix {
    pub offsets: Vec<usize>,
    pub rows: Vec<usize>,
    pub values: Vec<f64>,
}

impl LowerMatrix {
    pub fn dimension(&self) -> usize {
        self.offsets.len() - 1
    }

    /// `A x`.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        self.product(x, |value| value)
    }

    /// `|A| x` with the magnitudes of the entries.
    pub fn multiply_magnitudes(&self, x: &[f64]) -> Vec<f64> {
        self.product(x, f64::abs)
    }

    fn product(&self, x: &[f64], of: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut result = vec![0.0; x.len()];
        for column in 0..self.dimension() {
            let mut sum = 0.0;
            for place in self.offsets[column]..self.offsets[column + 1] {
                let (row, value) = (self.rows[place], of(self.values[place]));
                result[row] += value * x[column];
                if row != column {
                    sum += value * x[row];
                }
            }
            result[column] += sum;
        }
        result
    }

    /// The number of singular values below 1e-10 of the largest; `None` for more than 600 unknowns, which would take
    /// too long.
    pub fn nullity(&self) -> Option<usize> {
        let dimension = self.dimension();
        if dimension > 600 {
            return None;
        }
        let mut dense = faer::Mat::<f64>::zeros(dimension, dimension);
        for column in 0..dimension {
            for place in self.offsets[column]..self.offsets[column + 1] {
                dense[(self.rows[place], column)] = self.values[place];
                dense[(column, self.rows[place])] = self.values[place];
            }
        }
        let values = dense.singular_values().ok()?;
        let largest = values.iter().copied().fold(0.0, f64::max);
        Some(values.iter().filter(|&&value| value < 1e-10 * largest).count())
    }
}

/// The unknowns of the mixed system.
pub struct Numbering {
    /// Number of the unknown of each field `u`, `v`, `w` at each vertex.
    index: Vec<[u32; 3]>,
    /// Vertices with an unknown, in the order of their numbers.
    order: Vec<u32>,
    pub count: usize,
    /// An unknown is its field's value divided by this, so that all coefficients have about the same size whatever the
    /// edge length: pivots are chosen by size.
    pub(super) scale: [f64; 3],
}

/// The fields in the order in which a vertex's unknowns are numbered: `v`, `w`, `u`. In this order every pivot is
/// nonzero once those before it are eliminated, even where a vertex is split over supernodes.
const FIELDS: [usize; 3] = [1, 2, 0];

impl Numbering {
    pub fn new(discretization: &Discretization<'_>) -> Self {
        let unknown = &discretization.unknown;
        let (with, graph, points) = vertex_graph(discretization);
        let elimination = Elimination::new(&graph, &geometric_dissection(&graph, &points), discretization.order);
        let order: Vec<u32> = elimination.order().iter().map(|&place| with[place as usize]).collect();
        let mut index = vec![[NONE; 3]; discretization.domain.places.len()];
        let mut count = 0;
        for &vertex in &order {
            for field in FIELDS {
                if unknown[field][vertex as usize] {
                    index[vertex as usize][field] = count;
                    count += 1;
                }
            }
        }
        Self {
            index,
            order,
            count: count as usize,
            scale: scale(discretization),
        }
    }

    /// The same number of places, one for each field, at each of the vertices `with`, whether the field is unknown or
    /// not; the vertices in the given order, the fields in that of [`FIELDS`].
    pub(super) fn in_blocks(discretization: &Discretization<'_>, with: &[u32]) -> Self {
        let fields = FIELDS.into_iter().filter(|&field| field < discretization.order);
        let mut index = vec![[NONE; 3]; discretization.domain.places.len()];
        for (place, &vertex) in with.iter().enumerate() {
            for (slot, field) in fields.clone().enumerate() {
                if discretization.unknown[field][vertex as usize] {
                    index[vertex as usize][field] = (place * discretization.order + slot) as u32;
                }
            }
        }
        Self {
            index,
            order: with.to_vec(),
            count: with.len() * discretization.order,
            scale: scale(discretization),
        }
    }

    /// How many places in the order are unknowns; [`Self::count`] has those that are kept for known fields too.
    pub(super) fn unknown_count(&self) -> usize {
        self.index.iter().flatten().filter(|&&index| index != NONE).count()
    }

    /// The vertex of the mesh at a place in the order.
    pub(super) fn vertex(&self, place: u32) -> u32 {
        self.order.get(place as usize).copied().unwrap_or(place)
    }

    /// Numbers of the unknowns `u`, `v`, `w` at a vertex, [`NONE`] where the field is known.
    pub(super) fn unknowns(&self, vertex: u32) -> [u32; 3] {
        self.index[vertex as usize]
    }

    /// The values of a field taken from a solution with `components` columns; known values elsewhere.
    pub fn field(&self, discretization: &Discretization<'_>, solution: &[f64], field: usize) -> Vec<f64> {
        let components = discretization.components;
        let mut values = discretization.known[field].clone();
        for (vertex, index) in self.index.iter().enumerate() {
            if index[field] != NONE {
                for c in 0..components {
                    let unknown = solution[c * self.count + index[field] as usize];
                    values[vertex * components + c] = self.scale[field] * unknown;
                }
            }
        }
        values
    }
}

/// The vertices with an unknown, the mesh's edges between them by their places in that list, and where they are.
pub(super) fn vertex_graph(discretization: &Discretization<'_>) -> (Vec<u32>, Graph, Vec<[f64; 3]>) {
    let mesh = discretization.domain.mesh;
    let vertices = discretization.domain.places.len();
    let mut name = vec![NONE; vertices];
    let mut with: Vec<u32> = Vec::new();
    for vertex in 0..vertices {
        if discretization.unknown.iter().any(|field| field[vertex]) {
            name[vertex] = with.len() as u32;
            with.push(vertex as u32);
        }
    }
    let whole = &discretization.domain.graph;
    let mut graph = Graph {
        offsets: Vec::with_capacity(with.len() + 1),
        neighbours: Vec::with_capacity(whole.neighbours.len()),
    };
    graph.offsets.push(0);
    for &vertex in &with {
        // Names ascend with the vertices, so the neighbours stay sorted.
        let names = whole.neighbours(vertex).iter().map(|&other| name[other as usize]);
        graph.neighbours.extend(names.filter(|&name| name != NONE));
        graph.offsets.push(graph.neighbours.len());
    }
    let points = with.iter().map(|&vertex| mesh.points[vertex as usize]).collect();
    (with, graph, points)
}

/// With the mean lumped mass `m`, coefficients are of size 1 for `L`, `m` for `M` and `m^2` for `S`.
fn scale(discretization: &Discretization<'_>) -> [f64; 3] {
    let lumped = discretization.lumped();
    let used = lumped.iter().filter(|&&mass| mass > 0.0);
    let (sum, count) = used.fold((0.0, 0), |(sum, count), mass| (sum + mass, count + 1));
    let mean: f64 = if count > 0 { sum / f64::from(count) } else { 1.0 };
    if discretization.order == 2 {
        [mean.sqrt(), 1.0 / mean.sqrt(), 1.0]
    } else {
        [mean, 1.0, 1.0 / mean]
    }
}

/// Calls `visit(row field, column vertex, column field, coefficient)` for every coefficient in the rows of the
/// unknowns of one vertex.
pub(super) fn coefficients(
    discretization: &Discretization<'_>,
    vertex: u32,
    mut visit: impl FnMut(usize, usize, usize, f64),
) {
    let operators = discretization.operators;
    let lumped = (discretization.mass != Mass::Full).then(|| discretization.lumped());
    let (u, v, w) = (0, 1, 2);
    for place in operators.pattern.row(vertex) {
        let other = operators.pattern.columns[place] as usize;
        let laplacian = operators.laplacian[place];
        let diagonal = other == vertex as usize;
        let mass = match lumped {
            None => operators.mass[place],
            Some(lumped) if diagonal => lumped[other],
            Some(_) => 0.0,
        };
        if discretization.order == 2 {
            visit(v, other, v, -mass);
            visit(v, other, u, laplacian);
            visit(u, other, v, laplacian);
        } else {
            visit(v, other, v, laplacian);
            visit(v, other, w, -mass);
            visit(u, other, w, laplacian);
            visit(w, other, v, -mass);
            visit(w, other, u, laplacian);
            if let Some(&relaxed) = discretization.penalty.get(place) {
                visit(w, other, w, relaxed);
            }
        }
    }
}

/// The matrix.
pub fn matrix(discretization: &Discretization<'_>, numbering: &Numbering) -> LowerMatrix {
    let mut matrix = LowerMatrix {
        offsets: Vec::with_capacity(numbering.count + 1),
        ..LowerMatrix::default()
    };
    matrix.offsets.push(0);
    let mut columns: [Vec<(u32, f64)>; 3] = Default::default();
    for &vertex in &numbering.order {
        let own = numbering.index[vertex as usize];
        // The matrix is symmetric: a row's entries from the diagonal on are a column's.
        coefficients(discretization, vertex, |row, other, column, value| {
            let index = numbering.index[other][column];
            if own[row] != NONE && index != NONE && index >= own[row] && (value != 0.0 || index == own[row]) {
                columns[row].push((index, numbering.scale[row] * value * numbering.scale[column]));
            }
        });
        for field in FIELDS {
            if own[field] == NONE {
                continue;
            }
            let entries = &mut columns[field];
            if !entries.iter().any(|entry| entry.0 == own[field]) {
                entries.push((own[field], 0.0));
            }
            entries.sort_unstable_by_key(|entry| entry.0);
            matrix.rows.extend(entries.iter().map(|entry| entry.0 as usize));
            matrix.values.extend(entries.iter().map(|entry| entry.1));
            matrix.offsets.push(matrix.rows.len());
        }
        columns.iter_mut().for_each(Vec::clear);
    }
    matrix
}

/// The right-hand side: `components` columns, one after another.
pub fn right_side(discretization: &Discretization<'_>, numbering: &Numbering) -> Vec<f64> {
    let components = discretization.components;
    let mut right = vec![0.0; numbering.count * components];
    for &vertex in &numbering.order {
        let own = numbering.index[vertex as usize];
        let flux_field = if discretization.order == 2 { 1 } else { 2 };
        for c in 0..components {
            let at = vertex as usize * components + c;
            if own[0] != NONE {
                right[c * numbering.count + own[0] as usize] += numbering.scale[0] * discretization.load[at];
            }
            if own[flux_field] != NONE {
                right[c * numbering.count + own[flux_field] as usize] -=
                    numbering.scale[flux_field] * discretization.flux[at];
            }
        }
        coefficients(discretization, vertex, |row, other, column, value| {
            if own[row] != NONE && numbering.index[other][column] == NONE && value != 0.0 {
                for c in 0..components {
                    right[c * numbering.count + own[row] as usize] -=
                        numbering.scale[row] * value * discretization.known[column][other * components + c];
                }
            }
        });
    }
    right
}
