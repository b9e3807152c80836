//! Reads `[models.*]`: a file or a generator for each role that the method's models have.

use crate::experiment::check::{Checker, defaults};
use crate::experiment::document::{Content, Entry, Node, Table};
use crate::experiment::file::{Model, PartSpecification};
use crate::experiment::nearest::suggestion;
use crate::method::Method;
use crate::method::model::Role;
use crate::method::setting::Field;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// The words that say which generator makes a part: one of them by role.
const GENERATOR_KEYS: [&str; 2] = ["generate", "shape"];

/// The role whose generator `model.PARAMETER` sets: `mesh`, or the first.
pub fn main_role(method: &dyn Method) -> Option<&'static Role> {
    let roles = method.model().roles;
    roles.iter().find(|role| role.name == "mesh").or(roles.first())
}

/// Why an axis does not fit a model.
pub struct Unfit {
    pub label: String,
    pub help: Option<String>,
}

/// The declaration of a generator's parameter in one model.
pub fn generator_parameter(
    method: &'static dyn Method,
    model: &Model,
    role: &str,
    name: &str,
) -> Result<&'static Field, Unfit> {
    let role = method.model().roles.iter().find(|known| known.name == role);
    let unfit = |label: String, help: Option<String>| Err(Unfit { label, help });
    match (role, role.and_then(|role| model.parts.get(role.name))) {
        (Some(role), Some(PartSpecification::Generated { generator, .. })) => {
            let declared = role.generators.iter().find(|known| known.name == generator.as_str());
            let fields = declared.map_or(&[][..], |generator| generator.parameters);
            match fields.iter().find(|field| field.name == name) {
                Some(field) => Ok(field),
                None => unfit(
                    format!("generator \"{generator}\" has no parameter \"{name}\""),
                    suggestion(name, fields.iter().map(|field| field.name)),
                ),
            }
        }
        (Some(role), Some(PartSpecification::File { .. })) => unfit(
            format!("its {} is a file", role.name),
            Some("list under `model` only those that are generated, or split the experiment".to_owned()),
        ),
        _ => unfit("it has no such part".to_owned(), None),
    }
}

/// The models, and the names of those that are wrong.
pub fn read(
    checker: &mut Checker,
    method: &'static dyn Method,
    file: &Table,
    varied: &BTreeSet<String>,
) -> (Vec<Model>, BTreeSet<String>) {
    let mut models = Vec::new();
    let mut broken = BTreeSet::new();
    let table = file
        .get("models")
        .and_then(|entry| checker.table(&entry.value, "models"));
    for entry in table.map_or(&[][..], |table| &table.entries) {
        let before = checker.diagnostics.len();
        let model = read_one(checker, method, entry, varied);
        match model {
            Some(model) if checker.diagnostics.len() == before => models.push(model),
            _ => {
                broken.insert(entry.key.clone());
            }
        }
    }
    let required = method.model().roles.iter().any(|role| role.required);
    if required && models.is_empty() && broken.is_empty() {
        let span = file.get("method").map_or(0..0, |entry| entry.value.span.clone());
        let diagnostic = checker.error(
            span,
            format!("method \"{}\" needs a model, and there is none", method.name()),
        );
        diagnostic.help = Some("add a table [models.NAME]; `vargeo new` prints an example".to_owned());
    }
    (models, broken)
}

fn read_one(
    checker: &mut Checker,
    method: &'static dyn Method,
    entry: &Entry,
    varied: &BTreeSet<String>,
) -> Option<Model> {
    let table = checker.table(&entry.value, &format!("models.{}", entry.key))?;
    if entry.key.is_empty() {
        checker.error(entry.key_span.clone(), "a model without a name");
    }
    let roles = method.model().roles;
    let mut model = Model {
        name: entry.key.clone(),
        optional: false,
        parts: BTreeMap::new(),
    };
    for part in &table.entries {
        let path = format!("models.{}.{}", entry.key, part.key);
        checker.places.insert(path.clone(), part.value.span.clone());
        if part.key == "optional" {
            match part.value.content {
                Content::Boolean(value) => model.optional = value,
                _ => checker.wrong_type(&part.value, "optional", "true or false"),
            }
        } else if let Some(role) = roles.iter().find(|role| role.name == part.key) {
            if let Some(specification) = read_part(checker, role, &part.value, &path, varied) {
                model.parts.insert(role.name.to_owned(), specification);
            }
        } else {
            let owner = format!("model \"{}\"", entry.key);
            checker.unknown_key(part, &owner, roles.iter().map(|role| role.name).chain(["optional"]));
        }
    }
    for role in roles {
        if role.required && table.get(role.name).is_none() {
            let message = format!("model \"{}\" has no {}", entry.key, role.name);
            let diagnostic = checker.error(span_of(entry), message);
            diagnostic.label = format!("expected {} = {}", role.name, example(role));
        }
    }
    Some(model)
}

/// The header of a model's table, or its name where it is written inline.
fn span_of(entry: &Entry) -> Range<usize> {
    if entry.value.span.contains(&entry.key_span.start) {
        entry.value.span.clone()
    } else {
        entry.key_span.clone()
    }
}

