//! Wavefront OBJ, read through the crate tobj.
//!
//! Vertices keep the order of the file, also those that no face uses; negative indices count back from the last vertex.
//! Polygons with more than four corners become fans, with a notice. Normals become the point field `normals`, where faces
//! name them: the sum over a vertex's corners, zero where there are none. Texture coordinates, colours, groups and
//! materials are left out silently, as they do not shape the mesh; lines, points and free forms with a notice.

use super::cells::Sorter;
use super::text::{Text, parse_real, shown};
use super::{CellKind, Content, Fault, Field, Written, left_out};
use std::collections::BTreeMap;
use std::io::{BufRead, Read, Write as _};

/// Whether the first word that is no comment is one that OBJ files start with.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    let first = Text::new(bytes, Some(b'#')).word();
    matches!(first, Some(b"v" | b"vn" | b"vt" | b"o" | b"g" | b"mtllib" | b"usemtl"))
}

/// The lines of a file that tobj shall see, one at a time, so that an error is about the last one.
///
/// tobj numbers the vertices of a model as its faces use them, and starts anew with every group. It sees one model only,
/// since other lines are passed over, and before it all a polygon of all vertices, which settles the numbering.
struct Lines<'a> {
    text: Text<'a>,
    line: Vec<u8>,
    used: usize,
    /// Where the line starts that was passed on last.
    at: usize,
    fault: Option<Fault>,
    left_out: BTreeMap<String, usize>,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8], vertices: usize) -> Lines<'a> {
        let mut line = Vec::new();
        if vertices > 0 {
            line.push(b'f');
            for vertex in 1..=vertices {
                // Writing to memory cannot fail.
                let _ = write!(line, " {vertex}");
            }
            line.push(b'\n');
        }
        Lines {
            text: Text::new(bytes, None),
            line,
            used: 0,
            at: 0,
            fault: None,
            left_out: BTreeMap::new(),
        }
    }

    /// Makes the next line with a vertex or a face the current one.
    fn advance(&mut self) {
        self.line.clear();
        self.used = 0;
        while self.line.is_empty() && self.fault.is_none() {
            self.at = self.text.at();
            let Some(line) = self.text.line() else {
                return;
            };
            let line = line.split(|&byte| byte == b'#').next().unwrap_or_default();
            let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
            match words.next() {
                Some(b"v") => self.pass_vertex(words),
                Some(b"f") => self.pass_face(words),
                None | Some(b"vn" | b"vt" | b"o" | b"g" | b"s" | b"mtllib" | b"usemtl" | b"vp") => {}
                Some(other) => {
                    let known =
                        other.len() <= 12 && other.iter().all(|byte| byte.is_ascii_alphanumeric() || *byte == b'_');
                    if !known {
                        self.fault = Some(Fault::text(
                            self.at,
                            format!("{} stands where a keyword such as v or f is expected", shown(other)),
                        ));
                        return;
                    }
                    *self
                        .left_out
                        .entry(String::from_utf8_lossy(other).into_owned())
                        .or_default() += 1;
                }
            }
        }
    }

    /// Passes on a vertex: its coordinates, without colours, which tobj wants on all vertices or none.
    fn pass_vertex<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) {
        let words: Vec<&[u8]> = words.collect();
        for (axis, word) in words.iter().take(3).enumerate() {
            if parse_real(word).is_none_or(|value| !value.is_finite()) {
                self.fault = Some(Fault::text(
                    self.at,
                    format!(
                        "coordinate {} of the vertex is {}; write a finite number",
                        axis + 1,
                        shown(word)
                    ),
                ));
            }
        }
        if words.len() < 3 {
            self.fault = Some(Fault::text(
                self.at,
                format!("a vertex has {} coordinates; write three", words.len()),
            ));
        }
        self.line.push(b'v');
        // Four numbers are a weight, six are a colour.
        for word in &words[..if words.len() == 4 { 4 } else { words.len().min(3) }] {
            self.line.push(b' ');
            self.line.extend_from_slice(word);
        }
        self.line.push(b'\n');
    }

    /// Passes on a face: the first number of every corner.
    fn pass_face<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) {
        self.line.push(b'f');
        let mut corners = 0;
        for word in words {
            self.line.push(b' ');
            self.line.extend(word.iter().copied().take_while(|&byte| byte != b'/'));
            corners += 1;
        }
        self.line.push(b'\n');
        if corners < 3 {
            self.fault = Some(Fault::text(
                self.at,
                format!("a face has {corners} corners; it needs three or more"),
            ));
        }
    }
}

