//! `vargeo job`: one job in a process of its own, started by `run`, never by hand.

use super::Exit;

/// Computes the job that standard input describes; `run` starts it.
#[derive(clap::Args)]
pub struct Arguments {}

/// Answers one request.
pub fn execute(_arguments: Arguments) -> Exit {
    if crate::run::job::serve(&crate::method::find) {
        Exit::Well
    } else {
        tell!("error: standard input holds no job");
        tell!("help: `vargeo run FILE` starts jobs");
        Exit::FileWrong
    }
}
