//! Mixed finite elements against stored solutions of an independent program, and the promises of the method.

use serde_json::{Value, json};
use vargeo::fem::surface::SurfaceOperators;
use vargeo::mesh::format;
use vargeo::mesh::planar::{self, Domain, FAMILIES, Family};
use vargeo::method::mixed_fem::MixedFem;
use vargeo::method::mixed_fem::settings::Settings;
use vargeo::method::model::{LoadedModel, Part};
use vargeo::method::{Failure, Inputs, Method, Outcome};
use vargeo::optimize::Silent;

/// A generated model.
fn generated(generator: &str, parameters: Value) -> LoadedModel {
    let part = Part::Generated {
        generator: generator.to_string(),
        parameters,
    };
    LoadedModel {
        parts: [("mesh".to_string(), part)].into(),
    }
}

/// A model from the text of an OBJ file.
fn file(text: &str) -> LoadedModel {
    let part = Part::File {
        name: "test.obj".to_string(),
        bytes: text.as_bytes().to_vec(),
        parameters: Value::Null,
    };
    LoadedModel {
        parts: [("mesh".to_string(), part)].into(),
    }
}

fn run(model: LoadedModel, settings: Value) -> Result<Outcome, Failure> {
    assert_eq!(MixedFem.check(&settings), Vec::new(), "valid settings");
    MixedFem.run(
        Inputs {
            settings: &settings,
            model,
        },
        &mut Silent,
    )
}

fn field(outcome: &Outcome, name: &str) -> Vec<f64> {
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
        "(15)stab" => ("curve", "stabilised"),
        "curve1" => ("curve", "first-order-ring"),
        _ => ("curve", "second-order-ring"),
    };
    json!({ "equation": equation, "condition": condition, "curve": curve, "mass": mass })
}

#[test]
fn solutions_agree_with_an_independent_program_in_both_systems() {
    let golden: Value = serde_json::from_str(include_str!("golden/mixed_fem.json")).expect("valid JSON");
    for (family, stored) in golden.as_object().expect("a table") {
        let known = FAMILIES.iter().find(|known| known.1 == family).expect("a family");
        let planar = planar::generate(Domain::Square, known.0, 8, 1).expect("a mesh");
        let operators =
            SurfaceOperators::new(&planar.mesh, &vec![true; planar.mesh.cells.len()]).expect("no flat triangle");
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
                if settings["mass"] == "full" && system == "one-field" {
                    continue;
                }
                settings["system"] = json!(system);
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
    ];
    for (domain, cells) in [("square", 8), ("l-shape", 8), ("disk", 8), ("annulus", 12)] {
        for &(family, name, _) in FAMILIES {
            if domain == "disk" && matches!(family, Family::Equi | Family::UnionJack | Family::CrissCross) {
                continue;
            }
            for scheme_name in schemes {
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
