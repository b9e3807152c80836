//! Plans: which jobs there are, in which order, under which names, and what keeps them from running.

use crate::tiny_method::{METHODS, SETTINGS};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use vargeo::experiment::claims::CLAIMS;
use vargeo::experiment::diagnostic::{Diagnostic, render};
use vargeo::experiment::document::{self, Content};
use vargeo::experiment::file::Experiment;
use vargeo::experiment::job::JobPart;
use vargeo::experiment::plan::{Lookup, Plan};
use vargeo::experiment::read::axes::paths;
use vargeo::experiment::schema::schema;
use vargeo::experiment::section::{EXPECT, EXPERIMENT, PLOT, RATE, TABLE};
use vargeo::experiment::template::template;
use vargeo::method::{Method, methods};

fn try_plan(path: &Path, text: &str, folders: &[&Path]) -> Result<Plan, Vec<Diagnostic>> {
    let experiment = Experiment::parse(path, text, METHODS)?;
    let lookup = Lookup {
        folders: folders.iter().map(|folder| folder.to_path_buf()).collect(),
    };
    Plan::new(experiment, &lookup)
}

fn plan(text: &str) -> Plan {
    let text = format!("method = \"tiny\"\n{text}");
    try_plan(Path::new("question.toml"), &text, &[]).unwrap_or_else(|errors| panic!("{}", render(&errors, false)))
}

fn names(plan: &Plan) -> Vec<&str> {
    plan.jobs.iter().map(|job| job.name.as_str()).collect()
}

fn setting<'p>(plan: &'p Plan, job: usize, path: &str) -> &'p Value {
    let (_, job) = plan.jobs[job].resolved.as_ref().expect("a job that can run");
    path.split('.').fold(&job.settings, |value, part| &value[part])
}

const BALL: &str = "[models.ball]\nmesh = { generate = \"ball\" }\n";

#[test]
fn the_last_axis_varies_fastest_and_zips_come_after() {
    let plan = plan(&format!(
        "{BALL}[vary]\nenergy = [\"arap\", \"stretch\"]\nnewton.relaxation = [true, false]\n\
         [[zip]]\norder = [1, 2]\nlambda = [50, 0.5]\n[[exclude]]\nenergy = \"arap\"\norder = 2\n"
    ));
    assert_eq!(
        names(&plan),
        [
            "arap-relaxation-true-order-1-lambda-50",
            "arap-relaxation-false-order-1-lambda-50",
            "stretch-relaxation-true-order-1-lambda-50",
            "stretch-relaxation-true-order-2-lambda-0.5",
            "stretch-relaxation-false-order-1-lambda-50",
            "stretch-relaxation-false-order-2-lambda-0.5",
        ]
    );
    let axes: Vec<&str> = plan.jobs[0].axes.iter().map(|(axis, _)| axis.as_str()).collect();
    assert_eq!(axes, ["model", "energy", "newton.relaxation", "order", "lambda"]);
    assert_eq!(setting(&plan, 1, "newton.relaxation"), &json!(false));
    assert_eq!(setting(&plan, 1, "newton.omega"), &json!(1e8));
    assert_eq!(setting(&plan, 5, "lambda"), &json!(0.5));
    let keys: BTreeSet<_> = plan
        .jobs
        .iter()
        .map(|job| &job.resolved.as_ref().expect("resolved").0)
        .collect();
    assert_eq!(keys.len(), 6);
}

#[test]
fn several_models_without_an_axis_are_an_axis() {
    let both = format!("{BALL}[models.bar]\nmesh = {{ generate = \"bar\", tetrahedra = 5 }}\n");
    assert_eq!(names(&plan(BALL)), ["ball"]);
    assert_eq!(names(&plan(&both)), ["ball", "bar"]);
    assert_eq!(names(&plan(&format!("{both}[vary]\norder = [1, 2]"))).len(), 4);
    assert_eq!(names(&plan(&format!("{both}[vary]\nmodel = [\"bar\"]"))), ["bar"]);
}

