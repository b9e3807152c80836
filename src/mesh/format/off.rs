//! OFF, Geomview's object file format, in text.
//!
//! Header words `OFF`, `COFF`, `NOFF`, `STOFF` and their combinations are read, also with the counts on their line, or no
//! header word at all; colours, normals and texture coordinates are left out. Comments follow `#`. Polygons with more
//! than four corners become fans, with a notice. Source: the Geomview manual 1.9, section 4.2.5, "OFF files".

use super::cells::Sorter;
use super::text::{Text, shown};
use super::{CellKind, Content, Fault, Written, left_out};
use std::io::Write as _;

/// The letters before `OFF`, if the word is a header word.
fn prefix(word: &[u8]) -> Option<&[u8]> {
    let prefix = word.strip_suffix(b"OFF")?;
    let rest = prefix.strip_prefix(b"ST").unwrap_or(prefix);
    let rest = rest.strip_prefix(b"C").unwrap_or(rest);
    let rest = rest.strip_prefix(b"N").unwrap_or(rest);
    let rest = rest.strip_prefix(b"4").unwrap_or(rest);
    let rest = rest.strip_prefix(b"n").unwrap_or(rest);
    rest.is_empty().then_some(prefix)
}

/// Whether the first word is a header word.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    let first = Text::new(bytes, Some(b'#')).word();
    first.is_some_and(|word| prefix(word).is_some())
}

/// The words of the next line that is not empty.
fn line<'a>(text: &mut Text<'a>, bytes: &'a [u8], what: std::fmt::Arguments<'_>) -> Result<Text<'a>, Fault> {
    text.skip_blank();
    let start = text.at();
    if text.remaining() == 0 {
        return Err(text.ended(what));
    }
    text.line();
    Ok(Text::part(bytes, start, text.at(), Some(b'#')))
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Content, Fault> {
    let mut text = Text::new(bytes, Some(b'#'));
    let first = text.peek().ok_or_else(|| text.ended(format_args!("the word OFF")))?;
    if let Some(prefix) = prefix(first) {
        text.word();
        if prefix.iter().any(|letter| matches!(letter, b'4' | b'n')) {
            return Err(Fault::text(
                text.at() - first.len(),
                format!(
                    "{} files are not three-dimensional; write OFF with three coordinates",
                    shown(first)
                ),
            ));
        }
        if text.peek() == Some(b"BINARY") {
            return Err(Fault::text(
                text.at(),
                "binary OFF files are not read; write the file in text",
            ));
        }
    } else if !first[0].is_ascii_digit() {
        return Err(text.next_is_not(format_args!("the word OFF")));
    }
    let mut counts = line(&mut text, bytes, format_args!("the numbers of vertices and faces"))?;
    let vertices = counts.integer(format_args!("the number of vertices"))?;
    let faces = counts.integer(format_args!("the number of faces"))?;
    let counts_at = counts.at().saturating_sub(1);
    let (Ok(vertices), Ok(faces)) = (usize::try_from(vertices), usize::try_from(faces)) else {
        return Err(Fault::text(
            counts_at,
            format!("{vertices} vertices and {faces} faces; counts cannot be negative"),
        ));
    };
    // Three numbers and their blanks take six bytes a vertex; a corner count and three corners take eight, an edge six.
    if vertices.saturating_add(faces).saturating_mul(6) > text.remaining() + 1 {
        return Err(Fault::text(
            counts_at,
            format!(
                "{vertices} vertices and {faces} faces are announced, but only {} bytes follow; correct the counts or restore the file",
                text.remaining()
            ),
        ));
    }
    let mut points = Vec::with_capacity(vertices);
    for index in 0..vertices {
        let mut words = line(&mut text, bytes, format_args!("vertex {index} (from 0)"))?;
        let mut point = [0.0; 3];
        for (axis, coordinate) in point.iter_mut().enumerate() {
            *coordinate = words.finite(format_args!("coordinate {} of vertex {index} (from 0)", axis + 1))?;
        }
        points.push(point);
    }
    let mut sorter = Sorter::default();
    let mut corners = Vec::new();
    for index in 0..faces {
        let mut words = line(&mut text, bytes, format_args!("face {index} (from 0)"))?;
        let size = words.count(format_args!("the number of corners of face {index} (from 0)"), 2)?;
        corners.clear();
        for _ in 0..size {
            let corner = words.integer(format_args!("a corner of face {index} (from 0)"))?;
            match u32::try_from(corner) {
                Ok(corner) if (corner as usize) < points.len() => corners.push(corner),
                _ => {
                    return Err(Fault::text(
                        words.at() - 1,
                        format!(
                            "face {index} (from 0) names vertex {corner}; there are {}, counted from 0",
                            points.len()
                        ),
                    ));
                }
            }
        }
        match size {
            0 | 1 => sorter.leave_out("points"),
            2 => sorter.leave_out("lines"),
            _ => sorter
                .polygon(&corners)
                .map_err(|message| Fault::text(words.at() - 1, message))?,
        }
    }
    if text.peek().is_some() {
        return Err(text.next_is_not(format_args!("the end of the file (or the counts are too small)")));
    }
    sorter.finish(points, Vec::new(), Vec::new())
}

/// Writes vertices and faces.
pub(super) fn write(content: &Content) -> Result<Written, String> {
    let cells = content.cells();
    let mut out = Vec::with_capacity(64 * content.points.len() + 24 * cells.count() + 32);
    // Writing to memory cannot fail.
    let _ = write!(out, "OFF\n{} {} 0\n", content.points.len(), cells.count());
    for [x, y, z] in &content.points {
        let _ = writeln!(out, "{x:?} {y:?} {z:?}");
    }
    for kind in CellKind::SURFACE {
        for corners in cells.corners_of(kind).chunks_exact(kind.corners()) {
            let _ = write!(out, "{}", kind.corners());
            for corner in corners {
                let _ = write!(out, " {corner}");
            }
            out.push(b'\n');
        }
    }
    Ok(Written {
        bytes: out,
        notices: left_out("OFF", content, |_, _| false),
    })
}
