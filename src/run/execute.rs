//! Computing one job within this process: its files are read and checked, its method runs, its times are taken.
//!
//! A panic becomes a failure with its message and place; the time limit and the wish to stop reach the method through its
//! observer.

use super::event::Progress;
use super::interrupt::Interrupt;
use super::protocol::{Effort, Message};
use super::provenance;
use super::store::{Artifacts, MESH, fingerprint};
use crate::experiment::job::{Job, JobPart, sha256};
use crate::experiment::record::{JobResult, Measurement, Phase, Status};
use crate::method::model::{LoadedModel, Part};
use crate::method::{Failure, Inputs, Method, Outcome};
use crate::optimize::{Iterate, Observer, StopReason};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// What a computation yields.
#[derive(Debug)]
pub struct Computed {
    pub result: JobResult,
    /// The files of the result by name: the mesh under [`MESH`], and what else the method wrote.
    pub files: Artifacts,
    pub measurement: Measurement,
    /// Fingerprints of the first repetition and of one that differs from it.
    pub differing: Option<(String, String)>,
}

/// How a computation ends.
#[derive(Debug)]
pub enum Ending {
    Computed(Box<Computed>),
    /// The interrupt was set; what there is must not be kept.
    Cancelled,
}

/// What bounds a computation, and who hears of it.
pub struct Bounds<'a> {
    pub effort: Effort,
    /// Wall seconds of each repetition.
    pub seconds: Option<f64>,
    pub interrupt: &'a Interrupt,
    /// Hears of repetitions, phases and iterates, at most about ten times a second.
    pub tell: &'a mut (dyn FnMut(Message) + Send),
}

/// Reads the files of a job and checks that they are those that it was planned with.
///
/// The error's kind is `input-unreadable` or `input-changed`.
pub fn load(job: &Job, inputs: &BTreeMap<String, PathBuf>) -> Result<LoadedModel, Failure> {
    let mut model = LoadedModel::default();
    for (role, part) in &job.model {
        let part = match part {
            JobPart::Generated { generator, parameters } => Part::Generated {
                generator: generator.clone(),
                parameters: parameters.clone(),
            },
            JobPart::File {
                sha256: planned,
                parameters,
                ..
            } => {
                let unreadable = |reason| Failure {
                    kind: "input-unreadable".into(),
                    reason,
                };
                let Some(path) = inputs.get(role) else {
                    return Err(unreadable(format!("no file was given for {role}")));
                };
                let name = path.display();
                let bytes = std::fs::read(path).map_err(|error| unreadable(format!("cannot read {name}: {error}")))?;
                let found = sha256(&bytes);
                if found != *planned {
                    return Err(Failure {
                        kind: "input-changed".into(),
                        reason: format!(
                            "{name} changed after the run was planned (SHA-256 {planned} then, {found} now); run again"
                        ),
                    });
                }
                Part::File {
                    // The bare name: a record says nothing of the folders of a machine.
                    name: path
                        .file_name()
                        .map_or_else(|| role.clone(), |name| name.to_string_lossy().into_owned()),
                    bytes,
                    parameters: parameters.clone(),
                }
            }
        };
        model.parts.insert(role.clone(), part);
    }
    Ok(model)
}

/// A result that says why there is none.
pub fn failure(stop: &str, reason: String) -> JobResult {
    JobResult {
        status: Status::Failed,
        stop: stop.into(),
        reason,
        metrics: BTreeMap::new(),
        traces: BTreeMap::new(),
        counters: BTreeMap::new(),
        notices: Vec::new(),
        artifacts: BTreeMap::new(),
    }
}

/// A measurement with nothing measured yet.
pub fn unmeasured(effort: Effort, inputs: &BTreeMap<String, PathBuf>) -> Measurement {
    let name = |path: &PathBuf| {
        path.file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    };
    Measurement {
        version: provenance::version().into(),
        commit: provenance::commit().into(),
        target: provenance::target(),
        host: provenance::host(),
        threads: effort.threads,
        started: provenance::now(),
        exclusive: effort.exclusive,
        wall_seconds: Vec::new(),
        cpu_seconds: Vec::new(),
        phases: Vec::new(),
        peak_memory: 0,
        inputs: inputs.iter().map(|(role, path)| (role.clone(), name(path))).collect(),
    }
}

/// One repetition's times.
struct Times {
    wall: f64,
    cpu: f64,
    phases: Vec<Phase>,
}

