//! Mixed finite elements against stored solutions of an independent program, and the promises of the method.

use crate::sample::{self, metric_bits, model, with_threads};
use serde_json::{Value, json};
use vargeo::fem::surface::{SurfaceOperators, mean_edge_length};
use vargeo::mesh::TriangleMesh;
use vargeo::mesh::format;
use vargeo::mesh::planar::{self, Domain, FAMILIES, Family};
use vargeo::method::mixed_fem::MixedFem;
use vargeo::method::model::LoadedModel;
use vargeo::method::{Failure, Method, Outcome};

/// A generated model.
pub(crate) fn generated(generator: &str, parameters: Value) -> LoadedModel {
    model([("mesh", sample::generated(generator, parameters))])
}

/// A model from the text of an OBJ file.
pub(crate) fn file(text: &str) -> LoadedModel {
    model([("mesh", sample::file("test.obj", text))])
}

pub(crate) fn run(model: LoadedModel, settings: Value) -> Result<Outcome, Failure> {
    assert_eq!(MixedFem.check(&settings), Vec::new(), "valid settings");
    sample::run(&MixedFem, model, settings)
}

pub(crate) fn field(outcome: &Outcome, name: &str) -> Vec<f64> {
    let content = format::read("result.vtu", outcome.mesh.as_ref().expect("a mesh")).expect("a VTU file");
    let field = content.point_data.into_iter().find(|field| field.name == name);
    field.expect("the field").values
}

fn numbers(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).expect("a list of numbers")
}

/// The settings behind the names of the stored solutions.
fn scheme(name: &str) -> Value {
    let mass = match name.rsplit(' ').next() {
        Some("full") => "full",
        Some("bary") => "barycentric",
        _ => "hybrid",
    };
    let equation = if name.starts_with("bih") {
        "biharmonic"
    } else {
        "triharmonic"
    };
    let (condition, curve) = match name.split(' ').nth(1).expect("two words at least") {
        "region" => ("region", "stabilised"),
        "(15)stab" | "(15)tangential" => ("curve", "stabilised"),
        "curve1" => ("curve", "first-order-ring"),
        _ => ("curve", "second-order-ring"),
    };
    let relaxation = if name.contains("tangential") {
        "tangential"
    } else {
        "quadratic"
    };
    json!({
        "equation": equation, "condition": condition, "curve": curve, "mass": mass, "relaxation": relaxation,
    })
}

