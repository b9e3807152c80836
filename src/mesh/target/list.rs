//! Targets as text: a line `index x y z` for every boundary vertex.

use super::Target;
use crate::mesh::connectivity::Boundary;

/// Reads a list of boundary positions.
///
/// One vertex a line: its index in the mesh, counted from 0, and three coordinates, which are multiplied by `scale`.
/// Empty lines and what follows a `#` are passed over. The order of the lines is free.
///
/// # Errors
/// Names the line of a malformed entry, of an index that is out of range, of an interior vertex or of a repeated one; or
/// says which boundary vertices are missing.
pub fn parse(text: &str, boundary: &Boundary, scale: f64) -> Result<Target, String> {
    if !(scale.is_finite() && scale > 0.0) {
        return Err(format!("the target's scale is {scale}, but must be a positive number"));
    }
    let vertices = boundary.mask.len();
    // Line of each vertex's entry, counted from 1; 0 when there is none.
    let mut lines = vec![0usize; vertices];
    let mut positions = vec![[f64::NAN; 3]; boundary.vertices.len()];
    let place = boundary.places();
    for (number, line) in (1..).zip(text.lines()) {
        let content = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> = content.split_whitespace().collect();
        let &[index, x, y, z] = words.as_slice() else {
            if words.is_empty() {
                continue;
            }
            let count = words.len();
            return Err(format!(
                "line {number}: {count} words where `index x y z` was expected; write one boundary vertex a line"
            ));
        };
        let vertex: usize = index.parse().map_err(|_| {
            format!("line {number}: `{index}` is not a vertex index; indices are whole numbers counted from 0")
        })?;
        if vertex >= vertices {
            return Err(format!(
                "line {number}: vertex {vertex} is out of range; the mesh has {vertices} vertices, counted from 0"
            ));
        }
        if !boundary.mask[vertex] {
            return Err(format!(
                "line {number}: vertex {vertex} lies inside the mesh; list boundary vertices only, counted from 0"
            ));
        }
        if lines[vertex] != 0 {
            let first = lines[vertex];
            return Err(format!(
                "line {number}: vertex {vertex} was given before on line {first}; remove one of them"
            ));
        }
        lines[vertex] = number;
        let mut point = [0.0; 3];
        for (coordinate, word) in point.iter_mut().zip([x, y, z]) {
            let value: f64 = word
                .parse()
                .map_err(|_| format!("line {number}: `{word}` is not a number"))?;
            *coordinate = scale * value;
            if !coordinate.is_finite() {
                return Err(format!(
                    "line {number}: coordinate `{word}` of vertex {vertex} is not finite"
                ));
            }
        }
        positions[place[vertex] as usize] = point;
    }
    let missing: Vec<u32> = boundary
        .vertices
        .iter()
        .copied()
        .filter(|&vertex| lines[vertex as usize] == 0)
        .collect();
    if missing.is_empty() {
        return Ok(Target {
            positions,
            interior: None,
        });
    }
    let shown: Vec<String> = missing.iter().take(10).map(u32::to_string).collect();
    let more = if missing.len() > shown.len() { ", ..." } else { "" };
    Err(format!(
        "{} of {} boundary vertices have no target: {}{more}; give every boundary vertex a line",
        missing.len(),
        boundary.vertices.len(),
        shown.join(", ")
    ))
}
