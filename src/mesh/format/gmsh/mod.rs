//! Gmsh's `.msh`, versions 2.2 and 4.1, ASCII and binary in either byte order.
//!
//! Cells carry the tag of their physical group as the field `reference`; data on nodes and elements become fields. Points
//! and lines among the elements, names of groups, periodicity and the like are left out with a notice.
//! Source: the Gmsh reference manual 4.13, section "File formats".

pub mod curved;
mod version_2;
mod version_4;

use super::binary::{Order, Scalar};
use super::cells::Sorter;
use super::numbers::Numbers;
use super::text::{parse_real, same, shown};
use super::{CellKind, Content, Fault, Field, Written, left_out, reference_field, reference_labels};
use std::collections::BTreeMap;
use std::fmt::Arguments;
use std::io::Write as _;

/// The most numbers of data a byte of the file, rows that the data leave out included.
const MOST_SPARSE: usize = 8;

/// Whether the first word is that of a Gmsh file.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    version(bytes).is_some_and(|rest| !rest.starts_with(b"2"))
}

/// Whether the header says version 2.
pub(super) fn sniff2(bytes: &[u8]) -> bool {
    version(bytes).is_some_and(|rest| rest.starts_with(b"2"))
}

/// What follows the first header's name.
fn version(bytes: &[u8]) -> Option<&[u8]> {
    let rest = bytes.trim_ascii_start().strip_prefix(b"$MeshFormat")?;
    Some(rest.trim_ascii_start())
}

/// Tags of nodes or elements, and the row of each.
enum Tags {
    Consecutive { first: i64, count: usize },
    Sorted(Vec<(i64, u32)>),
}

impl Tags {
    /// # Errors
    /// A tag that stands twice.
    fn new(tags: &[i64]) -> Result<Tags, i64> {
        let first = tags.first().copied().unwrap_or(1);
        let expected = (0..tags.len() as i64).map(|offset| first.saturating_add(offset));
        if tags.iter().copied().eq(expected) {
            return Ok(Tags::Consecutive {
                first,
                count: tags.len(),
            });
        }
        let mut sorted: Vec<(i64, u32)> = tags.iter().copied().zip(0..).collect();
        sorted.sort_unstable();
        match sorted.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            Some(pair) => Err(pair[0].0),
            None => Ok(Tags::Sorted(sorted)),
        }
    }

    fn row(&self, tag: i64) -> Option<u32> {
        match self {
            Tags::Consecutive { first, count } => {
                let row = u32::try_from(tag.checked_sub(*first)?).ok()?;
                ((row as usize) < *count).then_some(row)
            }
            Tags::Sorted(sorted) => {
                let place = sorted.binary_search_by_key(&tag, |&(tag, _)| tag).ok()?;
                Some(sorted[place].1)
            }
        }
    }
}

