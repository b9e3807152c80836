//! Tables as the experiment file asks for them: rows of axis values, columns of figures, printed figures beside ours.
//!
//! Every job of the table's condition is in it. A job without a figure has the word for its end in the cell and its
//! reason in a note. Several jobs in one cell (axes that are neither in `rows` nor `across`) give their mean and
//! sample standard deviation.

pub mod csv;
pub mod html;
pub mod latex;
mod legend;
pub mod markdown;
pub mod terminal;

use super::row::{Quantity, Row, label, same};
use crate::experiment::file::{Experiment, Table};
use crate::experiment::record::Status;
use crate::metric::Better;
use serde_json::Value;
use std::collections::BTreeMap;

/// Relative tolerance of a printed figure whose row in the file states none.
pub const TOLERANCE: f64 = 0.05;

/// A table before it is typeset.
#[derive(Clone, Debug)]
pub struct Grid {
    pub name: String,
    pub title: String,
    pub head: Vec<Head>,
    pub body: Vec<Vec<Cell>>,
    /// Explanations below the table; a cell's mark 1 points at the first.
    pub notes: Vec<String>,
    /// Rounding, marks and sources in sentences.
    pub legend: Vec<String>,
}

/// A column's heading.
#[derive(Clone, Debug)]
pub struct Head {
    pub text: String,
    pub unit: String,
    pub definition: String,
    pub kind: Column,
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    Axis,
    Figure,
    Printed,
    Difference,
}

/// One cell.
#[derive(Clone, Debug)]
pub struct Cell {
    pub content: Content,
    /// The best of its group.
    pub best: bool,
    /// Number of the note that explains it, from 1.
    pub mark: Option<usize>,
}

/// What a cell says.
#[derive(Clone, Debug)]
pub enum Content {
    Text(String),
    /// A figure with its significant digits and, over several jobs, standard deviation and count.
    Figure {
        value: f64,
        digits: usize,
        spread: Option<(f64, usize)>,
    },
    /// No figure, and the word why: `time-limit`.
    Absent(String),
    /// Ours against the printed one.
    Difference {
        text: String,
        judgement: Judgement,
    },
    Empty,
}

/// What a difference from a printed figure means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// Equal within the tolerance or the printed digits.
    Within,
    Better,
    Worse,
    /// Different where no direction is better.
    Differs,
    /// A measurement on another machine: a ratio without judgement.
    Ratio,
}

impl Judgement {
    pub fn word(self) -> &'static str {
        match self {
            Judgement::Within => "within",
            Judgement::Better => "better",
            Judgement::Worse => "worse",
            Judgement::Differs => "differs",
            Judgement::Ratio => "",
        }
    }
}

impl Cell {
    fn new(content: Content) -> Cell {
        Cell {
            content,
            best: false,
            mark: None,
        }
    }
}

/// Notes, each said once.
#[derive(Default)]
struct Notes(Vec<String>);

impl Notes {
    fn mark(&mut self, text: String) -> usize {
        match self.0.iter().position(|note| *note == text) {
            Some(index) => index + 1,
            None => {
                self.0.push(text);
                self.0.len()
            }
        }
    }
}

/// The jobs behind one line of the table, or behind one cell of it.
struct Line<'a> {
    axes: Vec<Option<&'a Value>>,
    jobs: Vec<&'a Row>,
}

