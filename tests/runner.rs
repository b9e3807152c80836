//! The runner's promises: every end of a job is a record and stops nobody else, limits hold, what is finished is kept.
//!
//! The jobs run in real processes: this test binary, started anew, serves the methods below.

use crate::store::{folder, this_test};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use vargeo::experiment::file::{Experiment, Limits, Timing};
use vargeo::experiment::job::{Job, Key};
use vargeo::experiment::plan::{Plan, PlannedJob};
use vargeo::experiment::record::{RECORD_SCHEMA, Record, Status};
use vargeo::method::model::{ModelKind, Part};
use vargeo::method::setting::Field;
use vargeo::method::{Failure, Inputs, Method, Outcome};
use vargeo::metric::Metric;
use vargeo::optimize::{Iterate, Observer, StopReason};
use vargeo::run::event::{Event, Listener, Nobody};
use vargeo::run::execute::{Bounds, Ending, execute};
use vargeo::run::interrupt::Interrupt;
use vargeo::run::protocol::{Effort, Message};
use vargeo::run::store::{Lookup, MESH, Store};
use vargeo::run::{Options, Program, Run, run_plan};

/// A method whose settings say what goes well or wrong.
struct Behaving;

impl Method for Behaving {
    fn name(&self) -> &'static str {
        "behaving"
    }
    fn version(&self) -> u32 {
        1
    }
    fn summary(&self) -> &'static str {
        "ends in every way there is"
    }
    fn source(&self) -> &'static str {
        "none"
    }
    fn model(&self) -> &'static ModelKind {
        &ModelKind { roles: &[] }
    }
    fn settings(&self) -> &'static [Field] {
        &[]
    }
    fn metrics(&self) -> &'static [Metric] {
        &[]
    }

    fn run(&self, inputs: Inputs<'_>, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let text = |name: &str| inputs.settings[name].as_str().unwrap_or_default().to_string();
        note(&text("log"), "begin");
        observer.phase("prepare");
        observer.phase("behave");
        let iterate = |iteration, energy| Iterate {
            iteration,
            energy,
            gradient_norm: 1.0,
            step: 1.0,
        };
        observer.iterate(&iterate(17, f64::NAN));
        let mut value = 0.0;
        match text("behaviour").as_str() {
            "well" => {}
            "slow" => std::thread::sleep(Duration::from_millis(250)),
            "panic" => panic!("a made-up fault"),
            "hang" => std::thread::sleep(Duration::from_secs(600)),
            "obedient" => {
                while observer.stop().is_none() {
                    std::thread::sleep(Duration::from_millis(5));
                }
                // Even one that claims success after it was told to stop must not be believed.
                assert!(matches!(
                    observer.stop(),
                    Some(StopReason::TimeLimit | StopReason::Cancelled)
                ));
            }
            "hog" => {
                let mut held = Vec::new();
                loop {
                    held.push(vec![1_u8; 1 << 20]);
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
            "gulp" => drop(std::hint::black_box(vec![1_u8; 64 << 30])),
            "abort" => std::process::abort(),
            "signal" => {
                let this = rustix::process::getpid();
                let _ = rustix::process::kill_process(this, rustix::process::Signal::ILL);
                std::thread::sleep(Duration::from_secs(1));
            }
            "recursion" => value = recurse(1.0),
            "exit" => std::process::exit(5),
            "not-finite" => {
                return Err(Failure {
                    kind: "not-finite".into(),
                    reason: "the energy of the start is not finite".into(),
                });
            }
            "clock" => value = std::time::UNIX_EPOCH.elapsed().unwrap().as_secs_f64(),
            "length" => match inputs.model.parts.get("mesh") {
                Some(Part::File { bytes, .. }) => value = bytes.len() as f64,
                other => panic!("no file: {other:?}"),
            },
            "threads" => value = rayon::current_num_threads() as f64,
            other => panic!("no behaviour {other}"),
        }
        note(&text("log"), "end");
        Ok(Outcome {
            stop: "converged".into(),
            metrics: [("value".to_string(), value)].into(),
            mesh: Some(b"mesh".to_vec()),
            files: [("notes.txt".to_string(), b"notes".to_vec())].into(),
            ..Outcome::default()
        })
    }
}

/// Uses up the stack.
#[allow(unconditional_recursion)]
fn recurse(value: f64) -> f64 {
    let room = std::hint::black_box([value; 1000]);
    recurse(room[999]) + room[0]
}

/// Appends a word to a file; one write of few bytes is not interleaved with others.
fn note(log: &str, word: &str) {
    use std::io::Write;
    if !log.is_empty() {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(log).unwrap();
        file.write_all(format!("{word}\n").as_bytes()).unwrap();
    }
}

const JOB: &str = "VARGEO_TEST_JOB";

/// Not a test of its own: the process of one job.
#[test]
fn job_process() {
    if std::env::var_os(JOB).is_some() {
        let served = vargeo::run::job::serve(&|name| (name == Behaving.name()).then_some(&Behaving as &dyn Method));
        std::process::exit(if served { 0 } else { 1 });
    }
}

/// Starts [`job_process`], after the given shell commands.
fn program(before: &str) -> Program {
    let this = std::env::current_exe().unwrap();
    let script =
        format!("{before} {JOB}=1 exec \"$0\" runner::job_process --exact --nocapture --quiet --test-threads 1");
    shell(&script, &[this])
}

fn shell(script: &str, arguments: &[PathBuf]) -> Program {
    let mut all = vec!["-c".into(), script.into()];
    all.extend(arguments.iter().map(Into::into));
    Program {
        path: "/bin/sh".into(),
        arguments: all,
    }
}

/// A plan of jobs with these settings.
pub(crate) fn plan(settings: &[Value], limits: Limits, timing: Timing) -> Plan {
    let jobs = settings
        .iter()
        .enumerate()
        .map(|(number, settings)| planned(&format!("job-{number}"), job(settings.clone()), BTreeMap::new()));
    Plan {
        jobs: jobs.collect(),
        experiment: Experiment {
            name: "test".into(),
            title: String::new(),
            description: String::new(),
            method: &Behaving,
            claims: Vec::new(),
            models: Vec::new(),
            settings: json!({}),
            axes: Vec::new(),
            zips: Vec::new(),
            excludes: Vec::new(),
            limits,
            timing,
            tables: Vec::new(),
            plots: Vec::new(),
            rates: Vec::new(),
            expectations: Vec::new(),
            origin: Default::default(),
        },
        notices: Vec::new(),
    }
}

pub(crate) fn job(settings: Value) -> Job {
    Job {
        record_schema: RECORD_SCHEMA,
        method: "behaving".into(),
        method_version: 1,
        model: BTreeMap::new(),
        settings,
    }
}

pub(crate) fn planned(name: &str, job: Job, inputs: BTreeMap<String, PathBuf>) -> PlannedJob {
    let key = Key::of(&job);
    PlannedJob {
        name: name.into(),
        axes: Vec::new(),
        resolved: Some((key, job)),
        inputs,
        missing: None,
    }
}

pub(crate) fn behaviours(names: &[&str]) -> Vec<Value> {
    names.iter().map(|name| json!({ "behaviour": name })).collect()
}

pub(crate) const UNTIMED: Timing = Timing {
    exclusive: false,
    repeat: 1,
    threads: None,
};

pub(crate) fn options(folder: &Path) -> Options {
    Options {
        store: Store::new(folder.join("store")),
        program: program(""),
        side_by_side: Some(4),
        threads: None,
        force: false,
        only: None,
        interrupt: Interrupt::default(),
    }
}

pub(crate) fn record(run: &Run, index: usize) -> &Record {
    let found = run.finished.iter().find(|finished| finished.index == index);
    &found.unwrap_or_else(|| panic!("job {index} has no record")).record
}

pub(crate) fn lines(log: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(log).unwrap_or_default();
    text.lines().map(String::from).collect()
}

#[test]
fn every_end_of_a_job_is_a_record_and_the_rest_go_on() {
    let folder = folder();
    let limits = Limits {
        seconds: Some(2.0),
        memory: Some(150 << 20),
    };
    let names: [&str; 12] = [
        "well",
        "panic",
        "hang",
        "obedient",
        "hog",
        "abort",
        "signal",
        "exit",
        "not-finite",
        "gulp",
        "slow",
        "recursion",
    ];
    let mut plan = plan(&behaviours(&names), limits, UNTIMED);
    plan.jobs.push(PlannedJob {
        name: "missing".into(),
        axes: Vec::new(),
        resolved: None,
        inputs: BTreeMap::new(),
        missing: Some("models/duck.mesh is missing".into()),
    });
    let options = options(folder.path());
    let run = run_plan(&plan, &options, &mut Nobody).unwrap();
    let ends: Vec<(&str, Status, &str)> = run
        .finished
        .iter()
        .map(|finished| {
            let name = names.get(finished.index).copied().unwrap_or("missing");
            let result = &finished.record.result;
            (name, result.status, result.stop.as_str())
        })
        .collect();
    use Status::{Done, Failed, Refused, Skipped};
    assert_eq!(
        ends,
        [
            ("well", Done, "converged"),
            ("panic", Failed, "panicked"),
            ("hang", Failed, "time-limit"),
            ("obedient", Failed, "time-limit"),
            ("hog", Failed, "memory-limit"),
            ("abort", Failed, "crashed"),
            ("signal", Failed, "crashed"),
            ("exit", Failed, "crashed"),
            ("not-finite", Refused, "not-finite"),
            ("gulp", Failed, "memory-limit"),
            ("slow", Done, "converged"),
            ("recursion", Failed, "crashed"),
            ("missing", Skipped, "missing-model"),
        ]
    );
    let reason = |index: usize| record(&run, index).result.reason.as_str();
    assert!(
        reason(1).contains("a made-up fault at tests/runner.rs:"),
        "{}",
        reason(1)
    );
    assert!(reason(2).contains("in phase behave near iteration 17"), "{}", reason(2));
    assert!(reason(5).contains("SIGABRT"), "{}", reason(5));
    assert!(reason(6).contains("SIGILL"), "{}", reason(6));
    assert!(reason(7).contains("exit code 5"), "{}", reason(7));
    assert!(reason(11).contains("stack overflow"), "{}", reason(11));
    assert_eq!(reason(12), "models/duck.mesh is missing");
    let well = &record(&run, 0).measurement;
    let phases: Vec<&str> = well.phases.iter().map(|phase| phase.name.as_str()).collect();
    assert_eq!(phases, ["prepare", "behave"]);
    assert!(well.peak_memory > 1 << 20 && well.wall_seconds.len() == 1);
    let mesh = options.store.entry(&record(&run, 0).key).join(MESH);
    assert_eq!(std::fs::read(mesh).unwrap(), b"mesh");

    // The second run takes what is finished from the store, and tries the failures again.
    let kept = options
        .store
        .failure(&record(&run, 1).key)
        .expect("the failure is kept");
    assert_eq!(kept.result.stop, "panicked");
    let cached: Vec<&str> = {
        plan.jobs.truncate(2);
        plan.jobs.push(planned(
            "not-finite",
            job(json!({ "behaviour": "not-finite" })),
            BTreeMap::new(),
        ));
        let run = run_plan(&plan, &options, &mut Nobody).unwrap();
        let cached = run.finished.iter().filter(|finished| finished.cached);
        cached.map(|finished| plan.jobs[finished.index].name.as_str()).collect()
    };
    assert_eq!(cached, ["job-0", "not-finite"]);
}

#[test]
fn a_process_that_does_not_answer_is_a_crash() {
    let folder = folder();
    let limits = Limits {
        seconds: Some(0.2),
        memory: None,
    };
    let cases = [
        ("true", "crashed", "exit code 0 and without a result"),
        (
            "cat > /dev/null; echo garbage; exit 3",
            "crashed",
            "last words: garbage",
        ),
        (
            "echo '{\"phase\":\"talk\"}'; echo oops >&2; kill -9 $$",
            "crashed",
            "in phase talk; its last words: oops",
        ),
        // Its output is closed, and it goes on.
        ("exec >&- 2>&-; sleep 30", "time-limit", "limits.time allows 0.2 s"),
        // A grandchild keeps the pipes open after the end.
        ("sleep 30 & exit 4", "crashed", "exit code 4"),
        ("no-such-program-at-all", "crashed", "exit code 127"),
    ];
    for (script, stop, reason) in cases {
        let started = Instant::now();
        let options = Options {
            program: shell(script, &[]),
            ..options(folder.path())
        };
        let run = run_plan(&plan(&behaviours(&["well"]), limits, UNTIMED), &options, &mut Nobody).unwrap();
        let result = &record(&run, 0).result;
        assert_eq!(result.stop, stop, "{script}: {}", result.reason);
        assert!(result.reason.contains(reason), "{script}: {}", result.reason);
        assert!(started.elapsed() < Duration::from_secs(6), "{script}");
    }
    let options = Options {
        program: Program {
            path: "/no/such/program".into(),
            arguments: Vec::new(),
        },
        ..options(folder.path())
    };
    let run = run_plan(&plan(&behaviours(&["well"]), limits, UNTIMED), &options, &mut Nobody).unwrap();
    assert_eq!(record(&run, 0).result.stop, "not-started");
}

/// Interrupts a run when its first job has finished.
struct InterruptAfterFirst(Interrupt, Option<Instant>);

impl Listener for InterruptAfterFirst {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Finished { .. } = event {
            self.0.set();
            self.1.get_or_insert_with(Instant::now);
        }
    }
}

