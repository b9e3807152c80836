//! Bernstein coefficients of the position of a cell whose functions are polynomials.
//!
//! Lines, triangles and tetrahedra have conversions of their own; coefficients of products are contracted factor by
//! factor. Guaranteed: a bound of the position's error. It covers the conversions' rounding.

use super::{Certifier, UNIT, rounding};
use crate::fem::space::Kind;
use crate::linalg::vector3::{add, subtract, times};
use crate::mesh::mixed::Shape;
use nalgebra::DMatrix;

/// The functions of a triangle or tetrahedron in Bernstein form: a row a coefficient, a column a function.
#[derive(Clone, Debug)]
pub(super) struct Converted {
    pub(super) matrix: DMatrix<f64>,
    /// For each function a bound of the error of its coefficients.
    pub(super) errors: Vec<f64>,
}

impl Converted {
    /// From values at the points of a conversion, entry `functions * point + function`.
    pub(super) fn new(conversion: &DMatrix<f64>, norm: f64, functions: usize, values: &[f64]) -> Converted {
        let sampled = DMatrix::from_row_slice(conversion.ncols(), functions, values);
        let sizes = sampled.column_iter().map(|column| column.amax());
        let errors = sizes.map(|size| rounding(conversion.ncols(), norm) * size).collect();
        Converted {
            matrix: conversion * sampled,
            errors,
        }
    }
}

impl Certifier {
    /// The coefficients with the origin in the middle of the vertices, where they are small.
    pub(super) fn centred(&self, kind: Kind, coefficients: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let n = kind.order + 1;
        // The functions of the vertices, which add up to 1.
        let vertices: Vec<usize> = match kind.shape {
            Shape::Hexahedron => (0..8)
                .map(|place| ((place >> 2) * n + (place >> 1 & 1)) * n + (place & 1))
                .collect(),
            Shape::Prism => {
                let functions = coefficients.len() / n;
                (0..2)
                    .flat_map(|level| (0..3).map(move |corner| level * functions + corner))
                    .collect()
            }
            Shape::Tetrahedron => (0..4).collect(),
        };
        let sum = vertices
            .iter()
            .fold([0.0; 3], |sum, &vertex| add(sum, coefficients[vertex]));
        let middle = times(sum, 1.0 / vertices.len() as f64);
        let mut own = coefficients.to_vec();
        for vertex in vertices {
            own[vertex] = subtract(own[vertex], middle);
        }
        own
    }

    /// The coefficients of the position by component, and a bound of their error: on the box of these intervals, each a
    /// level and a number, for hexahedra, on the whole cell for others.
    pub(super) fn positions(&self, kind: Kind, own: &[[f64; 3]], box_of: [(u32, u32); 3]) -> (Vec<f64>, f64) {
        let n = kind.order + 1;
        let terms = match kind.shape {
            Shape::Hexahedron => 3 * n,
            Shape::Prism => own.len() / n + n,
            Shape::Tetrahedron => own.len(),
        };
        // Rounding in the sums, relative to the sizes of the terms.
        let sums = (terms + 10) as f64 * UNIT;
        let mut error = [0.0; 3];
        let mut term = |c: [f64; 3], size: f64, wrong: f64| {
            for (error, c) in error.iter_mut().zip(c) {
                *error += c.abs() * (wrong + sums * size);
            }
        };
        let list: Vec<[f64; 3]> = match kind.shape {
            Shape::Hexahedron => {
                let lines = box_of.map(|(level, index)| self.interval(kind.order, level, index));
                for (place, &c) in own.iter().enumerate() {
                    let functions = [place / (n * n), place / n % n, place % n];
                    let (mut high, mut low) = (1.0, 1.0);
                    for (line, function) in lines.iter().zip(functions) {
                        high *= line.value_sizes[function];
                        low *= line.value_sizes[function] - line.value_errors[function];
                    }
                    term(c, high, high - low);
                }
                let last = contract(own, n * n, &lines[2].values, n, 1);
                let second = contract(&last, n, &lines[1].values, n, n);
                contract(&second, 1, &lines[0].values, n, n * n)
            }
            Shape::Prism => {
                let line = self.interval(kind.order, 0, 0);
                let functions = own.len() / n;
                let mut levels = Vec::with_capacity(own.len());
                for (level, own) in own.chunks_exact(functions).enumerate() {
                    let triangle = &self.triangle_functions[&(kind.order, prism_last(kind, level))];
                    levels.extend(products(&triangle.matrix, own));
                    for (function, &c) in own.iter().enumerate() {
                        let (most, wrong) = (triangle.matrix.column(function).amax(), triangle.errors[function]);
                        let high = (most + wrong) * line.value_sizes[level];
                        let low = most * (line.value_sizes[level] - line.value_errors[level]);
                        term(c, high, high - low);
                    }
                }
                let across = levels.len() / n;
                contract(&levels, 1, &line.values, n, across)
            }
            Shape::Tetrahedron => {
                let converted = &self.tetrahedron_functions[&kind.order];
                for (function, &c) in own.iter().enumerate() {
                    let wrong = converted.errors[function];
                    term(c, converted.matrix.column(function).amax() + wrong, wrong);
                }
                products(&converted.matrix, own)
            }
        };
        let positions = (0..3)
            .flat_map(|axis| list.iter().map(move |point| point[axis]))
            .collect();
        (positions, error.into_iter().fold(0.0, f64::max))
    }
}

/// The triangle functions of a level of line functions: bottom, top and within may differ.
pub(super) fn prism_last(kind: Kind, level: usize) -> usize {
    [kind.last[0], kind.last[1], 2][level.min(2)]
}

/// `sum_f matrix[row][f] c[f]` for every row.
fn products(matrix: &DMatrix<f64>, c: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut result = vec![[0.0; 3]; matrix.nrows()];
    for (column, &c) in matrix.column_iter().zip(c) {
        for (sum, &weight) in result.iter_mut().zip(column.iter()) {
            *sum = add(*sum, times(c, weight));
        }
    }
    result
}

/// `sum_f input[o][f][i] weights[n f + row]` at `[o][row][i]`, where f and row run below n.
fn contract(input: &[[f64; 3]], outer: usize, weights: &[f64], n: usize, inner: usize) -> Vec<[f64; 3]> {
    let mut result = vec![[0.0; 3]; input.len()];
    for o in 0..outer {
        for f in 0..n {
            let from = &input[(o * n + f) * inner..(o * n + f + 1) * inner];
            for row in 0..n {
                let weight = weights[f * n + row];
                let to = &mut result[(o * n + row) * inner..(o * n + row + 1) * inner];
                for (sum, &value) in to.iter_mut().zip(from) {
                    *sum = add(*sum, times(value, weight));
                }
            }
        }
    }
    result
}
