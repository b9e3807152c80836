//! How well patches join: gaps and angles between normals along shared edges, measured on the patches alone.

use super::evaluation::{Derivatives, Evaluated, Places, evaluate};
use super::patch::Patch;
use crate::linalg::processor::Processor;
use crate::linalg::vector3::{cross, dot, subtract, times};
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

/// Points along the four sides of a patch, side `k` from corner `k` to the next.
struct Sides([Places; 4]);

impl Sides {
    fn new() -> Self {
        let line: [f64; SAMPLES] = std::array::from_fn(|index| index as f64 / (SAMPLES - 1) as f64);
        let side = |point: &dyn Fn(f64) -> [f64; 2]| Places::new(&line.map(point));
        Self([
            side(&|t| [t, 0.0]),
            side(&|t| [1.0, t]),
            side(&|t| [1.0 - t, 1.0]),
            side(&|t| [0.0, 1.0 - t]),
        ])
    }
}

/// The larger of two numbers; not-a-number, from a patch without normal, must show.
pub fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// A vector of length 1, so that products of two neither overflow nor vanish; zero stays zero.
fn unit(vector: [f64; 3]) -> [f64; 3] {
    let largest = vector.iter().fold(0.0, |most, component| larger(most, component.abs()));
    if !(largest > 0.0) {
        return vector;
    }
    let scaled = vector.map(|component| component / largest);
    times(scaled, 1.0 / length(scaled))
}

/// Gap, largest angle and sum of the squares of the angles between two patches along their common edge, given as the
/// side of each; the sides run against each other.
fn between(patches: &[Patch], both: [Side; 2], sides: &Sides, scratch: &mut [Evaluated; 2]) -> [f64; 3] {
    let processor = Processor::detect();
    for (side, evaluated) in both.into_iter().zip(scratch.iter_mut()) {
        let (quad, side) = quad_and_corner(side);
        evaluate(processor, &patches[quad], &sides.0[side], Derivatives::First, evaluated);
    }
    let mut found = [0.0f64; 3];
    for index in 0..SAMPLES {
        let [position, u, v] = scratch[0].first(index);
        let [other, other_u, other_v] = scratch[1].first(SAMPLES - 1 - index);
        let (area, other_area) = (unit(cross(u, v)), unit(cross(other_u, other_v)));
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
    }
    found
}

/// Measures all edges with two patches; creases, where the surface is cut open, are not among them.
pub fn measure(patches: &[Patch], connectivity: &Connectivity) -> Continuity {
    let places = Sides::new();
    // Gap, largest angle and sum of squares of every edge; summed in the order of the edges.
    let edges: Vec<[f64; 3]> = connectivity
        .sides
        .par_iter()
        .map_init(Default::default, |scratch, &sides| {
            if sides.contains(&NONE) {
                [0.0; 3]
            } else {
                between(patches, sides, &places, scratch)
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
    let places = Sides::new();
    let found: Vec<[f64; 3]> = creases
        .par_iter()
        .map_init(Default::default, |scratch, pair| {
            // Each of the two edges has one side, the other entry is the largest number there is.
            let sides = pair.map(|edge| connectivity.sides[edge as usize].into_iter().fold(NONE, u32::min));
            between(patches, sides, &places, scratch)
        })
        .collect();
    let most = |index: usize| found.iter().fold(0.0, |worst, edge| larger(worst, edge[index]));
    [most(0), most(1)]
}