/// The table that the file's `[[table]]` asks for.
pub fn build(experiment: &Experiment, table: &Table, rows: &[Row]) -> Grid {
    let lines = lines(table, rows);
    let across = across(table, rows);
    let mut quantities: Vec<Quantity> = Vec::new();
    for name in &table.columns {
        quantities.extend(across.iter().map(|values| {
            let mut quantity = Quantity::find(experiment, name);
            quantity.name += &values.suffix;
            quantity
        }));
    }
    // The jobs of each cell, and the figure that is asked of them.
    let parts: Vec<Vec<Line>> = lines
        .iter()
        .map(|line| {
            let columns = table.columns.iter().flat_map(|_| &across);
            columns.map(|values| values.part(table, line)).collect()
        })
        .collect();
    let name_of = |column: usize| table.columns[column / across.len()].as_str();
    let printed: Vec<Vec<Option<Printed>>> = parts
        .iter()
        .map(|parts| {
            let printed = |(column, part): (usize, &Line)| printed_figure(table, part, name_of(column));
            parts.iter().enumerate().map(printed).collect()
        })
        .collect();
    let has_printed: Vec<bool> = (0..quantities.len())
        .map(|column| printed.iter().any(|line| line[column].is_some()))
        .collect();

    let mut notes = Notes::default();
    let mut body = Vec::new();
    let mut any_best = false;
    let is_contest = table.rows.last().is_some_and(|axis| axis != "model");
    let best = if is_contest {
        best_figures(experiment, &parts, &quantities, &name_of)
    } else {
        // One model is not better than another.
        vec![vec![false; quantities.len()]; parts.len()]
    };
    for (index, line) in lines.iter().enumerate() {
        let mut cells: Vec<Cell> = line
            .axes
            .iter()
            .map(|value| Cell::new(Content::Text(value.map_or_else(String::new, label))))
            .collect();
        for (column, quantity) in quantities.iter().enumerate() {
            let mut cell = figure(&parts[index][column], name_of(column), quantity, &mut notes);
            cell.best = best[index][column];
            any_best |= cell.best;
            let ours = match cell.content {
                Content::Figure { value, .. } => Some(value),
                _ => None,
            };
            cells.push(cell);
            if has_printed[column] {
                match &printed[index][column] {
                    Some(printed) => {
                        cells.push(Cell::new(Content::Text(printed.text.clone())));
                        cells.push(Cell::new(match ours {
                            Some(ours) => printed.compare(ours, quantity),
                            None => Content::Empty,
                        }));
                    }
                    None => cells.extend([Cell::new(Content::Empty), Cell::new(Content::Empty)]),
                }
            }
        }
        body.push(cells);
    }

    Grid {
        name: table.name.clone(),
        title: table.title.clone().unwrap_or_else(|| table.name.clone()),
        head: head(table, &quantities, &has_printed),
        body,
        notes: notes.0,
        legend: legend::legend(table, &quantities, &parts, any_best),
    }
}

fn lines<'a>(table: &Table, rows: &'a [Row]) -> Vec<Line<'a>> {
    let mut lines: Vec<Line<'a>> = Vec::new();
    for row in rows.iter().filter(|row| row.matches(&table.condition)) {
        let axes: Vec<Option<&Value>> = table.rows.iter().map(|axis| row.axis(axis)).collect();
        let equal = |other: &Vec<Option<&Value>>| {
            other.iter().zip(&axes).all(|(left, right)| match (left, right) {
                (Some(left), Some(right)) => same(left, right),
                (None, None) => true,
                _ => false,
            })
        };
        match lines.iter_mut().find(|line| equal(&line.axes)) {
            Some(line) => line.jobs.push(row),
            None => lines.push(Line { axes, jobs: vec![row] }),
        }
    }
    // Values stand in the order of the file, the first axis changing most slowly.
    let mut values: Vec<Vec<&Value>> = vec![Vec::new(); table.rows.len()];
    for line in &lines {
        for (known, value) in values.iter_mut().zip(&line.axes) {
            known.extend(value.filter(|value| !known.iter().any(|other| same(other, value))));
        }
    }
    let rank = |line: &Line| -> Vec<Option<usize>> {
        let places = line.axes.iter().zip(&values);
        places
            .map(|(value, known)| value.and_then(|value| known.iter().position(|other| same(other, value))))
            .collect()
    };
    lines.sort_by_cached_key(rank);
    lines
}

/// Values of the axes across, and how they are written in a heading.
struct Across<'a> {
    values: Vec<Option<&'a Value>>,
    suffix: String,
}

impl<'a> Across<'a> {
    /// The jobs of a line that have these values.
    fn part(&self, table: &Table, line: &Line<'a>) -> Line<'a> {
        let has = |job: &&&Row| {
            let own = table.across.iter().map(|axis| job.axis(axis));
            own.zip(&self.values).all(|(own, value)| own == *value)
        };
        Line {
            axes: line.axes.clone(),
            jobs: line.jobs.iter().filter(has).copied().collect(),
        }
    }
}

/// Every combination of values across that occurs, in the order of the jobs; one of none where the table has no such
/// axes.
fn across<'a>(table: &Table, rows: &'a [Row]) -> Vec<Across<'a>> {
    let mut found: Vec<Across> = Vec::new();
    for row in rows.iter().filter(|row| row.matches(&table.condition)) {
        let values: Vec<Option<&Value>> = table.across.iter().map(|axis| row.axis(axis)).collect();
        if found.iter().any(|other| other.values == values) {
            continue;
        }
        let short = |axis: &str| axis.rsplit('.').next().unwrap_or(axis).to_string();
        let parts = table.across.iter().zip(&values);
        let suffix = parts.map(|(axis, value)| format!(", {} {}", short(axis), value.map_or_else(String::new, label)));
        let suffix = suffix.collect();
        found.push(Across { values, suffix });
    }
    if found.is_empty() {
        found.push(Across {
            values: vec![None; table.across.len()],
            suffix: String::new(),
        });
    }
    found
}

