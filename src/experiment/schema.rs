//! JSON Schema (draft 2020-12) of the experiment file, derived from the declarations that the reader checks against.
//!
//! Guarantees that every file which the reader takes is valid; the reader finds more, such as names that depend on other
//! sections. Editors use it for completion and hints.

use super::check::{default, fields_of};
use super::column::columns;
use super::read::axes::paths;
use super::section::{BOUND, COMPARISON, EXPERIMENT, Holds, Key, PUBLISHED};
use super::unit::{DURATIONS, SIZES};
use crate::method::Method;
use crate::method::model::Role;
use crate::method::setting::{Default, Field, Kind};
use serde_json::{Map, Value, json};

/// The schema for files of these methods.
pub fn schema(methods: &[&'static dyn Method]) -> Value {
    let names: Vec<&str> = methods.iter().map(|method| method.name()).collect();
    let mut definitions = Map::new();
    definitions.insert(
        "duration".to_owned(),
        quantity(DURATIONS, "A duration such as \"10 min\"."),
    );
    definitions.insert("size".to_owned(), quantity(SIZES, "A size such as \"8 GiB\"."));
    let mut cases = Vec::new();
    for method in methods {
        let scope = Scope { method: *method };
        scope.settings(method.settings(), "", &mut definitions);
        for (name, definition) in scope.definitions() {
            definitions.insert(format!("{}.{name}", method.name()), definition);
        }
        cases.push(json!({
            "if": { "properties": { "method": { "const": method.name() } }, "required": ["method"] },
            "then": { "$ref": scope.reference("experiment") },
        }));
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "vargeo experiment",
        "description": "A batch of geometry experiments: models, settings, axes, and what is reported and expected.",
        "type": "object",
        "required": ["method"],
        "properties": { "method": { "enum": names } },
        "allOf": cases,
        "$defs": definitions,
    })
}

/// The schema of one kind of value.
pub fn kind(kind: &Kind) -> Value {
    match kind {
        Kind::Boolean => json!({ "type": "boolean" }),
        Kind::Integer { min, max } => {
            let mut schema = json!({ "type": "integer" });
            if *min > i64::MIN {
                schema["minimum"] = json!(min);
            }
            if *max < i64::MAX {
                schema["maximum"] = json!(max);
            }
            schema
        }
        Kind::Number { min, max } => {
            let mut schema = json!({ "type": "number" });
            if *min > f64::MIN {
                schema["minimum"] = json!(min);
            }
            if *max < f64::MAX {
                schema["maximum"] = json!(max);
            }
            schema
        }
        Kind::Choice(words) => words_of(words.iter().map(|(word, meaning)| (*word, (*meaning).to_owned()))),
        Kind::Named(words) => words_of(words().into_iter()),
        Kind::Text | Kind::File => json!({ "type": "string" }),
        Kind::Duration => json!({ "$ref": "#/$defs/duration" }),
        Kind::Size => json!({ "$ref": "#/$defs/size" }),
        Kind::Table(fields) => table(fields),
        Kind::List(inner) => json!({ "type": "array", "items": self::kind(inner) }),
        Kind::OneOf(kinds) => json!({ "anyOf": kinds.iter().map(self::kind).collect::<Vec<_>>() }),
    }
}

