//! Catmull-Clark subdivision: weights, creases, and positions on the limit surface.

use vargeo::mesh::catmull_clark::{limit, subdivide};
use vargeo::mesh::generate::template::generate_template;
use vargeo::mesh::surface::Surface;

fn cube() -> Surface {
    generate_template("box", &serde_json::json!({ "quads": 6 }), [[-1.0; 3], [1.0; 3]]).unwrap()
}

fn close(a: [f64; 3], b: [f64; 3], tolerance: f64) -> bool {
    (0..3).all(|axis| (a[axis] - b[axis]).abs() < tolerance)
}

#[test]
fn weights_of_the_cube_are_those_of_the_rules() {
    let cube = cube();
    assert_eq!((cube.points.len(), cube.quads.len()), (8, 6));
    let once = subdivide(&cube, &[], 1);
    assert_eq!((once.surface.points.len(), once.surface.quads.len()), (8 + 12 + 6, 24));
    // Vertex (1,1,1): Q = mean of (1,0,0), .. = 1/3 each, R = 2/3 each, so (Q + 2 R + 0) / 3 = 5/9.
    let corner = cube.points.iter().position(|point| *point == [1.0; 3]).unwrap();
    assert!(close(once.surface.points[corner], [5.0 / 9.0; 3], 1e-15));
    // The limit of a vertex of valence 3: (9 v + 4 sum of neighbours + sum of diagonal corners) / 24.
    let to_limit = limit(&cube, &[]);
    let mut limits = vec![[0.0; 3]; 8];
    to_limit.apply(&cube.points, &mut limits);
    assert!(close(limits[corner], [0.5; 3], 1e-15), "{:?}", limits[corner]);
}

#[test]
fn limit_positions_stay_under_subdivision_and_rows_sum_to_one() {
    let mut surface = generate_template("torus", &serde_json::json!({ "quads": 60 }), [[-1.0; 3], [1.0; 3]]).unwrap();
    // A boundary and a crease across.
    surface.quads.truncate(50);
    surface.drop_unused();
    let edges = surface.edges();
    let crease: Vec<[u32; 2]> = edges
        .iter()
        .filter(|edge| edge.faces.len() == 2 && edge.ends[1] == edge.ends[0] + 1)
        .map(|edge| edge.ends)
        .take(4)
        .collect();
    let coarse = limit(&surface, &crease);
    let fine = subdivide(&surface, &crease, 2);
    let map = limit(&fine.surface, &fine.creases).after(&fine.map);
    assert_eq!(fine.map.rows(), fine.surface.points.len());
    for row in 0..map.rows() {
        let sum: f64 = map.row(row).iter().map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-12);
    }
    let mut before = vec![[0.0; 3]; coarse.rows()];
    coarse.apply(&surface.points, &mut before);
    let mut after = vec![[0.0; 3]; map.rows()];
    map.apply(&surface.points, &mut after);
    // Old vertices come first. Where the crease ends the limit is an approximation.
    let ends = |vertex: usize| crease.iter().flatten().filter(|&&end| end as usize == vertex).count() == 1;
    for (vertex, (a, b)) in before.iter().zip(&after).enumerate() {
        let tolerance = if ends(vertex) { 0.02 } else { 1e-12 };
        assert!(close(*a, *b, tolerance), "vertex {vertex}: {a:?} and {b:?}");
    }
}

#[test]
fn creases_and_boundaries_stay_on_their_own_curves() {
    let cube = cube();
    let all: Vec<[u32; 2]> = cube.creases(30.0);
    assert_eq!(all.len(), 12, "every edge of a cube is sharp");
    let sharp = subdivide(&cube, &all, 3);
    // Corners stay, and everything stays on the cube's sides.
    for point in &sharp.surface.points {
        assert!(point.iter().any(|x| x.abs() == 1.0) && point.iter().all(|x| x.abs() <= 1.0));
    }
    assert_eq!(sharp.surface.points[..8], cube.points[..]);
    assert_eq!(sharp.parents.len(), 6 * 64);
}

#[test]
fn transposed_map_is_the_adjoint() {
    let surface = generate_template("sphere", &serde_json::json!({ "quads": 24 }), [[-1.0; 3], [1.0; 3]]).unwrap();
    let fine = subdivide(&surface, &[], 2);
    let field = |count: usize, seed: f64| -> Vec<[f64; 3]> {
        (0..count)
            .map(|index| std::array::from_fn(|axis| (seed + index as f64 * 1.7 + axis as f64).sin()))
            .collect()
    };
    let (x, y) = (field(fine.map.columns(), 0.3), field(fine.map.rows(), 0.9));
    let (mut forward, mut back) = (vec![[0.0; 3]; fine.map.rows()], vec![[0.0; 3]; fine.map.columns()]);
    fine.map.apply(&x, &mut forward);
    fine.map.apply_transposed(&y, &mut back);
    let inner = |a: &[[f64; 3]], b: &[[f64; 3]]| -> f64 {
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
    };
    assert!((inner(&forward, &y) - inner(&x, &back)).abs() < 1e-10);
}
