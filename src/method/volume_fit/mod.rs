//! Polynomial volumes fitted to surfaces: hexahedra, prisms and tetrahedra of high order whose boundary flows onto a target
//! while a barrier keeps them valid.
//!
//! The stages: [`template`] and [`target`] read the model, [`objective`] puts the surface energy and the volume energy
//! together, L-BFGS minimizes stage by stage while the order rises, [`outcome`] measures. Source: Jin et al. 2013, Mapping
//! polynomial volumes; the surface terms: Nivoliers, Yan and Lévy 2012.
//!
//! Guaranteed: every accepted iterate has positive determinants at all quadrature points; within a stage the energy never
//! rises; the same input gives the same bits with any number of threads. Not guaranteed: that elements are valid between
//! the quadrature points, which the certificate in the outcome decides; that the boundary does not cut through itself.

pub mod adaptivity;
pub mod metrics;
pub mod model;
pub mod objective;
pub mod outcome;
pub mod preconditioner;
pub mod settings;
pub mod surface_energy;
pub mod target;
pub mod template;
pub mod untangle;

use super::model::ModelKind;
use super::setting::Field;
use super::{Failure, Inputs, Method, Outcome, Traces};
use crate::energy::mapping::Density;
use crate::fem::batches::{Batches, references_of_volume};
use crate::fem::boundary::Boundary;
use crate::fem::space::{Kind, Space};
use crate::fem::volume_energy::VolumeEnergy;
use crate::linalg::vector3::Columns;
use crate::mesh::mixed::{MixedMesh, Topology};
use crate::mesh::{self, bounding_box};
use crate::metric::Metric;
use crate::optimize::lbfgs::Lbfgs;
use crate::optimize::{Iterate, Observer, StopReason, Stopping};
use objective::{FitObjective, Parts};
use preconditioner::{Model, Preconditioner};
use serde_json::Value;
use settings::{Settings, Stage};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;
use surface_energy::{Scale, SurfaceEnergy};
use target::Target;

/// The method `volume-fit`.
pub struct VolumeFit;

impl Method for VolumeFit {
    fn name(&self) -> &'static str {
        "volume-fit"
    }

    fn version(&self) -> u32 {
        1
    }

    fn summary(&self) -> &'static str {
        "fits a volume of high-order hexahedra, prisms and tetrahedra to a surface, keeping every element valid"
    }

    fn source(&self) -> &'static str {
        "Mapping polynomial volumes, Computer Graphics Forum 32, 2013"
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

    fn metrics(&self) -> &'static [Metric] {
        metrics::ALL
    }

    fn traces(&self) -> &'static [(&'static str, &'static str)] {
        TRACES
    }

    fn counters(&self) -> &'static [(&'static str, &'static str)] {
        COUNTERS
    }

    fn run(&self, inputs: Inputs<'_>, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let settings = Settings::resolve(inputs.settings)?;
        observer.phase("prepare");
        let mut notices = Vec::new();
        let part = |role: &str| inputs.model.parts.get(role);
        let template_part = part("template")
            .ok_or_else(|| invalid("the model has no `template`; give it a file or a generator".to_string()))?;
        let (volume, target) = match part("target") {
            Some(part) => {
                let target = target::read(part)?;
                (template::read(template_part, Some(&target), &mut notices)?, target)
            }
            None => {
                let volume = template::read(template_part, None, &mut notices)?;
                let topology = volume.topology().map_err(invalid)?;
                let target = target::of_boundary(topology.boundary_triangles(&volume.points));
                (volume, target)
            }
        };
        let mut fit = Fit::new(volume, target, &settings, notices)?;
        fit.run(observer)
    }
}

/// Names and meanings of the counters.
const COUNTERS: &[(&str, &str)] = &[
    ("iterations", "accepted steps over all stages"),
    ("evaluations", "evaluations of energy and gradient"),
    ("factorizations", "factorizations of the preconditioner"),
];

