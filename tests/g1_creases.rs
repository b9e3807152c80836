//! Surfaces with creases: the cut, the curves along them, patches on both sides.

use crate::sample::{self, file, generated, model};
use serde_json::{Value, json};
use vargeo::linalg::vector3::{cross, dot};
use vargeo::mesh::crease::{by_angle, by_label, by_list, cut};
use vargeo::mesh::generate::surface::generate_surface;
use vargeo::mesh::quadrilateral::Connectivity;
use vargeo::method::g1_surface::G1Surface;
use vargeo::method::model::Part;
use vargeo::method::{Failure, Outcome};
use vargeo::optimize::Silent;

fn run(parts: &[(&str, Part)], settings: Value) -> Result<Outcome, Failure> {
    sample::run(&G1Surface, model(parts.iter().cloned()), settings)
}

#[test]
fn a_cut_gives_every_side_its_vertices() {
    // Edges, corners, darts, parts that the cut surface falls into, vertices that are added.
    let cases = [
        ("cube", 12 * 2, 8, 0, 6, 8 * 2 + 12),
        ("cylinder", 2 * 8, 0, 0, 3, 2 * 8),
        ("ridge", 2, 0, 1, 1, 2),
    ];
    for (name, edges, corners, darts, parts, added) in cases {
        let generated = generate_surface(name, &json!({ "cells": 2 })).expect("valid");
        let (mesh, creased) = (generated.mesh, generated.creased.expect("creases"));
        let whole = Connectivity::of(&mesh.quads, mesh.points.len()).expect("a surface");
        let sharp = by_list(&whole, &creased.sharp).expect("edges");
        let found = cut(&mesh, &whole, sharp.clone());
        assert_eq!(
            (found.creases.len(), found.corners, found.darts, found.lone.len()),
            (edges, corners, darts, 0),
            "{name}"
        );
        assert_eq!(found.mesh.points.len() - mesh.points.len(), added, "{name}");
        assert_eq!(
            found.connectivity.boundary_edges(),
            whole.boundary_edges() + 2 * edges,
            "{name}"
        );
        for (quad, old) in found.mesh.quads.iter().zip(&mesh.quads) {
            assert_eq!(quad.map(|vertex| found.original[vertex as usize]), *old, "{name}");
        }
        // Pieces of one side hang together, those of different sides do not.
        let mut part: Vec<usize> = (0..found.mesh.points.len()).collect();
        for _ in 0..part.len() {
            for quad in &found.mesh.quads {
                let least = quad.iter().map(|&vertex| part[vertex as usize]).min().expect("four");
                quad.iter().for_each(|&vertex| part[vertex as usize] = least);
            }
        }
        part.sort_unstable();
        part.dedup();
        assert_eq!(part.len(), parts, "{name}");
        for pair in &found.creases {
            let points = pair.map(|edge| {
                let mut ends = found.connectivity.edges[edge as usize].map(|vertex| found.original[vertex as usize]);
                ends.sort_unstable();
                ends
            });
            assert_eq!(points[0], points[1], "{name}");
        }
        if name != "ridge" {
            let labels: Vec<f64> = creased.piece_of.iter().map(|&piece| f64::from(piece)).collect();
            assert_eq!(by_label(&whole, &labels), sharp, "{name}");
            assert_eq!(by_angle(&mesh, &whole, 60.0), sharp, "{name}");
        }
        // An edge between two ends has no sides.
        let mut lone = vec![false; whole.edges.len()];
        let inner = |&edge: &usize| {
            let ends = whole.edges[edge];
            ends.iter().all(|&vertex| !whole.on_boundary[vertex as usize])
        };
        let edge = (0..lone.len()).find(inner).expect("an inner edge");
        lone[edge] = true;
        let found = cut(&mesh, &whole, lone);
        assert_eq!((found.creases.len(), found.lone.len()), (0, 1));
        assert_eq!(found.mesh, mesh);
    }
}

