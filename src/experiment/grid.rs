//! The grid of an experiment: every combination of its axes and zips, the last varying fastest, minus what is excluded.

use super::file::{Axis, Condition};
use serde_json::Value;

/// More jobs than this are a slip of the fingers.
pub const MOST_JOBS: usize = 100_000;

/// The value of every axis, in the order of the file.
pub type Point = Vec<(String, Value)>;

/// Number of combinations before anything is excluded; none when it overflows.
pub fn count(axes: &[Axis], zips: &[Vec<Axis>]) -> Option<usize> {
    let lengths = axes.iter().map(|axis| axis.values.len());
    let zipped = zips.iter().map(|zip| zip.first().map_or(1, |axis| axis.values.len()));
    lengths
        .chain(zipped)
        .try_fold(1usize, |product, length| product.checked_mul(length))
}

/// Every combination of at most [`MOST_JOBS`].
pub fn points(axes: &[Axis], zips: &[Vec<Axis>]) -> Vec<Point> {
    // Each group moves as one: a single axis, or the axes of a zip.
    let groups: Vec<&[Axis]> = axes
        .iter()
        .map(std::slice::from_ref)
        .chain(zips.iter().map(Vec::as_slice))
        .collect();
    let mut points: Vec<Point> = vec![Vec::new()];
    for group in groups {
        let steps = group.iter().map(|axis| axis.values.len()).min().unwrap_or(1);
        points = points
            .iter()
            .flat_map(|point| {
                (0..steps).map(move |step| {
                    let mut longer = point.clone();
                    longer.extend(group.iter().map(|axis| (axis.name.clone(), axis.values[step].clone())));
                    longer
                })
            })
            .take(MOST_JOBS)
            .collect();
    }
    points
}

/// Whether every axis of the condition has one of its values.
pub fn matches(condition: &Condition, point: &[(String, Value)]) -> bool {
    condition
        .iter()
        .all(|(name, values)| point.iter().any(|(axis, value)| axis == name && values.contains(value)))
}

/// A point in words: `model = ball, energy = stretch`.
pub fn describe(point: &[(String, Value)]) -> String {
    point
        .iter()
        .map(|(axis, value)| format!("{axis} = {}", show(value)))
        .collect::<Vec<_>>()
        .join(", ")
}

/// A value as it is written in tables: text without quotes, numbers in their short form.
pub fn show(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => number.as_f64().map_or_else(String::new, super::check::plain),
        other => other.to_string(),
    }
}
