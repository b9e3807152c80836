//! `vargeo run`: every job of the experiments that is not stored yet, then the reports.

use super::input::Input;
use super::{Exit, progress};
use crate::experiment::file::Experiment;
use crate::experiment::grid;
use crate::experiment::nearest::suggestion;
use crate::experiment::plan::Plan;
use crate::experiment::record::{Record, Status};
use crate::report::gate::Outcome;
use crate::report::overview::{self, Entry};
use crate::report::{self, Row};
use crate::run::interrupt::Interrupt;
use crate::run::store::{MESH, Store};
use crate::run::{Finished, Options, Program, Run, run_plan};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Computes every job of the experiments that is not stored yet, and writes tables, plots, pictures and a page for each.
///
/// Finished jobs are kept, whatever happens to the others: the same command goes on where the last one ended. Nothing
/// runs until every file is read without an error.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    running: Running,
}

/// How they are computed.
#[derive(clap::Args)]
pub(super) struct Running {
    /// Folder of results.
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
    /// Jobs side by side; as many as the cores permit by default, and one where times are taken exclusively.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    jobs: Option<u32>,
    /// Threads of each job; what the file's [timing] says by default, else 1. Results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    /// Only the job of this name, or the jobs whose names contain it; the others are reported as far as they are stored.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Compute stored jobs again, and compare.
    #[arg(long)]
    force: bool,
    /// Show warnings and errors only.
    #[arg(long, short)]
    quiet: bool,
}

/// Runs, then reports.
pub fn execute(arguments: Arguments) -> Exit {
    match arguments.input.plans() {
        Ok(plans) => each(&plans, &arguments.running, |_, done, _| done.exit),
        Err(exit) => exit,
    }
}

/// Runs one experiment after another. `judge` has the last word on how each ended; the gravest end counts for all.
pub(super) fn each(
    plans: &[Plan],
    running: &Running,
    mut judge: impl FnMut(&Plan, &Done, &report::Written) -> Exit,
) -> Exit {
    let interrupt = Interrupt::default();
    // Whoever asks twice does not want to wait; job processes end with this one.
    interrupt.listen(|count| {
        if count > 1 {
            std::process::exit(Exit::Interrupted as i32);
        }
    });
    // With several files those are meant that have a job of the name.
    let any = |plan: &&Plan| {
        let named = |part: &String| plan.jobs.iter().any(|job| job.name.contains(part.as_str()));
        running.only.is_empty() || running.only.iter().any(named)
    };
    let asked: Vec<&Plan> = plans.iter().filter(any).collect();
    let asked = if asked.is_empty() {
        plans.iter().collect()
    } else {
        asked
    };
    let mut entries = Vec::new();
    let mut exits = Vec::new();
    for plan in asked {
        let chosen = match choose(plan, &running.only, plans.len() > 1) {
            Ok(chosen) => chosen,
            Err(exit) => return exit,
        };
        let done = match run(plan, running, chosen, &interrupt) {
            Ok(done) => done,
            Err(exit) => {
                exits.push(exit);
                continue;
            }
        };
        let Some(written) = &done.written else {
            return done.exit;
        };
        exits.push(judge(plan, &done, written));
        entries.push(Entry::new(
            &plan.experiment,
            &done.rows,
            plan.jobs.len(),
            &written.verdicts,
        ));
    }
    // A part of the experiments is no overview of them.
    if plans.len() > 1
        && running.only.is_empty()
        && let Err(exit) = write_overview(&entries, &running.results, running.quiet)
    {
        exits.push(exit);
    }
    gravest(&exits)
}

/// Writes `results/index.html` and prints a line for each experiment.
pub(super) fn write_overview(entries: &[Entry], results: &Path, quiet: bool) -> Result<(), Exit> {
    let page = overview::write(entries, results).map_err(|error| wrong(&error.to_string()))?;
    if !quiet {
        say(&format!(
            "{}\noverview: {}",
            overview::terminal(entries),
            page.display()
        ));
    }
    Ok(())
}

/// Nothing ran only where that is so of every experiment.
pub(super) fn gravest(exits: &[Exit]) -> Exit {
    let order = [Exit::FileWrong, Exit::ExpectationFailed, Exit::JobFailed, Exit::Well];
    let found = order.into_iter().find(|exit| exits.contains(exit));
    found.unwrap_or(Exit::NothingRan)
}

