//! Reads printed figures: in place, or from a TOML file beside the experiment.
//!
//! A file holds printed tables by the names of the tables that they stand beside, so that several experiments may use it:
//! `[distortion]` with `source = "..."`, then `[[distortion.rows]]`. A row belongs to every job whose axes have the row's
//! values; its other entries are figures by column name. Of a file's figures those that the table has no column for are
//! left out.

use super::outputs::unknown_column;
use super::{Context, axes, entries};
use crate::experiment::check::Checker;
use crate::experiment::column;
use crate::experiment::diagnostic::Source;
use crate::experiment::document::{self, Content, Node, Table};
use crate::experiment::file::Published;
use crate::experiment::grid;
use crate::experiment::nearest::{nearest, suggestion};
use crate::experiment::section::PUBLISHED;
use crate::method::setting::Kind;
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The printed figures of a table with these columns.
pub fn read(
    checker: &mut Checker,
    node: &Node,
    context: &Context<'_>,
    name: &str,
    columns: &[String],
) -> Option<Published> {
    match &node.content {
        Content::Table(table) => read_table(checker, table, node.span.clone(), context, columns, true),
        Content::Text(path) => {
            let path = context.folder.join(path);
            let text =
                match document::read(&path).and_then(|bytes| String::from_utf8(bytes).map_err(std::io::Error::other)) {
                    Ok(text) => text,
                    Err(error) => {
                        checker
                            .error(node.span.clone(), format!("cannot read {}: {error}", path.display()))
                            .help = Some("the path is relative to the experiment file".to_owned());
                        return None;
                    }
                };
            let source = Arc::new(Source {
                name: path.display().to_string(),
                text,
            });
            let table = match document::parse(&source) {
                Ok(table) => table,
                Err(diagnostics) => {
                    checker.diagnostics.extend(diagnostics);
                    return None;
                }
            };
            let Some(entry) = table.get(name) else {
                let message = format!("{} has no table [{name}]", path.display());
                let known = table.entries.iter().map(|entry| entry.key.as_str());
                checker.error(node.span.clone(), message).help = suggestion(name, known);
                return None;
            };
            let mut inner = Checker::new(source);
            let published = inner.table(&entry.value, name).and_then(|table| {
                let owner = entry.value.span.clone();
                read_table(&mut inner, table, owner, context, columns, false)
            });
            checker.diagnostics.extend(inner.diagnostics);
            published
        }
        _ => {
            checker.wrong_type(
                node,
                "published",
                "the path of a file, or { source = ..., rows = [...] }",
            );
            None
        }
    }
}

/// `strict` when figures without a column are errors; a file may hold more than one experiment shows.
fn read_table(
    checker: &mut Checker,
    table: &Table,
    owner: std::ops::Range<usize>,
    context: &Context<'_>,
    columns: &[String],
    strict: bool,
) -> Option<Published> {
    let found = entries(checker, PUBLISHED, table, "published", owner, false);
    let mut rows = Vec::new();
    if let Some(entry) = found.nodes.get("rows") {
        let items = checker.list(&entry.value, "rows")?;
        if items.is_empty() {
            checker.error(entry.value.span.clone(), "\"rows\" is empty").label = "expected at least one row".to_owned();
        }
        rows = items
            .iter()
            .filter_map(|item| read_row(checker, item, context, columns, strict))
            .collect();
    }
    Some(Published {
        source: found.text("source")?,
        machine: found.text("machine"),
        rows,
    })
}

fn read_row(
    checker: &mut Checker,
    node: &Node,
    context: &Context<'_>,
    columns: &[String],
    strict: bool,
) -> Option<BTreeMap<String, Value>> {
    let table = checker.table(node, "rows")?;
    let mut cells = Vec::new();
    axes::flatten(table, "", &mut cells);
    let mut row = BTreeMap::new();
    let mut condition = grid::Point::new();
    let mut figures = 0;
    let before = checker.diagnostics.len();
    for cell in cells {
        if let Some(axis) = context.axes.find(&cell.name) {
            if let Some(value) = axes::checked_value(checker, cell.node, axis) {
                condition.push((axis.name.clone(), value.clone()));
                row.insert(axis.name.clone(), value);
            }
        } else if cell.name == "tolerance" {
            let relative = Kind::Number {
                min: 0.0,
                max: f64::MAX,
            };
            if let Some(value) = checker.value(&relative, cell.node, &cell.name) {
                row.insert(cell.name.clone(), value);
            }
        } else if column::find(context.method, &cell.name).is_some() {
            figures += 1;
            let value = match cell.node.content {
                Content::Integer(value) => Value::from(value),
                Content::Number(value) if value.is_finite() => Value::from(value),
                _ => {
                    checker.wrong_type(cell.node, &cell.name, "the printed number");
                    continue;
                }
            };
            if columns.contains(&cell.name) {
                row.insert(cell.name.clone(), value);
            } else if strict {
                checker
                    .error(
                        cell.span.clone(),
                        format!("\"{}\" is no column of this table", cell.name),
                    )
                    .help = Some("add it to \"columns\", or remove the figure".to_owned());
            }
        } else if nearest(&cell.name, context.axes.names()).is_some() {
            axes::unknown_axis(checker, cell.span.clone(), &cell.name, context.axes);
        } else {
            unknown_column(checker, cell.span.clone(), &cell.name, context);
        }
    }
    if checker.diagnostics.len() > before {
        return None;
    }
    if condition.is_empty() || figures == 0 {
        let lacks = if figures == 0 { "no figure" } else { "no axis value" };
        checker
            .error(node.span.clone(), format!("a printed row with {lacks}"))
            .label = "expected axis values and figures, such as { energy = \"stretch\", d_ma = 1.2 }".to_owned();
        return None;
    }
    let met = |point: &grid::Point| condition.iter().all(|cell| point.contains(cell));
    if !context.points.is_empty() && !context.points.iter().any(met) {
        let message = format!("no job belongs to the printed row {}", grid::describe(&condition));
        checker.warning(node.span.clone(), message).help = Some("it is not shown".to_owned());
    }
    Some(row)
}
