//! Obstacles to maps without inversions: found where they are planted, named, and split away where a split helps.

use crate::volume_map::{settings, target_of};
use serde_json::json;
use vargeo::mesh::TetrahedralMesh;
use vargeo::mesh::connectivity::{self, NONE};
use vargeo::mesh::generate::{self, lattice::kuhn};
use vargeo::mesh::target;
use vargeo::method::volume_map;
use vargeo::method::volume_map::feasibility::{self, planar_faces};
use vargeo::method::volume_map::problem::Problem;
use vargeo::optimize::Silent;

/// A generated mesh and positions of its boundary vertices on a shape, zero inside.
fn on_shape(generator: &str, parameters: serde_json::Value, shape: &str) -> (TetrahedralMesh, Vec<[f64; 3]>) {
    let generated = generate::generate(generator, &parameters).expect("a mesh");
    let boundary = connectivity::boundary(&generated.mesh.cells, generated.mesh.points.len());
    let target = target::shape(
        shape,
        &json!({}),
        &generated.mesh,
        &boundary,
        generated.natural.as_deref(),
    )
    .expect("a target");
    let mut positions = vec![[0.0; 3]; generated.mesh.points.len()];
    for (&vertex, &position) in boundary.vertices.iter().zip(&target.positions) {
        positions[vertex as usize] = position;
    }
    (generated.mesh, positions)
}

#[test]
fn planar_faces_of_a_cube_are_six_and_a_sphere_has_none_that_matter() {
    let (mesh, positions) = on_shape("bumpy", json!({ "tetrahedra": 3000 }), "cube");
    let boundary = connectivity::boundary(&mesh.cells, mesh.points.len());
    let faces = planar_faces(&boundary.triangles, &positions);
    assert_eq!(faces.count, 6);
    assert!(faces.of_triangle.iter().all(|&face| face != NONE));
    // Turned out of the axes, and with one corner cut off by a plane, nothing changes but the count.
    let (sine, cosine) = 0.4f64.sin_cos();
    let turned: Vec<[f64; 3]> = positions
        .iter()
        .map(|&[x, y, z]| [cosine * x - sine * y, sine * x + cosine * y, z])
        .map(|[x, y, z]| [x, cosine * y - sine * z, sine * y + cosine * z])
        .collect();
    assert_eq!(planar_faces(&boundary.triangles, &turned).count, 6);
    assert_eq!(feasibility::check(&mesh, &boundary, &turned).lower_bound, 0);

    let (mesh, positions) = on_shape("ball", json!({ "tetrahedra": 3000 }), "sphere");
    let boundary = connectivity::boundary(&mesh.cells, mesh.points.len());
    let obstacles = feasibility::check(&mesh, &boundary, &positions);
    assert!(obstacles.inverted_triangles.is_empty() && obstacles.flat_triangles.is_empty() && !obstacles.forbid());
}

#[test]
fn a_triangle_turned_over_is_named_and_bounds_the_inversions() {
    let (mesh, mut positions) = on_shape("cube", json!({ "tetrahedra": 1200 }), "cube");
    let boundary = connectivity::boundary(&mesh.cells, mesh.points.len());
    assert!(!feasibility::check(&mesh, &boundary, &positions).forbid());
    // A vertex in the middle of the top moves across one of its triangles, past the opposite edge.
    let (index, triangle) = boundary
        .triangles
        .iter()
        .enumerate()
        .find(|(_, triangle)| {
            triangle.iter().all(|&v| {
                let [x, y, z] = positions[v as usize];
                z == 1.0 && x > 0.1 && x < 0.9 && y > 0.1 && y < 0.9
            })
        })
        .map(|(index, triangle)| (index, *triangle))
        .expect("a triangle inside the top");
    let [a, b, c] = triangle.map(|v| positions[v as usize]);
    let middle = [(b[0] + c[0]) / 2.0, (b[1] + c[1]) / 2.0];
    positions[triangle[0] as usize] = [a[0] + 1.2 * (middle[0] - a[0]), a[1] + 1.2 * (middle[1] - a[1]), 1.0];
    let obstacles = feasibility::check(&mesh, &boundary, &positions);
    assert!(obstacles.inverted_triangles.contains(&triangle), "{obstacles:?}");
    assert!(obstacles.lower_bound >= 1 && obstacles.lower_bound <= obstacles.inverted_triangles.len());

    let chosen = settings(json!({ "energy": "stretch" }));
    let problem = Problem::from_parts(mesh.clone(), target_of(&mesh, &positions), &chosen, Vec::new()).unwrap();
    let failure = volume_map::run(&problem, &chosen, &mut Silent).expect_err("refused");
    assert_eq!(failure.kind, "infeasible");
    let name = format!("{triangle:?}");
    assert!(
        failure.reason.contains(&name) && failure.reason.contains("at least"),
        "{}",
        failure.reason
    );

    // Told to go on, exactly the forced ones stay inverted, and the outcome says so.
    let chosen = settings(json!({ "energy": "stretch", "on_infeasible": "continue", "untangling": { "steps": 20 } }));
    let outcome = volume_map::run(&problem, &chosen, &mut Silent).expect("a map");
    assert_eq!(outcome.stop, "stalled", "{}", outcome.reason);
    assert_eq!(outcome.metrics["inverted"], problem.obstacles.lower_bound as f64);
    let cell = problem.boundary.cells[index];
    assert!(outcome.reason.contains(&cell.to_string()), "{}", outcome.reason);

    // A flattened triangle counts as well.
    positions[triangle[0] as usize] = [middle[0], middle[1], 1.0];
    let flat = feasibility::check(&mesh, &boundary, &positions);
    assert!(flat.flat_triangles.contains(&triangle) || flat.inverted_triangles.contains(&triangle));
}

