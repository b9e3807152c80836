//! What is computed is computed once: runs share a store, and only what is damaged, changed or timed anew is redone.

use crate::runner::{UNTIMED, behaviours, job, lines, options, plan, planned, record};
use crate::store::folder;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use vargeo::experiment::file::{Limits, Timing};
use vargeo::experiment::job::{JobPart, sha256};
use vargeo::experiment::record::Status;
use vargeo::run::event::{Event, Listener, Nobody};
use vargeo::run::store::MESH;
use vargeo::run::{Options, Run, run_plan};

#[test]
fn eight_runs_compute_one_job_once() {
    let folder = folder();
    let log = folder.path().join("log");
    let settings = [json!({ "behaviour": "slow", "log": log })];
    let results: Vec<Run> = std::thread::scope(|scope| {
        let runs: Vec<_> = (0..8)
            .map(|_| {
                scope.spawn(|| {
                    let plan = plan(&settings, Limits::default(), UNTIMED);
                    run_plan(&plan, &options(folder.path()), &mut Nobody).unwrap()
                })
            })
            .collect();
        runs.into_iter().map(|run| run.join().unwrap()).collect()
    });
    assert_eq!(lines(&log), ["begin", "end"]);
    assert_eq!(results.iter().filter(|run| !run.finished[0].cached).count(), 1);
    assert!(results.iter().all(|run| record(run, 0) == record(&results[0], 0)));
}

/// Keeps what was told, as words.
#[derive(Default)]
struct Told(Vec<String>);

impl Listener for Told {
    fn event(&mut self, event: &Event<'_>) {
        self.0.push(format!("{event:?}"));
    }
}

#[test]
fn who_waits_takes_over_when_the_holder_is_gone() {
    let folder = folder();
    let options = options(folder.path());
    options.store.prepare().unwrap();
    let plan = plan(&behaviours(&["well"]), Limits::default(), UNTIMED);
    let lock = options
        .store
        .try_lock(&plan.jobs[0].resolved.as_ref().unwrap().0)
        .unwrap();
    let holder = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(700));
        drop(lock);
    });
    let mut told = Told::default();
    let started = Instant::now();
    let run = run_plan(&plan, &options, &mut told).unwrap();
    assert!(started.elapsed() >= Duration::from_millis(700));
    assert!(told.0.iter().any(|event| event.starts_with("Waiting")), "{:?}", told.0);
    assert_eq!(record(&run, 0).result.status, Status::Done);
    assert!(!run.finished[0].cached);
    holder.join().unwrap();
}

#[test]
fn times_are_taken_again_when_the_stored_ones_are_not_what_is_asked_for() {
    let folder = folder();
    let options = options(folder.path());
    let timed = |repeat, threads| Timing {
        exclusive: true,
        repeat,
        threads: Some(threads),
    };
    let take = |timing| {
        let plan = plan(&behaviours(&["well"]), Limits::default(), timing);
        let mut run = run_plan(&plan, &options, &mut Nobody).unwrap();
        assert_eq!(run.warnings, [""; 0]);
        run.finished.remove(0)
    };
    assert!(!take(UNTIMED).cached);
    assert!(take(UNTIMED).cached);
    let exclusive = take(timed(3, 1));
    assert!(!exclusive.cached);
    assert_eq!(exclusive.record.measurement.wall_seconds.len(), 3);
    for timing in [UNTIMED, timed(3, 1), timed(2, 1)] {
        let again = take(timing);
        assert!(again.cached);
        assert_eq!(again.record, exclusive.record);
    }
    assert!(!take(timed(4, 1)).cached);
    assert!(!take(timed(1, 2)).cached);
    assert_eq!(take(timed(1, 2)).record.measurement.threads, 2);
}

#[test]
fn a_timed_job_has_the_machine_to_itself() {
    let folder = folder();
    let log = folder.path().join("log");
    let run_all = |name: &str, timing| {
        let settings: Vec<Value> = (0..3)
            .map(|number| json!({ "behaviour": "slow", "log": log, "name": format!("{name}{number}") }))
            .collect();
        let run = run_plan(
            &plan(&settings, Limits::default(), timing),
            &options(folder.path()),
            &mut Nobody,
        )
        .unwrap();
        assert!(
            run.finished
                .iter()
                .all(|finished| finished.record.result.status == Status::Done)
        );
    };
    let timed = Timing {
        exclusive: true,
        repeat: 1,
        threads: Some(1),
    };
    // Two runs at once, one pool each: neither sees the other but through the store.
    std::thread::scope(|scope| {
        scope.spawn(|| run_all("a", timed));
        scope.spawn(|| run_all("b", timed));
    });
    assert_eq!(lines(&log), ["begin", "end"].repeat(6));
}

