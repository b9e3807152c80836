//! Experiment files: what a good one says, and what it leaves to be understood.

use crate::tiny_method::METHODS;
use serde_json::json;
use std::path::Path;
use vargeo::experiment::diagnostic::{Diagnostic, render};
use vargeo::experiment::file::{Bound, Experiment};
use vargeo::experiment::unit;

pub(crate) fn parse(text: &str) -> Result<Experiment, Vec<Diagnostic>> {
    Experiment::parse(Path::new("experiments/question.toml"), text, METHODS)
}

/// The head that most of the files below have in common: 4 lines.
const HEAD: &str = "method = \"tiny\"\n[models.ball]\nmesh = { generate = \"ball\" }\n\n";

fn good(text: &str) -> Experiment {
    parse(text).unwrap_or_else(|diagnostics| panic!("{}", render(&diagnostics, false)))
}

/// `line:column message | label | help` of each diagnostic.
pub(crate) fn told(text: &str) -> Vec<String> {
    let diagnostics = match parse(text) {
        Ok(experiment) => experiment.origin.warnings,
        Err(diagnostics) => diagnostics,
    };
    diagnostics
        .iter()
        .map(|diagnostic| {
            let place = diagnostic.place.as_ref();
            let at = place.map_or("-".to_owned(), |place| format!("{}:{}", place.line(), place.column()));
            let help = diagnostic.help.as_deref().unwrap_or("");
            format!("{at} {} | {} | {help}", diagnostic.message, diagnostic.label)
        })
        .collect()
}

/// What is told of a file with the common head; lines are counted from its end.
pub(crate) fn after_head(text: &str) -> String {
    let shifted = told(&format!("{HEAD}{text}")).into_iter().map(|line| {
        let (line, rest) = line.split_once(':').expect("a place");
        format!("{}:{rest}", line.parse::<i64>().expect("a line") - 4)
    });
    shifted.collect::<Vec<_>>().join("\n")
}

#[test]
fn everything_a_file_may_say() {
    let experiment = good(
        r#"
title = "Five energies"
description = "Why."
method = "tiny"
claims = ["VM1", "VM2"]

[models.ball]
mesh = { generate = "ball", tetrahedra = 12_600 }
target = { shape = "cube" }

[models.duck]
mesh = { file = "models/duck.mesh", scale = 2 }
optional = true

[settings]
lambda = 2          # a whole number for a number
barrier = { width = 0.1 }
patience = "1.5 min"

[vary]
model = ["ball", "duck"]
energy = ["dirichlet", "stretch"]
newton.relaxation = [true, false]

[[zip]]
order = [1, 2, 4]
"newton.omega" = [50, 5, 5]

[[exclude]]
model = "duck"
energy = "dirichlet"

[limits]
time = "10 min"
memory = "8 GiB"

[timing]
exclusive = true
repeat = 3

[[table]]
name = "distortion"
rows = ["model", "energy"]
columns = ["d_ma", "inverted", "iterations", "seconds"]
where = { order = [1, 2], "newton.relaxation" = true, newton.omega = 50 }
published = { source = "Table 1", rows = [{ energy = "stretch", d_ma = 12.30, seconds = 98, tolerance = 0.1 }] }

[[plot]]
x = "iteration"
y = "energy"
series = "energy"
log = "xy"

[[plot]]
name = "by-energy"
x = "energy"
y = "d_ma"

[[rate]]
x = "h"
y = "l2_error"
window = [0.1, 1]
expect = { min = 1.75 }

[[expect]]
where = { energy = "stretch", order = [2, 4] }
stop = "converged"
inverted = 0
d_ma = { max = 20, less_than = { order = 1, "newton.omega" = 50 }, factor = 0.5 }

[[expect]]
stop = "converged"
"#,
    );
    assert_eq!(experiment.name, "question");
    assert_eq!(experiment.title, "Five energies");
    assert_eq!(experiment.claims, ["VM1", "VM2"]);
    assert_eq!(experiment.models.len(), 2);
    assert!(experiment.models[1].optional);
    assert_eq!(
        experiment.settings,
        json!({
            "energy": "stretch", "order": 2, "lambda": 2.0, "untangle": true, "solver": "newton",
            "newton": { "omega": 1e8, "relaxation": true }, "barrier": { "width": 0.1 },
            "patience": 90.0, "cache": 1_048_576,
        })
    );
    let names: Vec<&str> = experiment.axes.iter().map(|axis| axis.name.as_str()).collect();
    assert_eq!(names, ["model", "energy", "newton.relaxation"]);
    assert_eq!(experiment.zips[0][1].name, "newton.omega");
    assert_eq!(experiment.zips[0][1].values, [json!(50.0), json!(5.0), json!(5.0)]);
    assert_eq!(experiment.limits.seconds, Some(600.0));
    assert_eq!(experiment.limits.memory, Some(8 << 30));
    assert_eq!(
        (
            experiment.timing.exclusive,
            experiment.timing.repeat,
            experiment.timing.threads
        ),
        (true, 3, None)
    );
    let published = experiment.tables[0].published.as_ref().expect("printed figures");
    assert_eq!(published.rows[0]["seconds"], json!(98));
    assert_eq!(experiment.plots[0].name, "energy-iteration");
    assert!(experiment.plots[0].log_x && experiment.plots[0].log_y);
    // Silent on series: the axes that vary, save x.
    assert_eq!(
        experiment.plots[1].series,
        ["model", "newton.relaxation", "order", "newton.omega"]
    );
    assert_eq!(experiment.rates[0].window, Some([0.1, 1.0]));
    assert_eq!(experiment.rates[0].expect.and_then(|bound| bound.min), Some(1.75));
    let expectation = &experiment.expectations[0];
    assert_eq!(expectation.stop.as_deref(), Some("converged"));
    assert_eq!(
        expectation.bounds["inverted"],
        Bound {
            equals: Some(0.0),
            ..Bound::default()
        }
    );
    assert_eq!(expectation.bounds["d_ma"].max, Some(20.0));
    assert_eq!(expectation.comparisons[0].factor, 0.5);
    assert_eq!(expectation.line, 65);
    assert!(experiment.origin.warnings.is_empty());
}

