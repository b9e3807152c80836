//! Reads `[[expect]]`: bounds of columns, comparisons between jobs, and stop reasons.

use super::outputs::{bound, unknown_column};
use super::{Context, entries, sections};
use crate::experiment::check::Checker;
use crate::experiment::column;
use crate::experiment::document::{Content, Entry, Node, Table};
use crate::experiment::file::{Bound, Comparison, Condition, Expectation};
use crate::experiment::grid::{self, Point};
use crate::experiment::nearest::nearest;
use crate::experiment::section::{BOUND, COMPARISON, EXPECT};
use crate::method::setting::Kind;
use serde_json::Value;

/// All expectations of a file.
pub fn read(checker: &mut Checker, file: &Table, context: &Context<'_>) -> Vec<Expectation> {
    sections(checker, file, "expect")
        .iter()
        .filter_map(|node| read_one(checker, node, context))
        .collect()
}

fn read_one(checker: &mut Checker, node: &Node, context: &Context<'_>) -> Option<Expectation> {
    let table = checker.table(node, "expect")?;
    let found = entries(checker, EXPECT, table, "[[expect]]", node.span.clone(), true);
    let mut expectation = Expectation {
        condition: found
            .nodes
            .get("where")
            .and_then(|entry| context.condition(checker, &entry.value, "where"))
            .unwrap_or_default(),
        stop: found.text("stop"),
        bounds: Default::default(),
        comparisons: Vec::new(),
        line: 1 + checker.source.text[..node.span.start].matches('\n').count(),
    };
    for entry in &found.others {
        let known = column::columns(context.method);
        if !known.iter().any(|column| column.name == entry.key) {
            match nearest(&entry.key, EXPECT.iter().map(|key| key.name)) {
                Some(_) => {
                    let keys = EXPECT
                        .iter()
                        .map(|key| key.name)
                        .chain(known.iter().map(|column| column.name));
                    checker.unknown_key(entry, "[[expect]]", keys);
                }
                None => unknown_column(checker, entry.key_span.clone(), &entry.key, context),
            }
            continue;
        }
        column_expectation(checker, entry, context, &mut expectation);
    }
    if found.others.is_empty() && expectation.stop.is_none() && table.get("stop").is_none() {
        checker
            .error(node.span.clone(), "an expectation that says nothing")
            .help = Some("add a metric with its bound, such as inverted = 0, or stop = \"converged\"".to_owned());
    }
    Some(expectation)
}

/// `inverted = 0`, `d_ma = { max = 20.0 }` or `d_ma = { less_than = { energy = "dirichlet" }, factor = 0.5 }`.
fn column_expectation(checker: &mut Checker, entry: &Entry, context: &Context<'_>, expectation: &mut Expectation) {
    let name = entry.key.as_str();
    let table = match &entry.value.content {
        Content::Table(table) => table,
        Content::Integer(_) | Content::Number(_) => {
            let any = Kind::Number {
                min: f64::MIN,
                max: f64::MAX,
            };
            if let Some(value) = checker.value(&any, &entry.value, name) {
                let equals = Bound {
                    equals: value.as_f64(),
                    ..Bound::default()
                };
                expectation.bounds.insert(name.to_owned(), equals);
            }
            return;
        }
        _ => {
            checker.wrong_type(&entry.value, name, "a number, or a table such as { max = 20.0 }");
            return;
        }
    };
    let compared = |entry: &&Entry| COMPARISON.iter().any(|key| key.name == entry.key);
    let split = |compare: bool| Table {
        entries: table
            .entries
            .iter()
            .filter(|entry| compared(entry) == compare)
            .cloned()
            .collect(),
    };
    let (comparison, rest) = (split(true), split(false));
    for unknown in rest
        .entries
        .iter()
        .filter(|entry| !BOUND.iter().any(|field| field.name == entry.key))
    {
        let known = BOUND
            .iter()
            .map(|field| field.name)
            .chain(COMPARISON.iter().map(|key| key.name));
        checker.unknown_key(unknown, &format!("the bound of \"{name}\""), known);
    }
    let known = Table {
        entries: rest
            .entries
            .into_iter()
            .filter(|entry| BOUND.iter().any(|field| field.name == entry.key))
            .collect(),
    };
    if !known.entries.is_empty() || comparison.entries.is_empty() {
        let span = entry.value.span.clone();
        let values = checker.fields(BOUND, Some(&known), name, span.clone(), &Default::default());
        // A table with nothing but unknown keys has been told already.
        let silent = known.entries.is_empty() && !table.entries.is_empty();
        if let (Some(values), false) = (values, silent)
            && let Some(bound) = bound(checker, &Value::Object(values), span, name)
        {
            expectation.bounds.insert(name.to_owned(), bound);
        }
    }
    if !comparison.entries.is_empty() {
        let owner = format!("the bound of \"{name}\"");
        let found = entries(
            checker,
            COMPARISON,
            &comparison,
            &owner,
            entry.value.span.clone(),
            false,
        );
        let factor = found.values.get("factor").and_then(Value::as_f64);
        if let Some(other) = found.nodes.get("less_than")
            && let Some(condition) = other_job(checker, &other.value, context, &expectation.condition)
        {
            expectation.comparisons.push(Comparison {
                metric: name.to_owned(),
                other: condition,
                factor: factor.unwrap_or(1.0),
            });
        }
    }
}

/// The condition that tells the other jobs of each comparison: those that have its values and agree in every other axis.
fn other_job(checker: &mut Checker, node: &Node, context: &Context<'_>, these: &Condition) -> Option<Condition> {
    let other = super::axes::condition(checker, node, "less_than", context.axes)?;
    let chosen = || context.points.iter().filter(|point| grid::matches(these, point));
    // The others themselves are compared with nothing, unless the expectation speaks of no other job.
    let only_others = chosen().all(|point| grid::matches(&other, point));
    for point in chosen().filter(|point| only_others || !grid::matches(&other, point)) {
        let agree = |candidate: &Point| {
            let pairs = candidate.iter().zip(point);
            pairs
                .into_iter()
                .all(|(theirs, ours)| other.contains_key(&theirs.0) || theirs == ours)
        };
        let partner = |candidate: &&Point| grid::matches(&other, candidate) && agree(candidate) && *candidate != point;
        if !context.points.iter().any(|candidate| partner(&candidate)) {
            let message = format!(
                "the job with {} has no other to be compared with",
                grid::describe(point)
            );
            let diagnostic = checker.error(node.span.clone(), message);
            diagnostic.label = "expected axis values that another job has, all else equal".to_owned();
            diagnostic.help = Some("narrow the expectation with \"where\"".to_owned());
            return None;
        }
    }
    Some(other)
}
