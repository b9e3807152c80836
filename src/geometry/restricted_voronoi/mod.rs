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
mod envelope;
mod exact;
mod frame;
mod subdivide;

pub(crate) use clip::{Candidate, Corner};
pub(crate) use frame::Frame;

use crate::geometry::hilbert;
use crate::geometry::point_tree::{PointTree, SomePoints, within_reach};
use crate::linalg::lanes::Vector;
use crate::linalg::processor::{Kernel, Processor};
use crate::mesh::{dot, subtract};
use clip::{Clipper, Heights, Polygons};
use envelope::Envelope;
use exact::ExactClipper;
use rayon::prelude::*;
use std::cell::RefCell;
use std::fmt;
use std::sync::Mutex;
use subdivide::Subdivision;

/// Triangles, or vertices, treated together by one thread.
const CHUNK: usize = 512;
/// Most triangles, or vertices, whose sites are looked up together,
const BLOCK: usize = 16;
/// and most sites that are kept at hand for them.
const AT_HAND: usize = 96;
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
    reaches: Vec<Reach>,
    some: SomePoints,
    found: Vec<u32>,
    candidates: Vec<Candidate>,
    heights: Heights,
    some_heights: Heights,
    rivals: Vec<u32>,
    polygons: Polygons,
    clipper: Clipper,
    envelope: Envelope,
    exact: ExactClipper,
    duals: Vec<[f64; 3]>,
    subdivision: Subdivision,
}

/// The sites nearest to a triangle's vertices, and how near another one must come to own a part of it.
#[derive(Clone, Copy, Debug)]
struct Reach {
    triangle: u32,
    corners: [[f64; 3]; 3],
    near: [u32; 3],
    /// The one of `near` that is nearest to all three vertices together.
    reference: u32,
    /// One row a different site of `near`: no site owns a part that is not closer to some vertex than its entry there.
    rows: [[f64; 3]; 3],
    count: usize,
}

impl Reach {
    #[inline(always)]
    fn new(
        triangle: u32,
        corners: [[f64; 3]; 3],
        near: [u32; 3],
        positions: &[[f64; 3]],
        offset: impl Fn(u32) -> f64,
    ) -> Reach {
        let mut bounds = [[0.0; 3]; 3];
        for k in 0..3 {
            bounds[k] = if k > 0 && near[k] == near[k - 1] {
                bounds[k - 1]
            } else {
                Reach::row(&corners, near[k], positions, &offset)
            };
        }
        let sum = |k: usize| bounds[k][0] + bounds[k][1] + bounds[k][2];
        let mut best = 0;
        for k in 1..3 {
            if near[k] != near[best] && (sum(k), near[k]) < (sum(best), near[best]) {
                best = k;
            }
        }
        let reference = near[best];
        let mut rows = [bounds[best]; 3];
        let mut count = 1;
        for k in 0..3 {
            if near[k] != reference && !(k == 2 && near[1] == near[2]) {
                rows[count.min(2)] = bounds[k];
                count += 1;
            }
        }
        Reach {
            triangle,
            corners,
            near,
            reference,
            rows,
            count: count.min(3),
        }
    }

    /// A little more than the squared distances of the corners to a site, for their rounding.
    #[inline(always)]
    fn row(corners: &[[f64; 3]; 3], site: u32, positions: &[[f64; 3]], offset: &impl Fn(u32) -> f64) -> [f64; 3] {
        let position = positions[site as usize];
        let offset = offset(site);
        corners.map(|corner| {
            let difference = subtract(corner, position);
            (dot(difference, difference) + offset) * (1.0 + 1e-12)
        })
    }

    /// The whole triangle belongs to one site.
    fn is_whole(&self) -> bool {
        self.count == 1
    }

    /// No site farther from the triangle's corners than the root of this owns a part.
    #[inline(always)]
    fn radius(&self) -> f64 {
        self.rows[..self.count].iter().fold(f64::INFINITY, |least, row| {
            least.min(row.iter().fold(0.0, |most: f64, &bound| most.max(bound)))
        })
    }
}

/// A box that grows around points.
#[derive(Clone, Copy, Debug)]
struct Around {
    low: [f64; 3],
    high: [f64; 3],
}

impl Around {
    const NOTHING: Around = Around {
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };

    #[inline(always)]
    fn add(&mut self, point: [f64; 3]) {
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(point[axis]);
            self.high[axis] = self.high[axis].max(point[axis]);
        }
    }
}

