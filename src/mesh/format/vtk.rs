//! VTK's numbers for kinds of cells, and its legacy format `.vtk`.
//!
//! Read: unstructured grids and polygonal data, ASCII and binary, cells in the layout of files up to version 4 and in
//! that of version 5 (offsets and connectivity); scalars, vectors, normals, tensors, texture coordinates and fields as
//! data. Written: version 3.0, ASCII, unstructured grid. Source: the VTK user's guide, 11th edition, section 19.3,
//! "Simple legacy formats", and the note "VTK legacy file version 5.1".

use super::binary::{Order, Scalar};
use super::cells::Sorter;
use super::numbers::Numbers;
use super::text::{same, shown};
use super::{CellKind, Content, Fault, Field, Written};
use std::io::Write as _;

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
                "cells of type {code} ({}) are of higher order; only straight cells are read; take a tessellation instead (the job's own `.vtu`, or \
                 `tessellation.obj` by export = [\"obj\"]), or write the mesh with order 1",
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

/// Whether the first line is that of a legacy file.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    bytes.first_chunk::<5>().is_some_and(|start| same(start, "# vtk"))
}

/// The cells of a section, before their types are known.
#[derive(Default)]
struct Polygons {
    corners: Vec<u32>,
    /// Where each cell ends in `corners`.
    ends: Vec<usize>,
}

impl Polygons {
    fn cell(&self, index: usize) -> &[u32] {
        let start = if index == 0 { 0 } else { self.ends[index - 1] };
        &self.corners[start..self.ends[index]]
    }
}

/// Which rows the data that follow belong to.
#[derive(Clone, Copy, PartialEq)]
enum Owner {
    Whole,
    Points,
    Cells,
}

/// A file as far as it is read.
#[derive(Default)]
struct Reading {
    points: Vec<[f64; 3]>,
    cells: Option<Polygons>,
    sorter: Sorter,
    point_data: Vec<Field>,
    cell_data: Vec<Field>,
    notices: Vec<String>,
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Content, Fault> {
    let mut numbers = Numbers::new(bytes, None);
    for what in ["the line \"# vtk DataFile Version\"", "the title"] {
        let line = numbers.text.line();
        line.ok_or_else(|| numbers.text.ended(format_args!("{what}")))?;
    }
    let form = numbers.text.need(format_args!("ASCII or BINARY"))?;
    if same(form, "BINARY") {
        numbers.set_binary(Order::Big);
    } else if !same(form, "ASCII") {
        return Err(numbers.text.not(form, format_args!("ASCII or BINARY")));
    }
    let mut reading = Reading::default();
    let mut owner = Owner::Whole;
    let mut rows = 0;
    while let Some(word) = numbers.text.word() {
        let at = numbers.text.at() - word.len();
        let keyword = String::from_utf8_lossy(word).to_ascii_uppercase();
        match keyword.as_str() {
            "DATASET" => {
                let kind = numbers.text.need(format_args!("the kind of data set"))?;
                if !same(kind, "UNSTRUCTURED_GRID") && !same(kind, "POLYDATA") {
                    return Err(Fault::text(
                        at,
                        format!(
                            "a data set {} is not read; write UNSTRUCTURED_GRID or POLYDATA",
                            shown(kind)
                        ),
                    ));
                }
            }
            "POINTS" => {
                if !reading.points.is_empty() {
                    return Err(Fault::text(at, "a second section of points; join it with the first"));
                }
                reading.points = read_points(&mut numbers)?;
            }
            "CELLS" => reading.cells = Some(read_polygons(&mut numbers, reading.points.len())?),
            "CELL_TYPES" => reading.read_types(&mut numbers, at)?,
            "VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS" => {
                reading.read_polydata(&mut numbers, &keyword, at)?
            }
            "POINT_DATA" | "CELL_DATA" => {
                let count = text_count(&mut numbers, format_args!("the number of rows"))?;
                (owner, rows) = if keyword == "POINT_DATA" {
                    (Owner::Points, reading.points.len())
                } else {
                    (Owner::Cells, reading.sorter.seen())
                };
                if count != rows {
                    return Err(Fault::text(
                        at,
                        format!("{keyword} has {count} rows, the mesh has {rows} points or cells; correct the count"),
                    ));
                }
            }
            "METADATA" => skip_metadata(&mut numbers),
            _ => {
                let fields = read_data(&mut numbers, &keyword, rows, at)?;
                match owner {
                    Owner::Points => reading.point_data.extend(fields),
                    Owner::Cells => reading.cell_data.extend(fields),
                    Owner::Whole if fields.is_empty() => {}
                    Owner::Whole => reading
                        .notices
                        .push("data of the whole file (FIELD) left out".to_string()),
                }
            }
        }
    }
    if reading.cells.is_some() {
        return Err(numbers.text.ended(format_args!("the section CELL_TYPES")));
    }
    let mut content = reading
        .sorter
        .finish(reading.points, reading.point_data, reading.cell_data)?;
    content.notices.extend(reading.notices);
    Ok(content)
}

impl Reading {
    fn read_types(&mut self, numbers: &mut Numbers<'_>, at: usize) -> Result<(), Fault> {
        let count = text_count(numbers, format_args!("the number of cell types"))?;
        let cells = self
            .cells
            .take()
            .ok_or_else(|| Fault::text(at, "CELL_TYPES comes before CELLS; put it after"))?;
        if count != cells.ends.len() {
            return Err(Fault::text(
                at,
                format!(
                    "there are {count} cell types for {} cells; correct one of the counts",
                    cells.ends.len()
                ),
            ));
        }
        numbers.start_block();
        for index in 0..count {
            let code = numbers.integer(Scalar::Int32, format_args!("the type of cell {index} (from 0)"))?;
            add_cell(&mut self.sorter, code, cells.cell(index))
                .map_err(|message| numbers.fault(format!("cell {index} (from 0): {message}")))?;
        }
        Ok(())
    }

