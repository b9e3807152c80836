//! The program as its user meets it: exit codes, what a second run costs, and that results do not depend on threads.

use crate::store::folder;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

const SMALL: &str = r#"
title = "Two energies on a small ball"
method = "volume-map"

[models.ball]
mesh = { generate = "ball", tetrahedra = 300 }
target = { shape = "cube" }

[vary]
energy = ["stretch", "symmetric-dirichlet"]

[[table]]
name = "distortion"
rows = ["energy"]
columns = ["inverted", "d_ma", "seconds"]
"#;

fn vargeo(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vargeo"));
    command.args(arguments).current_dir(folder).env_remove("VARGEO_MODELS");
    command.stdin(Stdio::null());
    command
}

/// Writes the experiment and gives a command to it; returns its exit code and what it said on each stream.
fn experiment(folder: &Path, text: &str, arguments: &[&str]) -> (Option<i32>, String, String) {
    std::fs::write(folder.join("small.toml"), text).unwrap();
    let Output { status, stdout, stderr } = vargeo(folder, arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (status.code(), text(stdout), text(stderr))
}

#[test]
fn the_report_of_another_file_is_not_overwritten_in_silence() {
    let folder = folder();
    let (_, _, errors) = experiment(folder.path(), SMALL, &["run", "small.toml", "-q"]);
    assert!(!errors.contains("held the report"), "{errors}");
    let (_, _, errors) = experiment(folder.path(), SMALL, &["run", "small.toml", "-q"]);
    assert!(!errors.contains("held the report"), "{errors}");
    std::fs::create_dir(folder.path().join("other")).unwrap();
    std::fs::copy(folder.path().join("small.toml"), folder.path().join("other/small.toml")).unwrap();
    let (_, _, errors) = experiment(folder.path(), SMALL, &["run", "other/small.toml", "-q"]);
    assert!(
        errors.contains("held the report of") && errors.contains("rename one of"),
        "{errors}"
    );
}

#[test]
fn a_second_run_comes_from_the_store() {
    let folder = folder();
    let (code, output, errors) = experiment(folder.path(), SMALL, &["run", "small.toml"]);
    assert_eq!(code, Some(0), "{output}{errors}");
    assert!(output.starts_with("Two energies on a small ball: 2 jobs\n"), "{output}");
    assert!(output.contains("2 computed"), "{output}");
    let page = folder.path().join("results/small/index.html");
    assert!(page.is_file());
    let first = std::fs::read(&page).unwrap();

    let started = Instant::now();
    let (code, output, errors) = experiment(folder.path(), SMALL, &["run", "small.toml"]);
    assert_eq!((code, errors.as_str()), (Some(0), ""), "{output}");
    assert!(output.contains("2 from the store"), "{output}");
    assert!(started.elapsed() < Duration::from_secs(10));
    assert_eq!(
        std::fs::read(&page).unwrap(),
        first,
        "the report depends on when it is written"
    );

    // Computed again with other numbers of threads, the results are the stored ones to the last bit.
    for threads in ["2", "4"] {
        let again = ["run", "small.toml", "--force", "--quiet", "--threads", threads];
        let (code, output, errors) = experiment(folder.path(), SMALL, &again);
        assert_eq!((code, output.as_str(), errors.as_str()), (Some(0), "", ""));
    }
    let (code, output, _) = experiment(folder.path(), SMALL, &["store", "verify"]);
    assert_eq!(
        (code, output.as_str()),
        (Some(0), "2 results are sound, 0 are damaged\n")
    );
}

#[test]
fn exit_codes_tell_what_went_wrong() {
    let folder = folder();
    let run = ["run", "small.toml"];
    let (code, _, errors) = experiment(folder.path(), &SMALL.replace("stretch", "strech"), &run);
    assert_eq!(code, Some(3));
    assert!(errors.contains("did you mean \"stretch\"?"), "{errors}");
    assert!(!folder.path().join("results").exists(), "a wrong file leaves nothing");

    let (code, _, errors) = experiment(folder.path(), SMALL, &["run", "small.toml", "--only", "strech"]);
    assert_eq!(code, Some(3));
    assert!(errors.contains("stretch"), "{errors}");

    let limited = format!("{SMALL}\n[limits]\nmemory = \"1 MiB\"\n");
    let (code, output, errors) = experiment(folder.path(), &limited, &run);
    assert_eq!(code, Some(2), "{output}{errors}");
    assert!(output.contains("memory-limit"), "a failed job is a row: {output}");

    // Without the limit the failures are tried again.
    let (code, output, errors) = experiment(folder.path(), SMALL, &run);
    assert_eq!(code, Some(0), "{output}{errors}");

    let missing = SMALL.replace(
        "mesh = { generate = \"ball\", tetrahedra = 300 }",
        "mesh = \"no.mesh\"\noptional = true",
    );
    let (code, output, errors) = experiment(folder.path(), &missing, &run);
    assert_eq!(code, Some(4), "{output}{errors}");
    assert!(errors.contains("no.mesh"), "{errors}");

    let (code, _, errors) = experiment(folder.path(), SMALL, &["job"]);
    assert_eq!(code, Some(3));
    assert!(errors.contains("vargeo run"), "{errors}");
}

#[test]
fn a_terminated_run_keeps_what_is_finished() {
    let folder = folder();
    // The first job is small; the second would take minutes.
    let long = SMALL
        .replace(", tetrahedra = 300", "")
        .replace("energy = [", "\"model.tetrahedra\" = [300, 400_000]\nenergy = [")
        .replace("\"stretch\", ", "");
    std::fs::write(folder.path().join("small.toml"), &long).unwrap();
    let mut run = vargeo(folder.path(), &["run", "small.toml", "--jobs", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let store = vargeo::run::store::Store::new(folder.path().join("results/store"));
    let started = Instant::now();
    while store.keys().unwrap().is_empty() {
        assert!(
            started.elapsed() < Duration::from_secs(60),
            "the first job does not end"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(300));
    rustix::process::kill_process(rustix::process::Pid::from_child(&run), rustix::process::Signal::TERM).unwrap();
    let asked = Instant::now();
    let status = run.wait().unwrap();
    assert!(asked.elapsed() < Duration::from_secs(2), "{:?}", asked.elapsed());
    assert_eq!(status.code(), Some(130));
    let errors = std::io::read_to_string(run.stderr.take().unwrap()).unwrap();
    assert!(
        errors.contains("interrupted: 1 of 2 jobs are finished and kept"),
        "{errors}"
    );
    assert_eq!(store.verify().unwrap().0, 1);
}
