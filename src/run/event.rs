//! What happens during a run, told to whoever shows it.

use crate::experiment::record::Record;

/// Where a minimization stands; absent numbers are not finite.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Progress {
    pub iteration: u64,
    pub energy: Option<f64>,
    pub gradient_norm: Option<f64>,
}

/// One happening. `index` is the job's place in the plan.
#[derive(Debug)]
pub enum Event<'a> {
    /// Before anything is computed.
    Planned {
        jobs: usize,
        /// Already in the store.
        stored: usize,
        /// Without their optional model.
        skipped: usize,
        /// To be computed.
        missing: usize,
        /// How many run side by side.
        side_by_side: usize,
        threads: usize,
    },
    /// A process was started.
    Started { index: usize, name: &'a str },
    /// Another process computes the same job, or has the machine to itself.
    Waiting {
        index: usize,
        name: &'a str,
        reason: &'a str,
    },
    /// A repetition of the computation begins, counted from 0.
    Repetition {
        index: usize,
        name: &'a str,
        repetition: u32,
    },
    Phase {
        index: usize,
        name: &'a str,
        phase: &'a str,
    },
    Iterate {
        index: usize,
        name: &'a str,
        progress: Progress,
    },
    /// `cached`: it came from the store, or from another job of the plan with the same key.
    Finished {
        index: usize,
        name: &'a str,
        record: &'a Record,
        cached: bool,
    },
    /// Damage in the store, a result that differs from the stored one, a record that could not be written.
    Warning { text: &'a str },
    /// The run was asked to stop; running processes are being ended.
    Interrupted { running: usize },
}

/// Someone who follows a run. Called from the thread that runs the pool; must not block.
pub trait Listener {
    fn event(&mut self, event: &Event<'_>);
}

/// Follows nothing.
pub struct Nobody;

impl Listener for Nobody {
    fn event(&mut self, _event: &Event<'_>) {}
}
