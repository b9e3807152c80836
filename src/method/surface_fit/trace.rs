//! The columns over the iterations of all stages.

use super::objective::Parts;
use crate::method::Traces;
use crate::optimize::{Iterate, Observer, StopReason};
use std::cell::Cell;
use std::rc::Rc;

/// Names and meanings of the columns.
pub const COLUMNS: &[(&str, &str)] = &[
    ("iteration", "number of accepted steps before this row, over all stages"),
    ("stage", "number of the stage, from 0; refinements go on counting"),
    (
        "energy",
        "what is minimized: both terms, the regularizers and what unfolds, with their factors",
    ),
    ("target_to_fit", "the term from the target to the fit's vertices"),
    ("fit_to_target", "the term from the fit to the target's samples"),
    ("regularizer", "|L X|^2 without its factor"),
    (
        "unevenness",
        "|P L X|^2, the part of it along the fit, without its factor",
    ),
    (
        "gradient_norm",
        "Euclidean norm of the gradient over the control points",
    ),
    ("step", "length factor of the step that led here"),
];

/// The rows so far.
#[derive(Debug, Default)]
pub struct Trace {
    rows: Vec<[f64; 9]>,
}

impl Trace {
    /// The rows as columns.
    pub fn columns(&self) -> Traces {
        COLUMNS
            .iter()
            .enumerate()
            .map(|(index, (name, _))| (name.to_string(), self.rows.iter().map(|row| row[index]).collect()))
            .collect()
    }
}

/// Passes iterates on to an observer and records them with the parts of the energy.
pub struct Recorder<'a> {
    pub latest: Rc<Cell<Parts>>,
    pub stage: u64,
    /// Iterations of the stages before.
    pub before: u64,
    pub observer: &'a mut dyn Observer,
    pub trace: &'a mut Trace,
}

impl Observer for Recorder<'_> {
    fn phase(&mut self, name: &str) {
        self.observer.phase(name);
    }

    fn iterate(&mut self, iterate: &Iterate) {
        let iterate = Iterate {
            iteration: self.before + iterate.iteration,
            ..*iterate
        };
        let parts = self.latest.get();
        self.trace.rows.push([
            iterate.iteration as f64,
            self.stage as f64,
            iterate.energy,
            parts.from_target,
            parts.to_target,
            parts.regularizer,
            parts.unevenness,
            iterate.gradient_norm,
            iterate.step,
        ]);
        self.observer.iterate(&iterate);
    }

    fn stop(&self) -> Option<StopReason> {
        self.observer.stop()
    }
}
