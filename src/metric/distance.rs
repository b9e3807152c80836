//! Distances between surfaces: the Hausdorff distance both ways, mean and root of mean square (Cignoni, Rocchini,
//! Scopigno 1998, Metro: measuring error on simplified surfaces).
//!
//! Every triangle is cut into equal parts whose centres and corners are the samples, so that mean and root of mean
//! square are quadratures over the area. (Means over all samples of vertices, edges and faces alike, as some programs
//! print them, are larger: distances are largest along edges, which have no area.) The largest distance is then hunted
//! down by branch and bound from the largest sample: the distance to one triangle is convex, so over a piece of
//! surface it is largest at a corner, and the least of these over a few near triangles bounds the distance to the
//! whole surface.
//!
//! Guaranteed: `max <= true maximum <= bound`, up to rounding; `bound - max` is at most the tolerance unless the
//! budget of a triangle ran out, which `bound` then shows; the same input gives the same bits with any number of
//! threads. Where a sample comes near the maximum, the maximum is exact to a thousandth. Not guaranteed: anything
//! about orientation or connectivity, which play no part.

use super::{Better, Metric};
use crate::geometry::closest_point::{ClosestPoint, Nearest};
use crate::mesh::{self, TriangleMesh, area_vector, length, subtract};
use rayon::prelude::*;

/// Triangles per chunk of work.
const CHUNK: usize = 64;
/// Most parts along a triangle's edge: a few huge triangles must not take all time.
const PARTS: usize = 512;
/// but with no more parts along an edge than this many times the root of the triangle's area would have,
const SLENDER: f64 = 8.0;
/// or than this, whichever is more.
const FEW_PARTS: usize = 16;
/// Samples of a surface, beyond which the spacing grows.
const SAMPLES: f64 = 4e7;
/// Most pieces that the search for the maximum looks at in one triangle.
const PIECES: usize = 100_000;
/// Samples after which it is asked whether to stop,
const SAMPLES_AT_ONCE: usize = 1 << 20;
/// and chunks hunted at once, with so many pieces in each.
const HUNTS_AT_ONCE: usize = 64;
const PIECES_AT_ONCE: usize = 4096;
/// Triangles with a sample beyond this share of the largest are searched to [`SHARP`] of it.
const PROMISING: f64 = 0.8;
const SHARP: f64 = 1e-3;

/// Metrics of a fit: the fit is measured against the target and back.
pub const METRICS: &[Metric] = &[
    percent(
        "hausdorff",
        "d_H",
        "Largest distance between fit and target, both ways, in per cent of the diagonal of the target's box.",
    ),
    percent(
        "hausdorff_fit_to_target",
        "d_H S->T",
        "Largest distance of a point of the fit to the target, in per cent of the diagonal of the target's box.",
    ),
    percent(
        "hausdorff_target_to_fit",
        "d_H T->S",
        "Largest distance of a point of the target to the fit, in per cent of the diagonal of the target's box.",
    ),
    percent(
        "distance_mean",
        "d_mean",
        "Mean over both surfaces' areas of the distance to the other, in per cent of the diagonal of the target's box: the \
         larger of the two ways.",
    ),
    percent(
        "distance_rms",
        "d_rms",
        "Root of the mean square of the distance to the other surface, in per cent of the diagonal of the target's box: \
         the larger of the two ways.",
    ),
];

const fn percent(name: &'static str, symbol: &'static str, definition: &'static str) -> Metric {
    Metric {
        name,
        symbol,
        unit: "%",
        floor: Some(0.0),
        better: Better::Lower,
        definition,
    }
}

/// How finely distances are sampled; lengths in the units of the surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Largest edge of a part, but for slivers, for triangles that would have more than 512 parts along an edge, and for
    /// surfaces that would have more than forty million samples.
    pub spacing: f64,
    /// How far below the certain bound the maximum may stay.
    pub tolerance: f64,
    /// Area at a larger distance than this is summed.
    pub far: f64,
}

impl Sampling {
    /// Parts of 0.1 % of the diagonal, and a maximum certain to half of that; beyond 2 % it is far.
    pub fn of_diagonal(diagonal: f64) -> Sampling {
        Sampling {
            spacing: 1e-3 * diagonal,
            tolerance: 5e-4 * diagonal,
            far: 0.02 * diagonal,
        }
    }
}

/// Distances from one surface to another, in their units.
#[derive(Clone, Debug, PartialEq)]
pub struct Distance {
    /// The largest distance found; it is attained at `place`.
    pub max: f64,
    /// No point of the surface is farther than this.
    pub bound: f64,
    /// A point of the surface at the distance `max`.
    pub place: [f64; 3],
    /// Mean over the area.
    pub mean: f64,
    /// Root of the mean square over the area.
    pub rms: f64,
    /// Share of the area that is far.
    pub far: f64,
    /// The largest sample of every triangle.
    pub cells: Vec<f64>,
    pub samples: u64,
}

