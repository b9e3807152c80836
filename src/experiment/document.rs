//! A TOML document as a tree in which every key and value knows its bytes in the file, in the order of the file.

use super::diagnostic::{Diagnostic, Source};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use toml::de::{DeArray, DeTable, DeValue};

/// A value with its place.
#[derive(Clone, Debug)]
pub struct Node {
    pub span: Range<usize>,
    pub content: Content,
}

/// What a value holds.
#[derive(Clone, Debug)]
pub enum Content {
    Text(String),
    Integer(i64),
    Number(f64),
    Boolean(bool),
    /// Dates have no meaning in an experiment file; kept for the message.
    Date,
    List(Vec<Node>),
    Table(Table),
}

/// Entries in the order of the file.
#[derive(Clone, Debug, Default)]
pub struct Table {
    pub entries: Vec<Entry>,
}

/// A key and its value.
#[derive(Clone, Debug)]
pub struct Entry {
    pub key: String,
    pub key_span: Range<usize>,
    pub value: Node,
}

impl Table {
    pub fn get(&self, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.key == key)
    }
}

impl Content {
    /// What it is, for `"tetrahedra" is text`.
    pub fn describe(&self) -> &'static str {
        match self {
            Content::Text(_) => "text",
            Content::Integer(_) => "a whole number",
            Content::Number(_) => "a number",
            Content::Boolean(_) => "a truth value",
            Content::Date => "a date",
            Content::List(_) => "a list",
            Content::Table(_) => "a table",
        }
    }
}

/// Most bytes of a file that a person writes.
const MOST_BYTES: u64 = 16 << 20;

/// The bytes of a TOML file.
///
/// # Errors
/// When it cannot be read, or is far larger than any experiment.
pub fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    let bytes = std::fs::metadata(path)?.len();
    if bytes > MOST_BYTES {
        let text = format!("it has {bytes} bytes; at most {MOST_BYTES} are read of a TOML file");
        return Err(std::io::Error::other(text));
    }
    std::fs::read(path)
}

/// Reads TOML; every syntax error that can be told apart from its consequences is reported.
pub fn parse(source: &Arc<Source>) -> Result<Table, Vec<Diagnostic>> {
    let (table, errors) = DeTable::parse_recoverable(&source.text);
    if !errors.is_empty() {
        return Err(syntax_errors(source, &errors));
    }
    let mut diagnostics = Vec::new();
    let table = convert_table(table.get_ref(), source, &mut diagnostics);
    if diagnostics.is_empty() {
        Ok(table)
    } else {
        Err(diagnostics)
    }
}

/// One error a line; of a list or table that is never closed only its beginning, since the rest follows from it.
fn syntax_errors(source: &Arc<Source>, errors: &[toml::de::Error]) -> Vec<Diagnostic> {
    let runaway = |error: &toml::de::Error| {
        let message = error.message().split(", ").next();
        matches!(message, Some("unclosed array" | "unclosed inline table"))
    };
    if errors.iter().any(runaway)
        && let Some(first) = errors
            .iter()
            .filter_map(toml::de::Error::span)
            .map(|span| span.start)
            .min()
        && let Some(at) = opened(source.text.get(..first).unwrap_or(&source.text))
    {
        let what = if source.text[at..].starts_with('[') {
            "list"
        } else {
            "table"
        };
        let error = Diagnostic::error(format!("a {what} that is never closed")).label("opened here");
        return vec![
            error
                .at(source, at..at + 1)
                .help("close it, and see that commas part its entries"),
        ];
    }
    let mut lines = std::collections::BTreeSet::new();
    let mut found = Vec::new();
    for error in errors {
        let span = error.span().unwrap_or(0..0);
        let (message, expected) = error.message().split_once(", ").unwrap_or((error.message(), ""));
        let mut diagnostic = Diagnostic::error(message).label(expected).at(source, span);
        if message == "duplicate key" {
            diagnostic = diagnostic.help("a key or table may stand only once; join the two or remove one");
        } else if message.starts_with("cannot extend value of type") {
            diagnostic =
                diagnostic.help("a name with a dot that is no table stands in quotes: \"model.cells\" = [...]");
        } else if ["invalid boolean", "invalid float", "string values must be quoted"].contains(&message) {
            diagnostic = diagnostic.help("text stands in quotes: \"...\"");
        }
        let line = diagnostic.place.as_ref().map_or(0, super::diagnostic::Place::line);
        if lines.insert(line) {
            found.push((line, diagnostic));
        }
    }
    found.sort_by_key(|(line, _)| *line);
    found.into_iter().map(|(_, diagnostic)| diagnostic).collect()
}

