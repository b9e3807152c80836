//! The settings of a volumetric map in the typed form that the computation reads.
//!
//! A preset chooses the fields that the file leaves open; whatever the file says wins over it. [`Settings::canonical`]
//! writes the choice out and drops what has no effect, so that two files that ask the same question share one key.

use super::fields::FIELDS;
use crate::energy;
use crate::method::Failure;
use crate::method::setting::fill;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    Best,
    Paper,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weighting {
    Volume,
    Uniform,
    Target,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Barrier {
    Auto,
    None,
    LocallyInjective,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    ProjectedNewton,
    RelaxedNewton,
    LocallyInjective,
    LBfgs,
}

impl Solver {
    /// Whether the boundary stands on its target from the start, instead of being pulled towards it.
    pub fn hard_constraints(self) -> bool {
        matches!(self, Solver::ProjectedNewton | Solver::LBfgs)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    Auto,
    Harmonic,
    Rest,
    Similarity,
    TargetMesh,
    RandomInterior,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SimilarityFit {
    ClosedForm,
    ThirteenVariables,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    None,
    Needed,
    All,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OnInfeasible {
    Refuse,
    Continue,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hessian {
    Projected,
    OnDemand,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Continuation {
    Off,
    On,
    Auto,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RestShape {
    LocallyScaled,
    Uniform,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProjectedNewton {
    pub hessian: Hessian,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RelaxedNewton {
    pub relaxation: bool,
    pub relaxation_steps: u64,
    pub gradient_criterion: bool,
    pub weight: f64,
    pub continuation: Continuation,
    pub continuation_weight: f64,
    pub continuation_factor: f64,
    pub continuation_rounds: u64,
    pub constraint_tolerance: f64,
    pub energy_tolerance: f64,
    pub hessian: Hessian,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LocallyInjective {
    pub weight: f64,
    pub weight_ratio: f64,
    pub substepping: bool,
    pub constraint_tolerance: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LBfgs {
    pub memory: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Untangling {
    pub rest_shape: RestShape,
    pub determinant_weight: f64,
    pub decrease: f64,
    pub steps: u64,
    pub iterations: u64,
}

/// The settings with nothing left open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    pub energy: String,
    pub weighting: Weighting,
    pub barrier: Barrier,
    pub barrier_weight: f64,
    /// `"auto"` or a number.
    pub barrier_width: Value,
    pub rescale: bool,
    pub solver: Solver,
    pub start: Start,
    pub similarity: SimilarityFit,
    pub seed: u64,
    pub split: Split,
    pub on_infeasible: OnInfeasible,
    pub untangle: bool,
    pub iteration_limit: u64,
    pub gradient_tolerance: f64,
    pub energy_tolerance: f64,
    pub change_tolerance: f64,
    #[serde(rename = "projected-newton")]
    pub projected_newton: ProjectedNewton,
    #[serde(rename = "relaxed-newton")]
    pub relaxed_newton: RelaxedNewton,
    #[serde(rename = "locally-injective")]
    pub locally_injective: LocallyInjective,
    #[serde(rename = "l-bfgs")]
    pub l_bfgs: LBfgs,
    pub untangling: Untangling,
}

/// What the presets choose: field, best, paper.
const PRESETS: &[(&str, &str, &str)] = &[
    ("rescale", "true", "false"),
    ("solver", "projected-newton", "relaxed-newton"),
    ("start", "auto", "similarity"),
    ("similarity", "closed-form", "thirteen-variables"),
    ("split", "needed", "none"),
    ("untangle", "true", "false"),
];

impl Settings {
    /// Reads validated settings, full or canonical. Fields that are absent take the preset's or the declared value.
    ///
    /// # Errors
    /// A value that the declaration does not allow, which validation would have found.
    pub fn resolve(settings: &Value) -> Result<Settings, Failure> {
        let mut table = fill(FIELDS, settings);
        let paper = match table.remove("preset") {
            Some(Value::String(preset)) => preset == "paper",
            _ => false,
        };
        for (name, best, literal) in PRESETS {
            let chosen = if paper { *literal } else { *best };
            table.entry(*name).or_insert_with(|| match chosen {
                "true" => Value::Bool(true),
                "false" => Value::Bool(false),
                word => Value::String(word.to_string()),
            });
        }
        serde_json::from_value(Value::Object(table))
            .map_err(|error| Failure::invalid(format!("settings of volume-map: {error}")))
    }

    /// The energy of this name, or a failure that lists the known ones.
    pub fn density(&self) -> Result<&'static dyn energy::Energy, Failure> {
        energy::energies()
            .iter()
            .copied()
            .find(|energy| energy.name() == self.energy)
            .ok_or_else(|| {
                Failure::invalid(format!(
                    "unknown energy \"{}\"; known are {}",
                    self.energy,
                    energy::energies()
                        .iter()
                        .map(|energy| energy.name())
                        .collect::<Vec<_>>()
                        .join(", ")
                ))
            })
    }

    /// Whether the barrier term is added to this energy.
    pub fn with_barrier(&self) -> bool {
        match self.barrier {
            Barrier::None => false,
            Barrier::LocallyInjective => true,
            Barrier::Auto => {
                self.solver == Solver::LocallyInjective || !self.density().is_ok_and(|energy| energy.is_barrier())
            }
        }
    }

    /// The start with `auto` replaced.
    pub fn chosen_start(&self) -> Start {
        match self.start {
            Start::Auto if self.solver.hard_constraints() => Start::Harmonic,
            Start::Auto => Start::Similarity,
            start => start,
        }
    }

    /// The settings as a table without those that cannot change the result.
    pub fn canonical(&self) -> Value {
        let Ok(Value::Object(mut table)) = serde_json::to_value(self) else {
            return Value::Null;
        };
        let mut drop = |names: &[&str]| names.iter().for_each(|name| drop_entry(&mut table, name));
        if self.with_barrier() {
            drop(&["barrier"]);
        } else {
            drop(&["barrier", "barrier_weight", "barrier_width"]);
        }
        let start = self.chosen_start();
        drop(&["start"]);
        if start != Start::Similarity {
            drop(&["similarity"]);
        }
        if start != Start::RandomInterior {
            drop(&["seed"]);
        }
        // Only a density that is infinite on inverted tetrahedra asks for a start without any.
        let upright = self.with_barrier()
            || self.weighting == Weighting::Target
            || self.density().is_ok_and(|energy| energy.is_barrier());
        if !upright {
            drop(&["untangle"]);
        }
        if !upright || !self.untangle {
            drop(&["untangling"]);
        }
        if !upright || !self.solver.hard_constraints() {
            drop(&["on_infeasible"]);
        }
        for (solver, name) in [
            (Solver::ProjectedNewton, "projected-newton"),
            (Solver::RelaxedNewton, "relaxed-newton"),
            (Solver::LocallyInjective, "locally-injective"),
            (Solver::LBfgs, "l-bfgs"),
        ] {
            if solver != self.solver {
                drop(&[name]);
            }
        }
        if !self.solver.hard_constraints() {
            drop(&["energy_tolerance", "change_tolerance"]);
        }
        if let Some(Value::Object(options)) = table.get_mut("relaxed-newton") {
            let without_effect: &[&str] = match self.relaxed_newton.continuation {
                Continuation::Off => &["continuation_weight", "continuation_factor", "continuation_rounds"],
                Continuation::On => &["weight"],
                Continuation::Auto => &[],
            };
            without_effect.iter().for_each(|name| drop_entry(options, name));
            if !self.relaxed_newton.relaxation {
                drop_entry(options, "relaxation_steps");
            }
        }
        // Written with the words they stand for, so that `auto` and its meaning share a key.
        let barrier = if self.with_barrier() {
            Barrier::LocallyInjective
        } else {
            Barrier::None
        };
        for (name, value) in [
            ("barrier", serde_json::to_value(barrier)),
            ("start", serde_json::to_value(start)),
        ] {
            if let Ok(value) = value {
                table.insert(name.to_string(), value);
            }
        }
        Value::Object(table)
    }
}

fn drop_entry(table: &mut Map<String, Value>, name: &str) {
    table.remove(name);
}

/// Checks that go across fields: path of the offending field and message.
pub fn check(settings: &Value) -> Vec<(String, String)> {
    let Ok(settings) = Settings::resolve(settings) else {
        return Vec::new();
    };
    let mut errors = Vec::new();
    let mut error = |path: &str, message: &str| errors.push((path.to_string(), message.to_string()));
    if settings.solver == Solver::LocallyInjective && settings.barrier == Barrier::None {
        error(
            "barrier",
            "the locally-injective solver rests on the barrier; use \"auto\" or another solver",
        );
    }
    let upright = energy::find(&settings.energy).is_none_or(|energy| energy.is_barrier());
    if settings.weighting == Weighting::Target && settings.barrier == Barrier::None && !upright {
        error(
            "weighting",
            "weighted by the image's volume, an energy without a barrier falls without bound as cells invert; use \
             barrier = \"auto\" or another weighting",
        );
    }
    errors
}
