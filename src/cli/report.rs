//! `vargeo report`: tables, plots, pictures and the page from what is stored, running nothing.

use super::Exit;
use super::input::Input;
use super::run::{rows, write_report, wrong};
use crate::experiment::plan::{Plan, PlannedJob};
use crate::run::Finished;
use crate::run::pool::{effort, skipped};
use crate::run::store::{Lookup, Store};
use std::path::PathBuf;

/// Writes the report of an experiment from stored results, running nothing.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    input: Input,
    /// Folder of results.
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
    /// Show warnings and errors only.
    #[arg(long, short)]
    quiet: bool,
}

/// Looks up, then reports.
pub fn execute(arguments: Arguments) -> Exit {
    report(&arguments).unwrap_or_else(|exit| exit)
}

fn report(arguments: &Arguments) -> Result<Exit, Exit> {
    let plan = arguments.input.plan()?;
    let store = Store::new(arguments.results.join("store"));
    let found = look_up(&plan, &store);
    let missing = plan.jobs.len() - found.len();
    if missing > 0 {
        eprintln!(
            "notice: {missing} of {} jobs are not stored and not in the report; `vargeo run {}` computes them",
            plan.jobs.len(),
            arguments.input.file.display()
        );
    }
    if !found.iter().any(|finished| finished.cached) {
        wrong("nothing is stored of this experiment");
        return Ok(Exit::NothingRan);
    }
    let rows = rows(&plan, &store, found);
    write_report(&plan.experiment, &rows, &arguments.results, arguments.quiet)?;
    Ok(Exit::Well)
}

/// Results with whatever times were taken, recorded failures, and jobs without their optional model.
fn look_up(plan: &Plan, store: &Store) -> Vec<Finished> {
    let effort = effort(plan, None);
    let find = |(index, job): (usize, &PlannedJob)| -> Option<Finished> {
        let finished = |record, cached| Finished { index, record, cached };
        let Some((key, _)) = &job.resolved else {
            return Some(finished(skipped(&plan.experiment, job, effort), false));
        };
        match store.lookup(key) {
            Lookup::Hit(record) => return Some(finished(*record, true)),
            Lookup::Damaged { reason, .. } => {
                eprintln!("warning: the stored result of {} is damaged ({reason})", job.name);
            }
            Lookup::Miss => {}
        }
        store.failure(key).map(|record| finished(record, true))
    };
    plan.jobs.iter().enumerate().filter_map(find).collect()
}
