//! The Voronoi diagram of points in space, restricted to a triangle surface.
//!
//! Every triangle is cut into the parts of it that are nearest to one site (Yan, Lévy, Liu, Sun, Wang 2009). The surface
//! may be a soup: triangles are treated one by one. For a triangle, the candidates are the sites that come closer than a
//! reference site to one of its vertices; no other site owns a part of it, because the difference of two squared
//! distances is affine. A triangle whose three vertices share the nearest site lies in one cell, since cells are
//! convex.
//!
//! Guaranteed: the same pieces in the same order with any number of threads; the areas of a triangle's pieces sum to its
//! area up to 1e-10 of it and 1e-14 of its squared diameter, and where even exact decisions do not achieve that the
//! triangle is counted ([`Ways::gaps`]). Triangles without area have no pieces. Of several sites in one place the one
//! with the smallest index has a cell.
//!
//! Optionally a site's squared distance to a triangle is increased by `w (1 - n . N)` with the site's normal `n` and the
//! triangle's normal `N`, so that sheets that face away from each other are told apart. The diagram is then a power
//! diagram on every triangle.

mod clip;
mod cut;
mod envelope;
mod exact;
mod few;
mod frame;
mod nearest;
mod reach;
mod subdivide;

pub(crate) use clip::Candidate;
pub(crate) use cut::Cut;

use crate::geometry::hilbert;
use crate::geometry::point_tree::{PointTree, SomePoints, within_reach};
use crate::linalg::lanes::Vector;
use crate::linalg::processor::{Kernel, Processor};
use cut::Cutter;
use nearest::FindNearest;
use rayon::prelude::*;
use reach::{Around, Reach};
use std::fmt;
use std::sync::Mutex;

/// Triangles, or vertices, treated together by one thread.
const CHUNK: usize = 512;
/// Most chunks that a thread takes at once: chunks differ in work, and with more the last thread would keep all waiting.
const AT_ONCE: usize = 2;
/// Most triangles, or vertices, whose sites are looked up together,
const BLOCK: usize = 16;
/// and most sites that are kept at hand for them.
const AT_HAND: usize = 96;

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

/// The ways in which a triangle is cut, each for what the one before leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Way {
    /// All cells at once, along their edges.
    #[default]
    Walk,
    /// Cell by cell.
    Clip,
    /// Cell by cell, by exact decisions.
    Exact,
}

/// How many triangles were cut in which way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ways {
    /// Lie in one cell.
    pub whole: usize,
    pub walked: usize,
    pub clipped: usize,
    pub exact: usize,
    /// Those of `exact` whose pieces do not add up to them.
    pub gaps: usize,
}

/// Memory for one chunk at a time.
#[derive(Debug, Default)]
struct Scratch {
    reaches: Vec<Reach>,
    some: SomePoints,
    cutter: Cutter,
}

