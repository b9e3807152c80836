//! Mesh files keep what they can hold, bit for bit, through every format that takes them.

use proptest::prelude::*;
use vargeo::mesh::format::{self, CellKind, Cells, Content, FORMATS, Field, Format, vtu};

pub(crate) fn extension(format: Format) -> &'static str {
    format.entry().extensions[0]
}

fn round_trip(format: Format, content: &Content) -> Content {
    let written = format::write(format, content).expect("the format holds these cells");
    let name = format!("trip.{}", extension(format));
    format::read(&name, &written.bytes).unwrap_or_else(|error| panic!("{error}"))
}

/// Points as bits, so that a negative zero counts.
fn bits(points: &[[f64; 3]]) -> Vec<[u64; 3]> {
    points.iter().map(|point| point.map(f64::to_bits)).collect()
}

pub(crate) fn field(name: &str, components: usize, values: Vec<f64>) -> Field {
    Field {
        name: name.to_string(),
        components,
        values,
    }
}

/// Every kind of cells, awkward coordinates, and fields of one and three components.
pub(crate) fn sample(kinds: &[CellKind]) -> Content {
    let points = vec![
        [0.1, -0.0, 1.0 / 3.0],
        [f64::MIN_POSITIVE, 5e-324, -1.7976931348623157e308],
        [1e16, 123456789.12345679, -1e-7],
        [2.0, 0.0, 3.0],
        [0.30000000000000004, 1e-300, 1.0],
        [1.0, 2.0, 4.0],
        [7.0, 8.0, 9.0],
        [0.5, 0.25, 0.125],
        [-1.0, -2.0, -3.0],
    ];
    let has = |kind| kinds.contains(&kind);
    let mut content = Content {
        triangles: if has(CellKind::Triangle) {
            vec![[0, 1, 2], [8, 7, 6]]
        } else {
            vec![]
        },
        quads: if has(CellKind::Quad) {
            vec![[3, 4, 5, 6]]
        } else {
            vec![]
        },
        tetrahedra: if has(CellKind::Tetrahedron) {
            vec![[0, 1, 2, 3], [4, 3, 2, 8]]
        } else {
            vec![]
        },
        hexahedra: if has(CellKind::Hexahedron) {
            vec![[7, 6, 5, 4, 3, 2, 1, 0]]
        } else {
            vec![]
        },
        prisms: if has(CellKind::Prism) {
            vec![[0, 1, 2, 3, 4, 5]]
        } else {
            vec![]
        },
        pyramids: if has(CellKind::Pyramid) {
            vec![[0, 1, 2, 3, 4]]
        } else {
            vec![]
        },
        ..Content::default()
    };
    let cells = content.cells().count();
    let ramp = |count: usize| (0..count).map(|row| row as f64 * 0.1 - 0.3).collect::<Vec<f64>>();
    content.point_data = vec![
        field("height", 1, ramp(points.len())),
        field("flow", 3, ramp(3 * points.len())),
    ];
    content.cell_data = vec![
        field(format::REFERENCE, 1, (0..cells).map(|row| (row % 3) as f64).collect()),
        field("stretch", 1, ramp(cells)),
    ];
    content.points = points;
    content
}

#[test]
fn every_format_keeps_points_and_cells() {
    for entry in FORMATS {
        let mut content = sample(entry.cells);
        if entry.format == Format::Stl {
            // Single precision, and no vertex without a triangle.
            content.points = (0..9).map(|row| [row as f64, 0.5 - row as f64, 0.25]).collect();
            content.points.truncate(6);
            content.triangles = vec![[0, 1, 2], [3, 2, 1], [3, 4, 5]];
            content.point_data.clear();
            content.cell_data.clear();
        }
        let back = round_trip(entry.format, &content);
        assert_eq!(bits(&back.points), bits(&content.points), "{}", entry.name);
        for kind in CellKind::ALL {
            assert_eq!(
                back.cells().corners_of(kind),
                content.cells().corners_of(kind),
                "{}, {}",
                entry.name,
                kind.plural()
            );
        }
        assert!(back.notices.is_empty(), "{}: {:?}", entry.name, back.notices);
        // The same content gives the same bytes, also once it was read.
        let written = format::write(entry.format, &content).expect("the format holds these cells");
        let again = format::write(entry.format, &back).expect("the format holds these cells");
        assert_eq!(written.bytes, again.bytes, "{}", entry.name);
        // The content alone tells the format.
        let nameless = format::read("nameless", &written.bytes).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(nameless, back, "{}", entry.name);
    }
}

