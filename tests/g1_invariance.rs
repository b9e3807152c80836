//! A G1 surface depends on its mesh alone: not on numbering, place, size, other parts, threads or instruction sets.

use crate::g1_surface::{file, network_of, patches, run, small, written};
use crate::quadrilaterals::length;
use crate::sample::{generated, metric_bits, with_threads};
use serde_json::json;
use vargeo::linalg::processor::Processor;
use vargeo::linalg::vector3::subtract;
use vargeo::mesh::format;
use vargeo::mesh::generate::surface::generate_surface;
use vargeo::method::g1_surface::evaluation::{Derivatives, Evaluated, Places, evaluate};
use vargeo::method::g1_surface::{control_net, surface};

#[test]
fn numbering_and_position_do_not_matter() {
    let mesh = generate_surface("icosahedron", &json!({ "level": 0 }))
        .expect("valid")
        .mesh;
    let mut network = network_of(&mesh);
    let before = patches(&mut network);
    // Vertices in another order, quads from another corner, the whole turned and moved.
    let count = mesh.points.len();
    let rename = |vertex: usize| (vertex * 7 + 3) % count;
    let turn = |[x, y, z]: [f64; 3]| {
        [
            0.36 * x + 0.48 * y - 0.8 * z,
            -0.8 * x + 0.6 * y,
            0.48 * x + 0.64 * y + 0.6 * z,
        ]
    };
    let mut moved = mesh.clone();
    let normals = mesh.normals.as_ref().expect("normals");
    let mut moved_normals = normals.clone();
    for vertex in 0..count {
        let point = turn(mesh.points[vertex]);
        moved.points[rename(vertex)] = [point[0] + 1.0, point[1] - 2.0, point[2] + 0.5];
        moved_normals[rename(vertex)] = turn(normals[vertex]);
    }
    moved.normals = Some(moved_normals);
    for (index, quad) in moved.quads.iter_mut().enumerate() {
        let old = quad.map(|vertex| rename(vertex as usize) as u32);
        *quad = std::array::from_fn(|corner| old[(corner + index) % 4]);
    }
    let after = patches(&mut network_of(&moved));
    for (index, (a, b)) in before.iter().zip(&after).enumerate() {
        for (u, v) in [(0.5, 0.5), (0.2, 0.7), (0.9, 0.4)] {
            // Corner `index mod 4` of the old patch is corner 0 of the new one.
            let (s, t) = (0..index % 4).fold((u, v), |(s, t), _| (t, 1.0 - s));
            let [u, v, s, t] = [u, v, s, t].map(surface::Place::new);
            let old = turn(surface::position(a, &u, &v));
            let new = surface::position(b, &s, &t);
            let expected = [old[0] + 1.0, old[1] - 2.0, old[2] + 0.5];
            assert!(
                length(subtract(new, expected)) < 1e-9,
                "patch {index}: {new:?} and {expected:?}"
            );
        }
    }
}

#[test]
fn eight_points_at_a_time_give_the_same_bits() {
    let mesh = generate_surface("ellipsoid", &small("ellipsoid")).expect("valid").mesh;
    let points: Vec<[f64; 2]> = (0..21)
        .map(|index| [f64::from(index) / 20.0, f64::from(index * 7 % 21) / 20.0])
        .collect();
    let places = Places::new(&points);
    for patch in patches(&mut network_of(&mesh)).iter().take(4) {
        for processor in Processor::available() {
            let mut evaluated = Evaluated::default();
            evaluate(processor, patch, &places, Derivatives::Second, &mut evaluated);
            assert_eq!(evaluated.len(), points.len());
            for (jet, point) in evaluated.jets().zip(&points) {
                let [u, v] = point.map(surface::Place::new);
                assert_eq!(jet, surface::evaluate(patch, &u, &v), "{processor:?}");
            }
            evaluate(processor, patch, &places, Derivatives::First, &mut evaluated);
            let [u, v] = points[13].map(surface::Place::new);
            let jet = surface::first_derivatives(patch, &u, &v);
            assert_eq!(evaluated.first(13), [jet.position, jet.u, jet.v]);
        }
    }
}

#[test]
fn place_and_size_do_not_matter() {
    let mesh = generate_surface("ellipsoid", &small("ellipsoid")).expect("valid").mesh;
    let settings = json!({ "export": ["control-points"], "tessellation": 2 });
    let base = run(file(&written(&mesh, 1.0, 0.0)), settings.clone()).expect("a surface");
    for (scale, shift, tolerance) in [
        (1.0, 1e6, 1e-8),
        (1e-9, 0.0, 1e-10),
        (1e9, 0.0, 1e-10),
        (1e-3, -1e3, 1e-8),
    ] {
        let outcome = run(file(&written(&mesh, scale, shift)), settings.clone()).expect("a surface");
        let metric = |name: &str| outcome.metrics[name];
        assert_eq!(outcome.stop, "converged", "{}", outcome.reason);
        assert!(
            metric("angle_max") <= 1e-10,
            "scale {scale}, shift {shift}: {}",
            metric("angle_max")
        );
        for (name, power) in [
            ("area", 2),
            ("curve_energy", 2),
            ("node_energy", 2),
            ("edge_length", 1),
            ("curvature_energy", 0),
        ] {
            let ratio = metric(name) / base.metrics[name] / scale.powi(power);
            assert!(
                (ratio - 1.0).abs() < tolerance,
                "{name}, scale {scale}, shift {shift}: {ratio}"
            );
        }
        // The corners of patches are those of the faces, in their order.
        let text = String::from_utf8(outcome.files["control-points.txt"].clone()).expect("text");
        let nets = control_net::parse(&text).expect("what was written");
        for (net, quad) in nets.iter().zip(&mesh.quads) {
            for (place, &vertex) in [0, 20, 24, 4].into_iter().zip(quad) {
                let corner = mesh.points[vertex as usize].map(|coordinate| scale * coordinate + shift);
                assert!(length(subtract(net[place], corner)) <= 1e-15 * (shift.abs() + scale) * 4.0);
            }
        }
        let drawn = format::read("mesh.vtu", &outcome.mesh.expect("a mesh")).expect("a mesh");
        let far = drawn
            .points
            .iter()
            .map(|point| length(point.map(|coordinate| coordinate - shift)));
        let far = far.fold(0.0, f64::max);
        assert!(far > 0.9 * scale && far < 4.0 * scale, "{far}");
    }
}

#[test]
fn every_part_is_turned_by_its_own_normals() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 6 1 0\nv 5 1 0\nvn 0 0 1\nvn 0 0 -1\n\
                f 1//1 2//1 3//1 4//1\nf 5//2 6//2 7//2 8//2\n";
    let outcome = run(file(text), json!({ "tessellation": 1 })).expect("two patches");
    assert_eq!(
        (outcome.stop.as_str(), outcome.metrics["folded"]),
        ("converged", 0.0),
        "{}",
        outcome.reason
    );
    assert!(
        outcome.notices.iter().any(|notice| notice.contains("4 of 8 vertices")),
        "{:?}",
        outcome.notices
    );
}

#[test]
fn threads_do_not_change_a_bit() {
    let head = || run(generated("head", json!({ "cells": 8 })), json!({ "tessellation": 2 })).expect("a surface");
    let (one, three) = (with_threads(1, head), with_threads(3, head));
    assert_eq!(metric_bits(&one), metric_bits(&three));
    assert_eq!(one.mesh, three.mesh);
}
