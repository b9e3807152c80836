//! Surfaces of quadrilaterals: connectivity, orientation, checks, splits, generators.

use serde_json::{Value, json};
use vargeo::linalg::vector3::{cross, dot, subtract};
use vargeo::mesh::check::Severity;
use vargeo::mesh::connectivity::NONE;
use vargeo::mesh::format;
use vargeo::mesh::generate::surface::{generate_surface, surfaces};
use vargeo::mesh::quadrilateral::{Connectivity, QuadrilateralMesh, Triangles, check, orient, quad_and_corner};

pub(crate) fn length(vector: [f64; 3]) -> f64 {
    dot(vector, vector).sqrt()
}

fn connect(mesh: &QuadrilateralMesh) -> Connectivity {
    Connectivity::of(&mesh.quads, mesh.points.len()).expect("an oriented surface")
}

fn message(mut mesh: QuadrilateralMesh, kind: &str) -> String {
    let problems = check(&mut mesh);
    let found = problems.iter().find(|problem| problem.kind == kind);
    let found = found.unwrap_or_else(|| panic!("{kind} among {problems:?}"));
    assert_eq!(found.severity, Severity::Error, "{found:?}");
    found.message.clone()
}

fn grid(width: u32, height: u32) -> QuadrilateralMesh {
    let name = |i: u32, j: u32| j * (width + 1) + i;
    let mut mesh = QuadrilateralMesh::default();
    for j in 0..=height {
        for i in 0..=width {
            mesh.points.push([f64::from(i), f64::from(j), 0.0]);
        }
    }
    for j in 0..height {
        for i in 0..width {
            mesh.quads
                .push([name(i, j), name(i + 1, j), name(i + 1, j + 1), name(i, j + 1)]);
        }
    }
    mesh
}

#[test]
fn stars_are_fans_in_cyclic_order() {
    let mut meshes = vec![grid(3, 2), grid(1, 1)];
    for name in ["sphere", "torus", "icosahedron", "poles", "saddle"] {
        meshes.push(generate_surface(name, &Value::Null).expect("defaults").mesh);
    }
    for mesh in meshes {
        let connectivity = connect(&mesh);
        let mut seen = vec![false; 4 * mesh.quads.len()];
        for vertex in 0..mesh.points.len() {
            let corners = connectivity.stars.row(vertex);
            let spokes: Vec<u32> = connectivity.spokes(vertex).collect();
            assert_eq!(spokes.len(), connectivity.valence(vertex));
            for (index, &corner) in corners.iter().enumerate() {
                assert!(!std::mem::replace(&mut seen[corner as usize], true));
                let (quad, place) = quad_and_corner(corner);
                assert_eq!(mesh.quads[quad][place] as usize, vertex);
                let edges = connectivity.quad_edges[quad];
                assert_eq!(edges[place], spokes[index], "the right side of the corner");
                assert_eq!(
                    edges[(place + 3) % 4],
                    spokes[(index + 1) % spokes.len()],
                    "the left side"
                );
            }
        }
        assert!(seen.into_iter().all(|seen| seen), "every corner stands in one star");
        for (edge, sides) in connectivity.edges.iter().zip(&connectivity.sides) {
            for (side, [start, end]) in sides.iter().zip([*edge, [edge[1], edge[0]]]) {
                if *side != NONE {
                    let (quad, corner) = quad_and_corner(*side);
                    assert_eq!(mesh.quads[quad][corner], start);
                    assert_eq!(mesh.quads[quad][(corner + 1) % 4], end);
                }
            }
        }
    }
}

#[test]
fn generated_surfaces_are_sound_and_lie_where_they_say() {
    let topology = [
        ("sphere", 2, 0),
        ("ellipsoid", 2, 0),
        ("head", 2, 0),
        ("torus", 0, 0),
        ("icosahedron", 2, 0),
    ];
    for generator in surfaces() {
        let generated = generate_surface(generator.name, &Value::Null).expect("defaults");
        let mut mesh = generated.mesh.clone();
        let problems = check(&mut mesh);
        assert!(
            problems.iter().all(|problem| problem.kind == "concave"),
            "{}: {problems:?}",
            generator.name
        );
        let connectivity = connect(&mesh);
        if let Some((_, euler, boundary)) = topology.iter().find(|(name, _, _)| *name == generator.name) {
            assert_eq!(connectivity.euler(), *euler, "{}", generator.name);
            assert_eq!(connectivity.boundary_edges(), *boundary);
        }
        let normals = mesh.normals.as_ref().expect("generators give normals");
        for quad in &mesh.quads {
            let corners = mesh.corners(*quad);
            let face = cross(subtract(corners[2], corners[0]), subtract(corners[3], corners[1]));
            for &vertex in quad {
                assert!(dot(face, normals[vertex as usize]) > 0.0, "{}: outward", generator.name);
            }
        }
        let Some(exact) = generated.exact else { continue };
        for (point, normal) in mesh.points.iter().zip(normals) {
            assert!(exact.distance(*point) < 1e-12, "{}", generator.name);
            let off: [f64; 3] = std::array::from_fn(|axis| point[axis] + 0.01 * normal[axis]);
            assert!(
                (exact.distance(off) - 0.01).abs() < 1e-9,
                "{}: {}",
                generator.name,
                exact.distance(off)
            );
        }
    }
    let poles = |valence: u32| {
        let mesh = generate_surface("poles", &json!({ "valence": valence }))
            .expect("valid")
            .mesh;
        connect(&mesh).valences()
    };
    assert_eq!(poles(7)[7], 2);
    let mean = generate_surface("sphere", &json!({ "cells": 3 })).expect("valid");
    let exact = mean.exact.expect("a formula");
    assert!((exact.mean_curvature(mean.mesh.points[5]) - 2.0).abs() < 1e-12);
}

