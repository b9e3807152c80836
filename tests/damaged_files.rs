//! A damaged mesh file is an error that names its place and mend; never a panic, never memory out of proportion.

use proptest::prelude::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use vargeo::mesh::format;

/// Counts the bytes that the current thread holds, so that a reader's memory can be measured.
struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

fn count(change: isize) {
    // Threads that end may have no counters any more.
    let _ = HELD.try_with(|held| {
        held.set(held.get() + change);
        let _ = MOST.try_with(|most| most.set(most.get().max(held.get())));
    });
}

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Reads a file and returns the outcome and the most bytes held meanwhile.
fn measured(name: &str, bytes: &[u8]) -> (Result<format::Content, format::FormatError>, usize) {
    let before = HELD.get();
    MOST.set(before);
    let outcome = format::read(name, bytes);
    (outcome, (MOST.get() - before) as usize)
}

/// Reads a damaged file; whatever comes out has to be sound, and memory in proportion to the file.
fn survive(name: &str, bytes: &[u8]) {
    let (outcome, held) = measured(name, bytes);
    // Buffers of the decompressor, of tobj's tables and of messages do not grow with the file.
    let allowed = 64 * bytes.len() + (1 << 20);
    assert!(
        held <= allowed,
        "{name}: {held} bytes held for a file of {}",
        bytes.len()
    );
    match outcome {
        Ok(content) => {
            content
                .cells()
                .check(content.points.len())
                .expect("indices are within range");
            assert!(
                content.points.as_flattened().iter().all(|value| value.is_finite()),
                "{name}"
            );
            for field in &content.point_data {
                assert_eq!(field.values.len(), field.components * content.points.len(), "{name}");
            }
            for field in &content.cell_data {
                assert_eq!(field.values.len(), field.components * content.cells().count(), "{name}");
            }
        }
        Err(error) => assert!(!error.message.is_empty() && error.file == name),
    }
}

#[test]
fn every_truncation_of_every_specimen_is_survived() {
    for (name, bytes) in crate::format_variants::specimens() {
        for length in 0..bytes.len() {
            survive(&name, &bytes[..length]);
        }
    }
}

