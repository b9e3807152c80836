//! PLY, ASCII and binary in either byte order, with any further properties.
//!
//! Scalar properties of vertices beyond the coordinates become fields of points, those of faces fields of cells. Lists
//! other than the corners, and elements other than vertices and faces, are left out with a notice. Written: binary,
//! little-endian, double precision. Source: G. Turk, "The PLY Polygon File Format", Stanford, 1994.

use super::binary::{Order, Scalar};
use super::cells::Sorter;
use super::numbers::Numbers;
use super::text::Text;
use super::{CellKind, Content, Fault, Field, Written, left_out};
use std::io::Write as _;

/// A property of an element.
struct Property {
    name: String,
    /// The type of the length, for a list.
    length: Option<Scalar>,
    scalar: Scalar,
}

/// An element as the header describes it.
struct Element {
    name: String,
    count: usize,
    at: usize,
    properties: Vec<Property>,
}

/// Whether the first line is `ply`.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r\n")
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Content, Fault> {
    let mut numbers = Numbers::new(bytes, None);
    let elements = read_header(bytes, &mut numbers)?;
    let mut points = Vec::new();
    let mut point_data = Vec::new();
    let mut face_data = Vec::new();
    let mut sorter = Sorter::default();
    let mut notices = Vec::new();
    let mut vertices_seen = false;
    for element in &elements {
        // Each number takes at least its bytes, each list at least those of its length.
        let least: usize = element
            .properties
            .iter()
            .map(|property| property.length.unwrap_or(property.scalar).size())
            .sum();
        if numbers.is_binary() {
            numbers.can_follow(element.count, 1, least, format_args!("elements {:?}", element.name))?;
        } else {
            numbers.can_follow(
                element.count,
                element.properties.len(),
                1,
                format_args!("elements {:?}", element.name),
            )?;
        }
        match element.name.as_str() {
            "vertex" if !vertices_seen => {
                vertices_seen = true;
                read_vertices(&mut numbers, element, &mut points, &mut point_data, &mut notices)?;
            }
            "face" if face_data.is_empty() && sorter.seen() == 0 => {
                read_faces(
                    &mut numbers,
                    element,
                    points.len(),
                    &mut sorter,
                    &mut face_data,
                    &mut notices,
                )?;
            }
            "tristrips" => {
                return Err(Fault::text(
                    element.at,
                    "triangle strips are not read; write the faces as single polygons",
                ));
            }
            _ => {
                if element.count > 0 {
                    notices.push(format!("elements {:?} left out: {}", element.name, element.count));
                }
                if !element.properties.is_empty() {
                    for _ in 0..element.count {
                        for property in &element.properties {
                            skip(&mut numbers, property)?;
                        }
                    }
                }
            }
        }
    }
    if !vertices_seen {
        return Err(Fault::whole("there is no element \"vertex\"; the file has no points"));
    }
    if !numbers.is_binary() && numbers.text.peek().is_some() {
        return Err(numbers
            .text
            .next_is_not(format_args!("the end of the file (or a count is too small)")));
    }
    let mut content = sorter.finish(points, point_data, face_data)?;
    content.notices.extend(notices);
    Ok(content)
}

/// Reads the header and sets the form of the numbers.
fn read_header(bytes: &[u8], numbers: &mut Numbers<'_>) -> Result<Vec<Element>, Fault> {
    let mut elements: Vec<Element> = Vec::new();
    let mut form_seen = false;
    numbers.text.line();
    loop {
        let start = numbers.text.at();
        if numbers.text.line().is_none() {
            return Err(numbers.text.ended(format_args!("a line of the header, or end_header")));
        }
        let mut words = Text::part(bytes, start, numbers.text.at(), None);
        match words.word() {
            None | Some(b"comment" | b"obj_info") => {}
            Some(b"format") => {
                form_seen = true;
                let form = words.need(format_args!("ascii, binary_little_endian or binary_big_endian"))?;
                match form {
                    b"ascii" => {}
                    b"binary_little_endian" => numbers.set_binary(Order::Little),
                    b"binary_big_endian" => numbers.set_binary(Order::Big),
                    _ => return Err(words.not(form, format_args!("ascii, binary_little_endian or binary_big_endian"))),
                }
            }
            Some(b"element") => {
                let name = String::from_utf8_lossy(words.need(format_args!("the name of an element"))?).into_owned();
                let count = words.integer(format_args!("the number of elements {name:?}"))?;
                let count = usize::try_from(count).map_err(|_| {
                    Fault::text(
                        start,
                        format!("there are {count} elements {name:?}; the number cannot be negative"),
                    )
                })?;
                elements.push(Element {
                    name,
                    count,
                    at: start,
                    properties: Vec::new(),
                });
            }
            Some(b"property") => {
                let mut kind = words.need(format_args!("the type of a property"))?;
                let mut length = None;
                if kind == b"list" {
                    length = Some(scalar(&mut words)?);
                    if matches!(length, Some(Scalar::Float32 | Scalar::Float64)) {
                        return Err(Fault::text(
                            start,
                            "the length of a list is a real number; make it an integer type",
                        ));
                    }
                    kind = words.peek().unwrap_or_default();
                    words.word();
                }
                let scalar = named(kind)
                    .ok_or_else(|| words.not(kind, format_args!("a type such as int, uchar, float or double")))?;
                let name = String::from_utf8_lossy(words.need(format_args!("the name of a property"))?).into_owned();
                let element = elements
                    .last_mut()
                    .ok_or_else(|| Fault::text(start, "a property comes before any element; put the element first"))?;
                element.properties.push(Property { name, length, scalar });
            }
            Some(b"end_header") => break,
            Some(word) => {
                return Err(words.not(
                    word,
                    format_args!("a word of the header (format, element, property, comment, end_header)"),
                ));
            }
        }
    }
    if !form_seen {
        return Err(Fault::whole(
            "the header has no line \"format\"; add `format ascii 1.0` or a binary one",
        ));
    }
    Ok(elements)
}

