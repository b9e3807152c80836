//! Plots: traces over iterations, figures over numeric axes, figures over named values.
//!
//! A chart is data first ([`chart`]), then drawn through plotters onto whole-numbered coordinates fine enough for print
//! ([`draw`]), as SVG whose colours follow the reader's light or dark setting ([`svg`]) and as PNG ([`bitmap`]).
//! Series are told apart by dashes, markers and their names at the line's end; colour comes on top.

pub mod axis;
pub mod bitmap;
pub mod draw;
pub mod svg;

use super::row::{Quantity, Row, label};
use crate::experiment::file::{Experiment, Plot};
use axis::{Axis, Kind};

/// A plot's data.
#[derive(Clone, Debug)]
pub struct Chart {
    pub name: String,
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
    /// What is not to be seen, in sentences.
    pub notes: Vec<String>,
}

/// One line or set of dots.
#[derive(Clone, Debug)]
pub struct Series {
    pub name: String,
    /// By x; positions 0, 1, ... where x is a category.
    pub points: Vec<Point>,
    /// Joined by a line.
    pub joined: bool,
    /// x at which a new phase of the computation begins.
    pub phases: Vec<f64>,
    pub look: Look,
}

/// How a series is told from others: a colour, and a shape of dashes and markers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Look {
    pub colour: usize,
    pub shape: usize,
}

/// A value with the lowest and highest of the jobs that it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    pub low: f64,
    pub high: f64,
}

/// Traces that number the phases or stages of a computation.
const PHASES: &[&str] = &["phase", "stage"];

/// The data that the file's `[[plot]]` asks for.
pub fn chart(experiment: &Experiment, plot: &Plot, rows: &[Row]) -> Chart {
    let chosen: Vec<&Row> = rows.iter().filter(|row| row.matches(&plot.condition)).collect();
    // An axis may have a trace's name, such as `energy`.
    let is_axis = chosen
        .iter()
        .any(|row| row.axes.iter().any(|(axis, _)| *axis == plot.x));
    // A figure may have one too: against another figure it is meant itself.
    let has_traces = |row: &&Row| {
        [&plot.x, &plot.y]
            .iter()
            .all(|name| row.record.result.traces.contains_key(*name))
    };
    let is_trace = !is_axis && chosen.iter().any(has_traces);
    let mut notes = Vec::new();
    let mut categories: Vec<String> = Vec::new();
    let mut series = if is_trace {
        traces(plot, &chosen, &mut notes)
    } else {
        figures(plot, &chosen, &mut categories, &mut notes)
    };

    let mut hidden = 0;
    for one in &mut series {
        let before = one.points.len();
        one.points.retain(|point| {
            point.x.is_finite()
                && point.y.is_finite()
                && (!plot.log_x || !categories.is_empty() || point.x > 0.0)
                && (!plot.log_y || point.y > 0.0)
        });
        hidden += before - one.points.len();
        if plot.log_y {
            for point in &mut one.points {
                if point.low <= 0.0 {
                    point.low = point.y;
                }
            }
        }
        thin(&mut one.points);
    }
    if hidden > 0 {
        notes.push(format!(
            "{hidden} points are not shown: not finite, or not positive on a logarithmic axis."
        ));
    }
    series.retain(|one| !one.points.is_empty());
    look(&mut series, plot.series.len());
    if series.is_empty() {
        notes.push("There is nothing to show.".into());
    }

    let quantity_x = Quantity::find(experiment, &plot.x);
    let quantity_y = Quantity::find(experiment, &plot.y);
    let all = || series.iter().flat_map(|one| &one.points);
    let x_kind = if !categories.is_empty() {
        Kind::Category(categories)
    } else if plot.log_x {
        Kind::Logarithmic
    } else {
        Kind::Linear
    };
    let y_kind = if plot.log_y { Kind::Logarithmic } else { Kind::Linear };
    let x = Axis::new(quantity_x.heading(), x_kind, all().map(|point| point.x), is_trace);
    let y = Axis::new(
        quantity_y.heading(),
        y_kind,
        all().flat_map(|point| [point.low, point.high]),
        false,
    );
    Chart {
        name: plot.name.clone(),
        title: plot
            .title
            .clone()
            .unwrap_or_else(|| format!("{} against {}", plot.y.replace('_', " "), plot.x.replace('_', " "))),
        x,
        y,
        series,
        notes,
    }
}