#[test]
fn an_axis_sets_a_parameter_of_the_generator() {
    let text = "[models.bar]\nmesh = { generate = \"bar\" }\ntarget = { shape = \"cube\" }\n\
                [vary]\n\"model.tetrahedra\" = [1_000, 10_000]\n\"model.target.swirl\" = [0, 1]\n";
    let plan = plan(text);
    assert_eq!(names(&plan)[3], "tetrahedra-10000-swirl-1");
    let (_, job) = plan.jobs[3].resolved.as_ref().expect("resolved");
    let parameters = |role: &str| match &job.model[role] {
        JobPart::Generated { parameters, .. } => parameters.clone(),
        JobPart::File { .. } => panic!("a generated part"),
    };
    assert_eq!(parameters("mesh"), json!({ "tetrahedra": 10_000, "length": 2.0 }));
    assert_eq!(parameters("target"), json!({ "swirl": 1.0 }));
}

#[test]
fn an_axis_gives_what_a_table_must_have() {
    // The axis gives the width that a table must have.
    let plan = plan(&format!(
        "{BALL}[settings]\nbarrier = {{}}\n[vary]\n\"barrier.width\" = [2, 3]"
    ));
    assert_eq!(setting(&plan, 1, "barrier"), &json!({ "width": 3.0 }));
}

#[test]
fn names_are_unique_and_fit_for_files() {
    let plan = plan(&format!(
        "{BALL}[vary]\nlabel = [\"a b\", \"a/b\", \"A-b\", \"\", \"\u{e9}\"]\nlambda = [1, 1e-7]"
    ));
    let names = names(&plan);
    let folded: BTreeSet<String> = names.iter().map(|name| name.to_lowercase()).collect();
    assert_eq!(folded.len(), 10);
    assert_eq!(names[0], "a-b-lambda-1");
    assert_eq!(names[1], "a-b-lambda-1e-7");
    assert_eq!(names[2], "a-b-lambda-1-2");
    let allowed = |character: char| character.is_ascii_alphanumeric() || "-_.".contains(character);
    assert!(names.iter().all(|name| name.chars().all(allowed)));
}

#[test]
fn jobs_that_are_the_same_computation_are_told() {
    let plan = plan(&format!(
        "{BALL}[settings]\nsolver = \"l-bfgs\"\n[vary]\n\"newton.omega\" = [1, 2]"
    ));
    assert_eq!(
        plan.jobs[0].resolved.as_ref().map(|(key, _)| key),
        plan.jobs[1].resolved.as_ref().map(|(key, _)| key)
    );
    assert_eq!(
        plan.notices,
        ["jobs omega-1, omega-2 are the same computation, which runs once"]
    );
}

#[test]
fn what_the_method_says_of_settings_is_underlined() {
    let head = format!("method = \"tiny\"\n{BALL}");
    let place = |text: &str| {
        let errors = try_plan(Path::new("q.toml"), &format!("{head}{text}"), &[])
            .err()
            .expect("an error");
        assert_eq!(errors.len(), 1);
        let place = errors[0].place.clone().expect("a place");
        (
            place.source.text[place.span.clone()].to_owned(),
            errors[0].label.clone(),
        )
    };
    let held = "[settings]\nbarrier = \"none\"\n[vary]\nsolver = [\"newton\", \"l-bfgs\"]\norder = [1, 2]";
    assert_eq!(
        place(held),
        ("\"none\"".into(), "in job l-bfgs-order-1 and 1 more".into())
    );
    let varied = "[settings]\nsolver = \"l-bfgs\"\n[vary]\nbarrier = [\"auto\", \"none\"]";
    assert_eq!(place(varied), ("barrier".into(), "in job none".into()));
}