#[test]
fn patches_meet_along_creases_and_are_smooth_elsewhere() {
    for (name, parameters, angle) in [
        ("cylinder", json!({ "cells": 2 }), 90.0),
        ("cube", json!({ "cells": 2, "bulge": 0.0 }), 90.0),
        ("cube", json!({ "cells": 3, "bulge": 0.4 }), 43.0),
        ("ridge", json!({ "cells": 3 }), 70.0),
    ] {
        for tangents in ["enclosing", "balanced"] {
            let settings = json!({ "tangents": tangents, "tessellation": 1 });
            let outcome = run(&[("mesh", generated(name, parameters.clone()))], settings).expect("a surface");
            let metric = |name: &str| outcome.metrics[name];
            assert_eq!(outcome.stop, "converged", "{name}: {}", outcome.reason);
            assert!(metric("angle_max") < 1e-10, "{name}: {} degrees", metric("angle_max"));
            assert!(metric("crease_gap") < 1e-15 && metric("gap") < 1e-15, "{name}");
            assert!(metric("curve_tangency") < 1e-14, "{name}");
            assert!(
                (metric("crease_turn") - angle).abs() < 15.0,
                "{name}: {}",
                metric("crease_turn")
            );
            assert!(metric("distance_max") < 0.02, "{name}: {}", metric("distance_max"));
            assert_eq!(metric("folded"), 0.0, "{name}");
        }
    }
    // Hexahedra go on over creases.
    let settings = json!({ "hexahedra": "inward", "tessellation": 1 });
    let outcome = run(&[("mesh", generated("cube", json!({ "cells": 2 })))], settings).expect("hexahedra");
    assert_eq!(outcome.metrics["jacobian_certified"], 24.0);
    // Smoothed over, the same edges count as any other.
    let settings = json!({ "creases": "smooth", "tessellation": 1 });
    let outcome = run(&[("mesh", generated("cube", json!({ "cells": 3 })))], settings).expect("a surface");
    assert!(outcome.metrics["angle_max"] < 1e-10 && outcome.metrics["crease_edges"] == 0.0);
}

/// A box of quads as OBJ, one quad a face, with points that are no multiples of each other.
const BOX: &str = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 0 0 3\nv 2 0 3\nv 2 1 3\nv 0 1 3\n\
                   f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

