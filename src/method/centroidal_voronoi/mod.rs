//! Centroidal Voronoi tessellation of a surface: sites are scattered over it and moved to the centroids of their cells.
//!
//! The computation is [`crate::geometry::centroidal_voronoi`]; here are its model, settings, figures and picture.
//!
//! Guaranteed: the energy never grows; the same input gives the same bits with any number of threads. Not guaranteed: the
//! global minimum.

pub mod metrics;
pub mod model;
pub mod settings;

use super::model::ModelKind;
use super::setting::Field;
use super::{Failure, Inputs, Method, Outcome, Traces};
use crate::geometry::centroidal_voronoi::{Relaxation, relax, scatter};
use crate::geometry::point_tree::PointTree;
use crate::geometry::squared_distance::{Options, SquaredDistance, Wanted};
use crate::mesh::TriangleMesh;
use crate::mesh::format::Cells;
use crate::mesh::format::vtu;
use crate::metric::Metric;
use crate::optimize::{Iterate, Observer, StopReason};
use serde_json::Value;
use settings::Settings;
use std::collections::BTreeMap;

/// The method `centroidal-voronoi`.
pub struct CentroidalVoronoi;

impl Method for CentroidalVoronoi {
    fn name(&self) -> &'static str {
        "centroidal-voronoi"
    }

    fn version(&self) -> u32 {
        6
    }

    fn summary(&self) -> &'static str {
        "spreads sites over a surface so that each lies at the centroid of its Voronoi cell"
    }

    fn source(&self) -> &'static str {
        "On centroidal Voronoi tessellation: energy smoothness and fast computation, ACM Transactions on Graphics 28(4), \
         2009; Isotropic remeshing with fast and exact computation of restricted Voronoi diagram, Computer Graphics \
         Forum 28(5), 2009"
    }

    fn model(&self) -> &'static ModelKind {
        model::kind()
    }

    fn settings(&self) -> &'static [Field] {
        settings::FIELDS
    }

    fn metrics(&self) -> &'static [Metric] {
        metrics::ALL
    }

    fn incomparable(&self, metric: &str) -> &'static [&'static str] {
        match metric {
            "energy" => &["sites", "model"],
            _ => &[],
        }
    }

    fn traces(&self) -> &'static [(&'static str, &'static str)] {
        COLUMNS
    }

    fn counters(&self) -> &'static [(&'static str, &'static str)] {
        COUNTERS
    }

    fn run(&self, inputs: Inputs<'_>, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let settings = Settings::resolve(inputs.settings)?;
        observer.phase("prepare");
        let mut notices = Vec::new();
        let surface = model::surface(&inputs.model, &mut notices)?;
        run(&surface, &settings, notices, observer)
    }
}

/// Names and meanings of the trace's columns.
const COLUMNS: &[(&str, &str)] = &[
    ("iteration", "number of accepted steps before this row"),
    ("energy", "integral of the squared distance to the nearest site"),
    (
        "gradient_norm",
        "root mean square distance of the sites to the centroids of their cells, weighted by area, over the spacing",
    ),
    ("step", "length factor of the step that led here"),
];

/// Names and meanings of the counters.
const COUNTERS: &[(&str, &str)] = &[
    ("iterations", "accepted steps"),
    ("evaluations", "evaluations of the energy with its gradient"),
];

/// Keeps the iterates for the trace.
struct Recorder<'a> {
    observer: &'a mut dyn Observer,
    rows: Vec<Iterate>,
}

impl Observer for Recorder<'_> {
    fn phase(&mut self, name: &str) {
        self.observer.phase(name);
    }
    fn iterate(&mut self, iterate: &Iterate) {
        self.rows.push(*iterate);
        self.observer.iterate(iterate);
    }
    fn stop(&self) -> Option<StopReason> {
        self.observer.stop()
    }
}

