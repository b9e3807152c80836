//! Proofs that the determinant of a cell's Jacobian is positive everywhere, not only at sampled points.
//!
//! On a box, prism or tetrahedron within the cell the Jacobian is a convex combination of control matrices, its Bernstein
//! coefficients. With any fixed matrix `J0`, `det J > 0` follows when the symmetric parts of all control matrices of
//! `J0^-1 J`, or of all of `J J0^-1`, are positive definite: positive definite matrices are a convex set, and
//! `det M >= det((M + M^T) / 2)` (Ostrowski and Taussky 1951). As the cube root of the determinant is concave there,
//! the least of their determinants times `det J0` bounds `det J` from below. No product of polynomials is needed, unlike
//! for Bernstein coefficients of the determinant itself (Johnen et al. 2013). Where the test fails the part is cut,
//! until it holds, a point with a negative determinant turns up, or the permitted number of parts is used up.
//!
//! Functions that are no polynomials are replaced on each part by interpolants, along lines at Chebyshev points, on
//! triangles and tetrahedra at lattices, with an explicit bound on the error ([`chebyshev`]) that is subtracted from the
//! control matrices' symmetric parts.
//!
//! Rounding is covered by a margin that grows with the conditioning of the conversion to Bernstein form; it is an
//! estimate, not interval arithmetic.

mod double_double;
mod bernstein;
mod chebyshev;
mod interval;
mod lattice;
mod position;
mod polynomial;
mod hexahedron;
mod prism;
mod tetrahedron;

use super::basis::Basis;
use super::batches::in_frame;
use super::space::{Kind, Space};
use crate::fem::functions::{line_table, tetrahedron_table, triangle_table};
use crate::linalg::vector3::{Columns, add, apply, cofactor, dot, subtract, times, upper_entries};
use crate::mesh::mixed::Shape;
use bernstein::{Conversion, line_conversion, tetrahedron_conversion, triangle_conversion};
use interval::Interval;
use lattice::Lattice;
use nalgebra::DMatrix;
use position::{Converted, prism_last};
use std::collections::BTreeMap;

/// What could be shown of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The determinant, against the reference, is at least this everywhere.
    Positive(f64),
    /// At this canonical point the determinant is this, and not positive.
    Negative([f64; 3], f64),
    /// Neither, with the parts allowed used up: the determinant is at least this, which is not positive. Parts not
    /// looked at yet count with the bound of the part they were cut from, so this may be far too low.
    Undecided(f64),
}

/// The conversions that cells of one basis share.
pub struct Certifier {
    basis: &'static dyn Basis,
    /// Most parts a cell is cut into.
    most: usize,
    /// By degree: points of the unit interval and the matrix from values there to Bernstein coefficients.
    lines: BTreeMap<usize, (Vec<f64>, DMatrix<f64>)>,
    triangles: BTreeMap<usize, Conversion<2>>,
    tetrahedra: BTreeMap<usize, Conversion<3>>,
    /// Functions on dyadic intervals: `(order, level, index)`.
    intervals: BTreeMap<(usize, u32, u32), Interval>,
    /// By number of corners and degree.
    lattices: BTreeMap<(usize, usize), Lattice>,
    /// Polynomials alone: triangle functions by order and the corner c of those inside, tetrahedron functions by order.
    triangle_functions: BTreeMap<(usize, usize), Converted>,
    tetrahedron_functions: BTreeMap<usize, Converted>,
}

/// Half a unit in the last place of 1.
const UNIT: f64 = 0.5 * f64::EPSILON;

/// Rounding of a determinant of a positive definite matrix at most, as a share of the product of its diagonal.
const MARGIN: f64 = 1e-14;

/// Relative error of a conversion from this many values whose matrix has this norm: half a unit for each term of a sum and
/// a few for the entries and the values.
fn rounding(terms: usize, norm: f64) -> f64 {
    (terms + 30) as f64 * UNIT * norm
}

