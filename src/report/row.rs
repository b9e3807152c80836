//! A job as the report sees it, what it can be asked for by name, and conditions on its axes.

use crate::experiment::file::{Condition, Experiment};
use crate::experiment::record::{Record, Status};
use crate::metric::Better;
use serde_json::Value;

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
    /// The result mesh as bytes of a VTU file.
    pub mesh: Option<Vec<u8>>,
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

    /// A figure by name: a metric, a measurement, a counter or a numeric axis, in this order.
    pub fn figure(&self, name: &str) -> Option<f64> {
        if let Some(&value) = self.record.result.metrics.get(name) {
            return Some(value);
        }
        if let Some(measured) = MEASURED.iter().find(|measured| measured.name == name) {
            return (measured.value)(self);
        }
        if let Some(&count) = self.record.result.counters.get(name) {
            return Some(count as f64);
        }
        self.axis(name)?.as_f64()
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

    /// The values of these axes as one text, such as `ball, stretch`.
    pub fn labels(&self, axes: &[String]) -> String {
        let parts: Vec<String> = axes
            .iter()
            .map(|axis| self.axis(axis).map_or_else(String::new, label))
            .collect();
        parts.join(", ")
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
            Some(value) if number.is_f64() => super::number::round(value, 6).plain(),
            _ => number.to_string(),
        },
        Value::String(text) => text.clone(),
        Value::Array(items) => items.iter().map(label).collect::<Vec<_>>().join(" "),
        Value::Object(entries) => entries
            .iter()
            .map(|(key, value)| match value {
                Value::Object(inner) if inner.is_empty() => key.clone(),
                Value::Object(_) => format!("{key}({})", label(value)),
                _ => format!("{key}={}", label(value)),
            })
            .collect::<Vec<_>>()
            .join(" "),
    }
}

/// A measurement that every method's record holds.
pub struct Measured {
    pub name: &'static str,
    pub unit: &'static str,
    pub definition: &'static str,
    value: fn(&Row) -> Option<f64>,
}

/// Measurements that tables, plots, rates and expectations may name beside a method's metrics.
pub const MEASURED: &[Measured] = &[
    Measured {
        name: "seconds",
        unit: "s",
        definition: "wall-clock time of the method itself, median of the repetitions",
        value: |row| median(&row.record.measurement.wall_seconds),
    },
    Measured {
        name: "cpu_seconds",
        unit: "s",
        definition: "processor time of the method over all threads, median of the repetitions",
        value: |row| median(&row.record.measurement.cpu_seconds),
    },
    Measured {
        name: "peak_memory",
        unit: "MiB",
        definition: "peak resident memory of the job's process",
        value: |row| match row.record.measurement.peak_memory {
            0 => None,
            bytes => Some(bytes as f64 / (1024.0 * 1024.0)),
        },
    },
    Measured {
        name: "threads",
        unit: "",
        definition: "threads that the job was given",
        value: |row| match row.record.measurement.threads {
            0 => None,
            threads => Some(threads as f64),
        },
    },
];

/// The middle value, or the mean of the middle two.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => None,
        count if count % 2 == 1 => Some(sorted[count / 2]),
        count => Some(0.5 * (sorted[count / 2 - 1] + sorted[count / 2])),
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
    /// The quantity of this name in an experiment. Unknown names are counters, axes or trace columns: pure numbers.
    pub fn find(experiment: &Experiment, name: &str) -> Quantity {
        if let Some(metric) = experiment.method.metrics().iter().find(|metric| metric.name == name) {
            return Quantity {
                name: name.into(),
                symbol: metric.symbol.into(),
                unit: metric.unit.into(),
                better: metric.better,
                definition: metric.definition.into(),
                digits: 4,
                measured: false,
            };
        }
        if let Some(measured) = MEASURED.iter().find(|measured| measured.name == name) {
            let better = if name == "threads" {
                Better::Neither
            } else {
                Better::Lower
            };
            return Quantity {
                name: name.into(),
                symbol: name.replace('_', " "),
                unit: measured.unit.into(),
                better,
                definition: measured.definition.into(),
                digits: 3,
                measured: true,
            };
        }
        Quantity {
            name: name.into(),
            symbol: name.replace('_', " "),
            unit: String::new(),
            better: Better::Neither,
            definition: String::new(),
            digits: 4,
            measured: false,
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

impl Measured {
    /// The job's value; absent where nothing was measured.
    pub fn of(&self, row: &Row) -> Option<f64> {
        (self.value)(row)
    }
}
