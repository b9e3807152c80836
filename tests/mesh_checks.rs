//! Every kind of problem of a mesh is found, counted and placed; reversed tetrahedra are repaired and nothing else is.

use serde_json::json;
use vargeo::mesh::check::{Problem, Severity, tetrahedra, triangles};
use vargeo::mesh::connectivity::boundary;
use vargeo::mesh::generate::lattice::body_centred;
use vargeo::mesh::summary::{summarize_tetrahedra, summarize_triangles};
use vargeo::mesh::target::{from_mesh, list, shape};
use vargeo::mesh::{TetrahedralMesh, TriangleMesh};

fn sound() -> TetrahedralMesh {
    body_centred([3, 3, 3])
}

/// The kinds found after a change of a sound mesh, with counts and first offenders.
fn found(change: impl FnOnce(&mut TetrahedralMesh)) -> Vec<(&'static str, usize, usize)> {
    let mut mesh = sound();
    change(&mut mesh);
    let problems = tetrahedra(&mut mesh);
    for problem in &problems {
        assert!(
            !problem.message.is_empty() && problem.message.starts_with(|c: char| !c.is_uppercase()),
            "{problem:?}"
        );
    }
    problems
        .iter()
        .map(|problem| (problem.kind, problem.count, problem.first))
        .collect()
}

#[test]
fn a_sound_mesh_has_no_problems() {
    assert_eq!(found(|_| {}), []);
}

#[test]
fn reversed_tetrahedra_are_turned_round() {
    let whole = |mesh: &mut TetrahedralMesh| mesh.cells.iter_mut().for_each(|cell| cell.swap(0, 1));
    let count = sound().cells.len();
    assert_eq!(found(whole), [("reversed", count, 0)]);
    let some = |mesh: &mut TetrahedralMesh| [7, 8, 100].iter().for_each(|&cell| mesh.cells[cell].swap(1, 3));
    assert_eq!(found(some), [("reversed", 3, 7)]);
    for change in [&whole as &dyn Fn(&mut TetrahedralMesh), &some] {
        let mut mesh = sound();
        change(&mut mesh);
        assert_eq!(tetrahedra(&mut mesh)[0].severity, Severity::Repaired);
        assert!(mesh.volumes().iter().all(|&volume| volume > 0.0));
        assert_eq!(tetrahedra(&mut mesh), []);
    }
}

#[test]
fn misplaced_vertices_are_not_mistaken_for_reversed_tetrahedra() {
    // A centre of a box moved far into another box turns tetrahedra inside out whose order is right.
    for reversed in [false, true] {
        let mut mesh = sound();
        if reversed {
            mesh.cells.iter_mut().for_each(|cell| cell.swap(0, 1));
        }
        let centre = 64 + 13;
        mesh.points[centre] = [0.9, 0.5, 0.5];
        let before = mesh.clone();
        let inverted = mesh
            .volumes()
            .iter()
            .filter(|&&volume| (volume < 0.0) != reversed)
            .count();
        let problems = tetrahedra(&mut mesh);
        assert!(inverted > 0);
        assert_eq!(
            (problems[0].kind, problems[0].count, problems[0].severity),
            ("inverted", inverted, Severity::Error)
        );
        assert_eq!(mesh, before);
    }
}