impl Chart {
    /// The chart in words, for those who do not see it.
    pub fn alternative(&self) -> String {
        let mut text = format!("{}. {} against {}.", self.title, self.y.label, self.x.label);
        for one in &self.series {
            let (Some(first), Some(last)) = (one.points.first(), one.points.last()) else {
                continue;
            };
            let name = if one.name.is_empty() { "all jobs" } else { &one.name };
            let plain = |value: f64| super::number::round(value, 3).unicode();
            if one.points.len() == 1 {
                text.push_str(&format!(" {name}: {}.", plain(first.y)));
            } else {
                text.push_str(&format!(
                    " {name}: from {} to {} over {} points.",
                    plain(first.y),
                    plain(last.y),
                    one.points.len()
                ));
            }
        }
        text
    }
}

/// Gives each series its look. Few have a colour and a shape of their own; of more than there are colours, those of
/// one value of the first axis share the colour and those of equal values of the others the shape, where there are
/// enough of both.
fn look(series: &mut [Series], axes: usize) {
    for (index, one) in series.iter_mut().enumerate() {
        one.look = Look {
            colour: index,
            shape: index,
        };
    }
    let most = draw::SERIES.len();
    if series.len() <= most || axes < 2 {
        return;
    }
    let mut looks = Vec::new();
    let mut colours: Vec<&str> = Vec::new();
    let mut shapes: Vec<&str> = Vec::new();
    let place = |known: &[&str], part: &str| known.iter().position(|other| *other == part).unwrap_or(known.len());
    for one in series.iter() {
        let Some((first, rest)) = one.name.split_once(", ") else {
            return;
        };
        let colour = place(&colours, first);
        if colour == colours.len() {
            colours.push(first);
        }
        let shape = place(&shapes, rest);
        if shape == shapes.len() {
            shapes.push(rest);
        }
        looks.push(Look { colour, shape });
    }
    if colours.len() <= most && shapes.len() <= most {
        for (one, look) in series.iter_mut().zip(looks) {
            one.look = look;
        }
    }
}

fn traces(plot: &Plot, chosen: &[&Row], notes: &mut Vec<String>) -> Vec<Series> {
    let mut series = Vec::new();
    let mut without = Vec::new();
    let labels: Vec<String> = chosen.iter().map(|row| row.labels(&plot.series)).collect();
    for (index, row) in chosen.iter().enumerate() {
        let traces = &row.record.result.traces;
        let (Some(x), Some(y)) = (traces.get(&plot.x), traces.get(&plot.y)) else {
            without.push(row.name.as_str());
            continue;
        };
        // One line a job: where the series' axes do not tell jobs apart, their names do.
        let shared = labels.iter().filter(|other| **other == labels[index]).count() > 1;
        let name = if shared || labels[index].is_empty() {
            row.name.clone()
        } else {
            labels[index].clone()
        };
        let phase = PHASES.iter().find_map(|name| traces.get(*name));
        let phases = phase.map_or_else(Vec::new, |phase| {
            let changes = phase
                .windows(2)
                .zip(x.iter().skip(1))
                .filter(|(pair, _)| pair[0] != pair[1]);
            changes.map(|(_, &x)| x).filter(|x| x.is_finite()).collect()
        });
        series.push(Series {
            name,
            points: x
                .iter()
                .zip(y)
                .map(|(&x, &y)| Point { x, y, low: y, high: y })
                .collect(),
            joined: true,
            phases,
            look: Look::default(),
        });
    }
    if !without.is_empty() {
        notes.push(format!("Without a trace: {}.", some(&without)));
    }
    if series.iter().any(|one| !one.phases.is_empty()) {
        notes.push("Short upright strokes on a line mark the beginning of a new phase.".into());
    }
    series
}