/// What a run and its report leave.
pub(super) struct Done {
    pub(super) exit: Exit,
    pub(super) rows: Vec<Row>,
    /// Absent when the run was interrupted.
    pub(super) written: Option<report::Written>,
}

/// Runs what is missing and writes the report.
fn run(plan: &Plan, running: &Running, chosen: Option<Vec<usize>>, interrupt: &Interrupt) -> Result<Done, Exit> {
    let store = Store::new(running.results.join("store"));
    if !running.quiet {
        let jobs = plan.jobs.len();
        let plural = if jobs == 1 { "" } else { "s" };
        say(&format!("{}: {jobs} job{plural}", plan.experiment.title));
        plan.notices.iter().for_each(|notice| tell!("notice: {notice}"));
    }
    let options = Options {
        store: store.clone(),
        program: Program::this().map_err(|error| wrong(&format!("cannot find the program itself: {error}")))?,
        side_by_side: running.jobs.map(|jobs| jobs as usize),
        threads: running.threads.map(|threads| threads as usize),
        force: running.force,
        only: chosen,
        interrupt: interrupt.clone(),
    };
    let outcome = {
        let mut display = progress::display(running.quiet);
        run_plan(plan, &options, display.as_mut())
    };
    let outcome = outcome.map_err(|error| wrong(&error.to_string()))?;
    repeat_warnings(&outcome);
    if outcome.interrupted {
        let left = plan.jobs.len() - outcome.finished.len();
        let skipped = |finished: &&Finished| finished.record.result.status == Status::Skipped;
        let kept = outcome.finished.len() - outcome.finished.iter().filter(skipped).count();
        let jobs = plan.jobs.len();
        tell!(
            "interrupted: {kept} of {jobs} jobs are finished and kept; the same command computes the other {left}, \
             `vargeo report` shows those finished"
        );
        return Ok(Done {
            exit: Exit::Interrupted,
            rows: Vec::new(),
            written: None,
        });
    }
    let exit = verdict(plan, &outcome.finished);
    if !running.quiet {
        say(&summary(plan, &outcome.finished));
        if running.force && outcome.warnings.is_empty() {
            say("no stored result differs from the one computed again\n");
        }
    }
    let rows = rows(plan, &store, outcome.finished);
    let written = write_report(
        &plan.experiment,
        &rows,
        plan.jobs.len(),
        &running.results,
        running.quiet,
    )?;
    Ok(Done {
        exit,
        rows,
        written: Some(written),
    })
}

/// The jobs whose names are asked for; all when none are. A name that no job has is an error, unless another file may
/// have one.
fn choose(plan: &Plan, only: &[String], others: bool) -> Result<Option<Vec<usize>>, Exit> {
    if only.is_empty() {
        return Ok(None);
    }
    let mut chosen = Vec::new();
    for part in only {
        let before = chosen.len();
        // A whole name means that job alone.
        let exact = plan.jobs.iter().any(|job| job.name == *part);
        let asked = |name: &str| {
            if exact {
                name == part
            } else {
                name.contains(part.as_str())
            }
        };
        let named = plan.jobs.iter().enumerate().filter(|(_, job)| asked(&job.name));
        chosen.extend(named.map(|(index, _)| index));
        if chosen.len() == before && !others {
            let names = plan.jobs.iter().map(|job| job.name.as_str());
            let help = suggestion(part, names).unwrap_or_else(|| "`vargeo plan FILE` lists the jobs".into());
            return Err(wrong(&format!("no job's name contains \"{part}\"\nhelp: {help}")));
        }
    }
    if chosen.is_empty() {
        return Err(wrong(&format!("no job's name contains \"{}\"", only.join("\" or \""))));
    }
    chosen.sort_unstable();
    chosen.dedup();
    Ok(Some(chosen))
}

fn wrong(message: &str) -> Exit {
    tell!("error: {message}");
    Exit::FileWrong
}