fn scalar(words: &mut Text<'_>) -> Result<Scalar, Fault> {
    let word = words.need(format_args!("a type of numbers"))?;
    named(word).ok_or_else(|| words.not(word, format_args!("a type such as int, uchar, float or double")))
}

fn named(word: &[u8]) -> Option<Scalar> {
    Some(match word {
        b"char" | b"int8" => Scalar::Int8,
        b"uchar" | b"uint8" => Scalar::UInt8,
        b"short" | b"int16" => Scalar::Int16,
        b"ushort" | b"uint16" => Scalar::UInt16,
        b"int" | b"int32" => Scalar::Int32,
        b"uint" | b"uint32" => Scalar::UInt32,
        b"float" | b"float32" => Scalar::Float32,
        b"double" | b"float64" => Scalar::Float64,
        _ => return None,
    })
}

/// The length of a list, checked against the bytes that are left.
fn length(numbers: &mut Numbers<'_>, property: &Property, kind: Scalar) -> Result<usize, Fault> {
    let length = numbers.count(kind, format_args!("the length of a list {:?}", property.name))?;
    numbers.can_follow(
        length,
        1,
        property.scalar.size(),
        format_args!("numbers of a list {:?}", property.name),
    )?;
    Ok(length)
}

fn skip(numbers: &mut Numbers<'_>, property: &Property) -> Result<(), Fault> {
    let count = match property.length {
        Some(kind) => length(numbers, property, kind)?,
        None => 1,
    };
    for _ in 0..count {
        numbers.real(property.scalar, format_args!("a number of {:?}", property.name))?;
    }
    Ok(())
}

/// Where the number of a property goes.
#[derive(Clone, Copy)]
enum Use {
    Coordinate(usize),
    Corners,
    Field(usize),
    Nothing,
}

/// The use of every property; scalars that are not `taken` become fields, other lists are left out with a notice.
fn uses(
    element: &Element,
    taken: impl Fn(&Property) -> Option<Use>,
    fields: &mut Vec<Field>,
    notices: &mut Vec<String>,
) -> Vec<Use> {
    let mut uses = Vec::new();
    for property in &element.properties {
        uses.push(match (taken(property), property.length) {
            (Some(taken), _) => taken,
            (None, Some(_)) => {
                notices.push(format!(
                    "the lists {:?} of elements {:?} left out",
                    property.name, element.name
                ));
                Use::Nothing
            }
            (None, None) => {
                fields.push(Field {
                    name: property.name.clone(),
                    components: 1,
                    values: Vec::with_capacity(element.count),
                });
                Use::Field(fields.len() - 1)
            }
        });
    }
    uses
}

