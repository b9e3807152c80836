//! Checks values of a file against their declarations and collects everything that is wrong.
//!
//! The values that come out are canonical: a number is a 64-bit float and never minus zero, a duration is seconds, a size
//! is bytes, and every default is filled in. Guarantees nothing about relations between fields.

use super::diagnostic::{Diagnostic, Source};
use super::document::{Content, Entry, Node, Table};
use super::nearest::{nearest, suggestion};
use super::section::{EXPERIMENT, Holds};
use super::unit;
use crate::method::setting::{Default, Field, Kind};
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

/// Collects diagnostics over one source text.
pub struct Checker {
    pub source: Arc<Source>,
    pub diagnostics: Vec<Diagnostic>,
    /// Where entries stand, by dotted path: `settings.energy`, `models.duck.mesh`, `vary.energy`.
    pub places: BTreeMap<String, Range<usize>>,
}

/// Canonical JSON number; minus zero is zero.
pub fn number(value: f64) -> Value {
    Value::from(if value == 0.0 { 0.0 } else { value })
}

/// A field's default as a canonical value; none when the field is to be left out or is required.
pub fn default(field: &Field) -> Option<Value> {
    match &field.default {
        Default::Required | Default::Absent => None,
        Default::Boolean(value) => Some(Value::Bool(*value)),
        Default::Integer(value) if matches!(field.kind, Kind::Number { .. }) => Some(number(*value as f64)),
        Default::Integer(value) => Some(Value::from(*value)),
        Default::Number(value) => Some(number(*value)),
        Default::Text(text) => Some(match field.kind {
            Kind::Duration => unit::duration(text).map_or(Value::Null, number),
            Kind::Size => unit::size(text).map_or(Value::Null, Value::from),
            _ => Value::from(*text),
        }),
        Default::Fields => fields_of(&field.kind).map(|fields| Value::Object(defaults(fields))),
    }
}

/// A table filled with its fields' defaults.
pub fn defaults(fields: &[Field]) -> Map<String, Value> {
    fields
        .iter()
        .filter_map(|field| Some((field.name.to_owned(), default(field)?)))
        .collect()
}

/// The fields of a table, alone or as one of several kinds.
pub fn fields_of(kind: &Kind) -> Option<&'static [Field]> {
    match kind {
        Kind::Table(fields) => Some(fields),
        Kind::OneOf(kinds) => kinds.iter().find_map(fields_of),
        _ => None,
    }
}

/// What a kind admits, in words: `a number from 0 to 1`.
pub fn expectation(kind: &Kind) -> String {
    match kind {
        Kind::Boolean => "true or false".to_owned(),
        Kind::Integer { min, max } => match (*min == i64::MIN, *max == i64::MAX) {
            (true, true) => "a whole number".to_owned(),
            (false, true) => format!("a whole number of at least {min}"),
            (true, false) => format!("a whole number of at most {max}"),
            (false, false) => format!("a whole number from {min} to {max}"),
        },
        Kind::Number { min, max } => match (*min <= f64::MIN, *max >= f64::MAX) {
            (true, true) => "a number".to_owned(),
            (false, true) if *min > 0.0 && *min < 1e-100 => "a positive number".to_owned(),
            (false, true) => format!("a number of at least {}", plain(*min)),
            (true, false) => format!("a number of at most {}", plain(*max)),
            (false, false) => format!("a number from {} to {}", plain(*min), plain(*max)),
        },
        Kind::Choice(words) => one_of(words.iter().map(|(word, _)| *word)),
        Kind::Named(words) => one_of(words().iter().map(|(word, _)| *word)),
        Kind::Text => "text in quotes".to_owned(),
        Kind::Duration => "a duration such as \"10 min\"".to_owned(),
        Kind::Size => "a size such as \"8 GiB\"".to_owned(),
        Kind::File => "the path of a file".to_owned(),
        Kind::Table(_) => "a table".to_owned(),
        Kind::List(kind) => format!("a list, each {}", expectation(kind)),
        Kind::OneOf(kinds) => kinds.iter().map(expectation).collect::<Vec<_>>().join(", or "),
    }
}

