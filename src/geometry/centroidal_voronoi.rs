//! Restricted centroidal Voronoi tessellations: sites spread over a surface so that each lies at the centroid of its
//! cell.
//!
//! They minimize `F = sum_i int_(S cap Vor(i)) |x - y_i|^2 dx` over the sites `y_i`, which move freely in space. The
//! gradient is `2 m_i (y_i - g_i)` with the areas `m_i` and the centroids `g_i` of the cells (Du, Faber, Gunzburger
//! 1999). L-BFGS needs far fewer evaluations than Lloyd's iteration `y_i = g_i` (Liu et al. 2009; Yan et al. 2009).
//!
//! Guaranteed: neither method raises the energy; the same bits with any number of threads. Not guaranteed: the global
//! minimum.

use super::point_tree::PointTree;
use super::restricted_voronoi::Error;
use super::squared_distance::{Options, SquaredDistance, Wanted};
use crate::linalg::vector3::{add, cross, dot, times};
use crate::mesh::{length, subtract};
use crate::optimize::entries::scale;
use crate::optimize::lbfgs::Lbfgs;
use crate::optimize::{Counters, Iterate, Objective, Observer, Silent, Solution, StopReason, Stopping};

/// How sites are moved to the centroids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    Lbfgs,
    Lloyd,
}

/// How long sites are moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxation {
    pub method: Method,
    pub iterations: u64,
    /// Converged when the root mean square of the distances of sites to centroids, weighted by the cells' areas over
    /// their mean, is below this share of the spacing, the square root of the mean area.
    pub tolerance: f64,
}

impl Default for Relaxation {
    fn default() -> Relaxation {
        Relaxation {
            method: Method::Lbfgs,
            iterations: 100,
            tolerance: 1e-4,
        }
    }
}

/// Random points on a surface, evenly by area: the surface is divided, along the order of its triangles, into `count`
/// strips of one area, and each holds one point. Fewer than `count` only when the surface has no area.
pub fn scatter(points: &[[f64; 3]], cells: &[[u32; 3]], count: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut sums = Vec::with_capacity(cells.len());
    let mut area = 0.0;
    for cell in cells {
        let [a, b, c] = cell.map(|vertex| points[vertex as usize]);
        area += 0.5 * length(cross(subtract(b, a), subtract(c, a)));
        sums.push(area);
    }
    if !(area > 0.0 && area.is_finite()) {
        return Vec::new();
    }
    let mut state = seed;
    let mut random = || {
        // SplitMix64 (Steele, Lea, Flood 2014).
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..count)
        .map(|index| {
            let place = (index as f64 + random()) / count as f64 * area;
            let triangle = sums.partition_point(|&sum| sum <= place).min(cells.len() - 1);
            let (s, t) = (random(), random());
            let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
            let [a, b, c] = cells[triangle].map(|vertex| points[vertex as usize]);
            add(a, add(times(subtract(b, a), s), times(subtract(c, a), t)))
        })
        .collect()
}

/// The energy over the sites, in units in which its curvature is about 1 and its gradient the root mean square
/// distance of sites to centroids over the spacing.
struct Energy<'a> {
    term: &'a mut SquaredDistance,
    points: &'a [[f64; 3]],
    tree: PointTree,
    sites: Vec<[f64; 3]>,
    gradient: Vec<[f64; 3]>,
    /// An unknown times this is a coordinate.
    unit: f64,
    /// A value times this is an energy.
    scale: f64,
}

impl Energy<'_> {
    fn place(&mut self, x: &[f64]) {
        scale(x, self.unit, self.sites.as_flattened_mut());
        self.tree.set(&self.sites);
    }
}

impl Objective for Energy<'_> {
    fn dimension(&self) -> usize {
        3 * self.sites.len()
    }

    fn value(&mut self, x: &[f64]) -> f64 {
        self.place(x);
        let value = self
            .term
            .evaluate(self.points, &self.tree, &Options::default(), Wanted::default());
        value / self.scale
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        self.place(x);
        let wanted = Wanted {
            sites: Some(&mut self.gradient),
            ..Wanted::default()
        };
        let value = self.term.evaluate(self.points, &self.tree, &Options::default(), wanted);
        scale(self.gradient.as_flattened(), self.unit / self.scale, gradient);
        value / self.scale
    }
}

