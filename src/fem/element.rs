//! Jacobians of eight cells of one kind at all points of a product of points, and the transposed sums, in vector lanes.
//!
//! Hexahedra go by sum factorization: one index of the coefficients after the other is replaced by points, which costs
//! `O(n^4)` instead of `O(n^6)`. Prisms contract the triangle, then the line. Tetrahedra use dense tables.

use super::basis::Basis;
use super::contraction::Contraction;
use super::functions::{Table, line_table, tetrahedron_table, triangle_table};
use super::quadrature::CellQuadrature;
use super::space::Kind;
use crate::linalg::lanes::Lanes;
use crate::linalg::processor::Processor;
use crate::mesh::mixed::Shape;

/// A matrix and its transpose.
struct Matrix {
    rows: usize,
    columns: usize,
    forward: Vec<f64>,
    backward: Vec<f64>,
}

impl Matrix {
    fn new(rows: usize, columns: usize, entries: &[f64]) -> Matrix {
        let mut backward = vec![0.0; rows * columns];
        for row in 0..rows {
            for column in 0..columns {
                backward[column * rows + row] = entries[row * columns + column];
            }
        }
        Matrix {
            rows,
            columns,
            forward: entries.to_vec(),
            backward,
        }
    }

    fn of<const N: usize>(table: &Table<N>, entries: &[f64]) -> Matrix {
        Matrix::new(table.points, table.functions, entries)
    }

    fn apply(&self, processor: Processor, outer: usize, inner: usize, input: &[Lanes], output: &mut [Lanes]) {
        processor.run(Contraction {
            matrix: &self.forward,
            rows: self.rows,
            columns: self.columns,
            outer,
            inner,
            input,
            output,
            add: false,
        });
    }

    fn transposed(
        &self,
        processor: Processor,
        outer: usize,
        inner: usize,
        input: &[Lanes],
        output: &mut [Lanes],
        add: bool,
    ) {
        processor.run(Contraction {
            matrix: &self.backward,
            rows: self.columns,
            columns: self.rows,
            outer,
            inner,
            input,
            output,
            add,
        });
    }
}

enum Factors {
    Hexahedron {
        values: Matrix,
        slopes: Matrix,
    },
    Prism {
        /// Value, derivatives by u and v of the triangle functions, for the bottom, the top and all other levels.
        triangles: Box<[[Matrix; 3]; 3]>,
        values: Matrix,
        slopes: Matrix,
    },
    /// Values, then derivatives.
    Tetrahedron([Matrix; 4]),
}

/// The tables of one kind of cell at given points.
pub struct Element {
    kind: Kind,
    points: usize,
    factors: Factors,
}

/// Room for intermediate sums; grows to what the largest element needs.
#[derive(Default)]
pub struct Room {
    a: Vec<Lanes>,
    b: Vec<Lanes>,
    c: Vec<Lanes>,
    d: Vec<Lanes>,
    e: Vec<Lanes>,
}

/// At least `size` lanes; what is in them is not defined.
fn room(buffer: &mut Vec<Lanes>, size: usize) -> &mut [Lanes] {
    if buffer.len() < size {
        buffer.resize(size, Lanes::ZERO);
    }
    &mut buffer[..size]
}

impl Element {
    /// The tables of a kind of cell at the nodes of a quadrature for its shape.
    pub fn new(basis: &dyn Basis, kind: Kind, quadrature: &CellQuadrature) -> Element {
        let order = kind.order;
        let factors = match quadrature {
            CellQuadrature::Hexahedron(line) => {
                let table = line_table(basis, order, &line.points);
                Factors::Hexahedron {
                    values: Matrix::of(&table, &table.values),
                    slopes: Matrix::of(&table, &table.derivatives[0]),
                }
            }
            CellQuadrature::Prism(triangle, line) => {
                let table = line_table(basis, order, &line.points);
                let level = |last: usize| {
                    let table = triangle_table(basis, order, last, &triangle.points);
                    [&table.values, &table.derivatives[0], &table.derivatives[1]]
                        .map(|entries| Matrix::of(&table, entries))
                };
                Factors::Prism {
                    triangles: Box::new([level(kind.last[0]), level(kind.last[1]), level(2)]),
                    values: Matrix::of(&table, &table.values),
                    slopes: Matrix::of(&table, &table.derivatives[0]),
                }
            }
            CellQuadrature::Tetrahedron(scattered) => {
                let table = tetrahedron_table(basis, order, &scattered.points);
                let [u, v, w] = &table.derivatives;
                Factors::Tetrahedron([&table.values, u, v, w].map(|entries| Matrix::of(&table, entries)))
            }
        };
        let shape = match quadrature {
            CellQuadrature::Hexahedron(_) => Shape::Hexahedron,
            CellQuadrature::Prism(..) => Shape::Prism,
            CellQuadrature::Tetrahedron(_) => Shape::Tetrahedron,
        };
        assert_eq!(shape, kind.shape, "a quadrature of the cell's shape");
        Element {
            kind,
            points: quadrature.len(),
            factors,
        }
    }

    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The number of points.
    pub fn points(&self) -> usize {
        self.points
    }

