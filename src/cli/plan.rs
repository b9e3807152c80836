//! `vargeo plan`: the jobs of experiments, which of them are stored, and which cannot run.

use super::Exit;
use super::input::Input;
use crate::experiment::grid;
use crate::experiment::job::{Job, Key};
use crate::experiment::plan::Plan;
use crate::run::pool::{effort, stored};
use crate::run::store::{Lookup, Store};
use std::io::{self, Write};
use std::path::PathBuf;

/// Shows what would run, what is stored and what is missing, and runs nothing.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    input: Input,
    /// The folder of results.
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
}

/// Prints the plan.
pub fn execute(arguments: Arguments) -> Exit {
    let plans = match arguments.input.plans() {
        Ok(plans) => plans,
        Err(exit) => return exit,
    };
    let store = Store::new(arguments.results.join("store"));
    for plan in &plans {
        // A reader who has gone away is no error.
        let _ = io::stdout().write_all(describe(plan, &states(plan, &store)).as_bytes());
    }
    Exit::Well
}

/// What would become of each job.
fn states(plan: &Plan, store: &Store) -> Vec<State> {
    let effort = effort(plan, None);
    plan.jobs
        .iter()
        .map(|job| match (&job.resolved, stored(store, job, effort)) {
            (None, _) => State::Missing,
            (_, Lookup::Hit(_)) => State::Stored,
            (Some((_, resolved)), Lookup::Miss) if known_before(store, resolved) => State::Outdated,
            (_, Lookup::Miss) => State::ToRun,
            (_, Lookup::Damaged { reason, .. }) => {
                tell!(
                    "warning: the stored result of {} is damaged ({reason}); it will be computed again",
                    job.name
                );
                State::ToRun
            }
        })
        .collect()
}

/// What would become of a job.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    ToRun,
    /// Stored by an earlier version of the method, whose results may differ.
    Outdated,
    Stored,
    Missing,
}

/// Whether an earlier version of the method has left a result of this job.
fn known_before(store: &Store, job: &Job) -> bool {
    (1..job.method_version).any(|method_version| {
        let earlier = Job {
            method_version,
            ..job.clone()
        };
        store.entry(&Key::of(&earlier)).exists()
    })
}

/// The count of jobs, then a line for each, then the notices.
fn describe(plan: &Plan, states: &[State]) -> String {
    let count = |state: State| states.iter().filter(|other| **other == state).count();
    let mut text = format!(
        "{}: {} job{}; {} to run, {} stored, {} missing\n",
        plan.experiment.title,
        plan.jobs.len(),
        if plan.jobs.len() == 1 { "" } else { "s" },
        count(State::ToRun) + count(State::Outdated),
        count(State::Stored),
        count(State::Missing),
    );
    let width = plan.jobs.iter().map(|job| job.name.len()).max().unwrap_or(0);
    for (job, state) in plan.jobs.iter().zip(states) {
        let state = match state {
            State::ToRun => "to run",
            State::Outdated => "outdated",
            State::Stored => "stored",
            State::Missing => "missing",
        };
        let key = job
            .resolved
            .as_ref()
            .map_or("", |(key, _)| key.0.get(..12).unwrap_or(&key.0));
        text += &format!(
            "  {state:<8}  {key:<12}  {:<width$}  {}\n",
            job.name,
            grid::describe(&job.axes)
        );
    }
    if count(State::Outdated) > 0 {
        text += "notice: outdated results are those of an earlier version of the method; they are computed anew\n";
    }
    for notice in &plan.notices {
        text += &format!("notice: {notice}\n");
    }
    text
}