#[test]
fn files_are_found_beside_the_experiment_then_in_the_folders() {
    let root = tempfile::tempdir().expect("a folder");
    let (beside, first, second) = (root.path().join("a"), root.path().join("b"), root.path().join("c"));
    for folder in [&beside, &first, &second] {
        fs::create_dir_all(folder.join("models")).expect("a folder");
    }
    let file = beside.join("question.toml");
    let text = "method = \"tiny\"\n[models.duck]\nmesh = \"models/duck.mesh\"\n";
    let optional = format!("{text}optional = true\n[models.ball]\nmesh = {{ generate = \"ball\" }}\n");

    let errors = try_plan(&file, text, &[&first, &second]).err().expect("a missing file");
    assert_eq!(errors.len(), 1);
    assert_eq!(
        errors[0].message,
        "model \"duck\" needs the file models/duck.mesh, which is not found"
    );
    assert_eq!(
        errors[0].place.as_ref().map(|place| (place.line(), place.column())),
        Some((3, 8))
    );
    for folder in [&beside, &first, &second] {
        assert!(
            errors[0]
                .label
                .contains(&folder.join("models/duck.mesh").display().to_string()),
            "{}",
            errors[0].label
        );
    }

    let skipped = try_plan(&file, &optional, &[&first]).unwrap_or_else(|errors| panic!("{}", render(&errors, false)));
    assert_eq!(
        skipped.notices,
        ["optional model \"duck\" is skipped: models/duck.mesh is not found"]
    );
    assert_eq!(skipped.jobs[0].missing.as_ref(), Some(&skipped.notices[0]));
    assert!(skipped.jobs[0].resolved.is_none() && skipped.jobs[1].resolved.is_some());

    let found = |plan: Plan| plan.jobs[0].inputs["mesh"].clone();
    for folder in [&second, &first, &beside] {
        let path = folder.join("models/duck.mesh");
        fs::write(&path, folder.display().to_string()).expect("a file");
        let plan =
            try_plan(&file, text, &[&first, &second]).unwrap_or_else(|errors| panic!("{}", render(&errors, false)));
        assert_eq!(found(plan), path);
    }
    // A folder in the file's place is no file, optional or not.
    fs::remove_file(beside.join("models/duck.mesh")).expect("removed");
    fs::create_dir(beside.join("models/duck.mesh")).expect("a folder");
    let errors = try_plan(&file, &optional, &[&first]).err().expect("an unreadable file");
    assert!(errors[0].message.starts_with("cannot read "), "{}", errors[0].message);
}

/// The lines of a template's settings.
fn held_lines(text: &str) -> impl Iterator<Item = &str> {
    text.lines()
        .skip_while(|line| *line != "[settings]")
        .take_while(|line| *line != "[vary]")
}

/// Whether a line is the head of a table, not a sentence that begins with a list.
fn heads(line: &str) -> bool {
    let key = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    key.is_some_and(|key| key.chars().all(|c| c.is_ascii_alphanumeric() || "._-".contains(c)))
}

#[test]
fn the_template_of_every_method_plans() {
    let all: Vec<&'static dyn Method> = methods().iter().chain(METHODS).copied().collect();
    for method in &all {
        let text = template(*method);
        let experiment = Experiment::parse(Path::new("new.toml"), &text, &all)
            .unwrap_or_else(|errors| panic!("{text}\n{}", render(&errors, false)));
        assert!(
            experiment.origin.warnings.is_empty(),
            "{}",
            render(&experiment.origin.warnings, false)
        );
        let plan =
            Plan::new(experiment, &Lookup::default()).unwrap_or_else(|errors| panic!("{}", render(&errors, false)));
        assert!(plan.jobs.len() > 1);
        // Every default that stands in a comment may be written out: all settings uncommented plan too.
        let held: String = held_lines(&text).fold(String::new(), |text, line| {
            let body = line.strip_prefix("# ").unwrap_or(line);
            let code = heads(body) || body.split_once(" = ").is_some_and(|(key, _)| !key.contains(' '));
            if code { text + body + "\n" } else { text }
        });
        let rest: String = text
            .lines()
            .take_while(|line| *line != "[settings]")
            .fold(String::new(), |text, line| text + line + "\n");
        let full = format!("{rest}{held}");
        Experiment::parse(Path::new("full.toml"), &full, &all)
            .unwrap_or_else(|errors| panic!("{full}\n{}", render(&errors, false)));
        // Without the examples they change nothing.
        let mut comment = String::new();
        let mut defaults = String::new();
        for line in held_lines(&text) {
            let body = line.strip_prefix("# ").unwrap_or(line);
            let code = body.split_once(" = ").is_some_and(|(key, _)| !key.contains(' '));
            if code && !comment.contains("this is an example") && !defaults.contains("[settings.") {
                defaults = defaults + body + "\n";
            }
            if heads(body) {
                let whole = body == "[settings]";
                defaults += if whole { "[settings]\n" } else { "# [settings.\n" };
            }
            comment = if code { String::new() } else { comment + " " + body };
        }
        let parse = |text: &str| Experiment::parse(Path::new("defaults.toml"), text, &all).expect("an experiment");
        let (given, silent) = (parse(&format!("{rest}{defaults}")), parse(&rest));
        assert_eq!(
            method.canonical(given.settings),
            method.canonical(silent.settings),
            "{defaults}"
        );
        assert!(paths(method.settings()).len() <= held.lines().count() + 1, "{held}");
    }
}

