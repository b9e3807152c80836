//! A commented experiment to start from, generated from a method's declarations.
//!
//! Guarantees that the text reads and plans without an error: it generates its models, varies the method's first setting
//! with named values, and mentions everything else in comments with its default.

use super::check::expectation;
use super::claims::CLAIMS;
use super::document::quote;
use super::section::{LIMITS, TIMING};
use crate::method::Method;
use crate::method::model::Role;
use crate::method::setting::{Default, Field, Kind, fill};
use serde_json::Value;
use std::fmt::Write;

/// Widest line of the comments.
const WIDTH: usize = 100;

/// The text of an experiment file for a method.
pub fn template(method: &dyn Method) -> String {
    let mut text = String::new();
    comment(
        &mut text,
        &format!("An experiment with {}: it {}.", method.name(), method.summary()),
    );
    comment(
        &mut text,
        &format!("Source: {}.", method.source().trim_end_matches('.')),
    );
    comment(
        &mut text,
        "`vargeo plan FILE` shows its jobs, `vargeo run FILE` runs them and writes the report.",
    );
    let varied = varied(method.settings());
    let question = match &varied {
        Some((name, _)) => format!("What difference does the {name} make?"),
        None => "What is the question?".to_owned(),
    };
    let _ = write!(
        text,
        "\ntitle = {}\nmethod = {}\n\n",
        quote(&question),
        quote(method.name())
    );
    if let Some(claim) = CLAIMS.iter().find(|claim| claim.method == method.name()) {
        comment(
            &mut text,
            "Claims of the paper that the file reproduces; `vargeo list claims` has them.",
        );
        let _ = writeln!(text, "# claims = [{}]\n", quote(claim.id));
    }
    models(&mut text, method);
    comment(
        &mut text,
        "Held for every job. What stands in comments is the default, or an example where there is none.",
    );
    text.push_str("[settings]\n");
    let held = varied.as_ref().map(|(name, _)| *name);
    // What the method makes of no settings at all: presets decide what the declarations leave open.
    let resolved = method.canonical(Value::Object(fill(method.settings(), &Value::Null)));
    fields(&mut text, method.settings(), "settings", held, &resolved);
    comment(
        &mut text,
        "The grid: every combination of the values of these axes is a job. An axis is \"model\", a setting",
    );
    comment(
        &mut text,
        "(one within a table as \"table.setting\"), or \"model.PARAMETER\" of the generated mesh.",
    );
    text.push_str("[vary]\n");
    match &varied {
        Some((name, values)) => {
            let values: Vec<String> = values.iter().map(|value| quote(value)).collect();
            let _ = writeln!(text, "{name} = [{}]", values.join(", "));
        }
        None => text.push_str("# model = [\"NAME\", \"NAME\"]\n"),
    }
    sections(&mut text);
    outputs(&mut text, method, held);
    text
}

/// Comment lines of at most [`WIDTH`] characters.
fn comment(text: &mut String, words: &str) {
    let mut line = String::from("#");
    for word in words.split_whitespace() {
        if line.len() + 1 + word.len() > WIDTH && line.len() > 1 {
            text.push_str(&line);
            text.push('\n');
            line = String::from("#");
        }
        line.push(' ');
        line.push_str(word);
    }
    text.push_str(&line);
    text.push('\n');
}

/// The setting to vary: the first with words that are known at run time, else the first choice; with up to three words.
fn varied(fields: &[Field]) -> Option<(&'static str, Vec<String>)> {
    let words = |field: &Field| match &field.kind {
        Kind::Named(words) => words().into_iter().map(|(word, _)| word.to_owned()).collect(),
        Kind::Choice(words) => words.iter().map(|(word, _)| (*word).to_owned()).collect(),
        _ => Vec::new(),
    };
    let named = fields.iter().find(|field| matches!(field.kind, Kind::Named(_)));
    let field = named.or_else(|| fields.iter().find(|field| matches!(field.kind, Kind::Choice(_))))?;
    let mut words: Vec<String> = words(field);
    words.truncate(3);
    (!words.is_empty()).then_some((field.name, words))
}

