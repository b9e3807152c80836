//! Surface fitting by Voronoi squared distance minimization: a mesh, or the control mesh of a Catmull-Clark surface, onto
//! a target of triangles that need not hang together, or of points alone. Source: Nivoliers, Yan, Lévy 2012, Fitting
//! polynomial surfaces to triangular meshes with Voronoi squared distance minimization.
//!
//! The stages: [`problem`] reads the model and scales it, [`sampling`] samples the target, [`objective`] is minimized by
//! L-BFGS through a schedule of anisotropy and regularization, [`outcome`] measures the fit.
//!
//! Guaranteed: the energy of a stage never increases; the same input gives the same bits with any number of threads; a
//! template of the wrong kind still ends with a verdict. Not guaranteed: that the fit reaches the target everywhere, for
//! the connectivity of the template stays and minima are local.

pub mod cloud;
pub mod metrics;
pub mod model;
pub mod objective;
pub mod outcome;
pub mod preconditioner;
pub mod problem;
pub mod sampling;
pub mod settings;
pub mod trace;
pub mod voxels;

use super::model::ModelKind;
use super::setting::Field;
use super::{Failure, Inputs, Method, Outcome};
use crate::mesh::catmull_clark::{limit, subdivide};
use crate::mesh::format::{self, Content, Format};
use crate::mesh::linear_map::LinearMap;
use crate::mesh::surface::Surface;
use crate::metric::Metric;
use crate::optimize::lbfgs::Lbfgs;
use crate::optimize::{Counters, Objective, Observer, StopReason, Stopping};
use objective::FitObjective;
use problem::Problem;
use serde_json::Value;
use settings::{Settings, Stage};
use std::collections::{BTreeMap, VecDeque};
use trace::{Recorder, Trace};

/// The method `surface-fit`.
pub struct SurfaceFit;

impl Method for SurfaceFit {
    fn name(&self) -> &'static str {
        "surface-fit"
    }

    fn version(&self) -> u32 {
        8
    }

    fn summary(&self) -> &'static str {
        "fits a mesh or a Catmull-Clark control mesh to a triangle surface or a cloud of points, minimizing Voronoi squared distances"
    }

    fn source(&self) -> &'static str {
        "Fitting polynomial surfaces to triangular meshes with Voronoi squared distance minimization, Engineering with \
         Computers, 2012"
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
        metrics::all()
    }

    fn headline(&self) -> &'static [&'static str] {
        &[
            "hausdorff",
            "distance_rms",
            "scaled_jacobian_min",
            "folded_faces",
            "control_vertices",
        ]
    }

    fn traces(&self) -> &'static [(&'static str, &'static str)] {
        trace::COLUMNS
    }

    fn counters(&self) -> &'static [(&'static str, &'static str)] {
        COUNTERS
    }

    fn run(&self, inputs: Inputs<'_>, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let settings = Settings::resolve(inputs.settings)?;
        observer.phase("prepare");
        let problem = Problem::new(&inputs.model)?;
        run(&problem, &settings, observer)
    }
}

/// Names and meanings of the counters.
pub const COUNTERS: &[(&str, &str)] = &[
    ("iterations", "accepted steps of all stages"),
    (
        "evaluations",
        "evaluations of the energy with its gradient, of all stages",
    ),
    ("stages", "minimizations, one after the other"),
];

/// The fitted mesh of a control mesh and the map to its points.
pub fn fitted_mesh(control: &Surface, creases: &[[u32; 2]], settings: &Settings) -> (Surface, LinearMap) {
    let subdivided = subdivide(control, creases, settings.subdivisions);
    let map = if settings.limit && settings.subdivisions > 0 {
        limit(&subdivided.surface, &subdivided.creases).after(&subdivided.map)
    } else {
        subdivided.map
    };
    let mut fitted = subdivided.surface;
    map.apply(&control.points, &mut fitted.points);
    (fitted, map)
}

/// Most stages that unfold,
const UNFOLDINGS: i32 = 2;
/// and the factor by which each counts folded corners more than the one before.
const MORE: f64 = 10.0;

/// Most faces of a fitted mesh.
const MOST_FACES: f64 = 2e7;

/// Refuses what would have more faces than memory.
fn check_size(template: &Surface, settings: &Settings) -> Result<(), Failure> {
    let levels = settings.subdivisions + settings.refinements;
    // A face with k corners becomes k quadrilaterals, each of them four.
    let corners = (4 * template.quads.len() + 3 * template.triangles.len()) as f64;
    let faces = if levels == 0 {
        template.faces() as f64
    } else {
        corners * 4f64.powi(levels as i32 - 1)
    };
    if faces > MOST_FACES {
        return Err(Failure::invalid(format!(
            "a template of {} faces, subdivided {levels} times (subdivisions and refinements), has {faces:.1e} faces; \
                 {MOST_FACES:e} are the limit: take a coarser template or fewer levels",
            template.faces()
        )));
    }
    Ok(())
}