/// Runs a method as often as the effort says, on a pool of that many threads.
///
/// The result is that of the first repetition; a later one that differs ends the repetitions and is reported in
/// [`Computed::differing`]. Phases are those of the repetition with the median time.
pub fn execute(
    method: &dyn Method,
    job: &Job,
    model: LoadedModel,
    inputs: &BTreeMap<String, PathBuf>,
    bounds: Bounds<'_>,
) -> Ending {
    let mut measurement = unmeasured(bounds.effort, inputs);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(bounds.effort.threads.max(1))
        .thread_name(|index| format!("compute {index}"))
        .stack_size(8 << 20)
        .build();
    let pool = match pool {
        Ok(pool) => pool,
        Err(error) => {
            let reason = format!("cannot start {} threads: {error}", bounds.effort.threads);
            return computed(failure("not-started", reason), Artifacts::new(), measurement, None);
        }
    };
    let mut first: Option<(JobResult, Artifacts)> = None;
    let mut times: Vec<Times> = Vec::new();
    let mut differing = None;
    for repetition in 0..bounds.effort.repeat.max(1) {
        (bounds.tell)(Message::Repetition(repetition));
        let mut recorder = Recorder::new(bounds.interrupt, bounds.seconds, bounds.tell);
        let inputs = Inputs {
            settings: &job.settings,
            model: model.clone(),
        };
        let (wall, cpu) = (Instant::now(), provenance::cpu_seconds());
        let returned = catch_unwind(AssertUnwindSafe(|| pool.install(|| method.run(inputs, &mut recorder))));
        let (wall, cpu) = (wall.elapsed().as_secs_f64(), provenance::cpu_seconds() - cpu);
        let (stopped, phases) = recorder.finish();
        times.push(Times { wall, cpu, phases });
        // A method that was asked to stop may have ended in any way: what it returned depends on the clock.
        let cancelled = matches!(stopped, Some((StopReason::Cancelled, _)));
        if cancelled || bounds.interrupt.is_set() {
            return Ending::Cancelled;
        }
        let (result, files) = match returned {
            _ if stopped.is_some() => (
                time_limit(bounds.seconds, stopped.as_ref().map_or("", |(_, phase)| phase)),
                Artifacts::new(),
            ),
            Ok(Ok(outcome)) => done(outcome),
            Ok(Err(refusal)) => {
                let refused = JobResult {
                    status: Status::Refused,
                    ..failure(&refusal.kind, refusal.reason)
                };
                (refused, Artifacts::new())
            }
            Err(payload) => (failure("panicked", panic_reason(payload.as_ref())), Artifacts::new()),
        };
        let go_on = result.status != Status::Failed;
        match &first {
            None => first = Some((result, files)),
            Some(_) if !go_on => first = Some((result, Artifacts::new())),
            Some((former, _)) => {
                let fingerprints = (fingerprint(former), fingerprint(&result));
                if fingerprints.0 != fingerprints.1 {
                    differing = Some(fingerprints);
                    break;
                }
            }
        }
        if !go_on {
            break;
        }
    }
    measurement.wall_seconds = times.iter().map(|times| times.wall).collect();
    measurement.cpu_seconds = times.iter().map(|times| times.cpu).collect();
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by(|&a, &b| times[a].wall.total_cmp(&times[b].wall));
    if let Some(&median) = order.get(order.len().saturating_sub(1) / 2) {
        measurement.phases = times.swap_remove(median).phases;
    }
    measurement.peak_memory = provenance::peak_memory();
    match first {
        Some((result, files)) => computed(result, files, measurement, differing),
        None => Ending::Cancelled,
    }
}

fn computed(
    result: JobResult,
    files: Artifacts,
    measurement: Measurement,
    differing: Option<(String, String)>,
) -> Ending {
    Ending::Computed(Box::new(Computed {
        result,
        files,
        measurement,
        differing,
    }))
}

fn done(outcome: Outcome) -> (JobResult, Artifacts) {
    let mut files = outcome.files;
    files.extend(outcome.mesh.map(|bytes| (MESH.to_string(), bytes)));
    let artifacts = files.iter().map(|(name, bytes)| (name.clone(), sha256(bytes)));
    let result = JobResult {
        status: Status::Done,
        stop: outcome.stop,
        reason: outcome.reason,
        metrics: outcome.metrics,
        traces: outcome.traces,
        counters: outcome.counters,
        notices: outcome.notices,
        artifacts: artifacts.collect(),
    };
    (result, files)
}

/// `phase` may be empty, where the method named none.
fn time_limit(seconds: Option<f64>, phase: &str) -> JobResult {
    let phase = if phase.is_empty() {
        String::new()
    } else {
        format!(" in phase {phase}")
    };
    let limit = seconds.unwrap_or_default();
    failure(
        "time-limit",
        format!("stopped after {limit} s{phase}, the limit of each computation"),
    )
}

