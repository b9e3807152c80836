//! The hierarchical functions of a cell, tabulated at points.
//!
//! With barycentric coordinates l, `E_ab,j = l_a l_b kappa_j(l_b - l_a)` continues the bubble of an edge into the cell:
//! on the edge it is `b_j(l_b)`, on every other side zero. Then
//! - hexahedron: products of three line functions, `1 - x, x, b_1, b_2, ...`;
//! - triangle: `l_a`; `E_ab,j`; inside `E_ab,j l_c c_k(l_c)`, `j >= 1, k >= 0, j + k <= p - 2`;
//! - prism: a triangle function times a line function; triangles inside may choose c on bottom, top and within apart;
//! - tetrahedron: as the triangle, and inside `E_ab,i l_c c_j(l_c) l_d c_k(l_d)`, `i + j + k <= p - 3`.
//!
//! On both simplices the polynomials span all of degree p. A triangle shared by two cells takes a, b, c by ascending
//! vertex number, an edge runs from the smaller to the larger: so the functions of both cells agree on it.

use super::basis::Basis;
use super::quadrature::CellQuadrature;
use super::space::Kind;
use std::ops::{Add, Mul, Sub};

/// Local corners of a triangle's edges in the order of its functions.
pub const TRIANGLE_EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// Values and derivatives of functions at points: entry `functions * point + function`.
#[derive(Clone, Debug, PartialEq)]
pub struct Table<const N: usize> {
    pub points: usize,
    pub functions: usize,
    pub values: Vec<f64>,
    pub derivatives: [Vec<f64>; N],
}

impl<const N: usize> Table<N> {
    fn new(functions: usize) -> Self {
        Table {
            points: 0,
            functions,
            values: Vec::new(),
            derivatives: std::array::from_fn(|_| Vec::new()),
        }
    }

    fn push(&mut self, row: &[Dual<N>]) {
        assert_eq!(row.len(), self.functions, "as many functions as announced");
        self.points += 1;
        for function in row {
            self.values.push(function.value);
            for (derivatives, slope) in self.derivatives.iter_mut().zip(function.slopes) {
                derivatives.push(slope);
            }
        }
    }
}

/// A value with its derivatives by N coordinates.
#[derive(Clone, Copy, Debug)]
struct Dual<const N: usize> {
    value: f64,
    slopes: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// `f(self)` for `f` given by value and derivative there.
    fn of(self, [value, slope]: [f64; 2]) -> Self {
        Dual {
            value,
            slopes: self.slopes.map(|own| slope * own),
        }
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    // The product rule is a sum.
    #[allow(clippy::suspicious_arithmetic_impl)]
    fn mul(self, other: Self) -> Self {
        Dual {
            value: self.value * other.value,
            slopes: std::array::from_fn(|d| self.slopes[d] * other.value + self.value * other.slopes[d]),
        }
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Dual {
            value: self.value + other.value,
            slopes: std::array::from_fn(|d| self.slopes[d] + other.slopes[d]),
        }
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Dual {
            value: self.value - other.value,
            slopes: std::array::from_fn(|d| self.slopes[d] - other.slopes[d]),
        }
    }
}

/// Barycentric coordinates of a point of the canonical simplex.
fn barycentric<const N: usize, const M: usize>(point: [f64; N]) -> [Dual<N>; M] {
    std::array::from_fn(|corner| match corner {
        0 => Dual {
            value: 1.0 - point.iter().sum::<f64>(),
            slopes: [-1.0; N],
        },
        _ => Dual {
            value: point[corner - 1],
            slopes: std::array::from_fn(|d| if d + 1 == corner { 1.0 } else { 0.0 }),
        },
    })
}

/// The exponents `(j, k)` of the functions inside a triangle, in order.
pub fn triangle_inside(order: usize) -> Vec<[usize; 2]> {
    let mut inside = Vec::new();
    for j in 1..order.saturating_sub(1) {
        for k in 0..order - 1 - j {
            inside.push([j, k]);
        }
    }
    inside
}

/// The exponents `(i, j, k)` of the functions inside a tetrahedron, in order.
pub fn tetrahedron_inside(order: usize) -> Vec<[usize; 3]> {
    let mut inside = Vec::new();
    for i in 1..order.saturating_sub(2) {
        for j in 0..order - 2 - i {
            for k in 0..order - 2 - i - j {
                inside.push([i, j, k]);
            }
        }
    }
    inside
}

/// Number of functions of a triangle.
pub fn triangle_functions(order: usize) -> usize {
    (order + 1) * (order + 2) / 2
}

/// Number of functions of a tetrahedron.
pub fn tetrahedron_functions(order: usize) -> usize {
    (order + 1) * (order + 2) * (order + 3) / 6
}

/// The functions `1 - x, x, b_1, ..., b_(p-1)` on `[0, 1]`.
pub fn line_table(basis: &dyn Basis, order: usize, points: &[f64]) -> Table<1> {
    let mut table = Table::new(order + 1);
    for &x in points {
        let mut row = vec![
            Dual {
                value: 1.0 - x,
                slopes: [-1.0],
            },
            Dual {
                value: x,
                slopes: [1.0],
            },
        ];
        for j in 1..order {
            let [value, slope] = basis.bubble(j, x);
            row.push(Dual { value, slopes: [slope] });
        }
        table.push(&row);
    }
    table
}

/// The functions of a triangle: corners, edges by [`TRIANGLE_EDGES`], then inside with `c = last`, a and b being the
/// other two in ascending order. `edge(a, b, j)` is `E_ab,j` and `weighted(c, k)` is `l_c c_k(l_c)`, as numbers or
/// whatever is to be known of them.
pub fn triangle_row<T: Copy + Mul<Output = T>>(
    order: usize,
    last: usize,
    corners: &[T; 3],
    edge: impl Fn(usize, usize, usize) -> T,
    weighted: impl Fn(usize, usize) -> T,
) -> Vec<T> {
    let [a, b] = [[1, 2], [0, 2], [0, 1]][last];
    let mut row = corners.to_vec();
    for [a, b] in TRIANGLE_EDGES {
        row.extend((1..order).map(|j| edge(a, b, j)));
    }
    row.extend(
        triangle_inside(order)
            .iter()
            .map(|&[j, k]| edge(a, b, j) * weighted(last, k)),
    );
    row
}

/// The functions of a tetrahedron whose corners are in ascending order: corners, edges and faces as
/// [`Shape::edges`](crate::mesh::mixed::Shape::edges) and faces 012, 013, 023, 123, inside; the rest as in
/// [`triangle_row`].
pub fn tetrahedron_row<T: Copy + Mul<Output = T>>(
    order: usize,
    corners: &[T; 4],
    edge: impl Fn(usize, usize, usize) -> T,
    weighted: impl Fn(usize, usize) -> T,
) -> Vec<T> {
    let mut row = corners.to_vec();
    for [a, b] in [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]] {
        row.extend((1..order).map(|j| edge(a, b, j)));
    }
    let faces = triangle_inside(order);
    for [a, b, c] in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] {
        row.extend(faces.iter().map(|&[j, k]| edge(a, b, j) * weighted(c, k)));
    }
    let inside = tetrahedron_inside(order);
    row.extend(
        inside
            .iter()
            .map(|&[i, j, k]| edge(0, 1, i) * weighted(2, j) * weighted(3, k)),
    );
    row
}

