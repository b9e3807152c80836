//! Reads `[[table]]`, `[[plot]]` and `[[rate]]`.

use super::axes::{Axes, Known};
use super::{Context, Entries, axes, entries, file_name, published, sections};
use crate::experiment::check::Checker;
use crate::experiment::column;
use crate::experiment::document::{Entry, Node, Table};
use crate::experiment::file::{self, Axis, Bound, Plot, Rate};
use crate::experiment::grid;
use crate::experiment::nearest::{list, suggestion};
use crate::experiment::section::{PLOT, RATE, TABLE};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Names of files that a report writes by itself.
const RESERVED: &[&str] = &["index", "jobs", "macros"];

/// Tables, plots and rates; the names of each kind are unique.
pub fn read(checker: &mut Checker, file: &Table, context: &Context<'_>) -> (Vec<file::Table>, Vec<Plot>, Vec<Rate>) {
    let mut names = Names::new();
    let tables = sections(checker, file, "table")
        .iter()
        .filter_map(|node| table(checker, node, context, &mut names))
        .collect();
    let plots = sections(checker, file, "plot")
        .iter()
        .filter_map(|node| plot(checker, node, context, &mut names))
        .collect();
    let rates = sections(checker, file, "rate")
        .iter()
        .filter_map(|node| rate(checker, node, context, &mut names))
        .collect();
    (tables, plots, rates)
}

fn table(checker: &mut Checker, node: &Node, context: &Context<'_>, names: &mut Names) -> Option<file::Table> {
    let content = checker.table(node, "table")?;
    let found = entries(checker, TABLE, content, "[[table]]", node.span.clone(), false);
    let name = found.text("name")?;
    unique(checker, content.get("name"), node, &name, "table", names);
    let condition = condition(checker, &found, context);
    let columns = found
        .nodes
        .get("columns")
        .map_or_else(Vec::new, |entry| columns(checker, &entry.value, context));
    let across = match found.nodes.get("across") {
        Some(entry) => axes::axis_names(checker, &entry.value, "across", context.axes),
        None => Vec::new(),
    };
    let rows = match found.nodes.get("rows") {
        Some(entry) => axes::axis_names(checker, &entry.value, "rows", context.axes),
        None => {
            let all = varying(context).into_iter();
            all.filter(|axis| !across.contains(axis)).collect()
        }
    };
    if let (Some(entry), Some(twice)) = (
        found.nodes.get("across"),
        across.iter().find(|axis| rows.contains(axis)),
    ) {
        checker
            .error(
                entry.value.span.clone(),
                format!("axis \"{twice}\" is both in \"rows\" and \"across\""),
            )
            .help = Some("leave it in one of the two".to_owned());
    }
    if let Some(entry) = found.nodes.get("rows") {
        let told: Vec<String> = rows.iter().chain(&across).cloned().collect();
        indistinct(checker, entry, context, &condition, &told);
    }
    let published = found
        .nodes
        .get("published")
        .and_then(|entry| published::read(checker, &entry.value, context, &name, &columns));
    Some(file::Table {
        title: found.text("title"),
        name,
        rows,
        columns,
        across,
        condition,
        published,
    })
}

/// Warns when the rows of a table do not tell its jobs apart.
fn indistinct(
    checker: &mut Checker,
    entry: &Entry,
    context: &Context<'_>,
    condition: &file::Condition,
    rows: &[String],
) {
    let jobs: Vec<_> = context
        .points
        .iter()
        .filter(|point| grid::matches(condition, point))
        .collect();
    let heads: BTreeSet<String> = jobs
        .iter()
        .map(|point| {
            let head: Vec<_> = point.iter().filter(|(axis, _)| rows.contains(axis)).cloned().collect();
            grid::describe(&head)
        })
        .collect();
    if heads.len() < jobs.len() {
        let more: Vec<String> = varying(context)
            .into_iter()
            .filter(|axis| !rows.contains(axis))
            .collect();
        let rows = if heads.len() == 1 { "row" } else { "rows" };
        let message = format!("{} jobs fall into {} {rows}", jobs.len(), heads.len());
        checker.warning(entry.value.span.clone(), message).help = Some(format!(
            "add {} to the rows, or say which jobs with \"where\"",
            more.join(" or ")
        ));
    }
}

