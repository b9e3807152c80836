//! Two result sets side by side: each figure of each job that both have, with its difference.

use super::number::round;
use crate::experiment::record::MEASUREMENTS;
use std::fmt::Write;

/// A `jobs.csv` as read back.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    pub head: Vec<String>,
    pub jobs: Vec<Vec<String>>,
}

/// Columns that name or describe a job rather than measure its result.
const WORDS: &[&str] = &[
    "reason",
    "repetitions",
    "exclusive",
    "timed",
    "version",
    "commit",
    "target",
    "host",
    "notices",
    "key",
    "threads",
];

impl Sheet {
    /// Reads a `jobs.csv`.
    pub fn read(bytes: &[u8]) -> Result<Sheet, String> {
        let mut reader = csv::Reader::from_reader(bytes);
        let head: Vec<String> = reader
            .headers()
            .map_err(|error| error.to_string())?
            .iter()
            .map(String::from)
            .collect();
        if head.first().map(String::as_str) != Some("job") {
            return Err("the first column is not `job`: this is no jobs.csv of vargeo".into());
        }
        let mut jobs: Vec<Vec<String>> = Vec::new();
        for record in reader.records() {
            let job: Vec<String> = record
                .map_err(|error| error.to_string())?
                .iter()
                .map(String::from)
                .collect();
            if jobs.iter().any(|other| other[0] == job[0]) {
                return Err(format!("job {} is there twice", job[0]));
            }
            jobs.push(job);
        }
        Ok(Sheet { head, jobs })
    }
}

/// One figure that both sets have.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    pub job: String,
    pub column: String,
    pub left: String,
    pub right: String,
    /// (right - left) / |left| where both are numbers.
    pub relative: Option<f64>,
    pub measured: bool,
}

/// What differs between two sets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    pub differences: Vec<Difference>,
    pub only_left: Vec<String>,
    pub only_right: Vec<String>,
    /// Columns that only one of the sets has.
    pub columns_left: Vec<String>,
    pub columns_right: Vec<String>,
    pub jobs: usize,
    /// Results (not measurements) that are equal to the last bit.
    pub equal: usize,
}

impl Comparison {
    /// Differences of results; those of measurements do not count.
    pub fn results(&self) -> impl Iterator<Item = &Difference> {
        self.differences.iter().filter(|difference| !difference.measured)
    }

    pub fn same(&self) -> bool {
        self.results().next().is_none() && self.only_left.is_empty() && self.only_right.is_empty()
    }
}

/// Compares by job name and column name. Numbers whose relative difference is at most `tolerance` count as equal; with
/// `columns`, only those are looked at.
pub fn compare(left: &Sheet, right: &Sheet, tolerance: f64, columns: &[String]) -> Comparison {
    let missing = |from: &[String], other: &[String]| -> Vec<String> {
        from.iter().filter(|name| !other.contains(name)).cloned().collect()
    };
    let names = |sheet: &Sheet| -> Vec<String> { sheet.jobs.iter().map(|job| job[0].clone()).collect() };
    let mut comparison = Comparison {
        only_left: missing(&names(left), &names(right)),
        only_right: missing(&names(right), &names(left)),
        columns_left: missing(&left.head, &right.head),
        columns_right: missing(&right.head, &left.head),
        ..Comparison::default()
    };
    for job in &left.jobs {
        let Some(other) = right.jobs.iter().find(|other| other[0] == job[0]) else {
            continue;
        };
        comparison.jobs += 1;
        for (column, value) in left.head.iter().zip(job).skip(1) {
            let bare = column.split(" [").next().unwrap_or(column);
            let Some(index) = right.head.iter().position(|name| name == column) else {
                continue;
            };
            let wanted = columns.is_empty() || columns.iter().any(|column| column == bare);
            if WORDS.contains(&bare) || !wanted {
                continue;
            }
            // Differences of machines and moments are shown, never counted.
            let measured = MEASUREMENTS.iter().any(|measured| measured.name == bare);
            let relative = match (value.parse::<f64>(), other[index].parse::<f64>()) {
                (Ok(left), Ok(right)) if left != 0.0 => Some((right - left) / left.abs()),
                _ => None,
            };
            let near = !measured && relative.is_some_and(|relative| relative.abs() <= tolerance);
            if *value == other[index] || near {
                comparison.equal += usize::from(!measured);
                continue;
            }
            comparison.differences.push(Difference {
                job: job[0].clone(),
                column: column.clone(),
                left: value.clone(),
                right: other[index].clone(),
                relative,
                measured,
            });
        }
    }
    comparison
}

/// The comparison as text: results first, then measurements, then what only one set has.
pub fn describe(comparison: &Comparison, left: &str, right: &str) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{} jobs in both; {} results equal, {} different; {} jobs in one only",
        comparison.jobs,
        comparison.equal,
        comparison.results().count(),
        comparison.only_left.len() + comparison.only_right.len()
    );
    for (title, measured) in [("results", false), ("measurements", true)] {
        let chosen: Vec<&Difference> = comparison
            .differences
            .iter()
            .filter(|difference| difference.measured == measured)
            .collect();
        if chosen.is_empty() {
            continue;
        }
        let mut table = comfy_table::Table::new();
        table.load_style(comfy_table::presets::NOTHING);
        table.set_header([title, "job", left, right, "difference"]);
        for difference in chosen {
            table.add_row([
                super::table::terminal::plain(&difference.column),
                super::table::terminal::plain(&difference.job),
                shown(&difference.left),
                shown(&difference.right),
                difference.relative.map_or_else(String::new, percent),
            ]);
        }
        for column in table.column_iter_mut().skip(2) {
            column.set_cell_alignment(comfy_table::CellAlignment::Right);
        }
        let _ = writeln!(text);
        for line in table.to_string().lines() {
            let _ = writeln!(text, "{}", line.trim_end());
        }
    }
    for (what, side, names) in [
        ("jobs", left, &comparison.only_left),
        ("jobs", right, &comparison.only_right),
        ("columns", left, &comparison.columns_left),
        ("columns", right, &comparison.columns_right),
    ] {
        if !names.is_empty() {
            let _ = writeln!(text, "\nonly {side} has {} {what}:", names.len());
            for name in names {
                let _ = writeln!(text, "  {}", super::table::terminal::plain(name));
            }
        }
    }
    text
}

fn shown(text: &str) -> String {
    match text.parse::<f64>() {
        Ok(value) => round(value, 6).plain(),
        Err(_) if text.is_empty() => "-".into(),
        Err(_) => super::table::terminal::plain(text),
    }
}

fn percent(relative: f64) -> String {
    if relative.abs() < 1e-4 || relative.abs() >= 10.0 {
        format!("{relative:+.1e}")
    } else {
        format!("{:+.2} %", 100.0 * relative)
    }
}