#[test]
fn an_interrupted_run_stops_in_two_seconds_and_keeps_what_is_finished() {
    for stubborn in ["hang", "obedient"] {
        let folder = folder();
        let options = options(folder.path());
        let plan = plan(&behaviours(&["slow", stubborn, "well"]), Limits::default(), UNTIMED);
        let options = Options {
            side_by_side: Some(2),
            ..options
        };
        let mut listener = InterruptAfterFirst(options.interrupt.clone(), None);
        let run = run_plan(&plan, &options, &mut listener).unwrap();
        let took = listener.1.expect("a job finished").elapsed();
        assert!(took < Duration::from_secs(2), "{stubborn}: {took:?}");
        assert!(run.interrupted);
        assert!(run.finished.iter().all(|finished| finished.index != 1));
        let (key, _) = plan.jobs[0].resolved.as_ref().unwrap();
        assert!(matches!(options.store.lookup(key), Lookup::Hit(_)));
        assert!(
            options
                .store
                .failure(&plan.jobs[1].resolved.as_ref().unwrap().0)
                .is_none()
        );
    }
}

const PARENT: &str = "VARGEO_TEST_PARENT";

/// Not a test of its own: a run that is killed.
#[test]
fn parent_process() {
    if let Some(folder) = std::env::var_os(PARENT) {
        let folder = PathBuf::from(folder);
        let settings = [json!({ "behaviour": "hang", "log": folder.join("log") })];
        let plan = plan(&settings, Limits::default(), UNTIMED);
        let noted = format!("echo $$ >> \"{}\";", folder.join("processes").display());
        let options = Options {
            program: program(&noted),
            ..options(&folder)
        };
        let _ = run_plan(&plan, &options, &mut Nobody);
    }
}

