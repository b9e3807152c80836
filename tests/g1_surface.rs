//! G1 surfaces against stored figures of an independent program, and the promises of the method.

use crate::quadrilaterals::length;
use crate::sample::{self, generated, model};
use serde_json::{Value, json};
use vargeo::linalg::vector3::{dot, subtract};
use vargeo::mesh::generate::surface::{generate_surface, surfaces};
use vargeo::mesh::quadrilateral::{Connectivity, QuadrilateralMesh};
use vargeo::method::g1_surface::network::{Network, natural};
use vargeo::method::g1_surface::patch::{Operator, Patch, Reference, Solve, fit};
use vargeo::method::g1_surface::{
    G1Surface, balance, continuity, edge_normals, enclosure, hermite, laplace_beltrami, least_squares, patch, surface,
};
use vargeo::method::model::Part;
use vargeo::method::{Failure, Outcome};
use vargeo::optimize::Silent;

fn golden() -> Value {
    serde_json::from_str(include_str!("golden/g1_surface.json")).expect("the stored file is valid JSON")
}

fn rows<T: serde::de::DeserializeOwned>(value: &Value) -> T {
    serde_json::from_value(value.clone()).expect("rows of numbers")
}

pub(crate) fn network_of(mesh: &QuadrilateralMesh) -> Network {
    let connectivity = Connectivity::of(&mesh.quads, mesh.points.len()).expect("an oriented surface");
    let normals = mesh.normals.as_ref().expect("normals");
    Network::natural(mesh, connectivity, normals)
        .expect("normals that fit")
        .0
}

/// The default construction.
pub(crate) fn patches(network: &mut Network) -> Vec<Patch> {
    enclosure::enclose(network, &mut Silent).expect("a small system");
    let slopes = edge_normals::exact(network, true).expect("a small system");
    (0..network.quads.len())
        .map(|quad| {
            fit(
                network,
                &slopes,
                quad,
                Solve::Exact,
                Reference::Adini,
                Operator::Laplacian,
            )
            .patch
        })
        .collect()
}

pub(crate) fn small(name: &str) -> Value {
    match name {
        "sphere" => json!({ "cells": 2 }),
        "ellipsoid" => json!({ "cells": 3, "jitter": 0.2 }),
        "head" => json!({ "cells": 6 }),
        "torus" => json!({ "around": 8, "across": 6, "jitter": 0.15 }),
        "poles" => json!({ "valence": 8, "cells": 2 }),
        "saddle" => json!({ "cells": 5, "jitter": 0.2 }),
        "cube" | "ridge" => json!({ "cells": 2 }),
        _ => Value::Null,
    }
}

pub(crate) fn run(part: Part, settings: Value) -> Result<Outcome, Failure> {
    sample::run(&G1Surface, model([("mesh", part)]), settings)
}

pub(crate) fn file(text: &str) -> Part {
    sample::file("mesh.obj", text)
}

#[test]
fn natural_cubics_equal_the_stored_ones_and_solve_the_papers_system() {
    for curve in golden()["curves"].as_array().expect("a list") {
        let [p1, p2, n1, n2, t1, t2] = ["p1", "p2", "n1", "n2", "t1", "t2"].map(|name| rows::<[f64; 3]>(&curve[name]));
        let found = natural([p1, p2], [n1, n2]);
        let [l1, l2] = found.multipliers;
        for (tangent, stored) in found.tangents.iter().zip([t1, t2]) {
            assert!(length(subtract(*tangent, stored)) < 1e-13);
        }
        for (multiplier, stored) in [(l1, &curve["l1"]), (l2, &curve["l2"])] {
            assert!((multiplier - stored.as_f64().expect("a number")).abs() < 1e-12);
        }
        // X''(0) = l1 n1 and X''(1) = l2 n2.
        let coefficients = [p1, p2, found.tangents[0], found.tangents[1]];
        for (x, multiplier, normal) in [(0.0, l1, n1), (1.0, l2, n2)] {
            let second = hermite::combine(&hermite::second_derivatives(x), &coefficients);
            let wanted = normal.map(|component| multiplier * component);
            assert!(length(subtract(second, wanted)) < 1e-12);
        }
    }
}