#[test]
fn every_experiment_that_ships_plans() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments");
    let mut files: Vec<PathBuf> = Vec::new();
    let mut folders = vec![folder];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "toml") {
                files.push(path);
            }
        }
    }
    let mut count = 0;
    let mut names = BTreeSet::new();
    for path in files {
        let text = fs::read_to_string(&path).expect("a file");
        // Printed figures are data of experiments.
        if path.file_name().is_some_and(|name| name == "published.toml") {
            continue;
        }
        let experiment =
            Experiment::parse(&path, &text, methods()).unwrap_or_else(|errors| panic!("{}", render(&errors, false)));
        // All of them can be run by one command.
        assert!(
            names.insert(experiment.name.clone()),
            "two files named {}",
            experiment.name
        );
        let claims = experiment.claims.clone();
        let plan =
            Plan::new(experiment, &Lookup::default()).unwrap_or_else(|errors| panic!("{}", render(&errors, false)));
        assert!(
            plan.jobs.iter().any(|job| job.resolved.is_some()),
            "{} runs nothing on a bare machine",
            path.display()
        );
        count += 1;
        let known = |claim: &String| CLAIMS.iter().any(|known| known.id == claim);
        assert!(claims.iter().all(known), "{}", path.display());
    }
    assert!(count >= 10, "{count} experiments");
}

/// Every object of a schema that lists properties.
fn property_names(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(entries) => {
            if let Some(Value::Object(properties)) = entries.get("properties") {
                found.extend(properties.keys().cloned());
            }
            entries.values().for_each(|value| property_names(value, found));
        }
        Value::Array(items) => items.iter().for_each(|value| property_names(value, found)),
        _ => {}
    }
}

#[test]
fn the_schema_holds_every_declaration() {
    let schema = schema(METHODS);
    let mut found = BTreeSet::new();
    property_names(&schema, &mut found);
    let keys = [EXPERIMENT, TABLE, PLOT, RATE, EXPECT]
        .into_iter()
        .flatten()
        .map(|key| key.name.to_owned());
    let parameters = [
        "tetrahedra",
        "length",
        "swirl",
        "scale",
        "model.tetrahedra",
        "model.target.swirl",
        "inverted",
    ];
    for name in keys.chain(paths(SETTINGS)).chain(parameters.map(str::to_owned)) {
        assert!(found.contains(&name), "{name}");
    }
    for path in paths(SETTINGS) {
        let definition = &schema["$defs"][format!("tiny.settings.{path}")];
        assert!(definition["description"].is_string(), "{path}: {definition}");
    }
    assert_eq!(schema["$defs"]["tiny.settings.cache"]["default"], json!("1 MiB"));
    assert_eq!(schema["$defs"]["tiny.settings.order"]["maximum"], json!(16));
    // Every reference has its definition.
    let text = schema.to_string();
    for (at, _) in text.match_indices("\"#/$defs/") {
        let name = text[at + 9..].split('"').next().expect("an end");
        assert!(schema["$defs"].get(name).is_some(), "{name}");
    }
}

#[test]
fn quoted_text_is_read_back() {
    for text in ["", "a \"b\" \\c", "line\nbreak\t\u{7f}\u{1}", "\u{fc}\u{1f600}"] {
        let source = std::sync::Arc::new(vargeo::experiment::diagnostic::Source {
            name: String::new(),
            text: format!("a = {}", document::quote(text)),
        });
        let table = document::parse(&source).expect("valid TOML");
        assert!(
            matches!(&table.entries[0].value.content, Content::Text(read) if read == text),
            "{}",
            source.text
        );
    }
}