fn plot(checker: &mut Checker, node: &Node, context: &Context<'_>, names: &mut Names) -> Option<Plot> {
    let content = checker.table(node, "plot")?;
    let found = entries(checker, PLOT, content, "[[plot]]", node.span.clone(), false);
    let condition = condition(checker, &found, context);
    let (x, y) = coordinates(checker, &found, context, true);
    let series = series(checker, &found, context, x.as_deref());
    let (x, y) = (x?, y?);
    // A trace is a line of one job.
    let is_trace = |name: &str| context.method.traces().iter().any(|(trace, _)| *trace == name);
    if !(is_trace(&x) && is_trace(&y)) {
        mingled(checker, &found, context, &condition, &x, &series);
    }
    let name = found.text("name").unwrap_or_else(|| format!("{y}-{x}"));
    unique(checker, content.get("name"), node, &name, "plot", names);
    let log = found.text("log").unwrap_or_default();
    Some(Plot {
        title: found.text("title"),
        name,
        x,
        y,
        series,
        log_x: log.contains('x'),
        log_y: log.contains('y'),
        condition,
    })
}

fn rate(checker: &mut Checker, node: &Node, context: &Context<'_>, names: &mut Names) -> Option<Rate> {
    let content = checker.table(node, "rate")?;
    let found = entries(checker, RATE, content, "[[rate]]", node.span.clone(), false);
    let condition = condition(checker, &found, context);
    let (x, y) = coordinates(checker, &found, context, false);
    let series = series(checker, &found, context, x.as_deref());
    let window = found.values.get("window").and_then(|window| {
        let numbers: Vec<f64> = window.as_array()?.iter().filter_map(Value::as_f64).collect();
        match numbers[..] {
            [first, last] if first < last => Some([first, last]),
            _ => {
                checker
                    .error(content.get("window")?.value.span.clone(), "\"window\" is no interval")
                    .label = "expected [FIRST, LAST] with FIRST < LAST".to_owned();
                None
            }
        }
    });
    let expect = match (found.values.get("expect"), content.get("expect")) {
        (Some(value), Some(entry)) => bound(checker, value, entry.value.span.clone(), "expect"),
        _ => None,
    };
    let (x, y) = (x?, y?);
    mingled(checker, &found, context, &condition, &x, &series);
    let name = found.text("name").unwrap_or_else(|| format!("{y}-{x}-rate"));
    unique(checker, content.get("name"), node, &name, "rate", names);
    Some(Rate {
        name,
        x,
        y,
        series,
        condition,
        window,
        expect,
    })
}