#[test]
fn tangents_that_meet_the_enclosure_condition_equal_the_stored_ones() {
    let golden = &golden()["ellipsoid"];
    let mesh = QuadrilateralMesh {
        points: rows(&golden["V"]),
        quads: rows(&golden["Q"]),
        normals: Some(rows(&golden["N"])),
    };
    let mut network = network_of(&mesh);
    let ends: Vec<[u32; 2]> = rows(&golden["edges"]);
    let places: Vec<usize> = ends
        .iter()
        .map(|edge| {
            network
                .connectivity
                .edges
                .iter()
                .position(|other| other == edge)
                .expect("the same edges")
        })
        .collect();
    let stored: Vec<f64> = rows(&golden["enclosure_natural"]);
    let mut spokes = Vec::new();
    for (vertex, stored) in stored.iter().enumerate() {
        if network.is_even(vertex) {
            network.spokes(vertex, &mut spokes);
            // The stored fans may start at another spoke, which changes the sign.
            let found = enclosure::violation(&spokes, network.normals[vertex]);
            assert!(
                (found.abs() - stored.abs()).abs() < 1e-13,
                "vertex {vertex}: {found} and {stored}"
            );
        }
    }
    let compare = |network: &Network, name: &str, end: usize, tolerance: f64| {
        let stored: Vec<[f64; 3]> = rows(&golden[name]);
        for (&place, stored) in places.iter().zip(stored) {
            let error = length(subtract(network.tangents[place][end], stored));
            assert!(error < tolerance, "{name}: {error}");
        }
    };
    compare(&network, "natural_t1", 0, 1e-14);
    let done = enclosure::enclose(&mut network, &mut Silent).expect("a small system");
    assert!(done.before > 1e-3 && done.residual < 1e-14, "{done:?}");
    // The program that made the stored ones differentiates numerically.
    compare(&network, "t1", 0, 1e-8);
    compare(&network, "t2", 1, 1e-8);
}

#[test]
fn normals_agree_along_every_edge_of_every_generated_surface() {
    // Those of the cylinder with one normal a vertex are too far from its quads; see the tests of creases.
    for generator in surfaces().iter().filter(|generator| generator.name != "cylinder") {
        let name = generator.name;
        let mesh = generate_surface(name, &small(name)).expect("valid").mesh;
        let mut network = network_of(&mesh);
        let rough: Vec<Patch> = (0..mesh.quads.len())
            .map(|quad| patch::continuous(&network, quad, Operator::Laplacian).patch)
            .collect();
        let rough = continuity::measure(&rough, &network.connectivity);
        let smooth = continuity::measure(&patches(&mut network), &network.connectivity);
        assert!(smooth.gap < 1e-14, "{name}: gap {}", smooth.gap);
        assert!(smooth.largest < 1e-10, "{name}: {} degrees", smooth.largest);
        // The measure sees patches that only share their curves.
        assert!(
            name == "strip" || rough.largest > 1e-2,
            "{name}: {} degrees",
            rough.largest
        );
    }
}

#[test]
fn every_way_to_the_normals_gives_the_same_promise() {
    let mesh = generate_surface("torus", &small("torus")).expect("valid").mesh;
    let natural = network_of(&mesh);
    let mut network = natural.clone();
    enclosure::enclose(&mut network, &mut Silent).expect("a small system");
    let short = edge_normals::exact(&network, true).expect("a small system");
    let local = edge_normals::exact(&network, false).expect("no system");
    let squares = |slopes: &edge_normals::Slopes| slopes.iter().flatten().map(|&b| dot(b, b)).sum::<f64>();
    for slopes in [&short, &local] {
        let residuals = edge_normals::residuals(&network, slopes);
        assert!(
            residuals.perpendicular < 1e-13 && residuals.twist < 1e-13,
            "{residuals:?}"
        );
    }
    assert!(squares(&short) < squares(&local));
    // The shortest of all solutions is what a singular value decomposition finds.
    let solved = least_squares::solve(&network, 1e-10).expect("a small system");
    for (a, b) in solved.slopes.iter().flatten().zip(short.iter().flatten()) {
        assert!(length(subtract(*a, *b)) < 1e-9);
    }
    let mut network = natural.clone();
    let balanced = balance::balance(&mut network, 10.0, None, &mut Silent).expect("a small system");
    assert!(balanced.residual < 1e-12, "{}", balanced.residual);
    let residuals = edge_normals::residuals(&network, &balanced.slopes);
    assert!(
        residuals.perpendicular < 1e-12 && residuals.twist < 1e-12,
        "{residuals:?}"
    );
    // The paper's steps on the paper's curves cannot: the measure is able to fail.
    let solved = least_squares::solve(&natural, 1e-10).expect("a small system");
    assert!(edge_normals::residuals(&natural, &solved.slopes).twist > 1e-3);
}

