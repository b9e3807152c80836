//! Reads an experiment file: every name and value checked against the declarations, every error told in one go.
//!
//! Guarantees that an [`Experiment`] which is returned has a grid that can be walked, names only known axes and columns,
//! and conditions that match at least one job. Model files are looked for by the plan, not here.

pub mod axes;
mod expect;
pub mod models;
mod outputs;
mod published;

use super::check::Checker;
use super::diagnostic::{Diagnostic, Severity, Source};
use super::document::{self, Content, Entry, Node, Table};
use super::file::{Condition, Experiment, Limits, Model, Origin, Timing};
use super::grid::{self, Point};
use super::nearest::nearest;
use super::section::{EXPERIMENT, Holds, Key};
use crate::method::Method;
use axes::{Axes, Sets};
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// What the readers of sections share: the declarations and what is known of the file so far.
struct Context<'a> {
    method: &'static dyn Method,
    axes: &'a Axes,
    /// The jobs by their axis values; empty when the axes are wrong, and then nothing can be said of them.
    points: &'a [Point],
    folder: &'a Path,
}

impl Context<'_> {
    /// A condition that at least one job meets.
    fn condition(&self, checker: &mut Checker, node: &Node, name: &str) -> Option<Condition> {
        let condition = axes::condition(checker, node, name, self.axes)?;
        if !self.points.is_empty() && !self.points.iter().any(|point| grid::matches(&condition, point)) {
            checker
                .error(node.span.clone(), format!("\"{name}\" matches no job"))
                .help = Some("its values occur, but not together; see `vargeo plan`".to_owned());
            return None;
        }
        Some(condition)
    }
}

impl Experiment {
    /// Reads an experiment file. On success the warnings are in [`Origin::warnings`]; otherwise all diagnostics return.
    pub fn read(path: &Path, methods: &[&'static dyn Method]) -> Result<Experiment, Vec<Diagnostic>> {
        let name = path.display().to_string();
        let bytes = document::read(path).map_err(|error| {
            vec![
                Diagnostic::error(format!("cannot read {name}: {error}"))
                    .help("name an experiment file; `vargeo new` writes one to start from"),
            ]
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let valid = error.utf8_error().valid_up_to();
            let line = 1 + error.as_bytes()[..valid].iter().filter(|&&byte| byte == b'\n').count();
            vec![Diagnostic::error(format!("{name}:{line}: not UTF-8")).help("save the file as UTF-8")]
        })?;
        Experiment::parse(path, &text, methods)
    }

    /// Reads the text of an experiment file that stands, or would stand, at this path.
    pub fn parse(path: &Path, text: &str, methods: &[&'static dyn Method]) -> Result<Experiment, Vec<Diagnostic>> {
        let source = Arc::new(Source {
            name: path.display().to_string(),
            text: text.to_owned(),
        });
        let file = document::parse(&source)?;
        let mut checker = Checker::new(source);
        let experiment = read_file(&mut checker, path, &file, methods);
        let mut diagnostics = std::mem::take(&mut checker.diagnostics);
        diagnostics.sort_by_key(|diagnostic| diagnostic.place.as_ref().map_or(0, |place| place.span.start));
        // Two generators with the same parameter tell the same error of an axis twice.
        diagnostics.dedup();
        let wrong = diagnostics
            .iter()
            .any(|diagnostic| diagnostic.severity == Severity::Error);
        match experiment {
            Some(mut experiment) if !wrong => {
                experiment.origin.warnings = diagnostics;
                Ok(experiment)
            }
            _ => Err(diagnostics),
        }
    }
}

/// None when the method is unknown or the axes are wrong; otherwise the caller decides by the diagnostics.
fn read_file(checker: &mut Checker, path: &Path, file: &Table, methods: &[&'static dyn Method]) -> Option<Experiment> {
    let stem = path
        .file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let top = entries(checker, EXPERIMENT, file, "", 0..0, false);
    let limits = limits(&top);
    let timing = timing(&top);
    let method = method(checker, file, methods)?;

    let (vary, zips) = axes::named(checker, file);
    let varied = varied(
        method,
        file,
        vary.iter().chain(zips.iter().flatten()).map(|axis| axis.name.as_str()),
    );
    let (models, broken) = models::read(checker, method, file, &varied);
    let settings = settings(checker, method, file, &varied);
    let before = checker.diagnostics.len();
    let axes = axes::read(checker, method, &vary, &zips, &models, &broken);
    let axes_well = axes.well() && checker.diagnostics.len() == before;
    if let Some(settings) = &settings {
        tables_under_axes(checker, &axes, settings);
    }
    unused_models(checker, file, &axes, &models);

    let mut points = Vec::new();
    if axes_well {
        points = grid_points(checker, file, &axes);
    }
    let excludes = excludes(checker, file, &axes, &mut points);
    let context = Context {
        method,
        axes: &axes,
        points: &points,
        folder: path.parent().unwrap_or(Path::new("")),
    };
    let (tables, plots, rates) = outputs::read(checker, file, &context);
    let expectations = expect::read(checker, file, &context);
    let text = |key: &str| top.text(key);
    Some(Experiment {
        title: text("title").unwrap_or_else(|| stem.clone()),
        name: stem,
        description: text("description").unwrap_or_default(),
        method,
        claims: top
            .values
            .get("claims")
            .and_then(Value::as_array)
            .map(|claims| claims.iter().filter_map(Value::as_str).map(str::to_owned).collect())
            .unwrap_or_default(),
        origin: Origin {
            source: checker.source.clone(),
            folder: context.folder.to_owned(),
            places: std::mem::take(&mut checker.places),
            warnings: Vec::new(),
        },
        models: models.clone(),
        settings: Value::Object(settings?),
        axes: axes.vary.clone(),
        zips: axes.zips.clone(),
        excludes,
        limits,
        timing,
        tables,
        plots,
        rates,
        expectations,
    })
}

/// The entries of a section: plain values checked, others as nodes.
struct Entries<'n> {
    values: BTreeMap<&'static str, Value>,
    nodes: BTreeMap<&'static str, &'n Entry>,
    /// Keys that the section does not declare, where it may have such.
    others: Vec<&'n Entry>,
}

impl Entries<'_> {
    fn text(&self, key: &str) -> Option<String> {
        self.values.get(key).and_then(Value::as_str).map(str::to_owned)
    }
}

/// Checks the keys of a section and its plain values. `owner` is underlined when a required key is missing.
fn entries<'n>(
    checker: &mut Checker,
    keys: &'static [Key],
    table: &'n Table,
    section: &str,
    owner: Range<usize>,
    open: bool,
) -> Entries<'n> {
    let mut found = Entries {
        values: BTreeMap::new(),
        nodes: BTreeMap::new(),
        others: Vec::new(),
    };
    for entry in &table.entries {
        match keys.iter().find(|key| key.name == entry.key) {
            None if open => found.others.push(entry),
            None => checker.unknown_key(entry, section, keys.iter().map(|key| key.name)),
            Some(key) => {
                if let Holds::Plain(kind) = &key.holds {
                    if let Some(value) = checker.value(kind, &entry.value, key.name) {
                        found.values.insert(key.name, value);
                    }
                } else {
                    found.nodes.insert(key.name, entry);
                }
            }
        }
    }
    for key in keys {
        if key.required && table.get(key.name).is_none() && !section.is_empty() {
            checker
                .error(owner.clone(), format!("\"{}\" is missing in {section}", key.name))
                .help = Some(format!("add {} = ...: {}", key.name, key.doc));
        }
    }
    found
}

