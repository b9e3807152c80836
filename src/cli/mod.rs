//! The command line: one command a file.
pub fn main() -> std::process::ExitCode { std::process::ExitCode::SUCCESS }
