//! `index.html`: one page that holds everything and loads nothing.
//!
//! It reads without scripts: tables are tables, plots are SVG, every mesh has a rendered poster. With scripts a poster
//! opens into a viewer. All text from files and records is escaped. It has no clock and no random part.

pub mod html;
pub mod mesh;
mod results;

use super::gate::{Outcome, Verdict};
use super::jobs::status;
use super::number::{self, round};
use super::plot::{Chart, svg};
use super::rate::Fit;
use super::row::{Row, label};
use super::{ReportError, table};
use crate::experiment::claims::CLAIMS;
use crate::experiment::file::Experiment;
use crate::experiment::job::JobPart;
use crate::experiment::record::Status;
use html::escape;
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// The whole page.
pub fn write(
    experiment: &Experiment,
    rows: &[Row],
    planned: usize,
    fits: &[Fit],
    verdicts: &[Verdict],
    charts: &[Chart],
) -> Result<String, ReportError> {
    let results = results::results(experiment, rows)?;
    let mut sections: Vec<(&str, &str, String)> = Vec::new();
    if !verdicts.is_empty() {
        sections.push(("expectations", "Expectations", expectations(verdicts)));
    }
    if !experiment.tables.is_empty() {
        let tables = experiment
            .tables
            .iter()
            .map(|one| table::html::write(&table::build(experiment, one, rows)));
        sections.push(("tables", "Tables", tables.collect()));
    }
    if !fits.is_empty() {
        sections.push(("rates", "Rates", rates(fits)));
    }
    if !charts.is_empty() {
        sections.push(("plots", "Plots", plots(charts)?));
    }
    if !results.cards.is_empty() {
        sections.push(("results", "Results", results.cards));
    }
    sections.push(("jobs", "Jobs", jobs(rows)));
    sections.push(("provenance", "Provenance", provenance(experiment, rows)));

    let title = escape(&experiment.title);
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><meta name=\"color-scheme\" content=\"light dark\">\
         <title>{title}</title><style>{}{}</style></head>\n<body><header><h1>{title}</h1>",
        include_str!("style.css"),
        svg::style()
    );
    if !experiment.description.is_empty() {
        let _ = write!(page, "<p class=\"lead\">{}</p>", escape(&experiment.description));
    }
    page.push_str(&claims(experiment));
    page.push_str(&summary(rows, planned, verdicts));
    page.push_str("</header>\n<nav aria-label=\"Sections\"><ul>");
    for (id, name, _) in &sections {
        let _ = write!(page, "<li><a href=\"#{id}\">{name}</a></li>");
    }
    page.push_str("</ul></nav>\n<main>");
    for (id, name, content) in &sections {
        let _ = writeln!(
            page,
            "<section aria-labelledby=\"{id}\"><h2 id=\"{id}\">{name}</h2>{content}</section>"
        );
    }
    page.push_str("</main><footer><p>Written by vargeo from stored records; unrounded figures in <a href=\"jobs.csv\">jobs.csv</a>, figures for prose in <a href=\"macros.tex\">macros.tex</a>.</p></footer>\n");
    page.push_str(&results.data);
    page.push_str("</body></html>\n");
    Ok(page)
}