#[test]
fn the_rank_of_the_papers_system_is_known() {
    for (name, parameters) in [
        ("ellipsoid", json!({ "cells": 2 })),
        ("poles", json!({ "valence": 5, "cells": 1 })),
    ] {
        let network = network_of(&generate_surface(name, &parameters).expect("valid").mesh);
        let expected = 6 * network.tangents.len() - network.even_vertices();
        assert_eq!(least_squares::rank(&network, 1e-10), Some(expected), "{name}");
    }
}

#[test]
fn plane_data_give_plane_patches_and_derivatives_fit() {
    let flat = generate_surface("saddle", &json!({ "cells": 3, "height": 0.0, "jitter": 0.2 }))
        .expect("valid")
        .mesh;
    for patch in patches(&mut network_of(&flat)) {
        assert!(patch.iter().all(|coefficient| coefficient[2].abs() < 1e-14));
    }
    let curved = generate_surface("ellipsoid", &small("ellipsoid")).expect("valid").mesh;
    let patch = patches(&mut network_of(&curved))[4];
    let (u, v, step) = (0.3, 0.6, 1e-4);
    let at = |u: f64, v: f64| surface::evaluate(&patch, &surface::Place::new(u), &surface::Place::new(v));
    let here = at(u, v);
    for axis in 0..3 {
        let difference = |a: [f64; 3], b: [f64; 3]| (a[axis] - b[axis]) / (2.0 * step);
        assert!((difference(at(u + step, v).position, at(u - step, v).position) - here.u[axis]).abs() < 1e-6);
        assert!((difference(at(u + step, v).u, at(u - step, v).u) - here.uu[axis]).abs() < 1e-6);
        assert!((difference(at(u, v + step).u, at(u, v - step).u) - here.uv[axis]).abs() < 1e-6);
        assert!((difference(at(u, v + step).v, at(u, v - step).v) - here.vv[axis]).abs() < 1e-6);
    }
    // The control points span the same surface.
    let control = surface::control_points(&patch);
    let weights = |t: f64| {
        let s = 1.0 - t;
        [
            s * s * s * s,
            4.0 * s * s * s * t,
            6.0 * s * s * t * t,
            4.0 * s * t * t * t,
            t * t * t * t,
        ]
    };
    let (f, g) = (weights(u), weights(v));
    for axis in 0..3 {
        let value: f64 = (0..25)
            .map(|index| f[index / 5] * g[index % 5] * control[index][axis])
            .sum();
        assert!((value - here.position[axis]).abs() < 1e-14);
    }
}

