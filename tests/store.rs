//! The store's promises: whole or not at all, verified when read, any number of writers, nothing lost.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use vargeo::experiment::job::{Job, Key, sha256};
use vargeo::experiment::record::{JobResult, Measurement, RECORD_SCHEMA, Record, Status};
use vargeo::run::store::{GarbageKind, Lookup, MESH, Publication, Step, Store};

/// A record of a made-up job; `value` decides its result, `measured` its measurement.
pub(crate) fn record(name: &str, value: f64, measured: i64, mesh: &[u8]) -> Record {
    let job = Job {
        record_schema: RECORD_SCHEMA,
        method: "made-up".into(),
        method_version: 1,
        model: BTreeMap::new(),
        settings: serde_json::json!({ "name": name }),
    };
    Record {
        key: Key::of(&job),
        job,
        result: JobResult {
            status: Status::Done,
            stop: "converged".into(),
            reason: String::new(),
            metrics: [("value".to_string(), value), ("undefined".into(), f64::NAN)].into(),
            traces: [("energy".to_string(), vec![3.0, 2.0, f64::INFINITY])].into(),
            counters: [("iterations".to_string(), 2)].into(),
            notices: Vec::new(),
            artifacts: [(MESH.to_string(), sha256(mesh))].into(),
        },
        measurement: Measurement {
            version: "0".into(),
            commit: "unknown".into(),
            target: "none".into(),
            host: "none".into(),
            threads: 1,
            started: measured,
            exclusive: false,
            wall_seconds: vec![0.5],
            cpu_seconds: vec![0.5],
            phases: Vec::new(),
            peak_memory: 1,
            inputs: BTreeMap::new(),
        },
    }
}

/// A folder in memory where there is such a thing, for syncing to a disk takes long; else a usual one.
pub(crate) fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").unwrap_or_else(|_| tempfile::tempdir().expect("a temporary folder"))
}

fn artifacts(mesh: &[u8]) -> BTreeMap<String, Vec<u8>> {
    [(MESH.to_string(), mesh.to_vec())].into()
}

/// The text of a record, which tells any difference, not-a-number included.
fn text(record: &Record) -> String {
    serde_json::to_string(record).expect("a record serializes")
}

fn hit(store: &Store, key: &Key) -> Record {
    match store.lookup(key) {
        Lookup::Hit(record) => *record,
        other => panic!("expected a hit, got {other:?}"),
    }
}

fn is_miss(store: &Store, key: &Key) -> bool {
    matches!(store.lookup(key), Lookup::Miss)
}

fn count(folder: &Path) -> usize {
    std::fs::read_dir(folder).map_or(0, Iterator::count)
}

const MESH_BYTES: &[u8] = b"<VTKFile> not really </VTKFile>";

#[test]
fn what_is_published_is_found_and_stays() {
    let folder = folder();
    let store = Store::new(folder.path().join("store"));
    let first = record("job", 1.0, 1, MESH_BYTES);
    assert!(is_miss(&store, &first.key));
    assert!(matches!(
        store.publish(&first, &artifacts(MESH_BYTES), false).unwrap(),
        Publication::New
    ));
    assert_eq!(text(&hit(&store, &first.key)), text(&first));
    assert_eq!(std::fs::read(store.entry(&first.key).join(MESH)).unwrap(), MESH_BYTES);

    // A later computation of the same job changes nothing, unless a new measurement is asked for.
    let again = record("job", 1.0, 2, MESH_BYTES);
    assert!(matches!(
        store.publish(&again, &artifacts(MESH_BYTES), false).unwrap(),
        Publication::AlreadyThere(stored) if stored.measurement.started == 1
    ));
    assert!(matches!(
        store.publish(&again, &artifacts(MESH_BYTES), true).unwrap(),
        Publication::Remeasured
    ));
    assert_eq!(hit(&store, &first.key).measurement.started, 2);
    assert_eq!(count(&folder.path().join("store/tmp")), 0);
    assert_eq!(count(&folder.path().join("store/quarantine")), 0);
}

#[test]
fn exclusive_times_do_not_give_way_to_others() {
    let folder = folder();
    let store = Store::new(folder.path());
    let mut alone = record("job", 1.0, 1, MESH_BYTES);
    alone.measurement.exclusive = true;
    store.publish(&alone, &artifacts(MESH_BYTES), false).unwrap();
    let mut crowded = record("job", 1.0, 2, MESH_BYTES);
    store.publish(&crowded, &artifacts(MESH_BYTES), true).unwrap();
    assert_eq!(hit(&store, &alone.key).measurement.started, 1);
    crowded.measurement.wall_seconds = vec![0.5; 3];
    store.publish(&crowded, &artifacts(MESH_BYTES), true).unwrap();
    assert_eq!(hit(&store, &alone.key).measurement.started, 2);
}

