//! `jobs.csv`: a row a job with every axis, metric and counter, unrounded, and where and when its time was measured.

use super::ReportError;
use super::number::iso_moment;
use super::row::Row;
use crate::experiment::file::Experiment;
use crate::experiment::record::{MEASUREMENTS, Status};
use serde_json::Value;
use std::collections::BTreeSet;

/// The header has units in brackets; a figure that is absent or undefined is an empty field.
pub fn write(experiment: &Experiment, rows: &[Row]) -> Result<Vec<u8>, ReportError> {
    let mut axes: Vec<&str> = Vec::new();
    for (axis, _) in rows.iter().flat_map(|row| &row.axes) {
        if !axes.contains(&axis.as_str()) {
            axes.push(axis);
        }
    }
    let declared = experiment.method.metrics();
    let others: BTreeSet<&str> = rows
        .iter()
        .flat_map(|row| row.record.result.metrics.keys())
        .map(String::as_str)
        .filter(|name| declared.iter().all(|metric| metric.name != *name))
        .collect();
    let counters: BTreeSet<&str> = rows
        .iter()
        .flat_map(|row| row.record.result.counters.keys())
        .map(String::as_str)
        .collect();

    let unit = |name: &str, unit: &str| {
        if unit.is_empty() {
            name.to_string()
        } else {
            format!("{name} [{unit}]")
        }
    };
    let mut head: Vec<String> = vec!["job".into()];
    // An axis may be named like a figure, such as `energy`: no two columns share a name.
    let is_figure = |axis: &str| {
        declared.iter().any(|metric| metric.name == axis) || others.contains(axis) || counters.contains(axis)
    };
    head.extend(axes.iter().map(|axis| {
        if is_figure(axis) {
            format!("{axis} (axis)")
        } else {
            axis.to_string()
        }
    }));
    head.extend(["status", "stop", "reason"].map(String::from));
    head.extend(declared.iter().map(|metric| unit(metric.name, metric.unit)));
    head.extend(others.iter().chain(&counters).map(|name| name.to_string()));
    head.extend(MEASUREMENTS.iter().map(|measured| unit(measured.name, measured.unit)));
    head.extend(
        [
            "threads",
            "repetitions",
            "exclusive",
            "timed",
            "version",
            "commit",
            "target",
            "host",
            "notices",
            "key",
        ]
        .map(String::from),
    );

    let mut writer = csv::Writer::from_writer(Vec::new());
    let place = |error: csv::Error| ReportError::Csv("jobs.csv".into(), error.to_string());
    writer.write_record(&head).map_err(place)?;
    for row in rows {
        let result = &row.record.result;
        let measurement = &row.record.measurement;
        let metric = |name: &str| result.metrics.get(name).map_or_else(String::new, |&value| exact(value));
        let mut fields: Vec<String> = vec![row.name.clone()];
        fields.extend(axes.iter().map(|axis| {
            row.axes
                .iter()
                .find(|(name, _)| name == axis)
                .map_or_else(String::new, |(_, value)| match value {
                    Value::String(text) => text.clone(),
                    other => other.to_string(),
                })
        }));
        fields.extend([status(result.status).into(), result.stop.clone(), result.reason.clone()]);
        fields.extend(declared.iter().map(|declared| metric(declared.name)));
        fields.extend(others.iter().map(|name| metric(name)));
        fields.extend(counters.iter().map(|name| {
            result
                .counters
                .get(*name)
                .map_or_else(String::new, |count| count.to_string())
        }));
        fields.extend(
            MEASUREMENTS
                .iter()
                .map(|measured| row.measurement(measured.name).map_or_else(String::new, exact)),
        );
        fields.extend([
            measurement.threads.to_string(),
            measurement.wall_seconds.len().to_string(),
            if measurement.exclusive { "yes" } else { "no" }.into(),
            iso_moment(measurement.started),
            measurement.version.clone(),
            measurement.commit.clone(),
            measurement.target.clone(),
            measurement.host.clone(),
            result.notices.join("; "),
            row.record.key.0.clone(),
        ]);
        writer.write_record(&fields).map_err(place)?;
    }
    writer
        .into_inner()
        .map_err(|error| ReportError::Csv("jobs.csv".into(), error.to_string()))
}

/// The word for how a job ended.
pub fn status(status: Status) -> &'static str {
    match status {
        Status::Done => "done",
        Status::Refused => "refused",
        Status::Failed => "failed",
        Status::Skipped => "skipped",
    }
}

/// The shortest digits that read back to the same number.
fn exact(value: f64) -> String {
    if value.is_nan() {
        String::new()
    } else if value.is_infinite() {
        if value > 0.0 { "inf" } else { "-inf" }.into()
    } else if value != 0.0 && !(1e-5..1e16).contains(&value.abs()) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}
