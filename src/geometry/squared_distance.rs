//! The Voronoi squared distance from a surface to sites, with exact derivatives (Nivoliers, Yan, Lévy 2012).
//!
//! `F = sum_i int_(S cap Vor(i)) f_i(x) dx` with `f_i(x) = |A (x - y_i)|^2 + c_i`, over the surface `S` and the
//! Voronoi cells of the sites `y_i`. `A = I + (s - 1) N N^T` weighs the normal direction by `s`; `N` belongs to the
//! triangle or to the site. `c_i = w (1 - n_i . N_S)` is the optional normal compatibility, which takes part in the
//! diagram as well.
//!
//! With a template's vertices as sites and the target as surface this is `F_(T -> S)`; with samples of the target as
//! sites and the template as surface it is `F_(S -> T)`.
//!
//! Derivatives follow the transport theorem rather than the vertices of the diagram: inside a cell the integrand is
//! differentiated, and across the edge between the cells of `i` and `j`, which moves with normal velocity `v`, the value
//! changes by `int (f_i - f_j) v`. On the edge `f_i - f_j` is the difference of the anisotropic parts alone, so that
//! without anisotropy edges contribute nothing. This is the same gradient as by the Jacobians of the diagram's vertices
//! (equations 13 and 14 of the paper, Lévy and Liu 2010), with no small systems to solve.
//!
//! Guaranteed: the same bits with any number of threads. Not guaranteed: second derivatives; the value itself has kinks
//! where the surface touches the medial axis of the sites along a set of positive area.

use super::point_tree::PointTree;
use super::restricted_voronoi::{Candidate, Compatibility, Cut, Error, RestrictedVoronoi, Visitor};
use crate::linalg::vector3::{add, cross, dot, subtract, times};
use rayon::prelude::*;
use std::ops::Range;

/// Weights the distance along normals.
#[derive(Clone, Copy, Debug, Default)]
pub enum Anisotropy<'a> {
    /// The plain distance.
    #[default]
    None,
    /// Factor `s` along the normal of the surface's triangle.
    Facets(f64),
    /// Factor `s` along the unit normal of the site; a site without a normal has the zero vector.
    Sites(f64, &'a [[f64; 3]]),
}

/// Which derivative with respect to the sites is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Derivative {
    /// The derivative of the value.
    #[default]
    Complete,
    /// Equation 4 of the paper, `2 sum m M (y - g)`: cells stay, exact without anisotropy only.
    Paper,
}

/// What to integrate.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    pub anisotropy: Anisotropy<'a>,
    pub compatibility: Option<Compatibility<'a>>,
    pub derivative: Derivative,
}

/// What to write besides the value. Everything asked for is overwritten.
#[derive(Debug, Default)]
pub struct Wanted<'a> {
    /// The gradient by the sites.
    pub sites: Option<&'a mut [[f64; 3]]>,
    /// The gradient by the surface's vertices.
    pub surface: Option<&'a mut [[f64; 3]]>,
    /// The gradient by the sites' normals, as independent numbers, through the compatibility and the anisotropy.
    pub normals: Option<&'a mut [[f64; 3]]>,
    /// The area of every site's cell.
    pub areas: Option<&'a mut [f64]>,
    /// The integral of `x` over every site's cell.
    pub moments: Option<&'a mut [[f64; 3]]>,
}

/// Numbers kept for a site: gradient, gradient by the normal, moment, area.
const NUMBERS: usize = 10;
const GRADIENT: usize = 0;
const NORMAL: usize = 3;
const MOMENT: usize = 6;
const AREA: usize = 9;

/// What one chunk of triangles contributes.
#[derive(Debug, Default)]
struct Chunk {
    value: f64,
    /// Sites met, and their sums.
    sites: Vec<u32>,
    sums: Vec<[f64; NUMBERS]>,
    /// Triangles met, and the gradients by their three vertices.
    triangles: Vec<u32>,
    forces: Vec<[[f64; 3]; 3]>,
    /// A hash table from sites to places in `sites`.
    table: Vec<u32>,
}