/// Listens to the method: takes times, passes progress on, and says when to stop.
struct Recorder<'a> {
    phases: Vec<Phase>,
    /// The running phase's index, and clock and processor time at its start.
    running: Option<(usize, Instant, f64)>,
    interrupt: &'a Interrupt,
    deadline: Option<Instant>,
    /// Why the method was asked to stop, and the index of the phase that ran then.
    stopped: Cell<Option<(StopReason, usize)>>,
    tell: &'a mut (dyn FnMut(Message) + Send),
    told: Option<Instant>,
    phase_told: Option<Instant>,
}

/// Between two messages of one kind.
const PAUSE: Duration = Duration::from_millis(100);

impl<'a> Recorder<'a> {
    fn new(interrupt: &'a Interrupt, seconds: Option<f64>, tell: &'a mut (dyn FnMut(Message) + Send)) -> Self {
        let span = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        Recorder {
            phases: Vec::new(),
            running: None,
            interrupt,
            deadline: span.and_then(|span| Instant::now().checked_add(span)),
            stopped: Cell::new(None),
            tell,
            told: None,
            phase_told: None,
        }
    }

    fn close(&mut self) {
        if let Some((index, wall, cpu)) = self.running.take() {
            let phase = &mut self.phases[index];
            phase.wall_seconds += wall.elapsed().as_secs_f64();
            phase.cpu_seconds += provenance::cpu_seconds() - cpu;
        }
    }

    /// Why and in which phase the method was asked to stop, and what the phases took.
    fn finish(mut self) -> (Option<(StopReason, String)>, Vec<Phase>) {
        self.close();
        let name = |phase: usize| self.phases.get(phase).map_or(String::new(), |phase| phase.name.clone());
        let stopped = self.stopped.get().map(|(reason, phase)| (reason, name(phase)));
        (stopped, self.phases)
    }
}

impl Observer for Recorder<'_> {
    fn phase(&mut self, name: &str) {
        self.close();
        let known = self.phases.iter().position(|phase| phase.name == name);
        // A phase is always told when it is entered first; phases that alternate quickly would flood the reader.
        if known.is_none() || self.phase_told.is_none_or(|told| told.elapsed() >= PAUSE) {
            self.phase_told = Some(Instant::now());
            (self.tell)(Message::Phase(name.into()));
        }
        let index = known.unwrap_or(self.phases.len());
        if known.is_none() {
            self.phases.push(Phase {
                name: name.into(),
                wall_seconds: 0.0,
                cpu_seconds: 0.0,
            });
        }
        self.running = Some((index, Instant::now(), provenance::cpu_seconds()));
    }

    fn iterate(&mut self, iterate: &Iterate) {
        if self.told.is_some_and(|told| told.elapsed() < PAUSE) {
            return;
        }
        self.told = Some(Instant::now());
        (self.tell)(Message::Iterate(Progress {
            iteration: iterate.iteration,
            energy: Some(iterate.energy).filter(|value| value.is_finite()),
            gradient_norm: Some(iterate.gradient_norm).filter(|value| value.is_finite()),
        }));
    }

    fn stop(&self) -> Option<StopReason> {
        if self.stopped.get().is_none() {
            let phase = self.running.map_or(usize::MAX, |(index, ..)| index);
            if self.interrupt.is_set() {
                self.stopped.set(Some((StopReason::Cancelled, phase)));
            } else if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                self.stopped.set(Some((StopReason::TimeLimit, phase)));
            }
        }
        self.stopped.get().map(|(reason, _)| reason)
    }
}

/// The first panic since the hook was set: message and place.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Keeps panics for the record instead of printing them. For a process that computes a job.
pub fn catch_panics_quietly() {
    std::panic::set_hook(Box::new(|information| {
        let message = message_of(information.payload());
        let place = information.location().map_or_else(String::new, |location| {
            format!(
                " at {}:{}:{}",
                relative(location.file()),
                location.line(),
                location.column()
            )
        });
        if let Ok(mut first) = PANIC.lock() {
            first.get_or_insert_with(|| format!("{message}{place}"));
        }
    }));
}

fn panic_reason(payload: &(dyn std::any::Any + Send)) -> String {
    let kept = PANIC.lock().ok().and_then(|mut first| first.take());
    let text = kept.unwrap_or_else(|| message_of(payload));
    format!("a fault of vargeo, please report it: {text}")
}

fn message_of(payload: &(dyn std::any::Any + Send)) -> String {
    if let Some(text) = payload.downcast_ref::<&str>() {
        (*text).to_string()
    } else if let Some(text) = payload.downcast_ref::<String>() {
        text.clone()
    } else {
        "panic without a message".into()
    }
}

/// A source file's place within its crate, without the folders of the machine that built it.
fn relative(file: &str) -> &str {
    match file.rfind("/src/") {
        Some(end) if file.starts_with('/') => {
            let start = file[..end].rfind('/').map_or(0, |slash| slash + 1);
            &file[start..]
        }
        _ => file,
    }
}
