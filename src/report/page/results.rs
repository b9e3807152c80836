//! The results section: a card a job with its figures and poster, and the meshes for the viewer.

use super::html::{escape, json};
use super::mesh::{self, Order};
use super::{end, plural};
use crate::experiment::file::Experiment;
use crate::report::ReportError;
use crate::report::number::round;
use crate::report::picture::colour::{MAP, Scale};
use crate::report::picture::cut::opened_along;
use crate::report::picture::solid::Solid;
use crate::report::picture::{EYE, poster};
use crate::report::row::{Quantity, Row, label};
use base64::Engine;
use rayon::prelude::*;
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

/// Values of a field that one result adds to those by which its scale is chosen, besides its least and largest one.
const SAMPLES: usize = 20_000;
/// Results are read twice, once for the scales and once to be drawn, but for those within the first so many bytes of
/// files.
const KEPT_BYTES: u64 = 16 << 20;
/// Results in memory at a time.
const SIDE_BY_SIDE: usize = 4;

pub fn results(experiment: &Experiment, rows: &[Row]) -> Result<Results, ReportError> {
    let (survey, mut kept) = survey(rows);
    let scales = survey.scales();
    let mut embedded = Embedded {
        levels: mesh::levels(survey.values),
        ..Embedded::default()
    };
    let mut cards = String::new();
    let mut left_out = Vec::new();
    let mut shown_field: Option<String> = None;
    // A few at a time are in memory and are drawn side by side.
    for start in (0..rows.len()).step_by(SIDE_BY_SIDE) {
        let part = start..rows.len().min(start + SIDE_BY_SIDE);
        let drawn: Vec<(Loaded, Option<Result<Vec<u8>, String>>)> = kept[part.clone()]
            .par_iter_mut()
            .zip(&rows[part.clone()])
            .map(|(kept, row)| {
                let solid = kept.take().unwrap_or_else(|| load(row));
                let png = solid.as_ref().and_then(|solid| solid.as_ref().ok()).map(|solid| {
                    let first = solid.fields.first();
                    let scale = first.map_or(UNIT, |field| scales[&field.name]);
                    poster(solid, first.map(|_| 0), scale)
                });
                (solid, png)
            })
            .collect();
        for (row, (solid, png)) in rows[part].iter().zip(drawn) {
            let picture = match (solid, png) {
                (Some(Ok(solid)), Some(png)) => {
                    let png = png.map_err(|error| ReportError::Picture(row.name.clone(), error))?;
                    let name = solid.fields.first().map(|field| field.name.clone());
                    let index = embedded.add(row, &solid, &scales);
                    if index.is_none() {
                        left_out.push(row.name.as_str());
                    }
                    let html = picture(row, &solid, name.as_deref(), &png, index);
                    shown_field = shown_field.or(name);
                    html
                }
                (Some(Err(error)), _) => format!(
                    "<p class=\"none\">The result mesh cannot be shown: {}</p>",
                    escape(&error)
                ),
                // The table of jobs holds those that ended well and left no mesh.
                _ if row.done() => continue,
                _ => String::new(),
            };
            cards.push_str(&card(experiment, row, &picture));
        }
    }
    let mut text = String::new();
    if let Some(name) = shown_field {
        let scale = scales[&name];
        let _ = write!(
            text,
            "<div class=\"scale\"><span>{}{}</span><span>{}{}</span><span class=\"ramp\" style=\"background:linear-gradient(90deg,{})\"></span><span>{}{}</span>{}</div>",
            escape(&name.replace('_', " ")),
            if scale.logarithmic { ", logarithmic" } else { "" },
            if scale.least < scale.low { "≤ " } else { "" },
            round(scale.low, 3).unicode(),
            MAP.map(|[red, green, blue]| format!("#{red:02x}{green:02x}{blue:02x}"))
                .join(","),
            if scale.most > scale.high { "≥ " } else { "" },
            round(scale.high, 3).unicode(),
            if survey.inverted {
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
    least: 0.0,
    most: 1.0,
    logarithmic: false,
};

fn load(row: &Row) -> Loaded {
    let path = row.mesh.as_ref()?;
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) => return Some(Err(format!("cannot read {}: {error}", path.display()))),
    };
    let content = match crate::mesh::format::read(&format!("{}.vtu", row.name), &bytes) {
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

/// What the page needs to know of all results before it draws one.
#[derive(Default)]
struct Survey {
    /// Values of each field, as many as its scale needs.
    samples: BTreeMap<String, Vec<f64>>,
    /// Number of all values.
    values: usize,
    /// Whether a cell is inverted.
    inverted: bool,
}

impl Survey {
    fn add(&mut self, solid: &Solid) {
        for field in &solid.fields {
            let values = &field.values;
            let samples = self.samples.entry(field.name.clone()).or_default();
            let step = values.len().div_ceil(SAMPLES).max(1);
            samples.extend(values.iter().step_by(step));
            if step > 1 {
                let finite = values.iter().copied().filter(|value| value.is_finite());
                samples.extend(finite.clone().min_by(f64::total_cmp));
                samples.extend(finite.max_by(f64::total_cmp));
            }
        }
        self.values += solid.count() * solid.fields.len();
        self.inverted |= solid.inverted.contains(&true);
    }

    fn join(mut self, other: Survey) -> Survey {
        for (name, samples) in other.samples {
            self.samples.entry(name).or_default().extend(samples);
        }
        self.values += other.values;
        self.inverted |= other.inverted;
        self
    }

    /// One scale for each field over all jobs, so that their colours compare.
    fn scales(&self) -> BTreeMap<String, Scale> {
        let scale = |(name, values): (&String, &Vec<f64>)| (name.clone(), Scale::of(values.iter().copied()));
        self.samples.iter().map(scale).collect()
    }
}

/// Reads every result once; the first ones stay in memory.
fn survey(rows: &[Row]) -> (Survey, Vec<Option<Loaded>>) {
    let mut bytes = 0;
    let keep = rows.iter().map(|row| {
        let length = row.mesh.as_ref().and_then(|path| std::fs::metadata(path).ok());
        bytes += length.map_or(0, |found| found.len());
        bytes <= KEPT_BYTES
    });
    let keep: Vec<bool> = keep.collect();
    let read = rows.par_iter().zip(keep).with_max_len(1).map(|(row, keep)| {
        let solid = load(row);
        let mut survey = Survey::default();
        if let Some(Ok(solid)) = &solid {
            survey.add(solid);
        }
        (survey, keep.then_some(solid))
    });
    let (surveys, kept): (Vec<Survey>, Vec<Option<Loaded>>) = read.unzip();
    (surveys.into_iter().fold(Survey::default(), Survey::join), kept)
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
struct Embedded {
    meshes: Vec<(Solid, Order)>,
    mesh_facts: Vec<Value>,
    job_facts: Vec<Value>,
    scripts: String,
    levels: u8,
}

impl Embedded {
    /// Embeds a result and returns its number; nothing where it does not fit.
    fn add(&mut self, row: &Row, solid: &Solid, scales: &BTreeMap<String, Scale>) -> Option<usize> {
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
                self.meshes.push((solid.clone(), order));
                number
            }
        };
        let ranges: Vec<Scale> = solid.fields.iter().map(|field| scales[&field.name]).collect();
        let packed = mesh::image(solid, &self.meshes[number].1, &ranges, self.levels);
        let index = self.job_facts.len();
        let names: Vec<&str> = solid.fields.iter().map(|field| field.name.as_str()).collect();
        let axis = opened_along(EYE, &solid.points);
        self.job_facts.push(json!({
            "name": row.name,
            "mesh": number,
            "cut": format!("{}{}", if EYE[axis] < 0.0 { '-' } else { '+' }, ["x", "y", "z"][axis]),
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
                    "least": scale.least,
                    "most": scale.most,
                    "log": scale.logarithmic,
                });
                (name, value)
            })
            .collect();
        let data = json!({
            "eye": EYE,
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
