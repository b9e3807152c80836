//! `vargeo list`: what an experiment file may name, each with its meaning, formula and source.

use super::Exit;
use crate::energy;
use crate::experiment::check::{expectation, plain};
use crate::experiment::claims::CLAIMS;
use crate::experiment::column::columns;
use crate::experiment::record::STOPS;
use crate::mesh::format::FORMATS;
use crate::method::model::Generator;
use crate::method::setting::{Default, Field, Kind};
use crate::method::{Method, methods};
use crate::metric::Better;
use std::fmt::Write as _;
use std::io::{self, Write as _};

/// Lists what an experiment file may name: without an argument the names, with one their meanings.
#[derive(clap::Args)]
pub struct Arguments {
    /// What to explain.
    #[arg(value_enum)]
    list: Option<List>,
    /// Only what belongs to this method, for metrics, traces, settings and models.
    method: Option<String>,
}

/// The lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum List {
    /// Methods with their sources.
    Methods,
    /// Energies with formulas and sources.
    Energies,
    /// Metrics, counters and measurements: columns of tables.
    Metrics,
    /// Columns over the iterations, for plots.
    Traces,
    /// Settings of each method with their defaults.
    Settings,
    /// Generators and shapes with their parameters.
    Models,
    /// Claims of the papers.
    Claims,
    /// Formats of mesh files.
    Formats,
    /// Why a job may end.
    Stops,
}

const LISTS: &[List] = &[
    List::Methods,
    List::Energies,
    List::Metrics,
    List::Traces,
    List::Settings,
    List::Models,
    List::Claims,
    List::Formats,
    List::Stops,
];

/// A thing that can be named.
struct Item {
    name: String,
    /// Set beside the name, such as a default.
    note: String,
    text: Vec<String>,
}

/// Items under a heading, such as a method's name; empty where there is only one.
struct Group {
    heading: String,
    items: Vec<Item>,
}

/// Prints the lists.
pub fn execute(arguments: Arguments) -> Exit {
    let mut text = String::new();
    let all: Vec<&'static dyn Method> = methods()
        .iter()
        .copied()
        .filter(|method| arguments.method.as_deref().is_none_or(|name| name == method.name()))
        .collect();
    if all.is_empty() {
        let names: Vec<&str> = methods().iter().map(|method| method.name()).collect();
        tell!("error: no method has this name; there are {}", names.join(", "));
        return Exit::FileWrong;
    }
    match arguments.list {
        Some(list) => {
            for group in groups(list, &all) {
                explain(&group, &mut text);
            }
        }
        None => {
            for list in LISTS {
                let names: Vec<String> = groups(*list, &all)
                    .into_iter()
                    .flat_map(|group| group.items)
                    .map(|item| item.name)
                    .collect();
                let _ = writeln!(text, "{}", word(*list));
                wrap(&names.join(", "), 2, &mut text);
            }
            text.push_str("\n`vargeo list energies`, and so on, explains each.\n");
        }
    }
    // A reader who has gone away is no error.
    let _ = io::stdout().write_all(text.as_bytes());
    Exit::Well
}

fn word(list: List) -> String {
    format!("{list:?}").to_lowercase()
}

fn explain(group: &Group, text: &mut String) {
    if !group.heading.is_empty() {
        let _ = writeln!(text, "{}\n", group.heading);
    }
    for item in &group.items {
        let _ = writeln!(
            text,
            "{}{}{}",
            item.name,
            if item.note.is_empty() { "" } else { "  " },
            item.note
        );
        for line in &item.text {
            wrap(line, 4, text);
        }
    }
    text.push('\n');
}