#[test]
fn a_different_result_is_told_with_both_fingerprints() {
    for replace in [false, true] {
        let folder = folder();
        let store = Store::new(folder.path());
        let first = record("job", 1.0, 1, MESH_BYTES);
        let other = record("job", 1.0 + f64::EPSILON, 2, MESH_BYTES);
        store.publish(&first, &artifacts(MESH_BYTES), false).unwrap();
        let publication = store.publish(&other, &artifacts(MESH_BYTES), replace).unwrap();
        let Publication::Differs {
            stored,
            computed,
            kept,
            set_aside,
        } = publication
        else {
            panic!("the difference went unnoticed: {publication:?}");
        };
        assert_ne!(stored, computed);
        assert_eq!(kept.measurement.started, if replace { 2 } else { 1 });
        assert_eq!(text(&hit(&store, &first.key)), text(&kept));
        let aside: Record = serde_json::from_slice(&std::fs::read(set_aside.join("record.json")).unwrap()).unwrap();
        assert_eq!(aside.measurement.started, if replace { 1 } else { 2 });
    }
}

#[test]
fn sentences_for_humans_are_no_difference() {
    let folder = folder();
    let store = Store::new(folder.path());
    let first = record("job", 1.0, 1, MESH_BYTES);
    let mut renamed = record("job", 1.0, 2, MESH_BYTES);
    renamed.result.reason = "duck-copy.mesh:12: something".into();
    store.publish(&first, &artifacts(MESH_BYTES), false).unwrap();
    assert!(matches!(
        store.publish(&renamed, &artifacts(MESH_BYTES), false).unwrap(),
        Publication::AlreadyThere(_)
    ));
}

#[test]
fn every_kind_of_damage_is_a_miss_and_goes_to_quarantine() {
    let folder = folder();
    let sound = Store::new(folder.path().join("sound"));
    let stored = record("job", 1.0, 1, MESH_BYTES);
    sound.publish(&stored, &artifacts(MESH_BYTES), false).unwrap();
    let template = sound.entry(&stored.key);
    let names = ["manifest.json", "record.json", MESH];

    let damages: Vec<Damage> = damages(&template, &names);
    assert!(damages.len() > 1000, "only {} kinds of damage", damages.len());
    let store = Store::new(folder.path().join("store"));
    let entry = store.entry(&stored.key);
    let quarantine = store.root().join("quarantine");
    for (count_before, (what, inflict)) in damages.iter().enumerate() {
        std::fs::create_dir_all(&entry).unwrap();
        for name in names {
            std::fs::copy(template.join(name), entry.join(name)).unwrap();
        }
        inflict(&entry);
        match store.lookup(&stored.key) {
            Lookup::Damaged { reason, quarantine } => {
                assert!(
                    !reason.is_empty() && quarantine.is_ok(),
                    "{what}: {reason}, {quarantine:?}"
                );
            }
            other => panic!("{what} went unnoticed: {other:?}"),
        }
        assert!(is_miss(&store, &stored.key), "{what}: still there");
        assert_eq!(count(&quarantine), count_before + 1, "{what}: not in quarantine");
    }
    store.publish(&stored, &artifacts(MESH_BYTES), false).unwrap();
    assert_eq!(text(&hit(&store, &stored.key)), text(&stored));
}

/// Its name, and how it is inflicted on an entry's folder.
type Damage = (String, Box<dyn Fn(&Path)>);