/// Distances both ways.
#[derive(Clone, Debug, PartialEq)]
pub struct Hausdorff {
    pub forward: Distance,
    pub backward: Distance,
    /// Diagonal of the second surface's box.
    pub diagonal: f64,
}

impl Hausdorff {
    /// The largest distance either way.
    pub fn max(&self) -> f64 {
        self.forward.max.max(self.backward.max)
    }

    /// A length in per cent of the diagonal.
    pub fn percent(&self, distance: f64) -> f64 {
        100.0 * distance / self.diagonal
    }
}

/// Distances between two surfaces, each against the other's tree, sampled relative to the second one's diagonal.
/// `stop` is asked every fraction of a second whether to give up.
///
/// # Errors
/// For a surface without triangles, for a second surface of size zero, and when `stop` says so.
pub fn hausdorff(first: &TriangleMesh, second: &TriangleMesh, stop: &dyn Fn() -> bool) -> Result<Hausdorff, String> {
    for (name, surface) in [("first", first), ("second", second)] {
        if surface.cells.is_empty() {
            return Err(format!("the {name} surface has no triangles, so there is no distance"));
        }
    }
    let diagonal = mesh::diagonal(&second.points);
    if !(diagonal > 0.0 && diagonal.is_finite()) {
        return Err(format!(
            "the second surface has the diagonal {diagonal}, so there is no scale"
        ));
    }
    let sampling = Sampling::of_diagonal(diagonal);
    let distance = |from: &TriangleMesh, to: &TriangleMesh| {
        one_sided(from, &ClosestPoint::new(to), sampling, stop).ok_or("stopped from outside")
    };
    Ok(Hausdorff {
        forward: distance(first, second)?,
        backward: distance(second, first)?,
        diagonal,
    })
}

/// Distances of points to a surface, in the order of the points.
pub fn of_points(points: &[[f64; 3]], surface: &ClosestPoint) -> Vec<f64> {
    const RUN: usize = 256;
    let mut distances = vec![0.0; points.len()];
    points
        .par_chunks(RUN)
        .zip(distances.par_chunks_mut(RUN))
        .for_each(|(points, distances)| {
            let mut found = [NOWHERE; RUN];
            let found = &mut found[..points.len()];
            surface.nearest_each(points, None, found);
            for (distance, nearest) in distances.iter_mut().zip(found) {
                *distance = nearest.squared_distance.sqrt();
            }
        });
    distances
}

const NOWHERE: Nearest = Nearest {
    squared_distance: f64::INFINITY,
    triangle: 0,
};

/// What a chunk of triangles adds up to.
struct Sums {
    area: f64,
    first: f64,
    second: f64,
    far: f64,
    samples: u64,
    max: f64,
    place: [f64; 3],
}

