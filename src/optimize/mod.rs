//! Minimizers: what they ask of an objective, what they tell an observer, and why they stop.
//!
//! A failed line search is a stop reason, never a warning. Nothing here reads a clock: limits arrive through the observer.

use serde::{Deserialize, Serialize};

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
