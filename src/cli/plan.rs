//! `vargeo plan`: the jobs of an experiment, which of them are stored, and which cannot run.

use super::Exit;
use super::input::Input;
use crate::experiment::grid::describe;
use crate::experiment::job::Key;
use crate::experiment::plan::Plan;
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
    let store = arguments.results.join("store");
    // As a run would find it, but for the checks of its content.
    let stored = |key: &Key| key.0.get(..2).is_some_and(|shard| store.join(shard).join(&key.0).join("record.json").is_file());
    let mut text = Vec::new();
    let _ = print(&plan, &stored, &mut text);
    let _ = io::stdout().write_all(&text);
    Exit::Well
}

/// Writes the count of jobs, then a line for each.
fn print(plan: &Plan, stored: &dyn Fn(&Key) -> bool, out: &mut dyn Write) -> io::Result<()> {
    let states: Vec<&str> = plan
        .jobs
        .iter()
        .map(|job| match &job.resolved {
            None => "missing",
            Some((key, _)) if stored(key) => "stored",
            Some(_) => "to run",
        })
        .collect();
    let count = |state: &str| states.iter().filter(|other| **other == state).count();
    let experiment = &plan.experiment;
    writeln!(
        out,
        "{}: {} job{}, {} to run, {} stored, {} missing",
        experiment.title,
        plan.jobs.len(),
        if plan.jobs.len() == 1 { "" } else { "s" },
        count("to run"),
        count("stored"),
        count("missing"),
    )?;
    let width = plan.jobs.iter().map(|job| job.name.len()).max().unwrap_or(0);
    for (job, state) in plan.jobs.iter().zip(states) {
        let key = job.resolved.as_ref().map_or("", |(key, _)| key.0.get(..12).unwrap_or(&key.0));
        writeln!(out, "  {state:<7}  {key:<12}  {:<width$}  {}", job.name, describe(&job.axes))?;
    }
    Ok(())
}
