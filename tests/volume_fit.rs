//! Fits of small volumes: what is promised of them, templates by recipes, and certificates against stored verdicts.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use vargeo::fem::basis;
use vargeo::fem::batches::{Batches, unit_reference};
use vargeo::fem::boundary::Boundary;
use vargeo::fem::certificate::{Certifier, Verdict};
use vargeo::fem::coefficient_file;
use vargeo::fem::quadrature::{CellQuadrature, Line, Rule, Scattered};
use vargeo::fem::space::Space;
use vargeo::linalg::processor::Processor;
use vargeo::linalg::vector3::{Columns, cofactor, dot};
use vargeo::mesh::TriangleMesh;
use vargeo::mesh::mixed::{MixedMesh, Shape};
use vargeo::mesh::template::{carve, collapse, extrude, grid, pillow, voxels};
use vargeo::method::model::{LoadedModel, Part};
use vargeo::method::volume_fit::VolumeFit;
use vargeo::method::{Failure, Inputs, Method, Outcome};
use vargeo::optimize::Silent;

fn fit(template: Value, target: Option<Value>, settings: Value) -> Result<Outcome, Failure> {
    let generated = |mut table: Value, key: &str| {
        let name = table.as_object_mut().unwrap().remove(key).unwrap();
        Part::Generated {
            generator: name.as_str().unwrap().to_string(),
            parameters: table,
        }
    };
    let mut parts = BTreeMap::new();
    parts.insert("template".to_string(), generated(template, "generate"));
    if let Some(target) = target {
        parts.insert("target".to_string(), generated(target, "shape"));
    }
    let inputs = Inputs {
        settings: &settings,
        model: LoadedModel { parts },
    };
    VolumeFit.run(inputs, &mut Silent)
}

#[test]
fn a_fit_is_valid_falls_in_every_stage_and_is_the_same_with_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            fit(
                json!({ "generate": "grid", "x": 1, "y": 1, "z": 1, "recipe": [{ "op": "pillow" }] }),
                Some(json!({ "shape": "ellipsoid", "triangles": 400 })),
                json!({ "order": 2, "iteration_limit": 25, "lambda_far": 50.0 }),
            )
            .unwrap()
        })
    };
    let outcome = run(1);
    let metric = |name: &str| outcome.metrics[name];
    assert_eq!(metric("elements"), 7.0);
    assert_eq!(metric("inverted"), 0.0);
    assert_eq!(metric("certified"), 7.0);
    assert_eq!(metric("increases"), 0.0);
    assert!(metric("least_determinant_ever") > 0.0);
    assert!(metric("certified_determinant") > 0.0);
    assert!(metric("certified_determinant") <= metric("min_determinant"));
    assert!(metric("hausdorff") < 6.0, "{}", metric("hausdorff"));
    assert!(
        metric("scaled_jacobian_mean") > 0.85,
        "{}",
        metric("scaled_jacobian_mean")
    );
    let other = run(2);
    assert_eq!(outcome.mesh, other.mesh);
    let bits = |outcome: &Outcome| {
        outcome
            .metrics
            .values()
            .map(|value| value.to_bits())
            .collect::<Vec<_>>()
    };
    assert_eq!(bits(&outcome), bits(&other));
}

#[test]
fn an_inverted_mesh_is_repaired_over_its_own_boundary() {
    // Pillowed beyond the middle: the cells inside are turned inside out.
    let outcome = fit(
        json!({ "generate": "grid", "x": 2, "y": 2, "z": 1, "recipe": [{ "op": "pillow", "thickness": 1.3 }] }),
        None,
        json!({ "schedule": [{ "lambda": 0.05, "order": 1 }], "iteration_limit": 40, "distance": "symmetric" }),
    )
    .unwrap();
    assert!(outcome.metrics["inverted_at_start"] > 0.0);
    assert_eq!(outcome.metrics["inverted"], 0.0);
    assert!(outcome.metrics["hausdorff"] < 5.0, "{}", outcome.metrics["hausdorff"]);
}