impl Chunk {
    fn clear(&mut self) {
        self.value = 0.0;
        self.sites.clear();
        self.sums.clear();
        self.triangles.clear();
        self.forces.clear();
        self.table.fill(u32::MAX);
    }

    #[inline(always)]
    fn slot(&self, site: u32) -> usize {
        // Fibonacci hashing; the table's size is a power of two.
        let mut slot = (site.wrapping_mul(0x9e37_79b9) as usize) & (self.table.len() - 1);
        while self.table[slot] != u32::MAX && self.sites[self.table[slot] as usize] != site {
            slot = (slot + 1) & (self.table.len() - 1);
        }
        slot
    }

    /// The sums of a site.
    #[inline(always)]
    fn sums(&mut self, site: u32) -> &mut [f64; NUMBERS] {
        if self.table.len() < 2 * (self.sites.len() + 1) {
            let size = (4 * (self.sites.len() + 1)).next_power_of_two().max(64);
            self.table.clear();
            self.table.resize(size, u32::MAX);
            for place in 0..self.sites.len() {
                let slot = self.slot(self.sites[place]);
                self.table[slot] = place as u32;
            }
        }
        let slot = self.slot(site);
        if self.table[slot] == u32::MAX {
            self.table[slot] = self.sites.len() as u32;
            self.sites.push(site);
            self.sums.push([0.0; NUMBERS]);
        }
        &mut self.sums[self.table[slot] as usize]
    }
}

/// Evaluates squared distance terms over one surface, reusing its memory.
#[derive(Debug)]
pub struct SquaredDistance {
    diagram: RestrictedVoronoi,
    chunks: Vec<Chunk>,
}

/// Which derivatives a piece must provide.
#[derive(Clone, Copy)]
struct Work {
    sites: bool,
    surface: bool,
    normals: bool,
    /// Edges move and the integrand jumps across them.
    edges: bool,
    /// Sums by site are wanted at all,
    sums: bool,
    /// and areas or moments among them.
    cells: bool,
}

impl SquaredDistance {
    /// Prepares for the surface with these triangles; see [`RestrictedVoronoi::new`].
    pub fn new(points: &[[f64; 3]], cells: &[[u32; 3]]) -> Result<SquaredDistance, Error> {
        let diagram = RestrictedVoronoi::new(points, cells)?;
        let chunks = (0..diagram.chunks()).map(|_| Chunk::default()).collect();
        Ok(SquaredDistance { diagram, chunks })
    }

    /// The diagram that the terms are integrated over.
    pub fn diagram(&mut self) -> &mut RestrictedVoronoi {
        &mut self.diagram
    }