/// Tessellates a surface.
///
/// # Errors
/// `invalid-input` for a surface without area.
pub fn run(
    surface: &TriangleMesh,
    settings: &Settings,
    notices: Vec<String>,
    observer: &mut dyn Observer,
) -> Result<Outcome, Failure> {
    let mut term = SquaredDistance::new(&surface.points, &surface.cells)
        .map_err(|error| Failure::invalid(format!("surface: {error}; mend the file")))?;
    observer.phase("scatter");
    let start = scatter(&surface.points, &surface.cells, settings.sites as usize, settings.seed);
    if start.is_empty() {
        return Err(Failure::invalid(
            "the surface has no area, so that sites cannot be spread over it; give a surface with triangles that are not \
             flat"
            .to_string(),
        ));
    }
    observer.phase("minimize");
    let relaxation = Relaxation {
        method: settings.solver.into(),
        iterations: settings.iteration_limit,
        tolerance: settings.gradient_tolerance,
    };
    let mut recorder = Recorder {
        observer,
        rows: Vec::new(),
    };
    let solution = relax(&mut term, &surface.points, &start, &relaxation, &mut recorder);
    let rows = recorder.rows;
    observer.phase("measure");
    let (sites, _) = solution.x.as_chunks::<3>();
    let tree = PointTree::new(sites);
    let mut areas = vec![0.0; sites.len()];
    let wanted = Wanted {
        areas: Some(&mut areas),
        ..Wanted::default()
    };
    let energy = term.evaluate(&surface.points, &tree, &Options::default(), wanted);
    let area: f64 = areas.iter().sum();
    let count = sites.len() as f64;
    let mean = area / count;
    let variance = areas.iter().map(|a| (a - mean) * (a - mean)).sum::<f64>() / count;
    let empty = areas.iter().filter(|&&a| a == 0.0).count();

    // The picture: every piece of the diagram as a fan of triangles.
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let (mut colours, mut sizes) = (Vec::new(), Vec::new());
    let mut pieces = 0u64;
    term.diagram().pieces(&surface.points, &tree, None, |piece| {
        pieces += 1;
        let first = points.len() as u32;
        points.extend_from_slice(piece.polygon);
        for k in 2..piece.polygon.len() as u32 {
            triangles.push([first, first + k - 1, first + k]);
            // A step of the golden ratio: cells with near numbers get colours that are far apart.
            colours.push((f64::from(piece.site) * 0.618_033_988_749_894_9).fract());
            sizes.push(areas[piece.site as usize] / mean);
        }
    });
    let mesh = vtu::write(
        &points,
        Cells {
            triangles: &triangles,
            ..Cells::default()
        },
        &[],
        &[("cell", 1, &colours), ("relative_area", 1, &sizes)],
    );
    let metrics = BTreeMap::from([
        ("energy".to_string(), energy),
        ("quantization".to_string(), energy * count / (area * area)),
        ("centroid_distance".to_string(), solution.gradient_norm),
        ("area_deviation".to_string(), variance.sqrt() / mean),
        ("empty_cells".to_string(), empty as f64),
        ("area".to_string(), area),
        ("triangles".to_string(), surface.cells.len() as f64),
        ("pieces".to_string(), pieces as f64),
    ]);
    let column = |value: fn(&Iterate) -> f64| rows.iter().map(value).collect::<Vec<f64>>();
    let traces: Traces = BTreeMap::from([
        ("iteration".to_string(), column(|row| row.iteration as f64)),
        ("energy".to_string(), column(|row| row.energy)),
        ("gradient_norm".to_string(), column(|row| row.gradient_norm)),
        ("step".to_string(), column(|row| row.step)),
    ]);
    let stop = match serde_json::to_value(solution.stop) {
        Ok(Value::String(word)) => word,
        _ => format!("{:?}", solution.stop).to_lowercase(),
    };
    Ok(Outcome {
        stop,
        reason: solution.reason,
        metrics,
        traces,
        counters: BTreeMap::from([
            ("iterations".to_string(), solution.counters.iterations),
            ("evaluations".to_string(), solution.counters.evaluations),
        ]),
        notices,
        mesh: Some(mesh),
        files: Default::default(),
    })
}
