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

/// The exit code of a command and what it said on each stream.
fn said(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = vargeo(folder, arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (status.code(), text(stdout), text(stderr))
}

/// Writes the experiment and gives a command to it.
fn experiment(folder: &Path, text: &str, arguments: &[&str]) -> (Option<i32>, String, String) {
    std::fs::write(folder.join("small.toml"), text).unwrap();
    said(folder, arguments)
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
fn a_folder_of_experiments_is_one_command() {
    let folder = folder();
    let place = |name: &str| folder.path().join(name);
    let one = SMALL.replace(
        "energy = [\"stretch\", \"symmetric-dirichlet\"]",
        "energy = [\"stretch\"]",
    );
    let unmet = format!("{one}\n[[expect]]\ninverted = {{ min = 1 }}\n");
    std::fs::create_dir_all(place("study/more")).unwrap();
    std::fs::write(place("study/first.toml"), &one).unwrap();
    std::fs::write(place("study/more/second.toml"), &unmet).unwrap();
    std::fs::write(place("study/published.toml"), "[table]\nrows = []\n").unwrap();
    let run = |arguments: &[&str]| said(folder.path(), arguments);
    let (code, output, errors) = run(&["check", "study", "--junit", "verdicts.xml"]);
    assert_eq!(code, Some(1), "{output}{errors}");
    assert!(errors.contains("first: 0 expectations met") && errors.contains("second: 0 expectations met, 1 failed"));
    assert!(output.contains("\u{2713} first   1 of 1 jobs"), "{output}");
    assert!(
        output.contains("\u{2717} second  1 of 1 jobs, 0 of 1 expectations met"),
        "{output}"
    );
    let overview = std::fs::read_to_string(place("results/index.html")).unwrap();
    assert!(overview.contains("href=\"first/index.html\"") && overview.contains("href=\"second/index.html\""));
    let verdicts = std::fs::read_to_string(place("verdicts.xml")).unwrap();
    assert!(
        verdicts.contains("first: jobs") && verdicts.contains("second: expectations"),
        "{verdicts}"
    );

    // Both files share the stored result, and each can be reported and planned together.
    let (code, output, _) = run(&["plan", "study"]);
    assert!(
        code == Some(0) && output.matches("0 to run, 1 stored").count() == 2,
        "{output}"
    );
    assert_eq!(run(&["report", "study", "-q"]).0, Some(0));
    assert_eq!(run(&["run", "study", "-q"]).0, Some(0));

    // A file named twice is one experiment; a part of them leaves the overview as it is.
    assert_eq!(
        run(&["run", "study", "study/first.toml", "--only", "ball", "-q"]).0,
        Some(0)
    );
    assert_eq!(std::fs::read_to_string(place("results/index.html")).unwrap(), overview);
    // What is not stored is told by the exit code too.
    std::fs::write(place("study/third.toml"), one.replace("stretch", "arap")).unwrap();
    assert_eq!(run(&["report", "study", "-q"]).0, Some(4));
    std::fs::remove_file(place("study/third.toml")).unwrap();

    // What is wrong with one file or between two is told before anything runs.
    std::fs::write(place("study/more/first.toml"), one.replace("stretch", "arap")).unwrap();
    let (code, _, errors) = run(&["run", "study", "--results", "new"]);
    assert!(
        code == Some(3) && errors.contains("would write their reports to one folder, \"first\""),
        "{errors}"
    );
    std::fs::write(place("study/more/first.toml"), one.replace("stretch", "strech")).unwrap();
    let (code, _, errors) = run(&["run", "study", "--results", "new"]);
    assert!(code == Some(3) && errors.contains("strech"), "{errors}");
    assert!(!place("new").exists());
    std::fs::create_dir(place("none")).unwrap();
    let (code, _, errors) = run(&["run", "none"]);
    assert!(
        code == Some(3) && errors.contains("no experiment file in this folder"),
        "{errors}"
    );
}

#[test]
fn readers_who_go_away_change_no_exit_code() {
    let folder = folder();
    let mut child = vargeo(folder.path(), &["run", "missing.toml"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop((child.stdout.take(), child.stderr.take()));
    assert_eq!(child.wait().unwrap().code(), Some(3));
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

#[test]
fn the_command_converts_shows_and_says_what_is_wrong() {
    let folder = folder();
    let run = |arguments: &[&str]| said(folder.path(), &[&["mesh"], arguments].concat());
    // A reversed tetrahedron with a reference, and a section that is left out.
    let text = "MeshVersionFormatted 2\nDimension 3\nVertices 4\n0 0 0 0\n1 0 0 0\n0 1.5 0 0\n0 0 1 0\nCorners 1\n1\nTetrahedra 1\n1 3 2 4 5\nEnd\n";
    std::fs::write(folder.path().join("in.mesh"), text).expect("the folder takes files");

    let (code, shown, errors) = run(&["in.mesh"]);
    assert_eq!((code, errors.as_str()), (Some(0), ""), "{shown}");
    for words in [
        "MEDIT",
        "1 tetrahedra",
        "reference (1)",
        "volume",
        "0.25",
        "genus 0, closed",
        "repaired",
        "Corners",
    ] {
        assert!(shown.contains(words), "{words} is not in\n{shown}");
    }
    let (code, shown, errors) = run(&["convert", "in.mesh", "out.vtu"]);
    assert_eq!((code, shown.as_str()), (Some(0), ""), "{errors}");
    assert!(errors.starts_with("notice: ") && errors.contains("Corners"), "{errors}");
    let (code, shown, _) = run(&["out.vtu"]);
    assert!(
        code == Some(0) && shown.contains("VTU") && shown.contains("reference (1)"),
        "{shown}"
    );

    for (arguments, words) in [
        (&["convert", "in.mesh", "out.stl"][..], "STL cannot hold tetrahedra"),
        (
            &["convert", "in.mesh", "out.docx"][..],
            "the extension tells no mesh format",
        ),
        (&["absent.mesh"][..], "cannot be read"),
        (&[][..], "<FILE>"),
    ] {
        let (code, shown, errors) = run(arguments);
        assert_eq!((code, shown.as_str()), (Some(3), ""), "{errors}");
        assert!(errors.contains(words), "{errors}");
    }
    assert!(!folder.path().join("out.stl").exists());
}