/// What can befall an entry: every bit position of every byte is flipped in turn, and files are cut, grown and swapped.
fn damages(template: &Path, names: &[&str]) -> Vec<Damage> {
    let mut damages: Vec<Damage> = Vec::new();
    for &name in names {
        let bytes = std::fs::read(template.join(name)).unwrap();
        let mut add = |what: String, content: Vec<u8>| {
            let file = PathBuf::from(name);
            let inflict = move |entry: &Path| std::fs::write(entry.join(&file), &content).unwrap();
            damages.push((format!("{name} {what}"), Box::new(inflict)));
        };
        for place in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[place] ^= 1 << (place % 8);
            add(format!("flipped at {place}"), flipped);
        }
        for length in [0, 1, bytes.len() / 2, bytes.len() - 1] {
            add(format!("cut to {length}"), bytes[..length].to_vec());
        }
        for extra in [b"\n".as_slice(), b" ", b"{}", b"\0"] {
            add(format!("grown by {extra:?}"), [&bytes, extra].concat());
        }
        let file = PathBuf::from(name);
        damages.push((
            format!("{name} deleted"),
            Box::new({
                let file = file.clone();
                move |entry| std::fs::remove_file(entry.join(&file)).unwrap()
            }),
        ));
        damages.push((
            format!("{name} a folder"),
            Box::new(move |entry| {
                std::fs::remove_file(entry.join(&file)).unwrap();
                std::fs::create_dir(entry.join(&file)).unwrap();
            }),
        ));
    }
    damages.push((
        "an extra file".into(),
        Box::new(|entry| std::fs::write(entry.join("more.vtu"), b"").unwrap()),
    ));
    damages.push((
        "an empty folder".into(),
        Box::new(|entry| {
            std::fs::remove_dir_all(entry).unwrap();
            std::fs::create_dir(entry).unwrap();
        }),
    ));
    damages.push((
        "a file in place of the entry".into(),
        Box::new(|entry| {
            std::fs::remove_dir_all(entry).unwrap();
            std::fs::write(entry, b"?").unwrap();
        }),
    ));
    damages.push((
        "another job's entry".into(),
        Box::new(|entry| {
            let parent = entry.parent().unwrap().join("other-store");
            let other = Store::new(&parent);
            let record = record("another", 1.0, 1, MESH_BYTES);
            other.publish(&record, &artifacts(MESH_BYTES), false).unwrap();
            std::fs::remove_dir_all(entry).unwrap();
            std::fs::rename(other.entry(&record.key), entry).unwrap();
            std::fs::remove_dir_all(parent).unwrap();
        }),
    ));
    damages
}

/// The steps of a publication, in order.
fn steps(replace: bool) -> Vec<Step> {
    let folder = folder();
    let store = Store::new(folder.path());
    let record = record("job", 1.0, 1, MESH_BYTES);
    if replace {
        store.publish(&record, &artifacts(MESH_BYTES), false).unwrap();
    }
    let mut steps = Vec::new();
    let publication = store.publish_in_steps(&record, &artifacts(MESH_BYTES), replace, &mut |step| {
        steps.push(step.clone());
        Ok(())
    });
    publication.unwrap();
    assert!(steps.len() > 12, "{steps:?}");
    steps
}

#[test]
fn an_error_at_any_step_is_told_and_loses_nothing() {
    for replace in [false, true] {
        for (number, failing) in steps(replace).iter().enumerate() {
            let folder = folder();
            let store = Store::new(folder.path());
            let other = record("other", 2.0, 1, MESH_BYTES);
            store.publish(&other, &artifacts(MESH_BYTES), false).unwrap();
            if replace {
                let former = record("job", 1.0, 1, MESH_BYTES);
                store.publish(&former, &artifacts(MESH_BYTES), false).unwrap();
            }
            let latter = record("job", 1.0, 2, MESH_BYTES);
            let mut passed = 0;
            let error = store
                .publish_in_steps(&latter, &artifacts(MESH_BYTES), replace, &mut |_| {
                    passed += 1;
                    if passed > number {
                        Err(io::ErrorKind::StorageFull.into())
                    } else {
                        Ok(())
                    }
                })
                .expect_err("the error is passed on")
                .to_string();
            assert!(error.contains("free some space"), "{failing:?}: {error}");
            hit(&store, &other.key);
            match store.lookup(&latter.key) {
                Lookup::Hit(_) => {}
                Lookup::Miss => assert!(!replace, "{failing:?} lost the former entry"),
                damaged => panic!("{failing:?} left {damaged:?}"),
            }
            assert_eq!(count(&store.root().join("tmp")), 0, "{failing:?} left files behind");
            store.publish(&latter, &artifacts(MESH_BYTES), true).unwrap();
            assert_eq!(text(&hit(&store, &latter.key)), text(&latter));
        }
    }
}

/// This test binary as a process of its own that runs one of its functions.
pub(crate) fn this_test(function: &str, variable: &str, value: &str) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args([function, "--exact", "--nocapture", "--quiet"]);
    command.env(variable, value).stdin(Stdio::null()).stdout(Stdio::null());
    command
}

const PUBLISHER: &str = "VARGEO_TEST_PUBLISHER";