    /// The value of the term, and what is `wanted`. The value is infinite, and nothing wanted is written, when a
    /// coordinate is not finite or there are no sites; a surface without triangles has the value 0 even then.
    ///
    /// # Panics
    /// When an array has another length than its documentation says.
    pub fn evaluate(
        &mut self,
        points: &[[f64; 3]],
        sites: &PointTree,
        options: &Options<'_>,
        wanted: Wanted<'_>,
    ) -> f64 {
        let count = sites.points().len();
        let matches = |length: Option<usize>, expected: usize| length.is_none_or(|length| length == expected);
        assert!(
            matches(wanted.sites.as_deref().map(<[_]>::len), count)
                && matches(wanted.normals.as_deref().map(<[_]>::len), count)
                && matches(wanted.areas.as_deref().map(<[_]>::len), count)
                && matches(wanted.moments.as_deref().map(<[_]>::len), count),
            "as many results as sites"
        );
        assert!(
            matches(wanted.surface.as_deref().map(<[_]>::len), points.len()),
            "as many gradients as vertices"
        );
        let site_normals = match options.anisotropy {
            Anisotropy::Sites(_, normals) => Some(normals.len()),
            _ => None,
        };
        assert!(
            matches(site_normals, count) && matches(options.compatibility.map(|c| c.normals.len()), count),
            "as many normals as sites"
        );
        let anisotropic = match options.anisotropy {
            Anisotropy::None => false,
            Anisotropy::Facets(s) | Anisotropy::Sites(s, _) => s != 1.0,
        };
        let work = Work {
            sites: wanted.sites.is_some(),
            surface: wanted.surface.is_some(),
            normals: wanted.normals.is_some(),
            edges: anisotropic
                && ((wanted.sites.is_some() && options.derivative == Derivative::Complete)
                    || wanted.surface.is_some()
                    || wanted.normals.is_some()),
            cells: wanted.areas.is_some() || wanted.moments.is_some(),
            sums: wanted.sites.is_some()
                || wanted.normals.is_some()
                || wanted.areas.is_some()
                || wanted.moments.is_some(),
        };
        // Whole triangles of the plain distance have a short formula.
        let plain = !anisotropic && options.compatibility.is_none() && !(work.surface || work.normals);
        let positions = sites.points();
        let done = self
            .diagram
            .sweep(points, sites, options.compatibility, &mut self.chunks, |chunk| {
                chunk.clear();
                Integral {
                    chunk,
                    options,
                    work,
                    plain,
                    positions,
                }
            });
        if !done {
            return if self.diagram.cells().is_empty() && sites.is_finite() {
                0.0
            } else {
                f64::INFINITY
            };
        }
        let Self { diagram, chunks } = self;
        if let Some(surface) = wanted.surface {
            in_ranges(surface, [0.0; 3], |range, surface| {
                for chunk in &*chunks {
                    for (&triangle, forces) in chunk.triangles.iter().zip(&chunk.forces) {
                        for (&vertex, &force) in diagram.cells()[triangle as usize].iter().zip(forces) {
                            if range.contains(&(vertex as usize)) {
                                let total = &mut surface[vertex as usize - range.start];
                                *total = add(*total, force);
                            }
                        }
                    }
                }
            });
        }
        let gather = |target: Option<&mut [[f64; 3]]>, first: usize| {
            let Some(target) = target else { return };
            in_ranges(target, [0.0; 3], |range, target| {
                for chunk in &*chunks {
                    for (&site, sums) in chunk.sites.iter().zip(&chunk.sums) {
                        if range.contains(&(site as usize)) {
                            let total = &mut target[site as usize - range.start];
                            *total = add(*total, [sums[first], sums[first + 1], sums[first + 2]]);
                        }
                    }
                }
            });
        };
        gather(wanted.sites, GRADIENT);
        gather(wanted.normals, NORMAL);
        gather(wanted.moments, MOMENT);
        if let Some(areas) = wanted.areas {
            in_ranges(areas, 0.0, |range, areas| {
                for chunk in &*chunks {
                    for (&site, sums) in chunk.sites.iter().zip(&chunk.sums) {
                        if range.contains(&(site as usize)) {
                            areas[site as usize - range.start] += sums[AREA];
                        }
                    }
                }
            });
        }
        chunks.iter().map(|chunk| chunk.value).sum()
    }
}

/// From this number of sums on, threads share them.
const MANY: usize = 1 << 13;
/// but no more than so many, for going through all takes time as well.
const MOST: usize = 8;

/// Clears sums and lets `add` add to those with indices in a range, for all ranges. Every thread goes through all that
/// is to be added and takes its own, so that each sum is added up in one order however many threads there are.
fn in_ranges<T: Copy + Send + Sync>(sums: &mut [T], zero: T, add: impl Fn(Range<usize>, &mut [T]) + Sync) {
    let threads = if sums.len() < MANY {
        1
    } else {
        rayon::current_num_threads().min(MOST)
    };
    let size = sums.len().div_ceil(threads).max(1);
    let part = |(index, sums): (usize, &mut [T])| {
        sums.fill(zero);
        add(index * size..index * size + sums.len(), sums);
    };
    if threads == 1 {
        sums.chunks_mut(size).enumerate().for_each(part);
    } else {
        sums.par_chunks_mut(size).enumerate().for_each(part);
    }
}