#[test]
fn fields_are_kept_or_named_as_left_out() {
    let content = sample(&[CellKind::Triangle, CellKind::Quad]);
    let names = |fields: &[Field]| fields.iter().map(|field| field.name.clone()).collect::<Vec<_>>();
    for (format, point_fields, cell_fields) in [
        (Format::Vtu, vec!["height", "flow"], vec!["reference", "stretch"]),
        (Format::Vtk, vec!["height", "flow"], vec!["reference", "stretch"]),
        (Format::Gmsh, vec!["height", "flow"], vec!["reference", "stretch"]),
        (Format::Gmsh2, vec!["height", "flow"], vec!["reference", "stretch"]),
        (Format::Ply, vec!["height"], vec!["reference", "stretch"]),
        (Format::Medit, vec![], vec!["reference"]),
        (Format::Obj, vec![], vec![]),
        (Format::Off, vec![], vec![]),
    ] {
        let back = round_trip(format, &content);
        assert_eq!(names(&back.point_data), point_fields, "{format:?}");
        assert_eq!(names(&back.cell_data), cell_fields, "{format:?}");
        for kept in back.point_data.iter().chain(&back.cell_data) {
            let given = content
                .point_data
                .iter()
                .chain(&content.cell_data)
                .find(|field| field.name == kept.name);
            assert_eq!(Some(kept), given, "{format:?}");
        }
        let notices = format::write(format, &content).expect("surfaces fit").notices.join(" ");
        for given in content.point_data.iter().chain(&content.cell_data) {
            let kept = back
                .point_data
                .iter()
                .chain(&back.cell_data)
                .any(|field| field.name == given.name);
            assert_ne!(
                kept,
                notices.contains(&given.name),
                "{format:?}, {}: {notices}",
                given.name
            );
        }
    }
}

#[test]
fn fields_that_are_not_finite_survive_in_binary() {
    let mut content = sample(&[CellKind::Tetrahedron]);
    content.point_data = vec![field(
        "odd",
        1,
        vec![f64::NAN, f64::INFINITY, -0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
    )];
    for format in [Format::Vtu, Format::Vtk, Format::Gmsh] {
        let back = round_trip(format, &content);
        let bits = |content: &Content| {
            content.point_data[0]
                .values
                .iter()
                .map(|value| value.to_bits())
                .collect::<Vec<_>>()
        };
        assert_eq!(bits(&back), bits(&content), "{format:?}");
    }
}

#[test]
fn a_surface_format_refuses_volumes_and_names_those_that_hold_them() {
    for entry in FORMATS {
        let content = sample(&CellKind::ALL);
        let outcome = format::write(entry.format, &content);
        if entry.cells.len() == CellKind::ALL.len() {
            assert!(outcome.is_ok(), "{}", entry.name);
        } else {
            let message = outcome.expect_err("volumes do not fit");
            assert!(message.contains("cannot hold") && message.contains(".vtu"), "{message}");
        }
    }
}

#[test]
fn a_result_in_vtu_comes_back_with_the_same_bits_and_bytes() {
    // More than one block of 32 KiB.
    let points: Vec<[f64; 3]> = (0..5000)
        .map(|row| {
            let angle = f64::from(row) * 0.37;
            [angle.sin(), angle.cos(), angle.sqrt()]
        })
        .collect();
    let tetrahedra: Vec<[u32; 4]> = (0..4990).map(|row| [row, row + 3, row + 5, row + 9]).collect();
    let stretch: Vec<f64> = (0..tetrahedra.len()).map(|row| (row as f64).ln()).collect();
    let cells = Cells {
        tetrahedra: &tetrahedra,
        ..Cells::default()
    };
    let fields: [vtu::FieldView<'_>; 1] = [("stretch <&> \"größe\"", 1, &stretch)];
    let rest: [vtu::FieldView<'_>; 1] = [("rest", 3, points.as_flattened())];
    let bytes = vtu::write(&points, cells, &rest, &fields);
    assert_eq!(bytes, vtu::write(&points, cells, &rest, &fields));
    let back = format::read("result.vtu", &bytes).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(bits(&back.points), bits(&points));
    assert_eq!(back.tetrahedra, tetrahedra);
    assert_eq!(back.point_data, [field("rest", 3, points.as_flattened().to_vec())]);
    assert_eq!(back.cell_data, [field(fields[0].0, 1, stretch.clone())]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Any finite coordinates and any tetrahedra come back with the same bits, in text and in binary.
    #[test]
    fn any_tetrahedra_survive_any_volume_format(
        points in prop::collection::vec(prop::array::uniform3(any::<f64>().prop_filter("finite", |value| value.is_finite())), 1..40),
        corners in prop::collection::vec(prop::array::uniform4(any::<u32>()), 0..40),
    ) {
        let count = points.len() as u32;
        let tetrahedra: Vec<[u32; 4]> = corners.iter().map(|cell| cell.map(|corner| corner % count)).collect();
        let content = Content { points, tetrahedra, ..Content::default() };
        for entry in FORMATS.iter().filter(|entry| entry.cells.contains(&CellKind::Tetrahedron)) {
            let back = round_trip(entry.format, &content);
            prop_assert_eq!(bits(&back.points), bits(&content.points), "{}", entry.name);
            prop_assert_eq!(&back.tetrahedra, &content.tetrahedra, "{}", entry.name);
        }
    }
}