#[test]
fn damage_is_named_and_orientation_mended() {
    let mut mesh = grid(2, 2);
    mesh.quads[1] = [9, 1, 2, 5];
    assert!(message(mesh, "index-out-of-range").contains("quadrilateral 1"));
    let mut mesh = grid(2, 1);
    mesh.points[1] = mesh.points[0];
    assert!(message(mesh, "zero-length-edge").contains("quadrilateral 0"));
    // A third quad on the edge between vertices 1 and 4.
    let mut mesh = grid(2, 1);
    mesh.points.extend([[1.0, 0.0, 1.0], [1.0, 1.0, 1.0]]);
    mesh.quads.push([1, 4, 7, 6]);
    assert!(message(mesh, "non-manifold-edge").contains("vertices 1 and 4 with 3"));
    let mut mesh = grid(1, 1);
    mesh.points
        .extend([[-1.0, 0.0, 0.0], [-1.0, -1.0, 0.0], [0.0, -1.0, 0.0]]);
    mesh.quads.push([0, 4, 5, 6]);
    assert!(message(mesh, "pinched-vertex").contains("vertex 0"));
    // A Möbius strip of three quads.
    let mut mesh = QuadrilateralMesh::default();
    for index in 0..3 {
        let (sine, cosine) = (f64::from(index) * 2.094).sin_cos();
        let half = (f64::from(index) * 1.047).sin_cos();
        for side in [-0.3, 0.3] {
            let radius = 1.0 + side * half.1;
            mesh.points.push([radius * cosine, radius * sine, side * half.0]);
        }
    }
    mesh.quads = vec![[0, 2, 3, 1], [2, 4, 5, 3], [4, 1, 0, 5]];
    assert!(message(mesh, "one-sided").contains("Möbius"));

    let mut turned = grid(4, 4);
    let sound = turned.quads.clone();
    for quad in [0, 5, 10] {
        turned.quads[quad].swap(1, 3);
    }
    let problems = check(&mut turned);
    assert_eq!(problems.len(), 1);
    assert_eq!((problems[0].severity, problems[0].count), (Severity::Repaired, 3));
    assert_eq!(turned.quads, sound);
    assert_eq!(orient(&mut turned.quads), Ok(0));
}

#[test]
fn quads_come_through_every_format_that_holds_them() {
    let mesh = generate_surface("torus", &Value::Null).expect("defaults").mesh;
    let normals = mesh.normals.clone().expect("generators give normals");
    let content = format::Content {
        points: mesh.points.clone(),
        quads: mesh.quads.clone(),
        point_data: vec![format::Field {
            name: "normals".into(),
            components: 3,
            values: normals.as_flattened().to_vec(),
        }],
        ..Default::default()
    };
    for (name, keeps_normals) in [
        ("a.obj", true),
        ("a.off", false),
        ("a.vtk", true),
        ("a.vtu", true),
        ("a.msh", true),
    ] {
        let format = format::Format::of_name(name).expect("a known extension");
        let written = format::write(format, &content).expect("every format holds quads");
        let read = format::read(name, &written.bytes).expect("what was written");
        let (back, _) = QuadrilateralMesh::from_content(&read, Triangles::Refuse).expect("quads alone");
        assert_eq!(back.quads, mesh.quads, "{name}");
        assert_eq!(back.points, mesh.points, "{name}");
        if keeps_normals {
            let read = back.normals.unwrap_or_else(|| panic!("{name} keeps normals"));
            for (a, b) in read.iter().zip(&normals) {
                let across = length(cross(*a, *b)) / length(*a);
                assert!(across < 1e-12 && dot(*a, *b) > 0.0, "{name}");
            }
        }
    }
}

#[test]
fn triangles_are_refused_or_split() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0.5 0\nf 1 2 3 4\nf 2 5 3\n";
    let content = format::read("mixed.obj", text.as_bytes()).expect("a sound file");
    let error = QuadrilateralMesh::from_content(&content, Triangles::Refuse).expect_err("a triangle");
    assert!(error.contains("1 triangles") && error.contains("split"), "{error}");
    let (mesh, notices) = QuadrilateralMesh::from_content(&content, Triangles::Split).expect("split");
    assert_eq!((mesh.quads.len(), notices.len()), (7, 1));
    let connectivity = connect(&mesh);
    assert_eq!(connectivity.euler(), 1);
    assert!((mesh.area() - 1.5).abs() < 1e-12);
}