/// Products of a coefficient and a function that the proof for one cell may take.
const MOST_WORK: usize = 2_000_000_000;

/// Points below which a determinant counts as negative, relative to the reference.
const NEGATIVE: f64 = -1e-12;

impl Certifier {
    /// For cells of `basis` cut into at most `most` parts each. `orders` are all that occur.
    pub fn new(basis: &'static dyn Basis, kinds: impl Iterator<Item = Kind>, most: usize) -> Certifier {
        let mut result = Certifier {
            basis,
            most,
            lines: BTreeMap::new(),
            triangles: BTreeMap::new(),
            tetrahedra: BTreeMap::new(),
            intervals: BTreeMap::new(),
            lattices: BTreeMap::new(),
            triangle_functions: BTreeMap::new(),
            tetrahedron_functions: BTreeMap::new(),
        };
        for kind in kinds {
            let degree = result.degree(kind.order);
            match kind.shape {
                Shape::Hexahedron => {
                    result.lines.entry(degree).or_insert_with(|| line_conversion(degree));
                }
                Shape::Prism => {
                    result.lines.entry(degree).or_insert_with(|| line_conversion(degree));
                    result
                        .triangles
                        .entry(degree)
                        .or_insert_with(|| triangle_conversion(degree));
                }
                Shape::Tetrahedron => {
                    result
                        .tetrahedra
                        .entry(degree)
                        .or_insert_with(|| tetrahedron_conversion(degree));
                }
            }
            if result.polynomial(kind.order) {
                result.prepare(kind);
            }
            if kind.shape != Shape::Tetrahedron {
                // The coarsest intervals serve every cell.
                for level in 0..4 {
                    for index in 0..1 << level {
                        let interval = result.interval(kind.order, level, index);
                        result.intervals.insert((kind.order, level, index), interval);
                    }
                }
            }
        }
        result
    }

    /// What cells of polynomials need.
    fn prepare(&mut self, kind: Kind) {
        let (basis, order) = (self.basis, kind.order);
        let corners: &[usize] = match kind.shape {
            Shape::Hexahedron => &[2],
            Shape::Prism => &[2, 3],
            Shape::Tetrahedron => &[4],
        };
        for &corners in corners {
            self.lattices
                .entry((corners, order))
                .or_insert_with(|| Lattice::new(corners, order));
        }
        match kind.shape {
            Shape::Hexahedron => {}
            Shape::Prism => {
                for level in 0..=order.min(2) {
                    let last = prism_last(kind, level);
                    let conversion = &self.triangles[&order];
                    self.triangle_functions.entry((order, last)).or_insert_with(|| {
                        let table = triangle_table(basis, order, last, &conversion.points);
                        Converted::new(&conversion.matrix, conversion.norm, table.functions, &table.values)
                    });
                }
            }
            Shape::Tetrahedron => {
                let conversion = &self.tetrahedra[&order];
                self.tetrahedron_functions.entry(order).or_insert_with(|| {
                    let table = tetrahedron_table(basis, order, &conversion.points);
                    Converted::new(&conversion.matrix, conversion.norm, table.functions, &table.values)
                });
            }
        }
    }

    /// The determinant at a canonical point.
    fn determinant_at(&self, kind: Kind, coefficients: &[[f64; 3]], inverse: &Columns<f64>, point: [f64; 3]) -> f64 {
        let (basis, order) = (self.basis, kind.order);
        let mut raw = [[0.0; 3]; 3];
        match kind.shape {
            Shape::Hexahedron => return self.hexahedron_determinant(order, coefficients, inverse, point),
            Shape::Prism => {
                let line = line_table(basis, order, &[point[2]]);
                let functions = coefficients.len() / (order + 1);
                for level in 0..=order {
                    let triangle = triangle_table(basis, order, prism_last(kind, level), &[[point[0], point[1]]]);
                    let (value, slope) = (line.values[level], line.derivatives[0][level]);
                    for function in 0..functions {
                        let c = coefficients[level * functions + function];
                        raw[0] = add(raw[0], times(c, triangle.derivatives[0][function] * value));
                        raw[1] = add(raw[1], times(c, triangle.derivatives[1][function] * value));
                        raw[2] = add(raw[2], times(c, triangle.values[function] * slope));
                    }
                }
            }
            Shape::Tetrahedron => {
                let table = tetrahedron_table(basis, order, &[point]);
                for (function, &c) in coefficients.iter().enumerate() {
                    let slopes = [0, 1, 2].map(|direction| table.derivatives[direction][function]);
                    accumulate(&mut raw, &slopes.map(|slope| times(c, slope)), 1.0);
                }
            }
        }
        determinant(&apply_right(&raw, inverse))
    }

