//! The plan: every job of an experiment with its key, checked before anything runs.

use super::file::Experiment;
use super::job::{Job, Key};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// One job of the plan.
#[derive(Clone, Debug)]
pub struct PlannedJob {
    /// Unique within the plan and fit for a file name: `ball-stretch`.
    pub name: String,
    /// The values of all axes in the order of the file, `model` included when it varies.
    pub axes: Vec<(String, Value)>,
    /// Absent when an optional model's file is missing.
    pub resolved: Option<(Key, Job)>,
    /// Where the input files of the job are, by role.
    pub inputs: BTreeMap<String, PathBuf>,
    /// Why `resolved` is absent.
    pub missing: Option<String>,
}

/// All jobs of an experiment.
pub struct Plan {
    pub experiment: Experiment,
    pub jobs: Vec<PlannedJob>,
    /// Skipped optional models and the like, told before anything runs.
    pub notices: Vec<String>,
}
