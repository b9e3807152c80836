//! Projected Newton: a positive definite model of the Hessian, one factorization an iteration, backtracking.
//!
//! Guaranteed: the energy never increases, and every iterate has a finite value. Not guaranteed: a global minimum.

use super::line_search::{Backtracking, Start};
use super::{
    Counters, Iterate, LONG_STEP, NewtonObjective, NoDirection, Observer, Solution, StopReason, Stopping, dot, norm,
};

pub(super) const SUMMARY: &str =
    "projected Newton: positive model Hessian, sparse Cholesky, backtracking (Teran et al. 2005; Smith et al. 2019)";

/// Options of projected Newton.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Newton {
    pub stopping: Stopping,
    pub line_search: Backtracking,
}

impl Newton {
    /// Minimizes from `x`, which must lie in the domain. The observer hears of the start as iteration 0.
    pub fn minimize(
        &self,
        objective: &mut (impl NewtonObjective + ?Sized),
        x: Vec<f64>,
        observer: &mut dyn Observer,
    ) -> Solution {
        assert_eq!(
            x.len(),
            objective.dimension(),
            "a start with as many numbers as there are unknowns"
        );
        let factorizations = objective.factorizations();
        let mut counters = Counters::default();
        let mut x = x;
        let mut point = vec![0.0; x.len()];
        let mut gradient = vec![0.0; x.len()];
        let mut direction = vec![0.0; x.len()];
        let mut spare = vec![0.0; x.len()];
        let mut value = f64::NAN;
        let mut gradient_norm = f64::NAN;
        let mut step = 0.0;
        let (stop, reason) = loop {
            counters.evaluations += 1;
            let model = objective.newton_direction(&x, &mut gradient, &mut direction);
            if model != Err(NoDirection::NotFinite) {
                gradient_norm = norm(&gradient);
            }
            match model {
                Err(error @ NoDirection::NotPositive(_)) => {
                    // The gradient is there although no direction is.
                    counters.evaluations += 1;
                    value = objective.gradient(&x, &mut gradient);
                    gradient_norm = norm(&gradient);
                    break (StopReason::Stalled, error.to_string());
                }
                Err(error) => break (StopReason::NotFinite, error.to_string()),
                Ok(energy) if !energy.is_finite() || !gradient_norm.is_finite() => {
                    value = energy;
                    break (StopReason::NotFinite, NoDirection::NotFinite.to_string());
                }
                Ok(energy) => value = energy,
            }
            observer.iterate(&Iterate {
                iteration: counters.iterations,
                energy: value,
                gradient_norm,
                step,
            });
            if let Some(reason) = self.stopping.gradient(gradient_norm) {
                break (StopReason::Converged, reason);
            }
            let slope = dot(&gradient, &direction);
            if !slope.is_finite() {
                break (StopReason::NotFinite, NoDirection::NotFinite.to_string());
            }
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
            let start = Start {
                x: &x,
                value,
                gradient: &gradient,
                direction: &direction,
            };
            match self
                .line_search
                .search(objective, start, &mut point, &mut spare, &mut counters.evaluations)
            {
                Some(accepted) => {
                    // A step cut short changes the energy by little wherever it is taken: it proves nothing.
                    let change = (accepted.length >= LONG_STEP)
                        .then(|| self.stopping.change(value, accepted.value))
                        .flatten();
                    std::mem::swap(&mut x, &mut point);
                    step = accepted.length;
                    counters.iterations += 1;
                    if let Some(reason) = change {
                        // The gradient completes the report; a Hessian and its factorization would be for nothing.
                        counters.evaluations += 1;
                        value = objective.gradient(&x, &mut gradient);
                        gradient_norm = norm(&gradient);
                        observer.iterate(&Iterate {
                            iteration: counters.iterations,
                            energy: value,
                            gradient_norm,
                            step,
                        });
                        break (StopReason::Converged, reason);
                    }
                }
                None => {
                    break (
                        StopReason::Stalled,
                        "no step along the Newton direction is acceptable".into(),
                    );
                }
            }
        };
        counters.factorizations = objective.factorizations() - factorizations;
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
