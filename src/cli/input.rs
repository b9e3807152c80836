//! What every command on experiment files shares: the files, the folders of models, and how diagnostics are shown.

use super::Exit;
use crate::experiment::diagnostic::{Diagnostic, Severity, render};
use crate::experiment::document;
use crate::experiment::file::Experiment;
use crate::experiment::plan::{Lookup, Plan};
use crate::method;
use std::collections::BTreeSet;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Experiment files and where their models are.
#[derive(clap::Args)]
pub struct Input {
    /// Experiment files. A folder stands for those in it and in the folders below, which are the TOML files with a
    /// `method`.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// A folder where model files are looked for after the experiment's own; may be given several times. The variable
    /// VARGEO_MODELS holds more, separated as in PATH.
    #[arg(long, value_name = "DIR")]
    pub models: Vec<PathBuf>,
}

impl Input {
    /// Reads the files and unfolds their plans. What is wrong or doubtful is printed on standard error, for all files;
    /// the plans' notices are left to the caller.
    pub fn plans(&self) -> Result<Vec<Plan>, Exit> {
        let lookup = self.lookup()?;
        let mut plans: Vec<(PathBuf, Plan)> = Vec::new();
        let mut wrong = Vec::new();
        for file in self.experiments()? {
            let plan = Experiment::read(&file, method::methods()).and_then(|experiment| {
                show(&experiment.origin.warnings);
                Plan::new(experiment, &lookup)
            });
            match plan {
                Ok(plan) => plans.push((file, plan)),
                Err(diagnostics) => wrong.extend(diagnostics),
            }
        }
        for (index, (file, plan)) in plans.iter().enumerate() {
            let same = |other: &&(PathBuf, Plan)| other.1.experiment.name == plan.experiment.name;
            if let Some((other, _)) = plans[..index].iter().find(same) {
                let message = format!(
                    "{} and {} would write their reports to one folder, \"{}\"",
                    other.display(),
                    file.display(),
                    plan.experiment.name
                );
                wrong.push(Diagnostic::error(message).help("rename one of the files"));
            }
        }
        if wrong.is_empty() {
            Ok(plans.into_iter().map(|(_, plan)| plan).collect())
        } else {
            Err(fail(&wrong))
        }
    }

    /// The files named, folders replaced by what is in them.
    fn experiments(&self) -> Result<Vec<PathBuf>, Exit> {
        let mut files = Vec::new();
        for path in &self.files {
            if !path.is_dir() {
                files.push(path.clone());
                continue;
            }
            let before = files.len();
            let read = find(path, &mut files);
            read.map_err(|error| fail(&[Diagnostic::error(format!("cannot list {}: {error}", path.display()))]))?;
            if files.len() == before {
                let message = format!("{}: no experiment file in this folder", path.display());
                let help = "an experiment file ends in .toml and has a method; `vargeo new METHOD` writes one";
                return Err(fail(&[Diagnostic::error(message).help(help)]));
            }
        }
        // A file that is named twice, itself and by its folder, is one experiment.
        let mut seen = BTreeSet::new();
        files.retain(|file| seen.insert(std::fs::canonicalize(file).unwrap_or_else(|_| file.clone())));
        Ok(files)
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

/// Adds the experiment files of a folder and of those below, by name. Links to folders are not followed.
fn find(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    let mut entries = std::fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        if entry.file_type()?.is_dir() {
            find(&path, files)?;
        } else if path.extension().is_some_and(|ending| ending == "toml") {
            // A file that cannot be read as TOML is reported when it is read as an experiment.
            let table = (document::read(&path).ok())
                .and_then(|bytes| toml::from_str::<toml::Table>(std::str::from_utf8(&bytes).ok()?).ok());
            if table.is_none_or(|table| table.contains_key("method")) {
                files.push(path);
            }
        }
    }
    Ok(())
}

/// Prints diagnostics on standard error, in colour on a terminal.
pub fn show(diagnostics: &[Diagnostic]) {
    let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let _ = std::io::stderr().write_all(render(diagnostics, colour).as_bytes());
}

/// Prints diagnostics that keep a command from going on.
pub fn fail(diagnostics: &[Diagnostic]) -> Exit {
    show(diagnostics);
    let count = diagnostics
        .iter()
        .filter(|diagnostic| diagnostic.severity == Severity::Error)
        .count();
    if count > 1 {
        tell!("{count} errors; nothing was run");
    }
    Exit::FileWrong
}
