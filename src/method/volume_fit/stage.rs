//! One stage of a fit: L-BFGS with fixed orders and a fixed weight of the volume energy.

use super::chart::Chart;
use super::fit::Fit;
use super::objective::{FitObjective, Parts};
use super::preconditioner::{Model, Preconditioner};
use super::settings::Stage;
use super::untangle::TANGLED;
use crate::method::Failure;
use crate::optimize::lbfgs::Lbfgs;
use crate::optimize::{Iterate, Observer, StopReason, Stopping};
use std::cell::Cell;
use std::rc::Rc;

/// Share of the least determinant that a step must leave.
const LEAST_SHARE: f64 = 0.2;

/// A preconditioner is made anew after so many steps in a row that are shorter than this: the barrier then bends the
/// energy otherwise than the model does.
const SHORT_STEPS: u32 = 6;
const SHORT: f64 = 0.1;

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
    preconditioned: bool,
    short: u32,
}

impl Observer for Recorder<'_> {
    fn phase(&mut self, name: &str) {
        self.observer.phase(name);
    }

    fn iterate(&mut self, iterate: &Iterate) {
        self.floor.set(LEAST_SHARE * self.latest.get().least_determinant);
        self.short = if iterate.iteration > 0 && iterate.step < SHORT {
            self.short + 1
        } else {
            0
        };
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
        let stale = self.preconditioned && self.short >= SHORT_STEPS;
        // As at the end of a round: the stage goes on with the next.
        self.observer.stop().or_else(|| stale.then_some(StopReason::StepLimit))
    }
}

impl Fit<'_> {
    /// Minimizes with the present orders, over the nodes.
    pub(super) fn stage(
        &mut self,
        stage: &Stage,
        observer: &mut dyn Observer,
    ) -> Result<(StopReason, String), Failure> {
        self.stage_over(stage, None, observer)
    }

    /// Minimizes with the present orders, over the nodes or over unknowns that stand for them.
    pub(super) fn stage_over(
        &mut self,
        stage: &Stage,
        mut chart: Option<(&Chart, &mut Vec<f64>)>,
        observer: &mut dyn Observer,
    ) -> Result<(StopReason, String), Failure> {
        let settings = self.settings;
        self.lambda = stage.lambda;
        let order = self.space.highest_order();
        let volume = self.volume_energy(&self.space)?;
        if chart.is_some() {
            // Nodes are turned one by one, and what stands for many of them is not.
            let inverted = volume.inverted(&self.x).len();
            if inverted > 0 {
                return Err(Failure {
                    kind: TANGLED.to_string(),
                    reason: format!(
                        "{inverted} elements are inverted at the start of stage {}, whose nodes follow control points or \
                         layers and cannot be turned one by one; repair the template, or use more elements",
                        self.stages
                    ),
                });
            }
        } else if settings.untangle
            && let Some(stop) = self.mend(&volume, observer)?
        {
            return Ok((stop, "stopped from outside while elements were untangled".to_string()));
        }
        observer.phase(&format!("stage {}", self.stages));
        let boundary = self.boundary(&self.space);
        let mut samples = Vec::new();
        boundary.positions(&self.x, &mut samples);
        let mut surface = self.surface_energy(&boundary, &samples)?;
        let latest: Rc<Cell<Parts>> = Rc::default();
        let floor = Rc::new(Cell::new(f64::NEG_INFINITY));
        let mut done = 0;
        let mut previous = f64::INFINITY;
        // The energy when a round last ended for its small change.
        let mut settled = f64::INFINITY;
        // The model of the Hessian is one of nodes.
        let preconditioned = settings.preconditioned && chart.is_none();
        let outcome = loop {
            let preconditioner = if preconditioned {
                boundary.positions(&self.x, &mut samples);
                let model = Model {
                    mesh: &self.volume,
                    topology: &self.topology,
                    space: &self.space,
                    boundary: &boundary,
                    samples: &samples,
                    lambda: stage.lambda,
                    x: &self.x,
                    references: &self.references,
                    volume: self.reference_volume,
                    surface: self.surface_factor(),
                    anisotropy: settings.anisotropy,
                };
                let made = Preconditioner::new(&model).map_err(Failure::invalid)?;
                self.count("factorizations", 1);
                Some(made)
            } else {
                None
            };
            let left = stage.iterations - done;
            let round = if preconditioned {
                left.min(settings.refresh)
            } else {
                left
            };
            let mut objective = FitObjective {
                preconditioner,
                latest: latest.clone(),
                floor: floor.clone(),
                chart: chart.as_ref().map(|chart| chart.0),
                ..FitObjective::new(&volume, &boundary, surface.as_mut(), stage.lambda)
            };
            let lbfgs = Lbfgs {
                stopping: Stopping {
                    gradient_norm: settings.gradient_tolerance,
                    relative_decrement: 0.0,
                    relative_change: stage.tolerance,
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
                preconditioned,
                short: 0,
            };
            let start = match &mut chart {
                Some((_, unknowns)) => std::mem::take(*unknowns),
                None => std::mem::take(&mut self.x),
            };
            let solution = lbfgs.minimize(&mut objective, start, &mut recorder);
            previous = solution.value;
            match &mut chart {
                Some((chart, unknowns)) => {
                    chart.expand(&solution.x, &mut self.x);
                    **unknowns = solution.x;
                }
                None => self.x = solution.x,
            }
            done += solution.counters.iterations;
            self.count("iterations", solution.counters.iterations);
            self.count("evaluations", solution.counters.evaluations);
            // A step cut short by the barrier changes little as well: only when a fresh start finds nothing either has
            // the stage converged.
            let by_change =
                solution.stop == StopReason::Converged && solution.gradient_norm >= settings.gradient_tolerance;
            let again = by_change
                && solution.counters.iterations > 0
                && settled - solution.value > 5.0 * stage.tolerance * solution.value.abs();
            if again {
                settled = solution.value;
            }
            let more = (solution.stop == StopReason::StepLimit || again) && done < stage.iterations;
            if !more {
                // The parts at the accepted point, not at the last one tried.
                let mut gradient = vec![0.0; self.x.len()];
                use crate::optimize::Objective as _;
                objective.chart = None;
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
}
