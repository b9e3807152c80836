//! The relaxation-enhanced Newton method of the volume-map paper (section 4.2): soft constraints.
//!
//! Minimizes `E(u) + w sum |u_b - p_b|^2` over all vertices, from a map without inversions. A step is accepted only if
//! the energy falls and the norm of the gradient does not grow. Where no such step exists, the method relaxes: it takes
//! a few steps towards the present boundary positions instead of the targets, which lets the interior recover, and goes
//! on; if the step is still refused it takes one by the energy alone. The weight may be raised from a small value, each
//! time the method has converged off the target.
//!
//! Converged when the norm of the gradient, its slopes at the boundary divided by the weight where that exceeds 1, or the
//! change of the energy in a step of at least half the Newton direction is small. Guaranteed: no tetrahedron is
//! inverted if none was and the energy or the barrier forbids it. Not guaranteed: that the boundary reaches its
//! target; the residual is reported.

use super::objective::{MapObjective, Pull};
use super::problem::Problem;
use super::settings::{Continuation, RelaxedNewton, Settings};
use super::trace::Trace;
use crate::optimize::line_search::{Backtracking, Start};
use crate::optimize::{Iterate, LONG_STEP, NewtonObjective, NoDirection, Objective, Observer, StopReason, norm};

/// Where the method ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Relaxed {
    pub positions: Vec<[f64; 3]>,
    pub stop: StopReason,
    pub reason: String,
    pub iterations: u64,
    pub relaxations: u64,
    /// Accepted steps within the relaxations.
    pub relaxation_iterations: u64,
    pub evaluations: u64,
    /// Weights that were used up, one by one.
    pub weights: Vec<f64>,
}

/// What one try for a step gave.
enum Update {
    Accepted {
        length: f64,
        decrease: f64,
        gradient_norm: f64,
    },
    Refused,
    NotFinite,
}

struct Run<'a> {
    objective: &'a mut MapObjective,
    options: &'a RelaxedNewton,
    observer: &'a mut dyn Observer,
    trace: &'a mut Trace,
    x: Vec<f64>,
    gradient: Vec<f64>,
    direction: Vec<f64>,
    point: Vec<f64>,
    ahead: Vec<f64>,
    iterations: u64,
    relaxations: u64,
    relaxation_iterations: u64,
    evaluations: u64,
}

/// Minimizes from `start`, a map whose tetrahedra are all positive unless the energy allows others.
pub fn minimize(
    objective: &mut MapObjective,
    problem: &Problem,
    settings: &Settings,
    start: &[[f64; 3]],
    observer: &mut dyn Observer,
    trace: &mut Trace,
) -> Relaxed {
    let options = &settings.relaxed_newton;
    let x = objective.unknowns(start);
    let size = x.len();
    let mut run = Run {
        objective,
        options,
        observer,
        trace,
        x: x.clone(),
        gradient: vec![0.0; size],
        direction: vec![0.0; size],
        point: vec![0.0; size],
        ahead: vec![0.0; size],
        iterations: 0,
        relaxations: 0,
        relaxation_iterations: 0,
        evaluations: 0,
    };
    let mut weights = Vec::new();
    let (mut stop, mut reason);
    if options.continuation == Continuation::On {
        (stop, reason) = run.raise_weight(problem, settings, &mut weights);
    } else {
        weights.push(options.weight);
        (stop, reason) = run.at_weight(problem, settings, options.weight);
        let missed = run.objective.positional(&run.x) > options.constraint_tolerance;
        let give_up = matches!(
            stop,
            StopReason::TimeLimit | StopReason::Cancelled | StopReason::StepLimit
        );
        if options.continuation == Continuation::Auto && missed && !give_up {
            // The fixed weight was too stiff to find a way: once more from the start, with a growing one.
            run.x = x;
            (stop, reason) = run.raise_weight(problem, settings, &mut weights);
        }
    }
    let residual = run.objective.positional(&run.x);
    if stop == StopReason::Converged && residual > options.constraint_tolerance {
        stop = StopReason::Stalled;
        reason = format!(
            "converged off the target: the sum of squared distances is {residual:.3e}, above {:.3e}; raise the weight \
             or use hard constraints",
            options.constraint_tolerance
        );
    }
    Relaxed {
        positions: run.objective.positions(&run.x),
        stop,
        reason,
        iterations: run.iterations,
        relaxations: run.relaxations,
        relaxation_iterations: run.relaxation_iterations,
        evaluations: run.evaluations,
        weights,
    }
}

