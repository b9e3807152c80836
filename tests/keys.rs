//! Keys: what may change without changing them, and that everything else does.

use crate::tiny_method::{METHODS, SETTINGS};
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use vargeo::experiment::diagnostic::render;
use vargeo::experiment::file::Experiment;
use vargeo::experiment::job::{Job, Key, sha256};
use vargeo::experiment::plan::{Lookup, Plan};
use vargeo::experiment::read::axes::{declared, paths};
use vargeo::method::setting::Kind;

/// The resolved jobs of a file.
fn jobs(path: &Path, text: &str) -> Vec<(Key, Job)> {
    let experiment = Experiment::parse(path, text, METHODS);
    let plan = experiment.and_then(|experiment| Plan::new(experiment, &Lookup::default()));
    let plan = plan.unwrap_or_else(|errors| panic!("{text}\n{}", render(&errors, false)));
    plan.jobs.into_iter().filter_map(|job| job.resolved).collect()
}

fn keys(text: &str) -> BTreeSet<Key> {
    jobs(Path::new("question.toml"), text)
        .into_iter()
        .map(|(key, _)| key)
        .collect()
}

fn key(text: &str) -> Key {
    keys(text).into_iter().next().expect("a job")
}

/// The same sections and entries, each with other ways to write it.
const SECTIONS: &[(&str, &[&[&str]])] = &[
    (
        "[models.bar]",
        &[
            &[
                "mesh = { generate = \"bar\", tetrahedra = 1_000 }",
                "mesh = { tetrahedra = 0x3e8, generate = 'bar', length = 2 }",
                "mesh.generate = \"bar\"\nmesh.tetrahedra = 1000",
            ],
            &[
                "target = { shape = \"cube\" }",
                "target = { shape = \"cube\", swirl = -0.0 }",
            ],
        ],
    ),
    (
        "[settings]",
        &[
            &["lambda = 2", "lambda = 2.0", "lambda = 0.2e1"],
            &["patience = \"1.5 min\"", "patience = \"90 s\"", "patience = '90000ms'"],
            &["cache = \"2 KiB\"", "cache = \"2048 B\""],
            &[
                "newton = { omega = 5 }",
                "newton = { relaxation = true, omega = 5e0 }",
                "newton.omega = 5",
            ],
            // A default, written out or not.
            &["", "order = 2"],
        ],
    ),
    (
        "[vary]",
        &[
            &[
                "energy = [\"arap\", \"stretch\"]",
                "energy = [\n  'stretch', # first\n  'arap',\n]",
            ],
            &["untangle = [true, false]"],
        ],
    ),
    ("[limits]", &[&["time = \"1 h\"", ""]]),
    ("[timing]", &[&["repeat = 3", "exclusive = true", ""]]),
    (
        "[[table]]",
        &[&["name = \"a\"", "name = \"b\""], &["columns = [\"d_ma\"]"]],
    ),
];

/// A file with its sections and entries in this order, this choice of writing and this noise.
fn write(order: &[usize], choices: &[usize]) -> String {
    let mut choices = choices.iter().copied().cycle();
    let mut choose = || choices.next().unwrap_or(0);
    let mut text = String::from(["", "title = \"x\"\n", "description = '''y'''\n"][choose() % 3]);
    text.push_str("method = \"tiny\"\n");
    for &section in order {
        let (header, entries) = SECTIONS[section];
        text.push_str(["", "\n\n", "# a comment\n"][choose() % 3]);
        text.push_str(header);
        text.push_str(["\n", "   # of the section\n", "\n\n"][choose() % 3]);
        let first = choose();
        for index in 0..entries.len() {
            let ways = entries[(index + first) % entries.len()];
            text.push_str(ways[choose() % ways.len()]);
            text.push_str(["\n", "\t # of the entry\n", "\n\n"][choose() % 3]);
        }
    }
    text
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn order_comments_and_writing_keep_the_keys(
        order in Just((0..SECTIONS.len()).collect::<Vec<_>>()).prop_shuffle(),
        choices in prop::collection::vec(0usize..12, 40),
    ) {
        let plain = write(&[0, 1, 2, 3, 4, 5], &[0]);
        prop_assert_eq!(keys(&plain).len(), 4);
        prop_assert_eq!(keys(&write(&order, &choices)), keys(&plain));
    }
}

const HEAD: &str = "method = \"tiny\"\n[models.ball]\nmesh = { generate = \"ball\" }\n";

