//! G1 surfaces: biquartic patches with common tangent planes over any mesh of quadrilaterals with normals.
//!
//! The stages: [`problem`] reads the model, [`network`] spans natural cubics over the edges, [`enclosure`] moves their
//! tangents until surfaces of class C2 can meet at every vertex, [`edge_normals`] finds a cubic normal along every curve,
//! [`patch`] fits the patches, [`outcome`] measures them. Source: Xue, Demkowicz, Bajaj 2004, Reconstruction of G1 surfaces
//! with biquartic patches for hp finite element simulations.
//!
//! Guaranteed with the default settings, where the enclosure condition could be met (a metric tells): normals of
//! neighbouring patches agree along their whole edge to rounding, at vertices of every valence; patches share their curves
//! exactly; the same input gives the same bits with any number of threads. Not guaranteed: that the surface is free of
//! folds or does not meet itself.

pub mod balance;
pub mod construction;
pub mod continuity;
pub mod creases;
pub mod edge_normals;
pub mod enclosure;
pub mod hermite;
pub mod hexahedra;
pub mod laplace_beltrami;
pub mod least_squares;
pub mod metrics;
pub mod model;
pub mod network;
pub mod outcome;
pub mod patch;
pub mod problem;
pub mod repair;
pub mod sampled;
pub mod settings;
pub mod surface;
pub mod vertex_normals;

use super::model::ModelKind;
use super::setting::Field;
use super::{Failure, Inputs, Method, Outcome};
use crate::metric::Metric;
use crate::optimize::Observer;
use construction::build;
use problem::{Problem, Truth};
use serde_json::Value;
use settings::Settings;
use std::collections::BTreeMap;

/// The method `g1-surface`.
pub struct G1Surface;

impl Method for G1Surface {
    fn name(&self) -> &'static str {
        "g1-surface"
    }

    fn version(&self) -> u32 {
        2
    }

    fn summary(&self) -> &'static str {
        "spans biquartic patches with common tangent planes over a quadrilateral mesh with normals"
    }

    fn source(&self) -> &'static str {
        "Reconstruction of G1 surfaces with biquartic patches for hp FE simulations, 13th International Meshing Roundtable, 2004"
    }

    fn model(&self) -> &'static ModelKind {
        model::kind()
    }

    fn settings(&self) -> &'static [Field] {
        settings::FIELDS
    }

    fn check(&self, settings: &Value) -> Vec<(String, String)> {
        settings::check(settings)
    }

    fn canonical(&self, settings: Value) -> Value {
        match Settings::resolve(&settings) {
            Ok(resolved) => resolved.canonical(),
            // Left as it is: running it will say what is wrong.
            Err(_) => settings,
        }
    }

    fn metrics(&self) -> &'static [Metric] {
        metrics::ALL
    }

    fn counters(&self) -> &'static [(&'static str, &'static str)] {
        COUNTERS
    }

    fn run(&self, inputs: Inputs<'_>, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let settings = Settings::resolve(inputs.settings)?;
        observer.phase("prepare");
        let problem = Problem::new(&inputs.model, &settings)?;
        run(&problem, &settings, observer)
    }
}

/// Names and meanings of the counters.
pub const COUNTERS: &[(&str, &str)] = &[
    (
        "iterations",
        "Newton steps on the tangents towards the enclosure condition",
    ),
    ("factorizations", "factorizations of their system"),
    (
        "repairs",
        "times that tangents were found anew around patches that fold",
    ),
];

/// Builds, measures and tessellates the surface of a problem.
pub fn run(problem: &Problem, settings: &Settings, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
    let mut built = build(problem, settings, observer)?;
    observer.phase("measure");
    let continuity = outcome::measure(problem, &built.network.normals, &built.patches, &mut built.metrics);
    built
        .metrics
        .insert("edge_length".to_string(), outcome::mean_edge(problem));
    let metrics = &mut built.metrics;
    if settings.order > 0 {
        observer.phase("simulate");
        let Some(Truth::Analytic(exact)) = &problem.truth else {
            return Err(problem::invalid(
                "the test problem needs a surface given by a formula; use a generated mesh, or order = 0".to_string(),
            ));
        };
        let (quads, connectivity) = (&problem.mesh.quads, &problem.connectivity);
        let solved = laplace_beltrami::solve(&built.patches, quads, connectivity, exact, settings.order as usize)
            .map_err(problem::invalid)?;
        metrics.insert("l2_error".to_string(), solved.error);
        metrics.insert("gradient_error".to_string(), solved.gradient_error);
        metrics.insert("unknowns".to_string(), solved.unknowns as f64);
    }
    let mut other = (settings.result == "control-points").then(|| outcome::control_nets(&built.patches));
    if let Some(shell) = settings.shell() {
        observer.phase("hexahedra");
        let found = hexahedra::build(problem, &built.patches, shell, settings.layers as usize, observer)
            .map_err(problem::invalid)?;
        for (name, value) in [
            ("hexahedra_count", found.cells.len() as f64),
            (
                "jacobian_min",
                found.scaled.iter().copied().fold(f64::INFINITY, f64::min),
            ),
            ("jacobian_certified", found.positive as f64),
            ("jacobian_not_positive", found.not_positive as f64),
            ("jacobian_undecided", found.undecided as f64),
            ("jacobian_bound", found.bound),
            ("hexahedra_volume", found.volume),
        ] {
            metrics.insert(name.to_string(), value);
        }
        let pieces = outcome::pieces(settings, found.cells.len()).min(6);
        other = other.or_else(|| Some(hexahedra::tessellate(&found, pieces)));
    }
    let mesh = other.unwrap_or_else(|| {
        outcome::tessellate(
            &built.patches,
            &problem.connectivity,
            &problem.mesh.quads,
            &continuity,
            outcome::pieces(settings, built.patches.len()),
            settings.stripes,
        )
    });
    Ok(Outcome {
        stop: built.stop,
        reason: built.reason,
        metrics: built.metrics,
        traces: BTreeMap::new(),
        counters: built.counters,
        notices: built.notices,
        mesh: Some(mesh),
        files: Default::default(),
    })
}
