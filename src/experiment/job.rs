//! A job: one point of an experiment's grid, fully resolved, and its key.
//!
//! The key is SHA-256 over the canonical resolved job, the bytes of its input files, the method's version and the record
//! schema. No path, time, thread count or host enters it.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// One part of a job's model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum JobPart {
    /// A generator with all its parameters.
    Generated { generator: String, parameters: Value },
    /// The content of a file.
    File {
        sha256: String,
        format: String,
        parameters: Value,
    },
}

/// Everything that decides a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    pub record_schema: u32,
    pub method: String,
    pub method_version: u32,
    pub model: BTreeMap<String, JobPart>,
    /// Every setting that has an effect, defaults filled in.
    pub settings: Value,
}

/// Lower-case hexadecimal SHA-256 of the canonical job.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Key(pub String);
