//! Time per point of a biquartic patch evaluated at 9 by 9 points, one point at a time and eight side by side, on one
//! thread.
//!
//! `cargo bench --bench patches`. Each figure is a mean over 0.3 s.

use serde_json::json;
use std::hint::black_box;
use std::time::Instant;
use vargeo::linalg::processor::Processor;
use vargeo::mesh::generate::surface::generate_surface;
use vargeo::mesh::quadrilateral::Connectivity;
use vargeo::method::g1_surface::evaluation::{Derivatives, Evaluated, Places, evaluate};
use vargeo::method::g1_surface::network::Network;
use vargeo::method::g1_surface::patch::{Operator, Patch, continuous};
use vargeo::method::g1_surface::surface::{self, Place};

/// Seconds that this thread has run, so that other load does not count; wall time where the system does not tell.
fn clock(start: Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    match told
        .as_deref()
        .and_then(|text| text.split(' ').next())
        .and_then(|word| word.parse::<f64>().ok())
    {
        Some(nanoseconds) => nanoseconds * 1e-9,
        None => start.elapsed().as_secs_f64(),
    }
}

/// Nanoseconds per point, the mean over 0.3 s.
fn time(points: usize, mut work: impl FnMut()) -> f64 {
    let start = Instant::now();
    work();
    let begin = clock(start);
    let mut runs = 0;
    while clock(start) - begin < 0.3 {
        work();
        runs += 1;
    }
    (clock(start) - begin) * 1e9 / (runs * points) as f64
}

fn main() {
    let mesh = generate_surface("ellipsoid", &json!({ "cells": 8 }))
        .expect("a valid generator")
        .mesh;
    let connectivity = Connectivity::of(&mesh.quads, mesh.points.len()).expect("a surface");
    let normals = mesh.normals.clone().expect("generators give normals");
    let (network, _) = Network::natural(&mesh, connectivity, &normals).expect("normals that fit");
    let patches: Vec<Patch> = (0..mesh.quads.len())
        .map(|quad| continuous(&network, quad, Operator::Laplacian).patch)
        .collect();
    let line: [f64; 9] = std::array::from_fn(|index| index as f64 / 8.0);
    let single = line.map(Place::new);
    let points = 81 * patches.len();
    println!("{} patches at 81 points each: nanoseconds per point", patches.len());
    println!("{:44} {:>12} {:>12}", "", "first", "second order");
    let first = time(points, || {
        for patch in &patches {
            for v in &single {
                for u in &single {
                    black_box(surface::first_derivatives(patch, u, v));
                }
            }
        }
    });
    let second = time(points, || {
        for patch in &patches {
            for v in &single {
                for u in &single {
                    black_box(surface::evaluate(patch, u, v));
                }
            }
        }
    });
    println!("{:44} {first:12.1} {second:12.1}", "one point at a time");
    let places = Places::grid(&line, &line);
    let mut evaluated = Evaluated::default();
    for processor in Processor::available() {
        let mut each = |derivatives| {
            time(points, || {
                for patch in &patches {
                    evaluate(processor, patch, &places, derivatives, &mut evaluated);
                    black_box(&evaluated);
                }
            })
        };
        let (first, second) = (each(Derivatives::First), each(Derivatives::Second));
        println!("{:44} {first:12.1} {second:12.1}", format!("eight, {processor:?}"));
    }
}