/// Names and meanings of the traces.
const TRACES: &[(&str, &str)] = &[
    (
        "iteration",
        "accepted steps before this row, counted through all stages",
    ),
    ("stage", "number of the stage, from 0"),
    ("energy", "surface energy plus lambda times volume energy"),
    ("energy_surface", "the surface energy"),
    ("energy_volume", "the volume energy, without lambda"),
    ("gradient_norm", "Euclidean norm of the gradient"),
    ("step", "length factor of the step that led here"),
    ("min_determinant", "least determinant at a quadrature point"),
    ("order", "highest order of an element"),
    ("nodes", "number of nodes"),
];

fn invalid(reason: String) -> Failure {
    Failure {
        kind: "invalid-input".to_string(),
        reason,
    }
}

/// A fit under way, in units in which the target's box has the diagonal 1 and its middle the origin.
struct Fit<'a> {
    settings: &'a Settings,
    volume: MixedMesh,
    topology: Topology,
    target: Target,
    references: Vec<Columns<f64>>,
    reference_volume: f64,
    /// Edge of the references.
    size: f64,
    scale: Scale,
    /// The target's units: length of 1 here, and the middle.
    unit: f64,
    middle: [f64; 3],
    space: Space,
    x: Vec<f64>,
    notices: Vec<String>,
    rows: Vec<[f64; 10]>,
    counters: BTreeMap<String, u64>,
    last: Parts,
    lambda: f64,
    increases: usize,
    stages: usize,
    /// Quadrature points added a direction, after elements came out invalid between the points.
    extra_points: usize,
}

/// Share of the least determinant that a step must leave.
const LEAST_SHARE: f64 = 0.2;

/// Tells the world and remembers.
struct Recorder<'a> {
    observer: &'a mut dyn Observer,
    rows: &'a mut Vec<[f64; 10]>,
    latest: Rc<Cell<Parts>>,
    floor: Rc<Cell<f64>>,
    /// Accepted steps before this minimization, and whether its start is already recorded.
    before: u64,
    skip_start: bool,
    stage: usize,
    order: usize,
    nodes: usize,
    increases: &'a mut usize,
    previous: f64,
}

impl Observer for Recorder<'_> {
    fn phase(&mut self, name: &str) {
        self.observer.phase(name);
    }

    fn iterate(&mut self, iterate: &Iterate) {
        self.floor.set(LEAST_SHARE * self.latest.get().least_determinant);
        if iterate.iteration == 0 && self.skip_start {
            return;
        }
        let parts = self.latest.get();
        if iterate.energy > self.previous {
            *self.increases += 1;
        }
        self.previous = iterate.energy;
        let shown = Iterate {
            iteration: self.before + iterate.iteration,
            ..*iterate
        };
        self.rows.push([
            shown.iteration as f64,
            self.stage as f64,
            iterate.energy,
            parts.surface,
            parts.volume,
            iterate.gradient_norm,
            iterate.step,
            parts.least_determinant,
            self.order as f64,
            self.nodes as f64,
        ]);
        self.observer.iterate(&shown);
    }

    fn stop(&self) -> Option<StopReason> {
        self.observer.stop()
    }
}