fn head(table: &Table, quantities: &[Quantity], has_printed: &[bool]) -> Vec<Head> {
    let mut head: Vec<Head> = table
        .rows
        .iter()
        .map(|axis| Head {
            text: axis.clone(),
            unit: String::new(),
            definition: String::new(),
            kind: Column::Axis,
        })
        .collect();
    for (quantity, printed) in quantities.iter().zip(has_printed) {
        let column = |text: &str, kind| Head {
            text: text.into(),
            unit: if kind == Column::Difference {
                String::new()
            } else {
                quantity.unit.clone()
            },
            definition: if kind == Column::Figure {
                quantity.definition.clone()
            } else {
                String::new()
            },
            kind,
        };
        head.push(column(&quantity.name, Column::Figure));
        if *printed {
            head.push(column("printed", Column::Printed));
            head.push(column("difference", Column::Difference));
        }
    }
    head
}

fn figures(line: &Line, name: &str) -> Vec<f64> {
    line.jobs
        .iter()
        .filter_map(|job| job.figure(name))
        .filter(|value| !value.is_nan())
        .collect()
}

fn figure(line: &Line, name: &str, quantity: &Quantity, notes: &mut Notes) -> Cell {
    if line.jobs.is_empty() {
        return Cell::new(Content::Empty);
    }
    let values = figures(line, name);
    let troubled = line.jobs.iter().find(|job| job.remarkable());
    let mark = troubled.map(|job| notes.mark(note(job, line.jobs.len())));
    let content = if values.is_empty() {
        match troubled {
            Some(job) => Content::Absent(word(job).into()),
            None => Content::Absent(
                if line.jobs.iter().any(|job| job.record.result.metrics.contains_key(name)) {
                    "undefined"
                } else {
                    "absent"
                }
                .into(),
            ),
        }
    } else {
        let (mean, deviation) = mean_and_deviation(&values);
        Content::Figure {
            value: mean,
            digits: quantity.digits,
            spread: (line.jobs.len() > 1).then_some((deviation, values.len())),
        }
    };
    Cell {
        content,
        best: false,
        mark,
    }
}

/// The word that stands for a job without a figure.
pub fn word(row: &Row) -> &str {
    let result = &row.record.result;
    match (result.stop.is_empty(), result.status) {
        (false, _) => &result.stop,
        (true, Status::Skipped) => "skipped",
        (true, Status::Failed) => "failed",
        (true, Status::Refused) => "refused",
        (true, Status::Done) => "absent",
    }
}

fn note(job: &Row, jobs: usize) -> String {
    let result = &job.record.result;
    let who = if jobs > 1 {
        format!("{}: ", job.name)
    } else {
        String::new()
    };
    if result.reason.is_empty() {
        format!("{who}{}", word(job))
    } else {
        format!("{who}{}: {}", word(job), result.reason)
    }
}

/// Mean and sample standard deviation; the latter is 0 for a single value.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    if values.len() < 2 {
        return (mean, 0.0);
    }
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0)).sqrt())
}

