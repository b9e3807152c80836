//! The points of the target that the fit's distance is measured to, with the target's normals there.

use super::settings::{Sampling, Settings};
use crate::geometry::centroidal_voronoi::{Relaxation, Sample, project, relax, scatter};
use crate::geometry::squared_distance::SquaredDistance;
use crate::mesh::{TriangleMesh, area_vector, length, subtract};
use crate::method::Failure;
use crate::optimize::{Iterate, Observer, StopReason};

/// Facets serve as samples when none has an edge beyond this share of the diagonal,
const EVEN: f64 = 0.05;
/// and there are at least as many as vertices, and at most this many times that: more cost time and gain nothing.
const PLENTY: usize = 16;

/// See the module.
#[derive(Clone, Debug)]
pub struct Samples {
    pub points: Vec<[f64; 3]>,
    /// Unit vectors; zero for a cloud.
    pub normals: Vec<[f64; 3]>,
    pub sampling: Sampling,
}

/// Samples the target, whose diagonal is 1, for a fitted mesh with `vertices`.
///
/// # Errors
/// A target with an index out of range, which reading would have found.
pub fn sample(
    target: &TriangleMesh,
    vertices: usize,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<Samples, Failure> {
    let even = || {
        let longest = target.cells.iter().map(|&cell| {
            let [a, b, c] = target.corners(cell);
            length(subtract(b, a))
                .max(length(subtract(c, b)))
                .max(length(subtract(a, c)))
        });
        (vertices..=PLENTY * vertices).contains(&target.cells.len()) && longest.fold(0.0, f64::max) <= EVEN
    };
    let facets = match settings.sampling {
        Sampling::Facets => true,
        Sampling::Tessellation => false,
        Sampling::Auto => even(),
    };
    if facets {
        let mut samples = Samples {
            points: Vec::with_capacity(target.cells.len()),
            normals: Vec::with_capacity(target.cells.len()),
            sampling: Sampling::Facets,
        };
        for &cell in &target.cells {
            let corners = target.corners(cell);
            if let Some(normal) = unit(area_vector(corners)) {
                let [a, b, c] = corners;
                samples
                    .points
                    .push(std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0));
                samples.normals.push(normal);
            }
        }
        return Ok(samples);
    }
    let count = if settings.samples > 0 {
        settings.samples
    } else {
        vertices
    };
    let mut term = SquaredDistance::new(&target.points, &target.cells)
        .map_err(|error| Failure::invalid(format!("target: {error}")))?;
    let start = scatter(&target.points, &target.cells, count.max(4), settings.seed);
    let relaxation = Relaxation {
        iterations: settings.sampling_iterations,
        ..Relaxation::default()
    };
    let solution = relax(&mut term, &target.points, &start, &relaxation, &mut Quiet(observer));
    let (sites, _) = solution.x.as_chunks::<3>();
    let found: Vec<Sample> = project(&mut term, &target.points, sites)
        .into_iter()
        .flatten()
        .collect();
    Ok(Samples {
        points: found.iter().map(|sample| sample.point).collect(),
        normals: found.iter().map(|sample| sample.normal).collect(),
        sampling: Sampling::Tessellation,
    })
}

/// A cloud as samples without normals.
pub fn of_cloud(points: &[[f64; 3]]) -> Samples {
    Samples {
        points: points.to_vec(),
        normals: vec![[0.0; 3]; points.len()],
        sampling: Sampling::Facets,
    }
}

/// Passes on the wish to stop and keeps the iterates of the sampling to itself.
struct Quiet<'a>(&'a mut dyn Observer);

impl Observer for Quiet<'_> {
    fn phase(&mut self, _name: &str) {}

    fn iterate(&mut self, _iterate: &Iterate) {}

    fn stop(&self) -> Option<StopReason> {
        self.0.stop()
    }
}

/// The direction of a vector; `None` where it has none.
fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let norm = length(vector);
    (norm > 0.0 && norm.is_finite()).then(|| vector.map(|x| x / norm))
}