/// Prints a line; a reader who has gone away is no reason to stop computing.
fn say(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// Warnings scroll away during a run; those on wrong results are worth a second telling.
fn repeat_warnings(outcome: &Run) {
    let grave: Vec<&String> = outcome
        .warnings
        .iter()
        .filter(|warning| warning.contains("not deterministic"))
        .collect();
    if !grave.is_empty() {
        tell!("warning: {} jobs are NOT DETERMINISTIC:", grave.len());
        grave.iter().for_each(|warning| tell!("  {warning}"));
    }
}

/// Whether a job ended as an expectation of the file says it must.
fn is_expected(plan: &Plan, finished: &Finished) -> bool {
    let axes = &plan.jobs[finished.index].axes;
    plan.experiment.expectations.iter().any(|expectation| {
        expectation.stop.as_ref() == Some(&finished.record.result.stop) && grid::matches(&expectation.condition, axes)
    })
}

fn failed(record: &Record) -> bool {
    matches!(record.result.status, Status::Failed | Status::Refused)
}

/// The exit code that the records ask for: a failure that is expected is none.
fn verdict(plan: &Plan, finished: &[Finished]) -> Exit {
    let mut computed = finished
        .iter()
        .filter(|finished| finished.record.result.status != Status::Skipped);
    if finished
        .iter()
        .any(|finished| failed(&finished.record) && !is_expected(plan, finished))
    {
        Exit::JobFailed
    } else if computed.next().is_none() {
        Exit::NothingRan
    } else {
        Exit::Well
    }
}

fn summary(plan: &Plan, finished: &[Finished]) -> String {
    let count = |test: &dyn Fn(&Finished) -> bool| finished.iter().filter(|finished| test(finished)).count();
    let status = |finished: &Finished| finished.record.result.status;
    let parts = [
        (
            count(&|job| !job.cached && !failed(&job.record) && status(job) != Status::Skipped),
            "computed",
        ),
        (count(&|job| job.cached), "from the store"),
        (count(&|job| !job.cached && failed(&job.record)), "failed"),
        (count(&|job| status(job) == Status::Skipped), "skipped"),
        (plan.jobs.len() - finished.len(), "not asked for"),
    ];
    let parts: Vec<String> = parts
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, word)| format!("{count} {word}"))
        .collect();
    format!("{}\n", parts.join(", "))
}

/// The records as the report wants them, with the places of the result meshes in the store.
pub(super) fn rows(plan: &Plan, store: &Store, finished: Vec<Finished>) -> Vec<Row> {
    let row = |finished: Finished| {
        let job = &plan.jobs[finished.index];
        let record = finished.record;
        let mesh = record.result.artifacts.contains_key(MESH);
        let mesh = mesh.then(|| store.entry(&record.key).join(MESH));
        let further = record.result.artifacts.keys().filter(|name| *name != MESH);
        let files = further.map(|name| (name.clone(), store.entry(&record.key).join(name)));
        Row {
            name: job.name.clone(),
            axes: job.axes.clone(),
            files: files.collect(),
            record,
            cached: finished.cached,
            mesh,
        }
    };
    finished.into_iter().map(row).collect()
}

/// In a report's folder, the path of the experiment file it was written for.
const ORIGIN: &str = ".origin";

/// Warns where a folder holds the report of another experiment file of the same name, and notes whose it is from now on.
fn tell_overwritten(experiment: &Experiment, folder: &Path) {
    let file = experiment.origin.folder.join(format!("{}.toml", experiment.name));
    let Ok(file) = std::fs::canonicalize(file) else {
        return;
    };
    let note = folder.join(ORIGIN);
    let before = std::fs::read_to_string(&note).map(PathBuf::from);
    if let Ok(before) = before
        && before != file
        && before.exists()
    {
        tell!(
            "warning: {} held the report of {}, which is overwritten; its results stay in the store\nhelp: rename one of \
             the two files, or give each a --results folder of its own",
            folder.display(),
            before.display()
        );
    }
    // Without the note the next warning is missing, nothing else.
    let _ = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&note, file.as_os_str().as_encoded_bytes()));
}

/// Writes `results/<experiment>/` and prints the tables.
pub(super) fn write_report(
    experiment: &Experiment,
    rows: &[Row],
    planned: usize,
    results: &Path,
    quiet: bool,
) -> Result<report::Written, Exit> {
    let folder = results.join(&experiment.name);
    tell_overwritten(experiment, &folder);
    let written = report::write(experiment, rows, planned, &folder).map_err(|error| wrong(&error.to_string()))?;
    if !quiet {
        say(&report::terminal(experiment, rows, None));
        let unmet = written
            .verdicts
            .iter()
            .filter(|verdict| verdict.outcome == Outcome::Failed)
            .count();
        if unmet > 0 {
            say(&format!(
                "{unmet} of {} expectations are not met; the page says which",
                written.verdicts.len()
            ));
        }
        say(&format!("page: {}", written.page.display()));
    }
    Ok(written)
}