/// What becomes of an element.
#[derive(Clone, Copy)]
enum Shape {
    Cell(CellKind),
    /// Left out; the plural of its name.
    LeftOut(&'static str),
}

/// Gmsh's numbers for the kinds that are read.
const SHAPES: [(i64, usize, Shape); 8] = [
    (15, 1, Shape::LeftOut("points")),
    (1, 2, Shape::LeftOut("lines")),
    (2, 3, Shape::Cell(CellKind::Triangle)),
    (3, 4, Shape::Cell(CellKind::Quad)),
    (4, 4, Shape::Cell(CellKind::Tetrahedron)),
    (5, 8, Shape::Cell(CellKind::Hexahedron)),
    (6, 6, Shape::Cell(CellKind::Prism)),
    (7, 5, Shape::Cell(CellKind::Pyramid)),
];

/// Gmsh's number for a kind of cells.
fn code(kind: CellKind) -> i64 {
    match kind {
        CellKind::Triangle => 2,
        CellKind::Quad => 3,
        CellKind::Tetrahedron => 4,
        CellKind::Hexahedron => 5,
        CellKind::Prism => 6,
        CellKind::Pyramid => 7,
    }
}

/// The number of nodes of an element and what becomes of it.
fn shape(code: i64) -> Result<(usize, Shape), String> {
    if let Some(&(_, nodes, shape)) = SHAPES.iter().find(|entry| entry.0 == code) {
        return Ok((nodes, shape));
    }
    let curved = match code {
        8 => "second-order line",
        9 => "second-order triangle",
        10 => "second-order quad of 9 nodes",
        11 => "second-order tetrahedron",
        12 => "second-order hexahedron of 27 nodes",
        13 => "second-order prism of 18 nodes",
        14 => "second-order pyramid of 14 nodes",
        16 => "second-order quad of 8 nodes",
        17 => "second-order hexahedron of 20 nodes",
        18 => "second-order prism of 15 nodes",
        19 => "second-order pyramid of 13 nodes",
        20..=25 => "triangle of order 3 or higher",
        26..=28 => "line of order 3 or higher",
        29..=31 => "tetrahedron of order 3 or higher",
        36..=140 => "element of order 3 or higher, or a polygon",
        _ => return Err(format!("element type {code} is unknown; types 1 to 7 and 15 are read")),
    };
    Err(format!(
        "element type {code} ({curved}) is of higher order; only straight elements are read, write the mesh with order 1 (Gmsh: `-order 1`)"
    ))
}

/// Data on nodes or elements, as the file gives them.
struct Data {
    /// Where the section starts.
    at: usize,
    name: String,
    step: i64,
    components: usize,
    tags: Vec<i64>,
    values: Vec<f64>,
}

/// A file as far as it is read.
struct Reading<'a> {
    bytes: &'a [u8],
    numbers: Numbers<'a>,
    /// The type of counts and tags in binary files of version 4.
    size: Scalar,
    points: Vec<[f64; 3]>,
    node_tags: Vec<i64>,
    nodes: Option<Tags>,
    sorter: Sorter,
    element_tags: Vec<i64>,
    /// The physical group of every element.
    labels: Vec<f64>,
    /// The physical group of every entity, by dimension and tag.
    groups: BTreeMap<(i64, i64), i64>,
    node_data: Vec<Data>,
    element_data: Vec<Data>,
    notices: Vec<String>,
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Content, Fault> {
    let mut reading = Reading {
        bytes,
        numbers: Numbers::new(bytes, None),
        size: Scalar::UInt64,
        points: Vec::new(),
        node_tags: Vec::new(),
        nodes: None,
        sorter: Sorter::default(),
        element_tags: Vec::new(),
        labels: Vec::new(),
        groups: BTreeMap::new(),
        node_data: Vec::new(),
        element_data: Vec::new(),
        notices: Vec::new(),
    };
    let major = reading.read_header()?;
    let mut elements_seen = false;
    while let Some(word) = reading.numbers.text.word() {
        let at = reading.numbers.text.at() - word.len();
        match word {
            b"$Nodes" => {
                if reading.nodes.is_some() {
                    return Err(Fault::text(at, "a second section of nodes; join it with the first"));
                }
                match major {
                    2 => version_2::read_nodes(&mut reading)?,
                    _ => version_4::read_nodes(&mut reading)?,
                }
                let tags = Tags::new(&reading.node_tags).map_err(|tag| {
                    Fault::text(at, format!("node {tag} is given twice; give each node its own number"))
                })?;
                reading.nodes = Some(tags);
            }
            b"$Elements" => {
                if elements_seen || reading.nodes.is_none() {
                    return Err(Fault::text(at, "the elements have to come once, after the nodes"));
                }
                elements_seen = true;
                match major {
                    2 => version_2::read_elements(&mut reading)?,
                    _ => version_4::read_elements(&mut reading)?,
                }
            }
            b"$Entities" if major == 4 => version_4::read_entities(&mut reading)?,
            b"$NodeData" => {
                let data = reading.read_data(at)?;
                reading.node_data.push(data);
            }
            b"$ElementData" => {
                let data = reading.read_data(at)?;
                reading.element_data.push(data);
            }
            [b'$', name @ ..] if !name.starts_with(b"End") => {
                if name != b"Comments" {
                    reading.notices.push(format!("section {} left out", shown(word)));
                }
                reading.skip_section(name, at)?;
                continue;
            }
            _ => {
                return Err(Fault::text(
                    at,
                    format!("{} stands where a section such as $Nodes is expected", shown(word)),
                ));
            }
        }
        reading.end_section(&word[1..])?;
    }
    if reading.nodes.is_none() {
        return Err(Fault::whole("there is no section $Nodes; the file is cut off"));
    }
    if !elements_seen {
        return Err(Fault::whole("there is no section $Elements; the file is cut off"));
    }
    reading.finish()
}

impl<'a> Reading<'a> {
    /// Reads `$MeshFormat` and returns the major version.
    fn read_header(&mut self) -> Result<u32, Fault> {
        let text = &mut self.numbers.text;
        text.word();
        let word = text.need(format_args!("the version of the format"))?;
        let version_at = text.at() - word.len();
        let version = parse_real(word).ok_or_else(|| text.not(word, format_args!("the version of the format")))?;
        let kind = text.integer(format_args!("the file type (0 ASCII, 1 binary)"))?;
        let kind_at = text.at() - 1;
        let size = text.integer(format_args!("the size of numbers"))?;
        let major = match version {
            2.0..3.0 => 2,
            4.1..5.0 => 4,
            _ => {
                return Err(Fault::text(
                    version_at,
                    format!(
                        "version {version} is not read; write version 4.1 or 2.2 (Gmsh: `-format msh41` or `-format msh22`)"
                    ),
                ));
            }
        };
        match (kind, size) {
            (0, _) => {}
            (1, 4 | 8) => {
                self.size = if size == 8 { Scalar::UInt64 } else { Scalar::UInt32 };
                self.numbers.set_binary(Order::Little);
                self.numbers.start_block();
                let one = self
                    .numbers
                    .integer(Scalar::Int32, format_args!("the integer 1 that shows the byte order"))?;
                match one {
                    1 => {}
                    0x0100_0000 => self.numbers.set_binary(Order::Big),
                    _ => {
                        return Err(self.numbers.fault(format!(
                            "{one} stands where 1 shows the byte order; the file is damaged"
                        )));
                    }
                }
            }
            (1, _) => {
                return Err(Fault::text(
                    kind_at,
                    format!("numbers of {size} bytes are unknown; 4 and 8 are read"),
                ));
            }
            _ => {
                return Err(Fault::text(
                    kind_at,
                    format!("the file type is {kind}; write 0 for ASCII, 1 for binary"),
                ));
            }
        }
        self.end_section(b"MeshFormat")?;
        Ok(major)
    }

