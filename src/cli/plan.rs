//! `vargeo plan`: the jobs of an experiment, which of them are stored, and which cannot run.

use super::Exit;
use super::input::Input;
use crate::experiment::grid;
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
    let plan = match arguments.input.plan() {
        Ok(plan) => plan,
        Err(exit) => return exit,
    };
    let store = Store::new(arguments.results.join("store"));
    let effort = effort(&plan, None);
    let states: Vec<State> = plan
        .jobs
        .iter()
        .map(|job| match (&job.resolved, stored(&store, job, effort)) {
            (None, _) => State::Missing,
            (_, Lookup::Hit(_)) => State::Stored,
            (_, Lookup::Miss) => State::ToRun,
            (_, Lookup::Damaged { reason, .. }) => {
                eprintln!(
                    "warning: the stored result of {} is damaged ({reason}); it will be computed again",
                    job.name
                );
                State::ToRun
            }
        })
        .collect();
    // A reader who has gone away is no error.
    let _ = io::stdout().write_all(describe(&plan, &states).as_bytes());
    Exit::Well
}

/// What would become of a job.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    ToRun,
    Stored,
    Missing,
}

/// The count of jobs, then a line for each, then the notices.
fn describe(plan: &Plan, states: &[State]) -> String {
    let count = |state: State| states.iter().filter(|other| **other == state).count();
    let mut text = format!(
        "{}: {} job{}; {} to run, {} stored, {} missing\n",
        plan.experiment.title,
        plan.jobs.len(),
        if plan.jobs.len() == 1 { "" } else { "s" },
        count(State::ToRun),
        count(State::Stored),
        count(State::Missing),
    );
    let width = plan.jobs.iter().map(|job| job.name.len()).max().unwrap_or(0);
    for (job, state) in plan.jobs.iter().zip(states) {
        let state = match state {
            State::ToRun => "to run",
            State::Stored => "stored",
            State::Missing => "missing",
        };
        let key = job
            .resolved
            .as_ref()
            .map_or("", |(key, _)| key.0.get(..12).unwrap_or(&key.0));
        text += &format!(
            "  {state:<7}  {key:<12}  {:<width$}  {}\n",
            job.name,
            grid::describe(&job.axes)
        );
    }
    for notice in &plan.notices {
        text += &format!("notice: {notice}\n");
    }
    text
}
