//! The discretizations: which fields are unknown at which vertices, and what is known at the others.
//!
//! With `L` the cotangent Laplacian and `M` a mass matrix, `v` stands for the Laplacian of `u` and, for the triharmonic
//! equation, `w` for the Laplacian of `v`. The equations are
//!
//! - order 2: `-M v + L u = -N b1` wherever `v` is unknown, `L v = M g` wherever `u` is (systems 10 and 12);
//! - order 3: `L v - M w = 0` where `v` is unknown, `L w = M g` where `u` is, `-M v + L u + S w = -N b1` where `w` is
//!   (systems 13 and 15; `w` has the sign of the Laplacian of `v`, opposite to the multiplier of the Lagrangian (7)).
//!
//! Known values move to the right. `N b1` integrates the conormal derivative along the boundary, edge by edge with the
//! edge's own normal, because it jumps at corners. `S`, a multiple of the lumped mass `D` on boundary vertices, relaxes
//! their rows, of which there are more than unknowns on the first inner ring; without it system (15) is singular
//! (Proposition 2). Source: Jacobson, Tosun, Sorkine, Zorin 2010, Mixed finite elements for variational surface modeling.
//! The matrix in front of `u_f` in (11) lacks its second term there, and (14) the inverse mass and its sign; both are set
//! right here.
//!
//! The relaxation `S` is ours. Eliminating all but `w` on the boundary leaves `(A + S) w = r`, where `A` smooths by three
//! orders: a wave of number `k` is damped by `k^-3`. The boundary rows of irregular meshes are consistent to `O(h)` at
//! each vertex, at random. Where `A` is weaker than `S`, this noise is divided by `S` alone. A multiple of the lumped
//! mass `D`, `S = c h^2 D` or `S = c h s / 80 D`, is of order `h^3` and `h^2` beside the boundary's own mass, so that `w`
//! comes out with noise of size `1/h` and more, and a little of it is mixed into the smooth part: the error of `u` falls
//! as `h^2` to some 192 cells a unit length on Delaunay meshes with random vertices and more slowly beyond. `S = c h^3
//! s^2 / 100 K` with the stiffness `K` of the boundary curves damps rough `w` by `h` and takes `O(h^3)` away from smooth
//! `w`. The noise is gone from `u`, which converges as `h^2` on every mesh as fine as was tried. Here `s^2` is the
//! area of the connected part of the domain and `h` its mean edge length. `K` is not diagonal: `w` cannot be
//! eliminated with sparse matrices, and there is no one-field system.

use super::domain::{Domain, Place};
use crate::fem::surface::SurfaceOperators;
use crate::mesh::connectivity::{self, NONE};
use crate::mesh::{area_vector, dot, length, subtract};
use crate::method::Failure;

/// Which discretization.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// Fixed rings around the domain, or isolated fixed points: systems (10) and (13).
    Region,
    /// System (12): values and conormal derivatives on the boundary, order 2.
    Curve,
    /// System (15) with relaxed boundary rows, order 3.
    Stabilised,
    /// System (15), order 3.
    Unstabilised,
    /// The paper's reduction to (13): the first inner ring from the conormal derivatives, order 3.
    FirstOrderRing,
    /// The same with second derivatives, order 3.
    SecondOrderRing,
}

impl Scheme {
    /// Whether integrals run over the domain alone.
    pub fn on_domain(self) -> bool {
        self != Self::Region
    }
}

/// How the mass matrix is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mass {
    Hybrid,
    Barycentric,
    Full,
}

/// How much the boundary rows of the stabilised system give way, by the mean edge length `h`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Relaxation {
    /// `c h s / 80 D` with the side `s` of a square of the area of a connected part of the domain.
    Linear,
    /// `c h^2 D`.
    Quadratic,
    /// `c h^3 s^2 / 100 K` with the stiffness matrix `K` of piecewise linear functions on the boundary edges.
    Tangential,
}

/// The relaxation of the boundary rows of the stabilised system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stabilisation {
    pub relaxation: Relaxation,
    /// The factor `c`.
    pub factor: f64,
}

