//! The experiment file, the plan that it unfolds into, the jobs with their keys, and the records that they leave.
//!
//! `Experiment` (the file) -> `Plan` (all jobs, every name and file checked) -> `Job` (fully resolved) -> `Record`.

pub mod check;
pub mod claims;
pub mod column;
pub mod diagnostic;
pub mod document;
pub mod file;
pub mod grid;
pub mod job;
pub mod nearest;
pub mod plan;
pub mod read;
pub mod record;
pub mod schema;
pub mod section;
pub mod template;
pub mod unit;
