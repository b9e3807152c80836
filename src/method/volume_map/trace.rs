//! The columns over the iterations that every solver fills alike.

use super::objective::Evaluation;
use crate::method::Traces;
use crate::optimize::{Iterate, Observer, StopReason};
use std::cell::Cell;
use std::rc::Rc;

/// Names and meanings of the columns.
pub const COLUMNS: &[(&str, &str)] = &[
    ("iteration", "number of accepted steps before this row"),
    (
        "energy",
        "what the solver minimizes: distortion, barrier and pull of the constraints together",
    ),
    (
        "distortion",
        "the part of the energy that belongs to the map: density and barrier",
    ),
    (
        "positional",
        "sum of squared distances of the boundary to its target, in units of the target's volume to the 2/3",
    ),
    ("weight", "weight of the positional part; 0 with hard constraints"),
    ("gradient_norm", "Euclidean norm of the gradient over the free unknowns"),
    (
        "step",
        "length factor of the step that led here, 1 for a full Newton step",
    ),
    (
        "min_determinant",
        "smallest determinant of a tetrahedron, the source scaled to the target's volume",
    ),
];

/// The rows so far.
#[derive(Debug, Default)]
pub struct Trace {
    rows: Vec<[f64; 8]>,
}

impl Trace {
    pub fn record(&mut self, iterate: &Iterate, evaluation: &Evaluation) {
        self.rows.push([
            iterate.iteration as f64,
            iterate.energy,
            evaluation.distortion,
            evaluation.positional,
            evaluation.weight,
            iterate.gradient_norm,
            iterate.step,
            evaluation.min_determinant,
        ]);
    }

    /// The rows as columns.
    pub fn columns(&self) -> Traces {
        COLUMNS
            .iter()
            .enumerate()
            .map(|(column, (name, _))| (name.to_string(), self.rows.iter().map(|row| row[column]).collect()))
            .collect()
    }
}

/// Records what a generic minimizer tells, with what the objective found out at the same point.
pub struct Recorder<'a> {
    pub observer: &'a mut dyn Observer,
    pub trace: &'a mut Trace,
    /// Written by the objective at its last evaluation with derivatives.
    pub latest: Rc<Cell<Evaluation>>,
}

impl Observer for Recorder<'_> {
    fn phase(&mut self, name: &str) {
        self.observer.phase(name);
    }

    fn iterate(&mut self, iterate: &Iterate) {
        self.trace.record(iterate, &self.latest.get());
        self.observer.iterate(iterate);
    }

    fn stop(&self) -> Option<StopReason> {
        self.observer.stop()
    }
}
