//! The `vargeo` program: reads its arguments and hands them to the command that they name.

fn main() -> std::process::ExitCode {
    vargeo::cli::main()
}