#[test]
fn bad_input_is_named() {
    let reason = |outcome: Result<Outcome, Failure>| outcome.err().map(|failure| failure.reason).unwrap_or_default();
    let empty = fit(
        json!({ "generate": "grid", "x": 1, "y": 1, "z": 1, "recipe": [{ "op": "carve", "from": [0, 0, 0], "to": [1, 1, 1] }] }),
        Some(json!({ "shape": "ellipsoid" })),
        json!({}),
    );
    assert!(reason(empty).contains("removes all 1 cells"));
    let falling = json!({ "schedule": [{ "lambda": 1.0, "order": 3 }, { "lambda": 1.0, "order": 2 }] });
    let falling = fit(
        json!({ "generate": "grid" }),
        Some(json!({ "shape": "block" })),
        falling,
    );
    assert!(reason(falling).contains("orders only rise"));
    let voxels = fit(json!({ "generate": "voxels" }), None, json!({}));
    assert!(reason(voxels).contains("need a target surface"));
}

/// Euler characteristic of the boundary and volume.
fn figures(mesh: &MixedMesh) -> (i64, f64) {
    let topology = mesh.topology().unwrap();
    let triangles = topology.boundary_triangles(&mesh.points);
    let mut vertices: Vec<u32> = triangles.cells.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let faces = triangles.cells.len() as i64;
    (vertices.len() as i64 - 3 * faces / 2 + faces, mesh.volume())
}

#[test]
fn recipes_keep_meshes_valid() {
    let block = grid::grid([3, 3, 2]);
    assert_eq!(figures(&block), (2, 18.0));
    let ring = carve::carve(&block, [[1.0, 1.0, 0.0], [2.0, 2.0, 2.0]]).unwrap();
    assert_eq!(figures(&ring), (0, 16.0));
    assert!(carve::carve(&block, [[9.0; 3], [10.0; 3]]).is_err());

    let pillowed = pillow::pillow(&ring, 0.4).unwrap();
    // Eight faces below and above, 12 x 2 outside, 4 x 2 inside.
    assert_eq!(pillowed.cells(), 16 + 8 + 8 + 24 + 8);
    assert_eq!(figures(&pillowed).0, 0);
    assert!((figures(&pillowed).1 - 16.0).abs() < 1e-12);

    let taller = extrude::extrude(&block, [[0.0, 0.0, 2.0], [1.0, 3.0, 2.0]], 1.5, 3).unwrap();
    assert_eq!(taller.cells(), 18 + 9);
    assert!((figures(&taller).1 - 22.5).abs() < 1e-12);
    assert_eq!(figures(&taller).0, 2);

    // Hexahedra become prisms, then one of these a tetrahedron.
    let wedge = collapse::collapse(&grid::grid([1, 1, 1]), 0, [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]).unwrap();
    assert_eq!((wedge.hexahedra.len(), wedge.prisms.len()), (0, 1));
    assert!((figures(&wedge).1 - 0.5).abs() < 1e-12);
    let simplex = collapse::collapse(&wedge, 2, [[0.0, 1.0, 0.0], [1.0, 1.0, 1.0]]).unwrap();
    assert_eq!((simplex.prisms.len(), simplex.tetrahedra.len()), (0, 1));
    assert!((figures(&simplex).1 - 1.0 / 6.0).abs() < 1e-12);
    assert!(collapse::collapse(&grid::grid([1, 1, 1]), 0, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5]]).is_err());

    // Two cubes that share an edge only: the voxels between are added, and the result is a manifold.
    let touching = grid::selected([2, 2, 1], |[i, j, _]| i == j);
    let mut surface = TriangleMesh::default();
    for (shape, corners) in touching.iter() {
        for face in shape.faces() {
            let at = |place: usize| corners[face[place]];
            surface.cells.extend([[at(0), at(1), at(2)], [at(0), at(2), at(3)]]);
        }
    }
    surface.points = touching.points.clone();
    let cubes = voxels::voxels(&surface, 2).unwrap();
    assert!(cubes.cells() > 2);
    assert_eq!(figures(&cubes).0, 2);
}