/// Tells the observer energies in the surface's units.
struct Translator<'a> {
    observer: &'a mut dyn Observer,
    scale: f64,
}

impl Observer for Translator<'_> {
    fn phase(&mut self, name: &str) {
        self.observer.phase(name);
    }
    fn iterate(&mut self, iterate: &Iterate) {
        self.observer.iterate(&Iterate {
            energy: iterate.energy * self.scale,
            ..*iterate
        });
    }
    fn stop(&self) -> Option<StopReason> {
        self.observer.stop()
    }
}

/// Moves `sites` to a centroidal tessellation of the surface that `term` was prepared for, with its vertices at `points`.
/// The solution holds the sites' coordinates, the energy, and the root mean square distance of sites to centroids over
/// the spacing as its gradient's norm; so do the iterates told to the observer.
///
/// # Panics
/// When `points` are not as many as `term` was prepared for.
pub fn relax(
    term: &mut SquaredDistance,
    points: &[[f64; 3]],
    sites: &[[f64; 3]],
    relaxation: &Relaxation,
    observer: &mut dyn Observer,
) -> Solution {
    let count = sites.len().max(1) as f64;
    let area: f64 = term
        .diagram()
        .cells()
        .iter()
        .map(|cell| {
            let [a, b, c] = cell.map(|vertex| points[vertex as usize]);
            0.5 * length(cross(subtract(b, a), subtract(c, a)))
        })
        .sum();
    let mean = area / count;
    // Unknowns in units of spacing times the root of the number of sites.
    let unit = (mean * count).sqrt();
    let unit = if unit > 0.0 && unit.is_finite() { unit } else { 1.0 };
    let scale = 2.0 * mean * unit * unit;
    let scale = if scale > 0.0 && scale.is_finite() { scale } else { 1.0 };
    let mut energy = Energy {
        term,
        points,
        tree: PointTree::default(),
        sites: sites.to_vec(),
        gradient: vec![[0.0; 3]; sites.len()],
        unit,
        scale,
    };
    let start: Vec<f64> = sites.iter().flatten().map(|x| x / unit).collect();
    let mut solution = match relaxation.method {
        Method::Lbfgs => {
            let minimizer = Lbfgs {
                stopping: Stopping {
                    gradient_norm: relaxation.tolerance,
                    relative_decrement: 0.0,
                    relative_change: 0.0,
                    absolute_change: 0.0,
                    iterations: relaxation.iterations,
                },
                ..Lbfgs::default()
            };
            minimizer.minimize(&mut energy, start, &mut Translator { observer, scale })
        }
        Method::Lloyd => lloyd(&mut energy, start, relaxation, &mut Translator { observer, scale }),
    };
    for x in &mut solution.x {
        *x *= unit;
    }
    solution.value *= scale;
    solution
}

/// Lloyd's iteration. The unknowns are scaled as in [`Energy`].
fn lloyd(energy: &mut Energy<'_>, start: Vec<f64>, relaxation: &Relaxation, observer: &mut dyn Observer) -> Solution {
    let count = energy.sites.len();
    let mut x = start;
    let mut areas = vec![0.0; count];
    let mut counters = Counters::default();
    loop {
        energy.place(&x);
        let wanted = Wanted {
            sites: Some(&mut energy.gradient),
            areas: Some(&mut areas),
            ..Wanted::default()
        };
        let value = energy
            .term
            .evaluate(energy.points, &energy.tree, &Options::default(), wanted)
            / energy.scale;
        counters.evaluations += 1;
        let squares: f64 = energy.gradient.iter().map(|&force| dot(force, force)).sum();
        let gradient_norm = squares.sqrt() * energy.unit / energy.scale;
        let end = |stop: StopReason, reason: String| Some((stop, reason));
        let stop = if !value.is_finite() || !gradient_norm.is_finite() {
            end(
                StopReason::NotFinite,
                "the energy or its gradient is not a finite number".into(),
            )
        } else {
            observer.iterate(&Iterate {
                iteration: counters.iterations,
                energy: value,
                gradient_norm,
                step: if counters.iterations > 0 { 1.0 } else { 0.0 },
            });
            if gradient_norm < relaxation.tolerance || gradient_norm == 0.0 {
                let reason = format!(
                    "gradient norm {gradient_norm:.3e} is below {:.3e}",
                    relaxation.tolerance
                );
                end(StopReason::Converged, reason)
            } else if let Some(reason) = observer.stop() {
                end(reason, "stopped from outside".into())
            } else if counters.iterations >= relaxation.iterations {
                let reason = format!("{} iterations were not enough", relaxation.iterations);
                end(StopReason::StepLimit, reason)
            } else {
                None
            }
        };
        if let Some((stop, reason)) = stop {
            return Solution {
                x,
                value,
                gradient_norm,
                stop,
                reason,
                counters,
            };
        }
        for (site, (force, &area)) in energy.gradient.iter().zip(&areas).enumerate() {
            if area > 0.0 {
                for axis in 0..3 {
                    x[3 * site + axis] -= 0.5 * force[axis] / area / energy.unit;
                }
            }
        }
        counters.iterations += 1;
    }
}

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    pub point: [f64; 3],
    /// Unit normal of the triangle.
    pub normal: [f64; 3],
    pub triangle: u32,
    /// Area of the cell that the sample stands for.
    pub area: f64,
}

