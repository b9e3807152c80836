//! How well patches join: gaps and angles between normals along shared edges, measured on the patches alone.

use super::patch::Patch;
use super::surface::{self, Place};
use crate::linalg::vector3::{cross, dot, subtract};
use crate::mesh::connectivity::NONE;
use crate::mesh::length;
use crate::mesh::quadrilateral::{Connectivity, quad_and_corner};
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

/// Measures all edges.
pub fn measure(patches: &[Patch], connectivity: &Connectivity) -> Continuity {
    let places: [Place; SAMPLES] = std::array::from_fn(|index| Place::new(index as f64 / (SAMPLES - 1) as f64));
    // Gap, largest angle and sum of squares of every edge; summed in the order of the edges.
    let edges: Vec<[f64; 3]> = connectivity
        .sides
        .par_iter()
        .map(|&[first, second]| {
            if first == NONE || second == NONE {
                return [0.0; 3];
            }
            let mut one = [([0.0; 3], [0.0; 3]); SAMPLES];
            let (quad, side) = quad_and_corner(first);
            along(&patches[quad], side, &places, &mut |index, position, area| {
                one[index] = (position, area);
            });
            let mut found = [0.0f64; 3];
            let (quad, side) = quad_and_corner(second);
            along(&patches[quad], side, &places, &mut |index, position, area| {
                let (other, other_area) = one[SAMPLES - 1 - index];
                found[0] = found[0].max(length(subtract(position, other)));
                let angle = length(cross(area, other_area))
                    .atan2(dot(area, other_area))
                    .to_degrees();
                found[1] = found[1].max(angle);
                found[2] += angle * angle;
            });
            found
        })
        .collect();
    let mut total = Continuity {
        of_edge: edges.iter().map(|edge| edge[1]).collect(),
        ..Continuity::default()
    };
    let mut squares = 0.0;
    for [gap, largest, sum] in &edges {
        // Not-a-number, from a patch without normal, must show.
        total.gap = if gap.is_nan() { f64::NAN } else { total.gap.max(*gap) };
        total.largest = if largest.is_nan() {
            f64::NAN
        } else {
            total.largest.max(*largest)
        };
        squares += sum;
    }
    let inner = connectivity.edges.len() - connectivity.boundary_edges();
    total.mean_square = (squares / (inner.max(1) * SAMPLES) as f64).sqrt();
    total
}