/// Names by what they name.
type Names = BTreeSet<(&'static str, String)>;

fn unique(
    checker: &mut Checker,
    entry: Option<&Entry>,
    node: &Node,
    name: &str,
    what: &'static str,
    names: &mut Names,
) {
    let span = entry.map_or(node.span.clone(), |entry| entry.value.span.clone());
    if !file_name(checker, span.clone(), name) {
        return;
    }
    if RESERVED.contains(&name) {
        checker
            .error(span, format!("\"{name}\" is the name of a file that every report has"))
            .help = Some("choose another name".to_owned());
    } else if !names.insert((what, name.to_lowercase())) {
        checker
            .error(span, format!("another {what} has the name \"{name}\""))
            .help = Some(format!("give this {what} a name of its own: name = \"...\""));
    }
}

fn condition(checker: &mut Checker, found: &Entries<'_>, context: &Context<'_>) -> file::Condition {
    found
        .nodes
        .get("where")
        .and_then(|entry| context.condition(checker, &entry.value, "where"))
        .unwrap_or_default()
}

/// Axes that vary; the first axis when none does.
fn varying(context: &Context<'_>) -> Vec<String> {
    let mut names = context.axes.varying();
    if names.is_empty() {
        names.extend(context.axes.names().next().map(str::to_owned));
    }
    names
}

fn series(checker: &mut Checker, found: &Entries<'_>, context: &Context<'_>, x: Option<&str>) -> Vec<String> {
    match found.nodes.get("series") {
        Some(entry) => axes::axis_names(checker, &entry.value, "series", context.axes),
        None => {
            let refining = refining(context.axes, x.unwrap_or(""));
            let mut names = context.axes.varying();
            names.retain(|name| !refining.contains(name));
            names
        }
    }
}

/// The axes that refine towards `x`, which therefore tell no series apart: `x` itself and what is zipped with it;
/// where `x` is no axis but a figure such as an edge length, the models' numbers, save seeds, and what is zipped with
/// them.
fn refining(axes: &Axes, x: &str) -> Vec<String> {
    let measured = axes.find(x).is_none();
    let refines = |axis: &&Known| {
        let parameter = axis.name.starts_with("model.") && !axis.name.ends_with(".seed");
        axis.name == x || measured && parameter && numeric(axis)
    };
    let refined = axes.known.iter().filter(refines);
    let mut found: Vec<String> = refined.map(|axis| axis.name.clone()).collect();
    let zipped = |zip: &&Vec<Axis>| zip.iter().any(|axis| found.contains(&axis.name));
    let mates = axes.zips.iter().filter(zipped).flatten();
    let mates: Vec<String> = mates.map(|axis| axis.name.clone()).collect();
    found.extend(mates);
    found
}

fn numeric(axis: &Known) -> bool {
    let values = axis.values.as_deref().unwrap_or_default();
    !values.is_empty() && values.iter().all(Value::is_number)
}

/// Warns when a series joins jobs that differ in more than what refines them. Numbers may refine towards a measured x,
/// and seeds are spread.
fn mingled(
    checker: &mut Checker,
    found: &Entries<'_>,
    context: &Context<'_>,
    condition: &file::Condition,
    x: &str,
    series: &[String],
) {
    let Some(entry) = found.nodes.get("series") else {
        return;
    };
    let refining = refining(context.axes, x);
    let measured = context.axes.find(x).is_none();
    let seed = |name: &str| name == "seed" || name.ends_with(".seed");
    let left_out = |axis: &&Known| {
        let told = series.contains(&axis.name) || refining.contains(&axis.name);
        !(told || seed(&axis.name) || measured && numeric(axis))
    };
    // Within a series alone: an axis that is zipped with one of the series goes with it.
    let differ = |name: &str| {
        let mut known = BTreeMap::new();
        let mut jobs = context.points.iter().filter(|point| grid::matches(condition, point));
        jobs.any(|point| {
            let told: Vec<_> = point
                .iter()
                .filter(|(axis, _)| series.contains(axis))
                .cloned()
                .collect();
            let value = point.iter().find(|(axis, _)| axis == name).map(|(_, value)| value);
            *known.entry(grid::describe(&told)).or_insert(value) != value
        })
    };
    let names: Vec<&str> = context
        .axes
        .known
        .iter()
        .filter(left_out)
        .map(|axis| axis.name.as_str())
        .filter(|name| differ(name))
        .collect();
    if !names.is_empty() {
        let names = names.join(" and ");
        let message = format!("each series joins jobs that differ in {names}");
        checker.warning(entry.value.span.clone(), message).help =
            Some(format!("add {names} to \"series\", or say which jobs with \"where\""));
    }
}

/// A list of columns, each known and none twice.
fn columns(checker: &mut Checker, node: &Node, context: &Context<'_>) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    let Some(items) = checker.list(node, "columns") else {
        return names;
    };
    if items.is_empty() {
        checker.error(node.span.clone(), "\"columns\" is empty").label = "expected at least one metric".to_owned();
    }
    for item in items {
        let Some(text) = checker.text(item, "columns").map(str::to_owned) else {
            continue;
        };
        if column::find(context.method, &text).is_none() {
            unknown_column(checker, item.span.clone(), &text, context);
        } else if names.contains(&text) {
            checker
                .error(item.span.clone(), format!("column \"{text}\" stands twice"))
                .help = Some("remove one of the two".to_owned());
        } else {
            names.push(text);
        }
    }
    names
}

/// A name that is no column of the method.
pub fn unknown_column(checker: &mut Checker, span: Range<usize>, name: &str, context: &Context<'_>) {
    let known: Vec<&str> = column::columns(context.method)
        .iter()
        .map(|column| column.name)
        .collect();
    if let Some(axis) = context.axes.names().find(|axis| *axis == name) {
        checker.error(span, format!("\"{axis}\" is an axis, not a metric")).help =
            Some("axes stand in \"rows\", \"series\" and \"where\"".to_owned());
        return;
    }
    checker.unknown_name(span, "metric", name, known);
}

