//! An experiment as its file states it: every name checked, every default filled, nothing run.

use super::diagnostic::{Diagnostic, Source};
use crate::method::Method;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// A named model of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    pub name: String,
    /// A missing file skips the model's jobs with a notice instead of being an error.
    pub optional: bool,
    pub parts: BTreeMap<String, PartSpecification>,
}

/// One part of a model, as written.
#[derive(Clone, Debug, PartialEq)]
pub enum PartSpecification {
    Generated { generator: String, parameters: Value },
    File { path: String, parameters: Value },
}

/// One axis of the grid: `model`, a setting by its dotted path, or `model.PARAMETER` of the mesh's generator.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    pub name: String,
    pub values: Vec<Value>,
}

/// Limits of each job.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    pub seconds: Option<f64>,
    /// Resident memory in bytes.
    pub memory: Option<u64>,
}

/// How times are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// One job at a time, on all threads.
    pub exclusive: bool,
    pub repeat: u32,
    /// Threads of each job; all cores when exclusive and silent, one otherwise.
    pub threads: Option<u32>,
}

/// A condition on the axes: `{ energy = "stretch", model = ["ball", "duck"] }`; a list means any of.
pub type Condition = BTreeMap<String, Vec<Value>>;

/// `[[table]]`. Columns are names of [`super::column::columns`].
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    pub name: String,
    pub title: Option<String>,
    /// Axes whose values head each row.
    pub rows: Vec<String>,
    /// Metrics, counters and measurements.
    pub columns: Vec<String>,
    /// Axes for each of whose values every column stands once.
    pub across: Vec<String>,
    pub condition: Condition,
    /// Printed figures: rows of axis values and metric values.
    pub published: Option<Published>,
}

/// Printed figures beside ours.
#[derive(Clone, Debug, PartialEq)]
pub struct Published {
    /// Where they were printed: `Table 1 of the paper`, and the machine for times.
    pub source: String,
    pub machine: Option<String>,
    /// Each row holds axis values by axis name and printed numbers, as whole or not as they are written, by the names of
    /// the table's columns; `tolerance`, if there, is relative and stands for this row.
    pub rows: Vec<BTreeMap<String, Value>>,
}

/// `[[plot]]`
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    pub name: String,
    pub title: Option<String>,
    /// A trace such as `iteration`, a column, or an axis, whose values may be words.
    pub x: String,
    pub y: String,
    /// Axes whose values tell the series apart.
    pub series: Vec<String>,
    pub log_x: bool,
    pub log_y: bool,
    pub condition: Condition,
}

/// `[[rate]]`: the slope of log y against log x.
#[derive(Clone, Debug, PartialEq)]
pub struct Rate {
    pub name: String,
    pub x: String,
    pub y: String,
    pub series: Vec<String>,
    pub condition: Condition,
    /// Only x within this window counts.
    pub window: Option<[f64; 2]>,
    pub expect: Option<Bound>,
}

/// What a number must satisfy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bound {
    pub min: Option<f64>,
    pub max: Option<f64>,
    pub equals: Option<f64>,
    /// Relative tolerance for `equals`; exact when absent.
    pub tolerance: Option<f64>,
}

/// `[[expect]]`
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    pub condition: Condition,
    /// The stop reason that must be met, such as `converged` or `infeasible`.
    pub stop: Option<String>,
    pub bounds: BTreeMap<String, Bound>,
    /// `d_ma = { less_than = { energy = "dirichlet" } }`: our metric below that of the job that differs only in these
    /// axes.
    pub comparisons: Vec<Comparison>,
    /// 1-based line in the file, for messages.
    pub line: usize,
}

/// A metric of one job against the same metric of the others that have the given axis values and agree in all other axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    pub metric: String,
    pub other: Condition,
    /// Ours must be less than `factor` times the other's.
    pub factor: f64,
}

/// Where an experiment was read from, so that what a plan finds can be underlined in the file.
#[derive(Clone, Debug, Default)]
pub struct Origin {
    pub source: Arc<Source>,
    /// Folder of the file: relative paths in it begin here.
    pub folder: PathBuf,
    /// Bytes of each entry, by dotted path such as `vary.energy` or `models.duck.mesh`.
    pub places: BTreeMap<String, Range<usize>>,
    /// What is doubtful but no error.
    pub warnings: Vec<Diagnostic>,
}

/// A checked experiment file.
pub struct Experiment {
    /// File stem, used for the folder under `results/`.
    pub name: String,
    pub title: String,
    pub description: String,
    pub method: &'static dyn Method,
    pub claims: Vec<String>,
    pub models: Vec<Model>,
    /// Complete settings held for every job.
    pub settings: Value,
    /// Axes in the order of the file; the last varies fastest. `model` is always among the axes of a method that has
    /// models: first, and with all of them, where the file does not list it.
    pub axes: Vec<Axis>,
    /// Groups of axes that move together; each group counts as one axis after those of `vary`.
    pub zips: Vec<Vec<Axis>>,
    pub excludes: Vec<Condition>,
    pub limits: Limits,
    pub timing: Timing,
    pub tables: Vec<Table>,
    pub plots: Vec<Plot>,
    pub rates: Vec<Rate>,
    pub expectations: Vec<Expectation>,
    pub origin: Origin,
}