/// Where the innermost list or inline table begins that is still open at the end of this part of a file. A bracket that
/// begins a line is taken for the header of the next table, which the open list has swallowed.
fn opened(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let mut open = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        match bytes[at] {
            b'[' | b'{' => open.push(at),
            b']' | b'}' => {
                open.pop();
            }
            b'#' => at += text[at..].find('\n').unwrap_or(text.len() - at),
            quote @ (b'"' | b'\'') => {
                let thrice = bytes[at..].starts_with(&[quote; 3]);
                at += if thrice { 3 } else { 1 };
                let ends = |at: usize| match thrice {
                    true => bytes[at..].starts_with(&[quote; 3]),
                    false => bytes[at] == quote || bytes[at] == b'\n',
                };
                while at < bytes.len() && !ends(at) {
                    at += if quote == b'"' && bytes[at] == b'\\' { 2 } else { 1 };
                }
                at += if thrice { 2 } else { 0 };
            }
            _ => {}
        }
        at += 1;
    }
    let header = |at: usize| {
        bytes[at] == b'['
            && text[..at]
                .rsplit('\n')
                .next()
                .is_some_and(|line| line.trim().is_empty())
    };
    open.iter().rev().copied().find(|&at| !header(at))
}

fn convert_table(table: &DeTable<'_>, source: &Arc<Source>, diagnostics: &mut Vec<Diagnostic>) -> Table {
    let mut entries: Vec<Entry> = table
        .iter()
        .map(|(key, value)| Entry {
            key: key.get_ref().to_string(),
            key_span: key.span(),
            value: convert(value.get_ref(), value.span(), source, diagnostics),
        })
        .collect();
    entries.sort_by_key(|entry| entry.key_span.start);
    Table { entries }
}

fn convert(value: &DeValue<'_>, span: Range<usize>, source: &Arc<Source>, diagnostics: &mut Vec<Diagnostic>) -> Node {
    let content = match value {
        DeValue::String(text) => Content::Text(text.to_string()),
        DeValue::Boolean(value) => Content::Boolean(*value),
        DeValue::Datetime(_) => Content::Date,
        DeValue::Integer(digits) => match i64::from_str_radix(digits.as_str(), digits.radix()) {
            Ok(value) => Content::Integer(value),
            Err(_) => {
                diagnostics.push(
                    Diagnostic::error(format!("whole number {digits} is too large"))
                        .label("expected at most 9223372036854775807 in magnitude")
                        .at(source, span.clone()),
                );
                Content::Integer(0)
            }
        },
        DeValue::Float(digits) => match digits.as_str().parse() {
            Ok(value) => Content::Number(value),
            Err(_) => {
                diagnostics.push(Diagnostic::error(format!("{digits} is not a number")).at(source, span.clone()));
                Content::Number(0.0)
            }
        },
        DeValue::Array(items) => Content::List(convert_list(items, source, diagnostics)),
        DeValue::Table(table) => Content::Table(convert_table(table, source, diagnostics)),
    };
    Node { span, content }
}

fn convert_list(items: &DeArray<'_>, source: &Arc<Source>, diagnostics: &mut Vec<Diagnostic>) -> Vec<Node> {
    items
        .iter()
        .map(|item| convert(item.get_ref(), item.span(), source, diagnostics))
        .collect()
}

/// Text as a basic string of TOML.
pub fn quote(text: &str) -> String {
    let mut quoted = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => {
                quoted.push('\\');
                quoted.push(character);
            }
            control if control.is_control() => quoted.push_str(&format!("\\u{:04X}", control as u32)),
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}
