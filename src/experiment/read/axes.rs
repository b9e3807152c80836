//! Reads the axes of `[vary]` and `[[zip]]`, and the conditions that name them.

use super::models;
use crate::experiment::check::{Checker, fields_of, number};
use crate::experiment::document::{Content, Entry, Node, Table};
use crate::experiment::file::{Axis, Condition, Model};
use crate::experiment::grid::show;
use crate::experiment::nearest::{nearest, suggestion};
use crate::method::Method;
use crate::method::setting::{Field, Kind};
use serde_json::Value;
use std::collections::BTreeSet;
use std::ops::Range;

/// An axis as the file names it.
#[derive(Clone, Debug)]
pub struct Named<'n> {
    pub name: String,
    pub span: Range<usize>,
    pub node: &'n Node,
}

/// What an axis sets.
#[derive(Clone, Copy, Debug)]
pub enum Sets {
    Model,
    Setting(&'static Field),
    /// A parameter of the generator of a role, checked against each model's generator.
    Parameter {
        role: &'static str,
    },
}

/// An axis with what is known of it; `values` is none where anything was wrong.
#[derive(Clone, Debug)]
pub struct Known {
    pub name: String,
    pub sets: Option<Sets>,
    pub values: Option<Vec<Value>>,
    /// Another name that was probably meant, so that one slip is told once.
    meant: Option<String>,
}

/// All axes of a file.
#[derive(Clone, Debug, Default)]
pub struct Axes {
    pub known: Vec<Known>,
    pub vary: Vec<Axis>,
    pub zips: Vec<Vec<Axis>>,
    /// Names of the method's settings, which may be meant where an axis is asked for.
    settings: Vec<&'static str>,
}

impl Axes {
    pub fn find(&self, name: &str) -> Option<&Known> {
        self.known
            .iter()
            .find(|axis| axis.name == name || axis.meant.as_deref() == Some(name))
    }

    /// Whether every axis is well, so that the grid can be walked.
    pub fn well(&self) -> bool {
        self.known.iter().all(|axis| axis.values.is_some())
    }

    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.known.iter().map(|axis| axis.name.as_str())
    }

    /// Axes with at least two different values.
    pub fn varying(&self) -> Vec<String> {
        self.known
            .iter()
            .filter(|axis| match &axis.values {
                Some(values) => values.iter().any(|value| *value != values[0]),
                None => true,
            })
            .map(|axis| axis.name.clone())
            .collect()
    }
}

/// The entries of a table with nested tables as dotted paths: `relaxed-newton.relaxation = [...]` needs no quotes.
pub fn flatten<'n>(table: &'n Table, prefix: &str, found: &mut Vec<Named<'n>>) {
    for Entry { key, key_span, value } in &table.entries {
        let name = if prefix.is_empty() {
            key.clone()
        } else {
            format!("{prefix}.{key}")
        };
        match &value.content {
            Content::Table(inner) if !inner.entries.is_empty() => flatten(inner, &name, found),
            _ => found.push(Named {
                name,
                span: key_span.clone(),
                node: value,
            }),
        }
    }
}

/// Every dotted path of the settings.
pub fn paths(fields: &[Field]) -> Vec<String> {
    let mut found = Vec::new();
    for field in fields {
        found.push(field.name.to_owned());
        if let Some(inner) = fields_of(&field.kind) {
            found.extend(paths(inner).into_iter().map(|path| format!("{}.{path}", field.name)));
        }
    }
    found
}

/// The field at a dotted path.
pub fn declared(fields: &'static [Field], path: &str) -> Option<&'static Field> {
    let (first, rest) = path
        .split_once('.')
        .map_or((path, None), |(first, rest)| (first, Some(rest)));
    let field = fields.iter().find(|field| field.name == first)?;
    match rest {
        None => Some(field),
        Some(rest) => declared(fields_of(&field.kind)?, rest),
    }
}

/// The role and the parameter that `model.PARAMETER` or `model.ROLE.PARAMETER` names.
pub fn parameter<'p>(method: &dyn Method, path: &'p str) -> Option<(&'static str, &'p str)> {
    let rest = path.strip_prefix("model.")?;
    if let Some((role, parameter)) = rest.split_once('.') {
        let role = method.model().roles.iter().find(|known| known.name == role)?;
        return Some((role.name, parameter));
    }
    Some((models::main_role(method)?.name, rest))
}

