//! Mesh files: one reader and writer a file, one list of them by extension and content.
//!
//! Guarantees: readers take bytes and open nothing; a damaged file is an error that names its place, never a panic; a
//! count is compared with the bytes that are left before memory is taken for it; indices are within range and coordinates
//! are finite when a reader returns; what a file holds beyond [`Content`] is named in its notices. Text writers print the
//! shortest decimals that read back to the same bits.
//!
//! Not guaranteed: anything about the mesh itself. Orientation, duplicated cells and unused points are kept as they are.

mod binary;
mod cells;
mod numbers;
mod text;

pub mod gmsh;
mod medit;
mod mfem;
mod obj;
mod off;
mod ply;
mod stl;
mod vtk;
pub mod vtu;

pub use cells::{CellKind, Cells};
pub use obj::quad_corner_normals;

use std::fmt;

/// The name of the field that carries the integer labels of MEDIT (references) and Gmsh (physical groups).
pub const REFERENCE: &str = "reference";

/// Numbers given on every point or every cell: `values` holds `components` numbers for each, one row after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    pub name: String,
    pub components: usize,
    pub values: Vec<f64>,
}

/// What a mesh file holds. Cells are sorted by kind and keep the order of the file within a kind.
///
/// Corners are numbered as in VTK and Gmsh: a tetrahedron (0,1,2,3) is positive when `det[x1-x0, x2-x0, x3-x0] > 0`; a
/// hexahedron lists its bottom quad, then the top one; a prism its bottom triangle, then the top one; a pyramid its base,
/// then the apex. Some VTK files, by an older reading of its guide, have the prism's triangles the other way round;
/// they are kept as they are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Content {
    /// In the units of the file.
    pub points: Vec<[f64; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub quads: Vec<[u32; 4]>,
    pub tetrahedra: Vec<[u32; 4]>,
    pub hexahedra: Vec<[u32; 8]>,
    pub prisms: Vec<[u32; 6]>,
    pub pyramids: Vec<[u32; 5]>,
    /// One row a point.
    pub point_data: Vec<Field>,
    /// One row a cell: triangles, quads, tetrahedra, hexahedra, prisms, pyramids, in this order.
    pub cell_data: Vec<Field>,
    /// What was left out or changed while reading, one sentence each.
    pub notices: Vec<String>,
}

impl Content {
    /// The cells without the points.
    pub fn cells(&self) -> Cells<'_> {
        Cells {
            triangles: &self.triangles,
            quads: &self.quads,
            tetrahedra: &self.tetrahedra,
            hexahedra: &self.hexahedra,
            prisms: &self.prisms,
            pyramids: &self.pyramids,
        }
    }
}

/// A file's bytes in some format, and what of the content that format could not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    pub bytes: Vec<u8>,
    pub notices: Vec<String>,
}

/// A format of mesh files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Medit,
    Mfem,
    Gmsh,
    /// Version 2.2, for programs that do not know 4.1.
    Gmsh2,
    Vtk,
    Vtu,
    Obj,
    Off,
    Stl,
    Ply,
}

/// What the program knows about a format.
pub struct Entry {
    pub format: Format,
    pub name: &'static str,
    /// Without the dot, in lower case; the first is the usual one.
    pub extensions: &'static [&'static str],
    /// The kinds of cells that the format can hold.
    pub cells: &'static [CellKind],
    /// What a file of this format may hold and what is written.
    pub doc: &'static str,
    sniff: fn(&[u8]) -> bool,
    read: fn(&[u8]) -> Result<Content, Fault>,
    write: fn(&Content) -> Result<Written, String>,
}

