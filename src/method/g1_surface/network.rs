//! The network of cubic curves over the edges of a quadrilateral surface.
//!
//! A curve interpolates two points and is perpendicular to two normals. Among these, the natural cubic minimizes the integral
//! of `|X''|^2`; its second derivatives at the ends are parallel to the normals. Source: Xue, Demkowicz, Bajaj 2004, section
//! 2.1. They solve a system of eight equations; [`natural`] is its closed form.
//!
//! Guaranteed: every curve is perpendicular to the normals at its ends, whatever is done to the tangents by the functions of
//! this folder. Not guaranteed: that curves do not meet outside their ends.

use super::hermite;
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
}

/// The sine between neighbouring curves at a vertex, or the share of a curve's chord within the tangent plane, below which
/// the tangent plane says nothing about the directions of the curves.
const FLAT: f64 = 1e-6;

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
        let mut units = Vec::with_capacity(normals.len());
        for (vertex, &normal) in normals.iter().enumerate() {
            let size = length(normal);
            if !(size > 0.0 && size.is_finite()) {
                return Err(format!(
                    "vertex {vertex} (from 0) has no normal: {normal:?}; give a vector of any length but zero"
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
            connectivity,
        };
        network.orient_normals(&mut notices)?;
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
        network.check(&mut notices)?;
        Ok((network, notices))
    }

    /// Turns all normals round where most of them point to the back of their quads.
    fn orient_normals(&mut self, notices: &mut Vec<String>) -> Result<(), String> {
        let mut backward = 0usize;
        for quad in &self.quads {
            let corners = quad.map(|vertex| self.points[vertex as usize]);
            let face = cross(subtract(corners[2], corners[0]), subtract(corners[3], corners[1]));
            backward += quad
                .iter()
                .filter(|&&vertex| dot(face, self.normals[vertex as usize]) < 0.0)
                .count();
        }
        if 2 * backward > 4 * self.quads.len() {
            for normal in &mut self.normals {
                *normal = normal.map(|component| -component);
            }
            notices.push(
                "the normals point to the side from which the quadrilaterals are seen clockwise; turned round"
                    .to_string(),
            );
        }
        Ok(())
    }

    /// Whether the tangent planes carry the curves.
    fn check(&self, notices: &mut Vec<String>) -> Result<(), String> {
        for (edge, tangents) in self.connectivity.edges.iter().zip(&self.tangents) {
            let chord = length(subtract(self.points[edge[1] as usize], self.points[edge[0] as usize]));
            for (end, &tangent) in tangents.iter().enumerate() {
                if !(length(tangent) > FLAT * chord) {
                    return Err(format!(
                        "the normal at vertex {} is parallel to the edge to vertex {} (counted from 0); correct the normal",
                        edge[end],
                        edge[1 - end]
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
                    let [a, b] = [a.edge, b.edge].map(|edge| self.connectivity.other_end(edge, vertex as u32));
                    return Err(format!(
                        "at vertex {vertex} the edges to vertices {a} and {b} (counted from 0) leave in one line as seen \
                         along the normal, or the normal is tangent to their plane; move the vertex or correct its normal"
                    ));
                }
                if sine < 0.0 && folds.last() != Some(&(vertex as u32)) {
                    folds.push(vertex as u32);
                }
            }
        }
        if let Some(first) = folds.first() {
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

    /// Integral of `|X''|^2` over all curves, the quantity that natural cubics minimize. `X''` is linear, so Simpson's rule
    /// is exact.
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
