//! The results section: a card a job with its figures and poster, and the meshes for the viewer.

use super::html::{escape, json};
use super::mesh::{self, Order};
use super::{end, plural};
use crate::experiment::file::Experiment;
use crate::report::ReportError;
use crate::report::number::round;
use crate::report::picture::colour::{MAP, Scale};
use crate::report::picture::solid::Solid;
use crate::report::picture::{EYE, poster};
use crate::report::row::{Quantity, Row, label};
use base64::Engine;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Meshes are embedded, in the order of the jobs, until they take so many bytes; the others keep their posters.
const MOST_BYTES: usize = 6 << 20;
/// Larger meshes are not embedded.
const MOST_CELLS: usize = 400_000;

/// The cards, and what follows the page's visible part.
pub struct Results {
    pub cards: String,
    pub data: String,
}

/// A job's mesh as read, or why it cannot be shown.
type Loaded = Option<Result<Solid, String>>;

pub fn results(experiment: &Experiment, rows: &[Row]) -> Result<Results, ReportError> {
    let solids: Vec<Loaded> = rows.iter().map(load).collect();
    let scales = scales(&solids);
    let values = solids
        .iter()
        .flatten()
        .flatten()
        .map(|solid| solid.count() * solid.fields.len())
        .sum();
    let mut embedded = Embedded {
        levels: mesh::levels(values),
        ..Embedded::default()
    };
    let mut cards = String::new();
    let mut left_out = Vec::new();
    let mut shown_field = None;
    for (row, solid) in rows.iter().zip(&solids) {
        let picture = match solid {
            Some(Ok(solid)) => {
                let field = (!solid.fields.is_empty()).then_some(0);
                let name = field.map(|field| solid.fields[field].name.as_str());
                let scale = name.map_or(UNIT, |name| scales[name]);
                if shown_field.is_none() {
                    shown_field = name;
                }
                let png = poster(solid, field, scale).map_err(|error| ReportError::Picture(row.name.clone(), error))?;
                let index = embedded.add(row, solid, &scales);
                if index.is_none() {
                    left_out.push(row.name.as_str());
                }
                picture(row, solid, name, &png, index)
            }
            Some(Err(error)) => format!(
                "<p class=\"none\">The result mesh cannot be shown: {}</p>",
                escape(error)
            ),
            // The table of jobs holds those that ended well and left no mesh.
            None if row.done() => continue,
            None => String::new(),
        };
        cards.push_str(&card(experiment, row, &picture));
    }
    let mut text = String::new();
    if let Some(name) = shown_field {
        let scale = scales[name];
        let inverted = solids
            .iter()
            .flatten()
            .flatten()
            .any(|solid| solid.inverted.contains(&true));
        let _ = write!(
            text,
            "<div class=\"scale\"><span>{}{}</span><span>{}</span><span class=\"ramp\" style=\"background:linear-gradient(90deg,{})\"></span><span>{}</span>{}</div>",
            escape(&name.replace('_', " ")),
            if scale.logarithmic { ", logarithmic" } else { "" },
            round(scale.low, 3).unicode(),
            MAP.map(|[red, green, blue]| format!("#{red:02x}{green:02x}{blue:02x}"))
                .join(","),
            round(scale.high, 3).unicode(),
            if inverted {
                "<span class=\"striped\"></span><span>inverted cells</span>"
            } else {
                ""
            }
        );
    }
    if !left_out.is_empty() {
        let _ = write!(
            text,
            "<p>Too large to orbit on this page: {}. Their VTU files hold everything.</p>",
            escape(&left_out.join(", "))
        );
    }
    if !cards.is_empty() {
        let _ = write!(text, "<div class=\"cards\">{cards}</div>");
    }
    Ok(Results {
        cards: text,
        data: embedded.finish(&scales),
    })
}

const UNIT: Scale = Scale {
    low: 0.0,
    high: 1.0,
    logarithmic: false,
};