/// All formats; the first that recognises the content of a file reads it.
pub const FORMATS: &[Entry] = &[
    Entry {
        format: Format::Medit,
        name: "MEDIT",
        extensions: &["mesh"],
        cells: &CellKind::ALL,
        doc: "ASCII; references are kept as the field `reference`",
        sniff: medit::sniff,
        read: medit::read,
        write: medit::write,
    },
    Entry {
        format: Format::Mfem,
        name: "MFEM",
        extensions: &["mfem"],
        cells: &CellKind::ALL,
        doc: "text, straight cells; attributes are kept as the field `reference`",
        sniff: mfem::sniff,
        read: mfem::read,
        write: mfem::write,
    },
    Entry {
        format: Format::Gmsh,
        name: "Gmsh 4.1",
        extensions: &["msh", "msh4"],
        cells: &CellKind::ALL,
        doc: "ASCII and binary, 2.2 and 4.1; written as 4.1 in ASCII; physical groups are kept as the field `reference`",
        sniff: gmsh::sniff,
        read: gmsh::read,
        write: gmsh::write_version_4,
    },
    Entry {
        format: Format::Gmsh2,
        name: "Gmsh 2.2",
        extensions: &["msh2"],
        cells: &CellKind::ALL,
        doc: "as Gmsh 4.1, but written as 2.2",
        sniff: gmsh::sniff2,
        read: gmsh::read,
        write: gmsh::write_version_2,
    },
    Entry {
        format: Format::Vtk,
        name: "legacy VTK",
        extensions: &["vtk"],
        cells: &CellKind::ALL,
        doc: "unstructured grids and polygonal data, ASCII and binary; written as an unstructured grid in ASCII",
        sniff: vtk::sniff,
        read: vtk::read,
        write: vtk::write,
    },
    Entry {
        format: Format::Vtu,
        name: "VTU",
        extensions: &["vtu"],
        cells: &CellKind::ALL,
        doc: "VTK XML unstructured grid: ASCII, inline or appended, raw, base64 or zlib; written inline and compressed",
        sniff: vtu::sniff,
        read: vtu::read,
        write: vtu::write_content,
    },
    Entry {
        format: Format::Off,
        name: "OFF",
        extensions: &["off"],
        cells: &CellKind::SURFACE,
        doc: "text, with or without colours and normals, which are left out",
        sniff: off::sniff,
        read: off::read,
        write: off::write,
    },
    Entry {
        format: Format::Ply,
        name: "PLY",
        extensions: &["ply"],
        cells: &CellKind::SURFACE,
        doc: "ASCII and binary with any properties; written in binary",
        sniff: ply::sniff,
        read: ply::read,
        write: ply::write,
    },
    Entry {
        format: Format::Stl,
        name: "STL",
        extensions: &["stl"],
        cells: &[CellKind::Triangle],
        doc: "ASCII and binary, vertices welded where equal; written in binary",
        sniff: stl::sniff,
        read: stl::read,
        write: stl::write,
    },
    Entry {
        format: Format::Obj,
        name: "OBJ",
        extensions: &["obj"],
        cells: &CellKind::SURFACE,
        doc: "vertices and faces; groups, materials, normals and textures are left out",
        sniff: obj::sniff,
        read: obj::read,
        write: obj::write,
    },
];

impl Format {
    /// The format that a file name's extension stands for.
    pub fn of_name(name: &str) -> Option<Format> {
        let (_, extension) = name.rsplit_once('.')?;
        let extension = extension.to_ascii_lowercase();
        let entry = FORMATS
            .iter()
            .find(|entry| entry.extensions.contains(&extension.as_str()))?;
        Some(entry.format)
    }

    /// The format that a file's first bytes show, where they do.
    pub fn of_content(bytes: &[u8]) -> Option<Format> {
        let entry = FORMATS.iter().find(|entry| (entry.sniff)(bytes))?;
        Some(entry.format)
    }

    /// What is known about the format.
    pub fn entry(self) -> &'static Entry {
        FORMATS
            .iter()
            .find(|entry| entry.format == self)
            .expect("every format is in the list")
    }
}

/// What is wrong with a mesh file, where, and how to mend it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FormatError {
    pub file: String,
    /// From 1, in text.
    pub line: Option<usize>,
    /// From 0, in binary data.
    pub byte: Option<usize>,
    pub message: String,
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.line, self.byte) {
            (Some(line), _) => write!(f, "{}:{line}: {}", self.file, self.message),
            (None, Some(byte)) => write!(f, "{}: at byte {byte}: {}", self.file, self.message),
            (None, None) => write!(f, "{}: {}", self.file, self.message),
        }
    }
}

impl std::error::Error for FormatError {}

/// A reader's error, with the place as a byte offset; [`read`] turns it into a line and adds the file's name.
#[derive(Debug)]
pub(crate) struct Fault {
    place: Place,
    message: String,
}

#[derive(Debug)]
enum Place {
    Whole,
    Text(usize),
    Binary(usize),
}

impl Fault {
    fn whole(message: impl Into<String>) -> Fault {
        Fault {
            place: Place::Whole,
            message: message.into(),
        }
    }

    fn text(at: usize, message: impl Into<String>) -> Fault {
        Fault {
            place: Place::Text(at),
            message: message.into(),
        }
    }

    fn binary(at: usize, message: impl Into<String>) -> Fault {
        Fault {
            place: Place::Binary(at),
            message: message.into(),
        }
    }

    fn in_file(self, file: &str, bytes: &[u8]) -> FormatError {
        let (line, byte) = match self.place {
            Place::Whole => (None, None),
            Place::Text(at) => (Some(text::line_of(bytes, at)), None),
            Place::Binary(at) => (None, Some(at)),
        };
        FormatError {
            file: file.to_string(),
            line,
            byte,
            message: self.message,
        }
    }
}

