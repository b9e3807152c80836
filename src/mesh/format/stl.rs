//! STL, ASCII and binary: triangles without shared vertices, which are welded where their coordinates are equal.
//!
//! Equal means every coordinate is the same number; vertices that differ in the last bit stay apart. Binary files are
//! written, whose coordinates have single precision.
//! Source: 3D Systems, "StereoLithography Interface Specification", 1989.

use super::cells::Sorter;
use super::text::{Text, same};
use super::{CellKind, Content, Fault, Written, left_out};
use std::collections::HashMap;

const HEADER: usize = 80;
const TRIANGLE: usize = 50;

/// The number of triangles that a binary file announces.
fn announced(bytes: &[u8]) -> Option<usize> {
    let count = bytes
        .get(HEADER..)?
        .first_chunk()
        .map(|bytes| u32::from_le_bytes(*bytes));
    count.map(|count| count as usize)
}

fn is_binary(bytes: &[u8]) -> bool {
    announced(bytes).is_some_and(|count| count.checked_mul(TRIANGLE).map(|size| size + HEADER + 4) == Some(bytes.len()))
}

/// Whether the size is that of a binary file, or the words are those of a text file.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    is_binary(bytes) || {
        let mut text = Text::new(bytes, None);
        let first = text.word().is_some_and(|word| same(word, "solid"));
        text.line();
        first
            && text
                .word()
                .is_some_and(|word| same(word, "facet") || same(word, "endsolid"))
    }
}

/// Vertices, each once.
#[derive(Default)]
struct Weld {
    points: Vec<[f64; 3]>,
    rows: HashMap<[u64; 3], u32>,
}

