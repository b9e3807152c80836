//! Closest points agree with brute force on every processor, whatever the triangles; distances between surfaces with
//! known values, to the bit with any number of threads.

use crate::sample::{Noise, with_threads};
use std::cell::Cell;
use std::sync::LazyLock;
use vargeo::geometry::closest_point::{ClosestPoint, Nearest, foot};
use vargeo::linalg::processor::Processor;
use vargeo::mesh::TriangleMesh;
use vargeo::mesh::generate::shape::generate_shape;
use vargeo::metric::crease::crease_distance;
use vargeo::metric::distance::{Hausdorff, Sampling, hausdorff, one_sided};

/// What rounding of coordinates of size 1 to 100 may do to a squared distance.
fn rounding(squared: f64) -> f64 {
    1e-12 * squared + 1e-15 * squared.sqrt() + 1e-30
}

fn squared(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum()
}

/// Squared distance to a triangle by a search over its barycentric coordinates, refined by halving.
fn searched(corners: [[f64; 3]; 3], point: [f64; 3]) -> f64 {
    let at = |v: f64, w: f64| -> f64 {
        let [a, b, c] = corners;
        squared(
            point,
            std::array::from_fn(|axis| a[axis] + v * (b[axis] - a[axis]) + w * (c[axis] - a[axis])),
        )
    };
    let (mut v, mut w, mut step) = (1.0 / 3.0, 1.0 / 3.0, 0.5);
    while step > 1e-9 {
        let mut best = (at(v, w), v, w);
        for (dv, dw) in [
            (1.0, 0.0),
            (-1.0, 0.0),
            (0.0, 1.0),
            (0.0, -1.0),
            (1.0, -1.0),
            (-1.0, 1.0),
        ] {
            let (next_v, next_w) = ((v + step * dv).max(0.0), (w + step * dw).max(0.0));
            let sum = (next_v + next_w).max(1.0);
            let (next_v, next_w) = (next_v / sum, next_w / sum);
            if at(next_v, next_w) < best.0 {
                best = (at(next_v, next_w), next_v, next_w);
            }
        }
        if (best.1, best.2) == (v, w) {
            step /= 2.0;
        }
        (v, w) = (best.1, best.2);
    }
    at(v, w)
}

/// Random triangles of very different sizes, needles, segments, points and copies among them.
fn soup() -> TriangleMesh {
    let mut noise = Noise(7);
    let mut mesh = TriangleMesh::default();
    for kind in 0..700 {
        let size = 10f64.powf(2.0 * noise.number() - 1.5);
        let centre = noise.point();
        let mut corner = || -> [f64; 3] { std::array::from_fn(|axis| centre[axis] + size * noise.number()) };
        let [a, b, mut c] = [corner(), corner(), corner()];
        match kind % 10 {
            0 => c = b,
            1 => c = std::array::from_fn(|axis| a[axis] + 0.4 * (b[axis] - a[axis])),
            2 => c[0] = b[0] + 1e-13,
            _ => {}
        }
        let first = mesh.points.len() as u32;
        mesh.points.extend([a, b, if kind % 50 == 3 { a } else { c }]);
        mesh.cells.push([first, first + 1, first + 2]);
        if kind % 70 == 5 {
            mesh.cells.push([first, first, first]);
        }
    }
    mesh
}

#[test]
fn nearest_triangle_as_by_brute_force() {
    let mesh = soup();
    let mut noise = Noise(11);
    let points: Vec<[f64; 3]> = (0..300)
        .map(|index| {
            let reach = if index % 7 == 0 { 100.0 } else { 1.2 };
            std::array::from_fn(|_| reach * noise.number())
        })
        .collect();
    let expected: Vec<f64> = points
        .iter()
        .map(|&point| {
            let each = mesh.cells.iter().map(|&cell| {
                let foot = foot(mesh.corners(cell), point);
                squared(point, foot)
            });
            each.fold(f64::INFINITY, f64::min)
        })
        .collect();
    let mut bits: Option<Vec<u64>> = None;
    for processor in Processor::available() {
        let tree = ClosestPoint::new(&mesh).with_processor(processor);
        let mut found = vec![
            Nearest {
                squared_distance: 0.0,
                triangle: 0
            };
            points.len()
        ];
        tree.nearest_each(&points, Some(3), &mut found);
        for ((nearest, expected), &point) in found.iter().zip(&expected).zip(&points) {
            assert!(
                (nearest.squared_distance - expected).abs() <= rounding(*expected),
                "{nearest:?}, by brute force {expected}"
            );
            let named = squared(point, tree.foot(nearest.triangle, point));
            assert!((named - expected).abs() <= rounding(*expected));
            let alone = tree.nearest(point, None).squared_distance;
            assert!((alone - expected).abs() <= rounding(*expected));
        }
        let these: Vec<u64> = found.iter().map(|nearest| nearest.squared_distance.to_bits()).collect();
        assert_eq!(
            bits.get_or_insert(these.clone()),
            &these,
            "the same bits on every processor"
        );
    }
}