impl<'a> Fit<'a> {
    fn new(
        mut volume: MixedMesh,
        mut target: Target,
        settings: &'a Settings,
        mut notices: Vec<String>,
    ) -> Result<Fit<'a>, Failure> {
        notices.append(&mut target.notices);
        let points = if target.surface.points.is_empty() {
            &target.sites
        } else {
            &target.surface.points
        };
        let [low, high] = bounding_box(points).ok_or_else(|| invalid("the target has no points".to_string()))?;
        let unit = mesh::diagonal(points);
        if !(unit > 0.0 && unit.is_finite()) {
            return Err(invalid(format!(
                "the target's box has the diagonal {unit}; it needs an extent"
            )));
        }
        let middle: [f64; 3] = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        let lists = [
            &mut target.surface.points,
            &mut target.clean.points,
            &mut target.sites,
            &mut volume.points,
        ];
        for list in lists {
            for point in list {
                *point = std::array::from_fn(|axis| (point[axis] - middle[axis]) / unit);
            }
        }
        target.place_sites();
        let topology = volume.topology().map_err(invalid)?;
        let template_surface = topology.boundary_triangles(&volume.points);
        let own_volume = volume.volume();
        if !(own_volume > 0.0) {
            return Err(invalid(format!(
                "the template has the volume {own_volume:e}; its elements are inside out or flat"
            )));
        }
        check_target(&target, &mut notices)?;
        let scale = Scale::of(&target, &template_surface, own_volume);
        let references = references_of_volume(volume.iter().map(|cell| cell.0), scale.volume);
        let unit_volume: f64 = volume
            .iter()
            .map(|(shape, _)| crate::fem::batches::reference_volume(shape, &crate::fem::batches::unit_reference(shape)))
            .sum();
        let first = settings.stages[0].order;
        let space = Space::new(&volume, &topology, settings.basis, &vec![first; volume.cells()]).map_err(invalid)?;
        let x = space.linear(&volume.points);
        Ok(Fit {
            settings,
            size: (scale.volume / unit_volume).cbrt(),
            reference_volume: scale.volume,
            volume,
            topology,
            target,
            references,
            scale,
            unit,
            middle,
            space,
            x,
            notices,
            rows: Vec::new(),
            counters: COUNTERS.iter().map(|(name, _)| (name.to_string(), 0)).collect(),
            last: Parts::default(),
            lambda: settings.stages[0].lambda,
            increases: 0,
            stages: 0,
            extra_points: 0,
        })
    }

    fn count(&mut self, name: &str, amount: u64) {
        *self.counters.entry(name.to_string()).or_default() += amount;
    }

    fn volume_energy(&self, space: &Space) -> Result<VolumeEnergy, Failure> {
        self.volume_energy_of(space, Density::new(self.settings.energy))
    }

    fn volume_energy_of(&self, space: &Space, density: Density) -> Result<VolumeEnergy, Failure> {
        let quadrature = |kind: Kind| {
            let points = self.settings.quadrature_points(kind.order) + self.extra_points;
            self.settings.rule.cell(kind.shape, points)
        };
        let batches = Batches::new(space, &self.references, &quadrature).map_err(invalid)?;
        VolumeEnergy::new(batches, density).map_err(invalid)
    }

    /// Intervals between samples along an edge of the boundary.
    fn intervals(&self, order: usize) -> usize {
        let induced = if order == 1 { 1 } else { 2 * order - 2 };
        self.settings.samples.unwrap_or_else(|| {
            let faces = self.topology.boundary().count().max(1);
            let sites = self.target.sites.len().max(self.target.surface.cells.len());
            let even = (0.5 * sites as f64 / faces as f64).sqrt().ceil() as usize;
            induced.max(even.clamp(2, 16))
        })
    }

    fn raise(&mut self, orders: &[usize]) -> Result<(), Failure> {
        if orders == self.space.orders {
            return Ok(());
        }
        let next = Space::new(&self.volume, &self.topology, self.settings.basis, orders).map_err(invalid)?;
        self.x = self.space.transfer(&self.x, &next);
        self.space = next;
        Ok(())
    }

    fn run(&mut self, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let start = self.volume_energy(&self.space)?;
        let evaluation = start.value(&self.x);
        let quality = outcome::quality(&self.space, &self.references, &self.x)?;
        let inverted_at_start = quality.least_determinant.iter().filter(|det| !(**det > 0.0)).count();
        drop(start);
        let mut stop = StopReason::Converged;
        let mut reason = String::new();
        if !evaluation.value.is_finite() && self.settings.untangle {
            if let Some(interrupted) = untangle::untangle(self, observer)? {
                return self.finish(
                    interrupted,
                    "stopped from outside while the template was untangled".to_string(),
                    inverted_at_start,
                    observer,
                );
            }
        } else if !evaluation.value.is_finite() {
            return Err(Failure {
                kind: "invalid-start".to_string(),
                reason: format!(
                    "{inverted_at_start} elements of the template are inverted or flat (least determinant {:.3e}), where the \
                     energy is infinite; repair the template, or change its recipe",
                    evaluation.least_determinant
                ),
            });
        }
        let stages = self.settings.stages.clone();
        for stage in stages {
            let orders: Vec<usize> = self.space.orders.iter().map(|&order| order.max(stage.order)).collect();
            self.raise(&orders)?;
            (stop, reason) = self.stage(&stage, observer)?;
            if interrupted(stop) {
                break;
            }
        }
        if let Some(adaptive) = self.settings.adaptive
            && !interrupted(stop)
        {
            for _ in 0..adaptive.steps {
                let Some(orders) = adaptivity::raised(self, &adaptive)? else {
                    break;
                };
                self.raise(&orders)?;
                let stage = Stage {
                    order: orders.iter().copied().max().unwrap_or(1),
                    ..self.settings.stages[self.settings.stages.len() - 1]
                };
                (stop, reason) = self.stage(&stage, observer)?;
                if interrupted(stop) {
                    break;
                }
            }
        }
        for _ in 0..self.settings.repairs {
            if interrupted(stop) {
                break;
            }
            observer.phase("certify");
            let certificates = outcome::certify(&self.space, &self.references, &self.x, observer);
            let failing = certificates
                .verdicts
                .iter()
                .filter(|verdict| **verdict == outcome::Judged::Fails)
                .count();
            if failing == 0 {
                break;
            }
            self.extra_points += 3;
            self.notices.push(format!(
                "{failing} elements were invalid between quadrature points; gone on with {} more a direction",
                self.extra_points
            ));
            if !self.volume_energy(&self.space)?.value(&self.x).value.is_finite()
                && let Some(interrupted) = untangle::untangle(self, observer)?
            {
                (stop, reason) = (interrupted, "stopped from outside during a repair".to_string());
                break;
            }
            let last = self.settings.stages[self.settings.stages.len() - 1];
            (stop, reason) = self.stage(&last, observer)?;
        }
        self.finish(stop, reason, inverted_at_start, observer)
    }

    /// Minimizes with the present orders.
    fn stage(&mut self, stage: &Stage, observer: &mut dyn Observer) -> Result<(StopReason, String), Failure> {
        observer.phase(&format!("stage {}", self.stages));
        let settings = self.settings;
        self.lambda = stage.lambda;
        let order = self.space.orders.iter().copied().max().unwrap_or(1);
        let volume = self.volume_energy(&self.space)?;
        if !volume.value(&self.x).value.is_finite()
            && settings.untangle
            && let Some(stop) = untangle::untangle(self, observer)?
        {
            // More points than in the stage before found an inversion.
            return Ok((stop, "stopped from outside while elements were untangled".to_string()));
        }
        let boundary = Boundary::new(&self.volume, &self.topology, &self.space, self.intervals(order));
        let mut samples = Vec::new();
        boundary.positions(&self.x, &mut samples);
        let mut surface = if settings.terms.to_target || settings.terms.from_target {
            let energy = SurfaceEnergy::new(
                &samples,
                &boundary.triangles,
                &self.target,
                settings.terms,
                settings.anisotropy,
                self.scale,
            );
            Some(energy.map_err(invalid)?)
        } else {
            None
        };
        let latest = Rc::new(Cell::new(Parts::default()));
        let floor = Rc::new(Cell::new(f64::NEG_INFINITY));
        let factor = surface.as_ref().map_or(0.0, SurfaceEnergy::factor);
        let mut done = 0;
        let mut previous = f64::INFINITY;
        // The energy when a round last ended for its small change.
        let mut settled = f64::INFINITY;
        let outcome = loop {
            let preconditioner = if settings.preconditioned {
                boundary.positions(&self.x, &mut samples);
                let model = Model {
                    mesh: &self.volume,
                    topology: &self.topology,
                    space: &self.space,
                    boundary: &boundary,
                    samples: &samples,
                    lambda: stage.lambda,
                    size: self.size,
                    volume: self.reference_volume,
                    surface: factor,
                    anisotropy: settings.anisotropy,
                };
                let made = Preconditioner::new(&model).map_err(invalid)?;
                self.count("factorizations", 1);
                Some(made)
            } else {
                None
            };
            let left = stage.iterations - done;
            let round = if settings.preconditioned {
                left.min(settings.refresh)
            } else {
                left
            };
            let mut objective = FitObjective {
                volume: &volume,
                boundary: &boundary,
                surface: surface.as_mut(),
                lambda: stage.lambda,
                preconditioner,
                latest: latest.clone(),
                floor: floor.clone(),
                samples: Vec::new(),
                forces: Vec::new(),
                room: Vec::new(),
            };
            let lbfgs = Lbfgs {
                stopping: Stopping {
                    gradient_norm: settings.gradient_tolerance,
                    relative_decrement: 0.0,
                    relative_change: settings.change_tolerance,
                    iterations: round,
                    ..Stopping::default()
                },
                memory: settings.memory,
                ..Lbfgs::default()
            };
            let mut recorder = Recorder {
                observer,
                latest: latest.clone(),
                floor: floor.clone(),
                before: self.counters["iterations"],
                skip_start: done > 0,
                stage: self.stages,
                order,
                nodes: self.space.nodes,
                rows: &mut self.rows,
                increases: &mut self.increases,
                previous,
            };
            let solution = lbfgs.minimize(&mut objective, std::mem::take(&mut self.x), &mut recorder);
            previous = solution.value;
            self.x = solution.x;
            done += solution.counters.iterations;
            self.count("iterations", solution.counters.iterations);
            self.count("evaluations", solution.counters.evaluations);
            // A step cut short by the barrier changes little as well: only when a fresh start finds nothing either has the
            // stage converged.
            let by_change =
                solution.stop == StopReason::Converged && solution.gradient_norm >= settings.gradient_tolerance;
            let again = by_change
                && solution.counters.iterations > 0
                && settled - solution.value > 5.0 * settings.change_tolerance * solution.value.abs();
            if again {
                settled = solution.value;
            }
            let more = (solution.stop == StopReason::StepLimit || again) && done < stage.iterations;
            if !more {
                // The parts at the accepted point, not at the last one tried.
                let mut gradient = vec![0.0; self.x.len()];
                use crate::optimize::Objective as _;
                objective.gradient(&self.x, &mut gradient);
                self.last = latest.get();
                let reason = if solution.stop == StopReason::StepLimit {
                    format!("{} iterations of a stage were not enough", stage.iterations)
                } else {
                    solution.reason
                };
                break (solution.stop, reason);
            }
        };
        self.stages += 1;
        Ok(outcome)
    }

    fn finish(
        &mut self,
        stop: StopReason,
        reason: String,
        inverted_at_start: usize,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, Failure> {
        observer.phase("measure");
        let quality = outcome::quality(&self.space, &self.references, &self.x)?;
        let mut metrics = BTreeMap::new();
        outcome::measure_boundary(
            &self.volume,
            &self.topology,
            &self.space,
            &self.x,
            &self.target,
            &mut metrics,
        )?;
        let cells = self.volume.cells();
        let flags: Vec<bool> = quality.least_determinant.iter().map(|det| !(*det > 0.0)).collect();
        let certificates = outcome::certify(&self.space, &self.references, &self.x, observer);
        let mut set = |name: &str, value: f64| {
            metrics.insert(name.to_string(), value);
        };
        let flags: Vec<bool> = flags
            .iter()
            .zip(&certificates.verdicts)
            .map(|(flag, verdict)| *flag || *verdict == outcome::Judged::Fails)
            .collect();
        set("scaled_jacobian_mean", mean(&quality.scaled_jacobian_mean));
        set("scaled_jacobian_min", least(&quality.scaled_jacobian_min));
        set("inverted", flags.iter().filter(|flag| **flag).count() as f64);
        set("min_determinant", least(&quality.least_determinant));
        set(
            "max_determinant",
            -least(&quality.largest_determinant.iter().map(|det| -det).collect::<Vec<_>>()),
        );
        set("determinant_spread", quality.spread);
        let judged = |wanted: outcome::Judged| {
            certificates
                .verdicts
                .iter()
                .filter(|verdict| **verdict == wanted)
                .count() as f64
        };
        set("certified", judged(outcome::Judged::Certified));
        set("undecided", judged(outcome::Judged::Undecided));
        set("certified_determinant", certificates.bound);
        let ever = self.rows.iter().map(|row| row[7]).fold(f64::INFINITY, f64::min);
        set("least_determinant_ever", if ever.is_finite() { ever } else { f64::NAN });
        set("energy_surface", self.last.surface);
        set("energy_volume", self.last.volume);
        set("energy", self.last.surface + self.lambda * self.last.volume);
        set("increases", self.increases as f64);
        set("nodes", self.space.nodes as f64);
        let highest = self.space.orders.iter().copied().max().unwrap_or(1);
        let most = self.settings.adaptive.map_or(highest, |adaptive| adaptive.most);
        let full =
            Space::new(&self.volume, &self.topology, self.settings.basis, &vec![most; cells]).map_err(invalid)?;
        set("node_share", 100.0 * self.space.nodes as f64 / full.nodes as f64);
        set(
            "order_mean",
            self.space.orders.iter().sum::<usize>() as f64 / cells as f64,
        );
        set("order_max", highest as f64);
        set("elements", cells as f64);
        set("hexahedra", self.volume.hexahedra.len() as f64);
        set("prisms", self.volume.prisms.len() as f64);
        set("tetrahedra", self.volume.tetrahedra.len() as f64);
        set("stages", self.stages as f64);
        set("inverted_at_start", inverted_at_start as f64);
        self.notices.extend(certificates.notices);
        let given: Vec<f64> = self
            .x
            .chunks_exact(3)
            .enumerate()
            .flat_map(|(node, values)| {
                let middle = if node < self.space.vertices {
                    self.middle
                } else {
                    [0.0; 3]
                };
                [0, 1, 2].map(|axis| values[axis] * self.unit + middle[axis])
            })
            .collect();
        let fields = [
            ("scaled_jacobian", quality.scaled_jacobian_mean.clone()),
            ("scaled_jacobian_min", quality.scaled_jacobian_min.clone()),
            ("order", self.space.orders.iter().map(|&order| order as f64).collect()),
            ("determinant_min", quality.least_determinant.clone()),
            (
                "inverted",
                flags.iter().map(|&flag| f64::from(u8::from(flag))).collect(),
            ),
            ("element", (0..cells).map(|cell| cell as f64).collect()),
        ];
        let picture = outcome::picture(&self.space, &self.references, &given, &self.volume, &fields)?;
        let traces: Traces = TRACES
            .iter()
            .enumerate()
            .map(|(column, (name, _))| (name.to_string(), self.rows.iter().map(|row| row[column]).collect()))
            .collect();
        let stop = serde_json::to_value(stop)
            .ok()
            .and_then(|word| word.as_str().map(str::to_owned))
            .unwrap_or_default();
        Ok(Outcome {
            stop,
            reason,
            metrics,
            traces,
            counters: std::mem::take(&mut self.counters),
            notices: std::mem::take(&mut self.notices),
            mesh: Some(picture),
            files: Default::default(),
        })
    }
}