impl Weld {
    fn vertex(&mut self, point: [f64; 3]) -> u32 {
        // Adding zero makes a negative zero positive, so that both are one vertex.
        let key = point.map(|coordinate| (coordinate + 0.0).to_bits());
        let next = self.points.len() as u32;
        let row = *self.rows.entry(key).or_insert(next);
        if row == next {
            self.points.push(point);
        }
        row
    }
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Content, Fault> {
    let text_start = bytes.first_chunk::<5>().is_some_and(|start| same(start, "solid"));
    if is_binary(bytes) || !text_start {
        read_binary(bytes)
    } else {
        read_text(bytes)
    }
}

fn read_binary(bytes: &[u8]) -> Result<Content, Fault> {
    let left = bytes.len().saturating_sub(HEADER + 4);
    let count = announced(bytes).ok_or_else(|| {
        Fault::binary(
            bytes.len(),
            "the file ends within its header of 84 bytes; it is cut off or no STL file",
        )
    })?;
    if count > left / TRIANGLE {
        return Err(Fault::binary(
            HEADER,
            format!(
                "{count} triangles of {TRIANGLE} bytes are announced, {left} bytes follow; the file is cut off or no STL file"
            ),
        ));
    }
    let mut weld = Weld::default();
    let mut sorter = Sorter::default();
    let (triangles, _) = bytes[HEADER + 4..].as_chunks::<TRIANGLE>();
    for (index, triangle) in triangles[..count].iter().enumerate() {
        let mut corners = [0; 3];
        for (corner, (row, chunk)) in corners.iter_mut().zip(triangle[12..48].chunks_exact(12).enumerate()) {
            let coordinate = |axis: usize| {
                let bytes = chunk[4 * axis..].first_chunk().copied().unwrap_or([0; 4]);
                f64::from(f32::from_le_bytes(bytes))
            };
            let point = [coordinate(0), coordinate(1), coordinate(2)];
            if let Some(axis) = point.iter().position(|coordinate| !coordinate.is_finite()) {
                return Err(Fault::binary(
                    HEADER + 4 + TRIANGLE * index + 12 + 12 * row + 4 * axis,
                    format!(
                        "a coordinate of triangle {index} (from 0) is {}, not a finite number",
                        point[axis]
                    ),
                ));
            }
            *corner = weld.vertex(point);
        }
        sorter.cell(CellKind::Triangle, &corners);
    }
    let mut content = sorter.finish(weld.points, Vec::new(), Vec::new())?;
    let rest = left - count * TRIANGLE;
    if rest > 0 {
        content
            .notices
            .push(format!("{rest} bytes behind the last triangle left out"));
    }
    Ok(content)
}

fn read_text(bytes: &[u8]) -> Result<Content, Fault> {
    let mut text = Text::new(bytes, None);
    let mut weld = Weld::default();
    let mut sorter = Sorter::default();
    let mut closed = false;
    while let Some(word) = text.word() {
        closed = false;
        if same(word, "solid") {
            text.line();
        } else if same(word, "endsolid") {
            text.line();
            closed = true;
        } else if same(word, "facet") {
            // The normal follows from the vertices.
            text.line();
            keyword(&mut text, "outer")?;
            keyword(&mut text, "loop")?;
            let mut corners = [0; 3];
            for corner in &mut corners {
                keyword(&mut text, "vertex")?;
                let mut point = [0.0; 3];
                for coordinate in &mut point {
                    *coordinate = text.finite(format_args!("a coordinate of triangle {} (from 0)", sorter.seen()))?;
                }
                *corner = weld.vertex(point);
            }
            keyword(&mut text, "endloop")?;
            keyword(&mut text, "endfacet")?;
            sorter.cell(CellKind::Triangle, &corners);
        } else {
            return Err(text.not(word, format_args!("facet or endsolid")));
        }
    }
    if !closed {
        return Err(text.ended(format_args!("facet or endsolid")));
    }
    sorter.finish(weld.points, Vec::new(), Vec::new())
}

fn keyword(text: &mut Text<'_>, expected: &str) -> Result<(), Fault> {
    let word = text.need(format_args!("{expected}"))?;
    if same(word, expected) {
        Ok(())
    } else {
        Err(text.not(word, format_args!("{expected}")))
    }
}

/// Writes a binary file.
///
/// # Errors
/// When a coordinate is beyond single precision.
pub(super) fn write(content: &Content) -> Result<Written, String> {
    let mut out = vec![0; HEADER];
    let title = b"triangles in model units";
    out[..title.len()].copy_from_slice(title);
    let count =
        u32::try_from(content.triangles.len()).map_err(|_| "STL holds at most 4294967295 triangles".to_string())?;
    out.extend_from_slice(&count.to_le_bytes());
    let mut used = vec![false; content.points.len()];
    let mut rounded = false;
    for triangle in &content.triangles {
        let corners = triangle.map(|corner| content.points[corner as usize]);
        for &corner in triangle {
            used[corner as usize] = true;
        }
        for coordinate in normal(corners) {
            out.extend_from_slice(&(coordinate as f32).to_le_bytes());
        }
        for coordinate in corners.as_flattened() {
            let single = *coordinate as f32;
            if !single.is_finite() {
                return Err(format!(
                    "STL cannot hold the coordinate {coordinate:?}, beyond single precision; choose another format"
                ));
            }
            rounded |= f64::from(single).to_bits() != coordinate.to_bits();
            out.extend_from_slice(&single.to_le_bytes());
        }
        out.extend_from_slice(&[0, 0]);
    }
    let mut notices = left_out("STL", content, |_, _| false);
    if rounded {
        notices.push("STL has single precision: coordinates are rounded".to_string());
    }
    let unused = used.iter().filter(|used| !**used).count();
    if unused > 0 {
        notices.push(format!(
            "STL holds triangles only: {unused} points that no triangle uses left out"
        ));
    }
    Ok(Written { bytes: out, notices })
}

/// The unit normal of a triangle; zero where the triangle has no area.
fn normal([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    let edge = |to: [f64; 3]| [to[0] - a[0], to[1] - a[1], to[2] - a[2]];
    let (u, v) = (edge(b), edge(c));
    let cross = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let length = (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]).sqrt();
    if length > 0.0 && length.is_finite() {
        cross.map(|coordinate| coordinate / length)
    } else {
        [0.0; 3]
    }
}