    fn read_polydata(&mut self, numbers: &mut Numbers<'_>, keyword: &str, at: usize) -> Result<(), Fault> {
        let polygons = read_polygons(numbers, self.points.len())?;
        for index in 0..polygons.ends.len() {
            let cell = polygons.cell(index);
            let outcome = match keyword {
                "VERTICES" => add_cell(&mut self.sorter, 2, cell),
                "LINES" => add_cell(&mut self.sorter, 4, cell),
                "POLYGONS" => self.sorter.polygon(cell),
                _ => add_cell(&mut self.sorter, 6, cell),
            };
            outcome.map_err(|message| Fault::text(at, format!("{keyword}, entry {index} (from 0): {message}")))?;
        }
        Ok(())
    }
}

fn text_count(numbers: &mut Numbers<'_>, what: std::fmt::Arguments<'_>) -> Result<usize, Fault> {
    numbers.text.count(what, 0)
}

fn read_points(numbers: &mut Numbers<'_>) -> Result<Vec<[f64; 3]>, Fault> {
    let count = text_count(numbers, format_args!("the number of points"))?;
    let scalar = scalar(numbers)?;
    numbers.start_block();
    numbers.can_follow(count, 3, scalar.size(), format_args!("points"))?;
    let mut points = Vec::with_capacity(count);
    for index in 0..count {
        let mut point = [0.0; 3];
        for (axis, coordinate) in point.iter_mut().enumerate() {
            *coordinate = numbers.finite(scalar, format_args!("coordinate {axis} of point {index} (both from 0)"))?;
        }
        points.push(point);
    }
    Ok(points)
}

/// The number type that the next word names.
fn scalar(numbers: &mut Numbers<'_>) -> Result<Scalar, Fault> {
    let word = numbers.text.need(format_args!("a type of numbers"))?;
    Ok(match String::from_utf8_lossy(word).to_ascii_lowercase().as_str() {
        "char" | "signed_char" | "vtktypeint8" => Scalar::Int8,
        "unsigned_char" | "vtktypeuint8" => Scalar::UInt8,
        "short" | "vtktypeint16" => Scalar::Int16,
        "unsigned_short" | "vtktypeuint16" => Scalar::UInt16,
        "int" | "vtkidtype" | "vtktypeint32" => Scalar::Int32,
        "unsigned_int" | "vtktypeuint32" => Scalar::UInt32,
        "long" | "vtktypeint64" | "long_long" => Scalar::Int64,
        "unsigned_long" | "vtktypeuint64" | "unsigned_long_long" => Scalar::UInt64,
        "float" | "vtktypefloat32" => Scalar::Float32,
        "double" | "vtktypefloat64" => Scalar::Float64,
        _ => {
            return Err(numbers.text.not(
                word,
                format_args!("a type of numbers (char, short, int, long, their unsigned kinds, float or double)"),
            ));
        }
    })
}

/// A section of cells in either layout.
fn read_polygons(numbers: &mut Numbers<'_>, points: usize) -> Result<Polygons, Fault> {
    let first = text_count(numbers, format_args!("the number of cells"))?;
    let second = text_count(numbers, format_args!("the number of integers of the cells"))?;
    let mut polygons = Polygons::default();
    if numbers.text.peek().is_some_and(|word| same(word, "OFFSETS")) {
        numbers.text.word();
        let offset_type = scalar(numbers)?;
        numbers.start_block();
        numbers.can_follow(first, 1, offset_type.size(), format_args!("offsets of cells"))?;
        polygons.ends.reserve(first);
        for index in 0..first {
            let end = numbers.count(offset_type, format_args!("offset {index} (from 0)"))?;
            let least = polygons.ends.last().copied().unwrap_or(0);
            if end < least || end > second || (index == 0 && end != 0) {
                return Err(numbers.fault(format!(
                    "offset {index} (from 0) is {end}; offsets start at 0, grow, and end at {second}"
                )));
            }
            if index > 0 {
                polygons.ends.push(end);
            }
        }
        if polygons.ends.last().copied().unwrap_or(0) != second {
            return Err(numbers.fault(format!(
                "the offsets do not end at {second}, the number of corners; correct the count"
            )));
        }
        let word = numbers.text.need(format_args!("CONNECTIVITY"))?;
        if !same(word, "CONNECTIVITY") {
            return Err(numbers.text.not(word, format_args!("CONNECTIVITY")));
        }
        let corner_type = scalar(numbers)?;
        numbers.start_block();
        numbers.can_follow(second, 1, corner_type.size(), format_args!("corners of cells"))?;
        polygons.corners.reserve(second);
        for index in 0..second {
            let corner = numbers.index(
                corner_type,
                points,
                format_args!("corner {index} (from 0) of the cells"),
            )?;
            polygons.corners.push(corner);
        }
        return Ok(polygons);
    }
    numbers.start_block();
    numbers.can_follow(second, 1, 4, format_args!("integers of cells"))?;
    numbers.can_follow(first, 1, 4, format_args!("cells"))?;
    polygons.ends.reserve(first);
    let mut left = second;
    for index in 0..first {
        let size = numbers.count(
            Scalar::Int32,
            format_args!("the number of corners of cell {index} (from 0)"),
        )?;
        left = left.checked_sub(size.saturating_add(1)).ok_or_else(|| {
            numbers.fault(format!(
                "cell {index} (from 0) with {size} corners goes beyond the {second} integers announced"
            ))
        })?;
        for _ in 0..size {
            let corner = numbers.index(Scalar::Int32, points, format_args!("a corner of cell {index} (from 0)"))?;
            polygons.corners.push(corner);
        }
        polygons.ends.push(polygons.corners.len());
    }
    if left > 0 {
        return Err(numbers.fault(format!(
            "the cells use {} of the {second} integers announced; correct the count",
            second - left
        )));
    }
    Ok(polygons)
}

/// The data that a keyword announces, none for a lookup table.
fn read_data(numbers: &mut Numbers<'_>, keyword: &str, rows: usize, at: usize) -> Result<Vec<Field>, Fault> {
    let known = matches!(
        keyword,
        "SCALARS"
            | "COLOR_SCALARS"
            | "LOOKUP_TABLE"
            | "VECTORS"
            | "NORMALS"
            | "TENSORS"
            | "TENSORS6"
            | "TEXTURE_COORDINATES"
            | "GLOBAL_IDS"
            | "PEDIGREE_IDS"
            | "EDGE_FLAGS"
            | "FIELD"
    );
    if !known {
        return Err(Fault::text(
            at,
            format!(
                "{} stands where a keyword is expected; a count before is too small, or the section is not known",
                shown(keyword.as_bytes())
            ),
        ));
    }
    let name = decode_name(numbers.text.need(format_args!("the name of the data"))?);
    let (components, scalar) = match keyword {
        "FIELD" => return read_fields(numbers),
        "LOOKUP_TABLE" => {
            let size = text_count(numbers, format_args!("the size of the lookup table"))?;
            numbers.start_block();
            read_values(numbers, Scalar::UInt8, size, 4, &name)?;
            return Ok(Vec::new());
        }
        "SCALARS" => {
            let scalar = scalar(numbers)?;
            let components = match numbers.text.peek().and_then(super::text::parse_integer) {
                Some(count @ 1..=4) => {
                    numbers.text.word();
                    count as usize
                }
                _ => 1,
            };
            if numbers.text.peek().is_some_and(|word| same(word, "LOOKUP_TABLE")) {
                numbers.text.word();
                numbers.text.word();
            }
            (components, scalar)
        }
        "COLOR_SCALARS" => (
            text_count(numbers, format_args!("the number of components"))?,
            Scalar::UInt8,
        ),
        "TEXTURE_COORDINATES" => (text_count(numbers, format_args!("the dimension"))?, scalar(numbers)?),
        "VECTORS" | "NORMALS" => (3, scalar(numbers)?),
        "TENSORS" => (9, scalar(numbers)?),
        "TENSORS6" => (6, scalar(numbers)?),
        _ => (1, scalar(numbers)?),
    };
    numbers.start_block();
    let values = read_values(numbers, scalar, rows, components, &name)?;
    Ok(vec![Field {
        name,
        components,
        values,
    }])
}

fn read_fields(numbers: &mut Numbers<'_>) -> Result<Vec<Field>, Fault> {
    let count = numbers.text.count(format_args!("the number of arrays"), 8)?;
    let mut fields = Vec::new();
    for _ in 0..count {
        while numbers.text.peek().is_some_and(|word| same(word, "METADATA")) {
            numbers.text.word();
            skip_metadata(numbers);
        }
        let name = decode_name(numbers.text.need(format_args!("the name of an array"))?);
        let components = text_count(numbers, format_args!("the number of components of {name:?}"))?;
        let rows = text_count(numbers, format_args!("the number of rows of {name:?}"))?;
        let scalar = scalar(numbers)?;
        numbers.start_block();
        let values = read_values(numbers, scalar, rows, components, &name)?;
        fields.push(Field {
            name,
            components,
            values,
        });
    }
    Ok(fields)
}

fn read_values(
    numbers: &mut Numbers<'_>,
    scalar: Scalar,
    rows: usize,
    components: usize,
    name: &str,
) -> Result<Vec<f64>, Fault> {
    if components == 0 {
        return Err(numbers.fault_at(
            numbers.text.at(),
            format!("the data {name:?} have 0 components; write 1 or more"),
        ));
    }
    numbers.can_follow(rows, components, scalar.size(), format_args!("rows of {name:?}"))?;
    let count = rows * components;
    let mut values = Vec::with_capacity(count);
    for index in 0..count {
        values.push(numbers.real(scalar, format_args!("number {index} (from 0) of {name:?}"))?);
    }
    Ok(values)
}

/// Passes information about arrays, which lasts to the next empty line.
fn skip_metadata(numbers: &mut Numbers<'_>) {
    numbers.text.line();
    while let Some(line) = numbers.text.line() {
        if line.trim_ascii().is_empty() {
            break;
        }
    }
}

/// A name, whose special characters VTK writes as `%` and two digits.
fn decode_name(word: &[u8]) -> String {
    let mut bytes = Vec::with_capacity(word.len());
    let mut rest = word;
    while let [first, tail @ ..] = rest {
        let coded = (*first == b'%')
            .then(|| tail.get(..2))
            .flatten()
            .and_then(|digits| std::str::from_utf8(digits).ok())
            .and_then(|digits| u8::from_str_radix(digits, 16).ok());
        match coded {
            Some(byte) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            None => {
                bytes.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn encode_name(name: &str) -> String {
    let mut coded = String::new();
    for byte in name.bytes() {
        if byte.is_ascii_graphic() && byte != b'%' && byte != b'"' {
            coded.push(byte as char);
        } else {
            coded.push_str(&format!("%{byte:02X}"));
        }
    }
    if coded.is_empty() { "%20".to_string() } else { coded }
}

/// Writes the whole of `content`.
pub(super) fn write(content: &Content) -> Result<Written, String> {
    let cells = content.cells();
    let mut out = Vec::with_capacity(64 * content.points.len() + 32 * cells.count() + 256);
    // Writing to memory cannot fail.
    let _ = write!(
        out,
        "# vtk DataFile Version 3.0\nmesh\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
        content.points.len()
    );
    for [x, y, z] in &content.points {
        let _ = writeln!(out, "{x:?} {y:?} {z:?}");
    }
    let integers: usize = cells.iter().map(|(_, corners)| corners.len() + 1).sum();
    let _ = writeln!(out, "CELLS {} {integers}", cells.count());
    for (_, corners) in cells.iter() {
        let _ = write!(out, "{}", corners.len());
        for corner in corners {
            let _ = write!(out, " {corner}");
        }
        out.push(b'\n');
    }
    let _ = writeln!(out, "CELL_TYPES {}", cells.count());
    for (kind, _) in cells.iter() {
        let _ = writeln!(out, "{}", code(kind));
    }
    for (keyword, rows, fields) in [
        ("POINT_DATA", content.points.len(), &content.point_data),
        ("CELL_DATA", cells.count(), &content.cell_data),
    ] {
        if fields.is_empty() {
            continue;
        }
        let _ = write!(out, "{keyword} {rows}\nFIELD FieldData {}\n", fields.len());
        for field in fields {
            let _ = writeln!(out, "{} {} {rows} double", encode_name(&field.name), field.components);
            for row in field.values.chunks_exact(field.components) {
                for (index, value) in row.iter().enumerate() {
                    let _ = write!(out, "{}{value:?}", if index == 0 { "" } else { " " });
                }
                out.push(b'\n');
            }
        }
    }
    Ok(Written {
        bytes: out,
        notices: Vec::new(),
    })
}
