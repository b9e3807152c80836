//! `vargeo mesh`: what a mesh file holds, and conversion between formats.

use super::Exit;
use crate::mesh::check::{self, Problem, Severity};
use crate::mesh::connectivity;
use crate::mesh::format::{self, CellKind, Content, Format};
use crate::mesh::summary::{self, Summary};
use crate::mesh::{TetrahedralMesh, TriangleMesh, bounding_box};
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
        /// Write the boundary triangles of the tetrahedra only, outward.
        #[arg(long)]
        boundary: bool,
    },
}

/// Shows or converts.
pub fn execute(arguments: Arguments) -> Exit {
    let outcome = match (arguments.command, arguments.file) {
        (
            Some(MeshCommand::Convert {
                input,
                output,
                boundary,
            }),
            _,
        ) => convert(&input, &output, boundary).map(|()| Exit::Well),
        (None, Some(file)) => inspect(&file),
        (None, None) => Err("no file is named".to_string()),
    };
    match outcome {
        Ok(exit) => exit,
        Err(message) => {
            tell!("error: {message}");
            Exit::FileWrong
        }
    }
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|error| format!("{}: cannot be read: {error}", path.display()))
}

fn convert(input: &Path, output: &Path, boundary: bool) -> Result<(), String> {
    let name = output.display().to_string();
    let format = Format::of_name(&name).ok_or_else(|| {
        format!(
            "{name}: the extension tells no mesh format; choose one of {}",
            format::extensions()
        )
    })?;
    let mut content =
        format::read(&input.display().to_string(), &read_bytes(input)?).map_err(|error| error.to_string())?;
    if boundary {
        content = boundary_of(content, &input.display().to_string())?;
    }
    let written = format::write(format, &content).map_err(|message| format!("{name}: {message}"))?;
    for notice in content.notices.iter().chain(&written.notices) {
        tell!("notice: {notice}");
    }
    std::fs::write(output, &written.bytes).map_err(|error| format!("{name}: cannot be written: {error}"))
}

/// The boundary of the tetrahedra as a surface of its own; fields are left out.
fn boundary_of(content: Content, name: &str) -> Result<Content, String> {
    let mut mesh = TetrahedralMesh {
        points: content.points,
        cells: content.tetrahedra,
    };
    if mesh.cells.is_empty() {
        return Err(format!("{name}: has no tetrahedra, whose boundary could be written"));
    }
    let problems = check::tetrahedra(&mut mesh);
    if let Some(problem) = problems.iter().find(|problem| problem.severity == Severity::Error) {
        return Err(format!("{name}: {}", problem.message));
    }
    let boundary = connectivity::boundary(&mesh.cells, mesh.points.len());
    let places = boundary.places();
    let place = |vertex: u32| places[vertex as usize];
    Ok(Content {
        points: boundary
            .vertices
            .iter()
            .map(|&vertex| mesh.points[vertex as usize])
            .collect(),
        triangles: boundary.triangles.iter().map(|triangle| triangle.map(place)).collect(),
        notices: content.notices,
        ..Content::default()
    })
}

/// Label and value of every line of the summary, then problems and notices. Errors in the mesh are those of the file.
fn inspect(path: &Path) -> Result<Exit, String> {
    let name = path.display().to_string();
    let bytes = read_bytes(path)?;
    let content = format::read(&name, &bytes).map_err(|error| error.to_string())?;
    let cells = content.cells();
    let mut rows = vec![("file", format!("{name} ({} bytes)", bytes.len()))];
    if let Some(format) = Format::of_content(&bytes).or(Format::of_name(&name)) {
        rows.push(("format", format.entry().name.to_string()));
    }
    let counts: Vec<String> = CellKind::ALL
        .into_iter()
        .filter(|&kind| cells.count_of(kind) > 0)
        .map(|kind| format!("{} {}", cells.count_of(kind), kind.plural()))
        .collect();
    rows.push(("points", content.points.len().to_string()));
    rows.push((
        "cells",
        if counts.is_empty() {
            "none".to_string()
        } else {
            counts.join(", ")
        },
    ));
    for (label, fields) in [("point data", &content.point_data), ("cell data", &content.cell_data)] {
        let names: Vec<String> = fields
            .iter()
            .map(|field| format!("{} ({})", field.name, field.components))
            .collect();
        if !names.is_empty() {
            rows.push((label, names.join(", ")));
        }
    }

    let mut notices = content.notices.clone();
    let (summary, problems) = summarize(&content, &mut notices);
    let shown = |label: &str| matches!(label, "vertices" | "tetrahedra" | "triangles");
    match summary {
        // What the counts above say already.
        Some(summary) => rows.extend(summary.rows().into_iter().filter(|(label, _)| !shown(label))),
        None => {
            if let Some([low, high]) = bounding_box(&content.points) {
                rows.push(("box", format!("{low:?} to {high:?}")));
            }
        }
    }
    let width = rows.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0);
    for (label, value) in rows {
        answer!("{label:width$}  {value}");
    }
    for problem in &problems {
        let severity = match problem.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Repaired => "repaired",
        };
        answer!("{severity:width$}  {}", problem.message);
    }
    for notice in notices {
        answer!("{:width$}  {notice}", "notice");
    }
    let unsound = problems.iter().any(|problem| problem.severity == Severity::Error);
    Ok(if unsound { Exit::FileWrong } else { Exit::Well })
}

/// The summary of tetrahedra, or else of a surface, with its problems; none where the indices are unsound or the cells
/// are of kinds that are only counted.
fn summarize(content: &Content, notices: &mut Vec<String>) -> (Option<Summary>, Vec<Problem>) {
    let cells = content.cells();
    if [CellKind::Hexahedron, CellKind::Prism, CellKind::Pyramid]
        .iter()
        .any(|&kind| cells.count_of(kind) > 0)
    {
        notices.push(
            "volume, boundary and quality are told of tetrahedra and of surfaces only; the cells here are counted"
                .to_string(),
        );
        return (None, Vec::new());
    }
    if !content.tetrahedra.is_empty() {
        if !content.triangles.is_empty() || !content.quads.is_empty() {
            notices.push("volume, boundary and quality are those of the tetrahedra".to_string());
        }
        let mut mesh = TetrahedralMesh {
            points: content.points.clone(),
            cells: content.tetrahedra.clone(),
        };
        let problems = check::tetrahedra(&mut mesh);
        return (summary::summarize_tetrahedra(&mesh), problems);
    }
    if content.triangles.is_empty() && content.quads.is_empty() {
        return (None, Vec::new());
    }
    let mut mesh = TriangleMesh {
        points: content.points.clone(),
        cells: content.triangles.clone(),
    };
    if !content.quads.is_empty() {
        notices.push("for area, boundary, genus and angles each quad counts as two triangles".to_string());
        mesh.cells
            .extend(content.quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]));
    }
    let problems = check::triangles(&mesh);
    (summary::summarize_triangles(&mesh), problems)
}
