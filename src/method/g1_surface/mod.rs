//! G1 surfaces: biquartic patches with common tangent planes over any mesh of quadrilaterals with normals.
//!
//! The stages: [`problem`] reads the model and cuts it open along its [`creases`], [`network`] spans natural cubics
//! over the edges, [`enclosure`] moves their tangents until surfaces of class C2 can meet at every vertex,
//! [`edge_normals`] finds a cubic normal along every curve, [`patch`] fits the patches, [`repair`] mends those that
//! fold, [`outcome`] measures them; [`construction`] runs them. Source: Xue, Demkowicz, Bajaj 2004, Reconstruction of
//! G1 surfaces with biquartic patches for hp finite element simulations.
//!
//! Guaranteed with the default settings, where a run ends `converged`: no patch folds at 9 by 9 points, and normals of
//! neighbouring patches agree along their whole edge to rounding, at vertices of every valence, except along creases.
//! A run in which a patch folds ends `folded` and names it; one whose normals disagree ends `stalled`. Always: patches
//! share their curves exactly, creases too; the same input gives the same bits with any number of threads; where the
//! surface lies and how large it is does not matter (see [`frame`]). Not guaranteed: that conditions can be met for
//! all data, that the surface is free of folds between the points, or does not meet itself.

pub mod balance;
pub mod construction;
pub mod continuity;
pub mod control_net;
pub mod creases;
pub mod edge_normals;
pub mod enclosure;
pub mod evaluation;
pub mod frame;
pub mod hermite;
pub mod hexahedra;
pub mod laplace_beltrami;
pub mod least_squares;
pub mod metrics;
pub mod model;
pub mod network;
pub mod numbering;
pub mod orientation;
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
        3
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
        let problem = Problem::new(&inputs.model, &settings, observer)?;
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
    let shape = outcome::measure(problem, &built.network.normals, &built.patches, &mut built.metrics);
    built.judge(problem, settings, &shape);
    built
        .metrics
        .insert("edge_length".to_string(), outcome::mean_edge(problem));
    if settings.order > 0 {
        observer.phase("simulate");
        simulate(problem, &built.patches, settings, &mut built.metrics)?;
    }
    let mut shell = None;
    if let Some(kind) = settings.shell() {
        observer.phase("hexahedra");
        let found = hexahedra::build(problem, &built.patches, kind, settings.layers as usize, observer)
            .map_err(Failure::invalid)?;
        found.tell(&mut built.metrics);
        shell = Some(found);
    }
    // From here on everything is in the coordinates of the file.
    let frame = &problem.frame;
    frame.leave_metrics(&mut built.metrics);
    if let Some(shell) = &mut shell {
        shell.leave(frame);
    }
    let angles = outcome::angles_to_neighbours(&problem.connectivity, &shape.continuity);
    let tessellate = || {
        let mut found = outcome::tessellate(
            &built.patches,
            &problem.connectivity,
            &problem.mesh.quads,
            &angles,
            outcome::pieces(settings, built.patches.len()),
            settings.stripes,
        )
        .map_err(Failure::invalid)?;
        found.leave(frame);
        Ok::<_, Failure>(found)
    };
    let nets = || control_net::of(&built.patches, frame);
    let mesh = match &shell {
        _ if settings.result == "control-points" => control_net::nets(&nets()),
        Some(shell) => {
            let pieces = outcome::pieces(settings, shell.cells.len()).min(6);
            let (mesh, connectivity) = problem.whole();
            hexahedra::tessellate(shell, &mesh.quads, connectivity, pieces).map_err(Failure::invalid)?
        }
        None => tessellate()?.vtu(),
    };
    let mut files = BTreeMap::new();
    if settings.exports("bezier") {
        files.insert("bezier.vtu".to_string(), control_net::bezier(&nets(), &angles));
        if let Some(shell) = &shell {
            files.insert("bezier-hexahedra.vtu".to_string(), shell.bezier());
        }
    }
    if settings.exports("obj") {
        files.insert(
            "tessellation.obj".to_string(),
            tessellate()?.obj().map_err(Failure::invalid)?,
        );
    }
    if settings.exports("control-points") {
        let text = control_net::text(&nets());
        files.insert("control-points.txt".to_string(), text.into_bytes());
    }
    Ok(Outcome {
        stop: built.stop,
        reason: built.reason,
        metrics: built.metrics,
        traces: BTreeMap::new(),
        counters: built.counters,
        notices: built.notices,
        mesh: Some(mesh),
        files,
    })
}

/// Solves the test problem on the patches.
fn simulate(
    problem: &Problem,
    patches: &[patch::Patch],
    settings: &Settings,
    metrics: &mut outcome::Metrics,
) -> Result<(), Failure> {
    let Some(Truth::Analytic(exact)) = &problem.truth else {
        return Err(Failure::invalid(
            "the test problem needs a surface given by one formula; use a generated mesh without creases, or order = 0",
        ));
    };
    let (quads, connectivity) = (&problem.mesh.quads, &problem.connectivity);
    let solved = laplace_beltrami::solve(patches, quads, connectivity, exact, settings.order as usize)
        .map_err(Failure::invalid)?;
    metrics.insert("l2_error".to_string(), solved.error);
    metrics.insert("gradient_error".to_string(), solved.gradient_error);
    metrics.insert("unknowns".to_string(), solved.unknowns as f64);
    Ok(())
}