/// Integrates over the pieces of a chunk.
struct Integral<'a> {
    chunk: &'a mut Chunk,
    options: &'a Options<'a>,
    work: Work,
    /// Whether whole triangles are done by the short formula.
    plain: bool,
    positions: &'a [[f64; 3]],
}

impl Visitor for Integral<'_> {
    #[inline(always)]
    fn whole(&mut self, corners: &[[f64; 3]; 3], site: u32) -> bool {
        if self.plain {
            triangle(self.chunk, corners, site, self.positions[site as usize], self.work);
        }
        self.plain
    }

    #[inline(always)]
    fn piece(&mut self, cut: &Cut<'_>) {
        piece(self.chunk, cut, self.options, self.work);
    }
}

#[inline(always)]
fn accumulate(sums: &mut [f64; NUMBERS], first: usize, x: [f64; 3]) {
    for axis in 0..3 {
        sums[first + axis] += x[axis];
    }
}

/// The anisotropic part `q(x) = (s^2 - 1) (n . (x - y))^2` of a candidate's integrand, in the triangle's frame.
struct Normal {
    factor: f64,
    direction: [f64; 3],
}

impl Normal {
    #[inline(always)]
    fn of(options: &Options<'_>, cut: &Cut<'_>, candidate: &Candidate) -> Normal {
        match options.anisotropy {
            Anisotropy::None => Normal {
                factor: 0.0,
                direction: [0.0; 3],
            },
            Anisotropy::Facets(s) => Normal {
                factor: s * s - 1.0,
                direction: [0.0, 0.0, 1.0],
            },
            Anisotropy::Sites(s, normals) => Normal {
                factor: s * s - 1.0,
                direction: cut.frame.local(normals[candidate.site as usize]),
            },
        }
    }

    /// `q` at the point `(u, v)` of the plane.
    fn at(&self, candidate: &Candidate, u: f64, v: f64) -> f64 {
        let [p, q, h] = candidate.local;
        let along = dot(self.direction, [u - p, v - q, -h]);
        self.factor * along * along
    }
}

/// Adds a triangle that lies in one cell, for the plain distance and without derivatives by the surface.
#[inline(always)]
fn triangle(chunk: &mut Chunk, corners: &[[f64; 3]; 3], site: u32, position: [f64; 3], work: Work) {
    let [a, b, c] = corners.map(|corner| subtract(corner, position));
    // Not from differences to the site: they lose a triangle that is far away.
    let across = cross(subtract(corners[1], corners[0]), subtract(corners[2], corners[0]));
    let area = 0.5 * dot(across, across).sqrt();
    if !(area > 0.0) {
        return;
    }
    let sum = add(add(a, b), c);
    chunk.value += area * (1.0 / 12.0) * (dot(a, a) + dot(b, b) + dot(c, c) + dot(sum, sum));
    if work.sums {
        let sums = chunk.sums(site);
        if work.sites {
            accumulate(sums, GRADIENT, times(sum, -2.0 / 3.0 * area));
        }
        if work.cells {
            accumulate(sums, MOMENT, add(times(sum, area / 3.0), times(position, area)));
            sums[AREA] += area;
        }
    }
}

