//! Minimizers: what they ask of an objective, what they tell an observer, and why they stop.
//!
//! A failed line search is a stop reason, never a warning. Nothing here reads a clock: limits arrive through the
//! observer.

pub mod entries;
pub mod line_search;
pub mod newton;
pub mod lbfgs;

pub use entries::{dot, norm};

use crate::linalg::sparse::NotPositive;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Why a minimization ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopReason {
    /// A convergence criterion was met.
    Converged,
    /// No acceptable step could be found although no criterion was met.
    Stalled,
    /// The permitted number of iterations was used up.
    StepLimit,
    /// The observer's time limit was reached.
    TimeLimit,
    /// The user asked to stop.
    Cancelled,
    /// The energy or its gradient is not a finite number.
    NotFinite,
}

/// One accepted iterate, as told to the observer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Iterate {
    pub iteration: u64,
    /// Total energy that is being minimized.
    pub energy: f64,
    /// Euclidean norm of the gradient over the free unknowns.
    pub gradient_norm: f64,
    /// Length factor of the accepted step, 1 for a full Newton step.
    pub step: f64,
}

/// Listens to a running method and may ask it to stop. Phases and times are measured by the observer, not by the method.
pub trait Observer {
    /// A new phase begins, for instance `"untangle"` or `"minimize"`; it lasts until the next call.
    fn phase(&mut self, name: &str);
    /// An iterate was accepted.
    fn iterate(&mut self, iterate: &Iterate);
    /// `Some(reason)` when the method must stop as soon as it can (time limit or cancellation).
    fn stop(&self) -> Option<StopReason>;
}

/// An observer that listens to nothing and never stops.
pub struct Silent;

impl Observer for Silent {
    fn phase(&mut self, _name: &str) {}
    fn iterate(&mut self, _iterate: &Iterate) {}
    fn stop(&self) -> Option<StopReason> {
        None
    }
}

/// The share of a Newton step from which on a small change of the energy means convergence.
pub(crate) const LONG_STEP: f64 = 0.5;

/// A function to minimize. Outside its domain its value is positive infinity.
pub trait Objective {
    /// Number of unknowns.
    fn dimension(&self) -> usize;
    /// The value alone. Worth writing where a method asks for values without gradients, as Newton's line search does and
    /// L-BFGS never.
    fn value(&mut self, x: &[f64]) -> f64 {
        self.gradient(x, &mut vec![0.0; x.len()])
    }
    /// Writes the gradient at `x` and returns the value. Where the value is not finite the gradient is not used.
    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64;
    /// The largest `t` for which `x + s direction` is certain to stay in the domain for all `s < t`; infinite when
    /// unknown.
    fn max_step(&mut self, _x: &[f64], _direction: &[f64]) -> f64 {
        f64::INFINITY
    }
    /// Whether [`Objective::precondition`] does anything.
    fn is_preconditioned(&self) -> bool {
        false
    }
    /// Multiplies by the inverse of a constant positive definite model of the Hessian, which L-BFGS starts its own from.
    fn precondition(&mut self, _vector: &mut [f64]) {}
}

/// A function with a positive definite model of its Hessian.
pub trait NewtonObjective: Objective {
    /// Writes the gradient `g` and the direction `-H^-1 g` at `x`, with `H` positive definite, and returns the value.
    fn newton_direction(&mut self, x: &[f64], gradient: &mut [f64], direction: &mut [f64]) -> Result<f64, NoDirection>;
    /// Factorizations done so far.
    fn factorizations(&self) -> u64 {
        0
    }
}

/// Why there is no Newton direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoDirection {
    /// The model of the Hessian could not be factorized.
    NotPositive(NotPositive),
    /// The value or a derivative is not a finite number.
    NotFinite,
}

impl From<NotPositive> for NoDirection {
    fn from(error: NotPositive) -> Self {
        Self::NotPositive(error)
    }
}

impl fmt::Display for NoDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPositive(error) => error.fmt(f),
            Self::NotFinite => f.write_str("the energy or one of its derivatives is not a finite number"),
        }
    }
}