    /// Passes `$End` and the section's name.
    fn end_section(&mut self, name: &[u8]) -> Result<(), Fault> {
        let name = String::from_utf8_lossy(name);
        let text = &mut self.numbers.text;
        let word = text.need(format_args!("$End{name}"))?;
        if same(word, &format!("$End{name}")) {
            Ok(())
        } else {
            Err(Fault::text(
                text.at() - word.len(),
                format!(
                    "{} stands where $End{name} is expected; a count is too small, or a line has too many numbers",
                    shown(word)
                ),
            ))
        }
    }

    fn skip_section(&mut self, name: &[u8], at: usize) -> Result<(), Fault> {
        let end = [b"$End", name].concat();
        let from = self.numbers.text.at();
        let place = self.bytes[from..].windows(end.len()).position(|window| window == end);
        let place = place.ok_or_else(|| {
            let end = String::from_utf8_lossy(&end).into_owned();
            Fault::text(at, format!("the section does not end with {end}; the file is cut off"))
        })?;
        self.numbers.text.go_to(from + place + end.len());
        Ok(())
    }

    fn point(&mut self, tag: i64) -> Result<(), Fault> {
        let mut point = [0.0; 3];
        for (axis, coordinate) in point.iter_mut().enumerate() {
            *coordinate = self
                .numbers
                .finite(Scalar::Float64, format_args!("coordinate {} of node {tag}", axis + 1))?;
        }
        self.points.push(point);
        Ok(())
    }

