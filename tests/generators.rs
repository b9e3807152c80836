//! Generated meshes: size, validity, quality, shape, their natural positions, and a mesh from an independent program.

use serde_json::{Value, json};
use vargeo::mesh::connectivity::{boundary, surface_topology};
use vargeo::mesh::generate::lattice::body_centred;
use vargeo::mesh::generate::{Generated, generate, generators};
use vargeo::mesh::quality::{scaled_jacobian, scaled_jacobians};
use vargeo::mesh::split::{boundary_cells, boundary_chords, boundary_faces};
use vargeo::mesh::target::{inverted_about, shape, shapes};
use vargeo::mesh::{TetrahedralMesh, TriangleMesh, check};

fn make(name: &str, parameters: Value) -> Generated {
    generate(name, &parameters).unwrap_or_else(|error| panic!("{name} {parameters}: {error}"))
}

fn worst(mesh: &TetrahedralMesh) -> f64 {
    mesh.cells
        .iter()
        .map(|&cell| scaled_jacobian(mesh.corners(cell)))
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn every_generator_makes_a_ball_that_maps_onto_cube_and_sphere() {
    for generator in generators() {
        let Generated { mesh, natural } = make(generator.name, Value::Null);
        let mut checked = mesh.clone();
        assert_eq!(check::tetrahedra(&mut checked), [], "{}", generator.name);
        let surface = boundary(&mesh.cells, mesh.points.len());
        let topology = surface_topology(&surface.triangles, mesh.points.len());
        assert_eq!(topology.components.len(), 1, "{}", generator.name);
        assert_eq!(topology.components[0].genus, Some(0), "{}", generator.name);
        assert_eq!(topology.boundary_edges, 0, "{}", generator.name);

        // Nothing stands in the way of a map with fixed boundary.
        assert_eq!(
            boundary_chords(&mesh, &surface),
            [] as [[u32; 2]; 0],
            "{}",
            generator.name
        );
        assert_eq!(
            boundary_faces(&mesh, &surface),
            [] as [[u32; 3]; 0],
            "{}",
            generator.name
        );
        assert_eq!(boundary_cells(&mesh, &surface), [] as [u32; 0], "{}", generator.name);

        // The natural position of each boundary triangle lies in one side of the cube.
        let natural = natural.expect("lattice generators know their cube");
        for triangle in &surface.triangles {
            let corners = triangle.map(|vertex| natural[vertex as usize]);
            let flat = (0..3).any(|axis| [0.0, 1.0].iter().any(|side| corners.iter().all(|p| p[axis] == *side)));
            assert!(flat, "{}: {corners:?}", generator.name);
        }
        for (kind, centre) in [("cube", [0.5; 3]), ("sphere", [0.0; 3])] {
            let target = shape(kind, &json!({}), &mesh, &surface, Some(&natural)).expect(generator.name);
            assert_eq!(target.positions.len(), surface.vertices.len());
            assert_eq!(
                inverted_about(&surface, &target.positions, centre),
                [] as [u32; 0],
                "{}",
                generator.name
            );
        }
    }
    assert!(shapes().len() >= 2);
}

#[test]
fn polyhedra_are_laid_over_surfaces_without_a_known_map() {
    for (generator, parameters) in [
        ("ball", json!({ "tetrahedra": 700 })),
        ("bar", json!({ "tetrahedra": 3000, "twist": 120, "bend": 200 })),
        ("bumpy", json!({ "tetrahedra": 3000 })),
        ("star", json!({ "tetrahedra": 5000, "height": 1.5 })),
    ] {
        let mesh = make(generator, parameters).mesh;
        let surface = boundary(&mesh.cells, mesh.points.len());
        let place = surface.places();
        let area = |positions: &[[f64; 3]]| {
            let cells = surface
                .triangles
                .iter()
                .map(|t| t.map(|vertex| place[vertex as usize]))
                .collect();
            TriangleMesh {
                points: positions.to_vec(),
                cells,
            }
            .area()
        };
        // Triangles of positive area whose areas add up to the whole surface cover it once.
        let cube = shape("cube", &json!({}), &mesh, &surface, None)
            .expect(generator)
            .positions;
        assert!((area(&cube) - 6.0).abs() < 1e-9);
        let sides = cube.iter().filter(|p| p.iter().any(|&c| c == 0.0 || c == 1.0)).count();
        assert_eq!(sides, cube.len());
        let octahedron = shape("octahedron", &json!({}), &mesh, &surface, None)
            .expect(generator)
            .positions;
        assert!((area(&octahedron) - 48f64.sqrt()).abs() < 1e-9);
        let tetrahedron = shape("tetrahedron", &json!({}), &mesh, &surface, None)
            .expect(generator)
            .positions;
        assert!((area(&tetrahedron) - 64f64.sqrt() / 3f64.sqrt()).abs() < 1e-9);
        let sphere = shape("sphere", &json!({ "radius": 2 }), &mesh, &surface, None)
            .expect(generator)
            .positions;
        assert!(
            sphere
                .iter()
                .all(|p| (p.iter().map(|c| c * c).sum::<f64>() - 4.0).abs() < 1e-12)
        );
        for (positions, centre) in [
            (cube, [0.5; 3]),
            (octahedron, [0.0; 3]),
            (tetrahedron, [0.0; 3]),
            (sphere, [0.0; 3]),
        ] {
            assert_eq!(inverted_about(&surface, &positions, centre), [] as [u32; 0]);
        }
    }
    // A box with a hole through it has no place on a cube; nor has a mesh too coarse for twelve edges.
    let mut ring = body_centred([6, 6, 3]);
    let hole = |p: &[f64; 3]| p[..2].iter().all(|c| (0.3..0.7).contains(c));
    let points = ring.points.clone();
    ring.cells
        .retain(|cell| !cell.iter().any(|&vertex| hole(&points[vertex as usize])));
    let refused = |mesh: &TetrahedralMesh| {
        let surface = boundary(&mesh.cells, mesh.points.len());
        shape("cube", &json!({}), mesh, &surface, None).expect_err("should be refused")
    };
    assert!(refused(&ring).contains("genus 1"));
    let single = TetrahedralMesh {
        points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        cells: vec![[0, 1, 2, 3]],
    };
    assert!(refused(&single).contains("no room"));
}

#[test]
fn a_strong_swirl_is_unfolded_or_refused() {
    let Generated { mesh, natural } = make("bumpy", json!({}));
    let surface = boundary(&mesh.cells, mesh.points.len());
    let swirled = |swirl: f64| {
        shape(
            "cube",
            &json!({ "swirl": swirl, "warp": 0.12 }),
            &mesh,
            &surface,
            natural.as_deref(),
        )
        .map(|t| t.positions)
    };
    // One by one the displaced points would turn some triangles over.
    for swirl in [1.0, 2.0] {
        let positions = swirled(swirl).expect("can be unfolded");
        assert_eq!(inverted_about(&surface, &positions, [0.5; 3]), [] as [u32; 0]);
    }
    assert!(swirled(15.0).expect_err("too strong").contains("lower `swirl`"));
}

#[test]
fn sizes_are_within_six_percent_and_below_the_nearest() {
    for generator in generators()
        .iter()
        .filter(|g| g.parameters.iter().any(|p| p.name == "tetrahedra"))
    {
        for wanted in [1000usize, 1500, 2000, 3300, 5000, 12_600, 23_653] {
            let count = make(generator.name, json!({ "tetrahedra": wanted })).mesh.cells.len();
            let error = (count as f64 / wanted as f64 - 1.0).abs();
            assert!(error <= 0.06, "{}: {count} tetrahedra for {wanted}", generator.name);
        }
    }
    assert_eq!(make("ball", json!({ "tetrahedra": 96 })).mesh.cells.len(), 96);
}

#[test]
fn quality_keeps_its_promise() {
    // Measured smallest scaled Jacobians, rounded down.
    for (name, parameters, floor) in [
        ("ball", json!({}), 0.3),
        ("ball", json!({ "tetrahedra": 2000 }), 0.29),
        ("cube", json!({}), 0.45),
        ("bar", json!({}), 0.5),
        ("bar", json!({ "twist": 180 }), 0.3),
        ("bar", json!({ "bend": 180 }), 0.3),
        ("ellipsoid", json!({}), 0.25),
        ("bumpy", json!({}), 0.1),
        ("star", json!({}), 0.2),
        ("ellipsoid", json!({ "a": 2, "b": 1, "c": 0.5 }), 0.1),
    ] {
        let mesh = make(name, parameters.clone()).mesh;
        let quality = scaled_jacobians(&mesh).expect("the mesh has cells");
        assert!(quality.min > floor, "{name} {parameters}: {quality:?}");
    }
}

#[test]
fn shapes_are_what_they_say() {
    let close = |a: f64, b: f64, tolerance: f64| assert!((a / b - 1.0).abs() < tolerance, "{a} is not {b}");
    let ball = make("ball", json!({ "radius": 2.0 })).mesh;
    for &vertex in &boundary(&ball.cells, ball.points.len()).vertices {
        let square: f64 = ball.points[vertex as usize].iter().map(|c| c * c).sum();
        close(square.sqrt(), 2.0, 1e-14);
    }
    close(ball.volume(), 4.0 / 3.0 * std::f64::consts::PI * 8.0, 0.02);
    close(make("cube", json!({ "edge": 3.0 })).mesh.volume(), 27.0, 1e-12);
    // Twisting and bending about the axis keep the volume, up to the chords.
    let plain = json!({ "length": 5.0, "width": 1.0, "height": 2.0 });
    close(make("bar", plain).mesh.volume(), 10.0, 1e-12);
    let bent = json!({ "length": 5.0, "width": 1.0, "height": 2.0, "twist": 90.0, "bend": 60.0 });
    close(make("bar", bent).mesh.volume(), 10.0, 0.02);
    let ellipsoid = make("ellipsoid", json!({ "a": 2.0, "b": 1.0, "c": 0.5 })).mesh;
    close(ellipsoid.volume(), 4.0 / 3.0 * std::f64::consts::PI, 0.03);
}

#[test]
fn jitter_is_seeded_and_keeps_boundary_and_validity() {
    let plain = make("ball", json!({ "tetrahedra": 3000 })).mesh;
    let shaken = |seed: u64| make("ball", json!({ "tetrahedra": 3000, "jitter": 0.4, "seed": seed })).mesh;
    let (first, again, other) = (shaken(1), shaken(1), shaken(2));
    assert_eq!(first, again);
    assert_ne!(first, other);
    assert!(worst(&first) >= 0.05 && worst(&first) < worst(&plain));
    let surface = boundary(&plain.cells, plain.points.len());
    let moved = |vertex: usize| first.points[vertex] != plain.points[vertex];
    assert!((0..plain.points.len()).all(|vertex| moved(vertex) != surface.mask[vertex]));
}

#[test]
fn bad_parameters_are_refused_by_name() {
    let error = |name: &str, parameters: Value| generate(name, &parameters).map(|_| ()).expect_err("should be refused");
    assert!(error("bal", json!({})).contains("`ball`"));
    assert!(error("ball", json!({ "radios": 1 })).contains("`radius`"));
    assert!(error("ball", json!({ "radius": -1 })).contains("`radius` is -1"));
    assert!(error("ball", json!({ "tetrahedra": 1000.5 })).contains("whole number"));
    assert!(error("bar", json!({ "bend": 300, "height": 3 })).contains("lower `bend`"));
    assert!(error("bar", json!({ "twist": 3000, "tetrahedra": 1000 })).contains("more tetrahedra"));
}

#[test]
fn the_twisted_grid_is_that_of_an_independent_program() {
    let golden: Value = serde_json::from_str(include_str!("golden/twisted_grid_4.json")).expect("golden file parses");
    let points: Vec<[f64; 3]> = serde_json::from_value(golden["points"].clone()).expect("points");
    let cells: Vec<[u32; 4]> = serde_json::from_value(golden["cells"].clone()).expect("cells");
    let vertices: Vec<u32> = serde_json::from_value(golden["boundary"].clone()).expect("boundary");
    let target: Vec<[f64; 3]> = serde_json::from_value(golden["target"].clone()).expect("target");
    let Generated { mesh, natural } = make("twisted-grid", json!({ "divisions": 4 }));
    assert_eq!(mesh.cells, cells);
    let distance = |a: &[[f64; 3]], b: &[[f64; 3]]| {
        assert_eq!(a.len(), b.len());
        a.iter()
            .flatten()
            .zip(b.iter().flatten())
            .fold(0.0, |largest: f64, (a, b)| largest.max((a - b).abs()))
    };

    // The other program scales its mesh to unit volume.
    let scale = mesh.volume().cbrt();
    let scaled: Vec<[f64; 3]> = mesh.points.iter().map(|point| point.map(|c| c / scale)).collect();
    assert!(distance(&scaled, &points) < 1e-14);
    let surface = boundary(&mesh.cells, mesh.points.len());
    assert_eq!(surface.vertices, vertices);
    let parameters = json!({ "swirl": 1.0, "warp": 0.12 });
    let positions = shape("cube", &parameters, &mesh, &surface, natural.as_deref())
        .expect("a valid target")
        .positions;
    assert!(distance(&positions, &target) < 1e-14);
}