/// What a coordinate may be; the same word may be several of these.
#[derive(Clone, Copy)]
struct Meanings {
    trace: bool,
    /// A column or an axis of numbers.
    number: bool,
    /// An axis of words.
    word: bool,
}

/// The names of x and y. `traces` where these may be plotted, and then x may be an axis of words too.
fn coordinates(
    checker: &mut Checker,
    found: &Entries<'_>,
    context: &Context<'_>,
    traces: bool,
) -> (Option<String>, Option<String>) {
    let mut read = |key: &str| {
        let entry = found.nodes.get(key)?;
        let name = checker.text(&entry.value, key)?.to_owned();
        let meanings = meanings(checker, entry, &name, context, traces)?;
        Some((name, meanings))
    };
    let (x, y) = (read("x"), read("y"));
    if let (Some((x_name, x)), Some((y_name, y)), Some(entry)) = (&x, &y, found.nodes.get("y"))
        && !(x.trace && y.trace || (x.number || x.word) && y.number)
    {
        let message = match (x.trace, y.trace) {
            (true, _) => format!("\"{x_name}\" is a trace, \"{y_name}\" is one number of each job"),
            (_, true) => format!("\"{y_name}\" is a trace, \"{x_name}\" is one value of each job"),
            _ => format!("axis \"{y_name}\" has values that are no numbers"),
        };
        let known: Vec<&str> = if x.trace {
            context.method.traces().iter().map(|(trace, _)| *trace).collect()
        } else {
            column::columns(context.method)
                .iter()
                .map(|column| column.name)
                .collect()
        };
        checker.error(entry.value.span.clone(), message).help = list(&known);
    }
    (x.map(|(name, _)| name), y.map(|(name, _)| name))
}

fn meanings(checker: &mut Checker, entry: &Entry, name: &str, context: &Context<'_>, plot: bool) -> Option<Meanings> {
    let axis = context.axes.find(name);
    let numeric = |values: &Vec<Value>| values.iter().all(Value::is_number);
    let numbers = axis.is_some_and(|axis| axis.values.as_ref().is_none_or(numeric));
    let meanings = Meanings {
        trace: plot && context.method.traces().iter().any(|(trace, _)| *trace == name),
        number: column::find(context.method, name).is_some() || numbers,
        word: plot && axis.is_some() && !numbers,
    };
    if meanings.trace || meanings.number || meanings.word {
        return Some(meanings);
    }
    let span = entry.value.span.clone();
    if axis.is_some() {
        checker
            .error(span, format!("axis \"{name}\" has values that are no numbers"))
            .help = Some("use it in \"series\"".to_owned());
        return None;
    }
    let traces = context.method.traces().iter().map(|(trace, _)| *trace).filter(|_| plot);
    let columns = column::columns(context.method);
    let known: Vec<&str> = traces
        .chain(columns.iter().map(|column| column.name))
        .chain(context.axes.names())
        .collect();
    let what = if plot {
        "trace, metric or axis"
    } else {
        "metric or axis"
    };
    checker.error(span, format!("unknown {what} \"{name}\"")).help = suggestion(name, known);
    None
}

/// A bound from its checked table.
pub fn bound(checker: &mut Checker, value: &Value, span: Range<usize>, name: &str) -> Option<Bound> {
    let get = |key: &str| value.get(key).and_then(Value::as_f64);
    let bound = Bound {
        min: get("min"),
        max: get("max"),
        equals: get("equals"),
        tolerance: get("tolerance"),
    };
    let wrong = match bound {
        Bound {
            min: None,
            max: None,
            equals: None,
            ..
        } => "says nothing",
        Bound {
            min: Some(min),
            max: Some(max),
            ..
        } if min > max => "has \"min\" above \"max\"",
        Bound {
            equals: None,
            tolerance: Some(_),
            ..
        } => "has a tolerance and no \"equals\"",
        Bound {
            equals: Some(_),
            min,
            max,
            ..
        } if min.is_some() || max.is_some() => "has \"equals\" beside a range",
        _ => return Some(bound),
    };
    checker.error(span, format!("\"{name}\" {wrong}")).label =
        "expected { min = ..., max = ... } or { equals = ..., tolerance = ... }".to_owned();
    None
}