/// The tables of a section that stands as `[[name]]`.
fn sections<'n>(checker: &mut Checker, file: &'n Table, name: &str) -> &'n [Node] {
    let Some(entry) = file.get(name) else { return &[] };
    match &entry.value.content {
        Content::List(items) => items,
        Content::Table(_) => {
            checker
                .error(entry.key_span.clone(), format!("\"{name}\" is a table"))
                .help = Some(format!("write [[{name}]] with two brackets: there may be several"));
            &[]
        }
        _ => {
            checker.wrong_type(&entry.value, name, &format!("tables that begin with [[{name}]]"));
            &[]
        }
    }
}

fn method(checker: &mut Checker, file: &Table, methods: &[&'static dyn Method]) -> Option<&'static dyn Method> {
    let names = || methods.iter().map(|method| method.name());
    let Some(entry) = file.get("method") else {
        let known = names().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
        checker.error(0..0, "\"method\" is missing").help =
            Some(format!("add method = ... at the top, one of {known}"));
        return None;
    };
    checker.places.insert("method".to_owned(), entry.value.span.clone());
    let name = checker.text(&entry.value, "method")?.to_owned();
    let found = methods.iter().copied().find(|method| method.name() == name);
    if found.is_none() {
        checker.unknown_name(entry.value.span.clone(), "method", &name, names());
        // The rest is checked by the method that was probably meant.
        let meant = nearest(&name, names());
        return methods.iter().copied().find(|method| Some(method.name()) == meant);
    }
    found
}

fn limits(top: &Entries<'_>) -> Limits {
    let get = |key: &str| top.values.get("limits").and_then(|limits| limits.get(key));
    Limits {
        seconds: get("time").and_then(Value::as_f64),
        memory: get("memory").and_then(Value::as_u64),
    }
}

fn timing(top: &Entries<'_>) -> Timing {
    let get = |key: &str| top.values.get("timing").and_then(|timing| timing.get(key));
    let count = |key: &str| {
        get(key)
            .and_then(Value::as_u64)
            .and_then(|count| u32::try_from(count).ok())
    };
    Timing {
        exclusive: get("exclusive").and_then(Value::as_bool).unwrap_or(false),
        repeat: count("repeat").unwrap_or(1),
        threads: count("threads"),
    }
}

/// Dotted paths that axes set: of settings, and of each model's generators as `models.NAME.ROLE.PARAMETER`.
fn varied<'a>(method: &dyn Method, file: &Table, names: impl Iterator<Item = &'a str>) -> BTreeSet<String> {
    let models: Vec<&str> = match file.get("models").map(|entry| &entry.value.content) {
        Some(Content::Table(table)) => table.entries.iter().map(|entry| entry.key.as_str()).collect(),
        _ => Vec::new(),
    };
    let mut paths = BTreeSet::new();
    for name in names {
        match axes::parameter(method, name) {
            Some((role, parameter)) => {
                paths.extend(models.iter().map(|model| format!("models.{model}.{role}.{parameter}")));
            }
            None => {
                paths.insert(name.to_owned());
            }
        }
    }
    paths
}

fn settings(
    checker: &mut Checker,
    method: &'static dyn Method,
    file: &Table,
    varied: &BTreeSet<String>,
) -> Option<Map<String, Value>> {
    match file.get("settings") {
        None => {
            let span = file.get("method").map_or(0..0, |entry| entry.value.span.clone());
            checker.fields(method.settings(), None, "", span, varied)
        }
        Some(entry) => {
            let table = checker.table(&entry.value, "settings")?;
            checker.places.insert("settings".to_owned(), entry.key_span.clone());
            checker.fields(method.settings(), Some(table), "", entry.value.span.clone(), varied)
        }
    }
}

/// An axis such as `barrier.strength` needs `barrier` to be a table.
fn tables_under_axes(checker: &mut Checker, axes: &Axes, settings: &Map<String, Value>) {
    for axis in &axes.known {
        if !matches!(axis.sets, Some(Sets::Setting(_))) {
            continue;
        }
        let mut table = settings;
        let mut path = String::new();
        let parts: Vec<&str> = axis.name.split('.').collect();
        for part in &parts[..parts.len() - 1] {
            if !path.is_empty() {
                path.push('.');
            }
            path.push_str(part);
            match table.get(*part) {
                Some(Value::Object(inner)) => table = inner,
                // An absent table is filled with its defaults when the axis sets a part of it.
                None => break,
                Some(_) => {
                    let span = checker
                        .places
                        .get(&format!("vary.{}", axis.name))
                        .cloned()
                        .unwrap_or(0..0);
                    let message = format!("axis \"{}\" needs \"{path}\" to be a table", axis.name);
                    checker.error(span, message).help = Some(format!("write {path} = {{ ... }} under [settings]"));
                    break;
                }
            }
        }
    }
}

fn unused_models(checker: &mut Checker, file: &Table, axes: &Axes, models: &[Model]) {
    let Some(values) = axes.find("model").and_then(|axis| axis.values.as_ref()) else {
        return;
    };
    let Some(Content::Table(table)) = file.get("models").map(|entry| &entry.value.content) else {
        return;
    };
    for model in models {
        if !values.contains(&Value::from(model.name.as_str()))
            && let Some(entry) = table.get(&model.name)
        {
            checker
                .warning(entry.key_span.clone(), format!("model \"{}\" is not used", model.name))
                .help = Some("list it in the axis \"model\", or remove it".to_owned());
        }
    }
}

fn grid_points(checker: &mut Checker, file: &Table, axes: &Axes) -> Vec<Point> {
    let span = file
        .get("vary")
        .or(file.get("zip"))
        .map_or(0..0, |entry| entry.key_span.clone());
    match grid::count(&axes.vary, &axes.zips) {
        Some(count) if count <= grid::MOST_JOBS => grid::points(&axes.vary, &axes.zips),
        count => {
            let many = count.map_or("more jobs than can be counted".to_owned(), |count| {
                format!("{count} jobs")
            });
            checker.error(span, format!("the grid has {many}")).help = Some(format!(
                "shorten an axis or split the experiment: at most {} jobs",
                grid::MOST_JOBS
            ));
            Vec::new()
        }
    }
}

/// Reads the excludes and takes what they match from the points.
fn excludes(checker: &mut Checker, file: &Table, axes: &Axes, points: &mut Vec<Point>) -> Vec<Condition> {
    let all = std::mem::take(points);
    let mut kept: Vec<Point> = all.clone();
    let mut found = Vec::new();
    for node in sections(checker, file, "exclude") {
        let Some(condition) = axes::condition(checker, node, "exclude", axes) else {
            continue;
        };
        if !all.is_empty() && !all.iter().any(|point| grid::matches(&condition, point)) {
            checker.error(node.span.clone(), "\"exclude\" matches no job").help =
                Some("its values occur, but not together; remove it".to_owned());
        }
        kept.retain(|point| !grid::matches(&condition, point));
        if kept.is_empty() && !all.is_empty() {
            checker.error(node.span.clone(), "every job is excluded").help = Some("leave at least one job".to_owned());
            return found;
        }
        found.push(condition);
    }
    *points = kept;
    found
}

/// A name that becomes a file's name.
fn file_name(checker: &mut Checker, span: Range<usize>, name: &str) -> bool {
    let well = !name.is_empty()
        && !name.starts_with('.')
        && name.len() <= 100
        && name
            .chars()
            .all(|character| character.is_ascii_alphanumeric() || "-_.".contains(character));
    if !well {
        checker.error(span, format!("\"{name}\" cannot name a file")).help =
            Some("use letters, digits, `-`, `_` and `.`, and do not begin with a dot".to_owned());
    }
    well
}
