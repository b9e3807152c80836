//! Settings declared as data: names, kinds, defaults and documentation of everything an experiment file may hold.
//!
//! One declaration serves the diagnostics, the defaults, the key, `vargeo schema` and `vargeo list settings`.

use serde_json::{Map, Value};

/// A named entry of a table in the experiment file.
#[derive(Debug)]
pub struct Field {
    pub name: &'static str,
    pub kind: Kind,
    pub default: Default,
    /// One or two sentences: meaning, unit, source.
    pub doc: &'static str,
}

/// What a field holds.
#[derive(Debug)]
pub enum Kind {
    Boolean,
    /// Whole number within `[min, max]`.
    Integer {
        min: i64,
        max: i64,
    },
    /// Finite number within `[min, max]`; a whole number in the file is taken as a number.
    Number {
        min: f64,
        max: f64,
    },
    /// One of a list of words, each with a one-line meaning.
    Choice(&'static [(&'static str, &'static str)]),
    /// Words known at run time, such as the energies: the function lists them with their meanings.
    Named(fn() -> Vec<(&'static str, String)>),
    /// Free text.
    Text,
    /// `"10 min"`: held as seconds.
    Duration,
    /// `"8 GiB"`: held as bytes.
    Size,
    /// Path of an input file, relative to the experiment file or to a models folder.
    File,
    /// A table with these fields.
    Table(&'static [Field]),
    /// Any number of values of one kind.
    List(&'static Kind),
    /// Any of these kinds, tried in order by TOML type; at most one per TOML type.
    OneOf(&'static [Kind]),
}

/// What stands in when the file is silent.
#[derive(Debug)]
pub enum Default {
    /// An error when absent.
    Required,
    /// Left out of the resolved job when absent.
    Absent,
    Boolean(bool),
    Integer(i64),
    Number(f64),
    Text(&'static str),
    /// A table filled with its fields' own defaults.
    Fields,
}

/// The given table with declared defaults where it is silent, recursively.
pub fn fill(fields: &[Field], given: &Value) -> Map<String, Value> {
    let mut table = Map::new();
    for field in fields {
        let present = given.get(field.name);
        let value = match (&field.kind, &field.default, present) {
            (Kind::Table(inner), _, Some(value)) => Some(Value::Object(fill(inner, value))),
            (Kind::List(Kind::Table(inner)), _, Some(Value::Array(items))) => {
                Some(items.iter().map(|item| Value::Object(fill(inner, item))).collect())
            }
            (_, _, Some(value)) => Some(value.clone()),
            (Kind::Table(inner), Default::Fields, None) => Some(Value::Object(fill(inner, &Value::Null))),
            (_, Default::Boolean(value), None) => Some(Value::from(*value)),
            (_, Default::Integer(value), None) => Some(Value::from(*value)),
            (_, Default::Number(value), None) => Some(Value::from(*value)),
            (_, Default::Text(value), None) => Some(Value::from(*value)),
            _ => None,
        };
        if let Some(value) = value {
            table.insert(field.name.to_string(), value);
        }
    }
    table
}