/// How many triangles, or vertices, have their sites looked up together: fewer where sites are dense.
fn block(things: usize, sites: usize) -> usize {
    if 4 * sites < things {
        BLOCK
    } else if sites < things {
        BLOCK / 2
    } else if sites < 4 * things {
        BLOCK / 4
    } else {
        1
    }
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
            whole: |_: &[[f64; 3]; 3], _| false,
        });
    }

    /// Calls `visit` for every piece, in parallel: chunk `k` of the triangles with `states[k]`. A triangle that lies in the
    /// cell of one site is first shown to `whole`, as its corners and the site, and not to `visit` if that returns true.
    pub(crate) fn sweep<State: Send>(
        &mut self,
        points: &[[f64; 3]],
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
        states: &mut [State],
        visit: impl Fn(&mut State, &Cut<'_>) + Sync,
        whole: impl Fn(&mut State, &[[f64; 3]; 3], u32) -> bool + Sync,
    ) -> bool {
        if !self.find_nearest(points, sites) {
            return false;
        }
        let this = &*self;
        let processor = Processor::detect();
        this.order.par_chunks(CHUNK).zip(states).for_each(|(triangles, state)| {
            let state = RefCell::new(state);
            let mut scratch = this.take();
            processor.run(Sweep {
                diagram: this,
                triangles,
                points,
                sites,
                compatibility,
                scratch: &mut scratch,
                visit: |cut: &Cut<'_>| visit(&mut **state.borrow_mut(), cut),
                whole: |corners: &[[f64; 3]; 3], site| whole(&mut **state.borrow_mut(), corners, site),
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
        // Only where a site is nearest to several vertices.
        let block = match block(points.len(), sites.points().len()) {
            block if block == BLOCK => block,
            _ => 1,
        };
        let mut ordered = std::mem::take(&mut self.ordered);
        let this = &*self;
        this.vertex_order
            .par_chunks(CHUNK)
            .zip(ordered.par_chunks_mut(CHUNK))
            .for_each(|(vertices, found)| {
                let mut scratch = this.take();
                processor.run(FindNearest {
                    vertices,
                    block,
                    points,
                    sites,
                    scratch: &mut scratch,
                    found,
                });
                this.give(scratch);
            });
        self.ordered = ordered;
        for (&vertex, &found) in self.vertex_order.iter().zip(&self.ordered) {
            self.nearest[vertex as usize] = found;
        }
        true
    }

    /// The sites around one triangle.
    #[inline(always)]
    fn reach(&self, triangle: u32, points: &[[f64; 3]], sites: &PointTree) -> Reach {
        let cell = self.cells[triangle as usize].map(|vertex| vertex as usize);
        let corners = cell.map(|vertex| points[vertex]);
        let near = cell.map(|vertex| self.nearest[vertex]);
        if near[0] == near[1] && near[0] == near[2] {
            // Cells are convex. Rows are needed where normals matter only, and are then made anew.
            return Reach {
                triangle,
                corners,
                near,
                reference: near[0],
                rows: [[0.0; 3]; 3],
                count: 1,
            };
        }
        Reach::new(triangle, corners, near, sites.points(), |_| 0.0)
    }

    /// Cuts one triangle, whose sites are `at_hand` if so it says.
    #[inline(always)]
    fn cut<V: Vector>(
        &self,
        reach: &Reach,
        at_hand: bool,
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
        scratch: &mut Scratch,
        visit: &mut impl FnMut(&Cut<'_>),
    ) {
        let corners = reach.corners;
        let Some(frame) = Frame::new(corners) else { return };
        let Scratch {
            reaches: _,
            some,
            found,
            candidates,
            heights,
            some_heights,
            rivals,
            polygons,
            clipper,
            envelope,
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
        let reach = match compatibility {
            None => *reach,
            Some(_) => Reach::new(reach.triangle, corners, reach.near, positions, offset),
        };
        let reference = reach.reference;
        found.clear();
        if compatibility.is_some() || !reach.is_whole() {
            let rows = &reach.rows[..reach.count];
            if at_hand {
                some.contenders::<V>(&corners, rows, found);
            } else {
                sites.contenders::<V>(&corners, rows, found);
            }
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
            // Polygons that overlap or leave gaps betray themselves by their areas.
            let allowed = 1e-10 * frame.area + 1e-14 * frame.diameter * frame.diameter;
            let whole = |polygons: &Polygons| (polygons.area - frame.area).abs() <= allowed;
            let walked = few && envelope.cells::<V>(&frame, heights, polygons) && whole(polygons);
            if !walked {
                polygons.clear();
            }
            if walked {
            } else if few {
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
            if !whole(polygons) {
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
                triangle: reach.triangle,
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
struct Sweep<'a, Visit, Whole> {
    diagram: &'a RestrictedVoronoi,
    triangles: &'a [u32],
    points: &'a [[f64; 3]],
    sites: &'a PointTree,
    compatibility: Option<Compatibility<'a>>,
    scratch: &'a mut Scratch,
    visit: Visit,
    /// Takes a triangle that lies in the cell of one site, if it likes.
    whole: Whole,
}

impl<Visit: FnMut(&Cut<'_>), Whole: FnMut(&[[f64; 3]; 3], u32) -> bool> Kernel for Sweep<'_, Visit, Whole> {
    #[inline(always)]
    fn run<V: Vector>(mut self) {
        let diagram = self.diagram;
        let block = block(diagram.cells.len(), self.sites.points().len());
        let mut reaches = std::mem::take(&mut self.scratch.reaches);
        for triangles in self.triangles.chunks(block) {
            reaches.clear();
            let mut around = Around::NOTHING;
            let (mut bound, mut count) = (0.0f64, 0);
            for &triangle in triangles {
                let reach = diagram.reach(triangle, self.points, self.sites);
                if self.compatibility.is_none() && !reach.is_whole() {
                    reach.corners.into_iter().for_each(|corner| around.add(corner));
                    bound = bound.max(reach.radius());
                    count += 1;
                }
                reaches.push(reach);
            }
            let at_hand =
                count > 1 && (self.sites).gather::<V>(around.low, around.high, bound, AT_HAND, &mut self.scratch.some);
            for reach in &reaches {
                if self.compatibility.is_none() && reach.is_whole() && (self.whole)(&reach.corners, reach.reference) {
                    continue;
                }
                diagram.cut::<V>(
                    reach,
                    at_hand,
                    self.sites,
                    self.compatibility,
                    self.scratch,
                    &mut self.visit,
                );
            }
        }
        self.scratch.reaches = reaches;
    }
}

/// Finds the sites nearest to a chunk of vertices.
struct FindNearest<'a> {
    vertices: &'a [u32],
    block: usize,
    points: &'a [[f64; 3]],
    sites: &'a PointTree,
    scratch: &'a mut Scratch,
    /// Holds the sites that were nearest the last time, which are good guesses.
    found: &'a mut [u32],
}

impl FindNearest<'_> {
    // No closure: it would not inherit the instruction set.
    #[inline(always)]
    fn nearest<V: Vector>(&self, vertex: u32, hint: Option<u32>, before: u32) -> u32 {
        let x = self.points[vertex as usize];
        let sites = self.sites.points();
        let hint = match (hint, sites.get(before as usize)) {
            (Some(hint), Some(&old)) => {
                let (here, there) = (subtract(sites[hint as usize], x), subtract(old, x));
                Some(if dot(there, there) < dot(here, here) {
                    before
                } else {
                    hint
                })
            }
            (None, Some(_)) => Some(before),
            (hint, None) => hint,
        };
        // There are sites, so there is a nearest one.
        self.sites.nearest_in::<V>(x, hint).map_or(0, |(site, _)| site)
    }
}

impl Kernel for FindNearest<'_> {
    #[inline(always)]
    fn run<V: Vector>(mut self) {
        let mut some = std::mem::take(&mut self.scratch.some);
        let found = std::mem::take(&mut self.found);
        let mut hint = None;
        for (vertices, found) in self.vertices.chunks(self.block).zip(found.chunks_mut(self.block)) {
            let first = self.nearest::<V>(vertices[0], hint, found[0]);
            hint = Some(first);
            found[0] = first;
            if vertices.len() == 1 {
                continue;
            }
            let position = self.sites.points()[first as usize];
            let square = |vertex: u32| {
                let difference = subtract(position, self.points[vertex as usize]);
                dot(difference, difference)
            };
            let mut around = Around::NOTHING;
            let mut bound = 0.0f64;
            for &vertex in &vertices[1..] {
                around.add(self.points[vertex as usize]);
                bound = bound.max(square(vertex));
            }
            if self
                .sites
                .gather::<V>(around.low, around.high, bound, AT_HAND, &mut some)
            {
                for (&vertex, found) in vertices.iter().zip(found).skip(1) {
                    *found = some
                        .nearest::<V>(self.points[vertex as usize], (square(vertex), first))
                        .1;
                }
            } else {
                for (&vertex, found) in vertices.iter().zip(found).skip(1) {
                    *found = self.nearest::<V>(vertex, hint, *found);
                    hint = Some(*found);
                }
            }
        }
        self.scratch.some = some;
    }
}
