//! The gate: every `[[expect]]` and every rate's `expect` held against the records.
//!
//! Each condition on each job is one verdict with the figure, the bound and the place. An expectation that matches no job
//! fails: it would otherwise stop guarding without anyone knowing. A figure that is absent or undefined fails. Jobs that
//! were skipped because an optional model is missing are reported as skipped.

use super::number;
use super::rate::Fit;
use super::row::{Quantity, Row, label, same};
use crate::experiment::file::{Bound, Condition, Expectation, Experiment};
use crate::experiment::record::Status;

/// Whether an expectation was met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    Met,
    Failed,
    /// The job did not run because an optional model is missing.
    Skipped,
}

/// One condition held against one job or rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// `line 42`, or `rate NAME`.
    pub place: String,
    /// The job or the rate's series; empty when an expectation matched nothing.
    pub subject: String,
    /// What was expected: `d_ma at most 20`.
    pub expected: String,
    /// What was found: `12.34`, or why there is no figure.
    pub found: String,
    pub outcome: Outcome,
}

/// All verdicts, expectations in the order of the file, then rates.
pub fn judge(experiment: &Experiment, rows: &[Row], fits: &[Fit]) -> Vec<Verdict> {
    let mut verdicts = Vec::new();
    for expectation in &experiment.expectations {
        judge_expectation(experiment, expectation, rows, &mut verdicts);
    }
    for rate in experiment.rates.iter().filter(|rate| rate.expect.is_some()) {
        if !fits.iter().any(|fit| fit.rate == rate.name) {
            verdicts.push(nothing(format!("rate {}", rate.name), &rate.condition));
        }
    }
    for fit in fits {
        let Some(bound) = fit.expect else { continue };
        let slope = fit.line.map(|line| line.slope);
        verdicts.push(Verdict {
            place: format!("rate {}", fit.rate),
            subject: fit.series.clone(),
            expected: format!("slope of {} against {} {}", fit.y, fit.x, describe(&bound)),
            found: match slope {
                Some(slope) => number::round(slope, 4).plain(),
                None => format!("no slope: {} usable points", fit.points.len()),
            },
            outcome: outcome(slope.is_some_and(|slope| holds(&bound, slope))),
        });
    }
    verdicts
}

/// Whether every verdict lets the gate open.
pub fn passes(verdicts: &[Verdict]) -> bool {
    verdicts.iter().all(|verdict| verdict.outcome != Outcome::Failed)
}

fn judge_expectation(experiment: &Experiment, expectation: &Expectation, rows: &[Row], verdicts: &mut Vec<Verdict>) {
    let place = format!("line {}", expectation.line);
    let mut matched = false;
    for row in rows.iter().filter(|row| row.matches(&expectation.condition)) {
        matched = true;
        let skipped = row.record.result.status == Status::Skipped;
        let mut push = |expected: String, found: String, met: bool| {
            verdicts.push(Verdict {
                place: place.clone(),
                subject: row.name.clone(),
                expected,
                found: if skipped { ended(row) } else { found },
                outcome: if skipped { Outcome::Skipped } else { outcome(met) },
            });
        };
        if let Some(stop) = &expectation.stop {
            let word = super::table::word(row);
            push(format!("stop is {stop}"), ended(row), word == stop);
        }
        for (metric, bound) in &expectation.bounds {
            let quantity = Quantity::find(experiment, metric);
            let value = row.figure(metric);
            push(
                format!("{} {}", quantity.heading(), describe(bound)),
                found(row, value, quantity.digits),
                value.is_some_and(|value| holds(bound, value)),
            );
        }
        for comparison in &expectation.comparisons {
            let quantity = Quantity::find(experiment, &comparison.metric);
            let factor = if comparison.factor == 1.0 {
                String::new()
            } else {
                format!("{} times ", number::round(comparison.factor, 4).plain())
            };
            let partners = partners(row, &comparison.other, rows);
            if partners.is_empty() {
                // Without a condition of its own, the expectation speaks of the other jobs only.
                if row.matches(&comparison.other) {
                    continue;
                }
                push(
                    format!(
                        "{} less than {factor}that with {}",
                        comparison.metric,
                        written(&comparison.other)
                    ),
                    "no job differs from this one in these axes only".into(),
                    false,
                );
            }
            for partner in partners {
                let (ours, theirs) = (row.figure(&comparison.metric), partner.figure(&comparison.metric));
                let met = matches!((ours, theirs), (Some(ours), Some(theirs)) if ours < comparison.factor * theirs);
                if partner.record.result.status == Status::Skipped && !skipped {
                    continue;
                }
                push(
                    format!("{} less than {factor}that of {}", comparison.metric, partner.name),
                    format!(
                        "{} against {}",
                        found(row, ours, quantity.digits),
                        found(partner, theirs, quantity.digits)
                    ),
                    met,
                );
            }
        }
    }
    if !matched {
        verdicts.push(nothing(place, &expectation.condition));
    }
}