#[test]
fn creases_come_from_angles_lists_and_labels() {
    let settings = json!({ "crease_angle": 30.0, "tessellation": 1 });
    let by_angle = run(&[("mesh", file("box.obj", BOX))], settings).expect("a box");
    let metric = |outcome: &Outcome, name: &str| outcome.metrics[name];
    assert_eq!(metric(&by_angle, "crease_edges"), 12.0);
    assert_eq!(metric(&by_angle, "crease_corners"), 8.0);
    assert!((metric(&by_angle, "area") - 22.0).abs() < 1e-12);
    let list = "# bottom\n0 1\n1 2\n2 3\n3 0\n\n4 5 # top\n5 6\n6 7\n7 4\n0 4\n1 5\n2 6\n3 7\n";
    let parts = [("mesh", file("box.obj", BOX)), ("creases", file("list.txt", list))];
    let listed = run(&parts, json!({ "tessellation": 1 })).expect("a box");
    let medit = "MeshVersionFormatted 2\nDimension 3\nVertices 8\n0 0 0 0\n2 0 0 0\n2 1 0 0\n0 1 0 0\n0 0 3 0\n2 0 3 0\n\
                 2 1 3 0\n0 1 3 0\nQuadrilaterals 6\n4 3 2 1 1\n5 6 7 8 2\n1 2 6 5 3\n2 3 7 6 4\n3 4 8 7 5\n4 1 5 8 6\nEnd\n";
    let settings = json!({ "crease_field": "reference", "tessellation": 1 });
    let labelled = run(&[("mesh", file("box.mesh", medit))], settings).expect("a box");
    for other in [&listed, &labelled] {
        assert_eq!(other.mesh, by_angle.mesh);
        assert_eq!(metric(other, "crease_edges"), 12.0);
    }
    // Normals of the corners, different on both sides of every edge; one quad listed the other way round.
    let mut corners = BOX.split_once("f ").expect("faces").0.to_string();
    corners.push_str("vn 0 0 -2\nvn 0 0 1\nvn 0 -1 0\nvn 1 0 0\nvn 0 1 0\nvn -1 0 0\n");
    for (normal, quad) in [
        [4, 3, 2, 1],
        [5, 6, 7, 8],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [7, 8, 4, 3],
        [4, 1, 5, 8],
    ]
    .into_iter()
    .enumerate()
    {
        let words = quad.map(|vertex: usize| format!("{vertex}//{}", normal + 1));
        corners.push_str(&format!("f {}\n", words.join(" ")));
    }
    let settings = json!({ "crease_normals": true, "tessellation": 1 });
    let named = run(&[("mesh", file("box.obj", corners.as_str()))], settings.clone()).expect("a box");
    assert_eq!(metric(&named, "crease_edges"), 12.0);
    assert!((metric(&named, "area") - 22.0).abs() < 1e-12 && metric(&named, "angle_max") == 0.0);
    let without = run(&[("mesh", file("box.obj", BOX))], settings)
        .expect_err("no normals")
        .reason;
    assert!(without.contains("crease_normals needs"), "{without}");
    // Corner normals that are summed, and given normals that creases replace, are told.
    let told = |settings: Value, word: &str| {
        let outcome = run(&[("mesh", file("box.obj", corners.as_str()))], settings).expect("a box");
        assert!(
            outcome.notices.iter().any(|notice| notice.contains(word)),
            "{word}: {:?}",
            outcome.notices
        );
    };
    told(json!({ "tessellation": 1 }), "at 8 vertices, the first is vertex 0");
    told(json!({ "tessellation": 1 }), "12 edges are sharper than 60 degrees");
    told(
        json!({ "crease_angle": 30.0, "tessellation": 1 }),
        "given at 8 vertices on creases",
    );
    // With one normal a vertex for all walls, their creases with the top would run on around its corners.
    let ring = "0 1\n1 2\n2 3\n3 0\n4 5\n5 6\n6 7\n7 4\n";

    let reason = |parts: &[(&str, Part)], settings: Value| run(parts, settings).expect_err("bad input").reason;
    let with = |list: &str| [("mesh", file("box.obj", BOX)), ("creases", file("list.txt", list))];
    assert!(reason(&with(ring), json!({})).contains("may not turn within one quadrilateral"));
    assert!(reason(&with("0 1\n0 6\n"), json!({})).contains("vertices 0 and 6"));
    assert!(reason(&with("0 1\n0 8\n"), json!({})).contains("line 2: `8`"));
    assert!(reason(&with("0 1 2\n"), json!({})).contains("line 1: 3 words"));
    let field = json!({ "crease_field": "colour" });
    assert!(reason(&[("mesh", file("box.mesh", medit))], field.clone()).contains("`reference`"));
    assert!(reason(&[("mesh", generated("cube", json!({})))], field).contains("generated"));
}

#[test]
fn a_crease_is_perpendicular_to_the_normals_of_both_sides() {
    use vargeo::method::g1_surface::problem::Problem;
    use vargeo::method::g1_surface::settings::Settings;
    let model = model([("mesh", generated("cube", json!({ "cells": 2 })))]);
    let settings = Settings::resolve(&json!({})).expect("defaults");
    let problem = Problem::new(&model, &settings, &Silent).expect("a cube");
    let creases = problem.creases.as_ref().expect("creases");
    let (network, notices) = vargeo::method::g1_surface::network::Network::creased(
        &problem.mesh,
        problem.connectivity.clone(),
        &problem.normals,
        Some(creases),
    )
    .expect("normals that fit");
    assert!(notices.is_empty(), "{notices:?}");
    for &[one, other] in &creases.pairs {
        let [one, other] = [one, other].map(|edge| edge as usize);
        let ends = network.connectivity.edges[one];
        for (end, vertex) in ends.into_iter().enumerate() {
            let [n, m] = {
                let far = network.connectivity.edges[other];
                let same = far
                    .into_iter()
                    .find(|&other| creases.original[other as usize] == creases.original[vertex as usize]);
                [vertex, same.expect("the same ends")].map(|vertex| network.normals[vertex as usize])
            };
            let tangent = network.tangents[one][end];
            let line = cross(n, m);
            assert!(dot(tangent, n).abs() < 1e-15 && dot(tangent, m).abs() < 1e-15);
            let along = cross(line, tangent);
            assert!(dot(along, along) < 1e-28, "along the line of both planes");
        }
    }
}
