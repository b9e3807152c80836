//! How near the fitted boundary and the target are, and how evenly parameters run along the elements' edges.

use super::target::Target;
use crate::fem::boundary::Boundary;
use crate::fem::space::Space;
use crate::geometry::closest_point::ClosestPoint;
use crate::mesh::mixed::{MixedMesh, Topology};
use crate::mesh::{self, TriangleMesh};
use crate::method::Failure;
use crate::metric::crease::crease_distance;
use crate::metric::distance;
use std::collections::BTreeMap;

/// Intervals along an edge when distances are measured.
const FINE: usize = 12;
/// Edges of the target with a larger angle between their faces' normals, in degrees, are creases.
const CREASE_ANGLE: f64 = 40.0;

/// Intervals along an edge to measure distances of a boundary with this order.
pub(super) fn fine_intervals(order: usize) -> usize {
    FINE.max(2 * order)
}

/// Distances and uniformity of the boundary, unless `stop` says to give up.
pub fn measure_boundary(
    volume: &MixedMesh,
    topology: &Topology,
    space: &Space,
    x: &[f64],
    target: &Target,
    metrics: &mut BTreeMap<String, f64>,
    stop: &dyn Fn() -> bool,
) -> Result<(), Failure> {
    let boundary = Boundary::new(volume, topology, space, fine_intervals(space.highest_order()));
    let mut samples = Vec::new();
    boundary.positions(x, &mut samples);
    let fitted = TriangleMesh {
        points: samples.clone(),
        cells: boundary.triangles.clone(),
    };
    let clean = &target.clean;
    let mut set = |name: &str, value: f64| {
        metrics.insert(name.to_string(), value);
    };
    if clean.cells.is_empty() {
        let diagonal = mesh::diagonal(&clean.points);
        let distances = distance::of_points(&clean.points, &ClosestPoint::new(&fitted));
        let percent = |value: f64| 100.0 * value / diagonal;
        let most = percent(distances.iter().copied().fold(0.0, f64::max));
        let square = distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64;
        set("hausdorff", most);
        set("hausdorff_target_to_fit", most);
        set("hausdorff_fit_to_target", f64::NAN);
        set("distance_rms", percent(square.sqrt()));
    } else {
        let measured = distance::hausdorff(&fitted, clean, stop).map_err(Failure::invalid)?;
        set("hausdorff", measured.percent(measured.max()));
        set("hausdorff_fit_to_target", measured.percent(measured.forward.max));
        set("hausdorff_target_to_fit", measured.percent(measured.backward.max));
        set(
            "distance_rms",
            measured.percent(measured.forward.rms.max(measured.backward.rms)),
        );
    }
    let crease = crease_distance(clean, &fitted, CREASE_ANGLE);
    let scale = 100.0 / mesh::diagonal(&clean.points);
    let crease = crease.map_or([f64::NAN; 2], |crease| [scale * crease.max, scale * crease.mean]);
    set("crease_distance", crease[0]);
    set("crease_distance_mean", crease[1]);
    let mut sum = 0.0;
    for line in &boundary.edges {
        let speeds: Vec<f64> = line
            .windows(2)
            .map(|pair| mesh::length(mesh::subtract(samples[pair[1] as usize], samples[pair[0] as usize])))
            .collect();
        let mean = speeds.iter().sum::<f64>() / speeds.len() as f64;
        let square = speeds.iter().map(|speed| (speed - mean).powi(2)).sum::<f64>() / speeds.len() as f64;
        sum += square.sqrt() / mean.max(f64::MIN_POSITIVE);
    }
    set("edge_uniformity", sum / boundary.edges.len() as f64);
    Ok(())
}
