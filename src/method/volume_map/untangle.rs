//! Untangling: a map with inverted tetrahedra becomes one without (Garanzha et al. 2021).
//!
//! Minimizes the mean of `A / chi^(2/3) + lambda (D^2 + 1) / chi` with `A = |J|^2`, `D = det J` and the regularized
//! determinant `chi(D) = (D + sqrt(epsilon^2 + D^2)) / 2`, for a falling sequence of `epsilon`. After a minimization from
//! `F0` to `F1` the next `epsilon` solves `chi(D_min, epsilon) = (1 - sigma) chi(D_min, previous)` with
//! `sigma = max(1 - F1 / F0, decrease)`: fast while the energy falls fast, never in one leap. It starts at the larger
//! of 1 and the depth of the deepest inversion. Each minimization is projected Newton, its steps limited by decrease
//! alone.
//!
//! The Jacobian is taken from a rest shape of the target's volume. By default that shape is scaled from place to place:
//! the logarithm of the square root of target area over source area, at the boundary vertices, is extended harmonically
//! over the graph, and each tetrahedron at rest is scaled by the exponential of its vertices' mean. Where a boundary map
//! shrinks fingers to dots, the tetrahedra inside then want to be small as well, and the energy stays moderate.
//!
//! Guaranteed: success is judged by the determinants of the result, all positive. Not guaranteed: success.

use super::harmonic;
use super::objective::MapObjective;
use super::problem::Problem;
use super::settings::{Hessian, RestShape, Untangling as Options};
use crate::energy::mapping::{Density, MappingEnergy};
use crate::energy::untangling::Untangling;
use crate::mesh;
use crate::method::Failure;
use crate::optimize::newton::Newton;
use crate::optimize::{Counters, Iterate, Observer, StopReason, Stopping};

/// Where the untangling ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Untangled {
    pub positions: Vec<[f64; 3]>,
    /// Tetrahedra whose determinant is not positive; empty on success.
    pub left: Vec<u32>,
    /// Set when the observer asked to stop.
    pub interrupted: Option<StopReason>,
    /// Values of epsilon that were used.
    pub steps: u64,
    pub counters: Counters,
}

/// Untangles from `start`, the boundary held where it is.
pub fn untangle(
    problem: &Problem,
    start: &[[f64; 3]],
    options: &Options,
    observer: &mut dyn Observer,
) -> Result<Untangled, Failure> {
    let weights = problem.volume_weights();
    let scales = match options.rest_shape {
        // From the source as the problem has it to one of the target's volume, 1.
        RestShape::Uniform => vec![problem.source_volume().cbrt().recip(); problem.source.cells.len()],
        RestShape::LocallyScaled => local_scales(problem)?,
    };
    let mut regularization = Untangling {
        epsilon: 1.0,
        lambda: options.determinant_weight,
    };
    let mapping = MappingEnergy::new(&problem.source, &weights, Density::of(regularization), Some(&scales))
        .map_err(|error| Failure::invalid(format!("source mesh: {error}")))?;
    let free: Vec<bool> = problem.boundary.mask.iter().map(|&fixed| !fixed).collect();
    let mut objective = MapObjective::new(
        mapping,
        &problem.source,
        &free,
        &problem.boundary.vertices,
        start,
        Hessian::Projected,
    )?;
    let mut x = objective.unknowns(start);
    // The first value is the depth of the deepest inversion, so that even a random start gives a smooth energy.
    let lowest = objective.determinants(&x).iter().copied().fold(f64::INFINITY, f64::min);
    regularization.epsilon = regularization.epsilon.max(-lowest);
    let mut counters = Counters::default();
    let mut steps = 0;
    let mut interrupted = None;
    let newton = Newton {
        stopping: Stopping {
            gradient_norm: 1e-9,
            relative_decrement: 1e-9,
            relative_change: 1e-6,
            iterations: options.iterations,
            ..Stopping::default()
        },
        ..Newton::default()
    };
    while steps < options.steps
        && objective
            .determinants(&x)
            .iter()
            .any(|&determinant| !(determinant > 0.0))
    {
        objective.set_density(Density::of(regularization));
        let mut watch = Watch {
            observer: &mut *observer,
            first: None,
            done: counters.iterations,
        };
        let solution = newton.minimize(&mut objective, x, &mut watch);
        let first = watch.first.unwrap_or(solution.value);
        x = solution.x;
        counters += solution.counters;
        steps += 1;
        if matches!(solution.stop, StopReason::TimeLimit | StopReason::Cancelled) {
            interrupted = Some(solution.stop);
            break;
        }
        if solution.stop == StopReason::NotFinite {
            break;
        }
        let lowest = objective.determinants(&x).iter().copied().fold(f64::INFINITY, f64::min);
        let sigma = (1.0 - solution.value / first).max(options.decrease);
        let goal = (1.0 - sigma) * regularization.chi(lowest);
        regularization.epsilon = if lowest < goal {
            2.0 * (goal * (goal - lowest)).sqrt()
        } else {
            1e-10
        };
        // Squares of anything smaller vanish.
        regularization.epsilon = regularization.epsilon.max(1e-100);
    }
    let left = objective
        .determinants(&x)
        .iter()
        .enumerate()
        .filter(|&(_, &determinant)| !(determinant > 0.0))
        .map(|(cell, _)| cell as u32)
        .collect();
    Ok(Untangled {
        positions: objective.positions(&x),
        left,
        interrupted,
        steps,
        counters,
    })
}

/// The factor of every tetrahedron at rest: how the boundary near it is stretched.
fn local_scales(problem: &Problem) -> Result<Vec<f64>, Failure> {
    let mut source = vec![0.0; problem.source.points.len()];
    let mut target = source.clone();
    for &triangle in &problem.boundary.triangles {
        let area =
            |points: &[[f64; 3]]| mesh::length(mesh::area_vector(triangle.map(|vertex| points[vertex as usize]))) / 2.0;
        let (before, after) = (area(&problem.source.points), area(&problem.targets));
        for vertex in triangle {
            source[vertex as usize] += before;
            target[vertex as usize] += after;
        }
    }
    let mean = {
        let total = |areas: &[f64]| areas.iter().sum::<f64>();
        total(&target) / total(&source)
    };
    let mut logarithms: Vec<[f64; 1]> = source
        .iter()
        .zip(&target)
        .map(|(&before, &after)| {
            let ratio = after / before;
            // A vertex whose triangles all collapse has no scale of its own; it takes the smallest sensible one.
            [0.5 * if before > 0.0 && after > 0.0 {
                ratio
            } else {
                1e-12 * mean
            }
            .max(1e-12 * mean)
            .ln()]
        })
        .collect();
    harmonic::extend_over_graph(&problem.source, &problem.boundary.mask, &mut logarithms)?;
    Ok(problem
        .source
        .cells
        .iter()
        .map(|cell| (cell.iter().map(|&vertex| logarithms[vertex as usize][0]).sum::<f64>() / 4.0).exp())
        .collect())
}

/// Passes iterates on with running numbers and remembers the first energy.
struct Watch<'a> {
    observer: &'a mut dyn Observer,
    first: Option<f64>,
    done: u64,
}

impl Observer for Watch<'_> {
    fn phase(&mut self, name: &str) {
        self.observer.phase(name);
    }

    fn iterate(&mut self, iterate: &Iterate) {
        self.first.get_or_insert(iterate.energy);
        self.observer.iterate(&Iterate {
            iteration: self.done + iterate.iteration,
            ..*iterate
        });
    }

    fn stop(&self) -> Option<StopReason> {
        self.observer.stop()
    }
}
