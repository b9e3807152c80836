//! How well patches join: gaps and angles between normals along shared edges, measured on the patches alone.

use super::patch::Patch;
use super::surface::{self, Place};
use crate::linalg::vector3::{cross, dot, subtract};
use crate::mesh::connectivity::NONE;
use crate::mesh::length;
use crate::mesh::quadrilateral::{Connectivity, Side, quad_and_corner};
use rayon::prelude::*;

/// Points along every edge, both ends included.
const SAMPLES: usize = 21;

/// What [`measure`] found over the edges with two patches.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Continuity {
    /// Largest distance between two patches' points at one place of their edge.
    pub gap: f64,
    /// Largest angle between two patches' normals, in degrees.
    pub largest: f64,
    /// Root of the mean square of these angles, in degrees.
    pub mean_square: f64,
    /// Largest angle on every edge, in degrees; 0 on the boundary.
    pub of_edge: Vec<f64>,
}

/// Positions and area vectors along side `k` of a patch, from corner `k` to the next.
fn along(patch: &Patch, side: usize, places: &[Place; SAMPLES], visit: &mut dyn FnMut(usize, [f64; 3], [f64; 3])) {
    for (index, place) in places.iter().enumerate() {
        let back = SAMPLES - 1 - index;
        let (u, v) = match side {
            0 => (place, &places[0]),
            1 => (&places[SAMPLES - 1], place),
            2 => (&places[back], &places[SAMPLES - 1]),
            _ => (&places[0], &places[back]),
        };
        let jet = surface::first_derivatives(patch, u, v);
        visit(index, jet.position, jet.area_vector());
    }
}

/// The larger of two numbers; not-a-number, from a patch without normal, must show.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

fn places() -> [Place; SAMPLES] {
    std::array::from_fn(|index| Place::new(index as f64 / (SAMPLES - 1) as f64))
}

/// Gap, largest angle and sum of the squares of the angles between two patches along their common edge, given as the side of
/// each; the sides run against each other.
fn between(patches: &[Patch], [first, second]: [Side; 2], places: &[Place; SAMPLES]) -> [f64; 3] {
    let mut one = [([0.0; 3], [0.0; 3]); SAMPLES];
    let (quad, side) = quad_and_corner(first);
    along(&patches[quad], side, places, &mut |index, position, area| {
        one[index] = (position, area);
    });
    let mut found = [0.0f64; 3];
    let (quad, side) = quad_and_corner(second);
    along(&patches[quad], side, places, &mut |index, position, area| {
        let (other, other_area) = one[SAMPLES - 1 - index];
        found[0] = larger(found[0], length(subtract(position, other)));
        let (sine, cosine) = (length(cross(area, other_area)), dot(area, other_area));
        // Without a normal on either side both are zero.
        let defined = sine > 0.0 || cosine != 0.0;
        let angle = if defined {
            sine.atan2(cosine).to_degrees()
        } else {
            f64::NAN
        };
        found[1] = larger(found[1], angle);
        found[2] += angle * angle;
    });
    found
}

/// Measures all edges with two patches; creases, where the surface is cut open, are not among them.
pub fn measure(patches: &[Patch], connectivity: &Connectivity) -> Continuity {
    let places = places();
    // Gap, largest angle and sum of squares of every edge; summed in the order of the edges.
    let edges: Vec<[f64; 3]> = connectivity
        .sides
        .par_iter()
        .map(|&sides| {
            if sides.contains(&NONE) {
                [0.0; 3]
            } else {
                between(patches, sides, &places)
            }
        })
        .collect();
    let mut total = Continuity {
        of_edge: edges.iter().map(|edge| edge[1]).collect(),
        ..Continuity::default()
    };
    let mut squares = 0.0;
    for [gap, largest, sum] in &edges {
        total.gap = larger(total.gap, *gap);
        total.largest = larger(total.largest, *largest);
        squares += sum;
    }
    let inner = connectivity.edges.len() - connectivity.boundary_edges();
    total.mean_square = (squares / (inner.max(1) * SAMPLES) as f64).sqrt();
    total
}

/// The largest gap along creases and the largest angle between the normals of their sides, in degrees.
pub fn measure_creases(patches: &[Patch], connectivity: &Connectivity, creases: &[[u32; 2]]) -> [f64; 2] {
    let places = places();
    let found: Vec<[f64; 3]> = creases
        .par_iter()
        .map(|pair| {
            // Each of the two edges has one side, the other entry is the largest number there is.
            let sides = pair.map(|edge| connectivity.sides[edge as usize].into_iter().fold(NONE, u32::min));
            between(patches, sides, &places)
        })
        .collect();
    let most = |index: usize| found.iter().fold(0.0, |worst, edge| larger(worst, edge[index]));
    [most(0), most(1)]
}
