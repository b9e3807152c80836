//! `vargeo schema`: the JSON Schema of the experiment file.

use super::Exit;
use crate::{experiment, method};

/// Prints a JSON Schema of the experiment file, for editors and validators.
#[derive(clap::Args)]
pub struct Arguments {}

/// Prints the schema.
pub fn execute(_arguments: Arguments) -> Exit {
    println!("{:#}", experiment::schema::schema(method::methods()));
    Exit::Well
}