/// Distances from a surface to the one of a tree; `None` when `stop` says so, which is asked every fraction of a second.
///
/// # Panics
/// When the surface has no triangles.
pub fn one_sided(
    surface: &TriangleMesh,
    to: &ClosestPoint,
    sampling: Sampling,
    stop: &dyn Fn() -> bool,
) -> Option<Distance> {
    assert!(!surface.cells.is_empty(), "a surface with at least one triangle");
    let mut cells = vec![0.0; surface.cells.len()];
    let spacing = affordable(surface, sampling.spacing);
    let mut sums: Vec<Sums> = Vec::new();
    let mut begin = 0;
    while begin < surface.cells.len() {
        if stop() {
            return None;
        }
        // Whole chunks until there are enough samples for one go.
        let mut end = begin;
        let mut planned = 0;
        while end < surface.cells.len() && planned < SAMPLES_AT_ONCE {
            let next = (end + CHUNK).min(surface.cells.len());
            planned += surface.cells[end..next]
                .iter()
                .map(|&cell| 2 * parts_of(surface.corners(cell), spacing).pow(2))
                .sum::<usize>();
            end = next;
        }
        sums.par_extend(
            (surface.cells[begin..end].par_chunks(CHUNK))
                .zip(cells[begin..end].par_chunks_mut(CHUNK))
                .map(|(triangles, largest)| sample(surface, triangles, to, (spacing, sampling.far), largest)),
        );
        begin = end;
    }
    let (mut area, mut first, mut second, mut far, mut samples) = (0.0, 0.0, 0.0, 0.0, 0);
    let (mut max, mut place) = (0.0, surface.corners(surface.cells[0])[0]);
    for sums in &sums {
        area += sums.area;
        first += sums.first;
        second += sums.second;
        far += sums.far;
        samples += sums.samples;
        if sums.max > max {
            (max, place) = (sums.max, sums.place);
        }
    }
    let mut bound = max;
    // First those that may hold the maximum, then all others against the maximum that came out.
    for promising in [true, false] {
        let (sampled, tolerance) = if promising {
            (max, (SHARP * max).min(sampling.tolerance))
        } else {
            (
                sums.iter().fold(0.0, |max: f64, sums| max.max(sums.max)),
                sampling.tolerance,
            )
        };
        let mut hunts: Vec<Hunt> = (surface.cells.chunks(CHUNK).zip(cells.chunks(CHUNK)))
            .enumerate()
            .filter_map(|(chunk, (_, largest))| {
                let mut triangles = (0..largest.len()).filter(|&k| (largest[k] >= PROMISING * sampled) == promising);
                let triangles: Vec<usize> = triangles.by_ref().map(|k| chunk * CHUNK + k).collect();
                (!triangles.is_empty()).then(|| Hunt {
                    max,
                    place,
                    bound: max,
                    visits: 0,
                    triangles: triangles.into_iter(),
                    due: Vec::new(),
                    budget: 0,
                })
            })
            .collect();
        for hunts in hunts.chunks_mut(HUNTS_AT_ONCE) {
            while !hunts.iter().all(Hunt::is_over) {
                if stop() {
                    return None;
                }
                hunts
                    .par_iter_mut()
                    .for_each(|hunt| hunt.search(surface, to, tolerance));
            }
        }
        for hunt in hunts {
            samples += hunt.visits;
            bound = bound.max(hunt.bound);
            if hunt.max > max {
                (max, place) = (hunt.max, hunt.place);
            }
        }
    }
    // A surface without area has no mean; its samples weigh alike.
    let weight = if area > 0.0 { area } else { f64::NAN };
    Some(Distance {
        max,
        bound: bound.max(max),
        place,
        mean: first / weight,
        rms: (second / weight).sqrt(),
        far: far / weight,
        cells,
        samples,
    })
}

/// How many parts the edges of a triangle are divided into. Slivers have longer parts than the spacing asks for, so
/// that no triangle has many more samples than its area asks for.
fn parts(longest: f64, area_vector: [f64; 3], spacing: f64) -> usize {
    let side = (0.5 * length(area_vector)).sqrt();
    let most = ((SLENDER * side / spacing).ceil() as usize).clamp(FEW_PARTS, PARTS);
    ((longest / spacing).ceil() as usize).clamp(1, most)
}

fn parts_of(corners: [[f64; 3]; 3], spacing: f64) -> usize {
    let [a, b, c] = corners;
    let longest = length(subtract(b, a))
        .max(length(subtract(c, b)))
        .max(length(subtract(a, c)));
    parts(longest, area_vector(corners), spacing)
}

/// The spacing, or a larger one where a surface is so large that there would be too many samples.
fn affordable(surface: &TriangleMesh, spacing: f64) -> f64 {
    let samples: f64 = surface
        .cells
        .iter()
        .map(|&cell| {
            let parts = parts_of(surface.corners(cell), spacing) as f64;
            1.5 * parts * parts
        })
        .sum();
    spacing * (samples / SAMPLES).max(1.0).sqrt()
}

