//! The pool: looks up what is stored, and runs a process for every job that is not, some side by side, timed ones alone.

use super::child::{Heard, Killed, Running};
use super::event::{Event, Listener};
use super::execute::{failure, unmeasured};
use super::interrupt::Interrupt;
use super::job::{damage, memory_reason};
use super::protocol::{Effort, Message, Request};
use super::provenance;
use super::store::{Lookup, Store, StoreError};
use crate::experiment::job::{Job, Key};
use crate::experiment::plan::{Plan, PlannedJob};
use crate::experiment::record::{JobResult, Record, Status};
use rayon::prelude::*;
use std::collections::{BTreeMap, VecDeque};
use std::ffi::OsString;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Between two looks at the running processes, where memory is limited and where it is not.
const LOOK: (Duration, Duration) = (Duration::from_millis(20), Duration::from_millis(50));
/// From the wish to stop until running processes are killed.
const PATIENCE: Duration = Duration::from_secs(1);
/// Between two tries of a job that another process computes.
const RETRY: Duration = Duration::from_millis(100);

/// What is started for each job; it is given a [`Request`] and answers in [`Message`]s.
#[derive(Clone, Debug)]
pub struct Program {
    pub path: PathBuf,
    pub arguments: Vec<OsString>,
}

impl Program {
    /// This very program as `vargeo job`.
    pub fn this() -> std::io::Result<Self> {
        let running = PathBuf::from("/proc/self/exe");
        // Named so, it stays the same program for the whole run even if its file is replaced meanwhile.
        let path = if running.exists() {
            running
        } else {
            std::env::current_exe()?
        };
        Ok(Program {
            path,
            arguments: vec!["job".into()],
        })
    }
}

/// How a plan is run.
#[derive(Clone, Debug)]
pub struct Options {
    pub store: Store,
    pub program: Program,
    /// Jobs side by side; as many as the cores permit when absent.
    pub side_by_side: Option<usize>,
    /// Threads of each job; what the experiment says when absent.
    pub threads: Option<usize>,
    /// Compute everything again and compare with what is stored.
    pub force: bool,
    /// Compute only these jobs of the plan; the others are returned as far as they are stored.
    pub only: Option<Vec<usize>>,
    pub interrupt: Interrupt,
}

/// A job's record, and whether it came from the store.
#[derive(Clone, Debug)]
pub struct Finished {
    /// The job's place in the plan.
    pub index: usize,
    pub record: Record,
    pub cached: bool,
}

/// What a run leaves.
#[derive(Debug, Default)]
pub struct Run {
    /// In the order of the plan. Jobs that were not asked for and are not stored are absent, and so are, after an
    /// interruption, those that did not finish.
    pub finished: Vec<Finished>,
    pub interrupted: bool,
    /// Damage, results that are not deterministic, records that could not be written.
    pub warnings: Vec<String>,
}

/// What is sent to a process, and whom its record is for.
struct Task {
    /// Places in the plan: several when jobs of the plan resolve to the same.
    indices: Vec<usize>,
    name: String,
    key: Key,
    job: Job,
    inputs: BTreeMap<String, PathBuf>,
    /// Not started again before this instant, since another process computes it.
    not_before: Option<Instant>,
}

/// Threads, repetitions and exclusiveness that a plan asks for.
pub fn effort(plan: &Plan, threads: Option<usize>) -> Effort {
    let timing = plan.experiment.timing;
    let own = timing.threads.map(|threads| threads as usize);
    let silent = if timing.exclusive { provenance::cores() } else { 1 };
    Effort {
        threads: threads.or(own).unwrap_or(silent).max(1),
        repeat: timing.repeat.max(1),
        exclusive: timing.exclusive,
    }
}

/// Looks a job up as a run would: its record if the store has what is asked for.
pub fn stored(store: &Store, job: &PlannedJob, effort: Effort) -> Lookup {
    match &job.resolved {
        None => Lookup::Miss,
        Some((key, _)) => match store.lookup(key) {
            Lookup::Hit(record) if !effort.is_met_by(&record) => Lookup::Miss,
            other => other,
        },
    }
}

/// The record of a job whose optional model is missing. It has no key: nothing was resolved.
pub fn skipped(plan: &Plan, job: &PlannedJob, effort: Effort) -> Record {
    let experiment = &plan.experiment;
    let reason = job.missing.clone().unwrap_or_else(|| "its model is missing".into());
    Record {
        key: Key(String::new()),
        job: Job {
            record_schema: crate::experiment::record::RECORD_SCHEMA,
            method: experiment.method.name().into(),
            method_version: experiment.method.version(),
            model: BTreeMap::new(),
            settings: serde_json::Value::Object(serde_json::Map::new()),
        },
        result: JobResult {
            status: Status::Skipped,
            ..failure("missing-model", reason)
        },
        measurement: unmeasured(effort, &job.inputs),
    }
}