/// The connectivity of a surface, and memory for diagrams restricted to it. Made once, used for any number of
/// positions of its vertices and any number of sites.
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
    first: Way,
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
            first: Way::default(),
            pool: Mutex::new(Vec::new()),
        })
    }

    pub fn cells(&self) -> &[[u32; 3]] {
        &self.cells
    }

    /// Leaves out the ways before this one, which are quicker. All give the same diagram up to rounding.
    pub fn begin_with(&mut self, way: Way) {
        self.first = way;
    }

    /// Chunks of triangles that [`RestrictedVoronoi::sweep`] works through.
    pub(crate) fn chunks(&self) -> usize {
        self.order.len().div_ceil(CHUNK)
    }

    /// Calls `visit` for every piece, in a fixed order, and counts the ways that were gone. Nothing is visited unless
    /// there are sites and all coordinates are finite.
    ///
    /// # Panics
    /// When there are not as many points as at the preparation, or not as many normals as sites.
    pub fn pieces(
        &mut self,
        points: &[[f64; 3]],
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
        visit: impl FnMut(&Piece<'_>),
    ) -> Ways {
        if !self.find_nearest(points, sites) {
            return Ways::default();
        }
        let mut scratch = Scratch::default();
        let triangles: Vec<u32> = (0..self.cells.len() as u32).collect();
        Processor::detect().run(Sweep {
            diagram: self,
            triangles: &triangles,
            points,
            sites,
            compatibility,
            scratch: &mut scratch,
            visitor: Shower {
                visit,
                polygon: Vec::new(),
                labels: Vec::new(),
            },
        });
        scratch.cutter.ways
    }

    /// Shows every piece, in parallel: those of chunk `k` of the triangles to what `visitor` makes of `states[k]`.
    pub(crate) fn sweep<'s, State: Send, V: Visitor>(
        &mut self,
        points: &[[f64; 3]],
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
        states: &'s mut [State],
        visitor: impl Fn(&'s mut State) -> V + Sync,
    ) -> bool {
        if !self.find_nearest(points, sites) {
            return false;
        }
        let this = &*self;
        let processor = Processor::detect();
        (this.order.par_chunks(CHUNK).zip(states))
            .with_max_len(AT_ONCE)
            .for_each(|(triangles, state)| {
                let mut scratch = this.take();
                processor.run(Sweep {
                    diagram: this,
                    triangles,
                    points,
                    sites,
                    compatibility,
                    scratch: &mut scratch,
                    visitor: visitor(state),
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
        let block = block(points.len(), sites.points().len());
        let mut ordered = std::mem::take(&mut self.ordered);
        let this = &*self;
        this.vertex_order
            .par_chunks(CHUNK)
            .zip(ordered.par_chunks_mut(CHUNK))
            .with_max_len(AT_ONCE)
            .for_each(|(vertices, found)| {
                let mut scratch = this.take();
                processor.run(FindNearest {
                    vertices,
                    block,
                    points,
                    sites,
                    some: &mut scratch.some,
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
            return Reach::whole(triangle, corners, near[0]);
        }
        Reach::new(triangle, corners, near, sites.points(), |_| 0.0)
    }
}

/// What is done with the pieces. No closures: they would not inherit the instruction set, and its functions must be
/// `#[inline(always)]` to do so.
pub(crate) trait Visitor {
    /// A triangle that lies in the cell of one site: true if that is all the visitor wants to know of it. Not asked with
    /// normals in the distance.
    fn whole(&mut self, corners: &[[f64; 3]; 3], site: u32) -> bool;

    fn piece(&mut self, cut: &Cut<'_>);
}

/// Shows pieces in space.
struct Shower<Visit> {
    visit: Visit,
    polygon: Vec<[f64; 3]>,
    labels: Vec<Label>,
}

impl<Visit: FnMut(&Piece<'_>)> Visitor for Shower<Visit> {
    #[inline(always)]
    fn whole(&mut self, _: &[[f64; 3]; 3], _: u32) -> bool {
        false
    }

    #[inline(always)]
    fn piece(&mut self, cut: &Cut<'_>) {
        self.polygon.clear();
        self.labels.clear();
        let mut doubled = 0.0;
        for (k, corner) in cut.polygon.iter().enumerate() {
            let next = cut.polygon[(k + 1) % cut.polygon.len()];
            doubled += corner.u * next.v - corner.v * next.u;
            let x = cut.frame.space([corner.u, corner.v, 0.0]);
            self.polygon
                .push(std::array::from_fn(|axis| cut.frame.origin[axis] + x[axis]));
            self.labels.push(match corner.mark {
                mark if mark < 0 => Label::Edge((-1 - mark) as u8),
                other => Label::Site(cut.candidates[other as usize].site),
            });
        }
        (self.visit)(&Piece {
            triangle: cut.triangle,
            site: cut.candidates[cut.owner].site,
            polygon: &self.polygon,
            labels: &self.labels,
            area: 0.5 * doubled,
        });
    }
}

/// Cuts a chunk of triangles in vector registers.
struct Sweep<'a, Pieces> {
    diagram: &'a RestrictedVoronoi,
    triangles: &'a [u32],
    points: &'a [[f64; 3]],
    sites: &'a PointTree,
    compatibility: Option<Compatibility<'a>>,
    scratch: &'a mut Scratch,
    visitor: Pieces,
}

impl<Pieces: Visitor> Kernel for Sweep<'_, Pieces> {
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
                if self.compatibility.is_none()
                    && reach.is_whole()
                    && self.visitor.whole(&reach.corners, reach.reference)
                {
                    continue;
                }
                self.scratch.cutter.cut::<V>(
                    reach,
                    at_hand.then_some(&self.scratch.some),
                    self.sites,
                    self.compatibility,
                    diagram.first,
                    &mut self.visitor,
                );
            }
        }
        self.scratch.reaches = reaches;
    }
}