/// Jobs that have the other's axis values and agree with this one in every other axis.
fn partners<'a>(row: &Row, other: &Condition, rows: &'a [Row]) -> Vec<&'a Row> {
    rows.iter()
        .filter(|candidate| {
            candidate.matches(other)
                && candidate.name != row.name
                && candidate
                    .axes
                    .iter()
                    .all(|(axis, value)| other.contains_key(axis) || row.axis(axis).is_some_and(|own| same(own, value)))
        })
        .collect()
}

fn nothing(place: String, condition: &Condition) -> Verdict {
    Verdict {
        place,
        subject: String::new(),
        expected: if condition.is_empty() {
            "at least one job".into()
        } else {
            format!("at least one job with {}", written(condition))
        },
        found: "no job matches".into(),
        outcome: Outcome::Failed,
    }
}

fn outcome(met: bool) -> Outcome {
    if met { Outcome::Met } else { Outcome::Failed }
}

fn found(row: &Row, value: Option<f64>, digits: usize) -> String {
    match value {
        Some(value) => number::round(value, digits).plain(),
        None => ended(row),
    }
}

/// The end of a job with its reason.
fn ended(row: &Row) -> String {
    let reason = &row.record.result.reason;
    let word = super::table::word(row);
    if reason.is_empty() {
        word.to_string()
    } else {
        format!("{word}: {reason}")
    }
}

/// Whether a number lies within a bound; not-a-number never does.
pub fn holds(bound: &Bound, value: f64) -> bool {
    let least = bound.min.is_none_or(|min| value >= min);
    let most = bound.max.is_none_or(|max| value <= max);
    let equal = bound.equals.is_none_or(|equals| match bound.tolerance {
        Some(tolerance) => (value - equals).abs() <= tolerance * equals.abs(),
        None => value == equals,
    });
    !value.is_nan() && least && most && equal
}

/// A bound in words.
pub fn describe(bound: &Bound) -> String {
    let plain = number::written;
    let mut parts = Vec::new();
    if let Some(min) = bound.min {
        parts.push(format!("at least {}", plain(min)));
    }
    if let Some(max) = bound.max {
        parts.push(format!("at most {}", plain(max)));
    }
    if let Some(equals) = bound.equals {
        parts.push(match bound.tolerance {
            Some(tolerance) => format!(
                "{} within {} %",
                plain(equals),
                number::round(100.0 * tolerance, 3).plain()
            ),
            None => format!("exactly {}", plain(equals)),
        });
    }
    if parts.is_empty() {
        "present".into()
    } else {
        parts.join(" and ")
    }
}

/// A condition in words: `energy = stretch and model = ball or duck`.
pub fn written(condition: &Condition) -> String {
    let parts: Vec<String> = condition
        .iter()
        .map(|(axis, values)| format!("{axis} = {}", values.iter().map(label).collect::<Vec<_>>().join(" or ")))
        .collect();
    parts.join(" and ")
}