impl Read for Lines<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let available = self.fill_buf()?;
        let count = available.len().min(buffer.len());
        buffer[..count].copy_from_slice(&available[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Lines<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        if self.used >= self.line.len() {
            self.advance();
        }
        if self.fault.is_some() {
            return Err(std::io::Error::from(std::io::ErrorKind::InvalidData));
        }
        Ok(&self.line[self.used..])
    }

    fn consume(&mut self, amount: usize) {
        self.used += amount;
    }
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Content, Fault> {
    let vertices = count_vertices(bytes);
    let mut lines = Lines::new(bytes, vertices);
    let options = tobj::LoadOptions::default();
    let outcome = tobj::load_obj_buf(&mut lines, &options, |_| Err(tobj::LoadError::GenericFailure));
    if let Some(fault) = lines.fault {
        return Err(fault);
    }
    let (models, _) = outcome.map_err(|error| match error {
        tobj::LoadError::FaceVertexOutOfBounds => out_of_bounds(bytes, vertices),
        tobj::LoadError::FaceParseError => Fault::text(
            lines.at,
            "a corner of the face is no whole number; write vertex numbers from 1",
        ),
        tobj::LoadError::ScalingByZeroError => Fault::text(lines.at, "the weight of the vertex is zero; leave it out"),
        error => Fault::text(lines.at, format!("the line cannot be read: {error}")),
    })?;
    let Some(model) = models.into_iter().next().filter(|_| vertices > 0) else {
        return Err(Fault::whole("there is no vertex; the file is cut off or no OBJ file"));
    };
    let mesh = model.mesh;
    let points: Vec<[f64; 3]> = mesh.positions.as_chunks().0.to_vec();
    if let Some(bad) = points
        .iter()
        .position(|point| !point.iter().all(|coordinate| coordinate.is_finite()))
    {
        return Err(Fault::whole(format!(
            "vertex {} is not finite once divided by its weight",
            bad + 1
        )));
    }
    let mut sorter = Sorter::default();
    // Without sizes all faces are triangles, and so was the polygon of all vertices.
    let sizes = mesh.face_arities.iter().map(|&size| size as usize);
    let mut sizes: Box<dyn Iterator<Item = usize>> = if mesh.face_arities.is_empty() {
        Box::new(std::iter::repeat_n(3, mesh.indices.len() / 3))
    } else {
        Box::new(sizes)
    };
    let mut rest = &mesh.indices[..];
    // The polygon of all vertices.
    if let Some((_, after)) = sizes.next().and_then(|size| rest.split_at_checked(size)) {
        rest = after;
    }
    for size in sizes {
        if let Some((corners, after)) = rest.split_at_checked(size) {
            sorter.polygon(corners).map_err(Fault::whole)?;
            rest = after;
        }
    }
    let point_data = read_normals(bytes, vertices)?;
    let mut content = sorter.finish(points, point_data, Vec::new())?;
    for (keyword, count) in lines.left_out {
        content.notices.push(format!("lines of {keyword:?} left out: {count}"));
    }
    Ok(content)
}

fn count_vertices(bytes: &[u8]) -> usize {
    let mut text = Text::new(bytes, None);
    let mut count = 0;
    while let Some(line) = text.line() {
        let line = line.trim_ascii_start();
        count += usize::from(matches!(line, [b'v', after, ..] if after.is_ascii_whitespace()) || line == b"v");
    }
    count
}

/// The name of the point field that holds normals.
const NORMALS: &str = "normals";

/// The normals that corners of faces name, summed over the corners of every vertex; nothing when no corner names one.
fn read_normals(bytes: &[u8], vertices: usize) -> Result<Vec<Field>, Fault> {
    let mut text = Text::new(bytes, None);
    let mut normals: Vec<[f64; 3]> = Vec::new();
    let mut corners: Vec<(usize, i64, usize)> = Vec::new();
    let mut seen: i64 = 0;
    loop {
        let at = text.at();
        let Some(line) = text.line() else { break };
        let line = line.split(|&byte| byte == b'#').next().unwrap_or_default();
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => seen += 1,
            Some(b"vn") => {
                let mut normal = [0.0; 3];
                for component in &mut normal {
                    let value = words.next().and_then(parse_real).filter(|value| value.is_finite());
                    *component = value.ok_or_else(|| Fault::text(at, "a normal needs three finite numbers"))?;
                }
                normals.push(normal);
            }
            Some(b"f") => {
                for word in words {
                    let mut parts = word.split(|&byte| byte == b'/');
                    let (vertex, normal) = (parts.next().unwrap_or_default(), parts.nth(1).unwrap_or_default());
                    let Some(vertex) = super::text::parse_integer(vertex) else {
                        continue;
                    };
                    let vertex = if vertex < 0 {
                        seen.saturating_add(vertex)
                    } else {
                        vertex.saturating_sub(1)
                    };
                    if normal.is_empty() || vertex < 0 || vertex >= vertices as i64 {
                        continue;
                    }
                    let index = super::text::parse_integer(normal)
                        .ok_or_else(|| Fault::text(at, format!("{} is no number of a normal", shown(normal))))?;
                    let index = if index < 0 {
                        (normals.len() as i64).saturating_add(index)
                    } else {
                        index.saturating_sub(1)
                    };
                    corners.push((vertex as usize, index, at));
                }
            }
            _ => {}
        }
    }
    if corners.is_empty() {
        return Ok(Vec::new());
    }
    let mut values = vec![0.0; 3 * vertices];
    for (vertex, index, at) in corners {
        let Some(normal) = usize::try_from(index).ok().and_then(|index| normals.get(index)) else {
            return Err(Fault::text(
                at,
                format!(
                    "the face names normal {}; there are {}, counted from 1",
                    index.saturating_add(1),
                    normals.len()
                ),
            ));
        };
        for axis in 0..3 {
            values[3 * vertex + axis] += normal[axis];
        }
    }
    Ok(vec![Field {
        name: NORMALS.to_string(),
        components: 3,
        values,
    }])
}