fn plural(count: usize, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

/// The papers' claims that the experiment tests; whether they hold is for the expectations to say.
fn claims(experiment: &Experiment) -> String {
    if experiment.claims.is_empty() {
        return String::new();
    }
    let mut text = String::from("<ul class=\"claims\">");
    for id in &experiment.claims {
        let claim = CLAIMS.iter().find(|claim| claim.id == id);
        let meaning = claim.map_or("", |claim| claim.text);
        let _ = write!(text, "<li><b>{}</b> {}</li>", escape(id), escape(meaning));
    }
    text + "</ul>"
}

fn summary(rows: &[Row], planned: usize, verdicts: &[Verdict]) -> String {
    let count = |status| rows.iter().filter(|row| row.record.result.status == status).count();
    let met = verdicts
        .iter()
        .filter(|verdict| verdict.outcome == Outcome::Met)
        .count();
    let failed = verdicts
        .iter()
        .filter(|verdict| verdict.outcome == Outcome::Failed)
        .count();
    let skipped = verdicts.len() - met - failed;
    let mut text = String::from("<ul class=\"verdicts\">");
    if !verdicts.is_empty() {
        let (class, mark) = if failed > 0 {
            ("ill", "\u{2717}")
        } else {
            ("well", "\u{2713}")
        };
        let mut left = String::new();
        for (count, word) in [(failed, "failed"), (skipped, "skipped")] {
            if count > 0 {
                let _ = write!(left, ", {count} {word}");
            }
        }
        let _ = write!(
            text,
            "<li class=\"{class}\"><b>{mark} {met} of {}</b><span>expectations met{left}</span></li>",
            verdicts.len()
        );
    }
    let done = count(Status::Done);
    let absent = planned.saturating_sub(rows.len());
    let (class, mark) = if count(Status::Failed) > 0 || absent > 0 {
        ("ill", "\u{2717}")
    } else {
        ("well", "\u{2713}")
    };
    let _ = write!(
        text,
        "<li class=\"{class}\"><b>{mark} {done} of {planned}</b><span>jobs done</span></li>"
    );
    if absent > 0 {
        let _ = write!(
            text,
            "<li class=\"ill\"><b>{absent}</b><span>not computed yet</span></li>"
        );
    }
    for (status, word) in [
        (Status::Failed, "failed"),
        (Status::Refused, "refused"),
        (Status::Skipped, "skipped"),
    ] {
        if count(status) > 0 {
            let class = if status == Status::Failed { "ill" } else { "" };
            let _ = write!(
                text,
                "<li class=\"{class}\"><b>{}</b><span>{word}</span></li>",
                count(status)
            );
        }
    }
    let stopped = rows.iter().filter(|row| row.done() && row.remarkable()).count();
    if stopped > 0 {
        let _ = write!(text, "<li><b>{stopped}</b><span>done, but not converged</span></li>");
    }
    text.push_str("</ul>");
    text
}

fn expectations(verdicts: &[Verdict]) -> String {
    let line = |verdict: &Verdict| {
        let (class, mark) = match verdict.outcome {
            Outcome::Met => ("well", "\u{2713} met"),
            Outcome::Failed => ("ill", "\u{2717} failed"),
            Outcome::Skipped => ("wait", "\u{2013} skipped"),
        };
        format!(
            "<tr><td class=\"{class}\">{mark}</td><th scope=\"row\">{}</th><td class=\"wide\">{}</td><td class=\"wide\">{}</td><td class=\"beside\">{}</td></tr>",
            escape(&verdict.subject),
            escape(&verdict.expected),
            escape(&verdict.found),
            escape(&verdict.place)
        )
    };
    let table = |chosen: Vec<&Verdict>| {
        let body: String = chosen.into_iter().map(line).collect();
        format!(
            "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Expectations\"><table class=\"words\"><thead><tr>\
             <th scope=\"col\">verdict</th><th scope=\"col\">job or series</th><th scope=\"col\">expected</th>\
             <th scope=\"col\">found</th><th scope=\"col\">stated in</th></tr></thead><tbody>{body}</tbody></table></div>"
        )
    };
    let (met, others): (Vec<&Verdict>, Vec<&Verdict>) =
        verdicts.iter().partition(|verdict| verdict.outcome == Outcome::Met);
    let mut text = String::new();
    if !others.is_empty() {
        text.push_str(&table(others));
    }
    if !met.is_empty() {
        let open = if met.len() == verdicts.len() && met.len() <= 8 {
            " open"
        } else {
            ""
        };
        let _ = write!(
            text,
            "<details{open}><summary>{}</summary>{}</details>",
            plural(met.len(), "expectation met", "expectations met"),
            table(met)
        );
    }
    text
}

/// A rate with a true minus sign.
fn rate(value: f64, standard_error: Option<f64>) -> String {
    super::rate::shown(value, standard_error).replace('-', "\u{2212}")
}

fn rates(fits: &[Fit]) -> String {
    let spread = fits.iter().any(|fit| fit.spread.is_some());
    let mut text = String::from(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Rates\"><table class=\"words\"><thead><tr><th scope=\"col\">rate</th>\
         <th scope=\"col\">series</th><th scope=\"col\">slope</th><th scope=\"col\">last pair</th><th scope=\"col\">points</th>",
    );
    if spread {
        text.push_str("<th scope=\"col\">over seeds</th>");
    }
    let windowed = fits.iter().any(|fit| fit.window.is_some());
    let gated = fits.iter().any(|fit| fit.expect.is_some());
    for (used, name) in [(windowed, "window"), (gated, "expected")] {
        if used {
            let _ = write!(text, "<th scope=\"col\">{name}</th>");
        }
    }
    text.push_str("</tr></thead><tbody>");
    for fit in fits {
        let slope = match fit.line {
            Some(line) => {
                let error = line
                    .standard_error
                    .map_or_else(String::new, |error| format!(" \u{b1} {}", round(error, 2).unicode()));
                format!("<b>{}</b>{error}", rate(line.slope, line.standard_error))
            }
            None => "<i>none</i>".into(),
        };
        let points = if fit.left_out > 0 {
            format!("{} ({} left out)", fit.points.len(), fit.left_out)
        } else {
            fit.points.len().to_string()
        };
        let expected = fit.expect.map_or_else(String::new, |bound| {
            let met = fit.line.is_some_and(|line| super::gate::holds(&bound, line.slope));
            let (class, mark) = if met { ("well", "\u{2713}") } else { ("ill", "\u{2717}") };
            format!(
                "<span class=\"{class}\">{mark} {}</span>",
                escape(&super::gate::describe(&bound))
            )
        });
        let _ = write!(
            text,
            "<tr><th scope=\"row\">{}: {} against {}</th><td>{}</td><td class=\"number\">{slope}</td><td class=\"number\">{}</td><td class=\"number\">{points}</td>",
            escape(&fit.rate),
            escape(&fit.y),
            escape(&fit.x),
            escape(&fit.series),
            fit.last_pair.map_or_else(String::new, |last| rate(last, None))
        );
        if spread {
            let seeds = fit.spread.map_or_else(String::new, |(low, high, count)| {
                format!("{} to {} ({count})", rate(low, None), rate(high, None))
            });
            let _ = write!(text, "<td class=\"number\">{seeds}</td>");
        }
        let window = fit.window.map_or_else(String::new, |[low, high]| {
            format!("{} to {}", round(low, 4).unicode(), round(high, 4).unicode())
        });
        if windowed {
            let _ = write!(text, "<td class=\"number\">{window}</td>");
        }
        if gated {
            let _ = write!(text, "<td>{expected}</td>");
        }
        text.push_str("</tr>");
    }
    text.push_str(
        "</tbody></table></div><figcaption><p>Slope of log y against log x by least squares with its standard error; \
         the last pair is the rate between the last two x.</p></figcaption>",
    );
    text
}

fn plots(charts: &[Chart]) -> Result<String, ReportError> {
    let mut text = String::from("<div class=\"plots\">");
    for chart in charts {
        let _ = write!(
            text,
            "<figure><h3>{}</h3>{}<figcaption>",
            escape(&chart.title),
            svg::inline(chart)?
        );
        for note in &chart.notes {
            let _ = write!(text, "<p>{}</p>", escape(note));
        }
        let name = escape(&chart.name);
        let _ = write!(
            text,
            "<p>As <a href=\"{name}.svg\">SVG</a>, <a href=\"{name}.png\">PNG</a>.</p></figcaption></figure>"
        );
    }
    text.push_str("</div>");
    Ok(text)
}

/// How a job ended, with a mark that does not need colour.
fn end(row: &Row) -> String {
    let word = table::word(row);
    let (class, mark) = match row.record.result.status {
        Status::Done if row.remarkable() => ("wait", "\u{25b3}"),
        Status::Done => ("well", "\u{2713}"),
        Status::Refused => ("wait", "\u{25b3}"),
        Status::Failed => ("ill", "\u{2717}"),
        Status::Skipped => ("wait", "\u{2013}"),
    };
    format!("<span class=\"{class}\">{mark} {}</span>", escape(word))
}

fn jobs(rows: &[Row]) -> String {
    let mut text = String::from(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Jobs\"><table class=\"words\"><thead><tr><th scope=\"col\">job</th>\
         <th scope=\"col\">status</th><th scope=\"col\">stop</th><th scope=\"col\">reason and notices</th>\
         <th scope=\"col\">time <span class=\"unit\">[s]</span></th><th scope=\"col\">peak memory</th><th scope=\"col\">timed</th></tr></thead><tbody>",
    );
    for row in rows {
        let result = &row.record.result;
        let measurement = &row.record.measurement;
        let mut remarks: Vec<String> = Vec::new();
        if !result.reason.is_empty() {
            remarks.push(escape(&result.reason));
        }
        remarks.extend(result.notices.iter().map(|notice| escape(notice)));
        let mut timed = number::moment(measurement.started);
        if !timed.is_empty() {
            let runs = measurement.wall_seconds.len();
            let alone = if row.waited() {
                "alone, but the machine was busy"
            } else if measurement.exclusive {
                "alone"
            } else {
                "beside others"
            };
            let _ = write!(timed, ", {}, {alone}", plural(measurement.threads, "thread", "threads"));
            if runs > 1 {
                let _ = write!(timed, ", median of {runs}");
            }
        }
        let memory = if measurement.peak_memory > 0 {
            number::bytes(measurement.peak_memory)
        } else {
            String::new()
        };
        let _ = write!(
            text,
            "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td class=\"wide\">{}</td><td class=\"number\">{}</td><td class=\"number\">{memory}</td><td>{timed}</td></tr>",
            escape(&row.name),
            status(result.status),
            end(row),
            remarks.join("<br>"),
            row.figure("seconds")
                .map_or_else(String::new, |seconds| round(seconds, 3).unicode())
        );
    }
    text.push_str("</tbody></table></div>");
    text
}

fn provenance(experiment: &Experiment, rows: &[Row]) -> String {
    let mut text = String::from("<dl class=\"facts\">");
    let mut fact = |name: &str, value: String| {
        if !value.is_empty() {
            let _ = write!(text, "<dt>{name}</dt><dd>{value}</dd>");
        }
    };
    let method = experiment.method;
    fact("experiment", escape(&experiment.name));
    let versions: BTreeSet<u32> = rows
        .iter()
        .map(|row| row.record.job.method_version)
        .filter(|version| *version > 0)
        .collect();
    let versions: Vec<String> = versions.iter().map(u32::to_string).collect();
    let version = if versions.is_empty() {
        String::new()
    } else {
        format!(", version {}", versions.join(" and "))
    };
    fact(
        "method",
        escape(&format!("{}{version}: {}", method.name(), method.summary())),
    );
    fact("source", escape(method.source()));
    let distinct = |value: fn(&Row) -> String| -> String {
        let values: BTreeSet<String> = rows.iter().map(value).filter(|value| !value.is_empty()).collect();
        escape(&values.into_iter().collect::<Vec<_>>().join("; "))
    };
    fact(
        "program",
        distinct(|row| {
            let measurement = &row.record.measurement;
            match (measurement.version.as_str(), measurement.commit.as_str()) {
                ("", _) => String::new(),
                (version, "") => format!("vargeo {version}"),
                (version, commit) => format!("vargeo {version}, commit {commit}"),
            }
        }),
    );
    fact(
        "processor and system",
        distinct(|row| row.record.measurement.host.clone()),
    );
    fact(
        "instructions used",
        distinct(|row| row.record.measurement.target.clone()),
    );
    let threads: BTreeSet<usize> = rows
        .iter()
        .map(|row| row.record.measurement.threads)
        .filter(|count| *count > 0)
        .collect();
    fact(
        "threads of a job",
        threads.iter().map(usize::to_string).collect::<Vec<_>>().join(", "),
    );
    let started: Vec<i64> = rows
        .iter()
        .map(|row| row.record.measurement.started)
        .filter(|moment| *moment != 0)
        .collect();
    if let (Some(first), Some(last)) = (started.iter().min(), started.iter().max()) {
        let (first, last) = (number::moment(*first), number::moment(*last));
        fact(
            "timed",
            if first == last {
                first
            } else {
                format!("{first} to {last}")
            },
        );
    }
    let mut inputs: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for row in rows {
        for (role, part) in &row.record.job.model {
            let described = match part {
                JobPart::Generated { generator, parameters } => format!("{generator} {}", label(parameters)),
                JobPart::File { sha256, .. } => {
                    let name = row.record.measurement.inputs.get(role).map_or("a file", String::as_str);
                    format!("{name}, SHA-256 {sha256}")
                }
            };
            inputs
                .entry(role.clone())
                .or_default()
                .insert(described.trim().to_string());
        }
    }
    for (role, parts) in &inputs {
        fact(
            &escape(role),
            parts.iter().map(|part| escape(part)).collect::<Vec<_>>().join("<br>"),
        );
    }
    text.push_str("</dl>");
    let held = held(rows);
    if !held.is_empty() {
        let settings = serde_json::to_string_pretty(&held).unwrap_or_default();
        let _ = write!(
            text,
            "<details><summary>Settings that all jobs share, given, chosen by the preset or by default</summary>\
             <pre>{}</pre></details>",
            escape(&settings)
        );
    }
    text
}

/// The settings that have one value in all jobs.
fn held(rows: &[Row]) -> Map<String, Value> {
    let mut all = rows.iter().filter_map(|row| row.record.job.settings.as_object());
    let mut held = all.next().cloned().unwrap_or_default();
    for settings in all {
        held.retain(|name, value| settings.get(name) == Some(value));
    }
    held
}
