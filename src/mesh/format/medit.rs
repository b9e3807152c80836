//! MEDIT's ASCII `.mesh`: sections of vertices and cells, indices from 1, an integer reference after each.
//!
//! Accepted: version and dimension on the keyword's line or the next, any order of sections, comments after `#`, two
//! dimensions (z becomes 0, with a notice), a missing `End`. Sections that [`Content`] cannot hold are left out with a
//! notice. Reference: P. Frey, "MEDIT: An interactive mesh visualization software", INRIA RT-0253, 2001, section 7.

use super::cells::Sorter;
use super::text::{Text, same, shown};
use super::{CellKind, Content, Fault, Written, left_out, reference_field, reference_labels};
use std::io::Write as _;

const SECTIONS: [(&str, CellKind); 6] = [
    ("Triangles", CellKind::Triangle),
    ("Quadrilaterals", CellKind::Quad),
    ("Tetrahedra", CellKind::Tetrahedron),
    ("Hexahedra", CellKind::Hexahedron),
    ("Prisms", CellKind::Prism),
    ("Pyramids", CellKind::Pyramid),
];

/// Whether the first words are MEDIT's.
pub(super) fn sniff(bytes: &[u8]) -> bool {
    let mut text = Text::new(bytes, Some(b'#'));
    text.word().is_some_and(|word| same(word, "MeshVersionFormatted"))
}