    /// Whether all functions of an order are polynomials.
    fn polynomial(&self, order: usize) -> bool {
        (1..order).all(|j| self.basis.frequency(j).unwrap_or(0.0) == 0.0)
    }

    /// Parts that a cell of this kind may be cut into.
    fn most(&self, kind: Kind) -> usize {
        let (n, m) = (kind.order + 1, self.degree(kind.order) + 1);
        let work = match kind.shape {
            Shape::Hexahedron => 9 * m * m * m * n,
            Shape::Prism => (m * (m + 1) / 2) * (n * (n + 1) / 2 * n + 2 * n * m + m * m * (m + 1) / 2),
            Shape::Tetrahedron => (m * (m + 1) * (m + 2) / 6) * (m * (m + 1) * (m + 2) / 6 + kind.functions()),
        };
        self.most.min(MOST_WORK / work).max(64)
    }

    /// Degree of the polynomials that stand for the functions.
    fn degree(&self, order: usize) -> usize {
        if self.polynomial(order) {
            order
        } else {
            // Above, conversions round more than is gained; more cuts do the same.
            (order + 3).clamp(6, 14)
        }
    }

    /// Judges a cell of a space.
    pub fn judge(&self, space: &Space, cell: usize, reference: &Columns<f64>, x: &[f64]) -> Verdict {
        let slots = &space.cells[cell];
        let coefficients: Vec<[f64; 3]> = slots
            .slots
            .iter()
            .map(|slot| match slot.node() {
                Some((node, sign)) => [0, 1, 2].map(|axis| sign * x[3 * node + axis]),
                None => [0.0; 3],
            })
            .collect();
        let framed = in_frame(slots.kind.shape, &slots.corners, reference);
        let cof = cofactor(&framed);
        let determinant = dot(framed[0], cof[0]);
        // Columns of A^-1: entry (row, column) is cof[row][column] / det.
        let inverse: Columns<f64> = [0, 1, 2].map(|column| [0, 1, 2].map(|row| cof[row][column] / determinant));
        let verdict = match slots.kind.shape {
            _ if self.polynomial(slots.kind.order) => self.polynomial_cell(slots.kind, &coefficients, &inverse),
            Shape::Hexahedron => self.hexahedron(slots.kind, &coefficients, &inverse),
            Shape::Prism => self.prism(slots.kind, &coefficients, &inverse),
            Shape::Tetrahedron => self.tetrahedron(slots.kind, &coefficients, &inverse),
        };
        match verdict {
            // The point in the cell's own coordinates.
            Verdict::Negative(point, value) if slots.kind.shape == Shape::Tetrahedron => {
                let weights = [1.0 - point[0] - point[1] - point[2], point[0], point[1], point[2]];
                let mut own = [0.0; 3];
                for (place, weight) in weights.iter().enumerate() {
                    let corner = slots.corners[place] as usize;
                    if corner > 0 {
                        own[corner - 1] = *weight;
                    }
                }
                Verdict::Negative(own, value)
            }
            other => other,
        }
    }