#[test]
fn foot_of_a_point_is_the_nearest_point_of_the_triangle() {
    let mesh = soup();
    let mut noise = Noise(5);
    for &cell in mesh.cells.iter().step_by(3) {
        let point: [f64; 3] = noise.point();
        let corners = mesh.corners(cell);
        let ours = squared(point, foot(corners, point));
        let searched = searched(corners, point);
        assert!(
            (ours - searched).abs() < 1e-7 * searched.max(1e-3),
            "{ours} against {searched}"
        );
    }
}

#[test]
fn distances_between_surfaces_with_known_values() {
    // A cube of edge 2 and one with its upper side raised by 0.1 in the middle: a pyramid.
    let cube = generate_shape(
        "cuboid",
        &serde_json::json!({ "triangles": 48, "a": 1, "b": 1, "c": 1 }),
    )
    .unwrap();
    let mut raised = cube.clone();
    let top = raised
        .points
        .iter()
        .position(|point| *point == [0.0, 0.0, 1.0])
        .expect("the middle of the upper side is a vertex");
    raised.points[top][2] = 1.1;
    let found = hausdorff(&raised, &cube, &never).unwrap();
    let diagonal = 12f64.sqrt();
    assert!((found.diagonal - diagonal).abs() < 1e-12);
    assert!((found.forward.max - 0.1).abs() < 1e-12, "{}", found.forward.max);
    assert_eq!(found.forward.place, [0.0, 0.0, 1.1]);
    // Back: the upper side's middle to the slopes, which fall by 0.1 over 1 where the mesh is cut along its diagonals.
    assert!(found.backward.max <= 0.1 && found.backward.max > 0.09);
    assert!(found.backward.bound >= found.backward.max && found.backward.bound - found.backward.max <= 5e-4 * diagonal);
    // The height is affine on every triangle, so its mean is exact.
    let height = |vertex: u32| (raised.points[vertex as usize][2] - 1.0).max(0.0) / 3.0;
    let volume: f64 = raised
        .cells
        .iter()
        .zip(raised.areas())
        .map(|(cell, area)| area * cell.iter().map(|&vertex| height(vertex)).sum::<f64>())
        .sum();
    let expected = volume / raised.area();
    assert!(
        (found.forward.mean / expected - 1.0).abs() < 1e-9,
        "{}",
        found.forward.mean
    );

    // The cube's edges to a cube a step higher: the lower four are a step off, the four upright ones below it leave a step.
    let step = 0.3;
    let mut higher = cube.clone();
    for point in &mut higher.points {
        point[2] += step;
    }
    let crease = crease_distance(&cube, &higher, 30.0).unwrap();
    let mean = (4.0 * 2.0 * step + 4.0 * step * step / 2.0) / 24.0;
    assert!((crease.max - step).abs() < 1e-12, "{}", crease.max);
    assert!((crease.mean / mean - 1.0).abs() < 1e-4, "{} for {mean}", crease.mean);
    assert!(crease_distance(&CONCENTRIC.0, &cube, 30.0).is_none());

    // The distance is the same everywhere but for the facets.
    let found = &CONCENTRIC.2;
    for distance in [&found.forward, &found.backward] {
        assert!((distance.mean - 0.1).abs() < 2e-3 && (distance.max - 0.1).abs() < 5e-3);
        assert!(distance.rms >= distance.mean && distance.rms <= distance.max);
    }
}

/// A measurement that is stopped when it asks for the `last` time, and how often it asked.
fn stopped(first: &TriangleMesh, second: &TriangleMesh, last: u32) -> (Result<Hausdorff, String>, u32) {
    let asked = Cell::new(0);
    let outcome = hausdorff(first, second, &|| {
        asked.set(asked.get() + 1);
        asked.get() >= last
    });
    (outcome, asked.get())
}

