//! The method of locally injective mappings (Schueller, Kavan, Panozzo, Sorkine-Hornung 2013): soft constraints that
//! advance in substeps, and a barrier.
//!
//! Minimizes `E(u) + barrier + w sum |u_b - p_b|^2` by Newton's method with the Hessian as it is. Where it is not
//! positive definite, a multiple `mu` of its mean diagonal is added to its diagonal, and the targets advance by less:
//! `p_sub = s p + (1 - s) u_b` with `s = 1 / (1 + mu^2)`. The weight is raised while the constraints are not met, to a
//! given ratio of the energy to the sum of squared distances. The paper leaves the unit of `mu` open; relative to the
//! mean diagonal it does not depend on units.
//!
//! Guaranteed: no tetrahedron is inverted if none was. Not guaranteed: that the boundary reaches its target, which the
//! method is known to miss under tight constraints; the residual is reported.

use super::objective::{MapObjective, Pull};
use super::problem::Problem;
use super::settings::{LocallyInjective, Settings};
use super::trace::Trace;
use crate::optimize::line_search::{Backtracking, Start};
use crate::optimize::{Iterate, Objective, Observer, StopReason, norm};

/// Where the method ended.
#[derive(Clone, Debug, PartialEq)]
pub struct LocallyInjectiveMap {
    pub positions: Vec<[f64; 3]>,
    pub stop: StopReason,
    pub reason: String,
    pub iterations: u64,
    pub evaluations: u64,
    /// Iterations in which the Hessian had to be shifted.
    pub shifts: u64,
}

/// Relative change of the energy in a step below which the method has converged.
const CHANGE: f64 = 1e-9;
/// First shift that is tried, relative to the mean diagonal.
const FIRST_SHIFT: f64 = 1e-6;
/// Shift beyond which a Hessian counts as hopeless.
const LAST_SHIFT: f64 = 1e12;
/// Largest weight; beyond it the constraints drown the energy in rounding.
const LARGEST_WEIGHT: f64 = 1e16;

/// Minimizes from `start`, a map whose tetrahedra are all positive.
pub fn minimize(
    objective: &mut MapObjective,
    problem: &Problem,
    settings: &Settings,
    start: &[[f64; 3]],
    observer: &mut dyn Observer,
    trace: &mut Trace,
) -> LocallyInjectiveMap {
    let options: &LocallyInjective = &settings.locally_injective;
    let mut x = objective.unknowns(start);
    let size = x.len();
    let (mut gradient, mut direction) = (vec![0.0; size], vec![0.0; size]);
    let (mut point, mut ahead) = (vec![0.0; size], vec![0.0; size]);
    let (mut iterations, mut evaluations, mut shifts) = (0u64, 0u64, 0u64);
    let mut weight = options.weight;
    let mut step = 0.0;
    let mut before: Option<f64> = None;
    let (mut stop, mut reason) = loop {
        objective.set_pull(Some(Pull {
            weight,
            targets: problem.targets.clone(),
        }));
        evaluations += 1;
        let value = objective.assemble(&x, &mut gradient, 1.0);
        let gradient_norm = norm(&gradient);
        if !value.is_finite() || !gradient_norm.is_finite() {
            break (
                StopReason::NotFinite,
                "the energy or its gradient is not a finite number".to_string(),
            );
        }
        let iterate = Iterate {
            iteration: iterations,
            energy: value,
            gradient_norm,
            step,
        };
        let evaluation = objective.describe(&x);
        trace.record(&iterate, &evaluation);
        observer.iterate(&iterate);
        let (balanced, tolerance) = (objective.balanced_norm(&gradient), settings.gradient_tolerance);
        if balanced < tolerance {
            break (
                StopReason::Converged,
                format!("balanced gradient norm {balanced:.3e} is below {tolerance:.3e}"),
            );
        }
        let change = before.map_or(f64::INFINITY, |before| before - value);
        if change.abs() < CHANGE * value.abs() {
            break (
                StopReason::Converged,
                format!("relative energy change is below {CHANGE:e}"),
            );
        }
        if let Some(stop) = observer.stop() {
            break (stop, "stopped from outside".to_string());
        }
        if iterations >= settings.iteration_limit {
            break (
                StopReason::StepLimit,
                format!("{} iterations were not enough", settings.iteration_limit),
            );
        }

        let diagonal = objective.mean_diagonal();
        let mut mu = 0.0;
        let factorized = loop {
            if objective.factorize(mu * diagonal).is_ok() {
                break true;
            }
            mu = if mu == 0.0 { FIRST_SHIFT } else { 10.0 * mu };
            if mu > LAST_SHIFT {
                break false;
            }
        };
        if !factorized {
            break (
                StopReason::Stalled,
                "no shift makes the Hessian positive definite".to_string(),
            );
        }
        if mu > 0.0 {
            shifts += 1;
        }
        if mu > 0.0 && options.substepping {
            let share = 1.0 / (1.0 + mu * mu);
            let present = objective.positions(&x);
            let targets =
                problem.targets.iter().zip(&present).map(|(target, here)| {
                    std::array::from_fn(|axis| share * target[axis] + (1.0 - share) * here[axis])
                });
            objective.set_pull(Some(Pull {
                weight,
                targets: targets.collect(),
            }));
        }
        evaluations += 1;
        let toward = objective.gradient(&x, &mut gradient);
        for (direction, &slope) in direction.iter_mut().zip(&gradient) {
            *direction = -slope;
        }
        objective.solve(&mut direction);
        let search = Backtracking::default();
        let from = Start {
            x: &x,
            value: toward,
            gradient: &gradient,
            direction: &direction,
        };
        let Some(accepted) = search.search(objective, from, &mut point, &mut ahead, &mut evaluations) else {
            break (
                StopReason::Stalled,
                format!("no step is acceptable at weight {weight:.3e}"),
            );
        };
        std::mem::swap(&mut x, &mut point);
        step = accepted.length;
        iterations += 1;
        // Compared with the energy at the same weight and the final targets.
        objective.set_pull(Some(Pull {
            weight,
            targets: problem.targets.clone(),
        }));
        before = Some(value);
        let evaluation = objective.describe(&x);
        if evaluation.positional > options.constraint_tolerance {
            let wanted = options.weight_ratio * evaluation.distortion.abs() / evaluation.positional;
            let raised = wanted.clamp(options.weight, LARGEST_WEIGHT).max(weight);
            if raised != weight {
                weight = raised;
                before = None;
            }
        }
    };
    let residual = objective.positional(&x);
    if stop == StopReason::Converged && residual > options.constraint_tolerance {
        stop = StopReason::Stalled;
        reason = format!(
            "converged off the target: the sum of squared distances is {residual:.3e}, above {:.3e}",
            options.constraint_tolerance
        );
    }
    LocallyInjectiveMap {
        positions: objective.positions(&x),
        stop,
        reason,
        iterations,
        evaluations,
        shifts,
    }
}
