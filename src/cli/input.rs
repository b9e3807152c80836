//! What every command on an experiment file shares: the file, the folders of models, and how diagnostics are shown.

use super::Exit;
use crate::experiment::diagnostic::{Diagnostic, Severity, render};
use crate::experiment::file::Experiment;
use crate::experiment::plan::{Lookup, Plan};
use crate::method;
use std::io::IsTerminal;
use std::path::PathBuf;

/// An experiment file and where its models are.
#[derive(clap::Args)]
pub struct Input {
    /// The experiment file.
    pub file: PathBuf,
    /// A folder where model files are looked for after the experiment's own; may be given several times. The variable
    /// VARGEO_MODELS holds more, separated as in PATH.
    #[arg(long, value_name = "DIR")]
    pub models: Vec<PathBuf>,
}

impl Input {
    /// Reads the file and unfolds its plan. What is wrong or doubtful is printed on standard error; the plan's notices
    /// are left to the caller.
    pub fn plan(&self) -> Result<Plan, Exit> {
        let experiment = Experiment::read(&self.file, method::methods()).map_err(|diagnostics| fail(&diagnostics))?;
        show(&experiment.origin.warnings);
        Plan::new(experiment, &self.lookup()?).map_err(|diagnostics| fail(&diagnostics))
    }

    fn lookup(&self) -> Result<Lookup, Exit> {
        let mut folders = self.models.clone();
        if let Some(wrong) = folders.iter().find(|folder| !folder.is_dir()) {
            let message = format!("--models {}: no such folder", wrong.display());
            return Err(fail(&[Diagnostic::error(message).help("name an existing folder")]));
        }
        if let Some(more) = std::env::var_os("VARGEO_MODELS") {
            folders.extend(std::env::split_paths(&more).filter(|folder| !folder.as_os_str().is_empty()));
        }
        Ok(Lookup { folders })
    }
}

/// Prints diagnostics on standard error, in colour on a terminal.
pub fn show(diagnostics: &[Diagnostic]) {
    let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    eprint!("{}", render(diagnostics, colour));
}

/// Prints diagnostics that keep a command from going on.
pub fn fail(diagnostics: &[Diagnostic]) -> Exit {
    show(diagnostics);
    let count = diagnostics
        .iter()
        .filter(|diagnostic| diagnostic.severity == Severity::Error)
        .count();
    if count > 1 {
        eprintln!("{count} errors; nothing was run");
    }
    Exit::FileWrong
}
