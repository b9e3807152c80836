//! The experiment file, the plan that it unfolds into, the jobs with their keys, and the records that they leave.
//!
//! `Experiment` (the file) -> `Plan` (all jobs, every name and file checked) -> `Job` (fully resolved) -> `Record`.

pub mod file;
pub mod job;
pub mod plan;
pub mod record;