/// Values and derivatives that the conditions prescribe, for several components at once: component `c` of vertex `i`
/// is at `components i + c`.
pub struct Data<'a> {
    pub components: usize,
    /// `u` at every vertex that is not free.
    pub values: Vec<f64>,
    /// The right-hand side `g`, `Laplacian^order u = g`, at every vertex.
    pub source: Vec<f64>,
    /// The conormal derivative at both ends of every boundary edge, `components` numbers for each end.
    pub conormal: Vec<f64>,
    /// The Laplacian of `u` at boundary vertices.
    pub laplacian: Vec<f64>,
    /// First derivatives at a vertex and second ones `[xx, xy, yy]` at a point, where a formula gives them (one
    /// component).
    pub taylor: Option<Taylor<'a>>,
}

/// Derivatives in the plane.
pub struct Taylor<'a> {
    pub gradient: &'a dyn Fn([f64; 2]) -> [f64; 2],
    pub hessian: &'a dyn Fn([f64; 2]) -> [f64; 3],
}

/// A discretized problem: everything that its systems are made of.
pub struct Discretization<'a> {
    pub domain: &'a Domain<'a>,
    pub operators: &'a SurfaceOperators,
    pub mass: Mass,
    pub order: usize,
    pub components: usize,
    /// Which of the fields `u`, `v`, `w` is unknown at a vertex.
    pub unknown: [Vec<bool>; 3],
    /// The fields' known values; zero where unknown or without meaning.
    pub known: [Vec<f64>; 3],
    /// Right-hand side of the rows where `u` is unknown.
    pub load: Vec<f64>,
    /// `N b1`.
    pub flux: Vec<f64>,
    /// `S` by the places of the operators' pattern; empty where nothing is relaxed.
    pub penalty: Vec<f64>,
}

impl<'a> Discretization<'a> {
    /// Sets up a scheme. `stabilisation` counts for the stabilised one alone.
    ///
    /// # Errors
    /// When the domain does not suit the scheme.
    pub fn new(
        domain: &'a Domain<'a>,
        operators: &'a SurfaceOperators,
        scheme: Scheme,
        order: usize,
        mass: Mass,
        stabilisation: Stabilisation,
        data: &Data<'_>,
    ) -> Result<Self, Failure> {
        if scheme == Scheme::Region {
            domain.check_rings(order)?;
            if mass == Mass::Full {
                return Err(Failure::invalid(
                    "region conditions need a lumped mass matrix, because v is known outside the domain only with its \
                     help; use mass = \"hybrid\" or \"barycentric\""
                        .to_string(),
                ));
            }
        } else {
            domain.check_curve()?;
        }
        let vertices = domain.places.len();
        let components = data.components;
        let is = |place: Place| -> Vec<bool> { domain.places.iter().map(|&other| other == place).collect() };
        let interior = is(Place::Interior);
        let closed: Vec<bool> = domain
            .places
            .iter()
            .map(|place| matches!(place, Place::Interior | Place::Boundary))
            .collect();
        let none = vec![false; vertices];
        let mut found = Self {
            domain,
            operators,
            mass,
            order,
            components,
            unknown: [interior.clone(), closed.clone(), none.clone()],
            known: [
                data.values.clone(),
                vec![0.0; vertices * components],
                vec![0.0; vertices * components],
            ],
            load: vec![0.0; vertices * components],
            flux: vec![0.0; vertices * components],
            penalty: Vec::new(),
        };
        for vertex in (0..vertices).filter(|&vertex| interior[vertex]) {
            found.known[0][vertex * components..(vertex + 1) * components].fill(0.0);
        }
        match scheme {
            Scheme::Region if order == 2 => {}
            Scheme::Region => {
                found.unknown[2] = closed;
                let laplacian = found.multiply_laplacian(&data.values);
                let lumped = found.lumped();
                for vertex in (0..vertices).filter(|&vertex| domain.places[vertex] == Place::FirstRing) {
                    for c in 0..components {
                        let at = vertex * components + c;
                        found.known[1][at] = laplacian[at] / lumped[vertex];
                    }
                }
            }
            Scheme::Curve => found.flux = flux(domain, data),
            Scheme::Stabilised | Scheme::Unstabilised => {
                found.unknown[1] = interior.clone();
                found.unknown[2] = closed;
                found.flux = flux(domain, data);
                if scheme == Scheme::Stabilised {
                    found.penalty = stabilisation.matrix(domain, operators);
                }
                for vertex in (0..vertices).filter(|&vertex| domain.places[vertex] == Place::Boundary) {
                    found.known[1][vertex * components..(vertex + 1) * components]
                        .copy_from_slice(&data.laplacian[vertex * components..(vertex + 1) * components]);
                }
            }
            Scheme::FirstOrderRing | Scheme::SecondOrderRing => {
                found.reduce_to_ring(data, scheme == Scheme::SecondOrderRing)?;
            }
        }
        let full = mass == Mass::Full || scheme == Scheme::Stabilised;
        found.load = found.integrate(&data.source, full);
        Ok(found)
    }