/// Waits until something is so, for ten seconds at most.
fn until(what: &str, mut so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !so() {
        assert!(started.elapsed() < Duration::from_secs(10), "{what} did not happen");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn no_job_outlives_its_run() {
    let folder = folder();
    let mut parent = this_test("runner::parent_process", PARENT, &folder.path().display().to_string())
        .spawn()
        .unwrap();
    until("the job's start", || lines(&folder.path().join("log")) == ["begin"]);
    let process = lines(&folder.path().join("processes"))[0].clone();
    let alive = || {
        let status = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        !status.is_empty() && !status.contains(") Z ")
    };
    assert!(alive());
    parent.kill().unwrap();
    parent.wait().unwrap();
    let started = Instant::now();
    until("the job's end", || !alive());
    assert!(started.elapsed() < Duration::from_secs(1));
}

#[test]
fn a_result_that_cannot_be_stored_is_told() {
    let folder = folder();
    let options = Options {
        program: program("trap '' XFSZ; ulimit -f 0;"),
        ..options(folder.path())
    };
    let plan = plan(&behaviours(&["well"]), Limits::default(), UNTIMED);
    let run = run_plan(&plan, &options, &mut Nobody).unwrap();
    let result = &record(&run, 0).result;
    assert_eq!((result.status, result.stop.as_str()), (Status::Failed, "not-stored"));
    assert!(result.reason.contains("cannot write"), "{}", result.reason);
    assert_eq!(result.metrics["value"], 0.0);
}

#[test]
fn a_method_gets_as_many_threads_as_were_asked_for() {
    let effort = Effort {
        threads: 3,
        repeat: 2,
        exclusive: false,
    };
    let mut told = Vec::new();
    let bounds = Bounds {
        effort,
        seconds: None,
        interrupt: &Interrupt::default(),
        tell: &mut |message| told.push(message),
    };
    let Ending::Computed(computed) = execute(
        &Behaving,
        &job(json!({ "behaviour": "threads" })),
        Default::default(),
        &BTreeMap::new(),
        bounds,
    ) else {
        panic!("it was cancelled");
    };
    assert_eq!(computed.result.metrics["value"], 3.0);
    assert_eq!(computed.measurement.wall_seconds.len(), 2);
    assert_eq!(told[0], Message::Repetition(0));
    assert!(
        told.iter()
            .any(|message| matches!(message, Message::Iterate(progress) if progress.energy.is_none()))
    );
}