/// A number as a person would write it: `0.5`, `1e8`.
pub fn plain(value: f64) -> String {
    if value != 0.0 && !(1e-4..1e6).contains(&value.abs()) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

fn one_of<'a>(words: impl Iterator<Item = &'a str>) -> String {
    let words: Vec<String> = words.map(|word| format!("\"{word}\"")).collect();
    if words.len() > 8 {
        format!("one of {}, ...", words[..8].join(", "))
    } else {
        format!("one of {}", words.join(", "))
    }
}

/// The singular of a field's name, for `unknown claim "VM9"`. A basis, a radius and an axis are singular already.
fn noun(name: &str) -> &str {
    let last = name.rsplit('.').next().unwrap_or(name);
    match last.strip_suffix('s') {
        Some(singular) if !singular.ends_with(['i', 'u', 's']) => singular,
        _ => last,
    }
}

impl Checker {
    pub fn new(source: Arc<Source>) -> Self {
        Checker {
            source,
            diagnostics: Vec::new(),
            places: BTreeMap::new(),
        }
    }

    /// Adds an error that underlines these bytes; the caller may refine what is returned.
    pub fn error(&mut self, span: Range<usize>, message: impl Into<String>) -> &mut Diagnostic {
        self.diagnostics.push(Diagnostic::error(message).at(&self.source, span));
        let last = self.diagnostics.len() - 1;
        &mut self.diagnostics[last]
    }

    /// Adds a warning that underlines these bytes.
    pub fn warning(&mut self, span: Range<usize>, message: impl Into<String>) -> &mut Diagnostic {
        self.diagnostics
            .push(Diagnostic::warning(message).at(&self.source, span));
        let last = self.diagnostics.len() - 1;
        &mut self.diagnostics[last]
    }

    /// `"omega" is text`, expected a number.
    pub fn wrong_type(&mut self, node: &Node, name: &str, expected: &str) {
        let message = format!("\"{name}\" is {}", node.content.describe());
        self.error(node.span.clone(), message).label = format!("expected {expected}");
    }