#[test]
fn errors_are_found_counted_and_placed() {
    let count = sound().cells.len();
    assert_eq!(found(|mesh| mesh.cells.clear()), [("empty", 1, 0)]);
    assert_eq!(found(|mesh| mesh.points[5][2] = f64::NAN), [("not-finite", 1, 5)]);
    assert_eq!(found(|mesh| mesh.points[9][0] = f64::INFINITY), [("not-finite", 1, 9)]);
    let out = |mesh: &mut TetrahedralMesh| [3, 4].iter().for_each(|&cell| mesh.cells[cell][1] = 10_000);
    assert_eq!(found(out), [("index-out-of-range", 2, 3)]);
    assert_eq!(
        found(|mesh| mesh.cells[17][2] = mesh.cells[17][0]),
        [("repeated-vertex", 1, 17)]
    );
    assert_eq!(
        found(|mesh| mesh.points.push([9.0; 3])),
        [("unreferenced-vertex", 1, sound().points.len())]
    );
    let copied = found(|mesh| {
        let [a, b, c, d] = mesh.cells[2];
        mesh.cells.push([b, a, d, c]);
    });
    assert_eq!(copied, [("duplicate-cell", 1, count)]);
    // A tetrahedron in a plane, hung onto a face.
    let flat = found(|mesh| {
        let [_, b, c, d] = mesh.cells[count - 1];
        let middle = [b, c, d].map(|v| mesh.points[v as usize]);
        mesh.points.push(std::array::from_fn(|axis| {
            middle.iter().map(|p| p[axis]).sum::<f64>() / 3.0
        }));
        mesh.cells.push([b, c, d, mesh.points.len() as u32 - 1]);
    });
    assert_eq!(flat[0], ("degenerate-cell", 1, count));
    let surplus = found(|mesh| {
        let [a, b, c, _] = mesh.cells[0];
        mesh.points.push([-1.0, 2.0, 3.0]);
        mesh.cells.push([a, b, c, mesh.points.len() as u32 - 1]);
    });
    assert_eq!(surplus[0].0, "non-manifold-face");
}

#[test]
fn doubts_are_warnings() {
    let kinds = |problems: &[Problem]| {
        assert!(problems.iter().all(|problem| problem.severity == Severity::Warning));
        problems
            .iter()
            .map(|problem| (problem.kind, problem.count))
            .collect::<Vec<_>>()
    };
    let corner = |at: f64| [[at; 3], [at + 1.0, at, at], [at, at + 1.0, at], [at, at, at + 1.0]];
    let points = [corner(0.0), corner(5.0)].concat();
    let mut apart = TetrahedralMesh {
        points: points.clone(),
        cells: vec![[0, 1, 2, 3], [4, 5, 6, 7]],
    };
    assert_eq!(kinds(&tetrahedra(&mut apart)), [("several-components", 1)]);
    // Two tetrahedra that touch in a vertex; then with the vertex doubled.
    let mut points = [corner(0.0), corner(0.0)].concat();
    points[5..8].iter_mut().for_each(|point| *point = point.map(|c| -c));
    let turned = [4, 6, 5, 7];
    let mut doubled = TetrahedralMesh {
        points: points.clone(),
        cells: vec![[0, 1, 2, 3], turned],
    };
    assert_eq!(
        kinds(&tetrahedra(&mut doubled)),
        [("coincident-vertices", 1), ("several-components", 1)]
    );
    points.remove(4);
    let mut touching = TetrahedralMesh {
        points,
        cells: vec![[0, 1, 2, 3], [0, 5, 4, 6]],
    };
    assert_eq!(kinds(&tetrahedra(&mut touching)), [("pinched-vertex", 1)]);
    let mut sliver = TetrahedralMesh {
        points: corner(0.0).to_vec(),
        cells: vec![[0, 1, 2, 3]],
    };
    sliver.points[3] = [0.3, 0.3, 1e-5];
    assert_eq!(kinds(&tetrahedra(&mut sliver)), [("poor-cell", 1)]);
}

#[test]
fn surfaces_are_checked_too() {
    let mesh = sound();
    let shell = boundary(&mesh.cells, mesh.points.len());
    let keep: Vec<[f64; 3]> = shell.vertices.iter().map(|&v| mesh.points[v as usize]).collect();
    let place = |v: u32| shell.vertices.binary_search(&v).expect("a boundary vertex") as u32;
    let cube = TriangleMesh {
        points: keep,
        cells: shell.triangles.iter().map(|t| t.map(place)).collect(),
    };
    let kinds = |change: &dyn Fn(&mut TriangleMesh)| {
        let mut mesh = cube.clone();
        change(&mut mesh);
        triangles(&mesh)
            .iter()
            .map(|problem| (problem.kind, problem.count, problem.first))
            .collect::<Vec<_>>()
    };
    assert_eq!(kinds(&|_| {}), []);
    assert_eq!(kinds(&|mesh| mesh.cells.truncate(107)), []);
    assert_eq!(kinds(&|mesh| mesh.cells[4].swap(0, 1))[0].0, "inconsistent-orientation");
    assert_eq!(
        kinds(&|mesh| mesh.cells[4][1] = mesh.cells[4][0]),
        [("repeated-vertex", 1, 4)]
    );
    let fin = kinds(&|mesh| {
        mesh.points.push([5.0; 3]);
        mesh.cells
            .push([mesh.cells[0][0], mesh.cells[0][1], mesh.points.len() as u32 - 1]);
    });
    assert_eq!(fin, [("non-manifold-edge", 1, 0)]);

    let summary = summarize_triangles(&cube).expect("points");
    assert_eq!(
        (summary.components, summary.surfaces[0].genus, summary.boundary_facets),
        (1, Some(0), 0)
    );
    assert!((summary.second_measure.expect("closed") - 1.0).abs() < 1e-12);
    let solid = summarize_tetrahedra(&mesh).expect("points");
    assert_eq!(
        (solid.boundary_facets, solid.boundary_vertices, solid.cells),
        (108, 56, 324)
    );
    assert!((solid.measure - 1.0).abs() < 1e-12);
    let shape = solid.scaled_jacobian.expect("cells");
    assert!(
        (shape.max - 0.75 * 8f64.sqrt() / 2.25).abs() < 1e-9 && shape.min > 0.5,
        "{shape:?}"
    );
    assert!(
        solid
            .rows()
            .iter()
            .chain(&summary.rows())
            .all(|(_, value)| !value.is_empty())
    );
}