    /// The nodes of an element, each an integer of type `scalar`, and the element itself.
    fn element(&mut self, tag: i64, label: i64, nodes: usize, shape: Shape, scalar: Scalar) -> Result<(), Fault> {
        let mut corners = [0u32; 8];
        for corner in &mut corners[..nodes] {
            let node = self.numbers.integer(scalar, format_args!("a node of element {tag}"))?;
            let row = self.nodes.as_ref().and_then(|tags| tags.row(node));
            *corner = row.ok_or_else(|| {
                self.numbers.fault(format!(
                    "element {tag} names node {node}, which is not among the {} nodes",
                    self.points.len()
                ))
            })?;
        }
        match shape {
            Shape::Cell(kind) => self.sorter.cell(kind, &corners[..nodes]),
            Shape::LeftOut(name) => self.sorter.leave_out(name),
        }
        self.element_tags.push(tag);
        self.labels.push(label as f64);
        Ok(())
    }

    /// Data on nodes or elements; their tags are always text.
    fn read_data(&mut self, at: usize) -> Result<Data, Fault> {
        let text = &mut self.numbers.text;
        let strings = text.count(format_args!("the number of string tags"), 2)?;
        text.line();
        let mut name = String::new();
        for index in 0..strings {
            let line = text.line().ok_or_else(|| text.ended(format_args!("a string tag")))?;
            if index == 0 {
                let line = line.trim_ascii();
                let line = line.strip_prefix(b"\"").unwrap_or(line);
                name = String::from_utf8_lossy(line.strip_suffix(b"\"").unwrap_or(line)).into_owned();
            }
        }
        let reals = text.count(format_args!("the number of real tags"), 2)?;
        for _ in 0..reals {
            text.real(format_args!("a real tag"))?;
        }
        let integers = text.count(format_args!("the number of integer tags"), 2)?;
        let mut tags = Vec::new();
        for _ in 0..integers {
            tags.push(text.integer(format_args!("an integer tag"))?);
        }
        let &[step, components, count, ..] = &tags[..] else {
            return Err(Fault::text(
                at,
                "the data need three integer tags: the time step, the number of components and the number of rows",
            ));
        };
        let (components, count) = match (usize::try_from(components), usize::try_from(count)) {
            (Ok(components @ 1..=9), Ok(count)) => (components, count),
            _ => {
                return Err(Fault::text(
                    at,
                    format!(
                        "the data {name:?} have {count} rows with {components} components; write 1 to 9 components"
                    ),
                ));
            }
        };
        self.numbers.start_block();
        self.numbers
            .can_follow(count, 1, 4 + 8 * components, format_args!("rows of {name:?}"))?;
        let mut data = Data {
            at,
            name,
            step,
            components,
            tags: Vec::with_capacity(count),
            values: Vec::with_capacity(count),
        };
        for row in 0..count {
            let what = format_args!("row {row} (from 0) of the data {:?}", data.name);
            data.tags.push(self.numbers.integer(Scalar::Int32, what)?);
            for _ in 0..components {
                data.values.push(self.numbers.real(Scalar::Float64, what)?);
            }
        }
        Ok(data)
    }