/// Reads a mesh file; `name` serves the messages and, where the content does not tell, the choice of the format.
///
/// # Errors
/// When the format is unknown or the file is damaged; the error names file, line or byte, and the mend.
pub fn read(name: &str, bytes: &[u8]) -> Result<Content, FormatError> {
    let by_name = Format::of_name(name);
    let by_content = Format::of_content(bytes);
    let outcome = match by_content.or(by_name) {
        _ if bytes.is_empty() => Err(Fault::whole("the file is empty; write it again")),
        _ if recognised_only(bytes).is_some() => Err(Fault::whole(recognised_only(bytes).unwrap_or_default())),
        None => Err(Fault::whole(format!(
            "neither the name nor the content tells a mesh format; known extensions: {}",
            extensions()
        ))),
        Some(format) => (format.entry().read)(bytes).map(|mut content| {
            if let Some(named) = by_name
                && by_content.is_some()
                && !(named.entry().sniff)(bytes)
            {
                content.notices.push(format!(
                    "the name says {}, the content is {}: read as that",
                    named.entry().name,
                    format.entry().name
                ));
            }
            content
        }),
    };
    outcome.map_err(|fault| fault.in_file(name, bytes))
}

/// Writes `content` in the given format.
///
/// # Errors
/// When the format cannot hold one of the kinds of cells, or the content contradicts itself.
pub fn write(format: Format, content: &Content) -> Result<Written, String> {
    let entry = format.entry();
    let cells = content.cells();
    cells.check(content.points.len())?;
    check_fields("point", &content.point_data, content.points.len())?;
    check_fields("cell", &content.cell_data, cells.count())?;
    for kind in CellKind::ALL {
        if cells.count_of(kind) > 0 && !entry.cells.contains(&kind) {
            let able: Vec<&str> = FORMATS
                .iter()
                .filter(|entry| entry.cells.contains(&kind))
                .map(|entry| entry.extensions[0])
                .collect();
            return Err(format!(
                "{} cannot hold {} ({} here); choose one of .{}",
                entry.name,
                kind.plural(),
                cells.count_of(kind),
                able.join(", .")
            ));
        }
    }
    (entry.write)(content)
}

/// The extensions of all formats, for messages.
pub fn extensions() -> String {
    let all: Vec<String> = FORMATS
        .iter()
        .flat_map(|entry| entry.extensions)
        .map(|extension| format!(".{extension}"))
        .collect();
    all.join(", ")
}

fn check_fields(of: &str, fields: &[Field], rows: usize) -> Result<(), String> {
    for field in fields {
        if field.components == 0 || field.values.len() != rows * field.components {
            return Err(format!(
                "the {of} field {:?} holds {} numbers, {} x {} are expected",
                field.name,
                field.values.len(),
                rows,
                field.components
            ));
        }
    }
    Ok(())
}

/// Formats that are told from ours, so that the message can name them.
fn recognised_only(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(&[1, 0, 0, 0]) && matches!(bytes.get(4..8), Some([1..=4, 0, 0, 0])) {
        return Some("this is a binary MEDIT file (.meshb); convert it to the ASCII form (.mesh)");
    }
    None
}

/// The field `reference` from integer labels, unless all of them are zero.
fn reference_field(labels: Vec<f64>) -> Option<Field> {
    if labels.iter().all(|&label| label == 0.0) {
        return None;
    }
    Some(Field {
        name: REFERENCE.to_string(),
        components: 1,
        values: labels,
    })
}

/// The labels of the field `reference` where it holds integers only.
fn reference_labels(fields: &[Field]) -> Option<&[f64]> {
    let field = fields
        .iter()
        .find(|field| field.name == REFERENCE && field.components == 1)?;
    let integers = field
        .values
        .iter()
        .all(|value| value.fract() == 0.0 && value.abs() <= f64::from(i32::MAX));
    integers.then_some(&field.values)
}

/// One sentence for the fields that a format cannot hold; `keeps` tells those that it can.
fn left_out(format: &str, content: &Content, keeps: impl Fn(&Field, bool) -> bool) -> Vec<String> {
    let names: Vec<&str> = content
        .point_data
        .iter()
        .filter(|field| !keeps(field, true))
        .chain(content.cell_data.iter().filter(|field| !keeps(field, false)))
        .map(|field| field.name.as_str())
        .collect();
    if names.is_empty() {
        return Vec::new();
    }
    vec![format!(
        "{format} cannot hold these fields, left out: {}",
        names.join(", ")
    )]
}