/// Samples a chunk of triangles at the centres and corners of their parts. Centres weigh 3/4 and corners 1/12, which
/// is exact for quadratic polynomials.
fn sample(
    surface: &TriangleMesh,
    triangles: &[[u32; 3]],
    to: &ClosestPoint,
    (spacing, far): (f64, f64),
    largest: &mut [f64],
) -> Sums {
    let mut sums = Sums {
        area: 0.0,
        first: 0.0,
        second: 0.0,
        far: 0.0,
        samples: 0,
        max: 0.0,
        place: surface.points[triangles[0][0] as usize],
    };
    let (mut points, mut weights, mut found): (Vec<[f64; 3]>, Vec<f64>, Vec<Nearest>) = Default::default();
    let mut hint = None;
    for (&triangle, largest) in triangles.iter().zip(largest) {
        let corners = surface.corners(triangle);
        let [a, b, c] = corners;
        let (first, second) = (subtract(b, a), subtract(c, a));
        let parts = parts_of(corners, spacing);
        points.clear();
        weights.clear();
        let scale = 1.0 / parts as f64;
        let at = |v: f64, w: f64| -> [f64; 3] {
            std::array::from_fn(|axis| a[axis] + scale * (v * first[axis] + w * second[axis]))
        };
        for row in 0..parts {
            // To and fro, so that each sample is near the one before.
            let count = 2 * (parts - row) - 1;
            for step in 0..count {
                let step = if row % 2 == 0 { step } else { count - 1 - step };
                let shift = if step % 2 == 0 { 1.0 / 3.0 } else { 2.0 / 3.0 };
                points.push(at((step / 2) as f64 + shift, row as f64 + shift));
                weights.push(0.75);
            }
        }
        for row in 0..=parts {
            let last = parts - row;
            for step in 0..=last {
                let step = if row % 2 == 0 { step } else { last - step };
                points.push(at(step as f64, row as f64));
                // A twelfth for every part that has this corner.
                let borders = [step == 0, row == 0, step == last].into_iter().filter(|&on| on).count();
                weights.push([0.5, 0.25, 1.0 / 12.0][borders.min(2)]);
            }
        }
        found.clear();
        found.resize(points.len(), NOWHERE);
        to.nearest_each(&points, hint, &mut found);
        hint = found.last().map(|nearest| nearest.triangle);
        let (mut one, mut two, mut beyond, mut most) = (0.0, 0.0, 0.0, (0.0, 0));
        for (index, nearest) in found.iter().enumerate() {
            if nearest.squared_distance > most.0 {
                most = (nearest.squared_distance, index);
            }
            one += weights[index] * nearest.squared_distance.sqrt();
            two += weights[index] * nearest.squared_distance;
            if nearest.squared_distance > far * far {
                beyond += weights[index];
            }
        }
        let area = length(area_vector(corners)) / 2.0;
        let weight = area * scale * scale;
        sums.area += area;
        sums.first += weight * one;
        sums.second += weight * two;
        sums.far += weight * beyond;
        sums.samples += points.len() as u64;
        *largest = most.0.sqrt();
        if *largest > sums.max {
            sums.max = *largest;
            sums.place = points[most.1];
        }
    }
    sums
}

/// The search for the largest distance of a piece of surface.
struct Hunt {
    max: f64,
    place: [f64; 3],
    /// Largest bound of the pieces that were dropped.
    bound: f64,
    visits: u64,
    /// Triangles to go, and what is left of the one begun.
    triangles: std::vec::IntoIter<usize>,
    due: Vec<Piece>,
    budget: usize,
}

/// A part of a triangle with the answers at its corners.
#[derive(Clone, Copy)]
struct Piece {
    corners: [[f64; 3]; 3],
    found: [Nearest; 3],
}

impl Piece {
    /// No point of the piece is farther from the surface than this.
    fn bound(&self, to: &ClosestPoint) -> f64 {
        let mut bound = f64::INFINITY;
        for (index, nearest) in self.found.iter().enumerate() {
            if self.found[..index]
                .iter()
                .any(|other| other.triangle == nearest.triangle)
            {
                continue;
            }
            let largest = (0..3)
                .map(|corner| {
                    if self.found[corner].triangle == nearest.triangle {
                        self.found[corner].squared_distance
                    } else {
                        to.squared_distance_to(nearest.triangle, self.corners[corner])
                    }
                })
                .fold(0.0, f64::max);
            bound = bound.min(largest.sqrt());
        }
        bound
    }
}

impl Hunt {
    fn is_over(&self) -> bool {
        self.due.is_empty() && self.triangles.len() == 0
    }

    /// Goes on for so many pieces.
    fn search(&mut self, surface: &TriangleMesh, to: &ClosestPoint, tolerance: f64) {
        for _ in 0..PIECES_AT_ONCE {
            let piece = match self.due.pop() {
                Some(piece) => piece,
                None => {
                    let Some(triangle) = self.triangles.next() else { return };
                    let corners = surface.corners(surface.cells[triangle]);
                    let mut found = [NOWHERE; 3];
                    to.nearest_each(&corners, None, &mut found);
                    self.visits += 3;
                    self.budget = PIECES;
                    Piece { corners, found }
                }
            };
            for (nearest, corner) in piece.found.iter().zip(piece.corners) {
                let distance = nearest.squared_distance.sqrt();
                if distance > self.max {
                    (self.max, self.place) = (distance, corner);
                }
            }
            let bound = piece.bound(to);
            if !(bound > self.max + tolerance) || self.budget == 0 {
                self.bound = self.bound.max(bound);
                continue;
            }
            self.budget -= 1;
            let [a, b, c] = piece.corners;
            let middle =
                |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis])) };
            let middles = [middle(b, c), middle(c, a), middle(a, b)];
            let mut between = [NOWHERE; 3];
            to.nearest_each(&middles, Some(piece.found[1].triangle), &mut between);
            self.visits += 3;
            self.due.push(Piece {
                corners: middles,
                found: between,
            });
            for corner in 0..3 {
                // The corner stays, the two others move to the middles of its edges.
                let (mut corners, mut found) = (middles, between);
                corners[corner] = piece.corners[corner];
                found[corner] = piece.found[corner];
                self.due.push(Piece { corners, found });
            }
        }
    }
}
