//! VTK's cells, and its legacy format.

use super::CellKind;
use super::cells::Sorter;

/// VTK's number for a kind of cells.
pub(super) fn code(kind: CellKind) -> u8 {
    match kind {
        CellKind::Triangle => 5,
        CellKind::Quad => 9,
        CellKind::Tetrahedron => 10,
        CellKind::Hexahedron => 12,
        CellKind::Prism => 13,
        CellKind::Pyramid => 14,
    }
}

/// Passes on a cell that a file describes by VTK's number for its kind and its corners.
///
/// # Errors
/// When the kind is unknown, or of higher order, or does not have so many corners.
pub(super) fn add_cell(sorter: &mut Sorter, code: i64, corners: &[u32]) -> Result<(), String> {
    let kind = match code {
        1 | 2 => return leave_out(sorter, "points"),
        3 | 4 => return leave_out(sorter, "lines"),
        7 => return sorter.polygon(corners),
        6 => return Err("triangle strips are not read; write single triangles (VTK: vtkTriangleFilter)".to_string()),
        5 => CellKind::Triangle,
        8 | 9 => CellKind::Quad,
        10 => CellKind::Tetrahedron,
        11 | 12 => CellKind::Hexahedron,
        13 => CellKind::Prism,
        14 => CellKind::Pyramid,
        42 => {
            return Err(
                "polyhedra are not read; split them into tetrahedra (VTK: vtkDataSetTriangleFilter)".to_string(),
            );
        }
        21..=37 | 60..=81 => {
            return Err(format!(
                "cells of type {code} ({}) are of higher order; only straight cells are read, write the mesh with order 1",
                higher_order(code)
            ));
        }
        _ => {
            return Err(format!(
                "cell type {code} is unknown; types 1 to 5 and 7 to 14 are read"
            ));
        }
    };
    if corners.len() != kind.corners() {
        return Err(format!(
            "a {} has {} corners here, it needs {}",
            kind.name(),
            corners.len(),
            kind.corners()
        ));
    }
    match (code, corners) {
        (8, &[a, b, c, d]) => sorter.cell(kind, &[a, b, d, c]),
        (11, &[a, b, c, d, e, f, g, h]) => sorter.cell(kind, &[a, b, d, c, e, f, h, g]),
        _ => sorter.cell(kind, corners),
    }
    Ok(())
}

fn leave_out(sorter: &mut Sorter, name: &'static str) -> Result<(), String> {
    sorter.leave_out(name);
    Ok(())
}

fn higher_order(code: i64) -> &'static str {
    match code {
        21 => "quadratic edge",
        22 | 34 => "quadratic triangle",
        23 | 28 | 30 => "quadratic quad",
        24 => "quadratic tetrahedron",
        25 | 29 | 33 => "quadratic hexahedron",
        26 | 31 | 32 => "quadratic prism",
        27 | 37 => "quadratic pyramid",
        68 | 75 => "Lagrange or Bezier curve",
        69 | 76 => "Lagrange or Bezier triangle",
        70 | 77 => "Lagrange or Bezier quad",
        71 | 78 => "Lagrange or Bezier tetrahedron",
        72 | 79 => "Lagrange or Bezier hexahedron",
        73 | 80 => "Lagrange or Bezier prism",
        74 | 81 => "Lagrange or Bezier pyramid",
        _ => "a curved cell",
    }
}
