//! What is made from a G1 surface holds it: control points, tessellations, Bézier cells, hexahedra with certificates.

use crate::g1_surface::{file, network_of, patches, run, written};
use crate::quadrilaterals::length;
use crate::sample::{Noise, generated};
use serde_json::json;
use vargeo::fem::bernstein_hexahedron::{self as bernstein, ControlPoints, Verdict};
use vargeo::linalg::vector3::subtract;
use vargeo::mesh::format::{self, vtu};
use vargeo::mesh::generate::surface::generate_surface;
use vargeo::mesh::quadrilateral::{QuadrilateralMesh, Triangles};
use vargeo::method::g1_surface::patch::Patch;
use vargeo::method::g1_surface::{control_net, surface};

#[test]
fn exports_hold_the_surface() {
    let settings = json!({ "export": ["control-points", "obj", "bezier"], "tessellation": 2, "hexahedra": "outward" });
    let outcome = run(generated("sphere", json!({ "cells": 2 })), settings).expect("a surface");
    let names: Vec<&str> = outcome.files.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "bezier-hexahedra.vtu",
            "bezier.vtu",
            "control-points.txt",
            "tessellation.obj"
        ]
    );
    let text = String::from_utf8(outcome.files["control-points.txt"].clone()).expect("text");
    let nets = control_net::parse(&text).expect("what was written");
    let mesh = generate_surface("sphere", &json!({ "cells": 2 })).expect("valid").mesh;
    let wanted: Vec<Patch> = patches(&mut network_of(&mesh))
        .iter()
        .map(surface::control_points)
        .collect();
    assert_eq!(nets, wanted);
    assert!(control_net::parse(&text.replace("24", "23")).is_err());
    assert!(control_net::parse(text.trim_end_matches('\n').rsplit_once('\n').expect("lines").0).is_err());
    let content = format::read("tessellation.obj", &outcome.files["tessellation.obj"]).expect("a mesh");
    let (read, _) = QuadrilateralMesh::from_content(&content, Triangles::Refuse).expect("quads");
    assert_eq!((read.quads.len(), read.points.len()), (24 * 4, 24 * 4 + 2));
    for (point, normal) in read.points.iter().zip(read.normals.as_ref().expect("normals")) {
        assert!(length(subtract(*point, normal.map(|component| component / length(*normal)))) < 0.02);
    }
}

#[test]
fn orders_of_bezier_points_visit_every_point_once() {
    for order in 1..5 {
        let mut quadrilateral = vtu::quadrilateral_order(order);
        quadrilateral.sort_unstable();
        quadrilateral.dedup();
        assert_eq!(quadrilateral.len(), (order + 1).pow(2));
        let mut hexahedron = vtu::hexahedron_order(order);
        hexahedron.sort_unstable();
        hexahedron.dedup();
        assert_eq!(hexahedron.len(), (order + 1).pow(3));
    }
}

#[test]
fn the_certificate_agrees_with_sampling() {
    // A cube with its control points moved by growing amounts, always the same way.
    let mut noise = Noise(1);
    let (mut positive, mut negative) = (0, 0);
    for trial in 0..24 {
        let amount = 0.1 + 0.05 * f64::from(trial % 12);
        let points: ControlPoints = std::array::from_fn(|index| {
            [index / 25, index / 5 % 5, index % 5].map(|place| place as f64 / 4.0 + 0.5 * amount * noise.number())
        });
        let mut least = f64::INFINITY;
        for index in 0..729 {
            let at = [index / 81, index / 9 % 9, index % 9].map(|place| place as f64 / 8.0);
            least = least.min(bernstein::jacobian(&points, at).0);
        }
        match bernstein::certify(&points, 512) {
            Verdict::Positive { bound, .. } => {
                positive += 1;
                assert!(bound > 0.0 && bound <= least, "{bound} and {least}");
            }
            Verdict::NotPositive { value } => {
                negative += 1;
                assert!(value <= 1e-9, "{value}");
            }
            Verdict::Undecided { .. } => assert!(least < 0.1),
        }
    }
    assert!(positive > 3 && negative > 3, "{positive} positive, {negative} not");
}

#[test]
fn hexahedra_of_a_head_are_valid_and_fill_the_shell() {
    let settings = json!({ "hexahedra": "inward", "layers": 2, "sphere_ratio": 0.5 });
    let outcome = run(generated("sphere", json!({ "cells": 3 })), settings).expect("hexahedra");
    let metric = |name: &str| outcome.metrics[name];
    assert_eq!(
        (metric("hexahedra_count"), metric("jacobian_certified")),
        (108.0, 108.0)
    );
    assert!(metric("jacobian_bound") > 0.0 && metric("jacobian_min") > 0.3);
    let shell = 4.0 / 3.0 * std::f64::consts::PI * (1.0 - 0.125);
    assert!(
        (metric("hexahedra_volume") / shell - 1.0).abs() < 2e-3,
        "{}",
        metric("hexahedra_volume")
    );
    // Points are shared by number, wherever they lie: 6 * 12^2 + 2 on either side, whatever the signs of zeros.
    let settings = json!({ "hexahedra": "outward", "tessellation": 6 });
    let ellipsoid = generate_surface("ellipsoid", &json!({ "cells": 2 }))
        .expect("valid")
        .mesh;
    for part in [
        generated("ellipsoid", json!({ "cells": 2 })),
        file(&written(&ellipsoid, 1.0, 1e6)),
        file(&written(&ellipsoid, 1e-9, 0.0)),
    ] {
        let outcome = run(part, settings.clone()).expect("hexahedra");
        let content = format::read("mesh.vtu", &outcome.mesh.expect("a mesh")).expect("a mesh");
        assert_eq!((content.points.len(), content.hexahedra.len()), (2 * 866, 24 * 36));
    }
    let failure = run(generated("saddle", json!({})), json!({ "hexahedra": "inward" })).expect_err("an open surface");
    assert!(failure.reason.contains("closed"), "{}", failure.reason);
}
