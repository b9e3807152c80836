//! `vargeo report`: the reports of experiments from their stored records, without running anything.

use super::Exit;
use super::input::Input;
use super::run;
use crate::experiment::plan::Plan;
use crate::experiment::record::Record;
use crate::report::overview::Entry;
use crate::run::Finished;
use crate::run::pool::{effort, skipped};
use crate::run::store::{Lookup, Store};
use std::path::PathBuf;

/// Writes tables, plots, pictures and the page of each experiment from stored records, and runs nothing.
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

/// Reports what is stored; jobs that never ran are named and left out.
pub fn execute(arguments: Arguments) -> Exit {
    let plans = match arguments.input.plans() {
        Ok(plans) => plans,
        Err(exit) => return exit,
    };
    let mut entries = Vec::new();
    let mut exits = Vec::new();
    for plan in &plans {
        match report(plan, &arguments) {
            Ok(entry) => entries.push(entry),
            Err(exit) => exits.push(exit),
        }
    }
    if plans.len() > 1
        && !entries.is_empty()
        && let Err(exit) = run::write_overview(&entries, &arguments.results, arguments.quiet)
    {
        exits.push(exit);
    }
    if exits.is_empty() {
        Exit::Well
    } else {
        run::gravest(&exits)
    }
}

fn report(plan: &Plan, arguments: &Arguments) -> Result<Entry, Exit> {
    let store = Store::new(arguments.results.join("store"));
    let effort = effort(plan, None);
    let mut finished = Vec::new();
    let mut absent = Vec::new();
    for (index, job) in plan.jobs.iter().enumerate() {
        let record: Option<Record> = match &job.resolved {
            None => Some(skipped(plan, job, effort)),
            Some((key, _)) => match store.lookup(key) {
                Lookup::Hit(record) => Some(*record),
                Lookup::Miss => store.failure(key),
                Lookup::Damaged { reason, .. } => {
                    tell!(
                        "warning: the stored result of {} is damaged and left out: {reason}",
                        job.name
                    );
                    None
                }
            },
        };
        match record {
            Some(record) => finished.push(Finished {
                index,
                record,
                cached: true,
            }),
            None => absent.push(job.name.as_str()),
        }
    }
    let file = plan.experiment.name.as_str();
    if finished.iter().all(|finished| finished.record.key.0.is_empty()) {
        tell!(
            "error: no job of {file} is stored in {}\nhelp: `vargeo run` computes them",
            store.root().display()
        );
        return Err(Exit::NothingRan);
    }
    if !absent.is_empty() {
        tell!("warning: not stored and left out of the report: {}", absent.join(", "));
    }
    let rows = run::rows(plan, &store, finished);
    let written = run::write_report(
        &plan.experiment,
        &rows,
        plan.jobs.len(),
        &arguments.results,
        arguments.quiet,
    )?;
    Ok(Entry::new(&plan.experiment, &rows, plan.jobs.len(), &written.verdicts))
}