fn figures(plot: &Plot, chosen: &[&Row], categories: &mut Vec<String>, notes: &mut Vec<String>) -> Vec<Series> {
    let numeric = chosen
        .iter()
        .filter(|row| row.done())
        .all(|row| row.coordinate(&plot.x).is_some());
    let mut series: Vec<(Series, Vec<Vec<f64>>)> = Vec::new();
    let mut without = Vec::new();
    for row in chosen {
        let x = if numeric {
            row.coordinate(&plot.x)
        } else {
            row.axis(&plot.x).map(|value| {
                let name = label(value);
                let index = categories.iter().position(|other| *other == name).unwrap_or_else(|| {
                    categories.push(name);
                    categories.len() - 1
                });
                index as f64
            })
        };
        let (Some(x), Some(y)) = (x, row.figure(&plot.y)) else {
            without.push(row.name.as_str());
            continue;
        };
        let name = row.labels(&plot.series);
        let index = series.iter().position(|(one, _)| one.name == name).unwrap_or_else(|| {
            series.push((
                Series {
                    name,
                    points: Vec::new(),
                    joined: numeric,
                    phases: Vec::new(),
                    look: Look::default(),
                },
                Vec::new(),
            ));
            series.len() - 1
        });
        let (one, values) = &mut series[index];
        match one.points.iter().position(|point| point.x == x) {
            Some(point) => values[point].push(y),
            None => {
                one.points.push(Point { x, y, low: y, high: y });
                values.push(vec![y]);
            }
        }
    }
    let mut several = false;
    for (one, values) in &mut series {
        for (point, values) in one.points.iter_mut().zip(values.iter()) {
            several |= values.len() > 1;
            point.y = super::table::mean_and_deviation(values).0;
            point.low = values.iter().copied().fold(f64::INFINITY, f64::min);
            point.high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        }
        one.points.sort_by(|left, right| left.x.total_cmp(&right.x));
    }
    if several {
        notes.push(
            "A point that stands for several jobs is their mean; its bar goes from the lowest to the highest.".into(),
        );
    }
    if !without.is_empty() {
        notes.push(format!("Without a figure: {}.", some(&without)));
    }
    series.into_iter().map(|(one, _)| one).collect()
}

/// The first few names, and how many more there are.
fn some(names: &[&str]) -> String {
    const MOST: usize = 6;
    match names.len().checked_sub(MOST) {
        Some(more) if more > 1 => format!("{} and {more} more", names[..MOST].join(", ")),
        _ => names.join(", "),
    }
}

/// Long traces keep at most some 800 points: first, last, and the lowest and highest of each stretch between.
fn thin(points: &mut Vec<Point>) {
    const MOST: usize = 800;
    if points.len() <= MOST {
        return;
    }
    let stretch = points.len().div_ceil(MOST / 2);
    let mut kept = Vec::with_capacity(MOST + 2);
    for chunk in points.chunks(stretch) {
        let by_y = |left: &&Point, right: &&Point| left.y.total_cmp(&right.y);
        let (Some(low), Some(high)) = (chunk.iter().min_by(by_y), chunk.iter().max_by(by_y)) else {
            continue;
        };
        let (first, second) = if low.x <= high.x { (low, high) } else { (high, low) };
        kept.push(*first);
        if first != second {
            kept.push(*second);
        }
    }
    if let (Some(first), Some(last)) = (points.first(), points.last()) {
        if kept.first() != Some(first) {
            kept.insert(0, *first);
        }
        if kept.last() != Some(last) {
            kept.push(*last);
        }
    }
    *points = kept;
}
