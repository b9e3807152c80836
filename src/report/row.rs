//! A job as the report sees it, what it can be asked for by name, and conditions on its axes.

use crate::experiment::column;
use crate::experiment::file::{Condition, Experiment};
use crate::experiment::record::{MEASUREMENTS, Record, Status};
use crate::metric::Better;
use serde_json::Value;
use std::path::PathBuf;

const MEBIBYTE: f64 = 1_048_576.0;

/// One job of the plan with its record.
#[derive(Clone, Debug)]
pub struct Row {
    /// Unique within the experiment and fit for a file name.
    pub name: String,
    /// Values of all axes in the order of the file.
    pub axes: Vec<(String, Value)>,
    pub record: Record,
    /// Whether the record was already stored; told on the terminal only, so that a second run writes the same bytes.
    pub cached: bool,
    /// Where the result mesh is, a VTU file.
    pub mesh: Option<PathBuf>,
    /// Where the result's further files are, by what follows the job's name in theirs.
    pub files: Vec<(String, PathBuf)>,
}

impl Row {
    /// The job's value of an axis; where the name is no axis, the setting of this dotted path or the model held fixed.
    pub fn axis(&self, name: &str) -> Option<&Value> {
        if let Some((_, value)) = self.axes.iter().find(|(axis, _)| axis == name) {
            return Some(value);
        }
        let mut value = &self.record.job.settings;
        for part in name.split('.') {
            value = value.get(part)?;
        }
        Some(value)
    }

    /// A figure by name: a metric, a counter, a measurement or a numeric axis, in this order. Bytes are returned in MiB,
    /// as [`Quantity`] says.
    pub fn figure(&self, name: &str) -> Option<f64> {
        let result = &self.record.result;
        if let Some(&value) = result.metrics.get(name) {
            return Some(value);
        }
        if let Some(&count) = result.counters.get(name) {
            return Some(count as f64);
        }
        match MEASUREMENTS.iter().find(|measured| measured.name == name) {
            Some(measured) => {
                let value = self.measurement(name)?;
                Some(if measured.unit == "B" { value / MEBIBYTE } else { value })
            }
            None => self.axis(name)?.as_f64(),
        }
    }

    /// The place on a plot's or rate's x: a varied axis comes before a figure of its name, such as `energy`.
    pub fn coordinate(&self, name: &str) -> Option<f64> {
        match self.axes.iter().find(|(axis, _)| axis == name) {
            Some((_, value)) => value.as_f64(),
            None => self.figure(name),
        }
    }

    /// A measurement in its own unit; absent where nothing was measured.
    pub fn measurement(&self, name: &str) -> Option<f64> {
        let measurement = &self.record.measurement;
        match name {
            "seconds" => median(&measurement.wall_seconds),
            "cpu_seconds" => median(&measurement.cpu_seconds),
            // Bytes in the record, MiB in tables.
            "peak_memory" => {
                Some(measurement.peak_memory as f64 / f64::from(1 << 20)).filter(|mebibytes| *mebibytes > 0.0)
            }
            "threads" => Some(measurement.threads as f64),
            _ => None,
        }
    }

    /// Whether a job on one thread had the machine's other jobs kept away and still waited: its time is not its own.
    pub fn waited(&self) -> bool {
        let measurement = &self.record.measurement;
        let times = (median(&measurement.wall_seconds), median(&measurement.cpu_seconds));
        let waited = matches!(times, (Some(wall), Some(cpu)) if wall > 1.25 * cpu + 0.1);
        measurement.exclusive && measurement.threads == 1 && waited
    }

    /// Whether the method returned an outcome.
    pub fn done(&self) -> bool {
        self.record.result.status == Status::Done
    }

    /// Whether the job has to be told apart in a table: it has no outcome, or did not converge.
    pub fn remarkable(&self) -> bool {
        !self.done() || !matches!(self.record.result.stop.as_str(), "converged" | "")
    }

    /// Whether every axis has one of the values asked for. An axis or setting that the job has not matches nothing.
    pub fn matches(&self, condition: &Condition) -> bool {
        condition.iter().all(|(axis, values)| {
            self.axis(axis)
                .is_some_and(|own| values.iter().any(|value| same(own, value)))
        })
    }