/// Not a test of its own: publishes in a process that is killed. `STORE|STEP|replace` kills itself at a step,
/// `STORE|forever` publishes until it is killed, `STORE|large` publishes one large entry.
#[test]
fn publisher() {
    let Ok(orders) = std::env::var(PUBLISHER) else { return };
    let orders: Vec<&str> = orders.split('|').collect();
    let store = Store::new(orders[0]);
    match orders[1..] {
        ["forever"] => {
            for round in 0.. {
                let (job, measured) = (format!("job {}", round % 7), i64::from(round));
                let published = store.publish(&record(&job, 1.0, measured, MESH_BYTES), &artifacts(MESH_BYTES), true);
                published.unwrap();
            }
        }
        ["large"] => {
            let mesh = vec![7; 1 << 20];
            match store.publish(&record("large", 1.0, 1, &mesh), &artifacts(&mesh), false) {
                Ok(_) => std::process::exit(0),
                Err(error) => {
                    eprintln!("{error}");
                    std::process::exit(7);
                }
            }
        }
        [step, replace] => {
            let step: usize = step.parse().unwrap();
            let mut passed = 0;
            let latter = record("job", 1.0, 2, MESH_BYTES);
            let _ = store.publish_in_steps(&latter, &artifacts(MESH_BYTES), replace == "true", &mut |_| {
                if passed == step {
                    let this = rustix::process::getpid();
                    rustix::process::kill_process(this, rustix::process::Signal::KILL)?;
                    std::thread::sleep(Duration::from_secs(10));
                }
                passed += 1;
                Ok(())
            });
        }
        _ => panic!("unknown orders"),
    }
}

#[test]
fn killed_at_any_step_an_entry_is_there_whole_or_not_at_all() {
    use std::os::unix::process::ExitStatusExt;
    for replace in [false, true] {
        let steps = steps(replace);
        let mut seen = BTreeSet::new();
        for (number, step) in steps.iter().enumerate() {
            let folder = folder();
            let store = Store::new(folder.path());
            let former = record("job", 1.0, 1, MESH_BYTES);
            if replace {
                store.publish(&former, &artifacts(MESH_BYTES), false).unwrap();
            }
            let orders = format!("{}|{number}|{replace}", folder.path().display());
            let status = this_test("store::publisher", PUBLISHER, &orders).status().unwrap();
            assert_eq!(status.signal(), Some(9), "{step:?} was not reached");
            match store.lookup(&former.key) {
                Lookup::Hit(found) => {
                    seen.insert(found.measurement.started);
                    assert!(!store.entry(&former.key).join("tmp").exists());
                }
                Lookup::Miss => assert!(!replace, "killed at {step:?}, the former entry is lost"),
                damaged => panic!("killed at {step:?}: {damaged:?}"),
            }
            // The next run goes on, and what the killed one left can be told and removed.
            let latter = record("job", 1.0, 3, MESH_BYTES);
            store.publish(&latter, &artifacts(MESH_BYTES), true).unwrap();
            assert_eq!(hit(&store, &former.key).measurement.started, 3);
            let garbage = store.garbage(Duration::ZERO, None).unwrap();
            store.remove(&garbage).unwrap();
            assert_eq!(count(&store.root().join("tmp")), 0);
            assert_eq!(hit(&store, &former.key).measurement.started, 3);
        }
        assert!(seen.contains(&2), "no kill came after the rename");
    }
}

#[test]
fn killed_at_random_instants_the_store_stays_sound() {
    let folder = folder();
    let store = Store::new(folder.path());
    let orders = format!("{}|forever", folder.path().display());
    let mut before = 0;
    for round in 0..12_u64 {
        let mut publishers: Vec<_> = (0..2)
            .map(|_| this_test("store::publisher", PUBLISHER, &orders).spawn().unwrap())
            .collect();
        std::thread::sleep(Duration::from_micros(20_000 + 7_919 * round));
        for publisher in &mut publishers {
            assert!(publisher.try_wait().unwrap().is_none(), "it ended by itself");
            publisher.kill().unwrap();
            publisher.wait().unwrap();
        }
        let (sound, damaged) = store.verify().unwrap();
        assert!(damaged.is_empty(), "round {round}: {damaged:?}");
        assert!(sound >= before, "round {round}: an entry that was there is lost");
        before = sound;
    }
    assert_eq!(before, 7);
}

