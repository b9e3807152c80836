//! A job: one point of an experiment's grid, fully resolved, and its key.
//!
//! The key is SHA-256 over the canonical resolved job, the bytes of its input files, the method's version and the record
//! schema. No path, time, thread count or host enters it.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt;

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

impl Key {
    /// The key of a job.
    pub fn of(job: &Job) -> Self {
        Key(sha256(job.canonical().as_bytes()))
    }
}

impl fmt::Display for Key {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl Job {
    /// The job as the text that is hashed: JSON without spaces, keys in byte order, floats in their shortest form with a
    /// point or an exponent, minus zero as zero.
    pub fn canonical(&self) -> String {
        let part = |part: &JobPart| match part {
            JobPart::Generated { generator, parameters } => {
                serde_json::json!({ "generated": { "generator": generator, "parameters": parameters } })
            }
            JobPart::File {
                sha256,
                format,
                parameters,
            } => {
                serde_json::json!({ "file": { "sha256": sha256, "format": format, "parameters": parameters } })
            }
        };
        let model: serde_json::Map<String, Value> = self
            .model
            .iter()
            .map(|(role, content)| (role.clone(), part(content)))
            .collect();
        let mut text = String::new();
        write(
            &serde_json::json!({
                "method": self.method,
                "method_version": self.method_version,
                "model": model,
                "record_schema": self.record_schema,
                "settings": self.settings,
            }),
            &mut text,
        );
        text
    }
}

/// Lower-case hexadecimal SHA-256.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn write(value: &Value, text: &mut String) {
    match value {
        Value::Object(entries) => {
            // Sorted here, since the order within a map depends on features that any dependency may switch on.
            let mut sorted: Vec<(&String, &Value)> = entries.iter().collect();
            sorted.sort_by_key(|(key, _)| key.as_bytes());
            for (index, (key, value)) in sorted.into_iter().enumerate() {
                text.push(if index == 0 { '{' } else { ',' });
                text.push_str(&Value::from(key.as_str()).to_string());
                text.push(':');
                write(value, text);
            }
            text.push_str(if entries.is_empty() { "{}" } else { "}" });
        }
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                text.push(if index == 0 { '[' } else { ',' });
                write(item, text);
            }
            text.push_str(if items.is_empty() { "[]" } else { "]" });
        }
        Value::Number(number) if number.is_f64() && number.as_f64() == Some(0.0) => text.push_str("0.0"),
        other => text.push_str(&other.to_string()),
    }
}