fn interrupted(stop: StopReason) -> bool {
    matches!(
        stop,
        StopReason::TimeLimit | StopReason::Cancelled | StopReason::NotFinite
    )
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Names what is wrong with a target surface; an inside-out one is turned, an open or damaged one only mentioned.
fn check_target(target: &Target, notices: &mut Vec<String>) -> Result<(), Failure> {
    if target.surface.cells.is_empty() {
        notices.push(format!(
            "the target is a cloud of {} points without normals",
            target.sites.len()
        ));
        return Ok(());
    }
    if target.sites.is_empty() {
        return Err(invalid("every triangle of the target has no area".to_string()));
    }
    let mut sides = BTreeMap::<[u32; 2], [usize; 2]>::new();
    for cell in &target.surface.cells {
        for place in 0..3 {
            let (a, b) = (cell[place], cell[(place + 1) % 3]);
            sides.entry([a.min(b), a.max(b)]).or_default()[usize::from(a > b)] += 1;
        }
    }
    let open = sides.values().filter(|count| count[0] + count[1] == 1).count();
    if open > 0 {
        notices.push(format!(
            "the target is open or a soup: {open} of its {} edges have one triangle; volume and length scale are the \
             template's where its own make no sense",
            sides.len()
        ));
    } else if target.surface.enclosed_volume() < 0.0 {
        notices.push("the target is inside out; distances do not depend on it".to_string());
    }
    Ok(())
}