/// The functions of a triangle as in [`triangle_row`] at points.
pub fn triangle_table(basis: &dyn Basis, order: usize, last: usize, points: &[[f64; 2]]) -> Table<2> {
    let mut table = Table::new(triangle_functions(order));
    for &point in points {
        let l: [Dual<2>; 3] = barycentric(point);
        table.push(&triangle_row(
            order,
            last,
            &l,
            |a, b, j| edge_function(basis, l[a], l[b], j),
            |c, k| l[c] * l[c].of(basis.factor(k, l[c].value)),
        ));
    }
    table
}

/// The functions of a tetrahedron as in [`tetrahedron_row`] at points.
pub fn tetrahedron_table(basis: &dyn Basis, order: usize, points: &[[f64; 3]]) -> Table<3> {
    let mut table = Table::new(tetrahedron_functions(order));
    for &point in points {
        let l: [Dual<3>; 4] = barycentric(point);
        table.push(&tetrahedron_row(
            order,
            &l,
            |a, b, j| edge_function(basis, l[a], l[b], j),
            |c, k| l[c] * l[c].of(basis.factor(k, l[c].value)),
        ));
    }
    table
}

/// `E_ab,j`.
fn edge_function<const N: usize>(basis: &dyn Basis, la: Dual<N>, lb: Dual<N>, j: usize) -> Dual<N> {
    let along = lb - la;
    la * lb * along.of(basis.kernel(j, along.value.clamp(-1.0, 1.0)))
}

/// All local functions of a kind of cell at the nodes of a quadrature, in the order of the cell's slots.
pub fn cell_table(basis: &dyn Basis, kind: Kind, quadrature: &CellQuadrature) -> Table<3> {
    let mut table = Table::new(kind.functions());
    match quadrature {
        CellQuadrature::Hexahedron(line) => {
            let lines = line_table(basis, kind.order, &line.points);
            let (q, n) = (lines.points, lines.functions);
            let [slopes] = &lines.derivatives;
            for u in 0..q {
                for v in 0..q {
                    for w in 0..q {
                        let mut row = Vec::with_capacity(n * n * n);
                        for i in 0..n {
                            for j in 0..n {
                                for k in 0..n {
                                    let (a, b, c) = (u * n + i, v * n + j, w * n + k);
                                    let values = &lines.values;
                                    row.push(Dual {
                                        value: values[a] * values[b] * values[c],
                                        slopes: [
                                            slopes[a] * values[b] * values[c],
                                            values[a] * slopes[b] * values[c],
                                            values[a] * values[b] * slopes[c],
                                        ],
                                    });
                                }
                            }
                        }
                        table.push(&row);
                    }
                }
            }
        }
        CellQuadrature::Prism(triangle, line) => {
            let lines = line_table(basis, kind.order, &line.points);
            let levels =
                [kind.last[0], kind.last[1], 2].map(|last| triangle_table(basis, kind.order, last, &triangle.points));
            let n = lines.functions;
            for w in 0..lines.points {
                for point in 0..triangle.points.len() {
                    let mut row = Vec::new();
                    for level in 0..n {
                        let triangles = &levels[level.min(2)];
                        let (value, slope) = (lines.values[w * n + level], lines.derivatives[0][w * n + level]);
                        for t in 0..triangles.functions {
                            let place = point * triangles.functions + t;
                            row.push(Dual {
                                value: triangles.values[place] * value,
                                slopes: [
                                    triangles.derivatives[0][place] * value,
                                    triangles.derivatives[1][place] * value,
                                    triangles.values[place] * slope,
                                ],
                            });
                        }
                    }
                    table.push(&row);
                }
            }
        }
        CellQuadrature::Tetrahedron(scattered) => return tetrahedron_table(basis, kind.order, &scattered.points),
    }
    table
}