    /// Diagonal of the lumped mass matrix; the barycentric one where the mass is not lumped.
    pub fn lumped(&self) -> &'a [f64] {
        match self.mass {
            Mass::Hybrid => &self.operators.hybrid,
            Mass::Barycentric | Mass::Full => &self.operators.barycentric,
        }
    }

    /// Diagonal of `S`.
    pub fn penalty_diagonal(&self) -> Vec<f64> {
        let diagonal = |vertex: u32| self.penalty.get(self.operators.pattern.place(vertex, vertex));
        (0..self.domain.places.len() as u32)
            .map(|vertex| diagonal(vertex).copied().unwrap_or(0.0))
            .collect()
    }

    /// `L x` for all components.
    pub fn multiply_laplacian(&self, x: &[f64]) -> Vec<f64> {
        let components = self.components;
        let mut result = vec![0.0; x.len()];
        for vertex in 0..self.domain.places.len() {
            for place in self.operators.pattern.row(vertex as u32) {
                let other = self.operators.pattern.columns[place] as usize;
                for c in 0..components {
                    result[vertex * components + c] += self.operators.laplacian[place] * x[other * components + c];
                }
            }
        }
        result
    }

    /// `M g` with the full or the chosen lumped mass.
    fn integrate(&self, source: &[f64], full: bool) -> Vec<f64> {
        let components = self.components;
        let mut result = vec![0.0; source.len()];
        let lumped = self.lumped();
        for vertex in (0..self.domain.places.len()).filter(|&vertex| self.unknown[0][vertex]) {
            for c in 0..components {
                let at = vertex * components + c;
                result[at] = if full {
                    self.operators
                        .pattern
                        .row(vertex as u32)
                        .map(|place| {
                            let other = self.operators.pattern.columns[place] as usize;
                            self.operators.mass[place] * source[other * components + c]
                        })
                        .sum()
                } else {
                    lumped[vertex] * source[at]
                };
            }
        }
        result
    }

    /// Fixes `u` on the first ring of vertices within the boundary by a Taylor expansion from it and `v` on the boundary,
    /// which turns the curve conditions into those of system (13).
    fn reduce_to_ring(&mut self, data: &Data<'_>, second_order: bool) -> Result<(), Failure> {
        let domain = self.domain;
        let components = self.components;
        let vertices = domain.places.len();
        let boundary = |vertex: u32| domain.places[vertex as usize] == Place::Boundary;
        let first: Vec<bool> = (0..vertices as u32)
            .map(|vertex| {
                domain.places[vertex as usize] == Place::Interior
                    && domain.graph.neighbours(vertex).iter().any(|&other| boundary(other))
            })
            .collect();
        let hessian = match (&data.taylor, second_order) {
            (Some(taylor), true) => Some(taylor.hessian),
            (None, true) => {
                return Err(Failure::invalid(
                    "the second-order ring needs second derivatives on the boundary, which a formula gives and a surface \
                     does not; use triharmonic-curve = \"stabilised\""
                        .to_string(),
                ));
            }
            (_, false) => None,
        };
        let mut sums = vec![0.0; vertices * components];
        let mut counts = vec![0u32; vertices];
        let place = |vertex: u32| domain.mesh.points[vertex as usize];
        let value = |vertex: u32, c: usize| data.values[vertex as usize * components + c];
        for (index, edge) in domain.edges.iter().enumerate() {
            let [a, b] = edge.vertices;
            let opposite = domain.mesh.cells[edge.triangle as usize]
                .into_iter()
                .find(|vertex| !edge.vertices.contains(vertex));
            let Some(inner) = opposite.filter(|&vertex| first[vertex as usize]) else {
                continue;
            };
            let along = subtract(place(b), place(a));
            let square = edge.length * edge.length;
            for c in 0..components {
                let ends = |end: usize| data.conormal[(2 * index + end) * components + c];
                let across = 0.5 * (ends(0) + ends(1));
                let step = |offset: [f64; 3]| {
                    dot(offset, along) / square * (value(b, c) - value(a, c)) + across * dot(offset, edge.conormal)
                };
                let found = match hessian {
                    None => value(a, c) + step(subtract(place(inner), place(a))),
                    Some(hessian) => {
                        let middle: [f64; 3] = std::array::from_fn(|axis| 0.5 * (place(a)[axis] + place(b)[axis]));
                        let second = hessian([middle[0], middle[1]]);
                        let form = |q: [f64; 3]| {
                            second[0] * q[0] * q[0] + 2.0 * second[1] * q[0] * q[1] + second[2] * q[1] * q[1]
                        };
                        let offset = subtract(place(inner), middle);
                        let centre = 0.5 * (value(a, c) + value(b, c)) - form(along) / 8.0;
                        centre + step(offset) + 0.5 * form(offset)
                    }
                };
                sums[inner as usize * components + c] += found;
            }
            counts[inner as usize] += 1;
        }
        // Vertices that touch the boundary by edges alone.
        let mut around: Vec<Vec<usize>> = vec![Vec::new(); vertices];
        for (index, edge) in domain.edges.iter().enumerate() {
            for vertex in edge.vertices {
                around[vertex as usize].push(index);
            }
        }
        for vertex in (0..vertices as u32).filter(|&vertex| first[vertex as usize]) {
            if counts[vertex as usize] > 0 {
                continue;
            }
            for &near in domain.graph.neighbours(vertex).iter().filter(|&&other| boundary(other)) {
                let offset = subtract(place(vertex), place(near));
                for c in 0..components {
                    let slope = match &data.taylor {
                        Some(taylor) => {
                            let gradient = (taylor.gradient)([place(near)[0], place(near)[1]]);
                            gradient[0] * offset[0] + gradient[1] * offset[1]
                        }
                        None => {
                            let edges = &around[near as usize];
                            let total: f64 = edges
                                .iter()
                                .map(|&index| {
                                    let edge = &domain.edges[index];
                                    let [a, b] = edge.vertices;
                                    let end = usize::from(near == b);
                                    let across = data.conormal[(2 * index + end) * components + c];
                                    let along = subtract(place(b), place(a));
                                    dot(offset, along) / (edge.length * edge.length) * (value(b, c) - value(a, c))
                                        + across * dot(offset, edge.conormal)
                                })
                                .sum();
                            total / edges.len().max(1) as f64
                        }
                    };
                    let bend = hessian.map_or(0.0, |hessian| {
                        let second = hessian([place(near)[0], place(near)[1]]);
                        second[0] * offset[0] * offset[0]
                            + 2.0 * second[1] * offset[0] * offset[1]
                            + second[2] * offset[1] * offset[1]
                    });
                    sums[vertex as usize * components + c] += value(near, c) + slope + 0.5 * bend;
                }
                counts[vertex as usize] += 1;
            }
        }
        for vertex in (0..vertices).filter(|&vertex| first[vertex]) {
            self.unknown[0][vertex] = false;
            for c in 0..components {
                let at = vertex * components + c;
                self.known[0][at] = sums[at] / f64::from(counts[vertex].max(1));
            }
        }
        if !self.unknown[0].contains(&true) {
            return Err(Failure::invalid(
                "every free vertex touches the boundary, so the reduction to the first ring leaves nothing to solve for; \
                 take a finer mesh"
                    .to_string(),
            ));
        }
        let interior: Vec<bool> = domain.places.iter().map(|&place| place == Place::Interior).collect();
        self.unknown[1].clone_from(&interior);
        self.unknown[2] = interior;
        for vertex in (0..vertices).filter(|&vertex| boundary(vertex as u32)) {
            self.known[1][vertex * components..(vertex + 1) * components]
                .copy_from_slice(&data.laplacian[vertex * components..(vertex + 1) * components]);
        }
        Ok(())
    }
}