/// Lines of at most 100 characters, indented.
fn wrap(words: &str, indent: usize, text: &mut String) {
    let margin = " ".repeat(indent);
    let mut line = String::new();
    for word in words.split_whitespace() {
        if !line.is_empty() && indent + line.chars().count() + 1 + word.chars().count() > 100 {
            let _ = writeln!(text, "{margin}{line}");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    if !line.is_empty() {
        let _ = writeln!(text, "{margin}{line}");
    }
}

fn groups(list: List, all: &[&'static dyn Method]) -> Vec<Group> {
    let one = |items: Vec<Item>| {
        vec![Group {
            heading: String::new(),
            items,
        }]
    };
    let item = |name: &str, note: &str, text: Vec<String>| Item {
        name: name.to_owned(),
        note: note.to_owned(),
        text,
    };
    match list {
        List::Methods => one(methods()
            .iter()
            .map(|method| {
                let text = vec![method.summary().to_owned(), format!("Source: {}", method.source())];
                item(method.name(), &format!("version {}", method.version()), text)
            })
            .collect()),
        List::Energies => one(energy::energies()
            .iter()
            .map(|energy| {
                let note = if energy.is_barrier() { "barrier" } else { "" };
                let text = vec![energy.formula().to_owned(), format!("Source: {}", energy.source())];
                item(energy.name(), note, text)
            })
            .collect()),
        List::Claims => one(CLAIMS
            .iter()
            .map(|claim| item(claim.id, claim.method, vec![claim.text.to_owned()]))
            .collect()),
        List::Formats => one(FORMATS
            .iter()
            .map(|format| {
                let extensions: Vec<String> = format.extensions.iter().map(|name| format!(".{name}")).collect();
                item(format.name, &extensions.join(" "), vec![format.doc.to_owned()])
            })
            .collect()),
        List::Stops => one(STOPS
            .iter()
            .map(|(name, meaning)| item(name, "", vec![(*meaning).to_owned()]))
            .collect()),
        List::Metrics => by_method(all, |method| {
            let metric = |metric: crate::metric::Metric| {
                let mut notes = Vec::new();
                if !metric.unit.is_empty() {
                    notes.push(format!("in {}", metric.unit));
                }
                match metric.better {
                    Better::Lower => notes.push("lower is better".to_owned()),
                    Better::Higher => notes.push("higher is better".to_owned()),
                    Better::Neither => {}
                }
                if let Some(floor) = metric.floor {
                    notes.push(format!("at best {}", plain(floor)));
                }
                item(metric.name, &notes.join(", "), vec![metric.definition.to_owned()])
            };
            columns(method).into_iter().map(metric).collect()
        }),
        List::Traces => by_method(all, |method| {
            let traces = method.traces().iter();
            traces
                .map(|(name, meaning)| item(name, "", vec![(*meaning).to_owned()]))
                .collect()
        }),
        List::Settings => by_method(all, |method| {
            let mut items = Vec::new();
            settings(method.settings(), "", &mut items);
            items
        }),
        List::Models => all.iter().flat_map(|method| models(*method)).collect(),
    }
}

/// A group for each method.
fn by_method(all: &[&'static dyn Method], items: impl Fn(&'static dyn Method) -> Vec<Item>) -> Vec<Group> {
    all.iter()
        .map(|method| Group {
            heading: format!("of method {}", method.name()),
            items: items(*method),
        })
        .collect()
}

/// Settings by dotted path.
fn settings(fields: &'static [Field], prefix: &str, items: &mut Vec<Item>) {
    for field in fields {
        let name = format!("{prefix}{}", field.name);
        items.push(setting(field, &name));
        within(&field.kind, &name, items);
    }
}

/// The fields of a table, of the tables of a list as `name[].field`, and of those among alternatives.
fn within(kind: &'static Kind, name: &str, items: &mut Vec<Item>) {
    match kind {
        Kind::Table(inner) => settings(inner, &format!("{name}."), items),
        Kind::List(each) => within(each, &format!("{name}[]"), items),
        Kind::OneOf(kinds) => kinds.iter().for_each(|kind| within(kind, name, items)),
        _ => {}
    }
}

fn setting(field: &Field, name: &str) -> Item {
    let note = match &field.default {
        Default::Required => "required".to_owned(),
        Default::Absent | Default::Fields => String::new(),
        Default::Boolean(value) => format!("= {value}"),
        Default::Integer(value) => format!("= {value}"),
        Default::Number(value) => format!("= {}", plain(*value)),
        Default::Text(text) => format!("= \"{text}\""),
    };
    let mut text = vec![field.doc.to_owned()];
    match &field.kind {
        Kind::Choice(words) => text.extend(words.iter().map(|(word, meaning)| format!("\"{word}\": {meaning}"))),
        Kind::Named(words) => {
            let words: Vec<&str> = words().into_iter().map(|(word, _)| word).collect();
            text.push(format!("One of {}.", words.join(", ")));
        }
        Kind::Table(_) => {}
        kind => text.push(format!("Expects {}.", expectation(kind))),
    }
    Item {
        name: name.to_owned(),
        note,
        text,
    }
}

/// A group for each role: what generates it, with parameters.
fn models(method: &'static dyn Method) -> Vec<Group> {
    let role = |role: &'static crate::method::model::Role| {
        let file = if role.file { " Or the path of a file." } else { "" };
        let mut items = Vec::new();
        let describe = |field: &Field| {
            let parameter = setting(field, field.name);
            let space = if parameter.note.is_empty() { "" } else { " " };
            let sentence = |text: &String| match text.ends_with('.') {
                true => text.clone(),
                false => format!("{text}."),
            };
            let text: Vec<String> = parameter.text.iter().map(sentence).collect();
            format!("{}{space}{}: {}", parameter.name, parameter.note, text.join(" "))
        };
        if role.file && !role.file_parameters.is_empty() {
            items.push(Item {
                name: "{ file = \"PATH\", ... }".to_owned(),
                note: String::new(),
                text: role.file_parameters.iter().map(describe).collect(),
            });
        }
        let described = |generator: &Generator| -> Vec<(&str, String)> {
            let parameters = generator.parameters.iter();
            parameters.map(|field| (field.name, describe(field))).collect()
        };
        // What most generators take is told once.
        let mut shared: Vec<(&str, String)> = Vec::new();
        for one in role.generators.iter().flat_map(described) {
            let count = role
                .generators
                .iter()
                .filter(|other| described(other).contains(&one))
                .count();
            if count > 2 && 2 * count > role.generators.len() && !shared.contains(&one) {
                shared.push(one);
            }
        }
        if !shared.is_empty() {
            items.push(Item {
                name: "parameters of most".to_owned(),
                note: String::new(),
                text: shared.iter().map(|(_, text)| text.clone()).collect(),
            });
        }
        for generator in role.generators {
            let mut text = vec![generator.doc.to_owned()];
            let (common, own): (Vec<_>, Vec<_>) =
                described(generator).into_iter().partition(|one| shared.contains(one));
            text.extend(own.into_iter().map(|(_, text)| text));
            if !common.is_empty() {
                let names: Vec<&str> = common.into_iter().map(|(name, _)| name).collect();
                text.push(format!("And {} as above.", names.join(", ")));
            }
            items.push(Item {
                name: generator.name.to_owned(),
                note: String::new(),
                text,
            });
        }
        Group {
            heading: format!(
                "{} of method {}, as {{ {} = \"NAME\", ... }}. {}{file}",
                role.name,
                method.name(),
                role.generator_key,
                role.doc
            ),
            items,
        }
    };
    method.model().roles.iter().map(role).collect()
}
