//! The methods that experiments run, and the list of them.
//!
//! A method declares its models' roles, its settings and its metrics as data; the experiment floor derives the
//! diagnostics, the defaults, the JSON Schema and the job's key from these declarations. It reads no file and no clock.

pub mod setting;
pub mod model;
pub mod volume_map;
pub mod volume_fit;
pub mod surface_fit;
pub mod centroidal_voronoi;
pub mod g1_surface;
pub mod mixed_fem;

use crate::metric::Metric;
use crate::optimize::Observer;
use model::{LoadedModel, ModelKind};
use serde_json::Value;
use setting::Field;
use std::collections::BTreeMap;

/// Everything that a method gets: nothing else may influence its result.
pub struct Inputs<'a> {
    /// Validated against [`Method::settings`], every default filled in.
    pub settings: &'a Value,
    pub model: LoadedModel,
}

/// A column of numbers over the iterations, as plotted by `x = "iteration"`.
pub type Traces = BTreeMap<String, Vec<f64>>;

/// What a method returns: a result that is the same to the last bit on every run.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Why the computation ended; `converged` is the good one. Kebab-case, such as `step-limit`.
    pub stop: String,
    /// A sentence for a human, with the place and the mend where something went wrong.
    pub reason: String,
    /// Values by metric name; each name is declared in [`Method::metrics`]. Not-a-number where undefined.
    pub metrics: BTreeMap<String, f64>,
    /// Columns of equal length. `iteration` is always there when anything iterated.
    pub traces: Traces,
    /// Iterations, factorizations, evaluations.
    pub counters: BTreeMap<String, u64>,
    /// Repairs made and doubts, for the reader of the report.
    pub notices: Vec<String>,
    /// The result mesh as bytes of a VTU file, with the fields that pictures can be coloured by.
    pub mesh: Option<Vec<u8>>,
    /// Further files by what follows the job's name in theirs: `bezier.vtu`, `control-points.txt`. Lowercase letters,
    /// digits, `-` and `.` only.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// A computation that could not be done at all: a record with a reason, never a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure {
    /// Kebab-case word for tables: `infeasible`, `invalid-input`, `not-finite`.
    pub kind: String,
    /// What is wrong, where, and the mend.
    pub reason: String,
}

impl Failure {
    /// The model or the settings cannot be computed with.
    pub fn invalid(reason: impl Into<String>) -> Failure {
        Failure {
            kind: "invalid-input".to_string(),
            reason: reason.into(),
        }
    }
}

/// A family of computations over one kind of model.
pub trait Method: Sync {
    /// The name in an experiment file: `volume-map`.
    fn name(&self) -> &'static str;
    /// Raised whenever a change alters results; part of every job's key.
    fn version(&self) -> u32;
    /// One line for `vargeo list methods`.
    fn summary(&self) -> &'static str;
    /// The paper, as author-less citation.
    fn source(&self) -> &'static str;
    /// What `[models.*]` may hold.
    fn model(&self) -> &'static ModelKind;
    /// What `[settings]` may hold.
    fn settings(&self) -> &'static [Field];
    /// Checks that go across fields, with the path of the offending field: `("solver", "message")`.
    fn check(&self, _settings: &Value) -> Vec<(String, String)> {
        Vec::new()
    }
    /// Drops settings that have no effect on this job, so that they do not enter its key.
    fn canonical(&self, settings: Value) -> Value {
        settings
    }
    /// The metrics that every record of this method holds.
    fn metrics(&self) -> &'static [Metric];
    /// Metrics that a first table shows; the first five when there are none.
    fn headline(&self) -> &'static [&'static str] {
        &[]
    }
    /// Settings and axes across which values of this metric mean different things, such as energies of different
    /// densities: no table calls one of them the best.
    fn incomparable(&self, _metric: &str) -> &'static [&'static str] {
        &[]
    }
    /// Names and meanings of the columns in [`Outcome::traces`], such as `iteration` and `energy`.
    fn traces(&self) -> &'static [(&'static str, &'static str)] {
        &[]
    }
    /// Names and meanings of [`Outcome::counters`], such as `iterations`; none may be a metric's name too.
    fn counters(&self) -> &'static [(&'static str, &'static str)] {
        &[]
    }
    fn run(&self, inputs: Inputs<'_>, observer: &mut dyn Observer) -> Result<Outcome, Failure>;
}

/// Every method, in the order of the documentation.
pub fn methods() -> &'static [&'static dyn Method] {
    &[
        &volume_map::VolumeMap,
        &volume_fit::VolumeFit,
        &surface_fit::SurfaceFit,
        &centroidal_voronoi::CentroidalVoronoi,
        &g1_surface::G1Surface,
        &mixed_fem::MixedFem,
    ]
}

/// The method of this name.
pub fn find(name: &str) -> Option<&'static dyn Method> {
    methods().iter().copied().find(|method| method.name() == name)
}
