//! The Voronoi diagram of points in space, restricted to a triangle surface.
//!
//! Every triangle is cut into the parts of it that are nearest to one site (Yan, Lévy, Liu, Sun, Wang 2009). The surface
//! may be a soup: triangles are treated one by one. For a triangle, the candidates are the sites that come closer than a
//! reference site to one of its vertices; no other site owns a part of it, because the difference of two squared distances
//! is affine. A triangle whose three vertices share the nearest site lies in one cell, since cells are convex.
//!
//! Guaranteed: the same pieces in the same order with any number of threads; the areas of a triangle's pieces sum to its
//! area up to rounding, whatever the input. Triangles without area have no pieces. Of several sites in one place the one
//! with the smallest index has a cell.
//!
//! Optionally a site's squared distance to a triangle is increased by `w (1 - n . N)` with the site's normal `n` and the
//! triangle's normal `N`, so that sheets that face away from each other are told apart. The diagram is then a power
//! diagram on every triangle.

mod clip;
mod frame;

pub(crate) use clip::{Candidate, Corner};
pub(crate) use frame::Frame;

use crate::geometry::hilbert;
use crate::geometry::point_tree::PointTree;
use crate::mesh::{dot, subtract};
use clip::Clipper;
use rayon::prelude::*;
use std::fmt;
use std::sync::Mutex;

/// Triangles, or vertices, treated together by one thread.
const CHUNK: usize = 512;

/// Why there is no diagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// A triangle refers to a vertex that does not exist.
    NoVertex {
        triangle: usize,
        vertex: u32,
        vertices: usize,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::NoVertex {
                triangle,
                vertex,
                vertices,
            } => write!(
                f,
                "triangle {triangle} refers to vertex {vertex}, but there are {vertices} vertices"
            ),
        }
    }
}

impl std::error::Error for Error {}

/// What lies across an edge of a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// The triangle's edge from its corner `k` to its corner `k + 1` (modulo 3).
    Edge(u8),
    /// The cell of another site: the edge lies on the bisector with it.
    Site(u32),
}

/// The part of a triangle that belongs to one site.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    pub triangle: u32,
    pub site: u32,
    /// Vertices in space, in the triangle's orientation.
    pub polygon: &'a [[f64; 3]],
    /// `labels[k]` belongs to the edge from vertex `k` to vertex `k + 1`.
    pub labels: &'a [Label],
    pub area: f64,
}

/// Normals that take part in the distance, so that a site prefers triangles that face the same way.
#[derive(Clone, Copy, Debug)]
pub struct Compatibility<'a> {
    /// The weight `w >= 0` of `1 - n . N` beside the squared distance; a squared length.
    pub weight: f64,
    /// The unit normal `n` of every site. A site without a normal has the zero vector.
    pub normals: &'a [[f64; 3]],
}

/// One triangle with the sites that may own a part of it.
pub(crate) struct Cut<'a> {
    pub(crate) triangle: u32,
    pub(crate) frame: &'a Frame,
    pub(crate) candidates: &'a [Candidate],
    /// The candidate that owns `polygon`.
    pub(crate) owner: usize,
    pub(crate) polygon: &'a [Corner],
}

#[derive(Debug, Default)]
struct Scratch {
    found: Vec<u32>,
    clipper: Clipper,
    polygon: Vec<Corner>,
}

/// The connectivity of a surface, and memory for diagrams restricted to it. Made once, used for any number of positions of
/// its vertices and any number of sites.
#[derive(Debug)]
pub struct RestrictedVoronoi {
    cells: Vec<[u32; 3]>,
    vertices: usize,
    /// Triangles and vertices along a Hilbert curve.
    order: Vec<u32>,
    vertex_order: Vec<u32>,
    /// The site nearest to the vertex at the same place of `vertex_order`, and then to every vertex.
    ordered: Vec<u32>,
    nearest: Vec<u32>,
    pool: Mutex<Vec<Box<Scratch>>>,
}

