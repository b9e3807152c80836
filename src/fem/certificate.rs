//! Proofs that the determinant of a cell's Jacobian is positive everywhere, not only at sampled points.
//!
//! On a box, prism or tetrahedron within the cell the Jacobian is a convex combination of control matrices, its Bernstein
//! coefficients. With any fixed matrix `J0`, `det J > 0` follows when the symmetric parts of all control matrices of
//! `J0^-1 J` are positive definite: positive definite matrices are a convex set, and `det M >= det((M + M^T) / 2)`
//! (Ostrowski and Taussky 1951). As the cube root of the determinant is concave there, the least of their determinants
//! times `det J0` bounds `det J` from below. No product of polynomials is needed, unlike for Bernstein coefficients of
//! the determinant itself (Johnen et al. 2013). Where the test fails the part is cut, until it holds, a point with a
//! negative determinant turns up, or the permitted number of parts is used up.
//!
//! Functions that are no polynomials are replaced on each part by interpolants at Chebyshev points, with an explicit bound
//! on the error that is subtracted from the control matrices' symmetric parts. This is done for hexahedra; prisms and
//! tetrahedra with such functions stay undecided.
//!
//! Rounding is covered by a margin that grows with the conditioning of the conversion to Bernstein form; it is an estimate,
//! not interval arithmetic.

use super::basis::Basis;
use super::batches::in_frame;
use super::functions::{Table, line_table, tetrahedron_table, triangle_table};
use super::space::{Kind, Space};
use crate::linalg::vector3::{Columns, add, apply, cofactor, dot, times};
use crate::mesh::mixed::Shape;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// What could be shown of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The determinant, against the reference, is at least this everywhere.
    Positive(f64),
    /// At this canonical point the determinant is this, and not positive.
    Negative([f64; 3], f64),
    /// Neither: the parts allowed were used up, or no bound is known for these functions.
    Undecided,
}

/// The conversions that cells of one basis share.
pub struct Certifier {
    basis: &'static dyn Basis,
    /// Most parts a cell is cut into.
    most: usize,
    /// By degree: points of the unit interval and the matrix from values there to Bernstein coefficients.
    lines: BTreeMap<usize, (Vec<f64>, DMatrix<f64>)>,
    triangles: BTreeMap<usize, (Vec<[f64; 2]>, DMatrix<f64>)>,
    tetrahedra: BTreeMap<usize, (Vec<[f64; 3]>, DMatrix<f64>)>,
    /// Functions on dyadic intervals: `(order, level, index)`.
    intervals: BTreeMap<(usize, u32, u32), Interval>,
}

/// The line functions of an order on an interval in Bernstein form.
#[derive(Clone)]
struct Interval {
    /// `degree + 1` coefficients a function.
    values: Vec<f64>,
    slopes: Vec<f64>,
    /// Bounds of the error of each function and of its derivative.
    value_errors: Vec<f64>,
    slope_errors: Vec<f64>,
    /// Bounds of their size.
    value_sizes: Vec<f64>,
    slope_sizes: Vec<f64>,
    degree: usize,
}