/// A generated model, and how a file is given.
fn models(text: &mut String, method: &dyn Method) {
    let roles = method.model().roles;
    let first = roles.iter().find_map(|role| role.generators.first());
    let _ = writeln!(text, "[models.{}]", first.map_or("NAME", |generator| generator.name));
    for role in roles.iter().filter(|role| role.required || !role.generators.is_empty()) {
        comment(text, role.doc);
        let others: Vec<&str> = role.generators.iter().skip(1).map(|generator| generator.name).collect();
        if !others.is_empty() {
            comment(
                text,
                &format!(
                    "Others: {}; `vargeo list models` has their parameters.",
                    others.join(", ")
                ),
            );
        }
        match role.generators.first() {
            Some(generator) => {
                let mut parts = vec![format!("{} = {}", role.generator_key, quote(generator.name))];
                parts.extend(
                    generator
                        .parameters
                        .iter()
                        .filter(|field| !matches!(field.default, Default::Absent))
                        .map(|field| format!("{} = {}", field.name, literal(field))),
                );
                let _ = writeln!(text, "{} = {{ {} }}", role.name, parts.join(", "));
            }
            None => {
                let _ = writeln!(text, "{} = {}", role.name, quote(&format!("{}.mesh", role.name)));
            }
        }
    }
    text.push('\n');
    let files: Vec<&Role> = roles.iter().filter(|role| role.file).collect();
    if !files.is_empty() {
        comment(
            text,
            "A model from files, looked for beside this file and then in the folders of --models.",
        );
        text.push_str("# [models.mine]\n");
        for role in files {
            let _ = writeln!(text, "# {} = \"mine/{}.mesh\"", role.name, role.name);
        }
        text.push_str("# optional = true   # skipped with a notice where the files are absent\n\n");
    }
}

/// Every field as a comment with its default, or what the method resolved it to; required ones are written out, tables
/// follow under headers of their own.
fn fields(text: &mut String, fields: &[Field], path: &str, varied: Option<&str>, resolved: &Value) {
    let is_table = |field: &&Field| matches!(field.kind, Kind::Table(_));
    for field in fields
        .iter()
        .filter(|field| !is_table(field) && Some(field.name) != varied)
    {
        let chosen = resolved
            .get(field.name)
            .filter(|_| matches!(field.default, Default::Absent));
        let absent = match (&field.default, chosen) {
            (Default::Absent, None) => " Absent by default; this is an example.",
            _ => "",
        };
        comment(
            text,
            &format!("{} Expects {}.{absent}", field.doc, expectation(&field.kind)),
        );
        let mark = if matches!(field.default, Default::Required) {
            ""
        } else {
            "# "
        };
        let value = chosen.map_or_else(|| literal(field), toml);
        let _ = writeln!(text, "{mark}{} = {value}\n", field.name);
    }
    for field in fields.iter().filter(is_table) {
        if let Kind::Table(inner) = &field.kind {
            let required = matches!(field.default, Default::Required);
            let name = format!("{path}.{}", field.name);
            comment(text, field.doc);
            let _ = writeln!(text, "{}[{name}]", if required { "" } else { "# " });
            let within = resolved.get(field.name).unwrap_or(&Value::Null);
            self::fields(text, inner, &name, None, within);
        }
    }
}

/// A value on one line of TOML.
fn toml(value: &Value) -> String {
    match value {
        Value::String(text) => quote(text),
        Value::Number(value) => match value.as_i64() {
            Some(whole) => whole.to_string(),
            None => number(value.as_f64().unwrap_or_default()),
        },
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(toml).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Object(entries) => {
            let entries = entries.iter().map(|(name, value)| format!("{name} = {}", toml(value)));
            format!("{{ {} }}", entries.collect::<Vec<_>>().join(", "))
        }
        Value::Bool(_) | Value::Null => value.to_string(),
    }
}

/// A field's default in TOML, or a value that it may have.
fn literal(field: &Field) -> String {
    match &field.default {
        Default::Boolean(value) => value.to_string(),
        Default::Integer(value) => value.to_string(),
        Default::Number(value) => number(*value),
        Default::Text(text) => quote(text),
        Default::Required | Default::Absent | Default::Fields => example(&field.kind),
    }
}

/// A number that TOML reads as one with a fraction.
fn number(value: f64) -> String {
    let short = super::check::plain(value);
    if short.contains(['.', 'e', 'n']) {
        short
    } else {
        format!("{short}.0")
    }
}

