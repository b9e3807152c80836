//! `vargeo check`: run, then gate by the file's expectations, for CI.

use super::Exit;
use super::input::Input;
use super::run::{self, Done, Running};
use crate::experiment::plan::Plan;
use crate::report::Written;
use crate::report::gate::{Outcome, Verdict};
use crate::report::table::terminal::plain;
use crate::report::{junit, publish};
use std::path::{Path, PathBuf};

/// Runs experiments and holds their results against every `expect` of the files.
///
/// Ends with 1 when an expectation is not met, with 2 when all are met but a job failed that no expectation allows.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    running: Running,
    /// Write the verdicts as JUnit XML.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
}

/// Runs, reports, judges.
pub fn execute(arguments: Arguments) -> Exit {
    let plans = match arguments.input.plans() {
        Ok(plans) => plans,
        Err(exit) => return exit,
    };
    let mut document = junit::Document::new(match &plans[..] {
        [plan] => &plan.experiment.name,
        _ => "vargeo",
    });
    let exit = run::each(&plans, &arguments.running, |plan, done, written| {
        document.add(&plan.experiment.name, &done.rows, &written.verdicts);
        judge(plan, done, written)
    });
    if exit != Exit::Interrupted
        && let Some(path) = &arguments.junit
        && let Err(error) = write_junit(path, &document)
    {
        tell!("error: {error}");
        return Exit::FileWrong;
    }
    exit
}

/// Prints what is not met.
fn judge(plan: &Plan, done: &Done, written: &Written) -> Exit {
    let experiment = &plan.experiment;
    let failed: Vec<&Verdict> = written
        .verdicts
        .iter()
        .filter(|verdict| verdict.outcome == Outcome::Failed)
        .collect();
    for verdict in &failed {
        let subject = if verdict.subject.is_empty() {
            "no job"
        } else {
            &verdict.subject
        };
        tell!(
            "{}.toml, {}: {}: expected {}, found {}",
            experiment.name,
            plain(&verdict.place),
            plain(subject),
            plain(&verdict.expected),
            plain(&verdict.found)
        );
    }
    let count = |outcome| {
        written
            .verdicts
            .iter()
            .filter(|verdict| verdict.outcome == outcome)
            .count()
    };
    let met = count(Outcome::Met);
    tell!(
        "{}: {met} {} met, {} failed, {} skipped",
        experiment.name,
        if met == 1 { "expectation" } else { "expectations" },
        failed.len(),
        count(Outcome::Skipped)
    );
    if failed.is_empty() {
        done.exit
    } else {
        Exit::ExpectationFailed
    }
}

fn write_junit(path: &Path, document: &junit::Document) -> Result<(), String> {
    let xml = document
        .write()
        .map_err(|error| format!("cannot compose JUnit: {error}"))?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let file = path.file_name().and_then(|name| name.to_str());
    let file = file.ok_or_else(|| format!("{} names no file for --junit", path.display()))?;
    std::fs::create_dir_all(folder).map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    publish::publish(folder, file, xml.as_bytes()).map_err(|error| error.to_string())?;
    Ok(())
}