impl Run<'_> {
    /// The continuation: a small weight, raised by a factor whenever the method has converged off the target.
    fn raise_weight(&mut self, problem: &Problem, settings: &Settings, weights: &mut Vec<f64>) -> (StopReason, String) {
        let mut weight = self.options.continuation_weight;
        let mut round = 0;
        loop {
            weights.push(weight);
            let (stop, reason) = self.at_weight(problem, settings, weight);
            let met = self.objective.positional(&self.x) <= self.options.constraint_tolerance;
            let go_on = matches!(stop, StopReason::Converged | StopReason::Stalled);
            if met || !go_on || round >= self.options.continuation_rounds {
                return (stop, reason);
            }
            weight *= self.options.continuation_factor;
            round += 1;
        }
    }

    /// Minimizes at one weight.
    fn at_weight(&mut self, problem: &Problem, settings: &Settings, weight: f64) -> (StopReason, String) {
        self.objective.set_pull(Some(Pull {
            weight,
            targets: problem.targets.clone(),
        }));
        let tolerance = settings.gradient_tolerance;
        let change = self.options.energy_tolerance * problem.source_diagonal();
        self.evaluations += 1;
        let mut value = self.objective.gradient(&self.x, &mut self.gradient);
        let mut gradient_norm = norm(&self.gradient);
        let mut step = 0.0;
        let mut decrease = f64::INFINITY;
        loop {
            if !value.is_finite() || !gradient_norm.is_finite() {
                return (
                    StopReason::NotFinite,
                    "the energy or its gradient is not a finite number".to_string(),
                );
            }
            self.tell(value, gradient_norm, step);
            let balanced = self.objective.balanced_norm(&self.gradient);
            if balanced < tolerance {
                return (
                    StopReason::Converged,
                    format!("balanced gradient norm {balanced:.3e} is below {tolerance:.3e} at weight {weight:.3e}"),
                );
            }
            // A step cut short lowers the energy by little wherever it is taken: it proves nothing.
            if decrease < change && step >= LONG_STEP {
                return (
                    StopReason::Converged,
                    format!("energy change {decrease:.3e} is below {change:.3e} at weight {weight:.3e}"),
                );
            }
            if let Some(stop) = self.observer.stop() {
                return (stop, "stopped from outside".to_string());
            }
            if self.iterations >= settings.iteration_limit {
                return (
                    StopReason::StepLimit,
                    format!("{} iterations were not enough", settings.iteration_limit),
                );
            }
            let mut update = self.update(self.options.gradient_criterion);
            if matches!(update, Update::Refused) && self.options.relaxation {
                let before = self.x.clone();
                self.relax(problem, weight);
                update = self.update(self.options.gradient_criterion);
                if matches!(update, Update::Refused) && self.options.gradient_criterion {
                    update = self.update(false);
                }
                if !matches!(update, Update::Accepted { .. }) {
                    // A relaxation without a step after it has only raised the energy.
                    self.x = before;
                }
            } else if matches!(update, Update::Refused) && self.options.gradient_criterion {
                update = self.update(false);
            }
            match update {
                Update::Accepted {
                    length,
                    decrease: lower,
                    gradient_norm: norm,
                } => {
                    step = length;
                    decrease = lower;
                    value = self.objective.value(&self.x);
                    gradient_norm = norm;
                    self.iterations += 1;
                }
                Update::Refused => {
                    return (
                        StopReason::Stalled,
                        format!("no step is acceptable at weight {weight:.3e}"),
                    );
                }
                Update::NotFinite => {
                    return (
                        StopReason::NotFinite,
                        "a derivative of the energy is not a finite number".to_string(),
                    );
                }
            }
        }
    }

    /// One Newton step with backtracking, if one is acceptable.
    fn update(&mut self, gradient_criterion: bool) -> Update {
        self.evaluations += 1;
        let value = match self
            .objective
            .newton_direction(&self.x, &mut self.gradient, &mut self.direction)
        {
            Ok(value) => value,
            Err(NoDirection::NotPositive(_)) => return Update::Refused,
            Err(NoDirection::NotFinite) => return Update::NotFinite,
        };
        let search = Backtracking {
            gradient_decrease: gradient_criterion,
            trials: 8,
            ..Backtracking::default()
        };
        let start = Start {
            x: &self.x,
            value,
            gradient: &self.gradient,
            direction: &self.direction,
        };
        let accepted = search.search(
            &mut *self.objective,
            start,
            &mut self.point,
            &mut self.ahead,
            &mut self.evaluations,
        );
        let Some(accepted) = accepted else {
            return Update::Refused;
        };
        if !accepted.has_gradient {
            self.evaluations += 1;
            self.objective.gradient(&self.point, &mut self.ahead);
        }
        std::mem::swap(&mut self.x, &mut self.point);
        std::mem::swap(&mut self.gradient, &mut self.ahead);
        Update::Accepted {
            length: accepted.length,
            decrease: value - accepted.value,
            gradient_norm: norm(&self.gradient),
        }
    }

    /// A few steps with the boundary's present positions as its targets.
    fn relax(&mut self, problem: &Problem, weight: f64) {
        self.relaxations += 1;
        let present = self.objective.positions(&self.x);
        self.objective.set_pull(Some(Pull {
            weight,
            targets: present,
        }));
        for _ in 0..self.options.relaxation_steps {
            if self.observer.stop().is_some() {
                break;
            }
            let Update::Accepted { decrease, .. } = self.update(false) else {
                break;
            };
            self.relaxation_iterations += 1;
            // Less than this moves nothing that matters to the next step.
            if decrease <= 1e-8 * problem.source_diagonal() {
                break;
            }
        }
        self.objective.set_pull(Some(Pull {
            weight,
            targets: problem.targets.clone(),
        }));
    }

    fn tell(&mut self, energy: f64, gradient_norm: f64, step: f64) {
        let iterate = Iterate {
            iteration: self.iterations,
            energy,
            gradient_norm,
            step,
        };
        let evaluation = self.objective.describe(&self.x);
        self.trace.record(&iterate, &evaluation);
        self.observer.iterate(&iterate);
    }
}
