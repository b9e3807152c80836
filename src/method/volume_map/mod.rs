//! Volumetric maps: a tetrahedral mesh onto a domain whose boundary is prescribed, with little distortion.
//!
//! The stages: [`problem`] reads the model and splits what would force inversions, [`feasibility`] names what else the
//! boundary forbids, [`start`] places the vertices, [`untangle`] turns inverted tetrahedra, one of four solvers minimizes
//! the distortion, [`outcome`] measures the map. Source of the energies and of the relaxation-enhanced solver: Jin,
//! Huang, Tong 2015, Stretch-minimizing volumetric parameterization.
//!
//! Guaranteed: a map that is reported as converged under a barrier has no inverted tetrahedron; the same input gives the
//! same bits with any number of threads. Not guaranteed: that a map without inversions exists or is found; then the
//! outcome says which tetrahedra stay inverted.

pub mod feasibility;
pub mod fields;
pub mod harmonic;
pub mod l_bfgs;
pub mod locally_injective;
pub mod metrics;
pub mod model;
pub mod objective;
pub mod outcome;
pub mod problem;
pub mod projected_newton;
pub mod relaxed_newton;
pub mod settings;
pub mod similarity;
pub mod start;
pub mod trace;
pub mod untangle;

use super::model::ModelKind;
use super::setting::Field;
use super::{Failure, Inputs, Method, Outcome};
use crate::energy::Energy;
use crate::energy::lim_barrier::LimBarrier;
use crate::energy::mapping::{Density, MappingEnergy};
use crate::energy::mips::Mips;
use crate::energy::target_weighted::TargetWeighted;
use crate::metric::Metric;
use crate::optimize::{NewtonObjective, Observer, StopReason};
use objective::MapObjective;
use problem::Problem;
use serde_json::Value;
use settings::{Hessian, OnInfeasible, Settings, Solver, Weighting};
use std::collections::BTreeMap;
use trace::Trace;

/// The method `volume-map`.
pub struct VolumeMap;

impl Method for VolumeMap {
    fn name(&self) -> &'static str {
        "volume-map"
    }

    fn version(&self) -> u32 {
        5
    }

    fn summary(&self) -> &'static str {
        "maps a tetrahedral mesh onto a domain with prescribed boundary, minimizing a distortion energy"
    }

    fn source(&self) -> &'static str {
        "Stretch-minimizing volumetric parameterization, Journal of Computer Science and Technology 30(3), 2015"
    }

    fn model(&self) -> &'static ModelKind {
        model::kind()
    }

    fn settings(&self) -> &'static [Field] {
        fields::FIELDS
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

    fn incomparable(&self, metric: &str) -> &'static [&'static str] {
        match metric {
            "energy" => &["energy", "weighting", "rescale", "model"],
            "energy_integral" => &["energy", "rescale", "model"],
            _ => &[],
        }
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
        let problem = Problem::new(&inputs.model, &settings)?;
        run(&problem, &settings, observer)
    }
}

/// Energies of a start beyond this say nothing but that a tetrahedron is almost flat.
const LARGEST_START: f64 = 1e50;

