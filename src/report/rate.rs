//! Rates of convergence: the slope of log y against log x by least squares, with its uncertainty.
//!
//! The standard error is that of ordinary least squares with equal variances: s / sqrt(sum (log x - mean)^2) with
//! s^2 = sum of squared residuals / (n - 2). It says how well a line describes the points, not whether they are
//! asymptotic: the rate of the last pair tells that.

use super::row::{Row, label};
use crate::experiment::file::{Bound, Experiment, Rate};

/// A fitted line in logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    pub slope: f64,
    /// log y at log x = 0.
    pub intercept: f64,
    /// Absent for two points, through which a line passes exactly.
    pub standard_error: Option<f64>,
}

/// A series of a rate and what was fitted to it.
#[derive(Clone, Debug)]
pub struct Fit {
    pub rate: String,
    /// Values of the series axes.
    pub series: String,
    pub x: String,
    pub y: String,
    /// Points within the window, by x.
    pub points: Vec<(f64, f64)>,
    /// How many of the points are of jobs that did not converge.
    pub unconverged: usize,
    pub line: Option<Line>,
    /// Rate between the last two x in the direction in which the jobs go, the mean of the seeds where there are several.
    pub last_pair: Option<f64>,
    /// Lowest and highest slope over the values of an axis named `seed`, each fitted alone, and their count.
    pub spread: Option<(f64, f64, usize)>,
    pub window: Option<[f64; 2]>,
    /// Points left out: not positive, not finite, or of jobs without a figure.
    pub left_out: usize,
    pub expect: Option<Bound>,
}

/// Slope, intercept and standard error of y against x in logarithms; `None` with fewer than two different x.
pub fn fit(points: &[(f64, f64)]) -> Option<Line> {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logs.len() as f64;
    let mean_x = logs.iter().map(|point| point.0).sum::<f64>() / count;
    let mean_y = logs.iter().map(|point| point.1).sum::<f64>() / count;
    let xx: f64 = logs.iter().map(|point| (point.0 - mean_x).powi(2)).sum();
    let xy: f64 = logs.iter().map(|point| (point.0 - mean_x) * (point.1 - mean_y)).sum();
    // Rounding alone makes equal x differ by some 1e-15.
    if logs.len() < 2 || !xx.is_finite() || xx.sqrt() <= 1e-12 * (1.0 + mean_x.abs()) {
        return None;
    }
    let slope = xy / xx;
    let intercept = mean_y - slope * mean_x;
    let residual: f64 = logs.iter().map(|(x, y)| (y - intercept - slope * x).powi(2)).sum();
    let standard_error = (logs.len() > 2).then(|| (residual / (count - 2.0) / xx).sqrt());
    Some(Line {
        slope,
        intercept,
        standard_error,
    })
}

/// A rate to two decimals, or to as many as its standard error's second digit needs, up to four.
pub fn shown(rate: f64, standard_error: Option<f64>) -> String {
    let decimals = match standard_error {
        Some(error) if error > 0.0 && error < 0.1 => (1 - error.log10().floor() as i32).clamp(2, 4) as usize,
        _ => 2,
    };
    let text = format!("{rate:.decimals$}");
    // No sign on what rounds to zero.
    match text.strip_prefix('-') {
        Some(digits) if !digits.contains(|digit: char| ('1'..='9').contains(&digit)) => digits.to_string(),
        _ => text,
    }
}

/// Every rate of the experiment, a fit for each series in the order of the jobs.
pub fn fits(experiment: &Experiment, rows: &[Row]) -> Vec<Fit> {
    experiment
        .rates
        .iter()
        .flat_map(|rate| fit_series(rate, rows))
        .collect()
}