/// Concentric spheres, as far from each other everywhere, so that no part of the search is cut short; their distances,
/// and how often the measurement asked whether to stop.
static CONCENTRIC: LazyLock<(TriangleMesh, TriangleMesh, Hausdorff, u32)> = LazyLock::new(|| {
    let [first, second] = [1.0, 1.1].map(|radius| {
        let parameters = serde_json::json!({ "triangles": 3000, "a": radius, "b": radius, "c": radius });
        generate_shape("ellipsoid", &parameters).unwrap()
    });
    let (whole, questions) = stopped(&first, &second, u32::MAX);
    (first, second, whole.unwrap(), questions)
});

/// For a measurement that is not to be stopped.
fn never() -> bool {
    false
}

#[test]
fn a_measurement_can_be_stopped_at_any_time() {
    let (first, second, whole, questions) = &*CONCENTRIC;
    let questions = *questions;
    // Sampling and searching, both ways, and again and again within.
    let work = whole.forward.samples + whole.backward.samples;
    assert!(
        questions >= 4 && u64::from(questions) >= work / 2_000_000,
        "{questions} for {work} samples"
    );
    for last in 1..=questions {
        let (outcome, asked) = stopped(first, second, last);
        assert!(outcome.is_err(), "asked {last} times");
        assert_eq!(asked, last, "goes on after it was told to stop");
    }
}

#[test]
fn maximum_between_samples_is_found_and_certain() {
    // One large triangle over a fine cone: the largest distance is at the tip, which no coarse sample hits.
    let mut cone = TriangleMesh::default();
    let tip = [0.237, 0.411, 0.0];
    for (x, y) in [(-2.0, -2.0), (3.0, -2.0), (-2.0, 3.0)] {
        cone.points.push([x, y, 1.0]);
    }
    cone.points.push(tip);
    cone.cells = vec![[0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let flat = TriangleMesh {
        points: cone.points[..3].to_vec(),
        cells: vec![[0, 1, 2]],
    };
    let sampling = Sampling {
        spacing: 2.0,
        tolerance: 1e-4,
        far: 1.0,
    };
    let distance = one_sided(&flat, &ClosestPoint::new(&cone), sampling, &never).unwrap();
    let finer = Sampling {
        spacing: 0.004,
        tolerance: 1e-5,
        far: 1.0,
    };
    let reference = one_sided(&flat, &ClosestPoint::new(&cone), finer, &never).unwrap();
    assert!(distance.max <= reference.bound && reference.max <= distance.bound);
    assert!(
        distance.bound - distance.max <= 1e-4 + 1e-12,
        "{}",
        distance.bound - distance.max
    );
    assert!((distance.max - reference.max).abs() < 2e-4);
}

#[test]
fn the_area_that_is_far_does_not_depend_on_the_triangles() {
    let quad = |points: Vec<[f64; 3]>| TriangleMesh {
        points,
        cells: vec![[0, 1, 2], [0, 2, 3]],
    };
    let ground = quad(vec![
        [-9.0, -9.0, 0.0],
        [9.0, -9.0, 0.0],
        [9.0, 9.0, 0.0],
        [-9.0, 9.0, 0.0],
    ]);
    let ramp = quad(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 0.0]]);
    let sampling = Sampling {
        spacing: 0.01,
        tolerance: 1e-4,
        far: 0.4,
    };
    let distance = one_sided(&ramp, &ClosestPoint::new(&ground), sampling, &never).unwrap();
    assert!((distance.far - 0.6).abs() < 5e-3, "{}", distance.far);
}

#[test]
fn same_bits_with_any_number_of_threads() {
    let shape = |noise: f64| {
        let parameters = serde_json::json!({ "triangles": 4000, "noise": noise, "seed": 4 });
        generate_shape("flower", &parameters).unwrap()
    };
    let (first, second) = (shape(0.01), shape(0.0));
    let run = |threads: usize| with_threads(threads, || hausdorff(&first, &second, &never).unwrap());
    let one = run(1);
    assert!(one.max() > 0.0);
    for threads in [2, 4] {
        assert_eq!(run(threads), one);
    }
}