#[test]
fn tetrahedra_that_the_boundary_inverts_are_split() {
    // All eight vertices on the boundary, the diagonal 0-7 inside, no tetrahedron with a free vertex.
    let mesh = kuhn(1);
    let boundary = connectivity::boundary(&mesh.cells, 8);
    assert!(
        !feasibility::check(&mesh, &boundary, &mesh.points).forbid(),
        "the identity needs no split"
    );
    // Corner 1 is pressed in, past the diagonal: the tetrahedra behind it turn inside out, on no planar face.
    let mut positions = mesh.points.clone();
    positions[1] = [0.3, 0.55, 0.45];
    let turned: Vec<u32> = (0..6)
        .filter(|&cell| vargeo::mesh::determinant(mesh.cells[cell as usize].map(|v| positions[v as usize])) <= 0.0)
        .collect();
    assert!(!turned.is_empty());
    let obstacles = feasibility::check(&mesh, &boundary, &positions);
    assert_eq!(obstacles.tetrahedra, turned);
    assert!(obstacles.lower_bound >= turned.len());
    let (refined, splits) = feasibility::split_needed(&mesh, &mut positions, |_| {});
    assert_eq!(splits.edges, 1, "the diagonal");
    assert_eq!(positions.len(), refined.points.len());
    let boundary = connectivity::boundary(&refined.cells, refined.points.len());
    assert!(
        feasibility::check(&refined, &boundary, &positions)
            .tetrahedra
            .is_empty()
    );
    assert!((refined.volume() - 1.0).abs() < 1e-14);
}

#[test]
fn an_interior_edge_within_a_planar_face_is_found_and_split() {
    // A double pyramid over the square a, b, c, d with apexes up and down, cut along the diagonal a-c by the axis: the
    // target flattens the upper half, so that the interior diagonal lies in the flat top.
    let points = vec![
        [-1.0, -1.0, 0.0],
        [1.0, -1.0, 0.0],
        [1.0, 1.0, 0.0],
        [-1.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    let around = [[0u32, 1, 2, 4], [0, 2, 3, 4], [0, 2, 1, 5], [0, 3, 2, 5]];
    let mesh = TetrahedralMesh {
        points: points.clone(),
        cells: around.to_vec(),
    };
    assert!(mesh.volumes().iter().all(|&volume| volume > 0.0));
    let mut positions = points;
    positions[4] = [0.2, 0.1, 0.0];
    let boundary = connectivity::boundary(&mesh.cells, 6);
    let obstacles = feasibility::check(&mesh, &boundary, &positions);
    assert_eq!(obstacles.edges, [[0, 2]], "{obstacles:?}");
    assert_eq!(obstacles.tetrahedra, [0, 1], "flattened onto the top");
    let chosen = settings(json!({ "energy": "stretch", "split": "none" }));
    let problem = Problem::from_parts(mesh.clone(), target_of(&mesh, &positions), &chosen, Vec::new()).unwrap();
    let failure = volume_map::run(&problem, &chosen, &mut Silent).expect_err("refused");
    assert!(
        failure.kind == "infeasible" && failure.reason.contains("split = \"needed\""),
        "{}",
        failure.reason
    );

    let chosen = settings(json!({ "energy": "stretch" }));
    let problem = Problem::from_parts(mesh.clone(), target_of(&mesh, &positions), &chosen, Vec::new()).unwrap();
    assert_eq!(problem.splits.edges, 1);
    let outcome = volume_map::run(&problem, &chosen, &mut Silent).expect("a map");
    assert_eq!(
        (outcome.stop.as_str(), outcome.metrics["inverted"]),
        ("converged", 0.0),
        "{}",
        outcome.reason
    );
    assert!(
        outcome
            .notices
            .iter()
            .any(|notice| notice.contains("split 1 interior edges"))
    );
}
