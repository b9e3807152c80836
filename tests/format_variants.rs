//! Mesh files of other programs are read whole in every variant: headers, versions, encodings, byte orders, layouts.

use crate::formats::{extension, field, sample};
use vargeo::mesh::format::{self, Content, FORMATS, Format};

/// A tetrahedron and its points, as most of the hand-written files below describe them.
fn assert_tetrahedron(name: &str, bytes: &[u8]) -> Content {
    let content = format::read(name, bytes).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        content.points,
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, 1.0]]
    );
    assert_eq!(content.tetrahedra, [[0, 1, 2, 3]]);
    content
}

#[test]
fn medit_headers_in_every_variant() {
    let body = "Vertices\n4\n0 0 0 0\n1 0 0 0\n0 1.5D0 0 0\n0 0 1. 0\nTetrahedra\n1\n1 2 3 4 7\n";
    for header in [
        "MeshVersionFormatted 1\nDimension 3\n",
        "MeshVersionFormatted\n2\n\nDimension\n3\n",
        "# made by hand\n MeshVersionFormatted 2 # double\r\nDimension 3\r\n",
        "meshversionformatted 3 dimension 3 ",
        "\u{feff}MeshVersionFormatted 1\n",
    ] {
        for end in ["End\n", "END", "", "\n# the end"] {
            let text = format!("{header}{body}{end}");
            let content = assert_tetrahedron("t.mesh", text.as_bytes());
            assert_eq!(content.cell_data, [field("reference", 1, vec![7.0])]);
            assert!(content.notices.is_empty());
        }
    }
    // Cells before vertices, sections that are left out, and two dimensions.
    let text = "MeshVersionFormatted 2\nDimension 3\nTetrahedra 1\n1 2 3 4 0\nCorners 2\n1\n2\nRequiredTriangles\n0\nNormals 1\n0 0 -1e-3\n\
                Vertices 4\n0 0 0 0 1 0 0 0 0 1.5 0 0 0 0 1 0\nEnd";
    let content = assert_tetrahedron("t.mesh", text.as_bytes());
    assert_eq!(content.notices.len(), 3, "{:?}", content.notices);
    assert!(content.notices[0].contains("Corners") && content.notices[0].contains('2'));
    assert!(content.cell_data.is_empty());
    let flat = "MeshVersionFormatted 1 Dimension 2 Vertices 3 0 0 1 1 0 1 0 1 1 Triangles 1 1 2 3 0 End";
    let content = format::read("t.mesh", flat.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(content.points[2], [0.0, 1.0, 0.0]);
    assert!(content.notices[0].contains("two-dimensional"));
}

/// Bytes of a binary file, in either order.
struct Bytes {
    bytes: Vec<u8>,
    big: bool,
}

impl Bytes {
    fn new(big: bool) -> Bytes {
        Bytes { bytes: Vec::new(), big }
    }

    fn put<const N: usize>(&mut self, mut number: [u8; N]) {
        if self.big {
            number.reverse();
        }
        self.bytes.extend_from_slice(&number);
    }

    fn text(&mut self, text: &str) -> &mut Bytes {
        self.bytes.extend_from_slice(text.as_bytes());
        self
    }

    fn ints(&mut self, numbers: &[i32]) -> &mut Bytes {
        numbers.iter().for_each(|number| self.put(number.to_le_bytes()));
        self
    }

    fn sizes(&mut self, numbers: &[u64]) -> &mut Bytes {
        numbers.iter().for_each(|number| self.put(number.to_le_bytes()));
        self
    }

    fn reals(&mut self, numbers: &[f64]) -> &mut Bytes {
        numbers.iter().for_each(|number| self.put(number.to_le_bytes()));
        self
    }
}

const CORNERS: [f64; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0, 1.0];

fn gmsh_2_binary(big: bool) -> Vec<u8> {
    let mut file = Bytes::new(big);
    file.text("$MeshFormat\n2.2 1 8\n")
        .ints(&[1])
        .text("\n$EndMeshFormat\n$Nodes\n4\n");
    for (row, point) in CORNERS.chunks(3).enumerate() {
        file.ints(&[[10, 20, 7, 40][row]]).reals(point);
    }
    file.text("\n$EndNodes\n$Elements\n2\n")
        .ints(&[15, 1, 2, 1, 0, 1, 10])
        .ints(&[4, 1, 2, 5, 9, 1, 10, 20, 7, 40]);
    file.text("\n$EndElements\n$NodeData\n1\n\"depth\"\n1\n0\n3\n0\n1\n4\n");
    for (node, value) in [(10, 1.0), (20, 2.0), (7, 3.0), (40, 4.0)] {
        file.ints(&[node]).reals(&[value]);
    }
    file.text("\n$EndNodeData\n");
    file.bytes
}

fn gmsh_4_binary(big: bool) -> Vec<u8> {
    let mut file = Bytes::new(big);
    file.text("$MeshFormat\n4.1 1 8\n")
        .ints(&[1])
        .text("\n$EndMeshFormat\n$Entities\n")
        .sizes(&[0, 0, 0, 1]);
    file.ints(&[1])
        .reals(&[0.0; 6])
        .sizes(&[1])
        .ints(&[9])
        .sizes(&[0])
        .text("\n$EndEntities\n$Nodes\n");
    file.sizes(&[1, 4, 7, 40])
        .ints(&[3, 1, 0])
        .sizes(&[4, 10, 20, 7, 40])
        .reals(&CORNERS)
        .text("\n$EndNodes\n$Elements\n");
    file.sizes(&[1, 1, 5, 5])
        .ints(&[3, 1, 4])
        .sizes(&[1, 5, 10, 20, 7, 40])
        .text("\n$EndElements\n");
    file.bytes
}

#[test]
fn gmsh_in_both_versions_encodings_and_byte_orders() {
    // Numbers of nodes with gaps and out of order, a physical group, a line that is left out, and data.
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Comments\nby hand\n$EndComments\n$PhysicalNames\n1\n3 9 \"body\"\n$EndPhysicalNames\n\
                $Nodes\n4\n10 0 0 0\n20 1 0 0\n7 0 1.5 0\n40 0 0 1\n$EndNodes\n\
                $Elements\n2\n1 1 2 0 1 10 20\n5 4 3 9 1 0 10 20 7 40\n$EndElements\n\
                $ElementData\n1\n\"quality\"\n1\n0.0\n3\n0\n1\n1\n5 0.75\n$EndElementData\n";
    let content = assert_tetrahedron("t.msh", text.as_bytes());
    assert_eq!(
        content.cell_data,
        [field("reference", 1, vec![9.0]), field("quality", 1, vec![0.75])]
    );
    assert!(
        content
            .notices
            .iter()
            .any(|notice| notice.contains("lines left out: 1")),
        "{:?}",
        content.notices
    );

    let text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n\
                $Entities\n1 0 0 1\n1 0 0 0 0\n1 0 0 0 1 1 1 1 9 0\n$EndEntities\n\
                $Nodes\n2 4 7 40\n0 1 0 1\n10\n0 0 0\n3 1 1 3\n20\n7\n40\n1 0 0 .1 .2 .3\n0 1.5 0 0 0 0\n0 0 1 0 0 0\n$EndNodes\n\
                $Elements\n2 2 1 5\n0 1 15 1\n1 10\n3 1 4 1\n5 10 20 7 40\n$EndElements\n\
                $NodeData\n1\n\"depth\"\n1\n0.0\n3\n0\n1\n4\n40 4\n10 1\n20 2\n7 3\n$EndNodeData\n";
    let content = assert_tetrahedron("t.msh", text.as_bytes());
    assert_eq!(content.cell_data, [field("reference", 1, vec![9.0])]);
    assert_eq!(content.point_data, [field("depth", 1, vec![1.0, 2.0, 3.0, 4.0])]);

    for big in [false, true] {
        let content = assert_tetrahedron("t.msh", &gmsh_2_binary(big));
        assert_eq!(content.cell_data, [field("reference", 1, vec![9.0])]);
        assert_eq!(content.point_data[0].values, [1.0, 2.0, 3.0, 4.0]);
        let content = assert_tetrahedron("t.msh", &gmsh_4_binary(big));
        assert_eq!(content.cell_data, [field("reference", 1, vec![9.0])]);
    }
    for (code, name) in [(11, "second-order tetrahedron"), (9, "second-order triangle")] {
        let text = format!(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n1\n1 {code} 2 0 1 1 1 1\n$EndElements\n"
        );
        let error = format::read("t.msh", text.as_bytes()).expect_err("higher order");
        assert!(error.message.contains(name) && error.line == Some(10), "{error}");
    }
}

fn vtk_5_binary() -> Vec<u8> {
    let mut file = Bytes::new(true);
    file.text("# vtk DataFile Version 5.1\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n")
        .reals(&CORNERS);
    file.text("\nMETADATA\nINFORMATION 0\n\nCELLS 2 4\nOFFSETS vtktypeint64\n")
        .sizes(&[0, 4]);
    file.text("\nCONNECTIVITY vtktypeint64\n")
        .sizes(&[0, 1, 2, 3])
        .text("\nCELL_TYPES 1\n")
        .ints(&[10]);
    file.text("\nCELL_DATA 1\nSCALARS q int\nLOOKUP_TABLE own\n")
        .ints(&[-5])
        .text("\nLOOKUP_TABLE own 1\n")
        .text("abcd\n");
    file.bytes
}

fn vtk_3_binary() -> Vec<u8> {
    let mut file = Bytes::new(true);
    file.text("# vtk DataFile Version 3.0\nt\nBINARY\nDATASET POLYDATA\nPOINTS 4 double\n")
        .reals(&CORNERS);
    file.text("\nPOLYGONS 2 9\n")
        .ints(&[3, 0, 1, 2, 4, 0, 1, 2, 3])
        .text("\n");
    file.bytes
}

#[test]
fn legacy_vtk_in_both_layouts_and_encodings() {
    let ascii = "# vtk DataFile Version 2.0\na title\nASCII\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData 1\nTIME 1 1 double\n0.5\n\
                 POINTS 4 float\n0 0 0 1 0 0\n0 1.5 0 0 0 1\nCELLS 2 8\n2 0 1\n4 0 1 2 3\nCELL_TYPES 2\n3\n10\n\
                 POINT_DATA 4\nSCALARS my%20height double 1\nLOOKUP_TABLE default\n1 2 3 4\nVECTORS v float\n1 2 3 1 2 3 1 2 3 1 2 3\nMETADATA\n\
                 COMPONENT_NAMES\na\n\nCELL_DATA 2\nFIELD f 1\nq 2 2 int\n1 2\n3 4\n";
    let content = assert_tetrahedron("t.vtk", ascii.as_bytes());
    assert_eq!(content.point_data[0], field("my height", 1, vec![1.0, 2.0, 3.0, 4.0]));
    assert_eq!(content.point_data[1].components, 3);
    assert_eq!(content.cell_data, [field("q", 2, vec![3.0, 4.0])]);
    assert_eq!(content.notices.len(), 2, "{:?}", content.notices);

    let content = assert_tetrahedron("t.vtk", &vtk_5_binary());
    assert_eq!(content.cell_data, [field("q", 1, vec![-5.0])]);

    let content = format::read("t.vtk", &vtk_3_binary()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((content.triangles.len(), content.quads.len()), (1, 1));

    let voxel = "# vtk DataFile Version 2.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 8 float\n0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 1 0 1 0 1 1 1 1 1\n\
                 CELLS 1 9\n8 0 1 2 3 4 5 6 7\nCELL_TYPES 1\n11\n";
    let content = format::read("t.vtk", voxel.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(content.hexahedra, [[0, 1, 3, 2, 4, 5, 7, 6]]);
    let curved = voxel.replace("CELL_TYPES 1\n11", "CELL_TYPES 1\n24");
    let error = format::read("t.vtk", curved.as_bytes()).expect_err("higher order");
    assert!(
        error.message.contains("quadratic tetrahedron") && error.line == Some(10),
        "{error}"
    );
}

/// A file of every format and encoding, all of them sound.
pub(crate) fn specimens() -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    for entry in FORMATS {
        let mut content = sample(entry.cells);
        if entry.format == Format::Stl {
            content.points.truncate(0);
            content.points.resize(9, [0.5, -1.0, 2.0]);
        }
        let written = format::write(entry.format, &content).expect("the format holds these cells");
        all.push((format!("written.{}", extension(entry.format)), written.bytes));
    }
    for big in [false, true] {
        all.push(("binary.msh".to_string(), gmsh_2_binary(big)));
        all.push(("binary.msh".to_string(), gmsh_4_binary(big)));
        all.push(("binary.ply".to_string(), ply_binary(big)));
    }
    all.push(("binary.vtk".to_string(), vtk_5_binary()));
    all.push(("polygons.vtk".to_string(), vtk_3_binary()));
    all.push(("text.ply".to_string(), ply_text()));
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    all.push((
        "text.stl".to_string(),
        format!("solid s\n{facet}{facet}endsolid s\n").into_bytes(),
    ));
    let ascii = |kind: &str, name: &str, components: usize, _: &[u8], text: &str| {
        format!(
            "<DataArray type='{kind}' Name='{name}' NumberOfComponents='{components}' format='ascii'>{text}</DataArray>"
        )
    };
    all.push(("text.vtu".to_string(), vtu_by_hand("", false, ascii, b"")));
    let mut appended = Vec::new();
    let raw = |kind: &str, name: &str, components: usize, bytes: &[u8], _: &str| {
        let offset = appended.len();
        appended.extend_from_slice(&(bytes.len() as u32).to_le_bytes());
        appended.extend_from_slice(bytes);
        format!(
            "<DataArray type='{kind}' Name='{name}' NumberOfComponents='{components}' format='appended' offset='{offset}'/>"
        )
    };
    let mut file = vtu_by_hand("", false, raw, b"<AppendedData encoding='raw'>_");
    file.truncate(file.len() - b"</VTKFile>\n".len());
    file.extend_from_slice(&appended);
    all.push(("appended.vtu".to_string(), file));
    for (name, bytes) in &all {
        format::read(name, bytes).unwrap_or_else(|error| panic!("{error}"));
    }
    all
}

/// A VTU file whose arrays are written by `array(type, name, components, bytes, text)`.
fn vtu_by_hand(
    attributes: &str,
    big: bool,
    mut array: impl FnMut(&str, &str, usize, &[u8], &str) -> String,
    appended: &[u8],
) -> Vec<u8> {
    let mut points = Bytes::new(big);
    points.reals(&CORNERS);
    let mut corners = Bytes::new(big);
    corners.ints(&[0, 1, 2, 3]);
    let mut offsets = Bytes::new(big);
    offsets.sizes(&[4]);
    let mut quality = Bytes::new(big);
    quality.put(0.5_f32.to_le_bytes());
    let body = format!(
        "<?xml version='1.0'?>\n<!-- by hand -->\n<VTKFile type='UnstructuredGrid' {attributes}>\n<UnstructuredGrid>\n\
         <Piece NumberOfPoints='4' NumberOfCells='1'>\n<PointData/>\n<CellData Scalars='q'>{}</CellData>\n<Points>{}</Points>\n\
         <Cells>\n{}\n{}\n{}</Cells></Piece></UnstructuredGrid>\n",
        array("Float32", "q &lt;1&gt;", 1, &quality.bytes, "0.5"),
        array("Float64", "Points", 3, &points.bytes, "0 0 0 1 0 0\n0 1.5 0 0 0 1"),
        array("Int32", "connectivity", 1, &corners.bytes, "0 1 2 3"),
        array("Int64", "offsets", 1, &offsets.bytes, " 4 "),
        array("UInt8", "types", 1, &[10], "10"),
    );
    let mut file = body.into_bytes();
    file.extend_from_slice(appended);
    file.extend_from_slice(b"</VTKFile>\n");
    file
}

#[test]
fn vtu_in_every_encoding() {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use std::io::Write as _;

    let check = |file: &[u8]| {
        let content = assert_tetrahedron("t.vtu", file);
        assert_eq!(content.cell_data, [field("q <1>", 1, vec![0.5])]);
    };
    check(&vtu_by_hand(
        "",
        false,
        |kind, name, components, _, text| {
            format!(
                "<DataArray type='{kind}' Name='{name}' NumberOfComponents='{components}' format='ascii'>{text}\
             <InformationKey name='L2'><Value>7</Value></InformationKey></DataArray>"
            )
        },
        b"",
    ));

    let deflate = |bytes: &[u8]| {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).expect("memory takes every byte");
        encoder.finish().expect("memory takes every byte")
    };
    for big in [false, true] {
        for wide in [false, true] {
            for zlib in [false, true] {
                let header = |sizes: &[u64]| {
                    let mut header = Bytes::new(big);
                    for &size in sizes {
                        if wide {
                            header.sizes(&[size])
                        } else {
                            header.ints(&[size as i32])
                        };
                    }
                    header.bytes
                };
                // The header and the numbers of an array; compressed in blocks of eight bytes.
                let parts = |bytes: &[u8]| -> (Vec<u8>, Vec<u8>) {
                    if !zlib {
                        return (header(&[bytes.len() as u64]), bytes.to_vec());
                    }
                    let blocks: Vec<Vec<u8>> = bytes.chunks(8).map(deflate).collect();
                    let mut sizes = vec![blocks.len() as u64, 8, bytes.len() as u64 % 8];
                    sizes.extend(blocks.iter().map(|block| block.len() as u64));
                    (header(&sizes), blocks.concat())
                };
                let attributes = format!(
                    "byte_order='{}' header_type='{}' {}",
                    if big { "BigEndian" } else { "LittleEndian" },
                    if wide { "UInt64" } else { "UInt32" },
                    if zlib { "compressor='vtkZLibDataCompressor'" } else { "" }
                );
                let tag = |kind: &str, name: &str, components: usize, rest: &str| {
                    format!(
                        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" {rest}</DataArray>"
                    )
                };
                // Compressed arrays have their header encoded by itself, others have it in front of the numbers.
                let letters = |bytes: &[u8]| {
                    let (head, body) = parts(bytes);
                    if zlib {
                        STANDARD.encode(head) + &STANDARD.encode(body)
                    } else {
                        STANDARD.encode([head, body].concat())
                    }
                };
                check(&vtu_by_hand(
                    &attributes,
                    big,
                    |kind, name, components, bytes, _| {
                        tag(
                            kind,
                            name,
                            components,
                            &format!("format=\"binary\">\n  {}\n", letters(bytes)),
                        )
                    },
                    b"",
                ));
                for raw in [false, true] {
                    let mut appended = Vec::new();
                    let mut collect = |kind: &str, name: &str, components: usize, bytes: &[u8], _: &str| {
                        let place = format!("format=\"appended\" offset=\"{}\">", appended.len());
                        if raw {
                            let (head, body) = parts(bytes);
                            appended.extend([head, body].concat());
                        } else {
                            appended.extend(letters(bytes).into_bytes());
                        }
                        tag(kind, name, components, &place)
                    };
                    let file = vtu_by_hand(&attributes, big, &mut collect, b"");
                    let file = &file[..file.len() - b"</VTKFile>\n".len()];
                    let encoding = if raw { "raw" } else { "base64" };
                    let open = format!("<AppendedData encoding=\"{encoding}\">\n _");
                    check(&[file, open.as_bytes(), &appended, b"\n</AppendedData>\n</VTKFile>\n"].concat());
                }
            }
        }
    }
}

#[test]
fn obj_keeps_the_order_of_vertices_whatever_the_groups() {
    let text = "# by hand\nmtllib a.mtl\no first\nv 9 9 9\nv 0 0 0 1 0 0\nv 1 0 0\nvt 0 0\nvn 0 0 1\ng a\nusemtl red\nf 4/1/1 3/1 2\n\
                v 0 1.5 0\r\no second\n  f -1//1 -2//1 -3//1 -4//1 # a quad\nv 0 0 1 2\nf 1 2 3 4 5\nl 1 2\n";
    let content = format::read("t.obj", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        content.points,
        [
            [9.0, 9.0, 9.0],
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.5, 0.0],
            [0.0, 0.0, 0.5]
        ]
    );
    assert_eq!(content.triangles, [[3, 2, 1], [0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    assert_eq!(content.quads, [[3, 2, 1, 0]]);
    assert_eq!(content.notices.len(), 2, "{:?}", content.notices);
    let three =
        format::read("t.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 3 2 1\n").unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((three.points.len(), three.triangles), (3, vec![[2, 1, 0]]));
    let cloud = format::read("t.obj", b"v 0 0 0\n").unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(cloud.points.len(), 1);
}

#[test]
fn off_headers_in_every_variant() {
    let plain = "0 0 0\n1 0 0\n\n0 1.5 0 # third\n0 0 1\n3 0 1 2\n4 0 1 2 3 255 0 0\n5 0 1 2 3 0\n2 0 1\n";
    let coloured = plain.replace("0 0 0\n", "0 0 0 .5 .5 .5 1\n");
    for (header, body) in [
        ("OFF\n4 4 0\n", plain),
        ("OFF 4 4 0\n", plain),
        ("# a comment\nOFF # another\n\n4 4\n", plain),
        ("4 4 0\n", plain),
        ("COFF\n4 4 0\n", &coloured),
        ("STCNOFF\r\n4 4 0\r\n", &coloured),
    ] {
        let text = format!("{header}{body}");
        let content = format::read("t.off", text.as_bytes()).unwrap_or_else(|error| panic!("{header}: {error}"));
        assert_eq!(content.points.as_flattened(), CORNERS);
        assert_eq!(content.triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 0]]);
        assert_eq!(content.quads, [[0, 1, 2, 3]]);
        assert_eq!(content.notices.len(), 2, "{:?}", content.notices);
    }
}

#[test]
fn stl_welds_equal_vertices_and_no_others() {
    let mut text = String::from("solid two words\n");
    for triangle in ["0 0 0 1 0 0 0 1 0", "1 0 0 0 0 -0.0 0 0 1e0", "0 0 5e-324 1 0 0 0 1 0"] {
        let numbers: Vec<&str> = triangle.split(' ').collect();
        text += "facet normal 0 0 nan\n outer loop\n";
        for vertex in numbers.chunks(3) {
            text += &format!("  vertex {}\n", vertex.join(" "));
        }
        text += " endloop\nendfacet\n";
    }
    text += "endsolid two words\n";
    let content = format::read("t.stl", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(content.points.len(), 5);
    assert_eq!(content.triangles, [[0, 1, 2], [1, 0, 3], [4, 1, 2]]);
    // A binary file whose title starts with the word of the text form.
    let mut binary = format::write(
        Format::Stl,
        &Content {
            points: content.points[..4].to_vec(),
            triangles: content.triangles[..2].to_vec(),
            ..Content::default()
        },
    )
    .expect("triangles fit")
    .bytes;
    binary[..6].copy_from_slice(b"solid ");
    let again = format::read("t.stl", &binary).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(again.triangles, content.triangles[..2]);
}

fn ply_header(form: &str) -> String {
    format!(
        "ply\nformat {form} 1.0\ncomment by hand\nelement vertex 4\nproperty uchar red\nproperty double x\nproperty double y\n\
             property list uchar int extra\nproperty double z\nelement material 1\nproperty int m\nelement face 1\n\
             property list int int vertex_indices\nproperty double area\nend_header\n"
    )
}

fn ply_text() -> Vec<u8> {
    let body = "0 0 0 0 0\n1 1 0 1 77 0\n2 0 1.5 2 77 78 0\n3 0 0 0 1\n9\n4 0 1 2 3 2.5\n";
    (ply_header("ascii") + body).into_bytes()
}

fn ply_binary(big: bool) -> Vec<u8> {
    let mut file = Bytes::new(big);
    file.text(&ply_header(if big {
        "binary_big_endian"
    } else {
        "binary_little_endian"
    }));
    for (row, point) in CORNERS.chunks(3).enumerate() {
        file.bytes.push(row as u8);
        file.reals(&point[..2]);
        file.bytes.push(1);
        file.ints(&[77]).reals(&point[2..]);
    }
    file.ints(&[9]).ints(&[4, 0, 1, 2, 3]).reals(&[2.5]);
    file.bytes
}

#[test]
fn ply_in_three_encodings_with_other_properties() {
    let check = |file: &[u8]| {
        let content = format::read("t.ply", file).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(content.points.as_flattened(), CORNERS);
        assert_eq!(content.quads, [[0, 1, 2, 3]]);
        assert_eq!(content.point_data, [field("red", 1, vec![0.0, 1.0, 2.0, 3.0])]);
        assert_eq!(content.cell_data, [field("area", 1, vec![2.5])]);
        assert_eq!(content.notices.len(), 2, "{:?}", content.notices);
    };
    check(&ply_text());
    for big in [false, true] {
        check(&ply_binary(big));
    }
}

#[test]
fn content_outranks_the_name_and_foreign_formats_are_named() {
    let off = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let content = format::read("misnamed.mesh", off).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(content.triangles, [[0, 1, 2]]);
    assert!(content.notices[0].contains("OFF"), "{:?}", content.notices);
    for (bytes, word) in [
        (&b"MFEM mesh v1.0\n\ndimension\n3\n"[..], "vertices"),
        (&[1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0][..], "binary MEDIT"),
        (
            b"<?xml version=\"1.0\"?><VTKFile type=\"PolyData\"></VTKFile>",
            "PolyData",
        ),
        (b"<?xml version=\"1.0\"?><svg></svg>", "VTKFile"),
        (b"", "empty"),
        (b"$MeshFormat\n4.0 0 8\n$EndMeshFormat\n", "4.1"),
    ] {
        let error = format::read("a.mesh", bytes).expect_err("no format of ours");
        assert!(error.message.contains(word), "{error}");
    }
    let error = format::read("points.xyz", b"0 0 0\n").expect_err("no format of ours");
    assert!(
        error.message.contains(".vtu") && error.message.contains(".obj"),
        "{error}"
    );
}
