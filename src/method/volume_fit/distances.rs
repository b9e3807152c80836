//! How near the fitted boundary and the target are, and how evenly parameters run along the elements' edges.

use super::invalid;
use super::target::Target;
use crate::fem::boundary::Boundary;
use crate::fem::space::Space;
use crate::geometry::closest_point::ClosestPoint;
use crate::mesh::mixed::{MixedMesh, Topology};
use crate::mesh::{self, TriangleMesh};
use crate::method::Failure;
use crate::metric::distance;
use std::collections::BTreeMap;

/// Intervals along an edge when distances are measured.
const FINE: usize = 12;

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
        set("hausdorff_from_target", most);
        set("hausdorff_to_target", f64::NAN);
        set("distance_rms", percent(square.sqrt()));
    } else {
        let measured = distance::hausdorff(&fitted, clean, stop).map_err(invalid)?;
        set("hausdorff", measured.percent(measured.max()));
        set("hausdorff_to_target", measured.percent(measured.forward.max));
        set("hausdorff_from_target", measured.percent(measured.backward.max));
        set("distance_rms", measured.percent(measured.backward.rms));
    }
    let creases = crease_points(clean);
    let (mut mean, mut most) = (f64::NAN, f64::NAN);
    if !creases.is_empty() {
        let distances = distance::of_points(&creases, &ClosestPoint::new(&fitted));
        let scale = 100.0 / mesh::diagonal(&clean.points);
        mean = scale * distances.iter().sum::<f64>() / distances.len() as f64;
        most = scale * distances.iter().copied().fold(0.0, f64::max);
    }
    set("crease_distance", mean);
    set("crease_distance_max", most);
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

/// Points along the edges of a surface that are bent by more than 40 degrees.
fn crease_points(surface: &TriangleMesh) -> Vec<[f64; 3]> {
    let mut sides: BTreeMap<[u32; 2], Vec<[f64; 3]>> = BTreeMap::new();
    for &cell in &surface.cells {
        let normal = mesh::area_vector(surface.corners(cell));
        let size = mesh::length(normal);
        if !(size > 0.0) {
            continue;
        }
        let normal = normal.map(|coordinate| coordinate / size);
        for place in 0..3 {
            let (a, b) = (cell[place], cell[(place + 1) % 3]);
            sides.entry([a.min(b), a.max(b)]).or_default().push(normal);
        }
    }
    let mut points = Vec::new();
    for ([a, b], normals) in sides {
        if let [first, second] = normals[..]
            && mesh::dot(first, second) < 40.0_f64.to_radians().cos()
        {
            let (a, b) = (surface.points[a as usize], surface.points[b as usize]);
            for share in [0.1, 0.5, 0.9] {
                points.push(std::array::from_fn(|axis| a[axis] + share * (b[axis] - a[axis])));
            }
        }
    }
    points
}