#[test]
fn what_refines_tells_no_series_apart() {
    let file = |rest: &str| {
        format!("{HEAD}[vary]\nenergy = [\"arap\", \"stretch\"]\n\"model.tetrahedra\" = [100, 200, 400]\n{rest}")
    };
    let series = |rest: &str| good(&file(rest)).plots[0].series.clone();
    // Towards a measured figure the models' numbers refine; settings of numbers do not by themselves.
    assert_eq!(
        series("order = [1, 2]\n[[plot]]\nx = \"h\"\ny = \"l2_error\"\n"),
        ["energy", "order"]
    );
    // Towards an axis that axis alone.
    let axis = "order = [1, 2]\n[[plot]]\nx = \"order\"\ny = \"l2_error\"\n";
    assert_eq!(series(axis), ["energy", "model.tetrahedra"]);
    // What is zipped with an axis that refines goes with it.
    let zipped = good(&format!(
        "{HEAD}[vary]\nenergy = [\"arap\", \"stretch\"]\n[[zip]]\n\"model.tetrahedra\" = [100, 200]\norder = [1, 2]\n\
         [[plot]]\nx = \"h\"\ny = \"l2_error\"\n[[rate]]\nx = \"order\"\ny = \"l2_error\"\n"
    ));
    assert_eq!(zipped.plots[0].series, ["energy"]);
    assert_eq!(zipped.rates[0].series, ["energy"]);
}

