//! `vargeo new`: a commented experiment to start from.

use super::Exit;
use super::input::fail;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::nearest::suggestion;
use crate::experiment::template::template;
use crate::method;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Prints or writes a commented experiment that runs as it is.
#[derive(clap::Args)]
pub struct Arguments {
    /// The method; `vargeo list methods` names them.
    method: String,
    /// The file to write; one that exists is left as it is. Without it the text goes to standard output.
    file: Option<PathBuf>,
}

/// Writes the experiment.
pub fn execute(arguments: Arguments) -> Exit {
    let Some(method) = method::find(&arguments.method) else {
        let known = method::methods().iter().map(|method| method.name());
        let error = Diagnostic::error(format!("unknown method \"{}\"", arguments.method));
        return fail(&[error.help_if(suggestion(&arguments.method, known))]);
    };
    let text = template(method);
    let Some(file) = arguments.file else {
        // A reader who has gone away is no error.
        let _ = io::stdout().write_all(text.as_bytes());
        return Exit::Well;
    };
    match write(&file, &text) {
        Ok(()) => {
            answer!(
                "{} is written; see its jobs with `vargeo plan {}`",
                file.display(),
                file.display()
            );
            Exit::Well
        }
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            let error = Diagnostic::error(format!("{} exists", file.display()));
            fail(&[error.help("nothing was overwritten; choose another name or remove it")])
        }
        Err(error) => fail(&[Diagnostic::error(format!("cannot write {}: {error}", file.display()))]),
    }
}

fn write(file: &Path, text: &str) -> io::Result<()> {
    let mut output = OpenOptions::new().write(true).create_new(true).open(file)?;
    output.write_all(text.as_bytes())?;
    output.sync_all()
}
