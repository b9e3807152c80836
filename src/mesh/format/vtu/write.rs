//! Writing VTU.

use super::super::{Cells, Content, Field, Written, vtk};
use super::BASE64;
use base64::Engine as _;
use std::fmt::Write as _;
use std::io::Write as _;

/// The bytes that are compressed at a time, VTK's own default.
const BLOCK: usize = 1 << 15;

/// A field as it is written: its name, the numbers per row, and the rows one after the other.
pub type FieldView<'a> = (&'a str, usize, &'a [f64]);

/// Points and cells of a document, the cells by their corners one after the other.
pub(super) struct Body<'a> {
    pub points: &'a [[f64; 3]],
    pub corners: &'a [u32],
    /// Where each cell's corners end.
    pub ends: &'a [i64],
    /// VTK's number of each cell's kind.
    pub types: &'a [u8],
}

/// A VTU file of `points`, `cells` and fields with one row a point or a cell (cells in the order of [`Content`]).
///
/// # Panics
/// When a field does not have a row for every point or cell.
pub fn write(
    points: &[[f64; 3]],
    cells: Cells<'_>,
    point_data: &[FieldView<'_>],
    cell_data: &[FieldView<'_>],
) -> Vec<u8> {
    let corners: Vec<u32> = cells.iter().flat_map(|(_, corners)| corners.to_vec()).collect();
    let ends = cells.iter().scan(0_i64, |end, (_, corners)| {
        *end += corners.len() as i64;
        Some(*end)
    });
    let ends: Vec<i64> = ends.collect();
    let types: Vec<u8> = cells.iter().map(|(kind, _)| vtk::code(kind)).collect();
    let body = Body {
        points,
        corners: &corners,
        ends: &ends,
        types: &types,
    };
    document("1.0", &body, point_data, cell_data)
}

/// The whole file.
pub(super) fn document(
    version: &str,
    body: &Body<'_>,
    point_data: &[FieldView<'_>],
    cell_data: &[FieldView<'_>],
) -> Vec<u8> {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        out,
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"{version}\" byte_order=\"LittleEndian\" header_type=\"UInt64\" \
         compressor=\"vtkZLibDataCompressor\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n",
        body.points.len(),
        body.types.len()
    );
    for (part, rows, fields) in [
        ("PointData", body.points.len(), point_data),
        ("CellData", body.types.len(), cell_data),
    ] {
        let _ = writeln!(out, "<{part}>");
        for &(name, components, values) in fields {
            assert_eq!(
                values.len(),
                rows * components,
                "field {name:?} has a row for each point or cell"
            );
            write_array(
                &mut out,
                name,
                "Float64",
                components,
                values.iter().flat_map(|value| value.to_le_bytes()),
            );
        }
        let _ = writeln!(out, "</{part}>");
    }
    out.push_str("<Points>\n");
    let coordinates = body.points.as_flattened().iter().flat_map(|value| value.to_le_bytes());
    write_array(&mut out, "Points", "Float64", 3, coordinates);
    out.push_str("</Points>\n<Cells>\n");
    let corners = body.corners.iter();
    // VTK takes the type that the file names; half the bytes where indices fit.
    if body.points.len() <= i32::MAX as usize {
        let bytes = corners.flat_map(|&corner| (corner as i32).to_le_bytes());
        write_array(&mut out, "connectivity", "Int32", 1, bytes);
    } else {
        let bytes = corners.flat_map(|&corner| i64::from(corner).to_le_bytes());
        write_array(&mut out, "connectivity", "Int64", 1, bytes);
    }
    let ends = body.ends.iter().flat_map(|end| end.to_le_bytes());
    write_array(&mut out, "offsets", "Int64", 1, ends);
    write_array(&mut out, "types", "UInt8", 1, body.types.iter().copied());
    out.push_str("</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
    out.into_bytes()
}

fn write_array(out: &mut String, name: &str, kind: &str, components: usize, bytes: impl Iterator<Item = u8>) {
    let bytes: Vec<u8> = bytes.collect();
    let mut header = vec![
        bytes.len().div_ceil(BLOCK) as u64,
        BLOCK as u64,
        (bytes.len() % BLOCK) as u64,
    ];
    let mut packed = Vec::with_capacity(bytes.len() / 2);
    for block in bytes.chunks(BLOCK) {
        let before = packed.len();
        let mut encoder = flate2::write::ZlibEncoder::new(packed, flate2::Compression::fast());
        let written = encoder.write_all(block).and_then(|()| encoder.finish());
        packed = written.expect("memory takes every byte");
        header.push((packed.len() - before) as u64);
    }
    let header: Vec<u8> = header.iter().flat_map(|size| size.to_le_bytes()).collect();
    let _ = writeln!(
        out,
        "<DataArray type=\"{kind}\" Name=\"{}\" NumberOfComponents=\"{components}\" format=\"binary\">",
        quick_xml::escape::escape(name)
    );
    BASE64.encode_string(header, out);
    BASE64.encode_string(packed, out);
    out.push_str("\n</DataArray>\n");
}

/// Writes the whole of `content`.
pub(crate) fn write_content(content: &Content) -> Result<Written, String> {
    Ok(Written {
        bytes: write(
            &content.points,
            content.cells(),
            &views(&content.point_data),
            &views(&content.cell_data),
        ),
        notices: Vec::new(),
    })
}

fn views(fields: &[Field]) -> Vec<FieldView<'_>> {
    fields
        .iter()
        .map(|field| (field.name.as_str(), field.components, field.values.as_slice()))
        .collect()
}