/// The axes of `[vary]` and the groups of `[[zip]]`, by name only.
pub fn named<'n>(checker: &mut Checker, file: &'n Table) -> (Vec<Named<'n>>, Vec<Vec<Named<'n>>>) {
    let mut vary = Vec::new();
    if let Some(entry) = file.get("vary")
        && let Some(table) = checker.table(&entry.value, "vary")
    {
        flatten(table, "", &mut vary);
    }
    let mut zips = Vec::new();
    for node in super::sections(checker, file, "zip") {
        let Some(table) = checker.table(node, "zip") else {
            continue;
        };
        let mut zip = Vec::new();
        flatten(table, "", &mut zip);
        if zip.is_empty() {
            checker.error(node.span.clone(), "a zip without axes").help =
                Some("name at least two axes, each with as many values".to_owned());
        }
        zips.push(zip);
    }
    (vary, zips)
}

/// Reads the values of all axes.
pub fn read(
    checker: &mut Checker,
    method: &'static dyn Method,
    vary: &[Named<'_>],
    zips: &[Vec<Named<'_>>],
    models: &[Model],
    broken_models: &BTreeSet<String>,
) -> Axes {
    let mut axes = Axes {
        settings: method.settings().iter().map(|field| field.name).collect(),
        ..Axes::default()
    };
    let all: Vec<&Named<'_>> = vary.iter().chain(zips.iter().flatten()).collect();
    let model_axis = all.iter().find(|axis| axis.name == "model");
    let listed: Option<Vec<String>> = model_axis.and_then(|axis| match &axis.node.content {
        Content::List(items) => Some(
            items
                .iter()
                .filter_map(|item| match &item.content {
                    Content::Text(text) => Some(text.clone()),
                    _ => None,
                })
                .collect(),
        ),
        _ => None,
    });
    let is_listed = |model: &&Model| listed.as_ref().is_none_or(|names| names.contains(&model.name));
    let known_models = KnownModels {
        all: models,
        used: models.iter().filter(is_listed).collect(),
        broken: broken_models,
    };
    // Broken ones count too: otherwise whatever names the axis would seem wrong.
    if model_axis.is_none() && !(models.is_empty() && broken_models.is_empty()) {
        let names = models.iter().map(|model| &model.name).chain(broken_models);
        let values: Vec<Value> = names.map(|name| Value::from(name.as_str())).collect();
        axes.vary.push(Axis {
            name: "model".to_owned(),
            values: values.clone(),
        });
        axes.known.push(Known {
            name: "model".to_owned(),
            sets: Some(Sets::Model),
            values: broken_models.is_empty().then_some(values),
            meant: None,
        });
    }
    for (index, axis) in all.iter().enumerate() {
        checker.places.insert(format!("vary.{}", axis.name), axis.span.clone());
        if let Some(earlier) = all[..index].iter().find(|earlier| overlap(&earlier.name, &axis.name)) {
            let message = if earlier.name == axis.name {
                format!("axis \"{}\" stands twice", axis.name)
            } else {
                format!("axis \"{}\" sets a part of axis \"{}\"", axis.name, earlier.name)
            };
            checker.error(axis.span.clone(), message).help = Some("let one axis hold all values".to_owned());
        }
    }
    let mut read_one = |axis: &Named<'_>, zipped: bool| -> Known {
        let (sets, meant) = resolve(checker, method, axis);
        let values = match sets {
            Some(sets) => values(checker, method, axis, sets, &known_models, zipped),
            None => None,
        };
        Known {
            name: axis.name.clone(),
            sets,
            values,
            meant,
        }
    };
    let mut groups: Vec<Vec<Known>> = Vec::new();
    for axis in vary {
        let known = read_one(axis, false);
        axes.vary.push(Axis {
            name: known.name.clone(),
            values: known.values.clone().unwrap_or_default(),
        });
        axes.known.push(known);
    }
    for zip in zips {
        groups.push(zip.iter().map(|axis| read_one(axis, true)).collect());
    }
    for (zip, group) in zips.iter().zip(groups) {
        check_zip(checker, zip, &group);
        let axis = |known: &Known| Axis {
            name: known.name.clone(),
            values: known.values.clone().unwrap_or_default(),
        };
        axes.zips.push(group.iter().map(axis).collect());
        axes.known.extend(group);
    }
    axes
}

/// The axes of a zip have equally many values, and no row stands twice.
fn check_zip(checker: &mut Checker, zip: &[Named<'_>], group: &[Known]) {
    let items = |axis: &Named<'_>| match &axis.node.content {
        Content::List(items) => items.len(),
        _ => 0,
    };
    let Some(expected) = zip.first().map(items) else { return };
    let mut even = true;
    for axis in &zip[1..] {
        let found = items(axis);
        if found != expected && found > 0 && expected > 0 {
            even = false;
            let message = format!(
                "\"{}\" has {found} values, \"{}\" has {expected}",
                axis.name, zip[0].name
            );
            let diagnostic = checker.error(axis.node.span.clone(), message);
            diagnostic.label = format!("expected {expected} values");
            diagnostic.help = Some("the axes of a zip move together and need equally many values".to_owned());
        }
    }
    let columns: Option<Vec<&Vec<Value>>> = group.iter().map(|axis| axis.values.as_ref()).collect();
    if let (true, Some(columns)) = (even, columns) {
        let row = |index: usize| columns.iter().map(|values| &values[index]).collect::<Vec<_>>();
        if let Some(copy) = (0..expected).find(|&index| (0..index).any(|earlier| row(earlier) == row(index))) {
            let words = zip
                .iter()
                .zip(row(copy))
                .map(|(axis, value)| format!("{} = {}", axis.name, quoted(value)));
            let message = format!("{} stands twice in a zip", words.collect::<Vec<_>>().join(", "));
            let span = match &zip[0].node.content {
                Content::List(items) => items[copy].span.clone(),
                _ => zip[0].node.span.clone(),
            };
            checker.error(span, message).help = Some("remove one of the two".to_owned());
        }
    }
}

fn overlap(one: &str, other: &str) -> bool {
    let within = |outer: &str, inner: &str| inner.strip_prefix(outer).is_some_and(|rest| rest.starts_with('.'));
    // `model.tetrahedra` sets a parameter of whichever model the axis `model` chose.
    one == other || (one != "model" && within(one, other)) || (other != "model" && within(other, one))
}

fn resolve(checker: &mut Checker, method: &'static dyn Method, axis: &Named<'_>) -> (Option<Sets>, Option<String>) {
    if axis.name == "model" {
        return (Some(Sets::Model), None);
    }
    if let Some((role, _)) = parameter(method, &axis.name) {
        return (Some(Sets::Parameter { role }), None);
    }
    if let Some(field) = declared(method.settings(), &axis.name) {
        return (Some(Sets::Setting(field)), None);
    }
    let mut known = paths(method.settings());
    known.insert(0, "model".to_owned());
    for role in method.model().roles {
        let parameters = role.generators.iter().flat_map(|generator| generator.parameters);
        known.extend(parameters.map(|field| format!("model.{}.{}", role.name, field.name)));
    }
    known.sort();
    known.dedup();
    let meant = nearest(&axis.name, known.iter().map(String::as_str)).map(str::to_owned);
    let deeper = known.iter().find(|path| path.ends_with(&format!(".{}", axis.name)));
    let meant = meant.filter(|_| deeper.is_none());
    let diagnostic = checker.error(
        axis.span.clone(),
        format!("axis \"{}\" names no setting of {}", axis.name, method.name()),
    );
    diagnostic.help = match (&meant, deeper) {
        (_, Some(path)) => Some(format!("did you mean \"{path}\"?")),
        (_, None) => suggestion(&axis.name, known.iter().map(String::as_str)),
    };
    (None, meant.or_else(|| deeper.cloned()))
}

/// The models of a file: those that are well, those that some axis value chooses, and the names of those that are wrong.
struct KnownModels<'a> {
    all: &'a [Model],
    used: Vec<&'a Model>,
    broken: &'a BTreeSet<String>,
}