#[test]
fn folded_patches_are_repaired() {
    // Slopes found vertex by vertex grow where curves are shallow and symmetric: patches of the saddle turn over.
    let saddle = || generated("saddle", json!({ "cells": 8, "jitter": 0.2 }));
    let left = json!({ "edge_normals": "local", "repair": false, "tessellation": 1 });
    let folded = run(saddle(), left).expect("a surface");
    assert!(folded.metrics["folded"] > 0.0 && folded.metrics["normal_slope"] > 10.0);
    assert!(
        folded.stop == "folded" && folded.reason.contains("the first is patch"),
        "{}: {}",
        folded.stop,
        folded.reason
    );
    let repaired = run(saddle(), json!({ "edge_normals": "local", "tessellation": 1 })).expect("a surface");
    assert!(repaired.counters["repairs"] > 0);
    assert_eq!(repaired.metrics["folded"], 0.0);
    assert!(
        repaired.metrics["angle_max"] < 1e-10
            && repaired.metrics["normal_slope"] < 0.5 * folded.metrics["normal_slope"]
    );
    assert!(repaired.metrics["distance_max"] < 0.1 * folded.metrics["distance_max"]);
    assert!(repaired.notices.is_empty(), "{:?}", repaired.notices);
    assert_eq!(repaired.stop, "converged");
    // A corner that is turned over cannot be repaired.
    let dent = "v 0 0 0\nv 1 0 0\nv 0.2 0.2 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n";
    let left = run(file(dent), json!({})).expect("a folded surface");
    assert_eq!(left.stop, "folded", "{}", left.reason);
    assert!(
        left.reason
            .contains("patch 0 over the quadrilateral with vertices [0, 1, 2, 3]"),
        "{}",
        left.reason
    );
    assert!(
        left.notices.iter().any(|notice| notice.contains("still fold after")),
        "{:?}",
        left.notices
    );
}

#[test]
fn normals_that_disagree_do_not_converge() {
    let paper = run(
        generated("ellipsoid", json!({ "cells": 3 })),
        json!({ "preset": "paper", "tessellation": 1 }),
    );
    let paper = paper.expect("a surface");
    assert!(paper.metrics["angle_max"] > 1e-3);
    assert!(
        paper.stop == "stalled" && paper.reason.contains("natural cubics"),
        "{}",
        paper.reason
    );
    // The tolerance says nothing about a network that is too large for singular values.
    let settings = json!({ "preset": "paper", "rank_tolerance": 1e-3, "tessellation": 1 });
    for (cells, told) in [(3, false), (6, true)] {
        let outcome = run(generated("ellipsoid", json!({ "cells": cells })), settings.clone()).expect("a surface");
        let notices = &outcome.notices;
        assert_eq!(
            notices.iter().any(|notice| notice.contains("rank_tolerance")),
            told,
            "{notices:?}"
        );
    }
}

/// A generated mesh as the text of an OBJ file with normals, scaled, then shifted.
pub(crate) fn written(mesh: &QuadrilateralMesh, scale: f64, shift: f64) -> String {
    let mut text = String::new();
    for point in &mesh.points {
        let [x, y, z] = point.map(|coordinate| scale * coordinate + shift);
        text.push_str(&format!("v {x:?} {y:?} {z:?}\n"));
    }
    for [x, y, z] in mesh.normals.as_ref().expect("normals") {
        text.push_str(&format!("vn {x:?} {y:?} {z:?}\n"));
    }
    for quad in &mesh.quads {
        let words = quad.map(|vertex| format!("{0}//{0}", vertex + 1));
        text.push_str(&format!("f {}\n", words.join(" ")));
    }
    text
}

#[test]
fn middle_nodes_make_the_energy_least() {
    let mesh = generate_surface("ellipsoid", &small("ellipsoid")).expect("valid").mesh;
    for operator in [Operator::Laplacian, Operator::Printed] {
        let network = network_of(&mesh);
        let fitted = patch::continuous(&network, 5, operator);
        // The integrand has degree 8 in either parameter: the rule is exact.
        let energy = |change: [f64; 3]| -> f64 {
            let mut patch = fitted.patch;
            patch[patch::CENTRE] = std::array::from_fn(|axis| patch[patch::CENTRE][axis] + change[axis]);
            let mut sum = 0.0;
            for (u, weight) in patch::GAUSS_5 {
                for (v, other) in patch::GAUSS_5 {
                    let jet = surface::evaluate(&patch, &surface::Place::new(u), &surface::Place::new(v));
                    let image: [f64; 3] = std::array::from_fn(|axis| {
                        let mixed = if operator == Operator::Printed {
                            jet.uv[axis]
                        } else {
                            0.0
                        };
                        jet.uu[axis] + mixed + jet.vv[axis]
                    });
                    sum += weight * other * dot(image, image);
                }
            }
            sum
        };
        let least = energy([0.0; 3]);
        assert!(
            (least - fitted.energy[1]).abs() < 1e-12 * (1.0 + least),
            "{least} and {:?}",
            fitted.energy
        );
        for axis in 0..3 {
            for step in [1.0, 0.1, 0.01] {
                let mut change = [0.0; 3];
                change[axis] = step;
                let (up, down) = (
                    energy(change) - least,
                    energy(change.map(|component| -component)) - least,
                );
                // A parabola about its least value: both sides rise alike.
                assert!(
                    up > 0.0 && (up - down).abs() < 1e-9 * up + 1e-12,
                    "step {step}: {up} and {down}"
                );
            }
        }
    }
}

