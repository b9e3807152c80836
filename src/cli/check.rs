//! `vargeo check`: run, then gate by the file's expectations, for CI.

use super::Exit;
use super::input::Input;
use super::run::{self, Running};
use crate::report::gate::{Outcome, Verdict};
use crate::report::table::terminal::plain;
use crate::report::{junit, publish};
use std::path::{Path, PathBuf};

/// Runs an experiment and holds its results against every `expect` of the file.
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
    let done = arguments.input.plan().and_then(|plan| {
        let done = run::run(&plan, &arguments.running)?;
        Ok((plan, done))
    });
    let (plan, done) = match done {
        Ok(done) => done,
        Err(exit) => return exit,
    };
    let Some(written) = &done.written else { return done.exit };
    let experiment = &plan.experiment;
    if let Some(path) = &arguments.junit
        && let Err(error) = write_junit(path, &experiment.name, &done.rows, &written.verdicts)
    {
        eprintln!("error: {error}");
        return Exit::FileWrong;
    }
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
        eprintln!(
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
    eprintln!(
        "{met} {} met, {} failed, {} skipped",
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

fn write_junit(path: &Path, name: &str, rows: &[crate::report::Row], verdicts: &[Verdict]) -> Result<(), String> {
    let xml = junit::write(name, rows, verdicts).map_err(|error| format!("cannot compose JUnit: {error}"))?;
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
