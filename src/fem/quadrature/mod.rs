//! Quadrature on the canonical cells: points and weights that keep their product structure.
//!
//! Exactness for `n` points a direction: Gauss for every variable of a hexahedron up to degree `2n - 1`, and for total
//! degree `2n - 1` in triangles and tetrahedra (collapsed Gauss-Jacobi points); Lobatto up to degree `2n - 3` a variable,
//! but in triangles and tetrahedra, where it is Gauss with a tenth of the lattice's vertex rule, for linear functions
//! only; the trapezoid rule for linear functions, and for products of two of the cosines `cos(j pi x)` with `j + k < 2
//! (n - 1)`.

pub mod line;
pub mod simplex;

use crate::mesh::mixed::Shape;

/// Points in `[0, 1]` with weights that sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub points: Vec<f64>,
    pub weights: Vec<f64>,
}

/// Points in the canonical triangle (`N = 2`) or tetrahedron (`N = 3`).
#[derive(Clone, Debug, PartialEq)]
pub struct Scattered<const N: usize> {
    pub points: Vec<[f64; N]>,
    pub weights: Vec<f64>,
}

/// A rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    Gauss,
    Lobatto,
    Trapezoid,
}

/// Every rule with its meaning, the default first.
pub const RULES: &[(&str, Rule, &str)] = &[
    (
        "lobatto",
        Rule::Lobatto,
        "Gauss-Lobatto, with points on faces, edges and corners; Gauss and a tenth of a lattice in triangles and tetrahedra",
    ),
    (
        "gauss",
        Rule::Gauss,
        "Gauss-Legendre; collapsed Gauss-Jacobi in triangles and tetrahedra",
    ),
    (
        "trapezoid",
        Rule::Trapezoid,
        "trapezoid rule, on simplices the vertex rule of a lattice (Jin et al. 2013)",
    ),
];

/// Quadrature of a cell.
#[derive(Clone, Debug, PartialEq)]
pub enum CellQuadrature {
    /// The third power of a rule on a line, third coordinate fastest.
    Hexahedron(Line),
    /// A triangle times a line; the triangle's points run fastest.
    Prism(Scattered<2>, Line),
    Tetrahedron(Scattered<3>),
}

impl Rule {
    /// The rule with `n` points on a line.
    ///
    /// # Panics
    /// With fewer than 2 points, or 1 for Gauss.
    pub fn line(self, n: usize) -> Line {
        match self {
            Rule::Gauss => line::gauss(n),
            Rule::Lobatto => line::lobatto(n),
            Rule::Trapezoid => line::trapezoid(n),
        }
    }

    /// The rule with `n` points a direction on a triangle.
    pub fn triangle(self, n: usize) -> Scattered<2> {
        match self {
            Rule::Gauss => simplex::gauss_triangle(n),
            Rule::Lobatto => simplex::mixed(simplex::gauss_triangle(n), simplex::lattice_triangle(n)),
            Rule::Trapezoid => simplex::lattice_triangle(n),
        }
    }

    /// The rule with `n` points a direction on a cell.
    pub fn cell(self, shape: Shape, n: usize) -> CellQuadrature {
        match shape {
            Shape::Hexahedron => CellQuadrature::Hexahedron(self.line(n)),
            Shape::Prism => CellQuadrature::Prism(self.triangle(n), self.line(n)),
            Shape::Tetrahedron => CellQuadrature::Tetrahedron(match self {
                Rule::Gauss => simplex::gauss_tetrahedron(n),
                Rule::Lobatto => simplex::mixed(simplex::gauss_tetrahedron(n), simplex::lattice_tetrahedron(n)),
                Rule::Trapezoid => simplex::lattice_tetrahedron(n),
            }),
        }
    }
}

impl CellQuadrature {
    /// The number of points.
    pub fn len(&self) -> usize {
        match self {
            CellQuadrature::Hexahedron(line) => line.points.len().pow(3),
            CellQuadrature::Prism(triangle, line) => triangle.points.len() * line.points.len(),
            CellQuadrature::Tetrahedron(scattered) => scattered.points.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Point and weight of every node, in order.
    pub fn nodes(&self) -> Vec<([f64; 3], f64)> {
        let mut nodes = Vec::with_capacity(self.len());
        match self {
            CellQuadrature::Hexahedron(line) => {
                for (&u, &a) in line.points.iter().zip(&line.weights) {
                    for (&v, &b) in line.points.iter().zip(&line.weights) {
                        for (&w, &c) in line.points.iter().zip(&line.weights) {
                            nodes.push(([u, v, w], a * b * c));
                        }
                    }
                }
            }
            CellQuadrature::Prism(triangle, line) => {
                for (&w, &b) in line.points.iter().zip(&line.weights) {
                    for (&[u, v], &a) in triangle.points.iter().zip(&triangle.weights) {
                        nodes.push(([u, v, w], a * b));
                    }
                }
            }
            CellQuadrature::Tetrahedron(scattered) => {
                nodes.extend(scattered.points.iter().copied().zip(scattered.weights.iter().copied()));
            }
        }
        nodes
    }
}