/// The normals that the corners of an OBJ file's faces name, quad by quad; nothing when a face is no quad or a corner
/// names no normal of the file. The file must have been [read](super::read) before.
pub fn quad_corner_normals(bytes: &[u8]) -> Option<Vec<[[f64; 3]; 4]>> {
    let mut text = Text::new(bytes, None);
    let mut normals: Vec<[f64; 3]> = Vec::new();
    let mut named: Vec<[usize; 4]> = Vec::new();
    while let Some(line) = text.line() {
        let line = line.split(|&byte| byte == b'#').next().unwrap_or_default();
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"vn") => {
                let mut normal = [0.0; 3];
                for component in &mut normal {
                    *component = words.next().and_then(parse_real)?;
                }
                normals.push(normal);
            }
            Some(b"f") => {
                let index = |word: &[u8]| {
                    let number = super::text::parse_integer(word.split(|&byte| byte == b'/').nth(2)?)?;
                    let index = if number < 0 {
                        (normals.len() as i64).checked_add(number)?
                    } else {
                        number.checked_sub(1)?
                    };
                    usize::try_from(index).ok()
                };
                let corners: Option<Vec<usize>> = words.map(index).collect();
                named.push(corners?.try_into().ok()?);
            }
            _ => {}
        }
    }
    let quad = |corners: [usize; 4]| -> Option<[[f64; 3]; 4]> {
        let mut found = [[0.0; 3]; 4];
        for (place, corner) in found.iter_mut().zip(corners) {
            *place = *normals.get(corner)?;
        }
        Some(found)
    };
    named.into_iter().map(quad).collect()
}

/// Names the first face with a corner that is none of the vertices.
fn out_of_bounds(bytes: &[u8], vertices: usize) -> Fault {
    let mut text = Text::new(bytes, None);
    let mut seen: i64 = 0;
    loop {
        let at = text.at();
        let Some(line) = text.line() else {
            return Fault::whole("a face names a vertex that is not there");
        };
        let line = line.split(|&byte| byte == b'#').next().unwrap_or_default();
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => seen += 1,
            Some(b"f") => {
                for word in words {
                    let number = word.split(|&byte| byte == b'/').next().unwrap_or_default();
                    let index = super::text::parse_integer(number).unwrap_or(0);
                    let from_one = if index < 0 {
                        seen.saturating_add(index).saturating_add(1)
                    } else {
                        index
                    };
                    if from_one < 1 || from_one > vertices as i64 {
                        return Fault::text(
                            at,
                            format!(
                                "the face names vertex {index}; there are {vertices}, counted from 1 (or from -1 backwards)"
                            ),
                        );
                    }
                }
            }
            _ => {}
        }
    }
}

/// Writes vertices and faces, and normals from the point field `normals`.
pub(super) fn write(content: &Content) -> Result<Written, String> {
    let is_normals = |field: &Field| field.name == NORMALS && field.components == 3;
    let normals = content.point_data.iter().find(|field| is_normals(field));
    let mut out = Vec::with_capacity(64 * content.points.len() + 24 * content.cells().count());
    // Writing to memory cannot fail.
    for [x, y, z] in &content.points {
        let _ = writeln!(out, "v {x:?} {y:?} {z:?}");
    }
    if let Some(field) = normals {
        for [x, y, z] in field.values.as_chunks::<3>().0 {
            let _ = writeln!(out, "vn {x:?} {y:?} {z:?}");
        }
    }
    let cells = content.cells();
    for kind in CellKind::SURFACE {
        for corners in cells.corners_of(kind).chunks_exact(kind.corners()) {
            out.push(b'f');
            for corner in corners {
                let number = u64::from(*corner) + 1;
                let _ = match normals {
                    None => write!(out, " {number}"),
                    Some(_) => write!(out, " {number}//{number}"),
                };
            }
            out.push(b'\n');
        }
    }
    Ok(Written {
        bytes: out,
        notices: left_out("OBJ", content, |field, of_points| of_points && is_normals(field)),
    })
}