#[test]
fn the_sampled_boundary_is_closed_and_follows_the_nodes() {
    let mut mesh = collapse::collapse(&grid::grid([2, 1, 1]), 0, [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]).unwrap();
    for (index, point) in mesh.points.iter_mut().enumerate() {
        point[0] += 0.1 * (index as f64).sin();
    }
    let topology = mesh.topology().unwrap();
    for basis in basis::bases() {
        let orders = if mesh.hexahedra.is_empty() {
            vec![3; mesh.cells()]
        } else {
            vec![4, 3]
        };
        let space = Space::new(&mesh, &topology, *basis, &orders).unwrap();
        let boundary = Boundary::new(&mesh, &topology, &space, 5);
        let mut x = space.linear(&mesh.points);
        for (place, value) in x.iter_mut().enumerate().skip(3 * space.vertices) {
            *value = 0.05 * (place as f64 * 1.7).sin();
        }
        let mut samples = Vec::new();
        boundary.positions(&x, &mut samples);
        // Every side of a triangle has its reverse: closed and oriented.
        let mut sides = BTreeMap::new();
        for cell in &boundary.triangles {
            for place in 0..3 {
                *sides.entry((cell[place], cell[(place + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(
            sides
                .iter()
                .all(|(&(a, b), &count)| count == 1 && sides.contains_key(&(b, a)))
        );
        let surface = TriangleMesh {
            points: samples.clone(),
            cells: boundary.triangles.clone(),
        };
        assert!(surface.enclosed_volume() > 0.0);
        // The pull-back is the transpose of the evaluation.
        let forces: Vec<[f64; 3]> = (0..samples.len())
            .map(|k| [(k as f64).cos(), 1.0, (k as f64).sin()])
            .collect();
        let mut gradient = vec![0.0; x.len()];
        boundary.add_gradient(&forces, &mut gradient);
        let direction: Vec<f64> = (0..x.len()).map(|k| (0.3 * k as f64).sin()).collect();
        let mut moved = Vec::new();
        boundary.positions(&direction, &mut moved);
        let left: f64 = gradient.iter().zip(&direction).map(|(a, b)| a * b).sum();
        let right: f64 = forces
            .as_flattened()
            .iter()
            .zip(moved.as_flattened())
            .map(|(a, b)| a * b)
            .sum();
        assert!((left - right).abs() < 1e-10 * left.abs().max(1.0), "{left} {right}");
        // Raising orders moves nothing.
        let up = Space::new(&mesh, &topology, *basis, &vec![6; mesh.cells()]).unwrap();
        let raised = Boundary::new(&mesh, &topology, &up, 5);
        let mut again = Vec::new();
        raised.positions(&space.transfer(&x, &up), &mut again);
        for (a, b) in samples.iter().zip(&again) {
            assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-13));
        }
    }
}

#[test]
fn certificates_agree_with_stored_verdicts() {
    let records: Vec<Value> = serde_json::from_str(include_str!("golden/certificates.json")).unwrap();
    let mut seen = [0, 0];
    for record in &records {
        let mut mesh = MixedMesh {
            points: Shape::Hexahedron.canonical().to_vec(),
            ..MixedMesh::default()
        };
        mesh.push(Shape::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]);
        let topology = mesh.topology().unwrap();
        let name = if record["family"] == "fourier" {
            "integrated-fourier"
        } else {
            "integrated-legendre"
        };
        let basis = basis::find(name).unwrap();
        let order = 4;
        let space = Space::new(&mesh, &topology, basis, &[order]).unwrap();
        // Stored nodes come by vertices, edges, faces and cell in the element's own order.
        let mut nodes: Vec<usize> = (0..8).collect();
        for &edge in &topology.cell_edges[0] {
            nodes.extend((0..order - 1).map(|j| space.edge(edge as usize).0 + j));
        }
        for &face in &topology.cell_faces[0] {
            nodes.extend((0..(order - 1) * (order - 1)).map(|jk| space.face(face as usize).0 + jk));
        }
        nodes.extend((0..(order - 1).pow(3)).map(|ijk| space.inside(0) + ijk));
        let mut x = vec![0.0; 3 * space.nodes];
        for (node, values) in nodes.iter().zip(record["nodes"].as_array().unwrap()) {
            for axis in 0..3 {
                x[3 * node + axis] = values[axis].as_f64().unwrap();
            }
        }
        let certifier = Certifier::new(basis, space.cells.iter().map(|cell| cell.kind), 20_000);
        match certifier.judge(&space, 0, &unit_reference(Shape::Hexahedron), &x) {
            Verdict::Positive(bound) => {
                assert_eq!(record["verdict"], "positive");
                assert!(bound > 0.0);
                seen[0] += 1;
            }
            Verdict::Negative(_, value) => {
                assert_eq!(record["verdict"], "negative");
                assert!(value <= 0.0);
                seen[1] += 1;
            }
            Verdict::Undecided(_) => panic!("undecided, stored: {}", record["verdict"]),
        }
    }
    assert!(seen[0] > 2 && seen[1] > 1, "{seen:?}");
}

#[test]
fn certificates_of_prisms_and_tetrahedra_hold_and_find_failures() {
    for basis in basis::bases() {
        for shape in Shape::ALL {
            let mut mesh = MixedMesh {
                points: shape.canonical().to_vec(),
                ..MixedMesh::default()
            };
            mesh.push(shape, &(0..shape.corners() as u32).collect::<Vec<_>>());
            let topology = mesh.topology().unwrap();
            let space = Space::new(&mesh, &topology, *basis, &[4]).unwrap();
            let certifier = Certifier::new(*basis, space.cells.iter().map(|cell| cell.kind), 20_000);
            let reference = unit_reference(shape);
            let lattice = Rule::Trapezoid.cell(shape, 12);
            for size in [0.0, 0.02, 0.05, 1.0] {
                let mut x = space.linear(&mesh.points);
                for (place, value) in x.iter_mut().enumerate().skip(3 * space.vertices) {
                    *value = size * (1.3 * place as f64).sin() / (1.0 + (place as f64 / 12.0));
                }
                let determinants = determinants(&space, &reference, &x, lattice.clone());
                let least = determinants.into_iter().fold(f64::INFINITY, f64::min);
                let name = format!("{} {shape:?} {size}", basis.name());
                match certifier.judge(&space, 0, &reference, &x) {
                    Verdict::Positive(bound) => {
                        assert!(bound > 0.0 && bound <= least + 1e-9, "{name}: {bound} {least}");
                        if size == 0.0 {
                            assert!((bound - least).abs() < 1e-3, "{name}: {bound} {least}");
                        }
                    }
                    Verdict::Negative(point, value) => {
                        let there = determinant_at(&space, &reference, &x, point);
                        assert!((there - value).abs() < 1e-9 && there <= 0.0, "{name}: {there} {value}");
                        assert!(size > 0.05, "{name}");
                    }
                    Verdict::Undecided(bound) => panic!("{name}: undecided, at least {bound}, sampled {least}"),
                }
                if size == 1.0 {
                    assert!(least < 0.0, "{name}");
                }
            }
        }
    }
}

/// Determinants of the only cell of a space at the points of a quadrature.
fn determinants(space: &Space, reference: &Columns<f64>, x: &[f64], quadrature: CellQuadrature) -> Vec<f64> {
    let batches = Batches::new(space, &[*reference], &|_| quadrature.clone()).unwrap();
    let mut result = Vec::new();
    batches.visit(Processor::detect(), (0, 0), x, |_, _, jacobian| {
        result.push(dot(jacobian[0], cofactor(&jacobian)[0]));
    });
    result
}

/// The determinant of the only cell of a space at one point.
fn determinant_at(space: &Space, reference: &Columns<f64>, x: &[f64], [u, v, w]: [f64; 3]) -> f64 {
    let line = |points: &[f64]| Line {
        points: points.to_vec(),
        weights: vec![1.0; points.len()],
    };
    let (quadrature, place) = match space.cells[0].kind.shape {
        // Of the 27 points the one with the coordinates in their order.
        Shape::Hexahedron => (CellQuadrature::Hexahedron(line(&[u, v, w])), 5),
        Shape::Prism => {
            let triangle = Scattered {
                points: vec![[u, v]],
                weights: vec![1.0],
            };
            (CellQuadrature::Prism(triangle, line(&[w])), 0)
        }
        Shape::Tetrahedron => {
            let point = Scattered {
                points: vec![[u, v, w]],
                weights: vec![1.0],
            };
            (CellQuadrature::Tetrahedron(point), 0)
        }
    };
    determinants(space, reference, x, quadrature)[place]
}

#[test]
fn a_shell_takes_its_thickness_and_leaves_the_surface_where_it_is() {
    let outcome = fit(
        json!({ "generate": "shell", "distance": 4.0, "layers": 2, "side": "both" }),
        Some(json!({ "shape": "ellipsoid", "triangles": 200 })),
        json!({ "order": 1, "iteration_limit": 300 }),
    )
    .unwrap();
    let metric = |name: &str| outcome.metrics[name];
    assert_eq!(metric("prisms"), 4.0 * 192.0);
    assert_eq!(metric("inverted"), 0.0);
    assert_eq!(metric("certified"), metric("elements"));
    assert!(
        metric("thickness_error_mean") < 5.0,
        "{}",
        metric("thickness_error_mean")
    );
    assert!(
        metric("scaled_jacobian_mean") > 0.8,
        "{}",
        metric("scaled_jacobian_mean")
    );
    let volume = coefficient_file::read(&outcome.files["coefficients"]).unwrap();
    let plain = fit(
        json!({ "generate": "shell", "distance": 4.0, "layers": 2, "side": "both" }),
        Some(json!({ "shape": "ellipsoid", "triangles": 200 })),
        json!({ "order": 1, "iteration_limit": 0 }),
    )
    .unwrap();
    let start = coefficient_file::read(&plain.files["coefficients"]).unwrap();
    // 192 triangles of a closed surface have 98 vertices.
    assert_eq!(volume.mesh.points[..98], start.mesh.points[..98]);
    assert!(volume.mesh.points[98..] != start.mesh.points[98..]);
}

#[test]
fn a_coefficient_file_is_a_template() {
    let part = |bytes: Vec<u8>| Part::File {
        name: "start.coefficients".to_string(),
        bytes,
        parameters: json!({}),
    };
    let settings = json!({ "order": 3, "iteration_limit": 20 });
    let target = json!({ "shape": "ellipsoid", "triangles": 400 });
    let template = json!({ "generate": "grid", "x": 1, "y": 1, "z": 1, "recipe": [{ "op": "pillow" }] });
    let first = fit(template, Some(target), settings).unwrap();
    let again = |settings: Value, bytes: Vec<u8>| {
        let mut parts = BTreeMap::new();
        parts.insert("template".to_string(), part(bytes));
        parts.insert(
            "target".to_string(),
            Part::Generated {
                generator: "ellipsoid".to_string(),
                parameters: json!({ "triangles": 400 }),
            },
        );
        let inputs = Inputs {
            settings: &settings,
            model: LoadedModel { parts },
        };
        VolumeFit.run(inputs, &mut Silent)
    };
    let bytes = first.files["coefficients"].clone();
    // Nothing moves: the same volume, with the orders of the file.
    let still = again(
        json!({ "schedule": [{ "lambda": 0.05, "order": 1, "iterations": 0 }] }),
        bytes.clone(),
    )
    .unwrap();
    assert_eq!(still.metrics["order_max"], 3.0);
    for name in ["hausdorff", "scaled_jacobian_mean", "energy_volume"] {
        let (a, b) = (first.metrics[name], still.metrics[name]);
        assert!((a - b).abs() < 1e-9 * a.abs(), "{name}: {a} {b}");
    }
    let other = again(json!({ "basis": "integrated-fourier", "order": 3 }), bytes).unwrap_err();
    assert!(
        other.reason.contains("basis = \"integrated-legendre\""),
        "{}",
        other.reason
    );
}

#[test]
fn a_subdivision_volume_comes_nearer_with_every_level() {
    let run = |levels: u64| {
        fit(
            json!({ "generate": "grid", "x": 2, "y": 2, "z": 2 }),
            Some(json!({ "shape": "ellipsoid", "triangles": 400 })),
            json!({ "order": 1, "subdivision_levels": levels, "crease_angle": 180.0, "iteration_limit": 40 }),
        )
        .unwrap()
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one.metrics["elements"], 64.0);
    assert_eq!(two.metrics["elements"], 512.0);
    for outcome in [&one, &two] {
        assert_eq!(outcome.metrics["inverted"], 0.0);
        assert_eq!(outcome.metrics["increases"], 0.0);
    }
    let rms = |outcome: &Outcome| outcome.metrics["distance_rms"];
    assert!(rms(&two) < 0.75 * rms(&one), "{} {}", rms(&one), rms(&two));
    let refused = fit(
        json!({ "generate": "grid", "x": 2, "y": 2, "z": 2 }),
        Some(json!({ "shape": "ellipsoid", "triangles": 400 })),
        json!({ "order": 2, "subdivision_levels": 1 }),
    );
    assert!(refused.unwrap_err().reason.contains("order = 1"));
}
