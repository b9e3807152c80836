//! The linear solvers of mixed finite elements: one solution whatever the factorization, pivots, rounding, singularity.

use crate::mixed_fem::{field, file, generated, grid, run};
use serde_json::{Value, json};

#[test]
fn symmetric_factorizations_hold_for_the_mixed_systems_of_larger_meshes() {
    for (family, condition) in [
        ("regular", "region"),
        ("regular", "curve"),
        ("minimum-angle-30", "curve"),
        ("minimum-angle-1", "region"),
    ] {
        for equation in ["biharmonic", "triharmonic"] {
            for solver in ["ldlt", "lblt"] {
                let settings = json!({
                    "equation": equation, "condition": condition, "system": "mixed", "solver": solver, "compare": true,
                    "relaxation": "linear",
                });
                let outcome = run(generated("square", json!({ "family": family, "cells": 32 })), settings)
                    .unwrap_or_else(|failure| panic!("{family}, {condition}, {equation}: {}", failure.reason));
                let difference = outcome.metrics["difference"];
                assert!(
                    difference < 1e-9,
                    "{family}, {condition}, {equation}, {solver}: {difference:e}"
                );
            }
        }
    }
}

#[test]
fn what_has_no_second_system_has_the_same_solution_by_other_pivots() {
    for family in ["criss-cross", "minimum-angle-1"] {
        let solution = |solver: &str| {
            let settings = json!({
                "equation": "triharmonic", "condition": "curve", "solver": solver, "compare": true,
            });
            let outcome =
                run(generated("square", json!({ "family": family, "cells": 24 })), settings).expect("a solution");
            assert!(outcome.metrics["difference"].is_nan());
            let told = |notice: &String| notice.contains("no comparison") && notice.contains("tangential");
            assert!(outcome.notices.iter().any(told), "{:?}", outcome.notices);
            field(&outcome, "solution")
        };
        let first = solution("ldlt");
        for other in ["lblt", "lu"] {
            for (first, other) in first.iter().zip(solution(other)) {
                assert!((first - other).abs() < 1e-9, "{family}: {first} and {other}");
            }
        }
    }
}

#[test]
fn known_signs_are_the_default_and_pivoting_answers_where_they_fail() {
    let solve = |settings: Value| {
        run(
            generated("square", json!({ "family": "regular", "cells": 8 })),
            settings,
        )
    };
    for curve in ["stabilised", "first-order-ring", "second-order-ring"] {
        let settings = json!({ "equation": "triharmonic", "condition": "curve", "curve": curve });
        let outcome = solve(settings).expect("a solution");
        assert!(outcome.reason.contains("ldlt"), "{curve}: {}", outcome.reason);
        assert_eq!(outcome.counters["fallbacks"], 0);
    }
    // No diagonal for w on the boundary: without pivots there is no factorization.
    let settings = json!({
        "equation": "triharmonic", "condition": "curve", "curve": "unstabilised", "system": "mixed",
        "on_singular": "continue", "solver": "ldlt",
    });
    let outcome = solve(settings).expect("an outcome");
    assert!(
        outcome.stop == "singular" && outcome.reason.contains("sign"),
        "{}",
        outcome.reason
    );
}

/// A sphere of eight triangles or its refinements, closed, as OBJ text.
fn octahedron() -> String {
    let points = ["1 0 0", "-1 0 0", "0 1 0", "0 -1 0", "0 0 1", "0 0 -1"];
    let faces = ["1 3 5", "3 2 5", "2 4 5", "4 1 5", "3 1 6", "2 3 6", "4 2 6", "1 4 6"];
    let mut text: String = points.iter().map(|point| format!("v {point}\n")).collect();
    text.extend(faces.iter().map(|face| format!("f {face}\n")));
    text
}

