//! What is reported of a map: its metrics and the mesh with fields to colour it by.

use super::metrics::energy_metric;
use super::problem::Problem;
use super::settings::{Settings, Weighting};
use crate::energy::mapping::{Density, MappingEnergy};
use crate::energy::{self, Energy};
use crate::linalg::vector3::{cofactor, dot};
use crate::mesh::connectivity::Boundary;
use crate::mesh::format::{Cells, vtu};
use crate::mesh::{self, TetrahedralMesh, TriangleMesh};
use crate::method::Failure;
use crate::metric::distortion::distortion;
use crate::metric::scaled_jacobian::ScaledJacobians;
use nalgebra::Matrix3;
use std::collections::BTreeMap;

/// A map in the units of the files with what follows from it.
pub struct Measured {
    pub metrics: BTreeMap<String, f64>,
    /// The map as a VTU file.
    pub mesh: Vec<u8>,
    /// Tetrahedra whose determinant is not positive.
    pub inverted: Vec<u32>,
}

/// Measures the map onto `positions`, given in the solver's units.
pub fn measure(problem: &Problem, settings: &Settings, positions: &[[f64; 3]]) -> Result<Measured, Failure> {
    let density = settings.density()?;
    let given = problem.to_given_units(positions);
    // The source at the target's volume, 1: the scale at which energies and determinants compare.
    let scale = problem.source_volume().cbrt().recip();
    let rest = TetrahedralMesh {
        points: problem
            .source
            .points
            .iter()
            .map(|point| point.map(|coordinate| coordinate * scale))
            .collect(),
        cells: problem.source.cells.clone(),
    };
    let weights = problem.volume_weights();
    let failure = |error: energy::mapping::InvalidRest| Failure::invalid(format!("source mesh: {error}"));
    let mut mapping = MappingEnergy::new(&rest, &weights, Density::new(density), None).map_err(failure)?;
    let flat = positions.as_flattened();
    let cells = rest.cells.len();
    let measured = distortion(
        &TetrahedralMesh {
            points: problem.given.clone(),
            cells: rest.cells.clone(),
        },
        &given,
        problem.ratio,
    )
    .map_err(|error| Failure::invalid(format!("source mesh: {error}")))?;
    let determinants: Vec<f64> = measured
        .determinant
        .iter()
        .map(|determinant| determinant / problem.ratio)
        .collect();

    let mut metrics = BTreeMap::new();
    let mut set = |name: &str, value: f64| {
        metrics.insert(name.to_string(), value);
    };
    for other in energy::energies() {
        mapping.set_density(Density::new(*other));
        set(&energy_metric(other.name()), mapping.value(flat));
    }

    // The chosen energy as it was minimized: on the problem's source, with the problem's weights.
    let densities = densities(problem, density, positions);
    let mean = |weights: &[f64]| {
        weights
            .iter()
            .zip(&densities)
            .map(|(weight, value)| weight * value)
            .sum::<f64>()
    };
    let minimized = match settings.weighting {
        Weighting::Target => {
            let weighted: Vec<f64> = weights
                .iter()
                .zip(&determinants)
                .map(|(weight, det)| weight * det)
                .collect();
            mean(&weighted) / weighted.iter().sum::<f64>()
        }
        weighting => mean(&problem.weights(weighting)),
    };
    set("energy", minimized);
    let given_volume = problem.unit.powi(3) / problem.ratio;
    set("energy_integral", given_volume * mean(&weights));

    let inverted: Vec<u32> = (0..cells as u32)
        .filter(|&cell| !(determinants[cell as usize] > 0.0))
        .collect();
    set("d_aa", measured.d_aa);
    set("d_ma", measured.d_ma);
    set("d_av", measured.d_av);
    set("d_mv", measured.d_mv);
    set("d_av_rescaled", measured.d_av_rescaled);
    set("d_mv_rescaled", measured.d_mv_rescaled);
    set("inverted", measured.inverted as f64);
    set("degenerate", measured.degenerate as f64);
    set("inverted_lower_bound", problem.obstacles.lower_bound as f64);
    set("min_determinant", measured.min_determinant);

    let image = TetrahedralMesh {
        points: given.clone(),
        cells: rest.cells.clone(),
    };
    let jacobians = ScaledJacobians::of_tetrahedra(&image);
    set("scaled_jacobian_min", jacobians.min);
    set("scaled_jacobian_mean", jacobians.mean);

    let distances: Vec<f64> = problem
        .boundary
        .vertices
        .iter()
        .map(|&vertex| {
            mesh::length(mesh::subtract(
                given[vertex as usize],
                problem.given_targets[vertex as usize],
            ))
        })
        .collect();
    set(
        "constraint_residual",
        distances.iter().map(|distance| distance * distance).sum::<f64>() / problem.unit.powi(2),
    );
    let on_target: Vec<[f64; 3]> = problem
        .boundary
        .vertices
        .iter()
        .map(|&vertex| problem.given_targets[vertex as usize])
        .collect();
    set(
        "constraint_distance",
        distances.iter().copied().fold(0.0, f64::max) / mesh::diagonal(&on_target),
    );

    let enclosed = enclosed_volume(&problem.boundary, positions);
    set(
        "mean_determinant_error",
        (measured.mean_determinant / problem.ratio / enclosed - 1.0).abs(),
    );
    set("volume_ratio", problem.ratio);
    set("vertices", rest.points.len() as f64);
    set("tetrahedra", cells as f64);
    set("boundary_vertices", problem.boundary.vertices.len() as f64);

    let flags: Vec<f64> = determinants
        .iter()
        .map(|&determinant| if determinant > 0.0 { 0.0 } else { 1.0 })
        .collect();
    let mesh = vtu::write(
        &given,
        Cells {
            tetrahedra: &image.cells,
            ..Cells::default()
        },
        &[("source", 3, problem.given.as_flattened())],
        &[
            ("angle_distortion", 1, &measured.angle_distortion),
            ("volume_distortion", 1, &measured.volume_distortion),
            ("determinant", 1, &determinants),
            ("energy_density", 1, &densities),
            ("scaled_jacobian", 1, &jacobians.cells),
            ("inverted", 1, &flags),
        ],
    );
    Ok(Measured {
        metrics,
        mesh,
        inverted,
    })
}

/// The volume within the image of the boundary.
fn enclosed_volume(boundary: &Boundary, positions: &[[f64; 3]]) -> f64 {
    TriangleMesh {
        points: positions.to_vec(),
        cells: boundary.triangles.clone(),
    }
    .enclosed_volume()
}

/// The energy density in every tetrahedron of the problem's source.
fn densities(problem: &Problem, density: &dyn Energy, positions: &[[f64; 3]]) -> Vec<f64> {
    let edges = |points: &[[f64; 3]], cell: [u32; 4]| {
        let [a, b, c, d] = cell.map(|vertex| points[vertex as usize]);
        [b, c, d].map(|point| mesh::subtract(point, a))
    };
    problem
        .source
        .cells
        .iter()
        .map(|&cell| {
            let (before, after) = (edges(&problem.source.points, cell), edges(positions, cell));
            let cof = cofactor(&before);
            let determinant = dot(before[0], cof[0]);
            let jacobian = Matrix3::from_fn(|row, column| {
                (0..3).map(|edge| after[edge][row] * cof[edge][column]).sum::<f64>() / determinant
            });
            density.value(&jacobian)
        })
        .collect()
}
