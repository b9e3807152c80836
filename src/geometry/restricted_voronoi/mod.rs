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
mod exact;
mod frame;
mod subdivide;

pub(crate) use clip::{Candidate, Corner};
pub(crate) use frame::Frame;

use crate::geometry::hilbert;
use crate::geometry::point_tree::{PointTree, within_reach};
use crate::linalg::lanes::Vector;
use crate::linalg::processor::{Kernel, Processor};
use crate::mesh::{dot, subtract};
use clip::{Clipper, Heights, Polygons};
use exact::ExactClipper;
use rayon::prelude::*;
use std::fmt;
use std::sync::Mutex;
use subdivide::Subdivision;

/// Triangles, or vertices, treated together by one thread.
const CHUNK: usize = 512;
/// Triangles with more candidates are subdivided first.
const MANY: usize = 48;

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

/// Memory for one triangle at a time.
#[derive(Debug, Default)]
struct Scratch {
    found: Vec<u32>,
    candidates: Vec<Candidate>,
    heights: Heights,
    some_heights: Heights,
    rivals: Vec<u32>,
    polygons: Polygons,
    clipper: Clipper,
    exact: ExactClipper,
    duals: Vec<[f64; 3]>,
    subdivision: Subdivision,
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
    pool: Mutex<Vec<Scratch>>,
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
        let triangles: Vec<u32> = (0..self.cells.len() as u32).collect();
        Processor::detect().run(Sweep {
            diagram: self,
            triangles: &triangles,
            points,
            sites,
            compatibility,
            scratch: &mut scratch,
            visit: |cut: &Cut<'_>| {
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
                    triangle: cut.triangle,
                    site: cut.candidates[cut.owner].site,
                    polygon: &polygon,
                    labels: &labels,
                    area: 0.5 * doubled,
                });
            },
        });
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
        let processor = Processor::detect();
        this.order.par_chunks(CHUNK).zip(states).for_each(|(triangles, state)| {
            let mut scratch = this.take();
            processor.run(Sweep {
                diagram: this,
                triangles,
                points,
                sites,
                compatibility,
                scratch: &mut scratch,
                visit: |cut: &Cut<'_>| visit(state, cut),
            });
            this.give(scratch);
        });
        true
    }

    fn take(&self) -> Scratch {
        self.pool
            .lock()
            .ok()
            .and_then(|mut pool| pool.pop())
            .unwrap_or_default()
    }

    fn give(&self, scratch: Scratch) {
        if let Ok(mut pool) = self.pool.lock() {
            pool.push(scratch);
        }
    }

    /// Finds the site nearest to every vertex. False when there are no sites or not all coordinates are finite.
    fn find_nearest(&mut self, points: &[[f64; 3]], sites: &PointTree) -> bool {
        assert_eq!(points.len(), self.vertices, "as many points as at the preparation");
        if sites.points().is_empty() || !sites.is_finite() || !within_reach(points) {
            return false;
        }
        let processor = Processor::detect();
        self.vertex_order
            .par_chunks(CHUNK)
            .zip(self.ordered.par_chunks_mut(CHUNK))
            .for_each(|(vertices, found)| {
                processor.run(FindNearest {
                    vertices,
                    points,
                    sites,
                    found,
                });
            });
        for (&vertex, &found) in self.vertex_order.iter().zip(&self.ordered) {
            self.nearest[vertex as usize] = found;
        }
        true
    }

    /// Cuts one triangle.
    #[inline(always)]
    fn cut<V: Vector>(
        &self,
        triangle: u32,
        points: &[[f64; 3]],
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
        scratch: &mut Scratch,
        visit: &mut impl FnMut(&Cut<'_>),
    ) {
        let cell = self.cells[triangle as usize];
        let [a, b, c] = cell.map(|vertex| vertex as usize);
        let corners = [points[a], points[b], points[c]];
        let Some(frame) = Frame::new(corners) else { return };
        let near = [self.nearest[a], self.nearest[b], self.nearest[c]];
        let Scratch {
            found,
            candidates,
            heights,
            some_heights,
            rivals,
            polygons,
            clipper,
            exact,
            duals,
            subdivision,
        } = scratch;
        let positions = sites.points();
        let offset = |site: u32| {
            compatibility.map_or(0.0, |compatibility| {
                let normal = compatibility.normals[site as usize];
                compatibility.weight * (1.0 - dot(normal, frame.normal)).max(0.0)
            })
        };
        // A little more than the squared distances, for their rounding.
        let mut bounds = [[0.0; 3]; 3];
        for k in 0..3 {
            if k > 0 && near[k] == near[k - 1] {
                bounds[k] = bounds[k - 1];
                continue;
            }
            let offset = offset(near[k]);
            for corner in 0..3 {
                let difference = subtract(corners[corner], positions[near[k] as usize]);
                bounds[k][corner] = (dot(difference, difference) + offset) * (1.0 + 1e-12);
            }
        }
        // The reference: of the sites nearest to the vertices the one with the smallest sum over the vertices.
        let sum = |k: usize| bounds[k][0] + bounds[k][1] + bounds[k][2];
        let mut best = 0;
        for k in 1..3 {
            if near[k] != near[best] && (sum(k), near[k]) < (sum(best), near[best]) {
                best = k;
            }
        }
        let reference = near[best];
        found.clear();
        if compatibility.is_some() || near != [reference; 3] {
            // No site owns a part that is not closer to some vertex than each of these.
            let mut distinct = [bounds[best]; 3];
            let mut count = 1;
            for k in 0..3 {
                if near[k] != reference && !(k == 2 && near[1] == near[2]) {
                    distinct[count.min(2)] = bounds[k];
                    count += 1;
                }
            }
            sites.contenders::<V>(&corners, &distinct[..count.min(3)], found);
            if compatibility.is_some() {
                if !found.contains(&reference) {
                    found.push(reference);
                }
                // Sites in one place may differ by their normals.
                for place in 0..found.len() {
                    let mut site = found[place];
                    while let Some(twin) = sites.twin(site) {
                        found.push(twin);
                        site = twin;
                    }
                }
            }
        }
        let origin = positions[reference as usize];
        let reference_offset = offset(reference);
        let mut scale = 0.0f64;
        candidates.clear();
        let to_origin = subtract(origin, frame.origin);
        let mut add = |site: u32| {
            let y = positions[site as usize];
            let difference = subtract(y, origin);
            let from_origin = subtract(y, frame.origin);
            let middle = [
                from_origin[0] + to_origin[0],
                from_origin[1] + to_origin[1],
                from_origin[2] + to_origin[2],
            ];
            let offset = offset(site);
            scale = scale.max(size(difference) * (size(middle) + 2.0 * frame.diameter) + offset + reference_offset);
            candidates.push(Candidate {
                site,
                height: [
                    -2.0 * dot(difference, frame.tangents[0]),
                    -2.0 * dot(difference, frame.tangents[1]),
                    dot(difference, middle) + (offset - reference_offset),
                ],
                local: frame.local(from_origin),
                offset,
            });
        };
        add(reference);
        for &site in found.iter() {
            if site != reference {
                add(site);
            }
        }
        polygons.clear();
        if candidates.len() == 1 {
            polygons.push(0, &Clipper::triangle(&frame));
        } else {
            heights.clear();
            for candidate in candidates.iter() {
                heights.push(candidate.height);
            }
            // Differences of height functions below this are rounding.
            let tolerance = 32.0 * f64::EPSILON * scale;
            let few = candidates.len() <= MANY;
            if few {
                let start = Clipper::corners::<V>(&frame, heights);
                for owner in 0..candidates.len() {
                    let polygon = clipper.cell::<V>(&start, heights, owner, tolerance);
                    if polygon.len() >= 3 {
                        polygons.push(owner, polygon);
                    }
                }
            } else {
                subdivision.divide(&frame, heights, tolerance);
                for owner in 0..candidates.len() {
                    subdivision.rivals(owner, rivals);
                    if rivals.is_empty() {
                        continue;
                    }
                    some_heights.clear();
                    for &rival in rivals.iter() {
                        some_heights.push(candidates[rival as usize].height);
                    }
                    let start = Clipper::corners::<V>(&frame, some_heights);
                    let polygon = clipper.cell::<V>(&start, some_heights, 0, tolerance);
                    if polygon.len() >= 3 && heights.owns::<V>(polygon, owner, tolerance) {
                        polygons.push_renamed(owner, polygon, rivals);
                    }
                }
            }
            // Polygons that overlap or leave gaps betray themselves by their areas.
            let allowed = 1e-10 * frame.area + 1e-14 * frame.diameter * frame.diameter;
            if !((polygons.area - frame.area).abs() <= allowed) {
                polygons.clear();
                // Of equal functions the first one owns: the one with the smallest index.
                candidates.sort_unstable_by_key(|candidate| candidate.site);
                duals.clear();
                duals.extend(candidates.iter().map(|candidate| exact::dual(&frame, candidate.height)));
                if few {
                    rivals.clear();
                    rivals.extend(0..candidates.len() as u32);
                } else {
                    heights.clear();
                    for candidate in candidates.iter() {
                        heights.push(candidate.height);
                    }
                    subdivision.divide(&frame, heights, tolerance);
                }
                for owner in 0..candidates.len() {
                    if !few {
                        subdivision.rivals(owner, rivals);
                        if rivals.is_empty() {
                            continue;
                        }
                    }
                    let polygon = exact.cell(&frame, duals, owner, rivals);
                    if polygon.len() >= 3 && (few || heights.owns::<V>(polygon, owner, tolerance)) {
                        polygons.push(owner, polygon);
                    }
                }
            }
        }
        for &(owner, start, end) in &polygons.parts {
            visit(&Cut {
                triangle,
                frame: &frame,
                candidates,
                owner: owner as usize,
                polygon: &polygons.corners[start as usize..end as usize],
            });
        }
    }
}