/// Marks the best figure of each group, the lines that differ in the last row axis only. Figures that print alike are
/// equally good.
fn best_figures<'a>(
    experiment: &Experiment,
    parts: &[Vec<Line>],
    quantities: &[Quantity],
    name_of: &dyn Fn(usize) -> &'a str,
) -> Vec<Vec<bool>> {
    let mut best = vec![vec![false; quantities.len()]; parts.len()];
    // Along numbers a table is a study, not a contest.
    if parts
        .iter()
        .flatten()
        .all(|line| line.axes.last().is_none_or(|value| value.is_some_and(Value::is_number)))
    {
        return best;
    }
    for (column, quantity) in quantities.iter().enumerate() {
        let sign = match quantity.better {
            Better::Lower => 1.0,
            Better::Higher => -1.0,
            Better::Neither => continue,
        };
        let mut groups: BTreeMap<String, Vec<(usize, f64)>> = BTreeMap::new();
        for (index, line) in parts.iter().map(|parts| &parts[column]).enumerate() {
            let values = figures(line, name_of(column));
            // Who stops early does not win.
            if values.is_empty() || line.jobs.iter().any(|job| job.remarkable()) {
                continue;
            }
            let fixed = line.axes.len().saturating_sub(1);
            let group = line.axes[..fixed]
                .iter()
                .map(|value| value.map_or_else(String::new, |value| value.to_string()));
            groups
                .entry(group.collect::<Vec<_>>().join("\n"))
                .or_default()
                .push((index, sign * mean_and_deviation(&values).0));
        }
        for group in groups.values() {
            let apart = experiment.method.incomparable(name_of(column));
            let kinds = group.iter().flat_map(|&(index, _)| &parts[index][column].jobs);
            let kinds: Vec<Vec<Option<&Value>>> = kinds
                .map(|job| apart.iter().map(|axis| job.axis(axis)).collect())
                .collect();
            if kinds.windows(2).any(|pair| pair[0] != pair[1]) {
                continue;
            }
            let lowest = group.iter().map(|entry| entry.1).fold(f64::INFINITY, f64::min);
            let printed = |value: f64| super::number::round(value, quantity.digits);
            let is_best = |value: f64| value == lowest || printed(value) == printed(lowest);
            // A column in which all are equal has no best.
            if !group.iter().all(|entry| is_best(entry.1)) {
                for &(index, value) in group {
                    best[index][column] = is_best(value);
                }
            }
        }
    }
    best
}

/// A printed figure.
struct Printed {
    value: f64,
    text: String,
    tolerance: f64,
}

impl Printed {
    /// Half a unit of the last printed digit: a difference below it is no difference.
    fn half_unit(&self) -> f64 {
        let mantissa = self.text.split(['e', 'E']).next().unwrap_or("");
        let decimals = mantissa.split_once('.').map_or(0, |(_, digits)| digits.len());
        let exponent: i32 = self
            .text
            .split(['e', 'E'])
            .nth(1)
            .and_then(|text| text.parse().ok())
            .unwrap_or(0);
        0.5 * 10f64.powi(exponent - decimals as i32)
    }

    fn compare(&self, ours: f64, quantity: &Quantity) -> Content {
        let difference = ours - self.value;
        if quantity.measured {
            let ratio = ours / self.value;
            let text = if ratio.is_finite() {
                format!("\u{d7}{}", super::number::round(ratio, 2).unicode())
            } else {
                String::new()
            };
            return Content::Difference {
                text,
                judgement: Judgement::Ratio,
            };
        }
        let within = difference.abs() <= (self.tolerance * self.value.abs()).max(self.half_unit());
        let judgement = match quantity.better {
            _ if within => Judgement::Within,
            Better::Neither => Judgement::Differs,
            Better::Lower if difference < 0.0 => Judgement::Better,
            Better::Higher if difference > 0.0 => Judgement::Better,
            _ => Judgement::Worse,
        };
        let relative = difference / self.value.abs();
        let text = if !difference.is_finite() || self.value == 0.0 {
            let rounded = super::number::round(difference, 3).unicode();
            if difference > 0.0 {
                format!("+{rounded}")
            } else {
                rounded
            }
        } else if relative > 1.0 {
            format!("\u{d7}{}", super::number::round(ours / self.value, 3).unicode())
        } else {
            let rounded = format!("{:+.1} %", 100.0 * relative).replace('-', "\u{2212}");
            if matches!(rounded.as_str(), "+0.0 %" | "\u{2212}0.0 %") {
                "0.0 %".into()
            } else {
                rounded
            }
        };
        Content::Difference { text, judgement }
    }
}

fn printed_figure(table: &Table, line: &Line, column: &str) -> Option<Printed> {
    let (Some(published), Some(job)) = (&table.published, line.jobs.first()) else {
        return None;
    };
    let is_column = |name: &str| table.columns.iter().any(|column| column == name);
    let row = published.rows.iter().find(|row| {
        row.iter()
            .filter(|(name, _)| !is_column(name) && name.as_str() != "tolerance")
            .all(|(name, value)| job.axis(name).is_some_and(|own| same(own, value)))
    });
    let row = row?;
    let value = row.get(column)?;
    Some(Printed {
        value: value.as_f64()?,
        text: value.to_string(),
        tolerance: row.get("tolerance").and_then(Value::as_f64).unwrap_or(TOLERANCE),
    })
}