/// The values of an axis; none when any is wrong. Within a zip a value may stand twice.
fn values(
    checker: &mut Checker,
    method: &'static dyn Method,
    axis: &Named<'_>,
    sets: Sets,
    models: &KnownModels<'_>,
    zipped: bool,
) -> Option<Vec<Value>> {
    let Content::List(items) = &axis.node.content else {
        let message = format!("axis \"{}\" is {}", axis.name, axis.node.content.describe());
        let written = checker
            .source
            .text
            .get(axis.node.span.clone())
            .unwrap_or("...")
            .to_owned();
        let diagnostic = checker.error(axis.node.span.clone(), message);
        diagnostic.label = "expected a list of values".to_owned();
        diagnostic.help = Some(format!("write [{written}]; what does not vary belongs into [settings]"));
        return None;
    };
    if items.is_empty() {
        let diagnostic = checker.error(axis.node.span.clone(), format!("axis \"{}\" has no values", axis.name));
        diagnostic.help = Some("give it at least one value, or leave it out".to_owned());
        return None;
    }
    let kinds: Vec<&Kind> = match sets {
        Sets::Model => Vec::new(),
        Sets::Setting(field) => vec![&field.kind],
        Sets::Parameter { role } => parameter_kinds(checker, method, axis, role, models)?,
    };
    let mut found: Vec<Value> = Vec::new();
    let mut well = true;
    for item in items {
        let value = match sets {
            Sets::Model => model_name(checker, item, models),
            _ => kinds
                .iter()
                .map(|kind| checker.value(kind, item, &axis.name))
                .collect::<Option<Vec<_>>>()
                .and_then(|values| values.into_iter().next()),
        };
        match value {
            // Within a zip a value may come again; it is the whole row that must not.
            Some(value) if !zipped && found.contains(&value) => {
                well = false;
                let message = format!("{} stands twice in axis \"{}\"", quoted(&value), axis.name);
                checker.error(item.span.clone(), message).help = Some("remove one of the two".to_owned());
            }
            Some(value) => found.push(value),
            None => well = false,
        }
    }
    well.then_some(found)
}

