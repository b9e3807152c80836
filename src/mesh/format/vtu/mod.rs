//! VTU: VTK's unstructured grid in XML, the format of results.
//!
//! Read: ASCII, inline base64 and appended (raw or base64) arrays, uncompressed or compressed by zlib, both byte
//! orders, both header types; one piece. Written: inline base64, little-endian, blocks of 32 KiB compressed by zlib,
//! 64-bit headers, so that the file is valid XML, every number keeps its bits, and the same content gives the same
//! bytes. Source: the VTK user's guide, 11th edition, section 19.3, "XML file formats".

mod bezier;
pub mod curved;
mod file;
mod write;

pub use bezier::{hexahedron_order, quadrilateral_order, write_bezier_hexahedra, write_bezier_quadrilaterals};
pub(super) use write::write_content;
pub use write::{FieldView, write};

use super::cells::Sorter;
use super::{Content, Fault, Field, vtk};
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use file::{File, Part};

const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Whether the bytes start as XML or a VTK XML file does.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    bytes.starts_with(b"<?xml") || bytes.starts_with(b"<VTKFile")
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Content, Fault> {
    let file = File::parse(bytes)?;
    let points = read_points(&file)?;
    let sorter = read_cells(&file, points.len())?;
    let mut point_data = Vec::new();
    let mut cell_data = Vec::new();
    for array in &file.arrays {
        let (rows, fields) = match array.part {
            Part::PointData => (file.points, &mut point_data),
            Part::CellData => (file.cells, &mut cell_data),
            Part::Points | Part::Cells => continue,
        };
        fields.push(Field {
            name: array.name.clone(),
            components: array.components,
            values: file.reals(array, rows, false)?,
        });
    }
    let mut content = sorter.finish(points, point_data, cell_data)?;
    content.notices.extend(file.notices);
    Ok(content)
}

fn read_points(file: &File<'_>) -> Result<Vec<[f64; 3]>, Fault> {
    let Some(array) = file.arrays.iter().find(|array| array.part == Part::Points) else {
        if file.points == 0 {
            return Ok(Vec::new());
        }
        return Err(Fault::whole("there is no array of points; the file is incomplete"));
    };
    if array.components != 3 {
        return Err(Fault::text(
            array.at,
            format!("points have {} coordinates here; write three", array.components),
        ));
    }
    let values = file.reals(array, file.points, true)?;
    if let Some(bad) = values.iter().position(|value| !value.is_finite()) {
        return Err(Fault::text(
            array.at,
            format!(
                "coordinate {} of point {} (from 0) is {}, not a finite number",
                bad % 3,
                bad / 3,
                values[bad]
            ),
        ));
    }
    Ok(values.as_chunks().0.to_vec())
}

fn read_cells(file: &File<'_>, points: usize) -> Result<Sorter, Fault> {
    let mut sorter = Sorter::default();
    if file.cells == 0 {
        return Ok(sorter);
    }
    let offsets_array = file.cell_array("offsets")?;
    let offsets = file.integers(offsets_array, file.cells)?;
    let types = file.integers(file.cell_array("types")?, file.cells)?;
    let connectivity_array = file.cell_array("connectivity")?;
    let length = usize::try_from(offsets.last().copied().unwrap_or(0))
        .map_err(|_| Fault::text(offsets_array.at, "the last offset is negative; the file is damaged"))?;
    let connectivity = file.integers(connectivity_array, length)?;
    let mut corners = Vec::new();
    let mut start = 0;
    for (cell, (&end, &code)) in offsets.iter().zip(&types).enumerate() {
        let range = usize::try_from(end).ok().and_then(|end| connectivity.get(start..end));
        let Some(indices) = range else {
            return Err(Fault::text(
                offsets_array.at,
                format!("the offset of cell {cell} (from 0) is {end}; it must lie between {start} and {length}"),
            ));
        };
        start += indices.len();
        corners.clear();
        for &index in indices {
            match u32::try_from(index) {
                Ok(corner) if (corner as usize) < points => corners.push(corner),
                _ => {
                    return Err(Fault::text(
                        connectivity_array.at,
                        format!("cell {cell} (from 0) names point {index}; there are {points}, counted from 0"),
                    ));
                }
            }
        }
        vtk::add_cell(&mut sorter, code, &corners)
            .map_err(|message| Fault::text(connectivity_array.at, format!("cell {cell} (from 0): {message}")))?;
    }
    Ok(sorter)
}