/// Runs every job of a plan that the store does not hold, and returns a record for each.
///
/// Errors only when the store cannot be written at all. Call it from a thread that lives as long as the run: the job
/// processes end with it.
pub fn run_plan(plan: &Plan, options: &Options, listener: &mut dyn Listener) -> Result<Run, StoreError> {
    let effort = effort(plan, options.threads);
    let mut pool = Pool {
        plan,
        options,
        effort,
        listener,
        run: Run::default(),
        queue: VecDeque::new(),
        running: BTreeMap::new(),
        started: 0,
        stopping: None,
    };
    pool.look_up();
    if !pool.queue.is_empty() {
        options.store.prepare()?;
        pool.work();
    }
    let mut run = pool.run;
    run.finished.sort_by_key(|finished| finished.index);
    Ok(run)
}

struct Pool<'a> {
    plan: &'a Plan,
    options: &'a Options,
    effort: Effort,
    listener: &'a mut dyn Listener,
    run: Run,
    queue: VecDeque<Task>,
    running: BTreeMap<usize, (Task, Running)>,
    /// Processes started so far.
    started: usize,
    /// When the wish to stop was seen, and whether patience is at an end.
    stopping: Option<Instant>,
}

impl Pool<'_> {
    fn side_by_side(&self) -> usize {
        if self.effort.exclusive {
            1
        } else {
            let room = (provenance::cores() / self.effort.threads).max(1);
            self.options.side_by_side.unwrap_or(room).max(1)
        }
    }

    fn warn(&mut self, text: String) {
        self.listener.event(&Event::Warning { text: &text });
        self.run.warnings.push(text);
    }

    fn finish(&mut self, index: usize, record: Record, cached: bool) {
        self.listener.event(&Event::Finished {
            index,
            name: &self.plan.jobs[index].name,
            record: &record,
            cached,
        });
        self.run.finished.push(Finished { index, record, cached });
    }

    /// Fills the queue with what the store does not hold.
    fn look_up(&mut self) {
        let jobs = &self.plan.jobs;
        let options = self.options;
        let wanted = |index: usize| options.only.as_ref().is_none_or(|only| only.contains(&index));
        let effort = self.effort;
        let found: Vec<Lookup> = jobs
            .par_iter()
            .enumerate()
            .map(|(index, job)| match options.force && wanted(index) {
                true => Lookup::Miss,
                false => stored(&options.store, job, effort),
            })
            .collect();
        let mut tasks: BTreeMap<Key, usize> = BTreeMap::new();
        let mut warnings = Vec::new();
        let mut finished = Vec::new();
        for (index, (job, found)) in jobs.iter().zip(found).enumerate() {
            let Some((key, resolved)) = &job.resolved else {
                finished.push((index, skipped(self.plan, job, self.effort), false));
                continue;
            };
            match found {
                Lookup::Hit(record) => {
                    finished.push((index, *record, true));
                    continue;
                }
                Lookup::Damaged { reason, quarantine } => warnings.push(damage(&key.0, &reason, &quarantine)),
                Lookup::Miss => {}
            }
            if !wanted(index) {
                continue;
            }
            match tasks.get(key) {
                Some(&place) => self.queue[place].indices.push(index),
                None => {
                    tasks.insert(key.clone(), self.queue.len());
                    self.queue.push_back(Task {
                        indices: vec![index],
                        name: job.name.clone(),
                        key: key.clone(),
                        job: resolved.clone(),
                        inputs: job.inputs.clone(),
                        not_before: None,
                    });
                }
            }
        }
        let stored = finished.iter().filter(|(_, _, cached)| *cached).count();
        self.listener.event(&Event::Planned {
            jobs: jobs.len(),
            stored,
            skipped: finished.len() - stored,
            missing: self.queue.iter().map(|task| task.indices.len()).sum(),
            side_by_side: self.side_by_side(),
            threads: self.effort.threads,
        });
        warnings.into_iter().for_each(|text| self.warn(text));
        for (index, record, cached) in finished {
            self.finish(index, record, cached);
        }
    }

    fn work(&mut self) {
        let (sender, receiver) = channel();
        loop {
            self.heed_interrupt();
            if self.stopping.is_none() {
                self.start_what_fits(&sender);
            }
            if self.running.is_empty() && (self.queue.is_empty() || self.stopping.is_some()) {
                return;
            }
            self.listen(&receiver);
            self.reap();
        }
    }

    fn heed_interrupt(&mut self) {
        if !self.options.interrupt.is_set() {
            return;
        }
        match self.stopping {
            None => {
                self.stopping = Some(Instant::now());
                self.run.interrupted = true;
                let running = self.running.len();
                self.listener.event(&Event::Interrupted { running });
                self.running.values().for_each(|(_, process)| process.terminate());
            }
            Some(since) if since.elapsed() > PATIENCE => {
                for (_, process) in self.running.values_mut() {
                    process.kill(Killed::Interrupted);
                }
            }
            Some(_) => {}
        }
    }

    fn start_what_fits(&mut self, sender: &Sender<(usize, Heard)>) {
        while self.running.len() < self.side_by_side() {
            let now = Instant::now();
            let ready = |task: &Task| task.not_before.is_none_or(|instant| now >= instant);
            let Some(place) = self.queue.iter().position(ready) else {
                return;
            };
            let Some(mut task) = self.queue.remove(place) else {
                return;
            };
            // A job that another process holds is left for later while there are others. When only such jobs remain
            // and nothing runs, one process waits for the holder, and takes over if it dies.
            let wait = self.queue.is_empty() && self.running.is_empty();
            if !wait && self.options.store.is_locked(&task.key) {
                task.not_before = Some(now + RETRY);
                self.queue.push_back(task);
                continue;
            }
            let limits = self.plan.experiment.limits;
            let request = Request {
                key: task.key.clone(),
                job: task.job.clone(),
                inputs: task.inputs.clone(),
                store: self.options.store.root().to_path_buf(),
                effort: self.effort,
                seconds: limits.seconds,
                memory: limits.memory,
                force: self.options.force,
                wait,
                parent: std::process::id(),
            };
            let number = self.started;
            self.started += 1;
            match Running::start(&self.options.program, &request, number, sender) {
                Ok(process) => {
                    self.listener.event(&Event::Started {
                        index: task.indices[0],
                        name: &task.name,
                    });
                    self.running.insert(number, (task, process));
                }
                Err(error) => {
                    let reason = format!("cannot start {}: {error}", self.options.program.path.display());
                    let record = self.record(&task, failure("not-started", reason), None);
                    self.keep_failure(task, record);
                }
            }
        }
    }

    /// Waits for news, but not for long, and passes on all that have come.
    fn listen(&mut self, receiver: &Receiver<(usize, Heard)>) {
        let limited = self.running.values().any(|(_, process)| process.is_memory_limited());
        let pause = if limited { LOOK.0 } else { LOOK.1 };
        // The pool holds a sender, so the channel never closes while it listens.
        let Ok(first) = receiver.recv_timeout(pause) else {
            return;
        };
        for (number, heard) in std::iter::once(first).chain(receiver.try_iter()) {
            let Some((task, process)) = self.running.get_mut(&number) else {
                continue;
            };
            let (index, name) = (task.indices[0], task.name.as_str());
            if let Heard::Message(message) = &heard {
                match message {
                    Message::Waiting(reason) => self.listener.event(&Event::Waiting { index, name, reason }),
                    &Message::Repetition(repetition) => {
                        self.listener.event(&Event::Repetition {
                            index,
                            name,
                            repetition,
                        });
                    }
                    Message::Phase(phase) => self.listener.event(&Event::Phase { index, name, phase }),
                    &Message::Iterate(progress) => self.listener.event(&Event::Iterate { index, name, progress }),
                    Message::Warning(text) => {
                        let text = format!("{name}: {text}");
                        self.listener.event(&Event::Warning { text: &text });
                        self.run.warnings.push(text);
                    }
                    Message::Busy | Message::Finished { .. } | Message::Cancelled => {}
                }
            }
            process.hear(heard);
        }
    }

    /// Takes leave of the processes that have ended.
    fn reap(&mut self) {
        let over: Vec<(usize, ExitStatus)> = self
            .running
            .iter_mut()
            .filter_map(|(&number, (_, process))| Some((number, process.look()?)))
            .collect();
        for (number, status) in over {
            if let Some((task, process)) = self.running.remove(&number) {
                self.conclude(task, process, status);
            }
        }
    }

    fn conclude(&mut self, mut task: Task, mut process: Running, status: ExitStatus) {
        let result = match (process.last.take(), process.killed) {
            (Some(Message::Finished { record, cached }), _) if record.key == task.key => {
                match record.result.status {
                    Status::Failed => self.keep_failure(task, *record),
                    _ => self.deliver(task, *record, cached),
                }
                return;
            }
            (Some(Message::Busy), _) => {
                task.not_before = Some(Instant::now() + RETRY);
                self.queue.push_back(task);
                return;
            }
            // Asked to stop, it stopped: the job is simply not finished.
            _ if self.stopping.is_some() => return,
            (Some(Message::Cancelled), _) => failure("cancelled", "its process was asked to stop from outside".into()),
            (_, Some(Killed::MemoryLimit { used })) => failure(
                "memory-limit",
                memory_reason(used, self.plan.experiment.limits.memory.unwrap_or_default()),
            ),
            (_, Some(Killed::TimeLimit)) => {
                let limit = self.plan.experiment.limits.seconds.unwrap_or_default();
                failure(
                    "time-limit",
                    format!("killed{}; limits.time allows {limit} s", place(&process)),
                )
            }
            (_, Some(Killed::Interrupted) | None) => self.crash(&process, status),
        };
        let record = self.record(&task, result, Some(&process));
        self.keep_failure(task, record);
    }

    /// What a process's end without a result says.
    fn crash(&self, process: &Running, status: ExitStatus) -> JobResult {
        let memory = self.plan.experiment.limits.memory;
        if let (Some(limit), true) = (memory, process.errors.contains("memory allocation of")) {
            let tail = format!(
                "{}, and an allocation beyond that failed",
                memory_reason(process.peak_memory, limit)
            );
            return failure("memory-limit", tail);
        }
        let end = match (status.signal(), status.code()) {
            (Some(signal), _) => format!("ended by signal {signal}{}", signal_name(signal)),
            (None, Some(code)) => format!("ended with exit code {code} and without a result"),
            (None, None) => "ended without a result".into(),
        };
        let said = [&process.errors, &process.noise]
            .into_iter()
            .filter_map(|text| text.lines().rev().find(|line| !line.trim().is_empty()))
            .next()
            .map_or_else(String::new, |line| format!("; its last words: {}", line.trim()));
        failure("crashed", format!("its process {end}{}{said}", place(process)))
    }

    fn record(&self, task: &Task, result: JobResult, process: Option<&Running>) -> Record {
        let mut measurement = unmeasured(self.effort, &task.inputs);
        if let Some(process) = process {
            measurement.wall_seconds = vec![process.started.elapsed().as_secs_f64()];
            measurement.peak_memory = process.peak_memory;
        }
        Record {
            key: task.key.clone(),
            job: task.job.clone(),
            result,
            measurement,
        }
    }

    fn keep_failure(&mut self, task: Task, record: Record) {
        if let Err(error) = self.options.store.record_failure(&record) {
            self.warn(format!("{}: {error}", task.name));
        }
        self.deliver(task, record, false);
    }

    /// Gives a record to every job of the plan that it is for.
    fn deliver(&mut self, task: Task, record: Record, cached: bool) {
        for (count, &index) in task.indices.iter().enumerate() {
            self.finish(index, record.clone(), cached || count > 0);
        }
    }
}