fn load(row: &Row) -> Loaded {
    let bytes = row.mesh.as_ref()?;
    let content = match crate::mesh::format::read(&format!("{}.vtu", row.name), bytes) {
        Ok(content) => content,
        Err(error) => return Some(Err(error.to_string())),
    };
    let solid = Solid::from_content(&content);
    if solid.count() == 0 {
        Some(Err("it has no cells".into()))
    } else {
        Some(Ok(solid))
    }
}

/// One scale for each field over all jobs, so that their colours compare.
fn scales(solids: &[Loaded]) -> BTreeMap<String, Scale> {
    let mut values: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for solid in solids.iter().flatten().flatten() {
        for field in &solid.fields {
            values.entry(field.name.clone()).or_default().extend(&field.values);
        }
    }
    values
        .into_iter()
        .map(|(name, values)| (name, Scale::of(values.into_iter())))
        .collect()
}

fn picture(row: &Row, solid: &Solid, field: Option<&str>, png: &[u8], index: Option<usize>) -> String {
    let inverted = solid.inverted.iter().filter(|inverted| **inverted).count();
    let coloured = field.map_or_else(String::new, |field| {
        format!(", coloured by {}", field.replace('_', " "))
    });
    let cut = if solid.is_volume() {
        ", cut open through its middle"
    } else {
        ""
    };
    let red = if inverted > 0 {
        format!(
            "; {} in striped red",
            plural(inverted, "inverted cell", "inverted cells")
        )
    } else {
        String::new()
    };
    let alternative = format!(
        "Result of {}: {}{cut}{coloured}{red}.",
        row.name,
        plural(solid.count(), "cell", "cells")
    );
    let view = index.map_or_else(String::new, |index| format!(" data-view=\"{index}\""));
    let button = if index.is_some() {
        "<button type=\"button\" hidden>Open in 3D</button>"
    } else {
        ""
    };
    format!(
        "<div class=\"picture\"{view}><img width=\"{}\" height=\"{}\" alt=\"{}\" src=\"data:image/png;base64,{}\">{button}</div>",
        crate::report::picture::WIDTH,
        crate::report::picture::HEIGHT,
        escape(&alternative),
        base64::engine::general_purpose::STANDARD.encode(png)
    )
}

/// The figures of a card: the columns of the tables, or the first metrics.
fn figures<'a>(experiment: &'a Experiment, row: &Row) -> Vec<(&'a str, f64)> {
    const MOST: usize = 6;
    let columns = experiment
        .tables
        .iter()
        .flat_map(|table| &table.columns)
        .map(String::as_str);
    let metrics = experiment.method.metrics().iter().map(|metric| metric.name);
    let mut names: Vec<&str> = Vec::new();
    for name in columns.chain(metrics) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let figures = names.into_iter().filter_map(|name| Some((name, row.figure(name)?)));
    figures.filter(|(_, value)| !value.is_nan()).take(MOST).collect()
}

fn card(experiment: &Experiment, row: &Row, picture: &str) -> String {
    let result = &row.record.result;
    let mut text = format!("<article class=\"card\"><h3>{}</h3><p>{}", escape(&row.name), end(row));
    if !result.reason.is_empty() && row.remarkable() {
        let _ = write!(text, ": {}", escape(&result.reason));
    }
    let _ = write!(text, "</p>{picture}<dl>");
    for (axis, value) in &row.axes {
        let _ = write!(text, "<dt>{}</dt><dd>{}</dd>", escape(axis), escape(&label(value)));
    }
    for (name, value) in figures(experiment, row) {
        let quantity = Quantity::find(experiment, name);
        let unit = if quantity.unit.is_empty() {
            String::new()
        } else {
            format!(" {}", escape(&quantity.unit))
        };
        let _ = write!(
            text,
            "<dt>{}</dt><dd>{}{unit}</dd>",
            // A narrow card breaks long names between their words.
            escape(name).replace('_', "_<wbr/>"),
            round(value, quantity.digits).unicode()
        );
    }
    text.push_str("</dl>");
    if !result.notices.is_empty() {
        let _ = write!(
            text,
            "<details><summary>{}</summary>",
            plural(result.notices.len(), "notice", "notices")
        );
        for notice in &result.notices {
            let _ = write!(text, "<p>{}</p>", escape(notice));
        }
        text.push_str("</details>");
    }
    let mesh = row.mesh.iter().map(|_| "vtu");
    for ending in mesh.chain(row.files.iter().map(|(name, _)| name.as_str())) {
        let file = escape(&format!("{}.{ending}", row.name));
        let _ = write!(text, "<p class=\"foot\"><a href=\"{file}\">{file}</a></p>");
    }
    text.push_str("</article>");
    text
}

