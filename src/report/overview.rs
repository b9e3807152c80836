//! The overview of several experiments: a line each on the terminal, and a page that links their pages.

use super::gate::{Outcome, Verdict};
use super::page::html::escape;
use super::publish::publish;
use super::row::Row;
use super::{ReportError, table};
use crate::experiment::file::Experiment;
use crate::experiment::record::Status;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// How an experiment went.
#[derive(Clone, Debug)]
pub struct Entry {
    name: String,
    title: String,
    method: &'static str,
    claims: Vec<String>,
    jobs: usize,
    done: usize,
    expectations: usize,
    met: usize,
    /// Whether an expectation failed, or a job that no expectation allows to fail.
    ill: bool,
}

impl Entry {
    /// Sums an experiment up. `planned` is the number of its jobs.
    pub fn new(experiment: &Experiment, rows: &[Row], planned: usize, verdicts: &[Verdict]) -> Self {
        let judged = |outcome| verdicts.iter().filter(|verdict| verdict.outcome == outcome).count();
        let count = |status| rows.iter().filter(|row| row.record.result.status == status).count();
        Self {
            name: experiment.name.clone(),
            title: experiment.title.clone(),
            method: experiment.method.name(),
            claims: experiment.claims.clone(),
            jobs: planned,
            done: count(Status::Done) + count(Status::Refused),
            expectations: judged(Outcome::Met) + judged(Outcome::Failed),
            met: judged(Outcome::Met),
            ill: judged(Outcome::Failed) + count(Status::Failed) > 0,
        }
    }

    fn mark(&self) -> char {
        if self.ill { '\u{2717}' } else { '\u{2713}' }
    }
}

/// A line for each experiment.
pub fn terminal(entries: &[Entry]) -> String {
    let width = entries
        .iter()
        .map(|entry| entry.name.chars().count())
        .max()
        .unwrap_or(0);
    let line = |entry: &Entry| {
        format!(
            "{} {:<width$}  {} of {} jobs, {} of {} expectations met\n",
            entry.mark(),
            table::terminal::plain(&entry.name),
            entry.done,
            entry.jobs,
            entry.met,
            entry.expectations
        )
    };
    entries.iter().map(line).collect()
}

/// Writes `index.html` beside the folders of the experiments.
///
/// # Errors
/// When the file cannot be written.
pub fn write(entries: &[Entry], results: &Path) -> Result<PathBuf, ReportError> {
    std::fs::create_dir_all(results).map_err(|error| ReportError::Write(results.into(), error))?;
    publish(results, "index.html", page(entries).as_bytes())
}

fn page(entries: &[Entry]) -> String {
    let ill = entries.iter().filter(|entry| entry.ill).count();
    let met: usize = entries.iter().map(|entry| entry.met).sum();
    let expectations: usize = entries.iter().map(|entry| entry.expectations).sum();
    let (class, mark) = if ill > 0 {
        ("ill", '\u{2717}')
    } else {
        ("well", '\u{2713}')
    };
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><meta name=\"color-scheme\" content=\"light dark\">\
         <title>Experiments</title><style>{}</style></head>\n<body><header><h1>Experiments</h1><ul class=\"verdicts\">\
         <li class=\"{class}\"><b>{mark} {met} of {expectations}</b><span>expectations met</span></li>\
         <li class=\"{class}\"><b>{mark} {} of {}</b><span>experiments without a failure</span></li></ul></header>\n<main>\
         <section aria-labelledby=\"experiments\"><h2 id=\"experiments\">Experiments</h2><div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Experiments\"><table class=\"words\"><thead><tr>\
         <th scope=\"col\">experiment</th><th scope=\"col\">question</th><th scope=\"col\">method</th><th scope=\"col\">claims</th>\
         <th scope=\"col\">jobs done</th><th scope=\"col\">expectations met</th></tr></thead><tbody>\n",
        include_str!("page/style.css"),
        entries.len() - ill,
        entries.len(),
    );
    for entry in entries {
        let name = escape(&entry.name);
        let _ = writeln!(
            page,
            "<tr><th scope=\"row\"><span class=\"{}\">{}</span> <a href=\"{name}/index.html\">{name}</a></th><td class=\"wide\">{}</td><td>{}</td><td class=\"wide\">{}</td>\
             <td>{} of {}</td><td>{} of {}</td></tr>",
            if entry.ill { "ill" } else { "well" },
            entry.mark(),
            escape(&entry.title),
            escape(entry.method),
            escape(&entry.claims.join(", ")),
            entry.done,
            entry.jobs,
            entry.met,
            entry.expectations
        );
    }
    page.push_str("</tbody></table></div></section></main></body></html>\n");
    page
}
