//! L-BFGS: a quasi-Newton method that remembers the last few steps (Liu and Nocedal 1989).
//!
//! Guaranteed: the energy never increases, and every iterate has a finite value. Not guaranteed: a global minimum.

use super::entries::{add_scaled, dot, multiply, norm, scale, subtract};
use super::line_search::{Start, StrongWolfe};
use super::{Counters, Iterate, Objective, Observer, Solution, StopReason, Stopping};
use std::collections::VecDeque;

pub(super) const SUMMARY: &str =
    "L-BFGS: quasi-Newton with limited memory and strong Wolfe steps (Liu and Nocedal 1989)";

/// Options of L-BFGS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lbfgs {
    pub stopping: Stopping,
    pub line_search: StrongWolfe,
    /// Steps remembered.
    pub memory: usize,
}

impl Default for Lbfgs {
    fn default() -> Self {
        Self {
            stopping: Stopping {
                relative_decrement: 0.0,
                iterations: 10_000,
                ..Stopping::default()
            },
            line_search: StrongWolfe::default(),
            memory: 10,
        }
    }
}

/// A remembered step: change of the point, change of the gradient, inverse of their product.
struct Pair {
    point: Vec<f64>,
    gradient: Vec<f64>,
    inverse: f64,
}

impl Lbfgs {
    /// Minimizes from `x`, which must lie in the domain. The observer hears of the start as iteration 0.
    pub fn minimize(
        &self,
        objective: &mut (impl Objective + ?Sized),
        x: Vec<f64>,
        observer: &mut dyn Observer,
    ) -> Solution {
        assert_eq!(
            x.len(),
            objective.dimension(),
            "a start with as many numbers as there are unknowns"
        );
        let size = x.len();
        let mut counters = Counters {
            evaluations: 1,
            ..Counters::default()
        };
        let mut x = x;
        let mut point = vec![0.0; size];
        let mut gradient = vec![0.0; size];
        let mut ahead = vec![0.0; size];
        let mut direction = vec![0.0; size];
        let mut pairs: VecDeque<Pair> = VecDeque::with_capacity(self.memory);
        let mut coefficients = vec![0.0; self.memory];
        let mut value = objective.gradient(&x, &mut gradient);
        let mut step = 0.0;
        let mut before: Option<f64> = None;
        let mut told = false;
        let (stop, reason) = loop {
            let gradient_norm = norm(&gradient);
            if !value.is_finite() || !gradient_norm.is_finite() {
                break (
                    StopReason::NotFinite,
                    "the energy or its gradient is not a finite number".to_string(),
                );
            }
            if !std::mem::replace(&mut told, true) {
                observer.iterate(&Iterate {
                    iteration: counters.iterations,
                    energy: value,
                    gradient_norm,
                    step,
                });
            }
            if let Some(reason) = self.stopping.gradient(gradient_norm) {
                break (StopReason::Converged, reason);
            }
            if let Some(reason) = before.and_then(|before| self.stopping.change(before, value)) {
                break (StopReason::Converged, reason);
            }
            two_loops(
                objective,
                &pairs,
                &gradient,
                &mut direction,
                &mut coefficients,
                &mut ahead,
            );
            let slope = dot(&gradient, &direction);
            if slope < 0.0
                && let Some(reason) = self.stopping.decrement(slope, value)
            {
                break (StopReason::Converged, reason);
            }
            if let Some(reason) = observer.stop() {
                break (reason, "stopped from outside".into());
            }
            if counters.iterations >= self.stopping.iterations {
                break (
                    StopReason::StepLimit,
                    format!("{} iterations were not enough", self.stopping.iterations),
                );
            }
            // Without memory the direction has no natural length: start with a unit step in space.
            let length = if pairs.is_empty() && !objective.is_preconditioned() {
                (1.0 / gradient_norm).min(1.0)
            } else {
                1.0
            };
            let start = Start {
                x: &x,
                value,
                gradient: &gradient,
                direction: &direction,
            };
            let accepted = self.line_search.search(
                objective,
                start,
                length,
                &mut point,
                &mut ahead,
                &mut counters.evaluations,
            );
            let Some(accepted) = accepted else {
                if pairs.is_empty() {
                    break (StopReason::Stalled, "no step against the gradient is acceptable".into());
                }
                // The memory may have gone stale: try once more along the gradient itself.
                pairs.clear();
                continue;
            };
            let mut pair = if pairs.len() == self.memory {
                pairs.pop_front()
            } else {
                None
            }
            .unwrap_or_else(|| Pair {
                point: vec![0.0; size],
                gradient: vec![0.0; size],
                inverse: 0.0,
            });
            subtract(&point, &x, &mut pair.point);
            subtract(&ahead, &gradient, &mut pair.gradient);
            let product = dot(&pair.point, &pair.gradient);
            // Only positive curvature keeps the model positive definite.
            if self.memory > 0 && product > f64::EPSILON * dot(&pair.gradient, &pair.gradient).max(f64::MIN_POSITIVE) {
                pair.inverse = 1.0 / product;
                pairs.push_back(pair);
            }
            before = Some(value);
            value = accepted.value;
            step = accepted.length;
            std::mem::swap(&mut x, &mut point);
            std::mem::swap(&mut gradient, &mut ahead);
            counters.iterations += 1;
            told = false;
        };
        let gradient_norm = norm(&gradient);
        Solution {
            x,
            value,
            gradient_norm,
            stop,
            reason,
            counters,
        }
    }
}

/// `direction = -H gradient` with the inverse Hessian `H` that the remembered steps stand for.
fn two_loops(
    objective: &mut (impl Objective + ?Sized),
    pairs: &VecDeque<Pair>,
    gradient: &[f64],
    direction: &mut [f64],
    coefficients: &mut [f64],
    room: &mut [f64],
) {
    scale(gradient, -1.0, direction);
    for (pair, coefficient) in pairs.iter().zip(coefficients.iter_mut()).rev() {
        *coefficient = pair.inverse * dot(&pair.point, direction);
        add_scaled(direction, -*coefficient, &pair.gradient);
    }
    let preconditioned = objective.is_preconditioned();
    // The curvature along the last step as the model without memory sees it.
    let factor = pairs.back().map(|last| {
        let seen = if preconditioned {
            room.copy_from_slice(&last.gradient);
            objective.precondition(room);
            &*room
        } else {
            &last.gradient
        };
        1.0 / (last.inverse * dot(&last.gradient, seen))
    });
    if preconditioned {
        objective.precondition(direction);
    }
    if let Some(factor) = factor {
        multiply(direction, factor);
    }
    for (pair, &coefficient) in pairs.iter().zip(coefficients.iter()) {
        let correction = coefficient - pair.inverse * dot(&pair.gradient, direction);
        add_scaled(direction, correction, &pair.point);
    }
}