/// Fits the template of a problem to its target.
pub fn run(problem: &Problem, settings: &Settings, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
    let mut notices = problem.notices.clone();
    check_size(&problem.template, settings)?;
    let mut control = problem.template.clone();
    let mut creases = control.creases(settings.crease_angle);
    let stages = if settings.approach.is_near(problem.near) {
        settings.stages_from_near()
    } else {
        settings.stages()
    };
    if stages != settings.stages() {
        notices.push(format!(
            "the template starts near the target: all stages have the last one's regularization, {}, at most",
            stages[stages.len() - 1].regularization
        ));
    }
    let mut trace = Trace::default();
    let mut counters = Counters::default();
    let mut minimizations = 0;
    let (mut stop, mut reason) = (StopReason::Converged, String::new());

    observer.phase("sample");
    let (mut fitted, mut map) = fitted_mesh(&control, &creases, settings);
    let take_samples = |vertices: usize, observer: &mut dyn Observer| match &problem.cloud {
        Some(points) => Ok(sampling::of_cloud(points)),
        None => sampling::sample(&problem.target, vertices, settings, observer),
    };
    let mut samples = take_samples(fitted.points.len(), observer)?;
    let mut parts = objective::Parts::default();
    let mut reached = stages[0];
    let mut unfoldings = 0;
    let mut total = (stages.len() + settings.refinements) as u64;
    'rounds: for round in 0..=settings.refinements {
        if round > 0 {
            observer.phase("refine");
            let finer = subdivide(&control, &creases, 1);
            (control, creases) = (finer.surface, finer.creases);
            (fitted, map) = fitted_mesh(&control, &creases, settings);
            samples = take_samples(fitted.points.len(), observer)?;
        }
        observer.phase("minimize");
        let first = if round == 0 { 0 } else { stages.len() - 1 };
        let target = match problem.cloud {
            Some(_) => objective::Target::Cloud,
            None => objective::Target::Surface(&problem.target),
        };
        let mut objective = FitObjective::new(
            target,
            &samples,
            &fitted,
            &map,
            &control.points,
            settings,
            stages[first],
        )?;
        let mut x = control.points.as_flattened().to_vec();
        let mut left: VecDeque<Stage> = stages[first..].iter().copied().collect();
        while let Some(stage) = left.pop_front() {
            reached = stage;
            objective.set_stage(stage);
            let lbfgs = Lbfgs {
                stopping: Stopping {
                    gradient_norm: settings.gradient_tolerance,
                    relative_decrement: 0.0,
                    relative_change: stage.change_tolerance,
                    iterations: settings.iteration_limit,
                    ..Stopping::default()
                },
                memory: settings.memory,
                ..Lbfgs::default()
            };
            let mut recorder = Recorder {
                latest: objective.latest(),
                stage: minimizations,
                before: counters.iterations,
                observer,
                trace: &mut trace,
            };
            let solution = lbfgs.minimize(&mut objective, x, &mut recorder);
            x = solution.x;
            counters += solution.counters;
            minimizations += 1;
            (stop, reason) = (solution.stop, solution.reason);
            let has_ended = matches!(
                stop,
                StopReason::TimeLimit | StopReason::Cancelled | StopReason::NotFinite
            );
            let is_last = !has_ended && left.is_empty() && round == settings.refinements;
            if is_last && settings.unfolding > 0.0 && unfoldings < UNFOLDINGS {
                map.apply(x.as_chunks().0, &mut fitted.points);
                if fitted.scaled_jacobians().iter().any(|&jacobian| !(jacobian > 0.0)) {
                    left.push_back(Stage {
                        unfolding: settings.unfolding * MORE.powi(unfoldings),
                        ..stage
                    });
                    unfoldings += 1;
                    total += 1;
                }
            }
            if total > 1 {
                reason = format!("stage {minimizations} of {total}: {reason}");
            }
            if stop == StopReason::StepLimit && minimizations < total {
                notices.push(format!(
                    "stage {} of {total} ended at its limit of {} iterations",
                    minimizations, settings.iteration_limit
                ));
            }
            if has_ended {
                break;
            }
        }
        objective.value(&x);
        parts = objective.latest().get();
        if let Some(reason) = objective.without_preconditioner() {
            notices.push(format!("minimized without the preconditioner: {reason}"));
        }
        let (points, _) = x.as_chunks();
        control.points = points.to_vec();
        map.apply(&control.points, &mut fitted.points);
        if matches!(
            stop,
            StopReason::TimeLimit | StopReason::Cancelled | StopReason::NotFinite
        ) {
            break 'rounds;
        }
    }

    observer.phase("measure");
    let measured = outcome::measure(problem, settings, &samples, &fitted, parts, reached, &|| {
        observer.stop().is_some()
    })?;
    notices.extend(measured.notices);
    let mut metrics = measured.metrics;
    metrics.insert("control_vertices".to_string(), control.points.len() as f64);
    let mut files = BTreeMap::new();
    let exports = |name: &str| settings.export.iter().any(|export| export == name);
    if exports("obj") {
        files.insert("fit.obj".to_string(), obj(problem, &fitted)?);
    }
    if exports("control") && settings.subdivisions > 0 {
        files.insert("control.obj".to_string(), obj(problem, &control)?);
    }
    let stop = match serde_json::to_value(stop) {
        Ok(Value::String(word)) => word,
        _ => format!("{stop:?}").to_lowercase(),
    };
    Ok(Outcome {
        stop,
        reason,
        metrics,
        traces: trace.columns(),
        counters: [
            ("iterations", counters.iterations),
            ("evaluations", counters.evaluations),
            ("stages", minimizations),
        ]
        .map(|(name, value)| (name.to_string(), value))
        .into(),
        notices,
        mesh: Some(measured.mesh),
        files,
    })
}

/// A surface as an OBJ file in the units of the target's file.
fn obj(problem: &Problem, surface: &Surface) -> Result<Vec<u8>, Failure> {
    let content = Content {
        points: problem.to_given_units(&surface.points),
        triangles: surface.triangles.clone(),
        quads: surface.quads.clone(),
        ..Content::default()
    };
    let written = format::write(Format::Obj, &content).map_err(Failure::invalid)?;
    Ok(written.bytes)
}
