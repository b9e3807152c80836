//! The network of cubic curves over the edges of a quadrilateral surface.
//!
//! A curve interpolates two points and is perpendicular to two normals. Among these, the natural cubic minimizes the
//! integral of `|X''|^2`; its second derivatives at the ends are parallel to the normals. Source: Xue, Demkowicz,
//! Bajaj 2004, section
//! 2.1. They solve a system of eight equations; [`natural`] is its closed form.
//!
//! Guaranteed: every curve is perpendicular to the normals at its ends, whatever is done to the tangents by the
//! functions of this folder. Not guaranteed: that curves do not meet outside their ends.

use super::creases::Creases;
use super::hermite;
use super::orientation;
use crate::linalg::vector3::{add, cross, dot, subtract, times};
use crate::mesh::length;
use crate::mesh::quadrilateral::{Connectivity, QuadrilateralMesh};

/// The natural cubic over one edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Natural {
    /// Slopes at both ends, in the direction of the curve.
    pub tangents: [[f64; 3]; 2],
    /// `X''` at both ends is this multiple of the normal there.
    pub multipliers: [f64; 2],
}

/// The natural cubic between two points with unit normals.
///
/// With `d = p2 - p1`, `c = n1.n2`, `a = d.n1`, `b = d.n2`: `l1 = (12 a + 6 c b) / (4 - c^2)`,
/// `l2 = -(12 b + 6 c a) / (4 - c^2)`, `t1 = d - l1 n1/3 - l2 n2/6`, `t2 = d + l2 n2/3 + l1 n1/6`. The denominator is at
/// least 3, so the curve is defined for all data, and equals the chord when `a = b = 0`.
pub fn natural([p1, p2]: [[f64; 3]; 2], [n1, n2]: [[f64; 3]; 2]) -> Natural {
    let d = subtract(p2, p1);
    let (c, a, b) = (dot(n1, n2), dot(d, n1), dot(d, n2));
    let l1 = (12.0 * a + 6.0 * c * b) / (4.0 - c * c);
    let l2 = -(12.0 * b + 6.0 * c * a) / (4.0 - c * c);
    let t1 = subtract(subtract(d, times(n1, l1 / 3.0)), times(n2, l2 / 6.0));
    let t2 = add(add(d, times(n2, l2 / 3.0)), times(n1, l1 / 6.0));
    Natural {
        tangents: [in_plane(t1, n1), in_plane(t2, n2)],
        multipliers: [l1, l2],
    }
}

/// The part of a vector that is perpendicular to a unit vector.
pub fn in_plane(vector: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    subtract(vector, times(normal, dot(vector, normal)))
}

/// A curve as it leaves a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spoke {
    pub edge: u32,
    /// 0 where the edge starts at the vertex, 1 where it ends there.
    pub end: usize,
    /// Slope away from the vertex.
    pub tangent: [f64; 3],
    /// `X'' . n` at the vertex.
    pub bend: f64,
}

impl Spoke {
    /// Normal curvature of the curve at the vertex.
    pub fn curvature(&self) -> f64 {
        self.bend / dot(self.tangent, self.tangent)
    }
}

/// Points, normals and curves.
#[derive(Clone, Debug)]
pub struct Network {
    pub points: Vec<[f64; 3]>,
    /// Of length 1, outward.
    pub normals: Vec<[f64; 3]>,
    pub quads: Vec<[u32; 4]>,
    pub connectivity: Connectivity,
    /// Slopes of every edge's curve at its two ends, from the smaller vertex to the larger one.
    pub tangents: Vec<[[f64; 3]; 2]>,
    /// Whether an edge is one side of a crease: its tangents belong to both sides and stay.
    pub on_crease: Vec<bool>,
}

/// The sine between neighbouring curves at a vertex, or the share of a curve's chord within the tangent plane, below
/// which the tangent plane says nothing about the directions of the curves.
const FLAT: f64 = 1e-6;
/// The sine between the normals of a crease's two sides below which they count as one: their common line would be
/// uncertain.
const SAME: f64 = 1e-4;
/// The cosine between a crease and the line in which its sides' planes meet, below which they do not belong together.
const CROOKED: f64 = 0.25;
/// Rounds in which planes are joined, since one joining may change another.
const JOINING: usize = 8;

/// The directions that a curve may leave a vertex in.
enum Allowed {
    /// The plane perpendicular to a normal.
    Plane([f64; 3]),
    /// The line perpendicular to two normals.
    Line([f64; 3]),
}