/// One way to damage a file; places and values are taken modulo what the file has.
#[derive(Clone, Debug)]
enum Damage {
    Cut(usize),
    Flip(usize, u8),
    Number(usize, &'static str),
    Insert(usize, Vec<u8>),
    Repeat(usize, usize),
    Remove(usize, usize),
}

fn damage() -> impl Strategy<Value = Damage> {
    let numbers = [
        "99999999999",
        "18446744073709551615",
        "-1",
        "nan",
        "1e999",
        "4294967295",
        "0",
        "x",
        "1000000",
    ];
    prop_oneof![
        1 => any::<usize>().prop_map(Damage::Cut),
        4 => (any::<usize>(), any::<u8>()).prop_map(|(place, bits)| Damage::Flip(place, bits)),
        4 => (any::<usize>(), prop::sample::select(numbers.to_vec())).prop_map(|(place, number)| Damage::Number(place, number)),
        2 => (any::<usize>(), prop::collection::vec(any::<u8>(), 1..12)).prop_map(|(place, bytes)| Damage::Insert(place, bytes)),
        2 => (any::<usize>(), 1..200_usize).prop_map(|(place, length)| Damage::Repeat(place, length)),
        2 => (any::<usize>(), 1..200_usize).prop_map(|(place, length)| Damage::Remove(place, length)),
    ]
}

fn apply(bytes: &mut Vec<u8>, damage: &Damage) {
    let place = |place: usize| place % (bytes.len() + 1);
    let range = |start: usize, length: usize| place(start)..(place(start) + length).min(bytes.len());
    match damage {
        Damage::Cut(at) => bytes.truncate(place(*at)),
        Damage::Flip(at, bits) => {
            let at = place(*at);
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= bits;
            }
        }
        // Another number for the word at or after the place.
        Damage::Number(at, number) => {
            let digit = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-');
            let at = place(*at);
            let start = at + bytes[at..].iter().position(digit).unwrap_or(0);
            let end = start + bytes[start..].iter().take_while(|byte| digit(byte)).count();
            bytes.splice(start..end, number.bytes());
        }
        Damage::Insert(at, more) => {
            let at = place(*at);
            bytes.splice(at..at, more.iter().copied());
        }
        Damage::Repeat(start, length) => {
            let range = range(*start, *length);
            let piece = bytes[range.clone()].to_vec();
            bytes.splice(range.end..range.end, piece);
        }
        Damage::Remove(start, length) => {
            let range = range(*start, *length);
            bytes.drain(range);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn any_damage_to_any_specimen_is_survived(damages in prop::collection::vec(damage(), 1..4)) {
        thread_local! {
            static SPECIMENS: Vec<(String, Vec<u8>)> = crate::format_variants::specimens();
        }
        SPECIMENS.with(|specimens| {
            for (name, bytes) in specimens {
                let mut bytes = bytes.clone();
                damages.iter().for_each(|damage| apply(&mut bytes, damage));
                survive(name, &bytes);
            }
        });
    }

    #[test]
    fn noise_behind_any_first_words_is_survived(
        start in prop::sample::select(vec![
            "", "MeshVersionFormatted 1\n", "$MeshFormat\n2.2 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n", "$MeshFormat\n4.1 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n",
            "# vtk DataFile Version 3.0\n\nBINARY\nDATASET POLYDATA\nPOINTS 1 float\n", "<VTKFile type='UnstructuredGrid'>", "OFF\n", "solid\nfacet ",
            "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nelement face 9\nproperty list int int vertex_index\nend_header\n",
            "v 0 0 0\nf ",
        ]),
        noise in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        for name in ["a.mesh", "a.msh", "a.vtk", "a.vtu", "a.off", "a.stl", "a.ply", "a.obj"] {
            survive(name, &[start.as_bytes(), &noise].concat());
        }
    }
}

/// Name of a file, its text, the line of the error, and words that the message holds.
type Case = (&'static str, &'static str, usize, &'static str);

#[test]
fn each_damage_is_named_with_its_line() {
    let cases: &[Case] = &[
        ("a.mesh", "MeshVersionFormatted 9\n", 1, "version 9"),
        ("a.mesh", "MeshVersionFormatted 1\nDimension 4\n", 2, "dimension 4"),
        (
            "a.mesh",
            "MeshVersionFormatted 1\nVertices\n2\n0 0 0 0\n0 oops 0 0\n",
            5,
            "\"oops\" stands where coordinate 2 of vertex 2",
        ),
        (
            "a.mesh",
            "MeshVersionFormatted 1\nVertices\n1\n0 nan 0 0\n",
            4,
            "not a finite number",
        ),
        (
            "a.mesh",
            "MeshVersionFormatted 1\nVertices\n1\n1e999 0 0 0\n",
            4,
            "not a finite number",
        ),
        (
            "a.mesh",
            "MeshVersionFormatted 1\nVertices\n99999999999\n0 0 0 0\n",
            3,
            "only 9 bytes follow",
        ),
        (
            "a.mesh",
            "MeshVersionFormatted 1\nVertices\n-3\n",
            3,
            "cannot be negative",
        ),
        (
            "a.mesh",
            "MeshVersionFormatted 1\nVertices 1\n0 0 0 0\nTriangles 1\n1 1\n2 0\n",
            6,
            "triangle 1 names vertex 2; there are 1, counted from 1",
        ),
        (
            "a.mesh",
            "MeshVersionFormatted 1\nVertices 1\n0 0 0 0\nTriangles 1\n1 1\n0 0\n",
            6,
            "triangle 1 names vertex 0",
        ),
        (
            "a.mesh",
            "MeshVersionFormatted 1\nVertices 1\n0 0 0 0\n0 0 0 0\n",
            4,
            "count of the section before is too small",
        ),
        (
            "a.mesh",
            "MeshVersionFormatted 1\nVertices 2\n0 0 0 0\n0.5 0.25\n",
            4,
            "the file ends where",
        ),
        (
            "a.msh",
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n1\n1 15 2 0 1 8\n$EndElements\n",
            10,
            "names node 8",
        ),
        (
            "a.msh",
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n2 0 0 0\n$EndNodes\n",
            7,
            "stands where $EndNodes",
        ),
        (
            "a.msh",
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n2\n1 0 0 0\n1 0 0 0\n$EndNodes\n",
            4,
            "node 1 is given twice",
        ),
        (
            "a.msh",
            "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 888888888 1 1\n3 1 0 888888888\n1\n",
            5,
            "888888888 nodes are announced",
        ),
        ("a.msh", "$MeshFormat\n4.1 7 8\n", 2, "file type is 7"),
        (
            "a.msh",
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Periodic\n1\n",
            4,
            "does not end with $EndPeriodic",
        ),
        ("a.vtk", "# vtk DataFile Version 3.0\n\nUTF8\n", 3, "ASCII or BINARY"),
        (
            "a.vtk",
            "# vtk DataFile Version 3.0\n\nASCII\nDATASET STRUCTURED_POINTS\n",
            4,
            "STRUCTURED_POINTS",
        ),
        (
            "a.vtk",
            "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 quadruple\n",
            5,
            "\"quadruple\"",
        ),
        (
            "a.vtk",
            "# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n0 0 0\nPOLYGONS 1 4\n3 0 0\n1\n",
            9,
            "there are 1 points",
        ),
        (
            "a.vtk",
            "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n0 0 0\nCELLS 1 2\n1 0\nCELL_TYPES 2\n1\n1\n",
            9,
            "2 cell types for 1 cells",
        ),
        (
            "a.vtk",
            "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n0 0 0\nPOINT_DATA 7\n",
            7,
            "7 rows",
        ),
        (
            "a.vtu",
            "<VTKFile type=\"UnstructuredGrid\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"many\">\n",
            3,
            "\"many\"",
        ),
        (
            "a.vtu",
            "<VTKFile type=\"UnstructuredGrid\">\n<Piece NumberOfPoints=\"9\" NumberOfCells=\"0\">\n<Points>\n\
          <DataArray type=\"Float64\" NumberOfComponents=\"3\">0 0 0</DataArray></Points></Piece></VTKFile>",
            4,
            "should hold 27 numbers",
        ),
        (
            "a.vtu",
            "<VTKFile type=\"UnstructuredGrid\">\n<Piece NumberOfPoints=\"1\" NumberOfCells=\"0\">\n<Points>\n\
          <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"binary\">!!!!</DataArray></Points></Piece></VTKFile>",
            4,
            "base64",
        ),
        (
            "a.vtu",
            "<VTKFile type=\"UnstructuredGrid\">\n<Piece NumberOfPoints=\"1\" NumberOfCells=\"0\"></Points>",
            2,
            "XML",
        ),
        ("a.obj", "v 0 0 0\nv 1 0\n", 2, "2 coordinates"),
        ("a.obj", "v 0 0 0\nv 1 inf 0\n", 2, "coordinate 2"),
        (
            "a.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 3\nf 1/1 2/2 9/3\n",
            6,
            "vertex 9; there are 3",
        ),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 -4\n", 5, "vertex -4"),
        ("a.obj", "v 0 0 0\nf 1 one 1\n", 2, "no whole number"),
        ("a.obj", "v 0 0 0\nf 1 1\n", 2, "2 corners"),
        ("a.off", "OFF\n1 0 0\n0 zero 0\n", 3, "\"zero\""),
        ("a.off", "OFF\n99999999 0 0\n0 0 0\n", 2, "only 6 bytes follow"),
        (
            "a.off",
            "OFF\n1 1 0\n0 0 0\n3 0 0 5\n",
            4,
            "names vertex 5; there are 1, counted from 0",
        ),
        ("a.off", "OFF\n1 0 0\n0 0 0\n3 0 0 0\n", 4, "counts are too small"),
        ("a.off", "OFF BINARY\n", 1, "binary OFF"),
        (
            "a.stl",
            "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\n",
            6,
            "\"endloop\" stands where vertex",
        ),
        (
            "a.stl",
            "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 inf\n",
            4,
            "finite",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n",
            3,
            "property \"z\"",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\n",
            4,
            "\"half\"",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 ? 0\n",
            8,
            "\"?\"",
        ),
    ];
    for &(name, text, line, words) in cases {
        let (outcome, held) = measured(name, text.as_bytes());
        let error = outcome.expect_err(text);
        assert!(error.message.contains(words), "{error}\nlacks {words:?}");
        assert_eq!(error.line, Some(line), "{error}");
        assert!(held < 1 << 20, "{error}: {held} bytes");
        assert!(error.to_string().starts_with(&format!("{name}:{line}: ")), "{error}");
    }
}

#[test]
fn damage_in_binary_data_is_named_with_its_byte() {
    let mut stl = vec![0; 84 + 50];
    stl[80] = 2;
    let error = format::read("a.stl", &stl).expect_err("a triangle is missing");
    assert_eq!(error.byte, Some(80), "{error}");
    stl[80] = 1;
    stl[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    let error = format::read("a.stl", &stl).expect_err("a coordinate is not a number");
    assert_eq!(error.byte, Some(96), "{error}");
    let ply = b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    let (outcome, held) = measured("a.ply", ply);
    let error = outcome.expect_err("nothing follows");
    assert!(
        error.message.contains("only 0 bytes follow") && error.byte == Some(ply.len()),
        "{error}"
    );
    assert!(held < 1 << 20);
}

#[test]
fn files_that_ask_for_more_than_they_hold_are_refused() {
    // A thousand sections, each with data on one of many nodes.
    let nodes: String = (1..=2000).map(|tag| format!("{tag} 0 0 0\n")).collect();
    let data = "$NodeData\n1\n\"d\"\n0\n3\n0\n9\n1\n1 0 0 0 0 0 0 0 0 0\n$EndNodeData\n".repeat(1000);
    let gmsh = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n2000\n{nodes}$EndNodes\n$Elements\n0\n$EndElements\n{data}"
    );
    // Many properties of one face with many corners.
    let properties: String = (0..2000).map(|row| format!("property char p{row}\n")).collect();
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty char x\nproperty char y\nproperty char z\nelement face 1\n\
         {properties}property list int char vertex_indices\nend_header\n0 0 0\n{}20000 {}",
        "0 ".repeat(2000),
        "0 ".repeat(20000)
    );
    // Many arrays at one place.
    let array =
        "<DataArray type='UInt8' Name='a' NumberOfComponents='20000' format='appended' offset='0'/>\n".repeat(1000);
    let vtu = format!(
        "<VTKFile type='UnstructuredGrid'><Piece NumberOfPoints='0' NumberOfCells='0'/><Piece/></VTKFile>\n<!--{}-->",
        array.len()
    );
    let shared = format!(
        "<VTKFile type='UnstructuredGrid'>\n<Piece NumberOfPoints='1' NumberOfCells='0'>\n<PointData>{array}</PointData>\n<Points>\
         <DataArray type='UInt8' NumberOfComponents='3' format='ascii'>0 0 0</DataArray></Points></Piece>\n<AppendedData encoding='raw'>_"
    );
    let shared = [shared.as_bytes(), &20000_u32.to_le_bytes(), &[7; 20000]].concat();
    for (name, bytes, words) in [
        ("sparse.msh", gmsh.as_bytes(), "cover only a few"),
        ("fan.ply", ply.as_bytes(), "repeated too often"),
        ("pieces.vtu", vtu.as_bytes(), "second piece"),
        ("shared.vtu", &shared, "overlaps"),
    ] {
        let (outcome, held) = measured(name, bytes);
        let error = outcome.expect_err(name);
        assert!(error.message.contains(words), "{error}");
        assert!(
            held < 64 * bytes.len(),
            "{name}: {held} bytes held for a file of {}",
            bytes.len()
        );
    }
}