#[test]
fn pivoting_takes_over_where_signs_fail_and_names_the_place() {
    // A closed surface with one fixed point, the last to be eliminated: its v meets a zero pivot.
    let mut fallbacks = 0;
    for pole in [[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]] {
        let settings = json!({
            "equation": "triharmonic", "condition": "region", "data": "displacement", "system": "mixed",
            "handles": [{ "select": "nearest", "center": pole, "role": "moved", "translate": [0.5, 0.0, 0.0] }],
        });
        let outcome = run(file(&octahedron()), settings.clone()).expect("a solution");
        // One point moved and nothing else fixed: everything follows it.
        assert!((outcome.metrics["displacement_max"] - 0.5).abs() < 1e-9);
        if outcome.counters["fallbacks"] > 0 {
            fallbacks += 1;
            assert_eq!(outcome.counters["factorizations"], 2);
            assert!(outcome.reason.contains("lblt"), "{}", outcome.reason);
            assert!(outcome.notices.iter().any(|notice| notice.contains("ldlt at vertex")));
            let mut settings = settings;
            settings["solver"] = json!("ldlt");
            let failure = run(file(&octahedron()), settings).expect_err("a zero pivot");
            assert!(failure.reason.contains("at vertex"), "{}", failure.reason);
        }
    }
    assert!(fallbacks > 0, "one of the poles is eliminated last");
}

#[test]
fn estimated_rounding_bounds_the_difference_of_two_systems() {
    // Both systems have the same exact solution, whatever the triangles. A vertex ever nearer to its neighbour makes
    // needles.
    let mut worst = 0.0f64;
    for distance in [1.0, 1e-2, 1e-4] {
        let mesh = grid(12, |lines| {
            let inner = lines
                .iter()
                .position(|line| line == "v 6 6 0")
                .expect("an inner vertex");
            lines[inner] = format!("v 6 {} 0", 5.0 + distance);
        });
        let mut difference = 0.0;
        let mut rounding = 0.0;
        for system in ["mixed", "one-field"] {
            let settings = json!({
                "equation": "triharmonic", "condition": "curve", "data": "position", "compare": true, "system": system,
                "relaxation": "linear",
                "handles": [{ "select": "boundary" }],
            });
            let outcome = run(file(&mesh), settings).expect("a solution");
            let own = outcome.metrics["rounding"];
            let told = outcome.notices.iter().any(|notice| notice.contains("rounding alone"));
            assert!(
                own < 1e-6 || told,
                "{distance:e} {system}: {own:e} {:?}",
                outcome.notices
            );
            difference = outcome.metrics["difference"];
            rounding += own;
        }
        assert!(
            difference < 30.0 * rounding,
            "{distance:e}: {difference:e}, {rounding:e}"
        );
        assert!(
            rounding < 1e3 * difference,
            "{distance:e}: {difference:e}, {rounding:e}"
        );
        worst = worst.max(difference);
    }
    assert!(worst > 1e-4, "{worst:e}");
}

#[test]
fn singular_configurations_are_found_and_named() {
    // Nullities that the independent program measured.
    // Neighbourhoods alone do not show that of the criss-cross mesh.
    for (family, nullity, bound) in [
        ("regular", 8.0, 8.0),
        ("union-jack", 8.0, 8.0),
        ("criss-cross", 4.0, 0.0),
    ] {
        let settings = json!({ "equation": "triharmonic", "condition": "curve", "curve": "unstabilised" });
        let failure = run(
            generated("square", json!({ "family": family, "cells": 4 })),
            settings.clone(),
        )
        .expect_err("a singular system");
        assert_eq!(failure.kind, "singular");
        let named = failure.reason.contains("Proposition 2") && failure.reason.contains("meet no free vertex but");
        assert!(named || bound == 0.0, "{}", failure.reason);
        let mut settings = settings;
        settings["on_singular"] = json!("continue");
        settings["system"] = json!("mixed");
        let outcome = run(generated("square", json!({ "family": family, "cells": 4 })), settings).expect("an outcome");
        assert_eq!(outcome.metrics["nullity_bound"], bound, "{family}");
        assert_eq!(outcome.metrics["nullity"], nullity, "{family}");
    }
}
