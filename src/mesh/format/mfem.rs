//! MFEM's text mesh: sections of elements, boundary and vertices, indices from 0, an attribute before each cell.
//!
//! Accepted: versions 1.0 to 1.3 without curved nodes; a curved mesh (`nodes`) is refused, because its corners alone
//! would be another shape. Points and segments are left out with a notice. Reference: mfem.org, "MFEM mesh formats".

use super::cells::Sorter;
use super::text::{Text, same, shown};
use super::{CellKind, Content, Fault, Written, left_out, reference_field, reference_labels};
use std::io::Write as _;

/// Kinds by MFEM's geometry number.
const GEOMETRIES: [(i64, CellKind); 6] = [
    (2, CellKind::Triangle),
    (3, CellKind::Quad),
    (4, CellKind::Tetrahedron),
    (5, CellKind::Hexahedron),
    (6, CellKind::Prism),
    (7, CellKind::Pyramid),
];

/// Whether the first words are MFEM's.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    let mut text = Text::new(bytes, Some(b'#'));
    text.word().is_some_and(|word| word == b"MFEM") && text.word().is_some_and(|word| word == b"mesh")
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Content, Fault> {
    let mut text = Text::new(bytes, Some(b'#'));
    let mut points: Option<Vec<[f64; 3]>> = None;
    let mut labels = Vec::new();
    let mut sorter = Sorter::default();
    text.word();
    text.word();
    let at = text.at();
    let version = text.need(format_args!("the version of the format"))?;
    if !matches!(version, b"v1.0" | b"v1.1" | b"v1.2" | b"v1.3") {
        return Err(Fault::text(
            at,
            format!("version {} is unknown; v1.0 to v1.3 are known", shown(version)),
        ));
    }
    while let Some(word) = text.word() {
        let at = text.at() - word.len();
        if same(word, "dimension") {
            text.integer(format_args!("the dimension"))?;
        } else if same(word, "elements") || same(word, "boundary") {
            let name = if same(word, "elements") {
                "element"
            } else {
                "boundary element"
            };
            let count = text.count(format_args!("the number of {name}s"), 4)?;
            for number in 0..count {
                let label = text.integer(format_args!("the attribute of {name} {number}"))?;
                let at = text.at();
                let geometry = text.integer(format_args!("the geometry of {name} {number}"))?;
                if let Some(corners) = [1, 2].get(geometry as usize).filter(|_| geometry >= 0) {
                    for _ in 0..*corners {
                        text.integer(format_args!("a vertex of {name} {number}"))?;
                    }
                    labels.push(label as f64);
                    sorter.leave_out(if geometry == 0 { "points" } else { "segments" });
                    continue;
                }
                let Some(&(_, kind)) = GEOMETRIES.iter().find(|entry| entry.0 == geometry) else {
                    return Err(Fault::text(
                        at,
                        format!("{name} {number} has the geometry {geometry}; 0 to 7 are known"),
                    ));
                };
                let mut cell = [0_u32; 8];
                for corner in &mut cell[..kind.corners()] {
                    let index = text.integer(format_args!("a vertex of {name} {number}"))?;
                    *corner = u32::try_from(index).unwrap_or(u32::MAX);
                }
                labels.push(label as f64);
                sorter.cell(kind, &cell[..kind.corners()]);
            }
        } else if same(word, "vertices") {
            let count = text.count(format_args!("the number of vertices"), 2)?;
            if text.peek().is_some_and(|next| same(next, "nodes")) {
                continue;
            }
            let dimension = text.integer(format_args!("the number of coordinates"))?;
            if !(1..=3).contains(&dimension) {
                return Err(Fault::text(
                    at,
                    format!("vertices with {dimension} coordinates; 1 to 3 are known"),
                ));
            }
            let mut list = Vec::with_capacity(count);
            for number in 0..count {
                let mut point = [0.0; 3];
                for coordinate in &mut point[..dimension as usize] {
                    *coordinate = text.finite(format_args!("a coordinate of vertex {number}"))?;
                }
                list.push(point);
            }
            points = Some(list);
        } else if same(word, "nodes") {
            return Err(Fault::text(
                at,
                "the mesh is curved: its nodes are a grid function, which is not read; save it with straight cells",
            ));
        } else {
            return Err(Fault::text(
                at,
                format!(
                    "section {} is unknown; dimension, elements, boundary and vertices are known, or the count before is wrong",
                    shown(word)
                ),
            ));
        }
    }
    let points = points.ok_or_else(|| Fault::whole("there is no section \"vertices\"; the file is cut off"))?;
    let cell_data = reference_field(labels).into_iter().collect();
    sorter.finish(points, Vec::new(), cell_data)
}

/// Writes version 1.0: volume cells as elements and surface cells as boundary, or surface cells as elements where
/// there are no others; the field `reference` becomes the attributes.
pub(super) fn write(content: &Content) -> Result<Written, String> {
    let mut out = Vec::with_capacity(64 * content.points.len() + 32 * content.cells().count() + 256);
    let labels = reference_labels(&content.cell_data);
    let cells = content.cells();
    let surface = CellKind::SURFACE
        .iter()
        .map(|&kind| cells.count_of(kind))
        .sum::<usize>();
    let solid = cells.count() > surface;
    // Writing to memory cannot fail.
    let _ = write!(out, "MFEM mesh v1.0\n\ndimension\n{}\n", if solid { 3 } else { 2 });
    for (title, wanted) in [("elements", solid), ("boundary", !solid)] {
        // Rows run over all cells in their order, whichever section they go to.
        let here = |kind: CellKind| CellKind::SURFACE.contains(&kind) != wanted;
        let count: usize = CellKind::ALL
            .into_iter()
            .filter(|&kind| here(kind))
            .map(|kind| cells.count_of(kind))
            .sum();
        let _ = write!(out, "\n{title}\n{count}\n");
        for (row, (kind, corners)) in cells.iter().enumerate() {
            if !here(kind) {
                continue;
            }
            let geometry = GEOMETRIES
                .iter()
                .find(|entry| entry.1 == kind)
                .map_or(0, |entry| entry.0);
            let label = labels.map_or(1, |labels| labels[row] as i64);
            let _ = write!(out, "{label} {geometry}");
            for corner in corners {
                let _ = write!(out, " {corner}");
            }
            let _ = writeln!(out);
        }
    }
    let _ = write!(out, "\nvertices\n{}\n3\n", content.points.len());
    for [x, y, z] in &content.points {
        let _ = writeln!(out, "{x:?} {y:?} {z:?}");
    }
    let keeps = |field: &super::Field, of_points: bool| {
        !of_points && field.name == super::REFERENCE && reference_labels(&content.cell_data).is_some()
    };
    Ok(Written {
        bytes: out,
        notices: left_out("MFEM", content, keeps),
    })
}