    /// The map itself, each place at `3 point + component`.
    pub fn places(&self, processor: Processor, coefficients: &[Lanes], places: &mut [Lanes], rooms: &mut Room) {
        let p = processor;
        match &self.factors {
            Factors::Hexahedron { values, .. } => {
                let (n, q) = (values.columns, values.rows);
                let along = room(&mut rooms.a, 3 * n * n * q);
                values.apply(p, n * n, 3, coefficients, along);
                let plane = room(&mut rooms.c, 3 * n * q * q);
                values.apply(p, n, 3 * q, along, plane);
                values.apply(p, 1, 3 * q * q, plane, places);
            }
            Factors::Prism { triangles, values, .. } => {
                let (n, t, q) = (values.columns, triangles[0][0].columns, triangles[0][0].rows);
                let levels = room(&mut rooms.a, 3 * n * q);
                for level in 0..n {
                    triangles[level.min(2)][0].apply(
                        p,
                        1,
                        3,
                        &coefficients[3 * t * level..3 * t * (level + 1)],
                        &mut levels[3 * q * level..3 * q * (level + 1)],
                    );
                }
                values.apply(p, 1, 3 * q, levels, places);
            }
            Factors::Tetrahedron([values, ..]) => values.apply(p, 1, 3, coefficients, places),
        }
    }

    /// Derivatives of the map by the canonical coordinates, each at `3 point + component`.
    pub fn jacobians(
        &self,
        processor: Processor,
        coefficients: &[Lanes],
        jacobians: &mut [Vec<Lanes>; 3],
        rooms: &mut Room,
    ) {
        let p = processor;
        for direction in jacobians.iter_mut() {
            room(direction, 3 * self.points);
        }
        let [du, dv, dw] = jacobians;
        match &self.factors {
            Factors::Hexahedron { values, slopes } => {
                let (n, q) = (values.columns, values.rows);
                let along = room(&mut rooms.a, 3 * n * n * q);
                let slope = room(&mut rooms.b, 3 * n * n * q);
                values.apply(p, n * n, 3, coefficients, along);
                slopes.apply(p, n * n, 3, coefficients, slope);
                let plane = room(&mut rooms.c, 3 * n * q * q);
                values.apply(p, n, 3 * q, along, plane);
                slopes.apply(p, 1, 3 * q * q, plane, du);
                slopes.apply(p, n, 3 * q, along, plane);
                values.apply(p, 1, 3 * q * q, plane, dv);
                values.apply(p, n, 3 * q, slope, plane);
                values.apply(p, 1, 3 * q * q, plane, dw);
            }
            Factors::Prism {
                triangles,
                values,
                slopes,
            } => {
                let (n, t, q) = (values.columns, triangles[0][0].columns, triangles[0][0].rows);
                let levels = room(&mut rooms.a, 3 * n * q);
                for (part, out) in [(1, &mut *du), (2, &mut *dv)] {
                    for level in 0..n {
                        triangles[level.min(2)][part].apply(
                            p,
                            1,
                            3,
                            &coefficients[3 * t * level..3 * t * (level + 1)],
                            &mut levels[3 * q * level..3 * q * (level + 1)],
                        );
                    }
                    values.apply(p, 1, 3 * q, levels, out);
                }
                for level in 0..n {
                    triangles[level.min(2)][0].apply(
                        p,
                        1,
                        3,
                        &coefficients[3 * t * level..3 * t * (level + 1)],
                        &mut levels[3 * q * level..3 * q * (level + 1)],
                    );
                }
                slopes.apply(p, 1, 3 * q, levels, dw);
            }
            Factors::Tetrahedron([_, u, v, w]) => {
                u.apply(p, 1, 3, coefficients, du);
                v.apply(p, 1, 3, coefficients, dv);
                w.apply(p, 1, 3, coefficients, dw);
            }
        }
    }

    /// The transpose of [`Element::jacobians`]: the derivative by the coefficients of what depends on the Jacobians.
    pub fn gather(
        &self,
        processor: Processor,
        jacobians: &[Vec<Lanes>; 3],
        coefficients: &mut [Lanes],
        rooms: &mut Room,
    ) {
        let p = processor;
        let [du, dv, dw] = jacobians;
        match &self.factors {
            Factors::Hexahedron { values, slopes } => {
                let (n, q) = (values.columns, values.rows);
                let along = room(&mut rooms.a, 3 * n * n * q);
                let slope = room(&mut rooms.b, 3 * n * n * q);
                let plane = room(&mut rooms.c, 3 * n * q * q);
                slopes.transposed(p, 1, 3 * q * q, du, plane, false);
                values.transposed(p, n, 3 * q, plane, along, false);
                values.transposed(p, 1, 3 * q * q, dv, plane, false);
                slopes.transposed(p, n, 3 * q, plane, along, true);
                values.transposed(p, 1, 3 * q * q, dw, plane, false);
                values.transposed(p, n, 3 * q, plane, slope, false);
                values.transposed(p, n * n, 3, along, coefficients, false);
                slopes.transposed(p, n * n, 3, slope, coefficients, true);
            }
            Factors::Prism {
                triangles,
                values,
                slopes,
            } => {
                let (n, t, q) = (values.columns, triangles[0][0].columns, triangles[0][0].rows);
                let levels = [
                    room(&mut rooms.c, 3 * n * q),
                    room(&mut rooms.d, 3 * n * q),
                    room(&mut rooms.e, 3 * n * q),
                ];
                let [by_w, by_u, by_v] = levels;
                slopes.transposed(p, 1, 3 * q, dw, by_w, false);
                values.transposed(p, 1, 3 * q, du, by_u, false);
                values.transposed(p, 1, 3 * q, dv, by_v, false);
                for level in 0..n {
                    let here = 3 * q * level..3 * q * (level + 1);
                    let out = &mut coefficients[3 * t * level..3 * t * (level + 1)];
                    for (part, input) in [&*by_w, &*by_u, &*by_v].into_iter().enumerate() {
                        triangles[level.min(2)][part].transposed(p, 1, 3, &input[here.clone()], out, part > 0);
                    }
                }
            }
            Factors::Tetrahedron([_, u, v, w]) => {
                u.transposed(p, 1, 3, du, coefficients, false);
                v.transposed(p, 1, 3, dv, coefficients, true);
                w.transposed(p, 1, 3, dw, coefficients, true);
            }
        }
    }
}