    fn finish(self) -> Result<Content, Fault> {
        let mut notices = self.notices;
        // Data may cover a few rows only, so that many sections could ask for far more memory than the file holds.
        let wanted = |all: &[Data], rows: usize| all.iter().map(|data| data.components * rows).sum::<usize>();
        let numbers = wanted(&self.node_data, self.points.len()) + wanted(&self.element_data, self.element_tags.len());
        if numbers > MOST_SPARSE * self.bytes.len() {
            return Err(Fault::whole(
                "too many data cover only a few nodes or elements; write data on all of them",
            ));
        }
        let no_nodes = Tags::Consecutive { first: 1, count: 0 };
        let nodes = self.nodes.unwrap_or(no_nodes);
        let point_data = fields(self.node_data, "node", &nodes, self.points.len(), &mut notices)?;
        let mut cell_data: Vec<Field> = reference_field(self.labels).into_iter().collect();
        if !self.element_data.is_empty() {
            let elements = Tags::new(&self.element_tags).map_err(|tag| {
                Fault::whole(format!(
                    "element {tag} is given twice, so data on elements cannot be placed; number them anew"
                ))
            })?;
            let rows = self.element_tags.len();
            cell_data.extend(fields(self.element_data, "element", &elements, rows, &mut notices)?);
        }
        let mut content = self.sorter.finish(self.points, point_data, cell_data)?;
        content.notices.extend(notices);
        Ok(content)
    }
}

/// The fields that data make, in the order of the rows; rows that the data leave out are not numbers.
fn fields(all: Vec<Data>, of: &str, tags: &Tags, rows: usize, notices: &mut Vec<String>) -> Result<Vec<Field>, Fault> {
    let mut fields: Vec<Field> = Vec::new();
    for data in all {
        let mut values = vec![f64::NAN; rows * data.components];
        let mut given = 0;
        for (&tag, row) in data.tags.iter().zip(data.values.chunks_exact(data.components)) {
            let Some(place) = tags.row(tag) else {
                return Err(Fault::text(
                    data.at,
                    format!("the data {:?} name {of} {tag}, which the mesh does not have", data.name),
                ));
            };
            let start = place as usize * data.components;
            values[start..start + data.components].copy_from_slice(row);
            given += 1;
        }
        if given < rows {
            notices.push(format!(
                "the data {:?} cover {given} of {rows} {of}s; the rest are not numbers",
                data.name
            ));
        }
        let mut name = data.name;
        if fields.iter().any(|field| field.name == name) {
            name = format!("{name}, step {}", data.step);
        }
        fields.push(Field {
            name,
            components: data.components,
            values,
        });
    }
    Ok(fields)
}

/// Writes version 4.1.
pub(super) fn write_version_4(content: &Content) -> Result<Written, String> {
    Ok(write(content, "4.1", version_4::write))
}

/// Writes version 2.2.
pub(super) fn write_version_2(content: &Content) -> Result<Written, String> {
    Ok(write(content, "2.2", version_2::write))
}

fn write(content: &Content, version: &str, body: fn(&Content, &[i64], &mut Vec<u8>)) -> Written {
    let mut out = Vec::with_capacity(64 * content.points.len() + 48 * content.cells().count() + 256);
    // Writing to memory cannot fail.
    let _ = write!(out, "$MeshFormat\n{version} 0 8\n$EndMeshFormat\n");
    let groups = reference_labels(&content.cell_data);
    let labels: Vec<i64> = match groups {
        Some(labels) => labels.iter().map(|&label| label as i64).collect(),
        None => vec![0; content.cells().count()],
    };
    body(content, &labels, &mut out);
    for field in content.point_data.iter().filter(|field| holds(field)) {
        write_data(&mut out, "NodeData", content.points.len(), field);
    }
    for field in content.cell_data.iter().filter(|field| holds(field)) {
        if groups.is_none() || field.name != super::REFERENCE {
            write_data(&mut out, "ElementData", content.cells().count(), field);
        }
    }
    Written {
        bytes: out,
        notices: left_out("Gmsh", content, |field, _| holds(field)),
    }
}

/// Whether Gmsh's format can hold a field: scalars, vectors and tensors under a name within quotes.
fn holds(field: &Field) -> bool {
    let plain = |letter: char| letter != '"' && !letter.is_control();
    matches!(field.components, 1 | 3 | 9) && field.name.chars().all(plain) && field.name.trim() == field.name
}

fn write_data(out: &mut Vec<u8>, section: &str, rows: usize, field: &Field) {
    let _ = write!(
        out,
        "${section}\n1\n\"{}\"\n1\n0.0\n3\n0\n{}\n{rows}\n",
        field.name, field.components
    );
    for (row, values) in field.values.chunks_exact(field.components).enumerate() {
        write_row(out, format_args!("{}", row + 1), values);
    }
    let _ = writeln!(out, "$End{section}");
}

fn write_row(out: &mut Vec<u8>, first: Arguments<'_>, values: &[f64]) {
    let _ = write!(out, "{first}");
    for value in values {
        let _ = write!(out, " {value:?}");
    }
    out.push(b'\n');
}
