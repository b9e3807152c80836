//! The sentences under a table: what its figures, marks and printed columns mean, and how far its times can be trusted.

use super::{Line, Quantity, TOLERANCE};
use crate::experiment::file::{Published, Table};
use crate::report::row::Row;

/// `parts` are the jobs behind the cells, a list for each line; `any_best` whether a figure is marked as the best.
pub(super) fn legend(table: &Table, quantities: &[Quantity], parts: &[Vec<Line>], any_best: bool) -> Vec<String> {
    let mut legend = Vec::new();
    if quantities.iter().any(|quantity| quantity.measured) {
        legend.push("Figures to four significant digits, measurements to three; jobs.csv holds them unrounded.".into());
    } else {
        legend.push("Figures to four significant digits; jobs.csv holds them unrounded.".into());
    }
    if any_best {
        legend.push(match table.rows.as_slice() {
            [] | [_] => "Bold: the best of a column among jobs that converged.".to_string(),
            [fixed @ .., last] => {
                format!(
                    "Bold: the best {last} of a column at equal {} among jobs that converged.",
                    fixed.join(" and ")
                )
            }
        });
    }
    if quantities.iter().any(|quantity| quantity.name == "seconds") {
        let jobs = || parts.iter().flatten().flat_map(|line| &line.jobs);
        let alone = |job: &&&Row| job.record.measurement.exclusive;
        if jobs().any(|job| alone(&job)) && !jobs().all(|job| alone(&job)) {
            legend.push(
                "Some of these jobs ran alone and some beside others (jobs.csv tells which): their seconds are no match; \
                 cpu_seconds are."
                    .into(),
            );
        }
        let busy = jobs().filter(|job| job.waited()).count();
        if busy > 0 {
            legend.push(format!(
                "The machine was busy with something else while {busy} of these jobs ran alone: their seconds exceed their \
                 processor time by more than a quarter."
            ));
        }
    }
    if parts.iter().flatten().any(|line| line.jobs.len() > 1) {
        legend.push("A \u{b1} B (n): mean and sample standard deviation of n jobs.".into());
    }
    if let Some(published) = &table.published {
        legend.push(source(published));
        legend.push(format!(
            "A difference within {} % of the printed figure (or the row's own tolerance, or half its last digit) counts as equal.",
            100.0 * TOLERANCE
        ));
        if quantities.iter().any(|quantity| quantity.measured) {
            legend.push(match &published.machine {
                Some(machine) => format!("Printed times: {machine}; ours against them is a ratio without judgement."),
                None => "Printed times are of another machine: a ratio without judgement.".into(),
            });
        }
    }
    legend
}

fn source(published: &Published) -> String {
    format!("Printed: {}.", published.source.trim_end_matches('.'))
}