impl Allowed {
    fn between(n: [f64; 3], m: [f64; 3]) -> Self {
        if n == m {
            return Self::Plane(n);
        }
        let line = cross(n, m);
        Self::Line(times(line, 1.0 / length(line)))
    }

    fn project(&self, vector: [f64; 3]) -> [f64; 3] {
        match *self {
            Self::Plane(normal) => in_plane(vector, normal),
            Self::Line(direction) => times(direction, dot(vector, direction)),
        }
    }
}

impl Network {
    /// The natural cubics of a checked mesh with one normal a vertex.
    ///
    /// # Errors
    /// Where a normal is zero or not finite, parallel to a curve, or tangent to the plane of two neighbouring edges.
    pub fn natural(
        mesh: &QuadrilateralMesh,
        connectivity: Connectivity,
        normals: &[[f64; 3]],
    ) -> Result<(Self, Vec<String>), String> {
        Self::creased(mesh, connectivity, normals, None)
    }

    /// The same over a mesh that is cut open along creases: the curve along a crease is the one of least curvature
    /// that is perpendicular to the normals of both its sides, and the same on both.
    ///
    /// # Errors
    /// As [`Self::natural`], and where two sides' planes meet in a line across their crease.
    pub fn creased(
        mesh: &QuadrilateralMesh,
        connectivity: Connectivity,
        normals: &[[f64; 3]],
        creases: Option<&Creases>,
    ) -> Result<(Self, Vec<String>), String> {
        // Messages name vertices as the model does.
        let named = |vertex: u32| creases.map_or(vertex, |creases| creases.original[vertex as usize]);
        let mut units = Vec::with_capacity(normals.len());
        for (vertex, &normal) in normals.iter().enumerate() {
            let size = length(normal);
            if !(size > 0.0 && size.is_finite()) {
                return Err(format!(
                    "vertex {} (from 0) has no normal: {normal:?}; give a vector of any length but zero, or estimate all of \
                     them (vertex_normals = \"estimated\")",
                    named(vertex as u32)
                ));
            }
            units.push(normal.map(|component| component / size));
        }
        let mut notices = Vec::new();
        let mut network = Self {
            points: mesh.points.clone(),
            normals: units,
            quads: mesh.quads.clone(),
            tangents: Vec::new(),
            on_crease: vec![false; connectivity.edges.len()],
            connectivity,
        };
        network.orient_normals(creases, &mut notices);
        if let Some(creases) = creases {
            network.join_planes(creases, &mut notices);
        }
        network.tangents = network
            .connectivity
            .edges
            .iter()
            .map(|&edge| {
                natural(
                    edge.map(|vertex| network.points[vertex as usize]),
                    edge.map(|vertex| network.normals[vertex as usize]),
                )
                .tangents
            })
            .collect();
        if let Some(creases) = creases {
            network.follow_creases(creases)?;
        }
        network.check(&named, &mut notices)?;
        Ok((network, notices))
    }

    /// Turns the normals of every part of the surface round where most of them point to the back of their quads.
    fn orient_normals(&mut self, creases: Option<&Creases>, notices: &mut Vec<String>) {
        let parts = orientation::parts(&self.connectivity, creases);
        let backward = orientation::backward(&self.points, &self.quads, &self.normals, &parts, |_| true);
        let turned = backward.iter().filter(|&&backward| backward).count();
        for (normal, _) in self
            .normals
            .iter_mut()
            .zip(&backward)
            .filter(|(_, backward)| **backward)
        {
            *normal = normal.map(|component| -component);
        }
        if turned > 0 {
            let which = if turned == backward.len() {
                "the normals".to_string()
            } else {
                format!(
                    "the normals at {turned} of {} vertices, whole parts of the surface,",
                    backward.len()
                )
            };
            notices.push(format!(
                "{which} point to the side from which the quadrilaterals are seen clockwise; turned round"
            ));
        }
    }

    /// The ends of a crease's two sides, that of the first side first: `ends[e]` are the vertices at end `e` of the first
    /// side's edge. The last part tells whether both edges run the same way.
    fn crease_ends(&self, creases: &Creases, [first, second]: [u32; 2]) -> ([[usize; 2]; 2], bool) {
        let [a, b] = self.connectivity.edges[first as usize].map(|vertex| vertex as usize);
        let [c, d] = self.connectivity.edges[second as usize].map(|vertex| vertex as usize);
        let alike = creases.original[a] == creases.original[c];
        (if alike { [[a, c], [b, d]] } else { [[a, d], [b, c]] }, alike)
    }