/// Words with their meanings in the description, where editors show them.
fn words_of(words: impl Iterator<Item = (&'static str, String)>) -> Value {
    let words: Vec<(&str, String)> = words.collect();
    let meanings: Vec<String> = words
        .iter()
        .map(|(word, meaning)| format!("{word}: {meaning}"))
        .collect();
    let names: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
    json!({ "type": "string", "enum": names, "description": meanings.join("\n") })
}

/// A declared field: its kind, its meaning, its default.
fn field(field: &Field) -> Value {
    let mut schema = described(kind(&field.kind), field.doc);
    if let (Some(default), false) = (default(field), matches!(field.default, Default::Fields)) {
        schema["default"] = match (&field.default, &field.kind) {
            (Default::Text(text), Kind::Duration | Kind::Size) => json!(text),
            _ => default,
        };
    }
    schema
}

/// Puts a meaning before what a schema says of itself.
fn described(mut schema: Value, doc: &str) -> Value {
    let more = schema
        .get("description")
        .and_then(Value::as_str)
        .map(|text| format!("\n{text}"));
    schema["description"] = json!(format!("{doc}{}", more.unwrap_or_default()));
    schema
}

/// A table of fields. Required fields are left to the reader where an axis may give them.
fn table(fields: &[Field]) -> Value {
    let properties: Map<String, Value> = fields.iter().map(|each| (each.name.to_owned(), field(each))).collect();
    json!({ "type": "object", "properties": properties, "additionalProperties": false })
}

fn quantity(units: &[(&str, f64)], doc: &str) -> Value {
    let names: Vec<&str> = units.iter().map(|(name, _)| *name).collect();
    json!({
        "type": "string",
        "pattern": format!(r"^\s*\+?[0-9_]*\.?[0-9_]+\.?\s*({})\s*$", names.join("|")),
        "description": format!("{doc} Units: {}.", names.join(", ")),
    })
}

/// What depends on the method.
struct Scope {
    method: &'static dyn Method,
}

impl Scope {
    fn reference(&self, name: &str) -> String {
        format!("#/$defs/{}.{name}", self.method.name())
    }

    fn refer(&self, name: &str) -> Value {
        json!({ "$ref": self.reference(name) })
    }

    /// A definition for each setting by its dotted path, which axes and conditions refer to.
    fn settings(&self, fields: &[Field], prefix: &str, definitions: &mut Map<String, Value>) {
        for field in fields {
            let path = format!("{prefix}{}", field.name);
            let schema = match &field.kind {
                Kind::Table(inner) => described(self.setting_table(inner, &format!("{path}.")), field.doc),
                _ => self::field(field),
            };
            definitions.insert(format!("{}.settings.{path}", self.method.name()), schema);
            if let Some(inner) = fields_of(&field.kind) {
                self.settings(inner, &format!("{path}."), definitions);
            }
        }
    }

    fn setting_table(&self, fields: &[Field], prefix: &str) -> Value {
        let refer = |field: &Field| {
            (
                field.name.to_owned(),
                self.refer(&format!("settings.{prefix}{}", field.name)),
            )
        };
        let properties: Map<String, Value> = fields.iter().map(refer).collect();
        json!({ "type": "object", "properties": properties, "additionalProperties": false })
    }

    fn definitions(&self) -> Vec<(&'static str, Value)> {
        let method_settings = self.method.settings();
        vec![
            ("experiment", self.keys(EXPERIMENT, false)),
            ("settings", self.setting_table(method_settings, "")),
            ("model", self.model()),
            ("axes", self.axes(&values)),
            ("condition", self.axes(&value_or_values)),
            ("column", self.column()),
            ("coordinate", self.coordinate()),
            ("axis", self.axis()),
            ("bound", self.bound()),
            ("published", self.keys(PUBLISHED, false)),
        ]
    }

    /// A section; `open` when columns may stand beside its keys.
    fn keys(&self, keys: &[Key], open: bool) -> Value {
        let mut properties: Map<String, Value> = keys
            .iter()
            .map(|key| (key.name.to_owned(), described(self.holds(&key.holds), key.doc)))
            .collect();
        if open {
            for column in columns(self.method) {
                let bound = described(self.refer("bound"), column.definition);
                properties.insert(column.name.to_owned(), bound);
            }
        }
        let required: Vec<&str> = keys.iter().filter(|key| key.required).map(|key| key.name).collect();
        json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
    }

    fn holds(&self, holds: &Holds) -> Value {
        let list = |items: Value| json!({ "type": "array", "items": items });
        match holds {
            Holds::Plain(plain) => kind(plain),
            Holds::Method => json!({ "const": self.method.name() }),
            Holds::Models => json!({ "type": "object", "additionalProperties": self.refer("model") }),
            Holds::Settings => self.refer("settings"),
            Holds::Axes => self.refer("axes"),
            Holds::Sections(keys) => list(self.keys(keys, false)),
            Holds::Zips => list(self.refer("axes")),
            Holds::Conditions => list(self.refer("condition")),
            Holds::Expectations(keys) => list(self.keys(keys, true)),
            Holds::Condition => self.refer("condition"),
            Holds::AxisNames => json!({ "anyOf": [self.refer("axis"), list(self.refer("axis"))] }),
            Holds::Columns => json!({ "type": "array", "minItems": 1, "items": self.refer("column") }),
            Holds::Coordinate => self.refer("coordinate"),
            Holds::Published => json!({ "anyOf": [{ "type": "string" }, self.refer("published")] }),
            Holds::PublishedRows => list(json!({ "type": "object" })),
        }
    }

    fn model(&self) -> Value {
        let mut properties = Map::new();
        properties.insert(
            "optional".to_owned(),
            json!({
                "type": "boolean",
                "default": false,
                "description": "Whether a missing file skips the model's jobs with a notice instead of being an error.",
            }),
        );
        let mut required = Vec::new();
        for role in self.method.model().roles {
            if role.required {
                required.push(role.name);
            }
            properties.insert(role.name.to_owned(), described(self.role(role), role.doc));
        }
        json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
    }

    fn role(&self, role: &Role) -> Value {
        let mut ways = Vec::new();
        if role.file {
            ways.push(json!({ "type": "string", "description": "The path of a file." }));
            let mut with_file = table(role.file_parameters);
            with_file["properties"]["file"] = json!({ "type": "string", "description": "The path of a file." });
            with_file["required"] = json!(["file"]);
            ways.push(with_file);
        }
        for generator in role.generators {
            let mut way = table(generator.parameters);
            way["properties"][role.generator_key] = json!({ "const": generator.name, "description": generator.doc });
            way["required"] = json!([role.generator_key]);
            way["description"] = json!(generator.doc);
            ways.push(way);
        }
        json!({ "anyOf": ways })
    }

    /// A table by axis name, flat with dotted names or nested. `wrap` makes an entry's schema of a value's.
    fn axes(&self, wrap: &dyn Fn(Value) -> Value) -> Value {
        let mut properties = self.fields_as_axes(self.method.settings(), "", "", wrap);
        let text = wrap(json!({ "type": "string" }));
        let mut nested = Map::new();
        for (main, role, parameter, of_each) in parameters(self.method) {
            let schema = wrap(json!({ "anyOf": of_each }));
            if main {
                properties.insert(format!("model.{parameter}"), schema.clone());
                nested.insert(parameter.to_owned(), schema.clone());
            }
            properties.insert(format!("model.{role}.{parameter}"), schema);
        }
        // Written without quotes, `model.tetrahedra` is a table within the table.
        let table = json!({ "type": "object", "properties": nested });
        properties.insert(
            "model".to_owned(),
            json!({ "anyOf": [text, table], "description": "Names of models." }),
        );
        json!({ "type": "object", "properties": properties, "additionalProperties": false, "minProperties": 1 })
    }

    /// Each field as an axis, by its dotted path and as a table within a table. `prefix` is the path of these fields,
    /// `shown` the part of it that is written out here.
    fn fields_as_axes(
        &self,
        fields: &[Field],
        prefix: &str,
        shown: &str,
        wrap: &dyn Fn(Value) -> Value,
    ) -> Map<String, Value> {
        let mut properties = Map::new();
        for field in fields {
            let path = format!("{prefix}{}", field.name);
            let name = format!("{shown}{}", field.name);
            let own = wrap(self.refer(&format!("settings.{path}")));
            match fields_of(&field.kind) {
                None => {
                    properties.insert(name, own);
                }
                Some(inner) => {
                    let path = format!("{path}.");
                    let dotted = self.fields_as_axes(inner, &path, &format!("{name}."), wrap);
                    let nested = self.fields_as_axes(inner, &path, "", wrap);
                    let table = json!({ "type": "object", "properties": nested, "additionalProperties": false });
                    properties.insert(name, json!({ "anyOf": [own, table] }));
                    properties.extend(dotted);
                }
            }
        }
        properties
    }

    fn axis(&self) -> Value {
        let mut names = vec!["model".to_owned()];
        names.extend(paths(self.method.settings()));
        for (main, role, parameter, _) in parameters(self.method) {
            if main {
                names.push(format!("model.{parameter}"));
            }
            names.push(format!("model.{role}.{parameter}"));
        }
        json!({ "type": "string", "enum": names, "description": "An axis of the file." })
    }

    fn column(&self) -> Value {
        let columns = columns(self.method);
        words_of(columns.iter().map(|column| (column.name, column.definition.to_owned())))
    }

    fn coordinate(&self) -> Value {
        let traces = words_of(
            self.method
                .traces()
                .iter()
                .map(|(name, meaning)| (*name, (*meaning).to_owned())),
        );
        json!({ "anyOf": [traces, self.refer("column"), self.refer("axis")] })
    }

    fn bound(&self) -> Value {
        let mut bound = table(BOUND);
        for key in COMPARISON {
            bound["properties"][key.name] = described(self.holds(&key.holds), key.doc);
        }
        bound["minProperties"] = json!(1);
        json!({ "anyOf": [{ "type": "number" }, bound] })
    }
}

/// Parameters of the generators: whether of the main role, role, name, and the kinds that they have in its generators.
fn parameters(method: &dyn Method) -> Vec<(bool, &'static str, &'static str, Vec<Value>)> {
    let main = super::read::models::main_role(method).map(|role| role.name);
    let mut found: Vec<(bool, &'static str, &'static str, Vec<Value>)> = Vec::new();
    for role in method.model().roles {
        for field in role.generators.iter().flat_map(|generator| generator.parameters) {
            let schema = described(kind(&field.kind), field.doc);
            match found
                .iter_mut()
                .find(|(_, known, name, _)| *known == role.name && *name == field.name)
            {
                Some((_, _, _, schemas)) if schemas.contains(&schema) => {}
                Some((_, _, _, schemas)) => schemas.push(schema),
                None => found.push((main == Some(role.name), role.name, field.name, vec![schema])),
            }
        }
    }
    found
}

/// The values of an axis.
fn values(value: Value) -> Value {
    json!({ "type": "array", "minItems": 1, "items": value })
}

/// A value of a condition: one, or any of several.
fn value_or_values(value: Value) -> Value {
    json!({ "anyOf": [value, { "type": "array", "minItems": 1, "items": value }] })
}
