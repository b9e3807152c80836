//! `macros.tex`: every rounded figure by name, so that prose cannot drift from the tables.

use super::number;
use super::row::{Quantity, Row};
use crate::experiment::file::Experiment;
use crate::experiment::record::MEASUREMENTS;
use std::fmt::Write;

/// Defines `\vargeo{JOB}{FIGURE}`; a figure that does not exist is an error of the document, never an empty place.
pub fn write(experiment: &Experiment, rows: &[Row], rates: &[super::rate::Fit]) -> String {
    let mut text = String::from(
        "% \\vargeo{JOB}{FIGURE} is the rounded figure of a job, \\vargeo{RATE}{SERIES} a fitted rate.\n\
         \\providecommand\\vargeo[2]{\\ifcsname vargeo@#1@#2\\endcsname\\csname vargeo@#1@#2\\endcsname\
         \\else\\errmessage{vargeo: no figure #2 of #1}\\fi}\n",
    );
    let mut define = |first: &str, second: &str, value: &str| {
        let _ = writeln!(
            text,
            "\\expandafter\\def\\csname vargeo@{}@{}\\endcsname{{{value}}}",
            name(first),
            name(second)
        );
    };
    for row in rows {
        let result = &row.record.result;
        let names = result.metrics.keys().chain(result.counters.keys()).map(String::as_str);
        for figure in names.chain(MEASUREMENTS.iter().map(|measured| measured.name)) {
            if let Some(value) = row.figure(figure) {
                let digits = Quantity::find(experiment, figure).digits;
                define(&row.name, figure, &number::round(value, digits).latex());
            }
        }
        define(&row.name, "stop", &super::table::latex::escape(super::table::word(row)));
    }
    for fit in rates {
        if let Some(line) = &fit.line {
            let series = if fit.series.is_empty() { "all" } else { &fit.series };
            define(&fit.rate, series, &number::round(line.slope, 3).latex());
        }
    }
    text
}

/// A name that TeX reads as itself within `\csname`.
fn name(text: &str) -> String {
    text.chars()
        .map(|character| {
            if matches!(character, '\\' | '{' | '}' | '%' | '#' | '~' | '^' | '&' | '$') {
                '-'
            } else {
                character
            }
        })
        .collect()
}