/// Sum of magnitudes.
#[inline(always)]
fn size(x: [f64; 3]) -> f64 {
    x[0].abs() + x[1].abs() + x[2].abs()
}

/// Cuts a chunk of triangles in vector registers.
struct Sweep<'a, Visit> {
    diagram: &'a RestrictedVoronoi,
    triangles: &'a [u32],
    points: &'a [[f64; 3]],
    sites: &'a PointTree,
    compatibility: Option<Compatibility<'a>>,
    scratch: &'a mut Scratch,
    visit: Visit,
}

impl<Visit: FnMut(&Cut<'_>)> Kernel for Sweep<'_, Visit> {
    #[inline(always)]
    fn run<V: Vector>(mut self) {
        for &triangle in self.triangles {
            self.diagram.cut::<V>(
                triangle,
                self.points,
                self.sites,
                self.compatibility,
                self.scratch,
                &mut self.visit,
            );
        }
    }
}

/// Finds the sites nearest to a chunk of vertices.
struct FindNearest<'a> {
    vertices: &'a [u32],
    points: &'a [[f64; 3]],
    sites: &'a PointTree,
    found: &'a mut [u32],
}

impl Kernel for FindNearest<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let mut hint = None;
        for (&vertex, found) in self.vertices.iter().zip(self.found) {
            // There are sites, so there is a nearest one.
            *found = self
                .sites
                .nearest_in::<V>(self.points[vertex as usize], hint)
                .map_or(0, |(site, _)| site);
            hint = Some(*found);
        }
    }
}
