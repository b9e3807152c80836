//! Fitted rates recover known slopes and their errors.

use crate::sample;
use vargeo::report::rate::{fit, fits};

#[test]
fn an_exact_power_law_is_recovered() {
    for slope in [-3.0, 0.5, 1.75, 2.0] {
        let points: Vec<(f64, f64)> = (0..6)
            .map(|level| 0.5f64.powi(level))
            .map(|h| (h, 7.0 * h.powf(slope)))
            .collect();
        let line = fit(&points).unwrap();
        assert!((line.slope - slope).abs() < 1e-12);
        assert!((line.intercept.exp() - 7.0).abs() < 1e-11);
        assert!(line.standard_error.unwrap() < 1e-12);
    }
}

/// Deviations (+e, -2e, +e) at log x = -1, 0, 1 leave the slope, and give s^2 = 6 e^2 / 1 and error = s / sqrt(2).
#[test]
fn the_standard_error_is_that_of_least_squares() {
    let deviation = 0.01;
    let points: Vec<(f64, f64)> = [(-1.0, deviation), (0.0, -2.0 * deviation), (1.0, deviation)]
        .map(|(log_x, off): (f64, f64)| (log_x.exp(), (2.0 * log_x + off).exp()))
        .to_vec();
    let line = fit(&points).unwrap();
    assert!((line.slope - 2.0).abs() < 1e-12);
    assert!((line.standard_error.unwrap() - deviation * 3f64.sqrt()).abs() < 1e-12);
}

#[test]
fn too_few_points_have_no_slope() {
    assert_eq!(fit(&[]), None);
    assert_eq!(fit(&[(0.1, 1.0)]), None);
    assert_eq!(fit(&[(0.1, 1.0), (0.1, 2.0), (0.1, 3.0)]), None, "one x only");
    assert_eq!(fit(&[(0.1, 1.0), (0.2, 2.0)]).unwrap().standard_error, None);
}

#[test]
fn series_seeds_windows_and_the_last_pair() {
    let (rows, rate) = sample::study();
    let mut experiment = sample::experiment();
    experiment.rates = vec![rate.clone()];
    let found = fits(&experiment, &rows);
    assert_eq!(
        found.iter().map(|fit| fit.series.as_str()).collect::<Vec<_>>(),
        ["even", "random"]
    );
    for (fit, slope) in found.iter().zip([2.0, 1.5]) {
        let line = fit.line.unwrap();
        assert_eq!(fit.points.len(), 15);
        assert!((line.slope - slope).abs() < 3.0 * line.standard_error.unwrap());
        let (low, high, seeds) = fit.spread.unwrap();
        assert!(low < line.slope && line.slope < high && high - low < 0.1 && seeds == 3);
        // h falls along the jobs: the last pair is the finest, its noise known from the sample.
        assert!((fit.last_pair.unwrap() - slope).abs() < 0.1);
    }

    let mut windowed = rate;
    windowed.window = Some([0.02, 0.11]);
    experiment.rates = vec![windowed];
    assert_eq!(
        fits(&experiment, &rows)[0].points.len(),
        9,
        "three of five levels, three seeds"
    );
}

#[test]
fn jobs_without_figures_are_counted() {
    let (mut rows, rate) = sample::study();
    rows[0].record.result.metrics.insert("error".into(), f64::NAN);
    rows[1].record.result.metrics.insert("error".into(), 0.0);
    rows[2].record.result.metrics.clear();
    let mut experiment = sample::experiment();
    experiment.rates = vec![rate];
    let found = fits(&experiment, &rows);
    assert_eq!((found[0].points.len(), found[0].left_out), (12, 3));
    assert!(found[0].sentence().contains("3 jobs left out"));
}