/// Relative error of a conversion whose inverse matrix has this norm.
fn rounding(norm: f64) -> f64 {
    1e-15 * norm
}

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
                        .entry(kind.order)
                        .or_insert_with(|| triangle_conversion(kind.order));
                }
                Shape::Tetrahedron => {
                    result
                        .tetrahedra
                        .entry(kind.order)
                        .or_insert_with(|| tetrahedron_conversion(kind.order));
                }
            }
            if kind.shape == Shape::Hexahedron {
                // The coarsest intervals serve every cell.
                for level in 0..3 {
                    for index in 0..1 << level {
                        let interval = result.interval(kind.order, level, index);
                        result.intervals.insert((kind.order, level, index), interval);
                    }
                }
            }
        }
        result
    }

    /// Whether all functions of an order are polynomials.
    fn polynomial(&self, order: usize) -> bool {
        (1..order).all(|j| self.basis.frequency(j).unwrap_or(0.0) == 0.0)
    }

    /// Degree of the polynomials that stand for the line functions.
    fn degree(&self, order: usize) -> usize {
        if self.polynomial(order) {
            order
        } else {
            (order + 3).max(6)
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
            Shape::Hexahedron => self.hexahedron(slots.kind.order, &coefficients, &inverse),
            _ if !self.polynomial(slots.kind.order) => Verdict::Undecided,
            Shape::Prism => self.prism(slots.kind, &coefficients, &inverse),
            Shape::Tetrahedron => self.tetrahedron(slots.kind.order, &coefficients, &inverse),
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

    fn interval(&self, order: usize, level: u32, index: u32) -> Interval {
        if let Some(known) = self.intervals.get(&(order, level, index)) {
            return known.clone();
        }
        let degree = self.degree(order);
        let (points, convert) = &self.lines[&degree];
        let width = 0.5_f64.powi(level as i32);
        let start = f64::from(index) * width;
        let places: Vec<f64> = points.iter().map(|t| start + width * t).collect();
        let table = line_table(self.basis, order, &places);
        let norm = row_norm(convert);
        let mut result = Interval {
            values: Vec::new(),
            slopes: Vec::new(),
            value_errors: Vec::new(),
            slope_errors: Vec::new(),
            value_sizes: Vec::new(),
            slope_sizes: Vec::new(),
            degree,
        };
        let radius = 0.5 * width;
        // |f - interpolant| <= max |f^(m+1)| r^(m+1) / (2^m (m+1)!).
        let share: f64 = (1..=degree + 1).map(|k| radius / k as f64).product::<f64>() / 2.0_f64.powi(degree as i32);
        for function in 0..=order {
            let frequency = match function {
                0 | 1 => 0.0,
                j => self.basis.frequency(j - 1).unwrap_or(0.0) * std::f64::consts::PI,
            };
            let (value_error, slope_error) = if frequency == 0.0 {
                (0.0, 0.0)
            } else {
                let bound = std::f64::consts::SQRT_2 * frequency.powi(degree as i32) * share;
                (bound, bound * frequency)
            };
            for (entries, out, errors, sizes, error) in [
                (
                    &table.values,
                    &mut result.values,
                    &mut result.value_errors,
                    &mut result.value_sizes,
                    value_error,
                ),
                (
                    &table.derivatives[0],
                    &mut result.slopes,
                    &mut result.slope_errors,
                    &mut result.slope_sizes,
                    slope_error,
                ),
            ] {
                let sampled: Vec<f64> = (0..=degree)
                    .map(|point| entries[point * table.functions + function])
                    .collect();
                let size = sampled.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                let mut largest = 0.0_f64;
                for row in 0..=degree {
                    let value: f64 = (0..=degree)
                        .map(|column| convert[(row, column)] * sampled[column])
                        .sum();
                    largest = largest.max(value.abs());
                    out.push(value);
                }
                let error = error + rounding(norm) * size;
                errors.push(error);
                sizes.push(largest + error);
            }
        }
        result
    }

    fn hexahedron(&self, order: usize, coefficients: &[[f64; 3]], inverse: &Columns<f64>) -> Verdict {
        let n = order + 1;
        let mut stack = vec![([0_u32; 3], 0_u32)];
        let (mut parts, mut bound) = (0, f64::INFINITY);
        // Rounding in the sums, relative to the sizes of the terms.
        const SUMS: f64 = 1e-14;
        let mut control: Vec<Columns<f64>> = Vec::new();
        while let Some((place, level)) = stack.pop() {
            parts += 1;
            let intervals = place.map(|index| self.interval(order, level, index));
            let degree = intervals[0].degree;
            let m = degree + 1;
            control.clear();
            control.resize(m * m * m, [[0.0; 3]; 3]);
            let mut error = 0.0;
            for direction in 0..3 {
                let pick = |axis: usize| {
                    let interval = &intervals[axis];
                    if axis == direction {
                        (&interval.slopes, &interval.slope_errors, &interval.slope_sizes)
                    } else {
                        (&interval.values, &interval.value_errors, &interval.value_sizes)
                    }
                };
                let (first, second, third) = (pick(0), pick(1), pick(2));
                // Third index, then second, then first.
                let mut a = vec![[0.0; 3]; n * n * m];
                for ij in 0..n * n {
                    for k in 0..n {
                        let c = coefficients[ij * n + k];
                        if c != [0.0; 3] {
                            for z in 0..m {
                                a[ij * m + z] = add(a[ij * m + z], times(c, third.0[k * m + z]));
                            }
                        }
                    }
                }
                let mut b = vec![[0.0; 3]; n * m * m];
                for i in 0..n {
                    for j in 0..n {
                        for y in 0..m {
                            let weight = second.0[j * m + y];
                            for z in 0..m {
                                let out = &mut b[(i * m + y) * m + z];
                                *out = add(*out, times(a[(i * n + j) * m + z], weight));
                            }
                        }
                    }
                }
                for i in 0..n {
                    for x in 0..m {
                        let weight = first.0[i * m + x];
                        for yz in 0..m * m {
                            let out = &mut control[x * m * m + yz][direction];
                            *out = add(*out, times(b[i * m * m + yz], weight));
                        }
                    }
                }
                let mut column = [0.0; 3];
                for i in 0..n {
                    for j in 0..n {
                        for k in 0..n {
                            let c = coefficients[(i * n + j) * n + k];
                            let (low, high) = (
                                first.2[i] * second.2[j] * third.2[k],
                                (first.2[i] + first.1[i]) * (second.2[j] + second.1[j]) * (third.2[k] + third.1[k]),
                            );
                            for axis in 0..3 {
                                column[axis] += c[axis].abs() * (high - low + SUMS * high);
                            }
                        }
                    }
                }
                error += dot(column, column);
            }
            let width = 0.5_f64.powi(level as i32);
            let corner = place.map(|index| f64::from(index) * width);
            match self.part(&mut control, error.sqrt(), inverse) {
                Some(least) => bound = bound.min(least),
                None => {
                    // The control matrices at the corners are the Jacobian's values there, up to the error.
                    for i in 0..3 {
                        for j in 0..3 {
                            for k in 0..3 {
                                let point = [i, j, k];
                                let at: [f64; 3] =
                                    std::array::from_fn(|axis| corner[axis] + 0.5 * width * point[axis] as f64);
                                let value = self.hexahedron_determinant(order, coefficients, inverse, at);
                                if !(value > NEGATIVE) {
                                    return Verdict::Negative(at, value);
                                }
                            }
                        }
                    }
                    if parts + stack.len() + 8 > self.most || level > 20 {
                        return Verdict::Undecided;
                    }
                    for child in 0..8_u32 {
                        let half = [child & 1, child >> 1 & 1, child >> 2];
                        stack.push((std::array::from_fn(|axis| 2 * place[axis] + half[axis]), level + 1));
                    }
                }
            }
        }
        Verdict::Positive(bound)
    }

    fn hexahedron_determinant(
        &self,
        order: usize,
        coefficients: &[[f64; 3]],
        inverse: &Columns<f64>,
        point: [f64; 3],
    ) -> f64 {
        let n = order + 1;
        let lines = point.map(|x| line_table(self.basis, order, &[x]));
        let mut raw = [[0.0; 3]; 3];
        for i in 0..n {
            for j in 0..n {
                for k in 0..n {
                    let c = coefficients[(i * n + j) * n + k];
                    for (direction, column) in raw.iter_mut().enumerate() {
                        let factor = |axis: usize, function: usize| {
                            if axis == direction {
                                lines[axis].derivatives[0][function]
                            } else {
                                lines[axis].values[function]
                            }
                        };
                        *column = add(*column, times(c, factor(0, i) * factor(1, j) * factor(2, k)));
                    }
                }
            }
        }
        determinant(&apply_right(&raw, inverse))
    }

    fn prism(&self, kind: Kind, coefficients: &[[f64; 3]], inverse: &Columns<f64>) -> Verdict {
        let order = kind.order;
        let (line_points, line_convert) = &self.lines[&order];
        let (nodes, convert) = &self.triangles[&order];
        let (m, t) = (line_points.len(), nodes.len());
        let norm = row_norm(line_convert) * row_norm(convert);
        let whole = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let mut stack = vec![(whole, 0.0, 1.0, 0)];
        let (mut parts, mut bound) = (0, f64::INFINITY);
        while let Some((corners, low, high, level)) = stack.pop() {
            parts += 1;
            let points: Vec<[f64; 2]> = nodes.iter().map(|&[u, v]| in_triangle(&corners, u, v)).collect();
            let heights: Vec<f64> = line_points.iter().map(|s| low + (high - low) * s).collect();
            let lines = line_table(self.basis, order, &heights);
            let tables = [kind.last[0], kind.last[1], 2].map(|last| triangle_table(self.basis, order, last, &points));
            let mut sampled = vec![[[0.0; 3]; 3]; t * m];
            let mut size = 0.0_f64;
            for w in 0..m {
                for point in 0..t {
                    let mut raw = [[0.0; 3]; 3];
                    for level in 0..=order {
                        let (value, slope) = (
                            lines.values[w * (order + 1) + level],
                            lines.derivatives[0][w * (order + 1) + level],
                        );
                        let table: &Table<2> = &tables[level.min(2)];
                        for function in 0..table.functions {
                            let c = coefficients[level * table.functions + function];
                            let place = point * table.functions + function;
                            raw[0] = add(raw[0], times(c, table.derivatives[0][place] * value));
                            raw[1] = add(raw[1], times(c, table.derivatives[1][place] * value));
                            raw[2] = add(raw[2], times(c, table.values[place] * slope));
                        }
                    }
                    if !(determinant(&apply_right(&raw, inverse)) > NEGATIVE) {
                        let [u, v] = points[point];
                        return Verdict::Negative([u, v, heights[w]], determinant(&apply_right(&raw, inverse)));
                    }
                    size = size.max(frobenius(&raw));
                    sampled[w * t + point] = raw;
                }
            }
            // Along the line, then over the triangle.
            let mut along = vec![[[0.0; 3]; 3]; t * m];
            for row in 0..m {
                for w in 0..m {
                    let weight = line_convert[(row, w)];
                    for point in 0..t {
                        accumulate(&mut along[row * t + point], &sampled[w * t + point], weight);
                    }
                }
            }
            let mut control = vec![[[0.0; 3]; 3]; t * m];
            for level in 0..m {
                for row in 0..t {
                    for point in 0..t {
                        accumulate(
                            &mut control[level * t + row],
                            &along[level * t + point],
                            convert[(row, point)],
                        );
                    }
                }
            }
            match self.part(&mut control, rounding(norm) * size, inverse) {
                Some(least) => bound = bound.min(least),
                None if parts + stack.len() + 8 > self.most || level > 20 => return Verdict::Undecided,
                None => {
                    let middle = 0.5 * (low + high);
                    for child in triangle_children(&corners) {
                        stack.push((child, low, middle, level + 1));
                        stack.push((child, middle, high, level + 1));
                    }
                }
            }
        }
        Verdict::Positive(bound)
    }

    fn tetrahedron(&self, order: usize, coefficients: &[[f64; 3]], inverse: &Columns<f64>) -> Verdict {
        let (nodes, convert) = &self.tetrahedra[&order];
        let t = nodes.len();
        let norm = row_norm(convert);
        let whole = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut stack = vec![(whole, 0)];
        let (mut parts, mut bound) = (0, f64::INFINITY);
        while let Some((corners, level)) = stack.pop() {
            parts += 1;
            let points: Vec<[f64; 3]> = nodes.iter().map(|&node| in_tetrahedron(&corners, node)).collect();
            let table = tetrahedron_table(self.basis, order, &points);
            let mut sampled = vec![[[0.0; 3]; 3]; t];
            let mut size = 0.0_f64;
            for point in 0..t {
                let mut raw = [[0.0; 3]; 3];
                for function in 0..table.functions {
                    for (direction, column) in raw.iter_mut().enumerate() {
                        let slope = table.derivatives[direction][point * table.functions + function];
                        *column = add(*column, times(coefficients[function], slope));
                    }
                }
                let value = determinant(&apply_right(&raw, inverse));
                if !(value > NEGATIVE) {
                    return Verdict::Negative(points[point], value);
                }
                size = size.max(frobenius(&raw));
                sampled[point] = raw;
            }
            let mut control = vec![[[0.0; 3]; 3]; t];
            for row in 0..t {
                for point in 0..t {
                    accumulate(&mut control[row], &sampled[point], convert[(row, point)]);
                }
            }
            match self.part(&mut control, rounding(norm) * size, inverse) {
                Some(least) => bound = bound.min(least),
                None if parts + stack.len() + 8 > self.most || level > 20 => return Verdict::Undecided,
                None => stack.extend(tetrahedron_children(&corners).map(|child| (child, level + 1))),
            }
        }
        Verdict::Positive(bound)
    }

    /// Whether the determinant is proved positive on a part from the control matrices there, each wrong by at most `error`
    /// in the Frobenius norm; then a lower bound.
    fn part(&self, control: &mut [Columns<f64>], error: f64, inverse: &Columns<f64>) -> Option<f64> {
        let mut mean = [[0.0; 3]; 3];
        for matrix in control.iter_mut() {
            *matrix = apply_right(matrix, inverse);
            accumulate(&mut mean, matrix, 1.0);
        }
        let mean = mean.map(|column| times(column, 1.0 / control.len() as f64));
        let cof = cofactor(&mean);
        let middle = dot(mean[0], cof[0]);
        if !(middle > 0.0) {
            return None;
        }
        // J0^-1 by rows: row r is cof[r] / det.
        let rows = cof.map(|row| times(row, 1.0 / middle));
        let delta = frobenius(&rows) * frobenius(inverse) * error;
        if !(delta < 0.5) {
            return None;
        }
        let mut least = f64::INFINITY;
        for matrix in control.iter() {
            let m = [0, 1, 2].map(|row| [0, 1, 2].map(|column| dot(rows[row], matrix[column])));
            let entry = |i: usize, j: usize| 0.5 * (m[i][j] + m[j][i]) - if i == j { delta } else { 0.0 };
            let (a, b, c, d, e, f) = (
                entry(0, 0),
                entry(0, 1),
                entry(0, 2),
                entry(1, 1),
                entry(1, 2),
                entry(2, 2),
            );
            let minor = a * d - b * b;
            let whole = f * minor - a * e * e + 2.0 * b * c * e - c * c * d;
            if !(a > 1e-14 && minor > 1e-14 && whole > 1e-14) {
                return None;
            }
            least = least.min(whole);
        }
        Some(middle * least)
    }
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

/// The largest sum of sizes in a row.
fn row_norm(matrix: &DMatrix<f64>) -> f64 {
    matrix
        .row_iter()
        .map(|row| row.iter().map(|entry| entry.abs()).sum::<f64>())
        .fold(0.0, f64::max)
}

fn binomial(n: usize, k: usize) -> f64 {
    (1..=k).map(|i| (n + 1 - i) as f64 / i as f64).product()
}

/// The inverse of a collocation matrix, which is regular for the points used here.
fn inverted(matrix: DMatrix<f64>) -> DMatrix<f64> {
    matrix
        .try_inverse()
        .expect("Bernstein polynomials are independent at these points")
}

/// Chebyshev points of the unit interval.
fn line_conversion(degree: usize) -> (Vec<f64>, DMatrix<f64>) {
    let count = degree + 1;
    let points: Vec<f64> = (0..count)
        .map(|k| 0.5 - 0.5 * ((2 * k + 1) as f64 * std::f64::consts::PI / (2 * count) as f64).cos())
        .collect();
    let matrix = DMatrix::from_fn(count, count, |row, column| {
        let x = points[row];
        binomial(degree, column) * x.powi(column as i32) * (1.0 - x).powi((degree - column) as i32)
    });
    (points, inverted(matrix))
}

/// A lattice of the triangle.
fn triangle_conversion(degree: usize) -> (Vec<[f64; 2]>, DMatrix<f64>) {
    let mut index = Vec::new();
    for i in 0..=degree {
        for j in 0..=degree - i {
            index.push([i, j]);
        }
    }
    let share = |k: usize| k as f64 / degree as f64;
    let points: Vec<[f64; 2]> = index.iter().map(|&[i, j]| [share(i), share(j)]).collect();
    let matrix = DMatrix::from_fn(points.len(), points.len(), |row, column| {
        let ([u, v], [i, j]) = (points[row], index[column]);
        let rest = degree - i - j;
        binomial(degree, i)
            * binomial(degree - i, j)
            * u.powi(i as i32)
            * v.powi(j as i32)
            * (1.0 - u - v).max(0.0).powi(rest as i32)
    });
    (points, inverted(matrix))
}

/// A lattice of the tetrahedron.
fn tetrahedron_conversion(degree: usize) -> (Vec<[f64; 3]>, DMatrix<f64>) {
    let mut index = Vec::new();
    for i in 0..=degree {
        for j in 0..=degree - i {
            for k in 0..=degree - i - j {
                index.push([i, j, k]);
            }
        }
    }
    let share = |k: usize| k as f64 / degree as f64;
    let points: Vec<[f64; 3]> = index.iter().map(|&[i, j, k]| [share(i), share(j), share(k)]).collect();
    let matrix = DMatrix::from_fn(points.len(), points.len(), |row, column| {
        let ([u, v, w], [i, j, k]) = (points[row], index[column]);
        let rest = degree - i - j - k;
        binomial(degree, i)
            * binomial(degree - i, j)
            * binomial(degree - i - j, k)
            * u.powi(i as i32)
            * v.powi(j as i32)
            * w.powi(k as i32)
            * (1.0 - u - v - w).max(0.0).powi(rest as i32)
    });
    (points, inverted(matrix))
}

fn in_triangle(corners: &[[f64; 2]; 3], u: f64, v: f64) -> [f64; 2] {
    [0, 1].map(|axis| (1.0 - u - v) * corners[0][axis] + u * corners[1][axis] + v * corners[2][axis])
}

fn in_tetrahedron(corners: &[[f64; 3]; 4], [u, v, w]: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        (1.0 - u - v - w) * corners[0][axis] + u * corners[1][axis] + v * corners[2][axis] + w * corners[3][axis]
    })
}

fn middle<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]))
}

fn triangle_children(&[a, b, c]: &[[f64; 2]; 3]) -> [[[f64; 2]; 3]; 4] {
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
}

/// Bey's eight: four at the corners, four of the octahedron between.
fn tetrahedron_children(&[a, b, c, d]: &[[f64; 3]; 4]) -> [[[f64; 3]; 4]; 8] {
    let (ab, ac, ad) = (middle(a, b), middle(a, c), middle(a, d));
    let (bc, bd, cd) = (middle(b, c), middle(b, d), middle(c, d));
    [
        [a, ab, ac, ad],
        [ab, b, bc, bd],
        [ac, bc, c, cd],
        [ad, bd, cd, d],
        [ab, ac, ad, bd],
        [ab, ac, bc, bd],
        [ac, ad, bd, cd],
        [ac, bc, bd, cd],
    ]
}
