//! Multi-linear averaging: weights that sum to 1, the tricubic mask inside, features that stay, linear precision.

use vargeo::mesh::mixed::MixedMesh;
use vargeo::mesh::multilinear_averaging::{Features, features, subdivide};
use vargeo::mesh::template::{carve, collapse, grid};

fn l_shape() -> MixedMesh {
    carve::carve(&grid::grid([3, 3, 3]), [[1.0, 1.0, 1.0], [3.0, 3.0, 3.0]]).unwrap()
}

#[test]
fn regular_insides_get_the_mask_of_the_tricubic_spline() {
    let mesh = grid::grid([4, 4, 4]);
    let fine = subdivide(&mesh, &Features::default()).unwrap();
    let inside = mesh.points.iter().position(|point| *point == [2.0, 2.0, 2.0]).unwrap();
    let row = fine.map.row(inside);
    let own = row.iter().find(|entry| entry.0 as usize == inside).unwrap().1;
    assert!((own - 27.0 / 64.0).abs() < 1e-15, "{own}");
    assert_eq!(row.len(), 27);
    for row in 0..fine.map.rows() {
        let sum: f64 = fine.map.row(row).iter().map(|entry| entry.1).sum();
        assert!((sum - 1.0).abs() < 1e-14);
        assert!(fine.map.row(row).iter().all(|entry| entry.1 > 0.0));
    }
    assert_eq!(fine.mesh.hexahedra.len(), 8 * 64);
}

#[test]
fn features_of_a_solid_with_flat_sides_stay_where_they_are() {
    let mesh = l_shape();
    let topology = mesh.topology().unwrap();
    let mut tagged = features(&mesh, &topology, 40.0);
    assert!(!tagged.corners.is_empty() && tagged.creases.len() > tagged.corners.len());
    let mut volume = mesh.clone();
    for _ in 0..2 {
        let fine = subdivide(&volume, &tagged).unwrap();
        // Flat sides, straight creases and corners: every point of the boundary stays on the solid's boundary, and the
        // volume with it.
        assert!(
            (fine.mesh.volume() - mesh.volume()).abs() < 1e-12,
            "{}",
            fine.mesh.volume()
        );
        for &corner in &tagged.corners {
            assert_eq!(fine.mesh.points[corner as usize], mesh.points[corner as usize]);
        }
        assert_eq!(fine.features.creases.len(), 2 * tagged.creases.len());
        (volume, tagged) = (fine.mesh, fine.features);
    }
    // Without features the solid shrinks.
    let smooth = subdivide(&mesh, &Features::default()).unwrap();
    assert!(smooth.mesh.volume() < 0.9 * mesh.volume());
}

#[test]
fn prisms_are_cut_into_hexahedra_and_affine_maps_commute() {
    let mesh = collapse::collapse(&grid::grid([3, 2, 2]), 0, [[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]]).unwrap();
    assert!(!mesh.prisms.is_empty());
    let fine = subdivide(&mesh, &Features::default()).unwrap();
    assert_eq!(
        fine.mesh.hexahedra.len(),
        8 * mesh.hexahedra.len() + 6 * mesh.prisms.len()
    );
    let image = |[x, y, z]: [f64; 3]| [2.0 * x - y + 0.5 * z + 1.0, x + 3.0 * y, 0.25 * x - z];
    let mut moved = mesh.clone();
    for point in &mut moved.points {
        *point = image(*point);
    }
    let other = subdivide(&moved, &Features::default()).unwrap();
    for (a, b) in fine.mesh.points.iter().zip(&other.mesh.points) {
        let a = image(*a);
        assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-13));
    }
}
