//! `vargeo mesh`: what a mesh file holds, and conversion between formats.

use super::Exit;
use crate::mesh::format::{self, Content, Format};
use std::path::{Path, PathBuf};

/// Shows what a mesh file holds, or converts it.
#[derive(clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Arguments {
    /// A mesh file; a file called `convert` is given as `./convert`.
    #[arg(required = true)]
    file: Option<PathBuf>,
    #[command(subcommand)]
    command: Option<MeshCommand>,
}

#[derive(clap::Subcommand)]
enum MeshCommand {
    /// Writes a mesh file in the format that the second name's extension stands for.
    Convert {
        /// The file to read.
        input: PathBuf,
        /// The file to write; its extension tells the format.
        output: PathBuf,
    },
}

/// Shows or converts.
pub fn execute(arguments: Arguments) -> Exit {
    let outcome = match (arguments.command, arguments.file) {
        (Some(MeshCommand::Convert { input, output }), _) => convert(&input, &output),
        (None, Some(file)) => inspect(&file),
        (None, None) => Err("no file is named".to_string()),
    };
    match outcome {
        Ok(()) => Exit::Well,
        Err(message) => {
            eprintln!("error: {message}");
            Exit::FileWrong
        }
    }
}

fn read(path: &Path) -> Result<Content, String> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|error| format!("{name}: cannot be read: {error}"))?;
    format::read(&name, &bytes).map_err(|error| error.to_string())
}

fn convert(input: &Path, output: &Path) -> Result<(), String> {
    let name = output.display().to_string();
    let format = Format::of_name(&name).ok_or_else(|| {
        format!(
            "{name}: the extension tells no mesh format; choose one of {}",
            format::extensions()
        )
    })?;
    let content = read(input)?;
    let written = format::write(format, &content).map_err(|message| format!("{name}: {message}"))?;
    for notice in content.notices.iter().chain(&written.notices) {
        eprintln!("notice: {notice}");
    }
    std::fs::write(output, &written.bytes).map_err(|error| format!("{name}: cannot be written: {error}"))
}

fn inspect(path: &Path) -> Result<(), String> {
    let content = read(path)?;
    println!("points {}", content.points.len());
    for (kind, count) in format::CellKind::ALL.map(|kind| (kind, content.cells().count_of(kind))) {
        println!("{} {count}", kind.plural());
    }
    for notice in &content.notices {
        eprintln!("notice: {notice}");
    }
    Ok(())
}