#[test]
fn series_that_join_different_jobs_are_told() {
    let told = |rest: &str| {
        after_head(&format!(
            "[vary]\nenergy = [\"arap\", \"stretch\"]\norder = [1, 2]\n\"model.tetrahedra\" = [100, 200]\n[[rate]]\n{rest}"
        ))
    };
    // Numbers may refine towards a measured figure, words do not.
    assert_eq!(
        told("x = \"h\"\ny = \"l2_error\"\nseries = \"order\"\n"),
        "8:10 each series joins jobs that differ in energy |  | add energy to \"series\", or say which jobs with \"where\""
    );
    assert_eq!(told("x = \"h\"\ny = \"l2_error\"\nseries = \"energy\"\n"), "");
    let one = "x = \"h\"\ny = \"l2_error\"\nseries = \"order\"\nwhere = { energy = \"arap\" }\n";
    assert_eq!(told(one), "");
    assert!(told("x = \"order\"\ny = \"l2_error\"\nseries = \"energy\"\n").contains("differ in model.tetrahedra |"));
    // What is zipped with an axis of the series is told with it.
    let zipped = "[vary]\n\"model.tetrahedra\" = [100, 200]\n[[zip]]\nenergy = [\"arap\", \"stretch\"]\n\
                  solver = [\"newton\", \"l-bfgs\"]\n[[rate]]\nx = \"h\"\ny = \"l2_error\"\nseries = \"energy\"\n";
    assert_eq!(after_head(zipped), "");
}

#[test]
fn a_file_that_cannot_be_read_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("latin.toml");
    let message = |path: &Path| {
        Experiment::read(path, METHODS).err().expect("an error")[0]
            .message
            .clone()
    };
    assert!(message(&path).starts_with("cannot read "));
    std::fs::write(&path, b"method = \"tiny\"\ntitle = \"\xe9\"\n").expect("a file");
    assert_eq!(message(&path), format!("{}:2: not UTF-8", path.display()));
}

#[test]
fn printed_figures_come_from_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("question.toml");
    let text = format!(
        "{HEAD}[vary]\nenergy = [\"arap\", \"stretch\"]\n[[table]]\nname = \"distortion\"\ncolumns = [\"d_ma\"]\n\
         published = \"printed.toml\"\n"
    );
    let read = |printed: &str| {
        std::fs::write(folder.path().join("printed.toml"), printed).expect("a file");
        Experiment::parse(&path, &text, METHODS)
    };
    let experiment = read(
        "[distortion]\nsource = \"Table 1\"\nmachine = \"a PC\"\n[[distortion.rows]]\nenergy = \"arap\"\nd_ma = 254.9\n\
         inverted = 3\n[other]\nrows = 1\n",
    )
    .unwrap_or_else(|errors| panic!("{}", render(&errors, false)));
    let published = experiment.tables[0].published.as_ref().expect("printed figures");
    assert_eq!(
        (published.source.as_str(), published.machine.as_deref()),
        ("Table 1", Some("a PC"))
    );
    // The figure without a column is another table's.
    assert_eq!(json!(published.rows), json!([{ "energy": "arap", "d_ma": 254.9 }]));

    let errors = read("[distortoin]\nsource = \"x\"\n").err().expect("an error");
    assert!(
        errors[0].message.ends_with("printed.toml has no table [distortion]"),
        "{}",
        errors[0].message
    );
    assert_eq!(errors[0].help.as_deref(), Some("did you mean \"distortoin\"?"));
    // Mistakes in it are underlined in it.
    let errors = read("[distortion]\nsource = \"x\"\nrows = [{ energy = \"arap\", d_mb = 1 }]")
        .err()
        .expect("an error");
    let place = errors[0].place.as_ref().expect("a place");
    assert!(place.source.name.ends_with("printed.toml"));
    assert_eq!((place.line(), place.column()), (3, 28));
}

#[test]
fn quantities() {
    assert_eq!(unit::duration("10 min"), Ok(600.0));
    assert_eq!(unit::duration("1.5 h"), Ok(5400.0));
    assert_eq!(unit::duration("200ms"), Ok(0.2));
    assert_eq!(unit::size("8 GiB"), Ok(8 << 30));
    assert_eq!(unit::size("500 MB"), Ok(500_000_000));
    assert_eq!(unit::size("1_000 B"), Ok(1000));
    for wrong in ["", "min", "-1 s", "inf s", "1e400 s", "1 fortnight", "1 2 s", "nan s"] {
        assert!(unit::duration(wrong).is_err(), "{wrong}");
    }
    for wrong in ["0 B", "0.2 B", "1e30 TiB", "1 b", "8 GiB!"] {
        assert!(unit::size(wrong).is_err(), "{wrong}");
    }
}
