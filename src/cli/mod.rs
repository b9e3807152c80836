//! The command line: one command a file, each with its arguments and its `execute`.

/// Prints a line on standard error; a reader who has gone away is no reason to end.
macro_rules! tell {
    ($($part:tt)*) => {{
        let _ = std::io::Write::write_fmt(&mut std::io::stderr(), format_args!("{}\n", format_args!($($part)*)));
    }};
}

/// The same on standard output.
macro_rules! answer {
    ($($part:tt)*) => {{
        let _ = std::io::Write::write_fmt(&mut std::io::stdout(), format_args!("{}\n", format_args!($($part)*)));
    }};
}

mod explain;
mod input;
mod check;
mod compare;
mod job;
mod list;
mod mesh;
mod new;
mod plan;
mod progress;
mod report;
mod run;
mod schema;
mod store;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// How the program ends, as documented in `vargeo help`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All well.
    Well = 0,
    /// An expectation was not met.
    ExpectationFailed = 1,
    /// A job failed.
    JobFailed = 2,
    /// The experiment file, an input or the command line is wrong.
    FileWrong = 3,
    /// There was nothing to run.
    NothingRan = 4,
    /// Stopped by Ctrl-C or SIGTERM; what is finished is kept.
    Interrupted = 130,
}

/// Runs batches of geometry experiments described in TOML.
#[derive(Parser)]
#[command(name = "vargeo", version, about, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 all well, 1 an expectation was not met, 2 a job failed, \
3 the file or the command line is wrong, 4 nothing ran, 130 interrupted.";

#[derive(Subcommand)]
enum Command {
    Run(run::Arguments),
    Plan(plan::Arguments),
    New(new::Arguments),
    Check(check::Arguments),
    Report(report::Arguments),
    Compare(compare::Arguments),
    List(list::Arguments),
    Schema(schema::Arguments),
    Explain(explain::Arguments),
    Mesh(mesh::Arguments),
    Store(store::Arguments),
    #[command(hide = true)]
    Job(job::Arguments),
}

/// Reads the process's arguments and runs the command that they name.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            let _ = error.print();
            let exit = if error.use_stderr() {
                Exit::FileWrong
            } else {
                Exit::Well
            };
            return ExitCode::from(exit as u8);
        }
    };
    let exit = match arguments.command {
        Command::Run(arguments) => run::execute(arguments),
        Command::Plan(arguments) => plan::execute(arguments),
        Command::New(arguments) => new::execute(arguments),
        Command::Schema(arguments) => schema::execute(arguments),
        Command::Explain(arguments) => explain::execute(arguments),
        Command::Check(arguments) => check::execute(arguments),
        Command::Report(arguments) => report::execute(arguments),
        Command::Compare(arguments) => compare::execute(arguments),
        Command::List(arguments) => list::execute(arguments),
        Command::Mesh(arguments) => mesh::execute(arguments),
        Command::Store(arguments) => store::execute(arguments),
        Command::Job(arguments) => job::execute(arguments),
    };
    ExitCode::from(exit as u8)
}