#[test]
fn twists_at_the_corners_follow_from_the_normals() {
    let mesh = generate_surface("torus", &small("torus")).expect("valid").mesh;
    let mut network = network_of(&mesh);
    let patches = patches(&mut network);
    let step = 1e-5;
    for (patch, quad) in patches.iter().zip(&mesh.quads) {
        // X_uv . n = -X_u . n_v with the patch's own unit normal, differentiated along the side v by differences.
        let at = |u: f64, v: f64| surface::evaluate(patch, &surface::Place::new(u), &surface::Place::new(v));
        let unit = |v: f64| {
            let area = at(0.0, v).area_vector();
            area.map(|component| component / length(area))
        };
        let here = at(0.0, 0.0);
        let normal = network.normals[quad[0] as usize];
        assert!(length(subtract(unit(0.0), normal)) < 1e-12);
        let (one, two) = (unit(step), unit(2.0 * step));
        let slope = std::array::from_fn(|axis| (4.0 * one[axis] - two[axis] - 3.0 * normal[axis]) / (2.0 * step));
        let (twist, wanted) = (dot(here.uv, normal), -dot(here.u, slope));
        assert!(
            (twist - wanted).abs() < 1e-6 * (1.0 + wanted.abs()),
            "{twist} and {wanted}"
        );
    }
}

#[test]
fn quads_by_dual_contouring_lie_on_their_surface() {
    let with = |mesh: Part, surface: Part, settings: Value| {
        sample::run(&G1Surface, model([("mesh", mesh), ("surface", surface)]), settings)
    };
    let contour = || generated("dual-contouring", json!({ "cells": 10, "smoothing": 10 }));
    let torus = generated("torus", json!({ "around": 48, "across": 24 }));
    let outcome = with(contour(), torus, json!({ "tessellation": 1 })).expect("a surface");
    let metric = |name: &str| outcome.metrics[name];
    // A torus: V - E + F = 0, and every quad has four half edges.
    assert_eq!(metric("vertices") - metric("edges") + metric("quads"), 0.0);
    assert_eq!(metric("boundary_edges"), 0.0);
    assert!(metric("angle_max") < 1e-8, "{}", metric("angle_max"));
    assert_eq!(metric("folded"), 0.0);
    assert!(metric("distance_max") < 0.05, "{}", metric("distance_max"));
    let open = with(contour(), generated("saddle", json!({})), json!({})).expect_err("open");
    assert!(open.reason.contains("the surface is open"), "{}", open.reason);
    let fine = generated("dual-contouring", json!({ "cells": 512 }));
    let many = with(fine, generated("sphere", json!({})), json!({})).expect_err("too many cubes");
    assert!(many.reason.contains("cubes"), "{}", many.reason);
    let missing = run(contour(), json!({})).expect_err("no surface");
    assert!(
        missing.reason.contains("needs the model's `surface`"),
        "{}",
        missing.reason
    );
}

#[test]
fn curves_tend_to_the_chord_with_the_normals() {
    for exponent in 0..=15 {
        let tilt = 10f64.powi(-exponent);
        let outcome = run(generated("strip", json!({ "tilt": tilt })), json!({})).expect("a surface");
        let height = outcome.metrics["chord_distance"];
        if tilt <= 1e-2 {
            let ratio = height / (tilt * 4.0 / 27.0);
            assert!((ratio - 1.0).abs() < 1e-3, "tilt {tilt}: {height}");
        }
        assert!(outcome.metrics["normal_slope"] < 10.0 * tilt, "tilt {tilt}");
        assert_eq!(outcome.metrics["folded"], 0.0);
    }
}