#[test]
fn targets_from_files_are_checked() {
    let mesh = sound();
    let surface = boundary(&mesh.cells, mesh.points.len());
    let lines: Vec<String> = surface
        .vertices
        .iter()
        .map(|&v| {
            format!(
                "{v} {} {} {}",
                mesh.points[v as usize][0], mesh.points[v as usize][1], mesh.points[v as usize][2]
            )
        })
        .collect();
    let read = |lines: &[String]| list::parse(&lines.join("\n"), &surface, 2.0);
    let mut backwards = lines.clone();
    backwards.reverse();
    backwards.insert(3, "  # a remark".to_string());
    for order in [&lines, &backwards] {
        let target = read(order).expect("complete");
        let doubled = surface
            .vertices
            .iter()
            .map(|&v| mesh.points[v as usize].map(|c| 2.0 * c));
        assert!(target.positions.iter().copied().eq(doubled));
    }
    let error = |line: usize, text: &str| {
        let mut lines = lines.clone();
        lines[line] = text.to_string();
        read(&lines).expect_err("should be refused")
    };
    let inner = (0..mesh.points.len())
        .find(|&v| !surface.mask[v])
        .expect("an interior vertex");
    assert!(error(3, "999 0 0 0").starts_with("line 4: vertex 999 is out of range"));
    assert!(error(3, &format!("{inner} 0 0 0")).contains("inside the mesh"));
    assert!(error(3, "0 0 0 0").starts_with("line 4: vertex 0 was given before on line 1"));
    assert!(error(3, "3 0 0").starts_with("line 4: 3 words"));
    assert!(error(3, "3 0 0 zero").contains("`zero`"));
    assert!(error(3, "3 0 nan 0").contains("not finite"));
    assert!(error(3, "-1 0 0 0").contains("`-1`"));
    assert!(error(3, "").contains(&format!(
        "1 of 56 boundary vertices have no target: {}",
        surface.vertices[3]
    )));

    let mut other = mesh.clone();
    other.points.iter_mut().for_each(|point| point[0] *= 3.0);
    other.cells.reverse();
    other.cells[0].swap(0, 2);
    let target = from_mesh(&mesh, &surface, &other).expect("same connectivity");
    assert!(
        target
            .positions
            .iter()
            .zip(&surface.vertices)
            .all(|(p, &v)| p[0] == 3.0 * mesh.points[v as usize][0])
    );
    other.cells[5][0] = other.cells[9][0];
    assert!(
        from_mesh(&mesh, &surface, &other)
            .expect_err("differs")
            .contains("tetrahedron")
    );
    other.cells.pop();
    assert!(
        from_mesh(&mesh, &surface, &other)
            .expect_err("fewer")
            .contains("323 tetrahedra but the mesh has 324")
    );
    // A swirl beyond what the triangles can follow.
    let natural = mesh.points.clone();
    let wild = shape("cube", &json!({ "swirl": 15.0 }), &mesh, &surface, Some(&natural)).expect_err("folds");
    assert!(wild.contains("lower `swirl`"), "{wild}");
}