/// The kinds that a generator's parameter has in the models that the axis sets it in.
fn parameter_kinds(
    checker: &mut Checker,
    method: &'static dyn Method,
    axis: &Named<'_>,
    role: &str,
    models: &KnownModels<'_>,
) -> Option<Vec<&'static Kind>> {
    let (_, name) = parameter(method, &axis.name)?;
    let mut kinds = Vec::new();
    for model in &models.used {
        match models::generator_parameter(method, model, role, name) {
            Ok(field) => kinds.push(&field.kind),
            Err(reason) => {
                let message = format!("axis \"{}\" does not fit model \"{}\"", axis.name, model.name);
                let diagnostic = checker.error(axis.span.clone(), message);
                diagnostic.label = reason.label;
                // A parameter of another role, such as the target's, is named in full.
                let other = method.model().roles.iter().find(|other| {
                    other.name != role && models::generator_parameter(method, model, other.name, name).is_ok()
                });
                diagnostic.help = match other {
                    Some(other) => Some(format!("did you mean \"model.{}.{name}\"?", other.name)),
                    None => reason.help,
                };
            }
        }
    }
    if models.used.is_empty() && models.broken.is_empty() {
        let message = format!("axis \"{}\" has no model to set", axis.name);
        checker.error(axis.span.clone(), message).help = Some("generate a model under [models.NAME]".to_owned());
    }
    (!kinds.is_empty()).then_some(kinds)
}

fn model_name(checker: &mut Checker, item: &Node, models: &KnownModels<'_>) -> Option<Value> {
    let name = checker.text(item, "model")?.to_owned();
    if models.all.iter().any(|model| model.name == name) {
        return Some(Value::from(name));
    }
    if !models.broken.contains(&name) {
        let well = models.all.iter().map(|model| model.name.as_str());
        let known: Vec<&str> = well.chain(models.broken.iter().map(String::as_str)).collect();
        checker.unknown_name(item.span.clone(), "model", &name, known);
    }
    None
}

/// A value as the file would write it, in quotes.
fn quoted(value: &Value) -> String {
    match value {
        Value::String(text) => format!("\"{text}\""),
        other => show(other),
    }
}