impl Stabilisation {
    /// The matrix `S` by the places of the operators' pattern.
    fn matrix(self, domain: &Domain<'_>, operators: &SurfaceOperators) -> Vec<f64> {
        let pattern = &operators.pattern;
        let mut matrix = vec![0.0; pattern.columns.len()];
        let factors = self.factors(domain);
        let mut add = |row: u32, column: u32, value: f64| {
            matrix[pattern.place(row, column)] += factors[row as usize] * value;
        };
        match self.relaxation {
            Relaxation::Linear | Relaxation::Quadratic => {
                for (vertex, &place) in domain.places.iter().enumerate() {
                    if place == Place::Boundary {
                        add(vertex as u32, vertex as u32, operators.barycentric[vertex]);
                    }
                }
            }
            Relaxation::Tangential => {
                for edge in &domain.edges {
                    let [a, b] = edge.vertices;
                    for (row, column) in [(a, b), (b, a)] {
                        add(row, row, 1.0 / edge.length);
                        add(row, column, -1.0 / edge.length);
                    }
                }
            }
        }
        matrix
    }

    /// What the lumped mass or the boundary's stiffness is multiplied by at each vertex of the domain, a power of a
    /// length. It depends on the vertex's connected part of the domain alone.
    fn factors(self, domain: &Domain<'_>) -> Vec<f64> {
        let mesh = domain.mesh;
        let cells = mesh.cells.iter().zip(&domain.inside).filter(|(_, inside)| **inside);
        let cells: Vec<[u32; 3]> = cells.map(|(&cell, _)| cell).collect();
        let parts = connectivity::components(&cells, mesh.points.len());
        // Of each part the sum of its triangles' edges, their number, and its area.
        let mut sums = vec![[0.0; 3]; parts.count];
        for &cell in &cells {
            let [a, b, c] = mesh.corners(cell);
            let sum = &mut sums[parts.of_vertex[cell[0] as usize] as usize];
            sum[0] += length(subtract(b, a)) + length(subtract(c, b)) + length(subtract(a, c));
            sum[1] += 3.0;
            sum[2] += length(area_vector([a, b, c])) / 2.0;
        }
        let of_part = |part: u32| {
            let [edges, count, area] = sums[part as usize];
            let edge = edges / count;
            let size = match self.relaxation {
                Relaxation::Linear => edge * area.sqrt() / 80.0,
                Relaxation::Quadratic => edge * edge,
                Relaxation::Tangential => edge.powi(3) * area / 100.0,
            };
            self.factor * size
        };
        let parts = parts.of_vertex.iter();
        parts
            .map(|&part| if part == NONE { 0.0 } else { of_part(part) })
            .collect()
    }
}

/// `N b1`: an edge from `a` to `b` adds its length times `b1_a / 3 + b1_b / 6` to `a`, and the like to `b`.
fn flux(domain: &Domain<'_>, data: &Data<'_>) -> Vec<f64> {
    let components = data.components;
    let mut flux = vec![0.0; domain.places.len() * components];
    for (index, edge) in domain.edges.iter().enumerate() {
        let [a, b] = edge.vertices.map(|vertex| vertex as usize);
        for c in 0..components {
            let at = |end: usize| data.conormal[(2 * index + end) * components + c];
            flux[a * components + c] += edge.length * (at(0) / 3.0 + at(1) / 6.0);
            flux[b * components + c] += edge.length * (at(0) / 6.0 + at(1) / 3.0);
        }
    }
    flux
}