fn fit_series(rate: &Rate, rows: &[Row]) -> Vec<Fit> {
    struct Point {
        x: f64,
        y: f64,
        seed: String,
        converged: bool,
    }
    let mut series: Vec<(String, Vec<Point>, usize)> = Vec::new();
    for row in rows.iter().filter(|row| row.matches(&rate.condition)) {
        let name = row.labels(&rate.series);
        let index = match series.iter().position(|entry| entry.0 == name) {
            Some(index) => index,
            None => {
                series.push((name, Vec::new(), 0));
                series.len() - 1
            }
        };
        let (_, points, left_out) = &mut series[index];
        let usable = |value: Option<f64>| value.filter(|value| value.is_finite() && *value > 0.0);
        match (usable(row.coordinate(&rate.x)), usable(row.figure(&rate.y))) {
            (Some(x), Some(y)) => {
                if rate.window.is_none_or(|[low, high]| (low..=high).contains(&x)) {
                    let seed = |axis: &str| axis.rsplit('.').next() == Some("seed");
                    let seeds: Vec<String> = row
                        .axes
                        .iter()
                        .filter(|(axis, _)| seed(axis))
                        .map(|(_, value)| label(value))
                        .collect();
                    points.push(Point {
                        x,
                        y,
                        seed: seeds.join(" "),
                        converged: !row.remarkable(),
                    });
                }
            }
            _ => *left_out += 1,
        }
    }
    series
        .into_iter()
        .map(|(name, points, left_out)| {
            let mut groups: Vec<(&str, Vec<(f64, f64)>)> = Vec::new();
            for point in &points {
                match groups.iter_mut().find(|group| group.0 == point.seed) {
                    Some(group) => group.1.push((point.x, point.y)),
                    None => groups.push((&point.seed, vec![(point.x, point.y)])),
                }
            }
            let slopes: Vec<f64> = groups
                .iter()
                .filter_map(|group| fit(&group.1))
                .map(|line| line.slope)
                .collect();
            let spread = (slopes.len() > 1).then(|| {
                let low = slopes.iter().copied().fold(f64::INFINITY, f64::min);
                let high = slopes.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                (low, high, slopes.len())
            });
            // Meshes of different seeds differ a little in x: each seed has a last pair of its own.
            let last: Vec<f64> = groups.iter().filter_map(|group| last_pair(&group.1)).collect();
            let last = (!last.is_empty()).then(|| last.iter().sum::<f64>() / last.len() as f64);
            let pairs: Vec<(f64, f64)> = points.iter().map(|point| (point.x, point.y)).collect();
            Fit {
                rate: rate.name.clone(),
                series: name,
                x: rate.x.clone(),
                y: rate.y.clone(),
                line: fit(&pairs),
                last_pair: last,
                unconverged: points.iter().filter(|point| !point.converged).count(),
                points: pairs,
                spread,
                window: rate.window,
                left_out,
                expect: rate.expect,
            }
        })
        .collect()
}

/// The rate between the two x at the end towards which the jobs go, y averaged geometrically at each x.
fn last_pair(points: &[(f64, f64)]) -> Option<f64> {
    let descending = points.first()?.0 > points.last()?.0;
    let mut sorted: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    sorted.sort_by(|left, right| left.0.total_cmp(&right.0).then(left.1.total_cmp(&right.1)));
    if descending {
        sorted.reverse();
    }
    let mut means: Vec<(f64, f64, f64)> = Vec::new();
    for (x, y) in sorted {
        match means.last_mut() {
            Some(last) if (last.0 - x).abs() < 1e-9 => {
                last.1 += y;
                last.2 += 1.0;
            }
            _ => means.push((x, y, 1.0)),
        }
    }
    let [.., before, last] = means.as_slice() else {
        return None;
    };
    Some((last.1 / last.2 - before.1 / before.2) / (last.0 - before.0))
}

impl Fit {
    /// The fit in one sentence, such as `error against h, ball: slope 1.98 ± 0.03 over 5 points; last pair 1.995`.
    pub fn sentence(&self) -> String {
        use super::number::round;
        let series = if self.series.is_empty() {
            String::new()
        } else {
            format!(", {}", self.series)
        };
        let mut text = format!("{} against {}{series}: ", self.y, self.x);
        match self.line {
            Some(line) => {
                text.push_str(&format!("slope {}", shown(line.slope, line.standard_error)));
                if let Some(error) = line.standard_error {
                    text.push_str(&format!(" \u{b1} {}", round(error, 2).plain()));
                }
                text.push_str(&format!(" over {} points", self.points.len()));
            }
            None => {
                let points = if self.points.len() == 1 { "point" } else { "points" };
                text.push_str(&format!("no slope from {} {points}", self.points.len()));
                if self.points.len() == 1 {
                    text.push_str(
                        "; say with series = [...] which axes tell lines apart, all but the one that refines",
                    );
                }
            }
        }
        if let Some(last) = self.last_pair {
            text.push_str(&format!("; last pair {}", shown(last, None)));
        }
        if let Some((low, high, count)) = self.spread {
            text.push_str(&format!(
                "; {} to {} over {count} seeds",
                shown(low, None),
                shown(high, None)
            ));
        }
        if let Some([low, high]) = self.window {
            text.push_str(&format!(
                "; {} within {} to {}",
                self.x,
                round(low, 4).plain(),
                round(high, 4).plain()
            ));
        }
        if self.unconverged > 0 {
            text.push_str(&format!("; {} of them did not converge", self.unconverged));
        }
        if self.left_out > 0 {
            text.push_str(&format!(
                "; {} jobs left out: without a figure, or with one that is not positive and has no logarithm",
                self.left_out
            ));
        }
        text
    }
}