/// Computes the map of a problem.
pub fn run(problem: &Problem, settings: &Settings, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
    let mut notices = problem.notices.clone();
    let mut counters = Counters::default();
    let density = density(problem, settings)?;
    let needs_positive = density.is_barrier();

    let sentences = problem.obstacles.sentences();
    if problem.obstacles.forbid() {
        let bound = problem.obstacles.lower_bound;
        let tetrahedra = if bound == 1 { "tetrahedron" } else { "tetrahedra" };
        // Soft constraints may leave the boundary off its target, so nothing is impossible.
        let refuses = settings.on_infeasible == OnInfeasible::Refuse && settings.solver.hard_constraints();
        if needs_positive && refuses {
            return Err(Failure {
                kind: "infeasible".to_string(),
                reason: format!(
                    "the boundary forces at least {bound} inverted {tetrahedra} (vertices and tetrahedra counted from 0): {}; \
                     mend the target{}, or set on_infeasible = \"continue\"",
                    sentences.join("; "),
                    if settings.split == settings::Split::None {
                        ", allow splits with split = \"needed\""
                    } else {
                        ""
                    }
                ),
            });
        }
        notices.push(format!(
            "the boundary forces at least {bound} inverted {tetrahedra}: {}",
            sentences.join("; ")
        ));
    } else {
        notices.extend(sentences);
    }

    observer.phase("start");
    let mut positions = start::positions(problem, settings)?;
    let mapping = MappingEnergy::new(&problem.source, &problem.weights(settings.weighting), density, None)
        .map_err(|error| Failure::invalid(format!("source mesh: {error}")))?;
    let mut determinants = vec![0.0; mapping.cells()];
    mapping.determinants(positions.as_flattened(), &mut determinants);
    let folded = determinants.iter().filter(|&&determinant| !(determinant > 0.0)).count();
    counters.set("start_inverted", folded as u64);

    let mut trace = Trace::default();
    if needs_positive && folded > 0 {
        if !settings.untangle {
            return Err(Failure {
                kind: "invalid-start".to_string(),
                reason: format!(
                    "{folded} tetrahedra of the start are inverted or flat, where the energy is infinite; set \
                     untangle = true, choose start = \"similarity\" with soft constraints, or barrier = \"none\" with an \
                     energy that allows inversions"
                ),
            });
        }
        observer.phase("untangle");
        let untangled = untangle::untangle(problem, &positions, &settings.untangling, observer)?;
        positions = untangled.positions;
        counters.set("untangling_steps", untangled.steps);
        counters.set("untangling_iterations", untangled.counters.iterations);
        counters.add("factorizations", untangled.counters.factorizations);
        counters.add("evaluations", untangled.counters.evaluations);
        if !untangled.left.is_empty() {
            let (stop, why) = match untangled.interrupted {
                Some(stop) => (stop, "stopped from outside during untangling"),
                None => (StopReason::Stalled, "untangling came to its end"),
            };
            let shown: Vec<String> = untangled.left.iter().take(10).map(|cell| cell.to_string()).collect();
            let reason = format!(
                "{why} with {} tetrahedra inverted or flat, the first are {} (counted from 0); nothing was minimized: the \
                 map is the untangled one",
                untangled.left.len(),
                shown.join(", ")
            );
            return finish(
                problem,
                settings,
                &positions,
                (stop, reason),
                trace,
                counters,
                notices,
                observer,
            );
        }
    }

    // The negation catches not-a-number too.
    if needs_positive && !(mapping.value(positions.as_flattened()) < LARGEST_START) {
        // Densities that grow exponentially overflow on badly shaped tetrahedra, of which a valid start may have some,
        // and long before that their derivatives are of no use.
        observer.phase("approach");
        let approach = Density::new(&Mips);
        let mapping = MappingEnergy::new(&problem.source, &problem.volume_weights(), approach, None)
            .map_err(|error| Failure::invalid(format!("source mesh: {error}")))?;
        let free: Vec<bool> = problem.boundary.mask.iter().map(|&on_boundary| !on_boundary).collect();
        let vertices = &problem.boundary.vertices;
        let mut objective =
            MapObjective::new(mapping, &problem.source, &free, vertices, &positions, Hessian::OnDemand)?;
        let solution =
            projected_newton::minimize(&mut objective, settings, &positions, observer, &mut Trace::default());
        positions = objective.positions(&solution.x);
        counters.set("approach_iterations", solution.counters.iterations);
        counters.add("factorizations", solution.counters.factorizations);
        counters.add("evaluations", solution.counters.evaluations);
        if matches!(solution.stop, StopReason::TimeLimit | StopReason::Cancelled) {
            let end = (solution.stop, "stopped from outside during the approach".to_string());
            return finish(problem, settings, &positions, end, trace, counters, notices, observer);
        }
        notices.push(format!(
            "the energy of the start is beyond all measure, so \"{}\" was minimized first, in {} iterations",
            Mips.name(),
            solution.counters.iterations
        ));
    }

    observer.phase("minimize");
    let hard = settings.solver.hard_constraints();
    let free: Vec<bool> = problem
        .boundary
        .mask
        .iter()
        .map(|&on_boundary| !(hard && on_boundary))
        .collect();
    let hessian = match settings.solver {
        Solver::ProjectedNewton => settings.projected_newton.hessian,
        Solver::RelaxedNewton => settings.relaxed_newton.hessian,
        Solver::LocallyInjective | Solver::LBfgs => Hessian::Projected,
    };
    let mut objective = MapObjective::new(
        mapping,
        &problem.source,
        &free,
        &problem.boundary.vertices,
        &positions,
        hessian,
    )?;
    let end = match settings.solver {
        Solver::ProjectedNewton | Solver::LBfgs => {
            let solution = if settings.solver == Solver::LBfgs {
                l_bfgs::minimize(&mut objective, settings, &positions, observer, &mut trace)
            } else {
                projected_newton::minimize(&mut objective, settings, &positions, observer, &mut trace)
            };
            positions = objective.positions(&solution.x);
            counters.set("iterations", solution.counters.iterations);
            counters.add("evaluations", solution.counters.evaluations);
            (solution.stop, solution.reason)
        }
        Solver::RelaxedNewton => {
            let relaxed = relaxed_newton::minimize(&mut objective, problem, settings, &positions, observer, &mut trace);
            positions = relaxed.positions;
            counters.set("iterations", relaxed.iterations);
            counters.set("relaxations", relaxed.relaxations);
            counters.set("relaxation_iterations", relaxed.relaxation_iterations);
            counters.set("weights", relaxed.weights.len() as u64);
            counters.add("evaluations", relaxed.evaluations);
            (relaxed.stop, relaxed.reason)
        }
        Solver::LocallyInjective => {
            let map = locally_injective::minimize(&mut objective, problem, settings, &positions, observer, &mut trace);
            positions = map.positions;
            counters.set("iterations", map.iterations);
            counters.set("shifts", map.shifts);
            counters.add("evaluations", map.evaluations);
            (map.stop, map.reason)
        }
    };
    counters.add("factorizations", objective.factorizations());
    finish(problem, settings, &positions, end, trace, counters, notices, observer)
}

