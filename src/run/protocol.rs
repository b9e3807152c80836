//! What a run and its job processes say to each other: one request on standard input, one message a line on standard
//! output.

use super::event::Progress;
use crate::experiment::job::{Job, Key};
use crate::experiment::record::Record;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Everything that a job process needs; nothing is planned again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    pub key: Key,
    pub job: Job,
    /// Files by role.
    pub inputs: BTreeMap<String, PathBuf>,
    /// Root of the store.
    pub store: PathBuf,
    pub effort: Effort,
    /// Wall seconds of each repetition.
    pub seconds: Option<f64>,
    /// Resident memory in bytes.
    pub memory: Option<u64>,
    /// Computed and compared even if the store has it.
    pub force: bool,
    /// While another process computes the job: wait for its result, rather than answer [`Message::Busy`].
    pub wait: bool,
    /// The process that asks; the job does not outlive it.
    pub parent: u32,
}

/// How a job is computed, as far as it concerns times only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Effort {
    pub threads: usize,
    pub repeat: u32,
    /// With the machine to itself.
    pub exclusive: bool,
}

impl Effort {
    /// Whether the times of a stored record are what is asked for: at least as many repetitions, and, where times are
    /// taken exclusively, taken exclusively and with as many threads.
    pub fn is_met_by(&self, record: &Record) -> bool {
        let stored = &record.measurement;
        let enough = stored.wall_seconds.len() >= self.repeat.max(1) as usize;
        enough && (!self.exclusive || (stored.exclusive && stored.threads == self.threads))
    }
}

/// What a job process reports.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Message {
    /// Another process holds the job; ask again later.
    Busy,
    /// Nothing is computed yet, for this reason.
    Waiting(String),
    /// A repetition begins, and with it the time that is limited.
    Repetition(u32),
    Phase(String),
    Iterate(Progress),
    Warning(String),
    /// The last message: the record, and whether it was in the store already.
    Finished {
        record: Box<Record>,
        cached: bool,
    },
    /// The last message after a wish to stop.
    Cancelled,
}
