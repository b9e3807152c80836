//! Experiment files: what a good one says, and that every mistake is told at its place with its mend.

use crate::tiny_method::METHODS;
use serde_json::json;
use std::path::Path;
use vargeo::experiment::diagnostic::{Diagnostic, Severity, render};
use vargeo::experiment::file::{Bound, Experiment};
use vargeo::experiment::unit;

fn parse(text: &str) -> Result<Experiment, Vec<Diagnostic>> {
    Experiment::parse(Path::new("experiments/question.toml"), text, METHODS)
}

/// The head that most of the files below have in common: 4 lines.
const HEAD: &str = "method = \"tiny\"\n[models.ball]\nmesh = { generate = \"ball\" }\n\n";

fn good(text: &str) -> Experiment {
    parse(text).unwrap_or_else(|diagnostics| panic!("{}", render(&diagnostics, false)))
}

/// `line:column message | label | help` of each diagnostic.
fn told(text: &str) -> Vec<String> {
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

/// The only diagnostic of a file with the common head; lines are counted after the head.
fn one(text: &str) -> String {
    let told = told(&format!("{HEAD}{text}"));
    assert_eq!(told.len(), 1, "{text}\n{told:#?}");
    let (line, rest) = told[0].split_once(':').expect("a place");
    format!("{}:{rest}", line.parse::<usize>().expect("a line") as i64 - 4)
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
where = { energy = "stretch" }
stop = "converged"
inverted = 0
d_ma = { max = 20, less_than = { order = 1, "newton.omega" = 50 }, factor = 0.5 }

[[expect]]
where = { energy = "stretch", order = [2, 4] }
"#
        .replace(
            "where = { energy = \"stretch\", order = [2, 4] }\n",
            "stop = \"converged\"\n",
        )
        .replace(
            "where = { energy = \"stretch\" }",
            "where = { energy = \"stretch\", order = [2, 4] }",
        )
        .as_str(),
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
    assert_eq!(expectation.line, 64);
    // The condition leaves the relaxation open, and the rows leave more open still.
    assert_eq!(experiment.origin.warnings.len(), 1);
    assert_eq!(experiment.origin.warnings[0].severity, Severity::Warning);
}

#[test]
fn every_mistake_has_its_place_and_its_mend() {
    let cases: &[(&str, &str)] = &[
        // Keys.
        (r#"tittle = "x""#, ""),
        ("[settings]\nlambdaa = 1", ""),
        ("[settings]\nrelaxation = true", ""),
        ("[settings]\nzzz = true", ""),
        ("[settings]\nnewton = { omgea = 1 }", ""),
        ("[limits]\ntimes = \"1 s\"", ""),
        ("[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\nrow = [\"model\"]", ""),
        ("[[table]]\ncolumns = [\"d_ma\"]", ""),
        ("[table]\nname = \"a\"", ""),
        ("[[vary]]\nenergy = [\"arap\"]", ""),
        // Types, ranges and units.
        ("[settings]\nuntangle = 1", ""),
        ("[settings]\norder = 1.5", ""),
        ("[settings]\norder = 17", ""),
        ("[settings]\nlambda = nan", ""),
        ("[settings]\nlambda = -0.5", ""),
        ("[settings]\nnewton = { omega = 0 }", ""),
        ("[settings]\nnewton = 3", ""),
        ("[settings]\nbarrier = 3", ""),
        ("[settings]\nbarrier = {}", ""),
        ("[settings]\nschedule = [1, \"2\"]", ""),
        ("[settings]\nlabel = 1979-05-27", ""),
        ("[settings]\norder = 99999999999999999999", ""),
        ("[limits]\ntime = \"10 mins\"", ""),
        ("[limits]\ntime = 10", ""),
        ("[limits]\ntime = \"soon\"", ""),
        ("[limits]\ntime = \"0 s\"", ""),
        ("[limits]\nmemory = \"8 GIB\"", ""),
        ("[limits]\nmemory = \"8\"", ""),
        ("[timing]\nrepeat = 0", ""),
        // Names.
        ("[settings]\nenergy = \"strech\"", ""),
        ("[settings]\nsolver = \"newtons method\"", ""),
        ("[settings]\nbarrier = \"atuo\"", ""),
        ("[models.bar]\nmesh = { generate = \"barr\" }", ""),
        ("[models.bar]\nmesh = { generate = \"bar\" }", ""),
        (
            "[models.bar]\nmesh = { generate = \"bar\", tetrahedra = 1, lenght = 1 }",
            "",
        ),
        ("[models.bar]\nmesh = \"bar\"", ""),
        ("[models.bar]\nmesh = { genrate = \"bar\" }", ""),
        ("[models.bar]\nmesh = { generate = \"ball\", file = \"x\" }", ""),
        ("[models.bar]\nmesh = \"bar.mesh\"\ntarget = \"cube\"", ""),
        ("[models.bar]\ntarget = { shape = \"cube\" }", ""),
        ("[models.bar]\nmesh = \"\"", ""),
        ("[models.bar]\nmesh = \"bar.mesh\"\noptionl = true", ""),
        // Axes.
        ("[vary]\nenrgy = [\"arap\"]", ""),
        ("[vary]\nomega = [1]", ""),
        ("[vary]\nenergy = []", ""),
        ("[vary]\nenergy = \"arap\"", ""),
        ("[vary]\nenergy = [\"arap\", \"strech\"]", ""),
        ("[vary]\nlambda = [1, 1.0]", ""),
        ("[vary]\nmodel = [\"bal\"]", ""),
        ("[vary]\nnewton = [{ omega = 1 }]\n\"newton.omega\" = [1]", ""),
        ("[vary]\n\"barrier.width\" = [1, 2]", ""),
        ("[vary]\norder = [1]\n[[zip]]\norder = [1]\nlambda = [1]", ""),
        ("[settings]\norder = 1\n[vary]\norder = [1, 2]", ""),
        ("[vary]\n\"model.length\" = [1, 2]", ""),
        ("[vary]\n\"model.tetrahedra\" = [1, 0]", ""),
        (
            "[models.duck]\nmesh = \"duck.mesh\"\n[vary]\n\"model.tetrahedra\" = [1, 2]",
            "",
        ),
        ("[[zip]]\norder = [1, 2]\nlambda = [1, 2, 3]", ""),
        ("[[zip]]\norder = [1, 1]\nlambda = [2, 2]", ""),
        (
            "[vary]\norder = [1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16]\nlambda = [1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16]\nnewton.omega = [1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16]\nschedule=[[1],[2],[3],[4],[5],[6],[7],[8],[9],[10],[11],[12],[13],[14],[15],[16],[17],[18],[19],[20],[21],[22],[23],[24],[25]]",
            "",
        ),
        // Conditions.
        (
            "[vary]\nenergy = [\"arap\", \"stretch\"]\n[[exclude]]\nenergy = \"hencky\"",
            "",
        ),
        (
            "[vary]\nenergy = [\"arap\", \"stretch\"]\n[[exclude]]\nenrgy = \"arap\"",
            "",
        ),
        ("[vary]\nenergy = [\"arap\"]\n[[exclude]]\nenergy = \"arap\"", ""),
        (
            "[[zip]]\norder = [1, 2]\nlambda = [1, 2]\n[[exclude]]\norder = 1\nlambda = 2",
            "",
        ),
        (
            "[[zip]]\norder = [1, 2]\nlambda = [1, 2]\n[[expect]]\nwhere = { order = 1, lambda = 2 }\ninverted = 0",
            "",
        ),
        ("[[expect]]\nwhere = {}\ninverted = 0", ""),
        // Tables, plots and rates.
        ("[[table]]\nname = \"a\"\ncolumns = [\"dma\"]", ""),
        ("[[table]]\nname = \"a\"\ncolumns = [\"model\"]", ""),
        ("[[table]]\nname = \"a\"\ncolumns = []", ""),
        ("[[table]]\nname = \"a\"\nrows = [\"energy\"]\ncolumns = [\"d_ma\"]", ""),
        ("[[table]]\nname = \"a/b\"\ncolumns = [\"d_ma\"]", ""),
        ("[[table]]\nname = \"jobs\"\ncolumns = [\"d_ma\"]", ""),
        (
            "[vary]\norder = [1, 2]\n[[table]]\nname = \"a\"\nrows = \"model\"\ncolumns = [\"d_ma\"]",
            "",
        ),
        (
            "[[plot]]\nname = \"a\"\nx = \"h\"\ny = \"d_ma\"\n[[plot]]\nname = \"A\"\nx = \"h\"\ny = \"d_ma\"",
            "",
        ),
        ("[[plot]]\nx = \"iteratoin\"\ny = \"energy\"", ""),
        ("[[plot]]\nx = \"iteration\"\ny = \"d_ma\"", ""),
        ("[[plot]]\nx = \"h\"\ny = \"energy\"", ""),
        ("[[plot]]\nx = \"h\"\ny = \"d_ma\"\nlog = \"z\"", ""),
        ("[[plot]]\nx = \"h\"\ny = \"model\"", ""),
        ("[[rate]]\nx = \"model\"\ny = \"d_ma\"", ""),
        ("[[rate]]\nx = \"iteration\"\ny = \"d_ma\"", ""),
        ("[[rate]]\nx = \"h\"\ny = \"d_ma\"\nwindow = [2, 1]", ""),
        ("[[rate]]\nx = \"h\"\ny = \"d_ma\"\nexpect = { min = 2, max = 1 }", ""),
        // Expectations.
        ("[[expect]]\ninvertd = 0", ""),
        ("[[expect]]\ninverted = \"none\"", ""),
        ("[[expect]]\ninverted = {}", ""),
        ("[[expect]]\ninverted = { mx = 1 }", ""),
        ("[[expect]]\ninverted = { max = 1, tolerance = 1 }", ""),
        ("[[expect]]\nstop = \"convergd\"", ""),
        ("[[expect]]\nwhere = { model = \"ball\" }", ""),
        (
            "[vary]\nenergy = [\"arap\", \"stretch\"]\n[[expect]]\nd_ma = { less_than = { energy = \"arap\" } }",
            "",
        ),
        ("[[expect]]\nd_ma = { factor = 2.0 }", ""),
        // Printed figures.
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = \"nowhere.toml\"",
            "",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ model = \"ball\", inverted = 1 }] }",
            "",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ model = \"ball\" }] }",
            "",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ d_ma = 1 }] }",
            "",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ modle = \"ball\", d_ma = 1 }] }",
            "",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { source = \"x\", rows = [{ model = \"cow\", d_ma = 1 }] }",
            "",
        ),
        (
            "[[table]]\nname = \"a\"\ncolumns = [\"d_ma\"]\npublished = { rows = [] }",
            "",
        ),
    ];
    for (text, _) in cases {
        println!("{}", serde_json::to_string(text).unwrap());
        for line in told(&format!("{HEAD}{text}")) {
            println!("      {line}");
        }
    }
    let _ = one("tittle = 1");
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