/// Meshes and results for the viewer.
#[derive(Default)]
struct Embedded<'a> {
    meshes: Vec<(&'a Solid, Order)>,
    mesh_facts: Vec<Value>,
    job_facts: Vec<Value>,
    scripts: String,
    levels: u8,
}

impl<'a> Embedded<'a> {
    /// Embeds a result and returns its number; nothing where it does not fit.
    fn add(&mut self, row: &Row, solid: &'a Solid, scales: &BTreeMap<String, Scale>) -> Option<usize> {
        if solid.count() > MOST_CELLS || self.scripts.len() > MOST_BYTES {
            return None;
        }
        let number = match self.meshes.iter().position(|(other, _)| mesh::same_mesh(solid, other)) {
            Some(number) => number,
            None => {
                let order = mesh::order(solid);
                let packed = mesh::topology(solid, &order);
                let (points, cells) = order.counts();
                let number = self.meshes.len();
                self.mesh_facts.push(json!({
                    "points": points,
                    "cells": cells,
                    "corners": if solid.is_volume() { 4 } else { 3 },
                    "diagonals": !solid.diagonals.is_empty(),
                    "box": packed.boxes[0],
                }));
                let _ = writeln!(
                    self.scripts,
                    "<script type=\"text/plain\" id=\"mesh-{number}\">{}</script>",
                    packed.base64
                );
                self.meshes.push((solid, order));
                number
            }
        };
        let ranges: Vec<Scale> = solid.fields.iter().map(|field| scales[&field.name]).collect();
        let packed = mesh::image(solid, &self.meshes[number].1, &ranges, self.levels);
        let index = self.job_facts.len();
        let names: Vec<&str> = solid.fields.iter().map(|field| field.name.as_str()).collect();
        self.job_facts.push(json!({
            "name": row.name,
            "mesh": number,
            "box": packed.boxes.first(),
            "fields": names,
        }));
        let _ = writeln!(
            self.scripts,
            "<script type=\"text/plain\" id=\"job-{index}\">{}</script>",
            packed.base64
        );
        Some(index)
    }

    /// The viewer with its data; nothing where no mesh was embedded.
    fn finish(self, scales: &BTreeMap<String, Scale>) -> String {
        if self.job_facts.is_empty() {
            return String::new();
        }
        let scales: BTreeMap<&String, Value> = scales
            .iter()
            .map(|(name, scale)| {
                let value = json!({
                    "label": name.replace('_', " "),
                    "low": scale.low,
                    "high": scale.high,
                    "log": scale.logarithmic,
                });
                (name, value)
            })
            .collect();
        let axis = (0..3)
            .max_by(|&left, &right| EYE[left].abs().total_cmp(&EYE[right].abs()))
            .unwrap_or(0);
        let cut = format!("{}{}", if EYE[axis] < 0.0 { '-' } else { '+' }, ["x", "y", "z"][axis]);
        let data = json!({
            "eye": EYE,
            "cut": cut,
            "map": MAP,
            "levels": self.levels,
            "steps": mesh::STEPS,
            "scales": scales,
            "meshes": self.mesh_facts,
            "jobs": self.job_facts,
        });
        format!(
            "{}<script type=\"application/json\" id=\"meshes\">{}</script>\n{}<script>{}</script>\n",
            include_str!("viewer.html"),
            json(&data),
            self.scripts,
            viewer()
        )
    }
}

/// The viewer without its comments and indentation.
fn viewer() -> String {
    let lines = include_str!("viewer.js").lines().map(str::trim);
    lines
        .filter(|line| !line.is_empty() && !line.starts_with("//"))
        .collect::<Vec<_>>()
        .join("\n")
}