/// How a role may be given, such as `{ generate = "ball" }` or `"FILE"`.
fn example(role: &Role) -> String {
    let generated = role
        .generators
        .first()
        .map(|generator| format!("{{ {} = \"{}\", ... }}", role.generator_key, generator.name));
    match (role.file, generated) {
        (true, Some(generated)) => format!("\"FILE\" or {generated}"),
        (true, None) => "\"FILE\"".to_owned(),
        (false, Some(generated)) => generated,
        (false, None) => "nothing".to_owned(),
    }
}

fn read_part(
    checker: &mut Checker,
    role: &'static Role,
    node: &Node,
    path: &str,
    varied: &BTreeSet<String>,
) -> Option<PartSpecification> {
    let generators = || role.generators.iter().map(|generator| generator.name);
    match &node.content {
        Content::Text(text) if role.file => {
            // A word without a dot that is a generator's name was meant as one.
            if generators().any(|name| name == text) {
                let message = format!("\"{text}\" is read as a file, and is the name of a generator");
                checker.error(node.span.clone(), message).help = Some(format!(
                    "write {{ {} = \"{text}\" }}, or \"./{text}\" for a file",
                    role.generator_key
                ));
                return None;
            }
            Some(PartSpecification::File {
                path: file_name(checker, node, text)?,
                parameters: Value::Object(defaults(role.file_parameters)),
            })
        }
        Content::Table(table) => {
            let generator = table.get(role.generator_key);
            let file = table.get("file");
            match (generator, file) {
                (Some(entry), None) => {
                    let name = checker.text(&entry.value, role.generator_key)?.to_owned();
                    let Some(generator) = role.generators.iter().find(|known| known.name == name) else {
                        checker.unknown_name(entry.value.span.clone(), noun(role), &name, generators());
                        return None;
                    };
                    let parameters = parameters(
                        checker,
                        generator.parameters,
                        table,
                        role.generator_key,
                        path,
                        node,
                        varied,
                    )?;
                    Some(PartSpecification::Generated {
                        generator: generator.name.to_owned(),
                        parameters,
                    })
                }
                (None, Some(entry)) if role.file => {
                    let text = checker.text(&entry.value, "file")?.to_owned();
                    checker.places.insert(path.to_owned(), entry.value.span.clone());
                    let name = file_name(checker, &entry.value, &text);
                    let parameters = parameters(checker, role.file_parameters, table, "file", path, node, varied)?;
                    Some(PartSpecification::File {
                        path: name?,
                        parameters,
                    })
                }
                (Some(_), Some(file)) => {
                    checker
                        .error(
                            file.key_span.clone(),
                            format!("both \"{}\" and \"file\" are given", role.generator_key),
                        )
                        .help = Some("keep one of the two".to_owned());
                    None
                }
                _ => {
                    let mut known = Vec::new();
                    if !role.generators.is_empty() {
                        known.push(role.generator_key);
                    }
                    if role.file {
                        known.push("file");
                    }
                    let message = format!("\"{path}\" says neither {}", known.join(" nor "));
                    let message = if known.len() == 1 {
                        message.replace("neither", "no")
                    } else {
                        message
                    };
                    let diagnostic = checker.error(node.span.clone(), message);
                    diagnostic.label = format!("expected {}", example(role));
                    diagnostic.help = table.entries.iter().find_map(|entry| {
                        // The word that another role uses.
                        let foreign = GENERATOR_KEYS.contains(&entry.key.as_str()) && !role.generators.is_empty();
                        let near = match foreign {
                            true => role.generator_key,
                            false => crate::experiment::nearest::nearest(&entry.key, known.iter().copied())?,
                        };
                        Some(format!("did you mean \"{near}\" instead of \"{}\"?", entry.key))
                    });
                    None
                }
            }
        }
        Content::Text(text) => {
            checker.wrong_type(node, path, &example(role));
            if generators().any(|name| name == text)
                && let Some(last) = checker.diagnostics.last_mut()
            {
                last.help = Some(format!("write {{ {} = \"{text}\" }}", role.generator_key));
            }
            None
        }
        _ => {
            checker.wrong_type(node, path, &example(role));
            None
        }
    }
}

/// What the generators of a role are called in messages.
fn noun(role: &Role) -> &'static str {
    if role.generator_key == "generate" {
        "generator"
    } else {
        role.generator_key
    }
}

fn file_name(checker: &mut Checker, node: &Node, text: &str) -> Option<String> {
    if text.trim().is_empty() {
        checker.error(node.span.clone(), "an empty file name").label = "expected the path of a file".to_owned();
        return None;
    }
    Some(text.to_owned())
}

/// The parameters of a generator or a file: every key of the table but the one that chose it.
fn parameters(
    checker: &mut Checker,
    fields: &'static [Field],
    table: &Table,
    chooser: &str,
    path: &str,
    node: &Node,
    varied: &BTreeSet<String>,
) -> Option<Value> {
    let rest = Table {
        entries: table
            .entries
            .iter()
            .filter(|entry| entry.key != chooser)
            .cloned()
            .collect(),
    };
    checker
        .fields(fields, Some(&rest), path, node.span.clone(), varied)
        .map(Value::Object)
}