/// The point of every site's cell that is nearest to the site; none for a site whose cell does not meet the surface.
pub fn project(term: &mut SquaredDistance, points: &[[f64; 3]], sites: &[[f64; 3]]) -> Vec<Option<Sample>> {
    let mut samples: Vec<Option<Sample>> = vec![None; sites.len()];
    let mut best = vec![f64::INFINITY; sites.len()];
    let cells = term.diagram().cells().to_vec();
    term.diagram().pieces(points, &PointTree::new(sites), None, |piece| {
        let site = piece.site as usize;
        let [a, b, c] = cells[piece.triangle as usize].map(|vertex| points[vertex as usize]);
        let normal = cross(subtract(b, a), subtract(c, a));
        let normal = times(normal, 1.0 / length(normal));
        let point = nearest_of_polygon(sites[site], piece.polygon, normal);
        let offset = subtract(point, sites[site]);
        let area = samples[site].map_or(0.0, |sample| sample.area) + piece.area;
        if dot(offset, offset) < best[site] {
            best[site] = dot(offset, offset);
            samples[site] = Some(Sample {
                point,
                normal,
                triangle: piece.triangle,
                area,
            });
        } else if let Some(sample) = &mut samples[site] {
            sample.area = area;
        }
    });
    samples
}

/// The point of a convex polygon, counter-clockwise about its unit normal, that is nearest to `x`.
fn nearest_of_polygon(x: [f64; 3], polygon: &[[f64; 3]], normal: [f64; 3]) -> [f64; 3] {
    let mut inside = true;
    let mut best = (f64::INFINITY, x);
    for (k, &from) in polygon.iter().enumerate() {
        let to = polygon[(k + 1) % polygon.len()];
        let edge = subtract(to, from);
        let offset = subtract(x, from);
        inside &= dot(cross(edge, offset), normal) >= 0.0;
        let t = (dot(offset, edge) / dot(edge, edge)).clamp(0.0, 1.0);
        let point = add(from, times(edge, if t.is_nan() { 0.0 } else { t }));
        let distance = subtract(x, point);
        if dot(distance, distance) < best.0 {
            best = (dot(distance, distance), point);
        }
    }
    if inside {
        subtract(x, times(normal, dot(subtract(x, polygon[0]), normal)))
    } else {
        best.1
    }
}

/// About `count` samples spread evenly over a surface: scattered, relaxed, and put onto the surface.
///
/// # Errors
/// When a triangle refers to a vertex that does not exist.
pub fn sample(
    points: &[[f64; 3]],
    cells: &[[u32; 3]],
    count: usize,
    seed: u64,
    relaxation: &Relaxation,
) -> Result<Vec<Sample>, Error> {
    let mut term = SquaredDistance::new(points, cells)?;
    let start = scatter(points, cells, count, seed);
    if start.is_empty() {
        return Ok(Vec::new());
    }
    let solution = relax(&mut term, points, &start, relaxation, &mut Silent);
    let (sites, _) = solution.x.as_chunks::<3>();
    Ok(project(&mut term, points, sites).into_iter().flatten().collect())
}