/// Reads a condition: each key an axis, each value one of the axis's values or a list of them.
pub fn condition(checker: &mut Checker, node: &Node, name: &str, axes: &Axes) -> Option<Condition> {
    let table = checker.table(node, name)?;
    let mut entries = Vec::new();
    flatten(table, "", &mut entries);
    let mut condition = Condition::new();
    let mut well = true;
    if entries.is_empty() {
        checker
            .error(node.span.clone(), format!("\"{name}\" names no axis"))
            .help = Some("write an axis and its values, such as model = \"ball\"".to_owned());
        return None;
    }
    for entry in entries {
        let Some(axis) = axes.find(&entry.name) else {
            well = false;
            unknown_axis(checker, entry.span.clone(), &entry.name, axes);
            continue;
        };
        let items = match &entry.node.content {
            Content::List(items)
                if !matches!(
                    axis.sets,
                    Some(Sets::Setting(Field {
                        kind: Kind::List(_),
                        ..
                    }))
                ) =>
            {
                items.iter().collect::<Vec<_>>()
            }
            _ => vec![entry.node],
        };
        let mut values = Vec::new();
        for item in items {
            let value = axis_value(checker, item, axis);
            match value {
                Some(value) => values.push(value),
                None => well = false,
            }
        }
        if values.is_empty() && well {
            well = false;
            checker
                .error(entry.node.span.clone(), format!("\"{}\" lists no value", entry.name))
                .label = "expected at least one value".to_owned();
        }
        condition.insert(axis.name.clone(), values);
    }
    well.then_some(condition)
}

/// One value of an axis; none when it is wrong or not among the axis's values.
fn axis_value(checker: &mut Checker, item: &Node, axis: &Known) -> Option<Value> {
    let value = checked_value(checker, item, axis)?;
    let known = axis.values.as_ref()?;
    if known.contains(&value) {
        return Some(value);
    }
    let words: Vec<String> = known.iter().map(show).collect();
    let message = format!("axis \"{}\" has no value {}", axis.name, quoted(&value));
    checker.error(item.span.clone(), message).help = suggestion(&show(&value), words.iter().map(String::as_str));
    None
}

/// A value of the kind that an axis has, among its values or not.
pub fn checked_value(checker: &mut Checker, item: &Node, axis: &Known) -> Option<Value> {
    match axis.sets? {
        Sets::Model => checker.text(item, "model").map(Value::from),
        Sets::Setting(field) => checker.value(&field.kind, item, &axis.name),
        Sets::Parameter { .. } => {
            // The axis's own values, which were checked against the generators, tell what kind it has.
            let value = match &item.content {
                Content::Integer(value) if axis.values.as_ref()?.iter().all(Value::is_i64) => Value::from(*value),
                Content::Integer(value) => number(*value as f64),
                Content::Number(value) => number(*value),
                Content::Text(text) => Value::from(text.as_str()),
                Content::Boolean(value) => Value::from(*value),
                Content::Date | Content::List(_) | Content::Table(_) => {
                    checker.wrong_type(item, &axis.name, "a value of this axis");
                    return None;
                }
            };
            Some(value)
        }
    }
}

/// An axis that the file does not have.
pub fn unknown_axis(checker: &mut Checker, span: Range<usize>, name: &str, axes: &Axes) {
    let known: Vec<&str> = axes.names().collect();
    let diagnostic = checker.error(span, format!("unknown axis \"{name}\""));
    let first = name.split('.').next().unwrap_or(name);
    diagnostic.help = if axes.settings.contains(&first) {
        Some(format!(
            "\"{name}\" is a setting that does not vary; give it values under [vary]"
        ))
    } else {
        suggestion(name, known).or_else(|| Some("this file has no axes; add them under [vary]".to_owned()))
    };
}

/// Axis names: one, or a list.
pub fn axis_names(checker: &mut Checker, node: &Node, name: &str, axes: &Axes) -> Vec<String> {
    let items: Vec<&Node> = match &node.content {
        Content::List(items) => items.iter().collect(),
        Content::Text(_) => vec![node],
        _ => {
            checker.wrong_type(node, name, "the name of an axis, or a list of them");
            return Vec::new();
        }
    };
    let mut names: Vec<String> = Vec::new();
    for item in items {
        let Some(text) = checker.text(item, name).map(str::to_owned) else {
            continue;
        };
        match axes.find(&text) {
            None => unknown_axis(checker, item.span.clone(), &text, axes),
            Some(axis) if names.contains(&axis.name) => {
                checker
                    .error(item.span.clone(), format!("axis \"{text}\" stands twice"))
                    .help = Some("remove one of the two".to_owned());
            }
            Some(axis) => names.push(axis.name.clone()),
        }
    }
    names
}
