//! The first map: where every vertex stands before anything is minimized.

use super::problem::Problem;
use super::settings::{Settings, SimilarityFit, Start};
use super::{harmonic, similarity};
use crate::mesh;
use crate::method::Failure;

/// Positions of all vertices. With hard constraints the boundary stands on its target, whatever the start.
pub fn positions(problem: &Problem, settings: &Settings) -> Result<Vec<[f64; 3]>, Failure> {
    let mut positions = match settings.chosen_start() {
        Start::Auto | Start::Harmonic => {
            let mut positions = problem.targets.clone();
            harmonic::extend(&problem.source, &problem.boundary.mask, &mut positions)?;
            positions
        }
        Start::Rest => problem.source.points.clone(),
        Start::Similarity => {
            let on_boundary = |points: &[[f64; 3]]| -> Vec<[f64; 3]> {
                problem
                    .boundary
                    .vertices
                    .iter()
                    .map(|&vertex| points[vertex as usize])
                    .collect()
            };
            let (from, to) = (on_boundary(&problem.source.points), on_boundary(&problem.targets));
            let similarity = match settings.similarity {
                SimilarityFit::ClosedForm => similarity::closed_form(&from, &to),
                SimilarityFit::ThirteenVariables => similarity::thirteen_variables(&from, &to),
            };
            problem
                .source
                .points
                .iter()
                .map(|&point| similarity.apply(point))
                .collect()
        }
        Start::TargetMesh => problem.interior.clone().ok_or_else(|| {
            Failure::invalid(
                "start = \"target-mesh\" needs a target that places interior vertices too; give a mesh of the \
                     same connectivity as target, or choose another start"
                    .to_string(),
            )
        })?,
        Start::RandomInterior => {
            let mut positions = problem.targets.clone();
            let inside: Vec<[f64; 3]> = problem
                .boundary
                .vertices
                .iter()
                .map(|&vertex| problem.targets[vertex as usize])
                .collect();
            if let Some([low, high]) = mesh::bounding_box(&inside) {
                let mut random = SplitMix(settings.seed);
                for (vertex, position) in positions.iter_mut().enumerate() {
                    let point = std::array::from_fn(|axis| low[axis] + random.unit() * (high[axis] - low[axis]));
                    if !problem.boundary.mask[vertex] {
                        *position = point;
                    }
                }
            }
            positions
        }
    };
    if settings.solver.hard_constraints() {
        for &vertex in &problem.boundary.vertices {
            positions[vertex as usize] = problem.targets[vertex as usize];
        }
    }
    Ok(positions)
}

/// The SplitMix64 generator of pseudorandom numbers (Steele, Lea, Flood 2014).
struct SplitMix(u64);

impl SplitMix {
    /// Uniform in `[0, 1)`.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ bits >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }
}
