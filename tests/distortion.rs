//! Distortion of maps whose singular values are known, under scaling, rotation and inversion.

use vargeo::mesh::TetrahedralMesh;
use vargeo::mesh::generate::lattice::kuhn;
use vargeo::metric::distortion::{InvalidSource, distortion};
use vargeo::metric::scaled_jacobian::ScaledJacobians;
use vargeo::metric::{Metric, families};

/// Rotated, stretched by the factors, rotated again.
fn linear(mesh: &TetrahedralMesh, factors: [f64; 3]) -> Vec<[f64; 3]> {
    let first = nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0);
    let second = nalgebra::Rotation3::from_euler_angles(-0.7, 0.2, 0.9);
    let matrix = second * nalgebra::Matrix3::from_diagonal(&factors.into()) * first.matrix();
    mesh.points
        .iter()
        .map(|&point| (matrix * nalgebra::Vector3::from(point)).into())
        .collect()
}

fn close(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-12 * b.abs().max(1.0), "{a} instead of {b}");
}

#[test]
fn of_linear_maps() {
    let mesh = kuhn(2);
    let image = linear(&mesh, [3.0, 1.5, 0.5]);
    let measured = distortion(&mesh, &image, 2.25).unwrap();
    close(measured.d_aa, 6.0 + 1.0 / 6.0);
    close(measured.d_ma, 6.0 + 1.0 / 6.0);
    close(measured.d_av, 2.25 + 1.0 / 2.25);
    close(measured.d_mv, 2.25 + 1.0 / 2.25);
    close(measured.d_av_rescaled, 2.0);
    close(measured.d_mv_rescaled, 2.0);
    close(measured.min_determinant, 1.0);
    close(measured.mean_determinant, 2.25);
    assert_eq!((measured.inverted, measured.degenerate), (0, 0));
    close(measured.weights.iter().sum(), 1.0);
    for (value, expected) in measured.singular_values[7].into_iter().zip([3.0, 1.5, 0.5]) {
        close(value, expected);
    }
    // Angles do not see the scale, volumes do.
    let doubled: Vec<[f64; 3]> = image.iter().map(|point| point.map(|c| 2.0 * c)).collect();
    let doubled = distortion(&mesh, &doubled, 18.0).unwrap();
    close(doubled.d_aa, measured.d_aa);
    close(doubled.d_av, 18.0 + 1.0 / 18.0);
    close(doubled.d_av_rescaled, 2.0);
}

#[test]
fn averages_weigh_by_source_volume() {
    let mut mesh = kuhn(2);
    // The middle vertex moves in the source: volumes differ, the identity does not.
    let image = mesh.points.clone();
    mesh.points[13] = [0.6, 0.4, 0.55];
    let measured = distortion(&mesh, &image, 1.0).unwrap();
    // The mean determinant of any map with a fixed boundary is the volume ratio.
    close(measured.mean_determinant, 1.0);
    let volumes = mesh.volumes();
    let total: f64 = volumes.iter().sum();
    let by_hand: f64 = volumes
        .iter()
        .zip(&measured.determinant)
        .map(|(v, d)| v / total * (d + 1.0 / d))
        .sum();
    close(measured.d_av, by_hand);
    assert!(measured.d_mv > measured.d_av && measured.d_av > 2.0);
    assert!(measured.d_ma > measured.d_aa && measured.d_aa > 2.0);
}

#[test]
fn inverted_and_flat_tetrahedra() {
    let mesh = kuhn(2);
    let mirrored = distortion(&mesh, &linear(&mesh, [2.0, 1.0, -1.0]), 2.0).unwrap();
    assert_eq!((mirrored.inverted, mirrored.degenerate), (mesh.cells.len(), 0));
    close(mirrored.d_aa, 2.5);
    close(mirrored.min_determinant, -1.0);
    assert!(mirrored.d_av.is_nan() && mirrored.d_mv.is_nan() && mirrored.d_av_rescaled.is_nan());
    let flat = distortion(
        &mesh,
        &mesh.points.iter().map(|p| [p[0], p[1], 0.0]).collect::<Vec<_>>(),
        1.0,
    )
    .unwrap();
    assert_eq!((flat.inverted, flat.degenerate), (mesh.cells.len(), mesh.cells.len()));
    assert!(flat.d_ma.is_infinite() && flat.d_mv.is_nan());
    let mut one = mesh.points.clone();
    one[13] = [2.0, 0.5, 0.5];
    let one = distortion(&mesh, &one, 1.0).unwrap();
    assert!(one.inverted > 0 && one.inverted < mesh.cells.len() && one.d_av.is_nan() && one.d_aa.is_finite());
    let mut missing = mesh.points.clone();
    missing[13][1] = f64::NAN;
    let missing = distortion(&mesh, &missing, 1.0).unwrap();
    assert!(missing.d_av.is_nan() && missing.d_ma.is_nan() && missing.min_determinant.is_nan());
    let mut source = mesh.clone();
    source.cells[5].swap(0, 1);
    assert_eq!(distortion(&source, &mesh.points, 1.0), Err(InvalidSource { cell: 5 }));
}

#[test]
fn scaled_jacobians_of_known_shapes() {
    let corner = TetrahedralMesh {
        points: vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
        ],
        // The corner of a cube, and the regular tetrahedron opposite to it.
        cells: vec![[0, 1, 2, 3], [1, 2, 3, 4]],
    };
    let measured = ScaledJacobians::of_tetrahedra(&corner);
    // At the ends of the edges the frame has lengths 1, sqrt 2, sqrt 2.
    close(measured.cells[0], std::f64::consts::SQRT_2 / 2.0);
    close(measured.cells[1].abs(), 1.0);
    close(measured.mean, (measured.cells[0] + measured.cells[1]) / 2.0);
    close(measured.min, measured.cells[0].min(measured.cells[1]));
}

#[test]
fn every_metric_is_defined_once() {
    let all: Vec<Metric> = families()
        .iter()
        .flat_map(|(_, metrics)| metrics.iter().copied())
        .collect();
    for (index, metric) in all.iter().enumerate() {
        assert!(
            all[..index].iter().all(|other| other.name != metric.name),
            "{}",
            metric.name
        );
        assert!(metric.definition.ends_with('.') && !metric.symbol.is_empty());
    }
}