/// A value of a kind.
fn example(kind: &Kind) -> String {
    match kind {
        Kind::Boolean => "true".to_owned(),
        Kind::Integer { min, max } => 1.clamp(*min, *max).to_string(),
        Kind::Number { min, max } => number(1f64.clamp(*min, *max)),
        Kind::Choice(words) => quote(words.first().map_or("", |(word, _)| word)),
        Kind::Named(words) => quote(words().first().map_or("", |(word, _)| word)),
        Kind::Text => "\"...\"".to_owned(),
        Kind::Duration => "\"10 min\"".to_owned(),
        Kind::Size => "\"8 GiB\"".to_owned(),
        Kind::File => "\"FILE\"".to_owned(),
        Kind::Table(fields) => {
            let required = fields.iter().filter(|field| matches!(field.default, Default::Required));
            let parts: Vec<String> = required
                .map(|field| format!("{} = {}", field.name, literal(field)))
                .collect();
            if parts.is_empty() {
                "{}".to_owned()
            } else {
                format!("{{ {} }}", parts.join(", "))
            }
        }
        Kind::List(kind) => format!("[{}]", example(kind)),
        Kind::OneOf(kinds) => kinds.first().map_or_else(String::new, example),
    }
}

/// The sections that an experiment may do without.
fn sections(text: &mut String) {
    text.push('\n');
    comment(text, "Axes that move together: give each equally many values.");
    text.push_str("# [[zip]]\n\n");
    comment(
        text,
        "Jobs to leave out, by the values of axes. One that matches nothing is an error.",
    );
    text.push_str("# [[exclude]]\n\n");
    comment(text, "Limits of each job; exceeding one is a row with its reason.");
    text.push_str("# [limits]\n");
    for field in LIMITS {
        let _ = writeln!(text, "# {} = {}   # {}", field.name, literal(field), field.doc);
    }
    text.push('\n');
    comment(text, "How times are taken.");
    text.push_str("# [timing]\n");
    for field in TIMING {
        let _ = writeln!(text, "# {} = {}   # {}", field.name, literal(field), field.doc);
    }
    text.push('\n');
}

/// A table, a plot and an expectation.
fn outputs(text: &mut String, method: &dyn Method, varied: Option<&str>) {
    let rows: Vec<String> = ["model"].into_iter().chain(varied).map(quote).collect();
    let metrics = method.metrics();
    let headline: Vec<&str> = match method.headline() {
        [] => metrics.iter().take(5).map(|metric| metric.name).collect(),
        headline => headline.to_vec(),
    };
    let columns: Vec<String> = headline.into_iter().chain(["seconds"]).map(quote).collect();
    comment(
        text,
        "A table of the report: axes that head the rows, metrics as columns; `vargeo list metrics` defines each.",
    );
    let _ = write!(
        text,
        "[[table]]\nname = \"comparison\"\nrows = [{}]\ncolumns = [{}]\n\n",
        rows.join(", "),
        columns.join(", ")
    );
    let traces = method.traces();
    let energy = traces.iter().position(|(name, _)| *name == "energy").unwrap_or(1);
    if let (Some((x, _)), Some((y, _))) = (traces.first(), traces.get(energy)) {
        comment(
            text,
            "A plot: a trace over another, or a metric over an axis; one line for each value of the series.",
        );
        let _ = write!(
            text,
            "[[plot]]\nx = {}\ny = {}\nseries = [{}]\n\n",
            quote(x),
            quote(y),
            rows.join(", ")
        );
    }
    comment(
        text,
        "A rate: the slope of log y against log x, where x is a metric or an axis of numbers, such as a model's parameter: \
         model.PARAMETER for its first part, model.ROLE.PARAMETER for another.",
    );
    text.push_str("# [[rate]]\n# x = \"model.PARAMETER\"\n# y = \"seconds\"\n# expect = { max = 1.5 }\n\n");
    comment(
        text,
        "What `vargeo check` gates: why jobs end, and bounds of metrics, such as NAME = 0 or",
    );
    comment(
        text,
        "NAME = { min = 1.0, max = 2.0 }, or NAME = { less_than = { AXIS = OTHER }, factor = 0.5 }, which compares with the \
         jobs that differ in that axis only; `where = { AXIS = VALUE }` chooses jobs.",
    );
    text.push_str("[[expect]]\nstop = \"converged\"\n");
}
