//! `vargeo check`: runs an experiment, then holds its expectations against the results.

use super::Exit;
use super::input::Input;
use super::run::{Running, run, wrong};
use crate::report::{gate, junit};
use std::path::PathBuf;

/// Runs an experiment and fails when a job fails or an expectation is not met.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    running: Running,
    /// Write the jobs and expectations as JUnit XML.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
}

/// Runs, reports, gates.
pub fn execute(arguments: Arguments) -> Exit {
    check(&arguments).unwrap_or_else(|exit| exit)
}

fn check(arguments: &Arguments) -> Result<Exit, Exit> {
    let plan = arguments.input.plan()?;
    let done = run(&plan, &arguments.running)?;
    let Some(written) = done.written else {
        return Ok(done.exit);
    };
    if let Some(path) = &arguments.junit {
        let text = junit::write(&plan.experiment.name, &done.rows, &written.verdicts)
            .map_err(|error| wrong(&format!("cannot compose {}: {error}", path.display())))?;
        std::fs::write(path, text).map_err(|error| wrong(&format!("cannot write {}: {error}", path.display())))?;
    }
    Ok(match done.exit {
        Exit::Well if !gate::passes(&written.verdicts) => Exit::ExpectationFailed,
        exit => exit,
    })
}