#[test]
fn readers_never_see_a_mixture_while_others_write() {
    let folder = folder();
    let store = Store::new(folder.path());
    // Meshes large enough that reading takes a while; each measurement goes with its own mesh name for the check.
    let mesh = vec![1; 200_000];
    store
        .publish(&record("job", 1.0, 0, &mesh), &artifacts(&mesh), false)
        .unwrap();
    let key = record("job", 1.0, 0, &mesh).key;
    std::thread::scope(|scope| {
        for writer in 1..=4 {
            let (store, mesh) = (store.clone(), &mesh);
            scope.spawn(move || {
                for round in 0..10 {
                    let measured = record("job", 1.0, 100 * writer + round, mesh);
                    let publication = store.publish(&measured, &artifacts(mesh), true).unwrap();
                    assert!(matches!(publication, Publication::Remeasured), "{publication:?}");
                }
            });
        }
        for _ in 0..4 {
            let (store, key) = (store.clone(), &key);
            scope.spawn(move || (0..40).for_each(|_| drop(hit(&store, key))));
        }
    });
    assert_eq!(count(&store.root().join("quarantine")), 0);
}

#[test]
fn a_file_too_large_is_told_and_loses_nothing() {
    let folder = folder();
    let store = Store::new(folder.path());
    let kept = record("kept", 1.0, 1, MESH_BYTES);
    store.publish(&kept, &artifacts(MESH_BYTES), false).unwrap();
    // The signal is ignored, so that the process sees the error as it would see a full disk.
    let output = Command::new("/bin/sh")
        .args([
            "-c",
            "trap '' XFSZ; ulimit -f 64; exec \"$0\" store::publisher --exact --nocapture --quiet",
        ])
        .arg(std::env::current_exe().unwrap())
        .env(PUBLISHER, format!("{}|large", folder.path().display()))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(7), "{said}");
    assert!(said.contains("cannot write") && said.contains(MESH), "{said}");
    assert!(is_miss(&store, &record("large", 1.0, 1, b"").key));
    assert_eq!(text(&hit(&store, &kept.key)), text(&kept));
    assert_eq!(count(&store.root().join("tmp")), 0);
}

#[test]
fn a_lock_excludes_others_until_its_holder_is_gone() {
    let folder = folder();
    let store = Store::new(folder.path());
    store.prepare().unwrap();
    let key = record("job", 1.0, 1, MESH_BYTES).key;
    let lock = store.try_lock(&key).expect("nobody holds it");
    assert!(store.is_locked(&key));
    assert!(store.try_lock(&key).is_none());
    drop(lock);
    assert!(!store.is_locked(&key));
    assert!(store.try_lock(&key).is_some());
}

#[test]
fn tidying_takes_only_what_nobody_needs() {
    let folder = folder();
    let store = Store::new(folder.path());
    store.prepare().unwrap();
    let [needed, busy, unneeded] = ["needed", "busy", "unneeded"].map(|name| record(name, 1.0, 1, MESH_BYTES));
    for record in [&needed, &busy, &unneeded] {
        store.publish(record, &artifacts(MESH_BYTES), false).unwrap();
    }
    let mut failure = record("failing", 1.0, 1, MESH_BYTES);
    failure.result.status = Status::Failed;
    store.record_failure(&failure).unwrap();
    assert_eq!(text(&store.failure(&failure.key).unwrap()), text(&failure));
    std::fs::create_dir(store.root().join("tmp/leftover")).unwrap();
    let _lock = store.try_lock(&busy.key).unwrap();

    // Without experiments to compare with, and with everything young: nothing.
    assert_eq!(store.garbage(Duration::from_secs(60), None).unwrap(), []);
    let keep = BTreeSet::from([needed.key.clone()]);
    let garbage = store.garbage(Duration::ZERO, Some(&keep)).unwrap();
    let kinds: Vec<GarbageKind> = garbage.iter().map(|garbage| garbage.kind).collect();
    use GarbageKind::{Failure, Leftover, Unreferenced};
    assert_eq!(kinds, [Leftover, Unreferenced, Failure]);
    store.remove(&garbage).unwrap();
    hit(&store, &needed.key);
    hit(&store, &busy.key);
    assert!(is_miss(&store, &unneeded.key));
    assert!(store.failure(&failure.key).is_none());
    assert_eq!(store.statistics().unwrap().entries, 2);
}

#[test]
fn a_success_ends_a_failure() {
    let folder = folder();
    let store = Store::new(folder.path());
    let mut failure = record("job", 1.0, 1, MESH_BYTES);
    failure.result.status = Status::Failed;
    store.record_failure(&failure).unwrap();
    assert!(is_miss(&store, &failure.key));
    store
        .publish(&record("job", 1.0, 1, MESH_BYTES), &artifacts(MESH_BYTES), false)
        .unwrap();
    assert!(store.failure(&failure.key).is_none());
}