    /// Whether the determinant is proved positive on a part from the control matrices there, each wrong by at most
    /// `error` in the Frobenius norm: a positive lower bound, or as an error one that is not.
    fn part(&self, control: &mut [Columns<f64>], error: f64, inverse: &Columns<f64>) -> Result<f64, f64> {
        let mut mean = [[0.0; 3]; 3];
        for matrix in control.iter_mut() {
            *matrix = apply_right(matrix, inverse);
            accumulate(&mut mean, matrix, 1.0);
        }
        let mean = mean.map(|column| times(column, 1.0 / control.len() as f64));
        let error = error * frobenius(inverse);
        prove(control, &mean, error).ok_or_else(|| rough(control.iter().copied(), &mean, error))
    }
}

/// A positive lower bound of the determinant over all convex combinations of matrices, each wrong by at most `error`.
fn prove(control: &[Columns<f64>], mean: &Columns<f64>, error: f64) -> Option<f64> {
    let cof = cofactor(mean);
    let middle = dot(mean[0], cof[0]);
    if !is_positive(middle, mean) {
        return None;
    }
    // J0^-1 by rows: row r is cof[r] / det.
    let rows = cof.map(|row| times(row, 1.0 / middle));
    let delta = frobenius(&rows) * error;
    if !(delta < 0.5) {
        return None;
    }
    // From the left: M_ij = rows_i . column_j. From the right: the sum over k of column_k[i] rows_k[j].
    let least = |from_left: bool| {
        let mut least = f64::INFINITY;
        for matrix in control.iter() {
            let m = [0, 1, 2].map(|row| {
                [0, 1, 2].map(|column| match from_left {
                    true => dot(rows[row], matrix[column]),
                    false => (0..3).map(|k| matrix[k][row] * rows[k][column]).sum(),
                })
            });
            let entry = |i: usize, j: usize| 0.5 * (m[i][j] + m[j][i]) - if i == j { delta } else { 0.0 };
            let [a, b, c, d, e, f] = upper_entries(entry);
            let minor = a * d - b * b;
            let whole = f * minor - a * e * e + 2.0 * b * c * e - c * c * d;
            if !(a > 0.0 && minor > MARGIN * a * d && whole > MARGIN * a * d * f) {
                return None;
            }
            least = least.min(whole);
        }
        Some(middle * least)
    };
    least(true).or_else(|| least(false))
}

/// Whether a determinant is positive whatever its rounding, which Hadamard's inequality bounds.
fn is_positive(determinant: f64, matrix: &Columns<f64>) -> bool {
    let square: f64 = matrix.iter().map(|column| dot(*column, *column)).product();
    determinant > MARGIN * square.sqrt()
}

/// `det (J0 + D) >= det J0 - (prod (|c_i| + |d_i|) - prod |c_i|)` over all those combinations, by Hadamard's inequality.
fn rough(control: impl Iterator<Item = Columns<f64>> + Clone, mean: &Columns<f64>, error: f64) -> f64 {
    let size = |column: [f64; 3]| dot(column, column).sqrt();
    let (mut inner, mut outer) = (1.0, 1.0);
    for direction in 0..3 {
        let away = (control.clone()).map(|matrix| size(subtract(matrix[direction], mean[direction])));
        let length = size(mean[direction]);
        inner *= length;
        outer *= length + away.fold(0.0, f64::max) + error;
    }
    (determinant(mean) - (outer - inner)).min(0.0)
}

fn determinant(matrix: &Columns<f64>) -> f64 {
    dot(matrix[0], cofactor(matrix)[0])
}

fn frobenius(matrix: &Columns<f64>) -> f64 {
    matrix.iter().map(|column| dot(*column, *column)).sum::<f64>().sqrt()
}

/// `matrix * right`.
fn apply_right(matrix: &Columns<f64>, right: &Columns<f64>) -> Columns<f64> {
    right.map(|column| apply(matrix, column))
}

fn accumulate(sum: &mut Columns<f64>, matrix: &Columns<f64>, weight: f64) {
    for (sum, column) in sum.iter_mut().zip(matrix) {
        *sum = add(*sum, times(*column, weight));
    }
}