/// Adds one piece to its chunk. All vectors are in the triangle's frame until they are stored.
#[inline(always)]
fn piece(chunk: &mut Chunk, cut: &Cut<'_>, options: &Options<'_>, work: Work) {
    let frame = cut.frame;
    let own = &cut.candidates[cut.owner];
    let first = cut.polygon[0];
    // Area, first and second moments about the first vertex, by the fan of triangles there.
    let (mut area, mut moment, mut second) = (0.0, [0.0; 2], [0.0; 3]);
    let mut b = [cut.polygon[1].u - first.u, cut.polygon[1].v - first.v];
    for corner in &cut.polygon[2..] {
        let c = [corner.u - first.u, corner.v - first.v];
        let doubled = b[0] * c[1] - b[1] * c[0];
        let sum = [b[0] + c[0], b[1] + c[1]];
        area += doubled;
        moment[0] += doubled * sum[0];
        moment[1] += doubled * sum[1];
        second[0] += doubled * (sum[0] * sum[0] + b[0] * b[0] + c[0] * c[0]);
        second[1] += doubled * (sum[0] * sum[1] + b[0] * b[1] + c[0] * c[1]);
        second[2] += doubled * (sum[1] * sum[1] + b[1] * b[1] + c[1] * c[1]);
        b = c;
    }
    let area = 0.5 * area;
    let moment = [moment[0] * (1.0 / 6.0), moment[1] * (1.0 / 6.0), 0.0];
    let second = second.map(|x| x * (1.0 / 24.0));
    // Second moments times a vector.
    let spread = |x: [f64; 3]| {
        [
            second[0] * x[0] + second[1] * x[1],
            second[1] * x[0] + second[2] * x[1],
            0.0,
        ]
    };
    // From the site to the first vertex.
    let e = [first.u - own.local[0], first.v - own.local[1], -own.local[2]];
    let normal = Normal::of(options, cut, own);
    let n = normal.direction;
    // int (x - y)
    let total = add(times(e, area), moment);
    let plain = area * dot(e, e) + 2.0 * dot(e, moment) + second[0] + second[2];
    let along = dot(n, e);
    let anisotropic = along * along * area + 2.0 * along * dot(n, moment) + dot(n, spread(n));
    let value = plain + normal.factor * anisotropic + own.offset * area;
    chunk.value += value;
    let stretched = |x: [f64; 3]| add(x, times(n, normal.factor * dot(n, x)));
    if work.sums {
        let sums = chunk.sums(own.site);
        if work.sites {
            accumulate(sums, GRADIENT, frame.space(times(stretched(total), -2.0)));
        }
        if work.normals {
            let mut gradient = [0.0; 3];
            if let Anisotropy::Sites(..) = options.anisotropy {
                // int (x - y) (x - y)^T n
                let product = add(add(times(e, dot(total, n)), times(moment, along)), spread(n));
                gradient = times(product, 2.0 * normal.factor);
            }
            if let Some(compatibility) = options.compatibility {
                gradient[2] -= compatibility.weight * area;
            }
            accumulate(sums, NORMAL, frame.space(gradient));
        }
        if work.cells {
            let centre = frame.space(add([first.u * area, first.v * area, 0.0], moment));
            accumulate(sums, MOMENT, add(centre, times(frame.origin, area)));
            sums[AREA] += area;
        }
    }
    let slopes = if work.surface {
        frame.barycentric_gradients()
    } else {
        [[0.0; 2]; 3]
    };
    let barycentric = |k: usize, u: f64, v: f64| {
        let [a, b] = frame.corners[(k + 1) % 3];
        slopes[k][0] * (u - a) + slopes[k][1] * (v - b)
    };
    if work.surface {
        let mut forces = [[0.0; 3]; 3];
        for k in 0..3 {
            let slope = [slopes[k][0], slopes[k][1], 0.0];
            let share = barycentric(k, first.u, first.v);
            // int lambda_k (x - y) and int lambda_k
            let product = add(add(times(total, share), times(e, dot(slope, moment))), spread(slope));
            let weight = share * area + dot(slope, moment);
            let mut force = times(product, 2.0);
            match options.anisotropy {
                Anisotropy::None => {}
                // The triangle's normal turns by -(N . dx_k) grad lambda_k.
                Anisotropy::Facets(_) => {
                    force[2] += 2.0 * normal.factor * e[2] * (weight - dot(slope, total));
                }
                Anisotropy::Sites(..) => force = add(force, times(n, 2.0 * normal.factor * dot(n, product))),
            }
            if let Some(compatibility) = options.compatibility {
                let turned = frame.local(compatibility.normals[own.site as usize]);
                force[2] += compatibility.weight * area * dot(slope, turned);
            }
            // The area changes as well.
            forces[k] = frame.space(add(force, times(slope, value)));
        }
        store(chunk, cut.triangle, forces);
    }
    if work.edges {
        edges(chunk, cut, options, work, &normal, slopes);
    }
}