#[test]
fn the_test_problem_converges_as_fast_as_the_geometry_allows() {
    let error = |cells: usize, facets: bool, order: usize| {
        let generated = generate_surface("sphere", &json!({ "cells": cells })).expect("valid");
        let mut network = network_of(&generated.mesh);
        let patches = if facets {
            generated
                .mesh
                .quads
                .iter()
                .map(|&quad| patch::bilinear(generated.mesh.corners(quad)))
                .collect()
        } else {
            patches(&mut network)
        };
        let exact = generated.exact.expect("a formula");
        let solved = laplace_beltrami::solve(&patches, &network.quads, &network.connectivity, &exact, order)
            .expect("a positive system");
        (solved.error, solved.gradient_error)
    };
    let rates = |facets: bool, order: usize| {
        let (coarse, fine) = (error(4, facets, order), error(8, facets, order));
        ((coarse.0 / fine.0).log2(), (coarse.1 / fine.1).log2())
    };
    let rate = |facets: bool, order: usize| rates(facets, order).0;
    // Gradients of functions of order p converge with p, but no faster than the geometry.
    for (facets, order, expected) in [(true, 1, 1.0), (true, 3, 2.0), (false, 2, 2.0), (false, 3, 3.0)] {
        let found = rates(facets, order).1;
        assert!(
            (found - expected).abs() < 0.4,
            "facets {facets}, order {order}: {found}"
        );
    }
    assert!((rate(true, 1) - 2.0).abs() < 0.2, "facets, order 1: {}", rate(true, 1));
    assert!((rate(true, 3) - 2.0).abs() < 0.2, "facets, order 3: {}", rate(true, 3));
    assert!(rate(false, 2) > 2.7, "patches, order 2: {}", rate(false, 2));
    assert!(rate(false, 3) > 3.6, "patches, order 3: {}", rate(false, 3));
    assert!(error(4, false, 3).0 < 0.1 * error(4, true, 3).0);
}

#[test]
fn what_cannot_be_used_is_named() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let reason = |text: String, settings: Value| run(file(&text), settings).expect_err("bad input").reason;
    // A vertex without a normal, one with a normal in the plane of its edges, one along an edge.
    let text = format!("{square}vn 0 0 1\nf 1//1 2//1 3//1 4\n");
    assert!(reason(text, json!({})).contains("vertex 3 (from 0) has no normal"));
    let text = format!("{square}vn 0 0 1\nvn 1 1 0\nf 1//1 2//1 3//1 4//2\n");
    assert!(reason(text, json!({})).contains("vertex 3"));
    let text = format!("{square}vn 0 0 1\nvn 1 0 0\nf 1//1 2//2 3//1 4//1\n");
    assert!(reason(text, json!({})).contains("vertex 1"));
    let text = format!("{square}f 1 2 3 4\nf 1 2 3\n");
    assert!(reason(text, json!({})).contains("triangles"));
    let text = "v 0 0 0\nv 0 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n".to_string();
    assert!(reason(text, json!({})).contains("without length"));
    let text = format!("{square}v 0 0 1\nv 1 0 1\nv 0 -1 0\nv 1 -1 0\nf 1 2 3 4\nf 2 1 5 6\nf 1 2 8 7\n");
    assert!(reason(text, json!({})).contains("more than two"));
    let text = format!("{square}f 1 2 3 4\n");
    assert!(reason(text.clone(), json!({ "vertex_normals": "given" })).contains("no normals"));
    assert!(reason(text.clone(), json!({ "vertex_normals": "surface" })).contains("no `surface`"));
    assert!(reason(text.clone(), json!({ "order": 2 })).contains("formula"));
    // The same square is fine as it is.
    let outcome = run(file(&text), json!({})).expect("a plane patch");
    assert_eq!(outcome.stop, "converged");
    assert!((outcome.metrics["area"] - 1.0).abs() < 1e-14);
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_string();
    let triangles = reason(text, json!({}));
    assert!(triangles.contains("this is a triangle mesh") && triangles.contains("triangles = \"split\""));
}