    /// Gives both sides of a crease one normal at vertices where their planes all but agree, or meet in a line across the
    /// crease: it has no direction there that both sides could follow.
    fn join_planes(&mut self, creases: &Creases, notices: &mut Vec<String>) {
        let mut crooked: Vec<u32> = Vec::new();
        for _ in 0..JOINING {
            let mut changed = false;
            for &pair in &creases.pairs {
                let (ends, _) = self.crease_ends(creases, pair);
                let chord = subtract(self.points[ends[1][0]], self.points[ends[0][0]]);
                for [a, b] in ends {
                    let (n, m) = (self.normals[a], self.normals[b]);
                    let line = cross(n, m);
                    let sine = length(line);
                    let across = dot(line, chord).abs() < CROOKED * sine * length(chord);
                    if n == m || (sine > SAME && !across) {
                        continue;
                    }
                    let sum = add(n, m);
                    if !(length(sum) > FLAT) {
                        continue;
                    }
                    if sine > SAME && !crooked.contains(&creases.original[a]) {
                        crooked.push(creases.original[a]);
                    }
                    let mean = times(sum, 1.0 / length(sum));
                    (self.normals[a], self.normals[b]) = (mean, mean);
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        if let Some(first) = crooked.first() {
            notices.push(format!(
                "at {} vertices, the first is vertex {first}, the planes of a crease's two sides meet in a line that runs \
                 across it: they share one normal there",
                crooked.len()
            ));
        }
    }

    /// Sets the tangents along creases: the integral of `|X''|^2` is least for `2 t1 + P1 t2 = 3 P1 d`,
    /// `P2 t1 + 2 t2 = 3 P2 d` with the projections `P` onto the directions perpendicular to the normals of both sides.
    fn follow_creases(&mut self, creases: &Creases) -> Result<(), String> {
        for &pair in &creases.pairs {
            let (ends, alike) = self.crease_ends(creases, pair);
            let chord = subtract(self.points[ends[1][0]], self.points[ends[0][0]]);
            let [first, second] = ends.map(|[a, b]| Allowed::between(self.normals[a], self.normals[b]));
            // t1 eliminated: (4 - P2 P1) t2 = 6 P2 d - 3 P2 P1 d.
            let columns: [[f64; 3]; 3] = std::array::from_fn(|axis| {
                let mut unit = [0.0; 3];
                unit[axis] = 1.0;
                subtract(times(unit, 4.0), second.project(first.project(unit)))
            });
            let matrix = nalgebra::Matrix3::from_columns(&columns.map(nalgebra::Vector3::from));
            let rhs = subtract(
                times(second.project(chord), 6.0),
                times(second.project(first.project(chord)), 3.0),
            );
            // Projections do not lengthen: the matrix is at least 3 times the identity.
            let solved = matrix.lu().solve(&nalgebra::Vector3::from(rhs));
            let t2 = second.project(solved.map_or(chord, Into::into));
            let t1 = first.project(times(subtract(times(chord, 3.0), t2), 0.5));
            for (tangent, [a, _]) in [t1, t2].into_iter().zip(ends) {
                if !(dot(tangent, chord) > FLAT * dot(chord, chord)) {
                    let [p, q] = ends.map(|[a, _]| creases.original[a]);
                    return Err(format!(
                        "at vertex {} the planes of the two sides of the crease between vertices {p} and {q} (counted from 0) \
                         meet in a line across it; correct the normals, or take the edge out of the creases",
                        creases.original[a]
                    ));
                }
            }
            let [one, other] = pair.map(|edge| edge as usize);
            self.tangents[one] = [t1, t2];
            self.tangents[other] = if alike {
                [t1, t2]
            } else {
                [times(t2, -1.0), times(t1, -1.0)]
            };
            (self.on_crease[one], self.on_crease[other]) = (true, true);
        }
        Ok(())
    }

    /// Whether the tangent planes carry the curves.
    fn check(&self, named: &dyn Fn(u32) -> u32, notices: &mut Vec<String>) -> Result<(), String> {
        for (edge, tangents) in self.connectivity.edges.iter().zip(&self.tangents) {
            let chord = length(subtract(self.points[edge[1] as usize], self.points[edge[0] as usize]));
            for (end, &tangent) in tangents.iter().enumerate() {
                if !(length(tangent) > FLAT * chord) {
                    return Err(format!(
                        "the normal at vertex {} is parallel to the edge to vertex {} (counted from 0); correct the normal",
                        named(edge[end]),
                        named(edge[1 - end])
                    ));
                }
            }
        }
        let mut folds: Vec<u32> = Vec::new();
        let mut spokes = Vec::new();
        for vertex in 0..self.points.len() {
            self.spokes(vertex, &mut spokes);
            for corner in 0..self.connectivity.stars.row(vertex).len() {
                let (a, b) = (&spokes[corner], &spokes[(corner + 1) % spokes.len()]);
                let sine =
                    dot(self.normals[vertex], cross(a.tangent, b.tangent)) / (length(a.tangent) * length(b.tangent));
                if sine.abs() < FLAT {
                    let turning = [a.edge, b.edge].map(|edge| self.on_crease[edge as usize]) == [true, true];
                    let [a, b] = [a.edge, b.edge].map(|edge| named(self.connectivity.other_end(edge, vertex as u32)));
                    let here = named(vertex as u32);
                    return Err(if turning {
                        format!(
                            "at vertex {here} the creases to vertices {a} and {b} (counted from 0), sides of one quadrilateral, \
                             leave in one line: a crease may not turn within one quadrilateral; add a third crease at this \
                             vertex, or take one of the two out"
                        )
                    } else {
                        format!(
                            "at vertex {here} the edges to vertices {a} and {b} (counted from 0) leave in one line as seen \
                             along the normal, or the normal is tangent to their plane; move the vertex or correct its normal"
                        )
                    });
                }
                if sine < 0.0 && folds.last() != Some(&(vertex as u32)) {
                    folds.push(vertex as u32);
                }
            }
        }
        if let Some(&first) = folds.first() {
            let first = named(first);
            notices.push(format!(
                "at {} vertices, the first is vertex {first}, a corner is turned over as seen along the normal: the surface \
                 folds there",
                folds.len()
            ));
        }
        Ok(())
    }

    /// The curves around a vertex, counter-clockwise; corner `i` of the star lies between spokes `i` and `i + 1`.
    pub fn spokes(&self, vertex: usize, into: &mut Vec<Spoke>) {
        into.clear();
        into.extend(self.connectivity.spokes(vertex).map(|edge| self.spoke(edge, vertex)));
    }

    /// One curve as it leaves a vertex.
    pub fn spoke(&self, edge: u32, vertex: usize) -> Spoke {
        let ends = self.connectivity.edges[edge as usize];
        let end = usize::from(ends[0] as usize != vertex);
        let sign = if end == 0 { 1.0 } else { -1.0 };
        let tangents = self.tangents[edge as usize];
        let chord = subtract(self.points[ends[1 - end] as usize], self.points[vertex]);
        // In directions away from the vertices: X'' = 6 chord - 4 tangent + 2 (tangent at the far end), the second
        // perpendicular to the normal.
        let far = times(tangents[1 - end], -sign);
        Spoke {
            edge,
            end,
            tangent: times(tangents[end], sign),
            bend: dot(add(times(chord, 6.0), times(far, 2.0)), self.normals[vertex]),
        }
    }

    /// Coefficients of an edge's curve over the four Hermite functions.
    pub fn curve(&self, edge: usize) -> [[f64; 3]; 4] {
        let [a, b] = self.connectivity.edges[edge];
        let [t1, t2] = self.tangents[edge];
        [self.points[a as usize], self.points[b as usize], t1, t2]
    }

    /// The slope of an edge's curve.
    pub fn slope(&self, edge: usize, x: f64) -> [f64; 3] {
        hermite::combine(&hermite::slopes(x), &self.curve(edge))
    }

    /// Whether corner `k` and the next one are the start and the end of the edge between them.
    pub fn runs_along(&self, quad: usize, corner: usize) -> bool {
        self.quads[quad][corner] < self.quads[quad][(corner + 1) % 4]
    }

    /// Number of vertices off the boundary with an even number of quads: those where tangents of curves cannot be chosen
    /// freely.
    pub fn even_vertices(&self) -> usize {
        (0..self.points.len()).filter(|&vertex| self.is_even(vertex)).count()
    }

    /// Whether a vertex lies off the boundary and has an even number of quads.
    pub fn is_even(&self, vertex: usize) -> bool {
        !self.connectivity.on_boundary[vertex] && self.connectivity.stars.row(vertex).len().is_multiple_of(2)
    }

    /// Integral of `|X''|^2` over all curves, the quantity that natural cubics minimize. `X''` is linear, so Simpson's
    /// rule is exact.
    pub fn bending_energy(&self) -> f64 {
        let edge_energy = |edge: usize| {
            let curve = self.curve(edge);
            let at = |x: f64| {
                let second = hermite::combine(&hermite::second_derivatives(x), &curve);
                dot(second, second)
            };
            (at(0.0) + 4.0 * at(0.5) + at(1.0)) / 6.0
        };
        (0..self.tangents.len()).map(edge_energy).sum()
    }
}