/// Adds to the gradients by a triangle's vertices.
fn store(chunk: &mut Chunk, triangle: u32, forces: [[f64; 3]; 3]) {
    if chunk.triangles.last() != Some(&triangle) {
        chunk.triangles.push(triangle);
        chunk.forces.push([[0.0; 3]; 3]);
    }
    if let Some(total) = chunk.forces.last_mut() {
        for k in 0..3 {
            total[k] = add(total[k], forces[k]);
        }
    }
}

/// Adds what the moving edges of a piece contribute. Each edge is treated once, from the side of the smaller index.
fn edges(chunk: &mut Chunk, cut: &Cut<'_>, options: &Options<'_>, work: Work, normal: &Normal, slopes: [[f64; 2]; 3]) {
    let frame = cut.frame;
    let own = &cut.candidates[cut.owner];
    let size = cut.polygon.len();
    // Two Gauss points integrate the cubic integrands exactly.
    let gauss = 0.5 / 3.0f64.sqrt();
    for k in 0..size {
        let from = cut.polygon[k];
        if from.mark < 0 {
            continue;
        }
        let other = &cut.candidates[from.mark as usize];
        if other.site < own.site {
            continue;
        }
        let to = cut.polygon[if k + 1 == size { 0 } else { k + 1 }];
        let (du, dv) = (to.u - from.u, to.v - from.v);
        let length = (du * du + dv * dv).sqrt();
        let across = subtract(other.local, own.local);
        let steepness = (across[0] * across[0] + across[1] * across[1]).sqrt();
        if !(length > 0.0 && steepness > 0.0) {
            continue;
        }
        let opposite = Normal::of(options, cut, other);
        let (mut at_own, mut at_other) = ([0.0; 3], [0.0; 3]);
        let mut weights = [0.0; 3];
        let mut whole = 0.0;
        for t in [0.5 - gauss, 0.5 + gauss] {
            let (u, v) = (from.u + t * du, from.v + t * dv);
            let jump = (normal.at(own, u, v) - opposite.at(other, u, v)) * 0.5 * length / steepness;
            let x = [u, v, 0.0];
            at_own = add(at_own, times(subtract(x, own.local), jump));
            at_other = add(at_other, times(subtract(x, other.local), jump));
            whole += jump;
            if work.surface {
                for k in 0..3 {
                    let [a, b] = frame.corners[(k + 1) % 3];
                    weights[k] += jump * (slopes[k][0] * (u - a) + slopes[k][1] * (v - b));
                }
            }
        }
        if work.sites && options.derivative == Derivative::Complete {
            accumulate(chunk.sums(own.site), GRADIENT, frame.space(at_own));
            accumulate(chunk.sums(other.site), GRADIENT, frame.space(times(at_other, -1.0)));
        }
        if let (true, Some(compatibility)) = (work.normals, options.compatibility) {
            let turn = times(frame.normal, 0.5 * compatibility.weight * whole);
            accumulate(chunk.sums(own.site), NORMAL, turn);
            accumulate(chunk.sums(other.site), NORMAL, times(turn, -1.0));
        }
        if work.surface {
            let mut forces = [[0.0; 3]; 3];
            for k in 0..3 {
                let mut force = times(across, -weights[k]);
                if let Some(compatibility) = options.compatibility {
                    let difference = frame.local(subtract(
                        compatibility.normals[own.site as usize],
                        compatibility.normals[other.site as usize],
                    ));
                    let turn = slopes[k][0] * difference[0] + slopes[k][1] * difference[1];
                    force[2] -= 0.5 * compatibility.weight * whole * turn;
                }
                forces[k] = frame.space(force);
            }
            store(chunk, cut.triangle, forces);
        }
    }
}
