//! `vargeo schema`: the JSON Schema of the experiment file.

use super::Exit;
use crate::{experiment, method};
use std::io::{self, Write as _};

/// Prints a JSON Schema of the experiment file, for editors and validators.
#[derive(clap::Args)]
pub struct Arguments {}

/// Prints the schema.
pub fn execute(_arguments: Arguments) -> Exit {
    // A reader who has gone away is no error.
    let _ = writeln!(io::stdout(), "{:#}", experiment::schema::schema(method::methods()));
    Exit::Well
}