impl std::error::Error for NoDirection {}

/// What a minimization did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Accepted steps.
    pub iterations: u64,
    /// Factorizations of the model Hessian.
    pub factorizations: u64,
    /// Evaluations of the value, with or without derivatives.
    pub evaluations: u64,
}

impl std::ops::AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        self.iterations += other.iterations;
        self.factorizations += other.factorizations;
        self.evaluations += other.evaluations;
    }
}

/// Where a minimization ended, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    pub x: Vec<f64>,
    pub value: f64,
    /// Euclidean norm of the gradient at `x`.
    pub gradient_norm: f64,
    pub stop: StopReason,
    /// One sentence on the stop, for a reader.
    pub reason: String,
    pub counters: Counters,
}

/// When to stop. A criterion with the value 0 is switched off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stopping {
    /// Converged when the Euclidean norm of the gradient is below this.
    pub gradient_norm: f64,
    /// Converged when the decrease per unit step, `-g . p`, is below this share of the energy's magnitude. For Newton's
    /// direction `p` this is the squared Newton decrement.
    pub relative_decrement: f64,
    /// Converged when one step lowers the energy by less than this share of its magnitude.
    pub relative_change: f64,
    /// Converged when one step lowers the energy by less than this.
    pub absolute_change: f64,
    /// Most iterations.
    pub iterations: u64,
}

impl Default for Stopping {
    fn default() -> Self {
        Self {
            gradient_norm: 1e-8,
            relative_decrement: 1e-15,
            relative_change: 0.0,
            absolute_change: 0.0,
            iterations: 1000,
        }
    }
}

impl Stopping {
    /// Why the current point is good enough, judged by its gradient.
    fn gradient(&self, norm: f64) -> Option<String> {
        // An exactly critical point is converged whatever the options say: there is nowhere to go.
        (norm < self.gradient_norm || norm == 0.0)
            .then(|| format!("gradient norm {norm:.3e} is below {:.3e}", self.gradient_norm))
    }

    /// Why the current point is good enough, judged by the slope of the direction.
    fn decrement(&self, slope: f64, value: f64) -> Option<String> {
        (-slope < self.relative_decrement * value.abs()).then(|| {
            format!(
                "predicted decrease {:.3e} is below {:.3e} of the energy",
                -slope, self.relative_decrement
            )
        })
    }

    /// Why the last step was the last one, judged by the decrease of the energy.
    fn change(&self, before: f64, after: f64) -> Option<String> {
        let change = before - after;
        if change < self.relative_change * after.abs() {
            Some(format!(
                "relative energy change {:.3e} is below {:.3e}",
                change / after.abs(),
                self.relative_change
            ))
        } else if change < self.absolute_change {
            Some(format!(
                "energy change {change:.3e} is below {:.3e}",
                self.absolute_change
            ))
        } else {
            None
        }
    }
}

/// One of the minimizers, with its options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Minimizer {
    Newton(newton::Newton),
    Lbfgs(lbfgs::Lbfgs),
}

impl Minimizer {
    /// The name in an experiment file.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Newton(_) => "newton",
            Self::Lbfgs(_) => "l-bfgs",
        }
    }

    /// One line with the source, for lists.
    pub fn summary(&self) -> &'static str {
        match self {
            Self::Newton(_) => newton::SUMMARY,
            Self::Lbfgs(_) => lbfgs::SUMMARY,
        }
    }

    /// Minimizes from `x`, which must lie in the domain.
    pub fn minimize(&self, objective: &mut dyn NewtonObjective, x: Vec<f64>, observer: &mut dyn Observer) -> Solution {
        match self {
            Self::Newton(newton) => newton.minimize(objective, x, observer),
            Self::Lbfgs(lbfgs) => lbfgs.minimize(objective, x, observer),
        }
    }
}

/// Every minimizer with its default options.
pub fn minimizers() -> [Minimizer; 2] {
    [
        Minimizer::Newton(newton::Newton::default()),
        Minimizer::Lbfgs(lbfgs::Lbfgs::default()),
    ]
}
