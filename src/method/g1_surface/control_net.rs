//! Patches as nets of 5 by 5 Bezier control points, for other programs: as text, as VTK's Bezier cells, as polyhedral
//! nets.

use super::frame::Frame;
use super::patch::Patch;
use super::surface;
use crate::mesh::format::{Cells, vtu};
use std::fmt::Write as _;

/// The control points of all patches, in the coordinates of the file: point `5 i + j` for `B_i(u) B_j(v)` of degree 4.
/// Patch `k` is face `k` of the mesh; its points 0, 20, 24, 4 are the corners of that face, in the face's order.
pub fn of(patches: &[Patch], frame: &Frame) -> Vec<Patch> {
    let mut nets: Vec<Patch> = patches.iter().map(surface::control_points).collect();
    frame.leave(nets.as_flattened_mut());
    nets
}

/// The control nets of all patches as a VTU file: 25 points a patch, `5 i + j` for `B_i(u) B_j(v)` of degree 4, and 16
/// quads.
pub fn nets(nets: &[Patch]) -> Vec<u8> {
    let mut cells = Vec::with_capacity(16 * nets.len());
    let mut numbers = Vec::with_capacity(16 * nets.len());
    for index in 0..nets.len() {
        for i in 0..4 {
            for j in 0..4 {
                let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                cells.push(corners.map(|(i, j)| (25 * index + 5 * i + j) as u32));
                numbers.push(index as f64);
            }
        }
    }
    vtu::write(
        nets.as_flattened(),
        Cells {
            quads: &cells,
            ..Cells::default()
        },
        &[],
        &[("patch", 1, &numbers)],
    )
}

/// The patches as a VTU file of Bezier quadrilaterals of order 4, with the largest angle to a neighbour on each.
pub fn bezier(nets: &[Patch], angles: &[f64]) -> Vec<u8> {
    let numbers: Vec<f64> = (0..nets.len()).map(|index| index as f64).collect();
    vtu::write_bezier_quadrilaterals(
        nets.as_flattened(),
        4,
        &[("patch", 1, &numbers), ("angle_to_neighbour", 1, angles)],
    )
}

/// The first line of the text.
const TITLE: &str = "biquartic patches";

/// The control points as text that reads back to the same bits: after the title and the number of patches, 25 lines a
/// patch, `5 i + j` for `B_i(u) B_j(v)` of degree 4.
pub fn text(nets: &[Patch]) -> String {
    let mut out = String::with_capacity(nets.len() * 1500 + 200);
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "{TITLE} {}\n# 25 control points a patch: point 5 i + j belongs to B_i(u) B_j(v), Bernstein polynomials of degree 4\n\
         # patch k is face k of the mesh; its points 0, 20, 24, 4 are the face's corners in their order",
        nets.len()
    );
    for (index, net) in nets.iter().enumerate() {
        let _ = writeln!(out, "# patch {index}");
        for [x, y, z] in net {
            let _ = writeln!(out, "{x:?} {y:?} {z:?}");
        }
    }
    out
}

/// Reads what [`text`] wrote: the control points of every patch.
///
/// # Errors
/// Names the line of a malformed or missing point.
pub fn parse(text: &str) -> Result<Vec<Patch>, String> {
    let lines = (1..).zip(text.lines());
    let mut lines = lines.filter_map(|(number, line)| {
        let content = line.split('#').next().unwrap_or_default().trim();
        (!content.is_empty()).then_some((number, content))
    });
    let title = lines
        .next()
        .and_then(|(_, line)| line.strip_prefix(TITLE)?.trim().parse::<usize>().ok());
    let count =
        title.ok_or_else(|| format!("line 1: a text of control points starts with `{TITLE}` and their number"))?;
    let mut points: Vec<[f64; 3]> = Vec::new();
    for (number, line) in lines {
        let mut point = [0.0; 3];
        let mut words = line.split_whitespace();
        for component in &mut point {
            *component = words
                .next()
                .and_then(|word| word.parse().ok())
                .filter(|value: &f64| value.is_finite())
                .ok_or_else(|| format!("line {number}: a control point has three finite numbers"))?;
        }
        if words.next().is_some() {
            return Err(format!(
                "line {number}: a control point has three numbers, here are more"
            ));
        }
        points.push(point);
    }
    let (patches, rest) = points.as_chunks::<25>();
    if patches.len() != count || !rest.is_empty() {
        return Err(format!(
            "{count} patches were announced, {} points follow; each patch has 25",
            points.len()
        ));
    }
    Ok(patches.to_vec())
}