    /// The values of these axes as one text, such as `ball, stretch, order 2`: a number says nothing without its axis.
    pub fn labels(&self, axes: &[String]) -> String {
        let part = |axis: &String| match self.axis(axis) {
            Some(value @ (Value::Number(_) | Value::Bool(_) | Value::Array(_))) => {
                let name = axis.rsplit('.').next().unwrap_or(axis);
                format!("{} {}", name.replace('_', " "), label(value))
            }
            value => value.map_or_else(String::new, label),
        };
        axes.iter().map(part).collect::<Vec<_>>().join(", ")
    }
}

/// Equality of two values of an axis: 1 and 1.0 are the same.
pub fn same(left: &Value, right: &Value) -> bool {
    match (left.as_f64(), right.as_f64()) {
        (Some(left), Some(right)) => left == right,
        _ => left == right,
    }
}

/// An axis value in a few characters: words as they are, `newton(omega=1e8)` for a table with one key.
pub fn label(value: &Value) -> String {
    match value {
        Value::Null => "none".into(),
        Value::Bool(flag) => if *flag { "yes" } else { "no" }.into(),
        Value::Number(number) => match number.as_f64() {
            Some(value) if number.is_f64() => super::number::written(value),
            _ => number.to_string(),
        },
        Value::String(text) => text.clone(),
        Value::Array(items) => items.iter().map(nested).collect::<Vec<_>>().join(" "),
        Value::Object(entries) => entries
            .iter()
            .map(|(key, value)| match value {
                Value::Object(inner) if inner.is_empty() => key.clone(),
                Value::Object(_) => format!("{key}({})", label(value)),
                _ => format!("{key}={}", nested(value)),
            })
            .collect::<Vec<_>>()
            .join(" "),
    }
}

/// A value within another: what has several parts stands in parentheses, a recipe's operation is called by its name.
fn nested(value: &Value) -> String {
    match value {
        Value::Array(_) => format!("({})", label(value)),
        Value::Object(entries) => {
            let name = entries.get("op").map_or_else(String::new, label);
            let mut rest = entries.clone();
            rest.remove("op");
            match (name.is_empty(), rest.is_empty()) {
                (false, true) => name,
                _ => format!("{name}({})", label(&Value::Object(rest))),
            }
        }
        _ => label(value),
    }
}

/// What a named figure is: its unit, its better direction, its definition.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    pub name: String,
    pub symbol: String,
    pub unit: String,
    pub better: Better,
    pub definition: String,
    /// Significant digits in tables: 4 for results, 3 for measurements.
    pub digits: usize,
    /// Measured on a machine rather than computed: compared with printed figures as a ratio only.
    pub measured: bool,
}

impl Quantity {
    /// The quantity of this name in an experiment. Other names are axes or trace columns: pure numbers.
    pub fn find(experiment: &Experiment, name: &str) -> Quantity {
        let measured = MEASUREMENTS.iter().any(|measured| measured.name == name);
        match column::find(experiment.method, name) {
            Some(column) => Quantity {
                name: name.into(),
                symbol: column.symbol.into(),
                unit: if measured && column.unit == "B" {
                    "MiB"
                } else {
                    column.unit
                }
                .into(),
                better: column.better,
                definition: column.definition.into(),
                digits: if measured { 3 } else { 4 },
                measured,
            },
            None => Quantity {
                name: name.into(),
                symbol: name.replace('_', " "),
                unit: String::new(),
                better: Better::Neither,
                definition: String::new(),
                digits: 4,
                measured: false,
            },
        }
    }

    /// `d_ma`, or `seconds [s]`.
    pub fn heading(&self) -> String {
        if self.unit.is_empty() {
            self.name.clone()
        } else {
            format!("{} [{}]", self.name, self.unit)
        }
    }
}

/// The middle value, or the mean of the two middle ones; none of an empty list.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => None,
        odd if odd % 2 == 1 => Some(sorted[middle]),
        _ => Some(0.5 * (sorted[middle - 1] + sorted[middle])),
    }
}