    /// A key that nothing declares.
    pub fn unknown_key<'a>(&mut self, entry: &Entry, owner: &str, known: impl IntoIterator<Item = &'a str>) {
        let place = if owner.is_empty() {
            String::new()
        } else {
            format!(" in {owner}")
        };
        let known: Vec<&str> = known.into_iter().collect();
        let message = format!("unknown key \"{}\"{place}", entry.key);
        // A key that was written under a table header and belongs above all of them.
        let top = EXPERIMENT.iter().filter(|key| {
            !matches!(key.holds, Holds::Plain(Kind::Table(_))) && !owner.is_empty() && !owner.starts_with("[[")
        });
        let top = top
            .filter(|key| matches!(key.holds, Holds::Plain(_) | Holds::Method))
            .map(|key| key.name);
        let above = nearest(&entry.key, top).filter(|_| nearest(&entry.key, known.iter().copied()).is_none());
        self.error(entry.key_span.clone(), message).help = match above {
            Some(name) => Some(format!(
                "\"{name}\" stands at the top of the file, above its first [table]"
            )),
            None => suggestion(&entry.key, known),
        };
    }

    /// A word that is none of those known.
    pub fn unknown_name<'a>(
        &mut self,
        span: Range<usize>,
        what: &str,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
    ) {
        let message = format!("unknown {what} \"{name}\"");
        self.error(span, message).help = suggestion(name, known);
    }

    /// Text, or an error.
    pub fn text<'n>(&mut self, node: &'n Node, name: &str) -> Option<&'n str> {
        match &node.content {
            Content::Text(text) => Some(text),
            _ => {
                self.wrong_type(node, name, "text in quotes");
                None
            }
        }
    }

    /// A table, or an error.
    pub fn table<'n>(&mut self, node: &'n Node, name: &str) -> Option<&'n Table> {
        match &node.content {
            Content::Table(table) => Some(table),
            content => {
                let doubled = matches!(content, Content::List(items)
                    if items.iter().all(|item| matches!(item.content, Content::Table(_))));
                self.wrong_type(node, name, "a table");
                if let (true, Some(last)) = (doubled, self.diagnostics.last_mut()) {
                    last.help = Some("write one pair of brackets: there is only one".to_owned());
                }
                None
            }
        }
    }

    /// A list, or an error.
    pub fn list<'n>(&mut self, node: &'n Node, name: &str) -> Option<&'n [Node]> {
        match &node.content {
            Content::List(items) => Some(items),
            _ => {
                self.wrong_type(node, name, "a list");
                None
            }
        }
    }

    /// The canonical value of a node; none when it is wrong, which has then been told.
    pub fn value(&mut self, kind: &Kind, node: &Node, name: &str) -> Option<Value> {
        match (kind, &node.content) {
            (Kind::Boolean, Content::Boolean(value)) => Some(Value::Bool(*value)),
            (Kind::Integer { min, max }, Content::Integer(value)) => {
                if (*min..=*max).contains(value) {
                    return Some(Value::from(*value));
                }
                self.out_of_range(node, name, &value.to_string(), kind)
            }
            (Kind::Number { min, max }, Content::Integer(_) | Content::Number(_)) => {
                let value = match &node.content {
                    Content::Integer(value) => *value as f64,
                    Content::Number(value) => *value,
                    _ => f64::NAN,
                };
                if value.is_finite() && *min <= value && value <= *max {
                    return Some(number(value));
                }
                self.out_of_range(node, name, &plain(value), kind)
            }
            (Kind::Choice(words), Content::Text(text)) => {
                let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
                self.word(node, noun(name), text, &known)
            }
            (Kind::Named(words), Content::Text(text)) => {
                let known: Vec<&str> = words().iter().map(|(word, _)| *word).collect();
                self.word(node, noun(name), text, &known)
            }
            (Kind::Text | Kind::File, Content::Text(text)) => Some(Value::from(text.as_str())),
            (Kind::Duration, Content::Text(text)) => match unit::duration(text) {
                Ok(seconds) => Some(number(seconds)),
                Err(misfit) => self.misfit(node, misfit),
            },
            (Kind::Size, Content::Text(text)) => match unit::size(text) {
                Ok(bytes) => Some(Value::from(bytes)),
                Err(misfit) => self.misfit(node, misfit),
            },
            (Kind::Duration | Kind::Size, Content::Integer(_) | Content::Number(_)) => {
                let digits = self.source.text.get(node.span.clone()).unwrap_or("1").to_owned();
                let unit = if matches!(kind, Kind::Duration) { "s" } else { "MiB" };
                let diagnostic = self.error(node.span.clone(), format!("\"{name}\" has no unit"));
                diagnostic.label = format!("expected {}", expectation(kind));
                diagnostic.help = Some(format!("write \"{digits} {unit}\" for instance"));
                None
            }
            (Kind::Table(fields), Content::Table(table)) => self
                .fields(fields, Some(table), name, node.span.clone(), &BTreeSet::new())
                .map(Value::Object),
            (Kind::List(kind), Content::List(items)) => {
                let values: Vec<Option<Value>> = items.iter().map(|item| self.value(kind, item, name)).collect();
                values.into_iter().collect::<Option<Vec<_>>>().map(Value::Array)
            }
            (Kind::OneOf(kinds), content) => match kinds.iter().find(|kind| accepts(kind, content)) {
                Some(kind) => self.value(kind, node, name),
                None => {
                    self.wrong_type(node, name, &expectation(kind));
                    None
                }
            },
            _ => {
                self.wrong_type(node, name, &expectation(kind));
                None
            }
        }
    }

    /// A table's fields with defaults filled in. `varied` holds dotted paths that axes set: these must not be held, and
    /// need not be given. `path` is the table's own dotted path, empty at the top of the settings.
    pub fn fields(
        &mut self,
        fields: &[Field],
        table: Option<&Table>,
        path: &str,
        owner: Range<usize>,
        varied: &BTreeSet<String>,
    ) -> Option<Map<String, Value>> {
        let mut well = true;
        let mut values = Map::new();
        let place = |dotted: &str| {
            if dotted.starts_with("models.") {
                dotted.to_owned()
            } else {
                format!("settings.{dotted}")
            }
        };
        for entry in table.map_or(&[][..], |table| &table.entries) {
            if !fields.iter().any(|field| field.name == entry.key) {
                well = false;
                let before = self.diagnostics.len();
                let owner = if path.is_empty() { "settings" } else { path };
                self.unknown_key(entry, owner, fields.iter().map(|field| field.name));
                if self.diagnostics[before]
                    .help
                    .as_ref()
                    .is_none_or(|help| help.starts_with("known"))
                    && let Some(deeper) = deeper(fields, &entry.key)
                {
                    self.diagnostics[before].help = Some(format!("it belongs into the table \"{deeper}\""));
                }
            }
        }
        for field in fields {
            let dotted = if path.is_empty() {
                field.name.to_owned()
            } else {
                format!("{path}.{}", field.name)
            };
            match table.and_then(|table| table.get(field.name)) {
                Some(entry) => {
                    self.places.insert(place(&dotted), entry.value.span.clone());
                    if varied.contains(&dotted) {
                        well = false;
                        self.error(entry.key_span.clone(), format!("\"{dotted}\" is both held and varied"))
                            .help = Some("hold it here, or vary it as an axis, not both".to_owned());
                        continue;
                    }
                    let value = match (fields_of(&field.kind), &entry.value.content) {
                        (Some(inner), Content::Table(table)) => self
                            .fields(inner, Some(table), &dotted, entry.value.span.clone(), varied)
                            .map(Value::Object),
                        _ => self.value(&field.kind, &entry.value, &dotted),
                    };
                    match value {
                        Some(value) => {
                            values.insert(field.name.to_owned(), value);
                        }
                        None => well = false,
                    }
                }
                None => match (&field.default, &field.kind) {
                    (Default::Required, _) if !varied.contains(&dotted) => {
                        well = false;
                        let message = format!("\"{dotted}\" is missing");
                        let diagnostic = self.error(owner.clone(), message);
                        diagnostic.label = format!("expected {} = {}", field.name, expectation(&field.kind));
                    }
                    (Default::Fields, Kind::Table(inner)) => {
                        match self.fields(inner, None, &dotted, owner.clone(), varied) {
                            Some(inner) => {
                                values.insert(field.name.to_owned(), Value::Object(inner));
                            }
                            None => well = false,
                        }
                    }
                    _ => {
                        if let Some(value) = default(field) {
                            values.insert(field.name.to_owned(), value);
                        }
                    }
                },
            }
        }
        well.then_some(values)
    }

    fn word(&mut self, node: &Node, what: &str, text: &str, known: &[&str]) -> Option<Value> {
        if known.contains(&text) {
            return Some(Value::from(text));
        }
        self.unknown_name(node.span.clone(), what, text, known.iter().copied());
        None
    }

    fn out_of_range(&mut self, node: &Node, name: &str, value: &str, kind: &Kind) -> Option<Value> {
        self.error(node.span.clone(), format!("\"{name}\" is {value}, out of range"))
            .label = format!("expected {}", expectation(kind));
        None
    }

    fn misfit(&mut self, node: &Node, misfit: unit::Misfit) -> Option<Value> {
        self.error(node.span.clone(), misfit.message).help = Some(misfit.help);
        None
    }
}

/// Whether a value has the TOML type of a kind, so that messages speak of the kind that was meant.
fn accepts(kind: &Kind, content: &Content) -> bool {
    match kind {
        Kind::Boolean => matches!(content, Content::Boolean(_)),
        Kind::Integer { .. } => matches!(content, Content::Integer(_)),
        Kind::Number { .. } => matches!(content, Content::Integer(_) | Content::Number(_)),
        Kind::Choice(_) | Kind::Named(_) | Kind::Text | Kind::Duration | Kind::Size | Kind::File => {
            matches!(content, Content::Text(_))
        }
        Kind::Table(_) => matches!(content, Content::Table(_)),
        Kind::List(_) => matches!(content, Content::List(_)),
        Kind::OneOf(kinds) => kinds.iter().any(|kind| accepts(kind, content)),
    }
}

/// The dotted path of the table within these fields that declares a key.
fn deeper(fields: &[Field], key: &str) -> Option<String> {
    fields.iter().find_map(|field| {
        let inner = fields_of(&field.kind)?;
        if inner.iter().any(|field| field.name == key) {
            return Some(field.name.to_owned());
        }
        deeper(inner, key).map(|rest| format!("{}.{rest}", field.name))
    })
}