impl RestrictedVoronoi {
    /// Prepares for the surface with these triangles. `points` are one position of its vertices: they decide the order of
    /// work, not the result.
    pub fn new(points: &[[f64; 3]], cells: &[[u32; 3]]) -> Result<RestrictedVoronoi, Error> {
        for (triangle, cell) in cells.iter().enumerate() {
            for &vertex in cell {
                if vertex as usize >= points.len() {
                    return Err(Error::NoVertex {
                        triangle,
                        vertex,
                        vertices: points.len(),
                    });
                }
            }
        }
        let centroids: Vec<[f64; 3]> = cells
            .iter()
            .map(|cell| {
                let [a, b, c] = cell.map(|vertex| points[vertex as usize]);
                std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0)
            })
            .collect();
        let mut keys = Vec::new();
        let mut order = Vec::new();
        hilbert::order(&centroids, &mut keys, &mut order);
        let mut vertex_order = Vec::new();
        hilbert::order(points, &mut keys, &mut vertex_order);
        Ok(RestrictedVoronoi {
            cells: cells.to_vec(),
            vertices: points.len(),
            order,
            vertex_order,
            ordered: vec![0; points.len()],
            nearest: vec![0; points.len()],
            pool: Mutex::new(Vec::new()),
        })
    }

    pub fn cells(&self) -> &[[u32; 3]] {
        &self.cells
    }

    /// Chunks of triangles that [`RestrictedVoronoi::sweep`] works through.
    pub(crate) fn chunks(&self) -> usize {
        self.order.len().div_ceil(CHUNK)
    }

    /// Calls `visit` for every piece, in a fixed order. Nothing is visited unless there are sites and all coordinates are
    /// finite.
    ///
    /// # Panics
    /// When there are not as many points as at the preparation, or not as many normals as sites.
    pub fn pieces(
        &mut self,
        points: &[[f64; 3]],
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
        mut visit: impl FnMut(&Piece<'_>),
    ) {
        if !self.find_nearest(points, sites) {
            return;
        }
        let mut scratch = Scratch::default();
        let (mut polygon, mut labels) = (Vec::new(), Vec::new());
        for triangle in 0..self.cells.len() as u32 {
            self.cut(
                triangle,
                points,
                sites,
                compatibility,
                &mut scratch,
                &mut |cut: &Cut<'_>| {
                    polygon.clear();
                    labels.clear();
                    let mut doubled = 0.0;
                    for (k, corner) in cut.polygon.iter().enumerate() {
                        let next = cut.polygon[(k + 1) % cut.polygon.len()];
                        doubled += corner.u * next.v - corner.v * next.u;
                        let x = cut.frame.space([corner.u, corner.v, 0.0]);
                        polygon.push(std::array::from_fn(|axis| cut.frame.origin[axis] + x[axis]));
                        labels.push(match corner.mark {
                            mark if mark < 0 => Label::Edge((-1 - mark) as u8),
                            other => Label::Site(cut.candidates[other as usize].site),
                        });
                    }
                    visit(&Piece {
                        triangle,
                        site: cut.candidates[cut.owner].site,
                        polygon: &polygon,
                        labels: &labels,
                        area: 0.5 * doubled,
                    });
                },
            );
        }
    }

    /// Calls `visit` for every piece, in parallel: chunk `k` of the triangles with `states[k]`.
    pub(crate) fn sweep<State: Send>(
        &mut self,
        points: &[[f64; 3]],
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
        states: &mut [State],
        visit: impl Fn(&mut State, &Cut<'_>) + Sync,
    ) -> bool {
        if !self.find_nearest(points, sites) {
            return false;
        }
        let this = &*self;
        this.order.par_chunks(CHUNK).zip(states).for_each(|(chunk, state)| {
            let mut scratch = this.take();
            for &triangle in chunk {
                this.cut(
                    triangle,
                    points,
                    sites,
                    compatibility,
                    &mut scratch,
                    &mut |cut: &Cut<'_>| {
                        visit(state, cut);
                    },
                );
            }
            this.give(scratch);
        });
        true
    }

    fn take(&self) -> Box<Scratch> {
        self.pool
            .lock()
            .ok()
            .and_then(|mut pool| pool.pop())
            .unwrap_or_default()
    }

    fn give(&self, scratch: Box<Scratch>) {
        if let Ok(mut pool) = self.pool.lock() {
            pool.push(scratch);
        }
    }

    /// Finds the site nearest to every vertex. False when there are no sites or not all coordinates are finite.
    fn find_nearest(&mut self, points: &[[f64; 3]], sites: &PointTree) -> bool {
        assert_eq!(points.len(), self.vertices, "as many points as at the preparation");
        if sites.points().is_empty() || !sites.is_finite() || !points.iter().flatten().all(|x| x.is_finite()) {
            return false;
        }
        self.vertex_order
            .par_chunks(CHUNK)
            .zip(self.ordered.par_chunks_mut(CHUNK))
            .for_each(|(chunk, found)| {
                let mut hint = None;
                for (&vertex, found) in chunk.iter().zip(found) {
                    // There are sites, so there is a nearest one.
                    *found = sites.nearest(points[vertex as usize], hint).map_or(0, |(site, _)| site);
                    hint = Some(*found);
                }
            });
        for (&vertex, &found) in self.vertex_order.iter().zip(&self.ordered) {
            self.nearest[vertex as usize] = found;
        }
        true
    }

    /// Cuts one triangle.
    fn cut(
        &self,
        triangle: u32,
        points: &[[f64; 3]],
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
        scratch: &mut Scratch,
        visit: &mut impl FnMut(&Cut<'_>),
    ) {
        let cell = self.cells[triangle as usize];
        let corners = cell.map(|vertex| points[vertex as usize]);
        let Some(frame) = Frame::new(corners) else { return };
        let near = cell.map(|vertex| self.nearest[vertex as usize]);
        let positions = sites.points();
        let offset = |site: u32| {
            compatibility.map_or(0.0, |compatibility| {
                let normal = compatibility.normals[site as usize];
                compatibility.weight * (1.0 - dot(normal, frame.normal)).max(0.0)
            })
        };
        let square = |k: usize, site: u32| {
            let difference = subtract(corners[k], positions[site as usize]);
            dot(difference, difference) + offset(site)
        };
        // The reference: of the sites nearest to the vertices the one with the smallest sum over the vertices.
        let sum = |site: u32| square(0, site) + square(1, site) + square(2, site);
        let mut reference = near[0];
        for &site in &near[1..] {
            if site != reference && (sum(site), site) < (sum(reference), reference) {
                reference = site;
            }
        }
        scratch.found.clear();
        if compatibility.is_some() || near != [reference; 3] {
            // A little more than needed, for the rounding of the squares.
            let squares = std::array::from_fn(|k| square(k, reference) * (1.0 + 1e-12));
            sites.within_any(&corners, squares, &mut scratch.found);
        }
        let origin = positions[reference as usize];
        let reference_offset = offset(reference);
        let clipper = &mut scratch.clipper;
        clipper.candidates.clear();
        let candidate = |site: u32| {
            let y = positions[site as usize];
            let difference = subtract(y, origin);
            let [du, dv, _] = frame.local(difference);
            let middle =
                std::array::from_fn(|axis| (y[axis] - frame.origin[axis]) + (origin[axis] - frame.origin[axis]));
            let offset = offset(site);
            Candidate {
                site,
                height: [
                    -2.0 * du,
                    -2.0 * dv,
                    dot(difference, middle) + (offset - reference_offset),
                ],
                local: frame.local(subtract(y, frame.origin)),
                offset,
            }
        };
        clipper.candidates.push(candidate(reference));
        for &site in &scratch.found {
            if site != reference {
                clipper.candidates.push(candidate(site));
            }
        }
        for owner in 0..clipper.candidates.len() {
            let polygon = clipper.cell(&frame, owner);
            if polygon.len() < 3 {
                continue;
            }
            scratch.polygon.clear();
            scratch.polygon.extend_from_slice(polygon);
            visit(&Cut {
                triangle,
                frame: &frame,
                candidates: &clipper.candidates,
                owner,
                polygon: &scratch.polygon,
            });
        }
    }
}