/// Where a process was when it ended.
fn place(process: &Running) -> String {
    let seconds = process.started.elapsed().as_secs_f64();
    let mut text = format!(" after {seconds:.1} s");
    if let Some(phase) = &process.phase {
        text += &format!(" in phase {phase}");
    }
    if let Some(progress) = &process.progress {
        text += &format!(" near iteration {}", progress.iteration);
    }
    text
}

/// The name of a signal in brackets, where it tells more than its number.
fn signal_name(signal: i32) -> &'static str {
    match rustix::process::Signal::from_named_raw(signal) {
        Some(rustix::process::Signal::SEGV) => " (SIGSEGV, invalid memory access)",
        Some(rustix::process::Signal::ABORT) => " (SIGABRT)",
        Some(rustix::process::Signal::KILL) => " (SIGKILL; the system does so when memory runs out)",
        Some(rustix::process::Signal::ILL) => " (SIGILL, illegal instruction)",
        Some(rustix::process::Signal::BUS) => " (SIGBUS, a mapped file or memory failed)",
        Some(rustix::process::Signal::FPE) => " (SIGFPE)",
        Some(rustix::process::Signal::TERM) => " (SIGTERM)",
        Some(rustix::process::Signal::XFSZ) => " (SIGXFSZ, a file grew beyond the permitted size)",
        Some(rustix::process::Signal::XCPU) => " (SIGXCPU, processor time used up)",
        _ => "",
    }
}