/// The density that is minimized, with its barrier.
fn density(problem: &Problem, settings: &Settings) -> Result<Density, Failure> {
    let density = match settings.weighting {
        Weighting::Target => Density::of(TargetWeighted(settings.density()?)),
        Weighting::Volume | Weighting::Uniform => Density::new(settings.density()?),
    };
    if !settings.with_barrier() {
        return Ok(density);
    }
    let width = settings
        .barrier_width
        .as_f64()
        .unwrap_or_else(|| problem.mean_determinant());
    Ok(density.with_barrier(settings.barrier_weight, LimBarrier::new(width)))
}

/// Measures the map and puts the outcome together.
#[allow(clippy::too_many_arguments)]
fn finish(
    problem: &Problem,
    settings: &Settings,
    positions: &[[f64; 3]],
    (stop, reason): (StopReason, String),
    trace: Trace,
    counters: Counters,
    notices: Vec<String>,
    observer: &mut dyn Observer,
) -> Result<Outcome, Failure> {
    observer.phase("measure");
    let measured = outcome::measure(problem, settings, positions)?;
    let stop = match serde_json::to_value(stop) {
        Ok(Value::String(word)) => word,
        _ => format!("{stop:?}").to_lowercase(),
    };
    Ok(Outcome {
        stop,
        reason,
        metrics: measured.metrics,
        traces: trace.columns(),
        counters: counters.0,
        notices,
        mesh: Some(measured.mesh),
        files: Default::default(),
    })
}

/// Names and meanings of the counters.
pub const COUNTERS: &[(&str, &str)] = &[
    (
        "iterations",
        "accepted steps of the minimization; untangling is counted apart",
    ),
    ("factorizations", "factorizations of a Hessian, untangling included"),
    (
        "evaluations",
        "evaluations of the energy with or without derivatives, untangling included",
    ),
    ("start_inverted", "tetrahedra of the start that were inverted or flat"),
    (
        "untangling_steps",
        "values of the regularization that the untangling went through",
    ),
    ("untangling_iterations", "Newton iterations of the untangling"),
    (
        "approach_iterations",
        "Newton iterations on another energy, where the chosen one overflows on the start",
    ),
    ("relaxations", "relaxations of the relaxed-newton solver"),
    (
        "relaxation_iterations",
        "accepted steps within these relaxations, counted apart from the iterations",
    ),
    (
        "weights",
        "weights that the relaxed-newton solver minimized with, one after the other",
    ),
    (
        "shifts",
        "iterations of the locally-injective solver in which the Hessian was shifted",
    ),
];

/// Counters by name, each at 0 from the start.
struct Counters(BTreeMap<String, u64>);

impl Default for Counters {
    fn default() -> Counters {
        Counters(COUNTERS.iter().map(|(name, _)| (name.to_string(), 0)).collect())
    }
}

impl Counters {
    fn set(&mut self, name: &str, value: u64) {
        self.0.insert(name.to_string(), value);
    }

    fn add(&mut self, name: &str, value: u64) {
        *self.0.entry(name.to_string()).or_default() += value;
    }
}
