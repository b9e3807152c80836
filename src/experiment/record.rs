//! What a job leaves: a deterministic result, and measurements of how it was obtained.

use super::job::{Job, Key};
use crate::metric::{Better, Metric};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Raised whenever the layout of a record changes; part of every key.
pub const RECORD_SCHEMA: u32 = 1;

/// One job's record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    pub key: Key,
    pub job: Job,
    pub result: JobResult,
    pub measurement: Measurement,
}

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// The method returned an outcome; `stop` says whether it converged. Kept in the store for ever.
    Done,
    /// The method said that it cannot be done (infeasible, invalid input, not finite). Kept in the store for ever.
    Refused,
    /// Crash, panic, time or memory limit: kept for the report, tried again on the next run.
    Failed,
    /// An optional model is missing: no computation took place.
    Skipped,
}

/// The deterministic part: the same to the last bit on every run of one binary on one kind of processor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobResult {
    pub status: Status,
    /// `converged`, `stalled`, `step-limit`, ..., `crashed`, `panicked`, `time-limit`, `memory-limit`, `missing-model`.
    pub stop: String,
    pub reason: String,
    /// By metric name. Non-finite values are written as the words `nan`, `inf`, `-inf`.
    #[serde(with = "numbers")]
    pub metrics: BTreeMap<String, f64>,
    #[serde(with = "columns")]
    pub traces: BTreeMap<String, Vec<f64>>,
    pub counters: BTreeMap<String, u64>,
    pub notices: Vec<String>,
    /// File name and SHA-256 of each artifact beside the record, such as `mesh.vtu`.
    pub artifacts: BTreeMap<String, String>,
}

/// One phase's share of the time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    pub name: String,
    pub wall_seconds: f64,
    pub cpu_seconds: f64,
}

/// The measured part: true of one run on one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Version and commit of vargeo.
    pub version: String,
    pub commit: String,
    /// Processor features that the kernels were dispatched on, such as `x86_64 avx512`.
    pub target: String,
    /// Processor's own name and operating system, never a host name.
    pub host: String,
    pub threads: usize,
    /// Seconds since 1970 in UTC when the job started.
    pub started: i64,
    /// Whether the job had the machine to itself.
    pub exclusive: bool,
    /// Wall seconds of the method itself, of each repetition; the median is reported as `seconds`.
    pub wall_seconds: Vec<f64>,
    pub cpu_seconds: Vec<f64>,
    pub phases: Vec<Phase>,
    /// Peak resident memory of the job's process in bytes.
    pub peak_memory: u64,
    /// Input file names as given, by role: for the reader, not part of the key.
    pub inputs: BTreeMap<String, String>,
}

/// Measurements that tables, plots and expectations may name beside a method's metrics.
pub const MEASUREMENTS: &[Metric] = &[
    Metric {
        name: "seconds",
        symbol: "time",
        unit: "s",
        floor: Some(0.0),
        better: Better::Lower,
        definition: "wall-clock time of the method, median over the repetitions",
    },
    Metric {
        name: "cpu_seconds",
        symbol: "CPU time",
        unit: "s",
        floor: Some(0.0),
        better: Better::Lower,
        definition: "processor time of the method over all threads, median over the repetitions",
    },
    Metric {
        name: "peak_memory",
        symbol: "memory",
        unit: "MiB",
        floor: Some(0.0),
        better: Better::Lower,
        definition: "peak resident memory of the job's process",
    },
    Metric {
        name: "threads",
        symbol: "threads",
        unit: "",
        floor: None,
        better: Better::Neither,
        definition: "threads that the job was given",
    },
];

/// Words that a record's `stop` may hold beside those of a method, with their meanings.
pub const STOPS: &[(&str, &str)] = &[
    ("converged", "a convergence criterion was met"),
    ("stalled", "no acceptable step was found although no criterion was met"),
    ("step-limit", "the permitted number of iterations was used up"),
    ("not-finite", "the energy or its gradient is not a finite number"),
    (
        "infeasible",
        "the problem has no admissible solution, with the obstacles named",
    ),
    ("invalid-input", "a model or a setting cannot be used"),
    ("folded", "the result folds over itself, with the first place named"),
    (
        "singular",
        "the system of equations has no unique solution, with the places named",
    ),
    ("out-of-memory", "a factorization found no more memory"),
    (
        "invalid-start",
        "the start is outside the energy's domain and may not be mended",
    ),
    ("time-limit", "the time of `limits` was used up"),
    ("memory-limit", "the memory of `limits` was used up"),
    ("cancelled", "the user asked to stop"),
    ("crashed", "the job's process ended by a signal"),
    ("panicked", "the job ran into a defect of the program"),
    ("missing-model", "an optional model's file is absent"),
    ("not-started", "the job's process could not be started"),
    (
        "not-stored",
        "the result was computed but could not be written to the store",
    ),
    ("input-changed", "an input file changed after the run was planned"),
    ("input-unreadable", "an input file could not be read"),
];

mod word {
    /// The word for a number that JSON cannot hold.
    pub fn write(value: f64) -> serde_json::Value {
        match serde_json::Number::from_f64(value) {
            Some(number) => serde_json::Value::Number(number),
            None if value.is_nan() => "nan".into(),
            None if value > 0.0 => "inf".into(),
            None => "-inf".into(),
        }
    }

    pub fn read(value: &serde_json::Value) -> Option<f64> {
        match value {
            serde_json::Value::Number(number) => number.as_f64(),
            serde_json::Value::String(text) => match text.as_str() {
                "nan" => Some(f64::NAN),
                "inf" => Some(f64::INFINITY),
                "-inf" => Some(f64::NEG_INFINITY),
                _ => None,
            },
            _ => None,
        }
    }
}

mod numbers {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};
    use std::collections::BTreeMap;

    pub fn serialize<S: Serializer>(map: &BTreeMap<String, f64>, serializer: S) -> Result<S::Ok, S::Error> {
        map.iter()
            .map(|(name, &value)| (name, super::word::write(value)))
            .collect::<BTreeMap<_, _>>()
            .serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, f64>, D::Error> {
        BTreeMap::<String, serde_json::Value>::deserialize(deserializer)?
            .into_iter()
            .map(|(name, value)| match super::word::read(&value) {
                Some(number) => Ok((name, number)),
                None => Err(D::Error::custom(format!("metric {name} is no number"))),
            })
            .collect()
    }
}

mod columns {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};
    use std::collections::BTreeMap;

    pub fn serialize<S: Serializer>(map: &BTreeMap<String, Vec<f64>>, serializer: S) -> Result<S::Ok, S::Error> {
        map.iter()
            .map(|(name, values)| {
                (
                    name,
                    values
                        .iter()
                        .map(|&value| super::word::write(value))
                        .collect::<Vec<_>>(),
                )
            })
            .collect::<BTreeMap<_, _>>()
            .serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, Vec<f64>>, D::Error> {
        BTreeMap::<String, Vec<serde_json::Value>>::deserialize(deserializer)?
            .into_iter()
            .map(|(name, values)| {
                let column: Option<Vec<f64>> = values.iter().map(super::word::read).collect();
                column
                    .map(|column| (name.clone(), column))
                    .ok_or_else(|| D::Error::custom(format!("trace {name} holds no numbers")))
            })
            .collect()
    }
}