/// A section of cells: where its first index stands, and how many cells it has.
struct Section {
    start: usize,
    kind: CellKind,
    count: usize,
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Content, Fault> {
    let mut text = Text::new(bytes, Some(b'#'));
    let mut dimension = 3;
    let mut points: Option<Vec<[f64; 3]>> = None;
    let mut point_labels = Vec::new();
    let mut cell_labels = Vec::new();
    let mut sorter = Sorter::default();
    let mut sections: Vec<Section> = Vec::new();
    let mut notices = Vec::new();

    while let Some(word) = text.word() {
        let at = text.at() - word.len();
        if same(word, "MeshVersionFormatted") {
            let version = text.integer(format_args!("the version of the format (1 to 4)"))?;
            if !(1..=4).contains(&version) {
                return Err(Fault::text(
                    at,
                    format!("version {version} is unknown; 1 to 4 are known"),
                ));
            }
        } else if same(word, "Dimension") {
            dimension = text.integer(format_args!("the dimension (2 or 3)"))?;
            if !(2..=3).contains(&dimension) {
                return Err(Fault::text(
                    at,
                    format!("dimension {dimension} is unknown; write 2 or 3"),
                ));
            }
            if points.is_some() {
                return Err(Fault::text(
                    at,
                    "the dimension comes after the vertices; put it before them",
                ));
            }
        } else if same(word, "Vertices") {
            if points.is_some() {
                return Err(Fault::text(at, "a second section of vertices; join it with the first"));
            }
            points = Some(read_vertices(&mut text, dimension as usize, &mut point_labels)?);
        } else if same(word, "End") {
            break;
        } else if let Some(&(name, kind)) = SECTIONS.iter().find(|(name, _)| same(word, name)) {
            let corners = kind.corners();
            let count = text.count(format_args!("the number of {}", kind.plural()), 2 * (corners + 1))?;
            sections.push(Section {
                start: text.at(),
                kind,
                count,
            });
            cell_labels.reserve(count);
            let mut cell = [0u32; 8];
            for number in 1..=count {
                for corner in &mut cell[..corners] {
                    let index = text.integer(format_args!("a vertex number of {} {number}", kind.name()))?;
                    // A number that does not fit becomes one out of range; the check below names its line.
                    *corner = u32::try_from(index.saturating_sub(1)).unwrap_or(u32::MAX);
                }
                let label = text.integer(format_args!("the reference of {} {number} in {name}", kind.name()))?;
                cell_labels.push(label as f64);
                sorter.cell(kind, &cell[..corners]);
            }
        } else if word[0].is_ascii_alphabetic() {
            let count = text.peek().and_then(super::text::parse_integer);
            while text.peek().is_some_and(|next| !next[0].is_ascii_alphabetic()) {
                text.word();
            }
            notices.push(match count {
                Some(count) => format!("section {} with {count} entries left out", shown(word)),
                None => format!("section {} left out", shown(word)),
            });
        } else {
            return Err(Fault::text(
                at,
                format!(
                    "{} stands where a keyword is expected; the count of the section before is too small, or a line has too many numbers",
                    shown(word)
                ),
            ));
        }
    }

    let points =
        points.ok_or_else(|| Fault::whole("there is no section \"Vertices\"; the file is cut off or no MEDIT file"))?;
    if sorter.names_beyond(points.len()) {
        for section in &sections {
            check_indices(bytes, section, points.len())?;
        }
    }
    let point_data = reference_field(point_labels).into_iter().collect();
    let cell_data = reference_field(cell_labels).into_iter().collect();
    let mut content = sorter.finish(points, point_data, cell_data)?;
    if dimension == 2 {
        notices.push("the file is two-dimensional: z is set to 0".to_string());
    }
    content.notices.extend(notices);
    Ok(content)
}

fn read_vertices(text: &mut Text<'_>, dimension: usize, labels: &mut Vec<f64>) -> Result<Vec<[f64; 3]>, Fault> {
    let count = text.count(format_args!("the number of vertices"), 2 * (dimension + 1))?;
    let mut points = Vec::with_capacity(count);
    labels.reserve(count);
    for number in 1..=count {
        let mut point = [0.0; 3];
        for (axis, coordinate) in point[..dimension].iter_mut().enumerate() {
            *coordinate = text.finite(format_args!("coordinate {} of vertex {number}", axis + 1))?;
        }
        // Some programs write references as 0.0 or 1e0.
        labels.push(text.real(format_args!("the reference of vertex {number}"))?);
        points.push(point);
    }
    Ok(points)
}

/// Names the line of the first index of a section that is none of the vertices.
fn check_indices(bytes: &[u8], section: &Section, vertices: usize) -> Result<(), Fault> {
    let mut text = Text::new(bytes, Some(b'#'));
    text.go_to(section.start);
    let name = section.kind.name();
    for number in 1..=section.count {
        for _ in 0..section.kind.corners() {
            let index = text.integer(format_args!("a vertex number of {name} {number}"))?;
            if index < 1 || index as u64 > vertices as u64 {
                let word_start = text.at() - 1;
                return Err(Fault::text(
                    word_start,
                    format!("{name} {number} names vertex {index}; there are {vertices}, counted from 1"),
                ));
            }
        }
        text.word();
    }
    Ok(())
}

/// Writes version 2 (double precision) in three dimensions; the field `reference` becomes the references.
pub(super) fn write(content: &Content) -> Result<Written, String> {
    let mut out = Vec::with_capacity(64 * content.points.len() + 32 * content.cells().count() + 256);
    let point_labels = reference_labels(&content.point_data);
    let cell_labels = reference_labels(&content.cell_data);
    let label = |labels: Option<&[f64]>, row: usize| labels.map_or(0, |labels| labels[row] as i64);
    // Writing to memory cannot fail.
    let _ = write!(
        out,
        "MeshVersionFormatted 2\nDimension 3\nVertices\n{}\n",
        content.points.len()
    );
    for (row, [x, y, z]) in content.points.iter().enumerate() {
        let _ = writeln!(out, "{x:?} {y:?} {z:?} {}", label(point_labels, row));
    }
    let mut row = 0;
    let cells = content.cells();
    for (name, kind) in SECTIONS {
        if cells.count_of(kind) == 0 {
            continue;
        }
        let _ = write!(out, "{name}\n{}\n", cells.count_of(kind));
        for cell in cells.corners_of(kind).chunks_exact(kind.corners()) {
            for corner in cell {
                let _ = write!(out, "{} ", u64::from(*corner) + 1);
            }
            let _ = writeln!(out, "{}", label(cell_labels, row));
            row += 1;
        }
    }
    out.extend_from_slice(b"End\n");
    let keeps = |field: &super::Field, of_points: bool| {
        let fields = if of_points {
            &content.point_data
        } else {
            &content.cell_data
        };
        field.name == super::REFERENCE && reference_labels(fields).is_some()
    };
    Ok(Written {
        bytes: out,
        notices: left_out("MEDIT", content, keeps),
    })
}