#[test]
fn a_computation_that_is_not_deterministic_is_told() {
    let folder = folder();
    let options = options(folder.path());
    let repeated = Timing { repeat: 2, ..UNTIMED };
    let run = run_plan(
        &plan(&behaviours(&["clock"]), Limits::default(), repeated),
        &options,
        &mut Nobody,
    )
    .unwrap();
    assert_eq!(run.warnings.len(), 1, "{:?}", run.warnings);
    assert!(run.warnings[0].contains("not deterministic"));

    let forced = Options { force: true, ..options };
    let run = run_plan(
        &plan(&behaviours(&["clock"]), Limits::default(), UNTIMED),
        &forced,
        &mut Nobody,
    )
    .unwrap();
    assert_eq!(run.warnings.len(), 1, "{:?}", run.warnings);
    assert!(
        run.warnings[0].contains("the stored result has the fingerprint"),
        "{:?}",
        run.warnings
    );
    let run = run_plan(
        &plan(&behaviours(&["well"]), Limits::default(), UNTIMED),
        &forced,
        &mut Nobody,
    )
    .unwrap();
    let again = run_plan(
        &plan(&behaviours(&["well"]), Limits::default(), UNTIMED),
        &forced,
        &mut Nobody,
    )
    .unwrap();
    assert!(!again.finished[0].cached && again.warnings.is_empty());
    assert_eq!(again.finished[0].record.result, run.finished[0].record.result);
}

#[test]
fn damage_is_told_and_computed_again() {
    let folder = folder();
    let options = options(folder.path());
    let plan = plan(&behaviours(&["well"]), Limits::default(), UNTIMED);
    let run = run_plan(&plan, &options, &mut Nobody).unwrap();
    let entry = options.store.entry(&record(&run, 0).key);
    assert_eq!(std::fs::read(entry.join("notes.txt")).unwrap(), b"notes");
    std::fs::write(entry.join(MESH), b"mosh").unwrap();
    let run = run_plan(&plan, &options, &mut Nobody).unwrap();
    assert!(
        run.warnings[0].contains("is damaged (mesh.vtu has SHA-256"),
        "{:?}",
        run.warnings
    );
    assert!(!run.finished[0].cached);
    assert!(run_plan(&plan, &options, &mut Nobody).unwrap().finished[0].cached);
}

#[test]
fn a_changed_input_is_told() {
    let folder = folder();
    let path = folder.path().join("duck.mesh");
    std::fs::write(&path, "quack").unwrap();
    let mut with_file = job(json!({ "behaviour": "length" }));
    let part = JobPart::File {
        sha256: sha256(b"quack"),
        format: "mesh".into(),
        parameters: json!({}),
    };
    with_file.model.insert("mesh".into(), part);
    let mut plan = plan(&[], Limits::default(), UNTIMED);
    let inputs = BTreeMap::from([("mesh".to_string(), path.clone())]);
    plan.jobs.push(planned("duck", with_file, inputs));
    let options = Options {
        force: true,
        ..options(folder.path())
    };
    let run = run_plan(&plan, &options, &mut Nobody).unwrap();
    assert_eq!(record(&run, 0).result.metrics["value"], 5.0);
    assert_eq!(record(&run, 0).measurement.inputs["mesh"], "duck.mesh");
    std::fs::write(&path, "quack!").unwrap();
    let run = run_plan(&plan, &options, &mut Nobody).unwrap();
    assert_eq!(record(&run, 0).result.stop, "input-changed");
    std::fs::remove_file(&path).unwrap();
    let run = run_plan(&plan, &options, &mut Nobody).unwrap();
    assert_eq!(record(&run, 0).result.stop, "input-unreadable");
}

#[test]
fn jobs_of_one_key_are_computed_once() {
    let folder = folder();
    let log = folder.path().join("log");
    let settings = json!({ "behaviour": "well", "log": log });
    let plan = plan(&[settings.clone(), settings], Limits::default(), UNTIMED);
    let run = run_plan(&plan, &options(folder.path()), &mut Nobody).unwrap();
    assert_eq!(run.finished.len(), 2);
    assert_eq!(lines(&log), ["begin", "end"]);
}