#[test]
fn solutions_agree_with_an_independent_program_in_both_systems() {
    let golden: Value = serde_json::from_str(include_str!("golden/mixed_fem.json")).expect("valid JSON");
    for (family, stored) in golden.as_object().expect("a table") {
        let known = FAMILIES.iter().find(|known| known.1 == family).expect("a family");
        let planar = planar::generate(Domain::Square, known.0, 8, 1).expect("a mesh");
        let operators =
            SurfaceOperators::new(&planar.mesh, &vec![true; planar.mesh.cells.len()]).expect("no flat triangle");
        let inside = planar
            .mesh
            .cells
            .iter()
            .zip(&planar.inside)
            .filter(|(_, inside)| **inside);
        let domain = TriangleMesh {
            cells: inside.map(|(&cell, _)| cell).collect(),
            ..planar.mesh.clone()
        };
        let (whole, within) = (mean_edge_length(&planar.mesh), mean_edge_length(&domain));
        let vertices: Vec<usize> = serde_json::from_value(stored["vertices"].clone()).expect("indices");
        for (index, &vertex) in vertices.iter().enumerate() {
            let point = numbers(&stored["points"][index]);
            assert_eq!(
                planar.mesh.points[vertex],
                [point[0], point[1], 0.0],
                "{family}: vertex {vertex}"
            );
            let diagonal = operators
                .pattern
                .row(vertex as u32)
                .find(|&place| operators.pattern.columns[place] as usize == vertex);
            for (value, name) in [
                (operators.hybrid[vertex], "hybrid"),
                (operators.barycentric[vertex], "barycentric"),
                (operators.laplacian[diagonal.expect("a diagonal")], "laplacian_diagonal"),
            ] {
                let expected = stored[name][index].as_f64().expect("a number");
                assert!((value - expected).abs() < 1e-12, "{family}: {name} of vertex {vertex}");
            }
        }
        for (name, expected) in stored["solutions"].as_object().expect("a table") {
            let expected = numbers(expected);
            for system in ["one-field", "mixed"] {
                let mut settings = scheme(name);
                let tangential = settings["relaxation"] == "tangential";
                if (settings["mass"] == "full" || tangential) && system == "one-field" {
                    continue;
                }
                settings["system"] = json!(system);
                if !tangential {
                    // The independent program takes the mean edge of the whole mesh, we that of the domain.
                    settings["stabilisation"] = json!((whole / within).powi(2));
                }
                let outcome = run(generated("square", json!({ "family": family, "cells": 8 })), settings)
                    .unwrap_or_else(|failure| panic!("{family}, {name}, {system}: {}", failure.reason));
                let solution = field(&outcome, "solution");
                for (&vertex, expected) in vertices.iter().zip(&expected) {
                    let difference = (solution[vertex] - expected).abs();
                    assert!(
                        difference < 1e-9,
                        "{family}, {name}, {system}: vertex {vertex} differs by {difference:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn every_scheme_reproduces_linear_functions_on_every_mesh() {
    let schemes = [
        "bih region hyb",
        "bih curve full",
        "bih curve hyb",
        "tri region hyb",
        "tri region bary",
        "tri curve1 hyb",
        "tri curve2 hyb",
        "tri (15)stab hyb",
        "tri (15)tangential hyb",
    ];
    for (domain, cells) in [("square", 8), ("l-shape", 8), ("disk", 8), ("annulus", 12)] {
        for &(family, name, _) in FAMILIES {
            if domain == "disk" && matches!(family, Family::Equi | Family::UnionJack | Family::CrissCross) {
                continue;
            }
            // Every scheme on the square, those that differ most elsewhere.
            for scheme_name in if domain == "square" {
                &schemes[..]
            } else {
                &schemes[6..]
            } {
                let mut settings = scheme(scheme_name);
                settings["function"] = json!("linear");
                let parameters = json!({ "family": name, "cells": cells, "seed": 5 });
                let outcome = run(generated(domain, parameters), settings)
                    .unwrap_or_else(|failure| panic!("{domain}, {name}, {scheme_name}: {}", failure.reason));
                let error = outcome.metrics["max_error"];
                assert!(error < 1e-10, "{domain}, {name}, {scheme_name}: error {error:e}");
            }
        }
    }
}

/// The L2 error of a scheme on a family.
fn error(family: &str, cells: usize, settings: Value) -> (f64, f64) {
    let model = generated("square", json!({ "family": family, "cells": cells, "seed": 3 }));
    let outcome = run(model, settings).expect("a solution");
    (outcome.metrics["h"], outcome.metrics["l2_error"])
}

#[test]
fn the_stabilised_system_converges_where_others_do_not() {
    let stabilised = json!({ "equation": "triharmonic", "condition": "curve" });
    let region = json!({ "equation": "triharmonic", "condition": "region" });
    let rate = |family: &str, settings: &Value| {
        // Far enough apart for the chance of a random mesh to count little.
        let (coarse, fine) = (error(family, 12, settings.clone()), error(family, 48, settings.clone()));
        (coarse.1 / fine.1).ln() / (coarse.0 / fine.0).ln()
    };
    for family in ["regular", "centroid-split", "minimum-angle-30"] {
        for relaxation in ["tangential", "linear", "quadratic"] {
            let mut settings = stabilised.clone();
            settings["relaxation"] = json!(relaxation);
            let found = rate(family, &settings);
            assert!((1.85..2.5).contains(&found), "{family}, {relaxation}: rate {found}");
        }
    }
    // 2.00 and 0.16 by the independent program.
    assert!((rate("regular", &region) - 2.0).abs() < 0.05);
    assert!(rate("centroid-split", &region) < 0.3);
}

#[test]
fn separate_parts_do_not_influence_each_other() {
    // Two squares of different size and resolution; the first alone, and beside the second.
    let square = |cells: usize, size: f64, shift: f64, first: usize| {
        let side = cells + 1;
        let at = |index: usize| size * index as f64 / cells as f64;
        let mut points = String::new();
        let mut faces = String::new();
        for index in 0..side * side {
            let (x, y) = (at(index % side), at(index / side));
            points += &format!("v {} {y} {}\n", x + shift, 0.1 * size * (3.0 * x / size).sin());
        }
        for index in (0..side * cells).filter(|index| index % side < cells) {
            let [a, b, c, d] = [index, index + 1, index + side + 1, index + side].map(|place| place + first);
            faces += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
        }
        points + &faces
    };
    let solve = |text: &str, relaxation: &str| {
        let settings = json!({
            "equation": "triharmonic", "condition": "curve", "data": "position", "relaxation": relaxation,
            "handles": [{ "select": "boundary" }],
        });
        field(&run(file(text), settings).expect("a surface"), "displacement")
    };
    for relaxation in ["tangential", "linear", "quadratic"] {
        let alone = solve(&square(12, 1.0, 0.0, 1), relaxation);
        let both = solve(&(square(12, 1.0, 0.0, 1) + &square(5, 100.0, 10.0, 170)), relaxation);
        let largest = alone.iter().copied().fold(0.0, f64::max);
        for (alone, both) in alone.iter().zip(&both) {
            assert!(
                (alone - both).abs() < 1e-9 * largest,
                "{relaxation}: {alone} and {both}"
            );
        }
    }
}

/// A flat grid of triangles as OBJ text, with a change to its lines.
pub(crate) fn grid(cells: usize, change: impl Fn(&mut Vec<String>)) -> String {
    let mut lines = Vec::new();
    for i in 0..=cells {
        for j in 0..=cells {
            lines.push(format!("v {i} {j} 0"));
        }
    }
    let name = |i: usize, j: usize| i * (cells + 1) + j + 1;
    for i in 0..cells {
        for j in 0..cells {
            let [a, b, c, d] = [name(i, j), name(i + 1, j), name(i + 1, j + 1), name(i, j + 1)];
            lines.push(format!("f {a} {b} {c}"));
            lines.push(format!("f {a} {c} {d}"));
        }
    }
    change(&mut lines);
    lines.join("\n") + "\n"
}

#[test]
fn input_that_cannot_be_used_is_an_error_that_names_the_place() {
    let plain = |_: &mut Vec<String>| {};
    let all = json!({ "handles": [{ "select": "all" }] });
    let none = json!({ "handles": [{ "select": "all", "role": "free" }], "data": "position" });
    let thin = json!({ "handles": [{ "select": "boundary" }] });
    let inner = json!({
        "condition": "curve",
        "handles": [{ "select": "boundary" }, { "select": "nearest", "center": [4, 4, 0] }],
    });
    let nothing = json!({ "handles": [{ "select": "sphere", "center": [99, 0, 0], "radius": 1 }] });
    let cases: Vec<(&str, String, Value, &str)> = vec![
        ("no free vertex", grid(8, plain), all, "leave no vertex free"),
        ("no fixed vertex", grid(8, plain), none, "has no fixed vertex"),
        (
            "a ring too thin",
            grid(8, plain),
            thin,
            "the fixed region is too thin: vertex 0",
        ),
        ("a point as a curve", grid(8, plain), inner, "fixed vertex 40"),
        (
            "a handle beside the mesh",
            grid(8, plain),
            nothing,
            "handle 0 (from 0) selects no vertex",
        ),
        (
            "too coarse a mesh",
            grid(2, plain),
            json!({ "equation": "triharmonic" }),
            "leave no vertex free",
        ),
        (
            "three triangles at an edge",
            grid(8, |lines| {
                lines.extend(["v 0 0 5".to_string(), "f 1 2 82".to_string(), "f 1 82 2".to_string()])
            }),
            json!({ "data": "position" }),
            "three or more triangles",
        ),
        (
            "a triangle without area",
            grid(8, |lines| lines[40] = "v 3 4 0".to_string()),
            json!({}),
            "has no area",
        ),
        (
            "a triangle with one vertex twice",
            grid(8, |lines| lines.push("f 1 1 2".to_string())),
            json!({}),
            "names a vertex twice",
        ),
        (
            "a surface for a function",
            grid(8, |lines| lines[40] = "v 4 4 1".to_string()),
            json!({ "data": "function" }),
            "needs a mesh in the plane",
        ),
        (
            "a hole where there is none",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n".to_string(),
            json!({ "fill": "largest" }),
            "no hole to fill",
        ),
    ];
    for (what, text, settings, message) in cases {
        match run(file(&text), settings) {
            Ok(_) => panic!("{what}: it ran"),
            Err(failure) => {
                assert_eq!(failure.kind, "invalid-input", "{what}");
                assert!(failure.reason.contains(message), "{what}: {}", failure.reason);
            }
        }
    }
    let two = grid(4, |lines| {
        let other = grid(4, |lines| {
            for line in lines.iter_mut() {
                let words: Vec<String> = line.split(' ').map(str::to_string).collect();
                let numbers = words[1..].iter().map(|word| word.parse::<i64>().expect("a number"));
                let shifted: Vec<String> = numbers
                    .map(|n| (n + if words[0] == "f" { 25 } else { 100 }).to_string())
                    .collect();
                *line = format!("{} {}", words[0], shifted.join(" "));
            }
        });
        lines.extend(other.lines().map(str::to_string));
    });
    let handles =
        json!({ "handles": [{ "select": "box", "min": [-1, -1, -1], "max": [0, 9, 9] }], "data": "position" });
    let failure = run(file(&two), handles).expect_err("a part without a fixed vertex");
    assert!(failure.reason.contains("2 parts"), "{}", failure.reason);
}

#[test]
fn contradictory_settings_are_refused_before_a_job_starts() {
    for (settings, path) in [
        (json!({ "mass": "full" }), "mass"),
        (json!({ "system": "mixed", "solver": "cholesky" }), "solver"),
        (json!({ "system": "one-field", "solver": "lu" }), "solver"),
        (
            json!({ "system": "one-field", "condition": "curve", "mass": "full" }),
            "system",
        ),
        (json!({ "handles": [{ "select": "sphere" }] }), "handles"),
        (
            json!({ "handles": [{ "select": "all", "translate": [0, 0, 1] }] }),
            "handles",
        ),
        (
            json!({ "handles": [{ "select": "box", "min": [0, 0], "max": [1, 1, 1] }] }),
            "handles",
        ),
    ] {
        let found = MixedFem.check(&settings);
        assert!(found.iter().any(|(place, _)| place == path), "{settings}: {found:?}");
    }
}

#[test]
fn a_filled_hole_joins_smoothly_and_frames_share_a_factorization() {
    let jump = |equation: &str, condition: &str| {
        let settings = json!({ "fill": "largest", "equation": equation, "condition": condition });
        let outcome = run(generated("cap", json!({ "rings": 12, "angle": 90.0 })), settings).expect("a surface");
        (
            outcome.metrics["tangent_jump_mean"],
            outcome.metrics["curvature_jump_mean"],
        )
    };
    let (biharmonic, triharmonic) = (jump("biharmonic", "region"), jump("triharmonic", "region"));
    assert!(
        triharmonic.0 < 6.0 && biharmonic.0 < 12.0,
        "{triharmonic:?} {biharmonic:?}"
    );
    assert!(triharmonic.1 < 0.6 * biharmonic.1, "{triharmonic:?} {biharmonic:?}");

    let settings = json!({
        "data": "position",
        "frames": 5,
        "handles": [
            { "select": "boundary", "rings": 2 },
            { "select": "nearest", "center": [0, 0, 0], "role": "moved", "translate": [0, 0, 0.5] },
        ],
    });
    let outcome = run(generated("square", json!({ "cells": 8 })), settings).expect("a surface");
    assert_eq!(
        (outcome.counters["factorizations"], outcome.counters["solutions"]),
        (1, 15)
    );
    assert!((outcome.metrics["displacement_max"] - 0.5).abs() < 1e-9);
    // The picture shows what is free, at its seam, and held; a single moved vertex has no triangle of its own.
    let content = format::read("result.vtu", outcome.mesh.as_ref().expect("a mesh")).expect("a VTU file");
    let parts = content
        .cell_data
        .iter()
        .find(|field| field.name == "free_seam_held_moved");
    let parts = &parts.expect("the field").values;
    let count = |part: f64| parts.iter().filter(|&&found| found == part).count();
    // 16 x 16 cells of two triangles, the outermost two layers held, and the two corners of the next that a diagonal
    // cuts off. The rest of that layer of 12 x 12 is the seam.
    assert_eq!(count(2.0), 2 * (16 * 16 - 12 * 12) + 2);
    assert!(count(1.0) > 2 * (12 * 12 - 10 * 10) - 4 && count(0.0) > 0 && count(3.0) == 0);
}

#[test]
fn results_have_the_same_bits_with_any_number_of_threads() {
    let result = |threads: usize| {
        with_threads(threads, || {
            let model = generated("square", json!({ "family": "minimum-angle-30", "cells": 24 }));
            let outcome = run(model, json!({ "equation": "triharmonic", "compare": true })).expect("a solution");
            (metric_bits(&outcome), outcome.mesh)
        })
    };
    let one = result(1);
    assert_eq!(one, result(2));
    assert_eq!(one, result(4));
}