/// A value of this kind in TOML that is not the default of any setting.
fn other(kind: &Kind) -> String {
    match kind {
        Kind::Boolean => "false".into(),
        Kind::Integer { .. } => "3".into(),
        Kind::Number { .. } => "3.25".into(),
        Kind::Choice(words) => format!("\"{}\"", words.last().expect("words").0),
        Kind::Named(words) => format!("\"{}\"", words().last().expect("words").0),
        Kind::Text | Kind::File => "\"other\"".into(),
        Kind::Duration => "\"3 s\"".into(),
        Kind::Size => "\"3 B\"".into(),
        Kind::List(kind) => format!("[{}]", other(kind)),
        Kind::OneOf(kinds) => other(&kinds[0]),
        Kind::Table(fields) => format!("{{ {} = {} }}", fields[0].name, other(&fields[0].kind)),
    }
}

#[test]
fn every_setting_has_a_share_in_the_key() {
    let mut seen = BTreeSet::from([key(HEAD)]);
    let mut count = 1;
    for path in paths(SETTINGS).into_iter().filter(|path| path != "newton") {
        let field = declared(SETTINGS, &path).expect("a declared setting");
        seen.insert(key(&format!("{HEAD}[settings]\n{path} = {}\n", other(&field.kind))));
        count += 1;
        assert_eq!(seen.len(), count, "{path}");
    }
    assert_eq!(count, 1 + SETTINGS.len() - 1 + 3);
}

#[test]
fn every_part_of_a_model_has_a_share_in_the_key() {
    let model = |parts: &str| key(&format!("method = \"tiny\"\n[models.m]\n{parts}"));
    let all = [
        "mesh = { generate = \"ball\" }",
        "mesh = { generate = \"ball\", tetrahedra = 101 }",
        "mesh = { generate = \"bar\", tetrahedra = 101 }",
        "mesh = { generate = \"bar\", tetrahedra = 101, length = 3 }",
        "mesh = { generate = \"ball\" }\ntarget = { shape = \"cube\" }",
        "mesh = { generate = \"ball\" }\ntarget = { shape = \"cube\", swirl = 1 }",
    ];
    let keys: BTreeSet<Key> = all.iter().map(|parts| model(parts)).collect();
    assert_eq!(keys.len(), all.len());
    // The model's name is a name.
    assert_eq!(key(HEAD), model("mesh = { generate = \"ball\" }"));
}

#[test]
fn files_enter_by_their_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &str| fs::write(folder.path().join(name), bytes).expect("a file");
    let key = |part: &str| {
        let text = format!("method = \"tiny\"\n[models.m]\nmesh = {part}");
        jobs(&folder.path().join("question.toml"), &text)[0].0.clone()
    };
    let medit = "MeshVersionFormatted 1\nDimension 3\nVertices 0\nEnd\n";
    write("duck.mesh", medit);
    write("renamed.txt", medit);
    write("moved.mesh", &format!("{medit}\n"));
    let duck = key("\"duck.mesh\"");
    assert_eq!(duck, key("\"renamed.txt\""));
    assert_eq!(duck, key("{ file = \"./duck.mesh\", scale = 1 }"));
    assert_ne!(duck, key("\"moved.mesh\""));
    assert_ne!(duck, key("{ file = \"duck.mesh\", scale = 2 }"));
    write("duck.mesh", &medit.replace('0', "1"));
    assert_ne!(duck, key("\"duck.mesh\""));
}

#[test]
fn settings_without_effect_have_no_share() {
    let with = |settings: &str| key(&format!("{HEAD}[settings]\nsolver = \"l-bfgs\"\n{settings}"));
    assert_eq!(with(""), with("newton = { omega = 7 }"));
}

#[test]
fn the_canonical_text_stays_as_it_is() {
    let (key, job) = jobs(
        Path::new("q.toml"),
        &format!("{HEAD}target = {{ shape = \"cube\", swirl = 0.1 }}"),
    )
    .remove(0);
    assert_eq!(
        job.canonical(),
        concat!(
            r#"{"method":"tiny","method_version":3,"model":{"mesh":{"generated":{"generator":"ball","#,
            r#""parameters":{"tetrahedra":100}}},"target":{"generated":{"generator":"cube","parameters":{"swirl":0.1}}}},"#,
            r#""record_schema":1,"settings":{"barrier":"auto","cache":1048576,"energy":"stretch","lambda":0.5,"#,
            r#""newton":{"omega":100000000.0,"relaxation":true},"order":2,"solver":"newton","untangle":true}}"#
        )
    );
    assert_eq!(key.0, sha256(job.canonical().as_bytes()));
    // FIPS 180-4, the example of one block.
    assert_eq!(
        sha256(b"abc"),
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    );
    // What is not in the file.
    for changed in [
        Job {
            record_schema: 2,
            ..job.clone()
        },
        Job {
            method_version: 4,
            ..job.clone()
        },
        Job {
            method: "tinier".into(),
            ..job.clone()
        },
    ] {
        assert_ne!(Key::of(&changed), key);
    }
    // A job that went through a record has the same key.
    let stored: Job = serde_json::from_str(&serde_json::to_string(&job).expect("text")).expect("a job");
    assert_eq!(Key::of(&stored), key);
}