fn read_vertices(
    numbers: &mut Numbers<'_>,
    element: &Element,
    points: &mut Vec<[f64; 3]>,
    fields: &mut Vec<Field>,
    notices: &mut Vec<String>,
) -> Result<(), Fault> {
    for axis in ["x", "y", "z"] {
        let found = element
            .properties
            .iter()
            .filter(|property| property.name == axis && property.length.is_none());
        if found.count() != 1 {
            return Err(Fault::text(
                element.at,
                format!("vertices need exactly one property {axis:?}"),
            ));
        }
    }
    let taken = |property: &Property| {
        let axis = ["x", "y", "z"].iter().position(|axis| *axis == property.name)?;
        property.length.is_none().then_some(Use::Coordinate(axis))
    };
    let uses = uses(element, taken, fields, notices);
    points.reserve(element.count);
    for index in 0..element.count {
        let mut point = [0.0; 3];
        for (property, &used) in element.properties.iter().zip(&uses) {
            match used {
                Use::Coordinate(axis) => {
                    let what = format_args!("{} of vertex {index} (from 0)", property.name);
                    point[axis] = numbers.finite(property.scalar, what)?;
                }
                Use::Field(place) => {
                    let what = format_args!("{:?} of vertex {index} (from 0)", property.name);
                    fields[place].values.push(numbers.real(property.scalar, what)?);
                }
                Use::Corners | Use::Nothing => skip(numbers, property)?,
            }
        }
        points.push(point);
    }
    Ok(())
}

fn read_faces(
    numbers: &mut Numbers<'_>,
    element: &Element,
    points: usize,
    sorter: &mut Sorter,
    fields: &mut Vec<Field>,
    notices: &mut Vec<String>,
) -> Result<(), Fault> {
    let is_corners = |property: &Property| {
        property.length.is_some() && matches!(property.name.as_str(), "vertex_indices" | "vertex_index")
    };
    if element
        .properties
        .iter()
        .filter(|property| is_corners(property))
        .count()
        != 1
    {
        return Err(Fault::text(
            element.at,
            "faces need exactly one list \"vertex_indices\" of their corners",
        ));
    }
    let taken = |property: &Property| is_corners(property).then_some(Use::Corners);
    let uses = uses(element, taken, fields, notices);
    let mut corners = Vec::new();
    for index in 0..element.count {
        for (property, &used) in element.properties.iter().zip(&uses) {
            match (used, property.length) {
                (Use::Corners, Some(kind)) => {
                    let count = length(numbers, property, kind)?;
                    corners.clear();
                    for _ in 0..count {
                        let what = format_args!("a corner of face {index} (from 0)");
                        corners.push(numbers.index(property.scalar, points, what)?);
                    }
                    sorter
                        .polygon(&corners)
                        .map_err(|message| numbers.fault(format!("face {index} (from 0): {message}")))?;
                }
                (Use::Field(place), _) => {
                    let what = format_args!("{:?} of face {index} (from 0)", property.name);
                    fields[place].values.push(numbers.real(property.scalar, what)?);
                }
                _ => skip(numbers, property)?,
            }
        }
    }
    Ok(())
}

/// Whether a field fits one scalar property.
fn holds(field: &Field) -> bool {
    let own = matches!(
        field.name.as_str(),
        "x" | "y" | "z" | "vertex_indices" | "vertex_index" | ""
    );
    field.components == 1
        && !own
        && !field
            .name
            .contains(|letter: char| letter.is_whitespace() || letter.is_control())
}

/// Writes a binary file.
pub(super) fn write(content: &Content) -> Result<Written, String> {
    let cells = content.cells();
    let point_data: Vec<&Field> = content.point_data.iter().filter(|field| holds(field)).collect();
    let cell_data: Vec<&Field> = content.cell_data.iter().filter(|field| holds(field)).collect();
    let mut out = Vec::with_capacity(24 * content.points.len() + 17 * cells.count() + 512);
    // Writing to memory cannot fail.
    let _ = write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
        content.points.len()
    );
    for axis in ["x", "y", "z"] {
        let _ = writeln!(out, "property double {axis}");
    }
    for field in &point_data {
        let _ = writeln!(out, "property double {}", field.name);
    }
    let _ = write!(
        out,
        "element face {}\nproperty list uchar uint vertex_indices\n",
        cells.count()
    );
    for field in &cell_data {
        let _ = writeln!(out, "property double {}", field.name);
    }
    out.extend_from_slice(b"end_header\n");
    for (row, point) in content.points.iter().enumerate() {
        for coordinate in point {
            out.extend_from_slice(&coordinate.to_le_bytes());
        }
        for field in &point_data {
            out.extend_from_slice(&field.values[row].to_le_bytes());
        }
    }
    let faces = CellKind::SURFACE
        .into_iter()
        .flat_map(|kind| cells.corners_of(kind).chunks_exact(kind.corners()));
    for (row, corners) in faces.enumerate() {
        out.push(corners.len() as u8);
        for corner in corners {
            out.extend_from_slice(&corner.to_le_bytes());
        }
        for field in &cell_data {
            out.extend_from_slice(&field.values[row].to_le_bytes());
        }
    }
    Ok(Written {
        bytes: out,
        notices: left_out("PLY", content, |field, _| holds(field)),
    })
}
