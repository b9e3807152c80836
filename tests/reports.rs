//! Tables, macros, plots and the comparison of two result sets, by snapshot.

use crate::sample;
use serde_json::json;
use vargeo::experiment::file::{Condition, Plot, Table};
use vargeo::report::table::{build, csv, latex, markdown, terminal};
use vargeo::report::{compare, jobs, macros, number, plot};

#[test]
fn numbers_round_to_significant_digits() {
    let plain: Vec<String> = [
        0.0,
        1.0,
        -12.34567,
        0.000_123_456,
        0.001_234_56,
        999.96,
        123_456.7,
        1.5e6,
        12_345_678.9,
        -0.0,
        2_464.0,
    ]
    .iter()
    .map(|&value| number::round(value, 4).plain())
    .collect();
    insta::assert_snapshot!("rounded", plain.join(" "));
    assert_eq!(
        number::round(-1.234e-7, 3).unicode(),
        "\u{2212}1.23\u{d7}10\u{207b}\u{2077}"
    );
    assert_eq!(number::round(-1.234e-7, 3).latex(), "$-1.23\\cdot 10^{-7}$");
    assert_eq!(number::round(f64::NAN, 3).plain(), "undefined");
    assert_eq!(number::bytes(123 << 20), "123 MiB");
}

#[test]
fn a_table_in_every_form() {
    let experiment = sample::experiment();
    let grid = build(&experiment, &experiment.tables[0], &sample::rows());
    insta::assert_snapshot!("markdown", markdown::write(&grid));
    insta::assert_snapshot!("csv", String::from_utf8(csv::write(&grid).unwrap()).unwrap());
    insta::assert_snapshot!("latex", latex::write(&grid));
    insta::assert_snapshot!("terminal", terminal::write(&grid, None));
}

#[test]
fn several_jobs_in_a_row_give_mean_and_deviation() {
    let (rows, _) = sample::study();
    let table = Table {
        name: "study".into(),
        title: None,
        rows: vec!["family".into(), "h".into()],
        columns: vec!["error".into()],
        across: Vec::new(),
        condition: sample::condition(&[("family", &[json!("even")])]),
        published: None,
    };
    let grid = build(&sample::experiment(), &table, &rows);
    insta::assert_snapshot!("deviation", markdown::write(&grid));
}

#[test]
fn jobs_csv_has_a_row_a_job_unrounded() {
    let text = String::from_utf8(jobs::write(&sample::experiment(), &sample::rows()).unwrap()).unwrap();
    insta::assert_snapshot!("jobs", text);
}

#[test]
fn macros_define_every_figure() {
    let text = macros::write(&sample::experiment(), &sample::rows()[..1], &[]);
    insta::assert_snapshot!("macros", text);
}

fn plot(x: &str, y: &str, log: bool) -> Plot {
    Plot {
        name: "plot".into(),
        title: None,
        x: x.into(),
        y: y.into(),
        series: vec!["family".into()],
        log_x: log,
        log_y: log,
        condition: Condition::new(),
    }
}

#[test]
fn logarithmic_axes_have_labelled_decades() {
    let (rows, _) = sample::study();
    let chart = plot::chart(&sample::experiment(), &plot("h", "error", true), &rows);
    let labels: Vec<&str> = chart.y.ticks.iter().filter_map(|tick| tick.label.as_deref()).collect();
    assert_eq!(labels, ["10\u{207b}\u{b3}", "10\u{207b}\u{b2}", "10\u{207b}\u{b9}"]);
    let svg = plot::svg::standalone(&chart).unwrap();
    for label in labels {
        assert!(svg.contains(&format!(">{label}</text>")), "{label}");
    }
}

#[test]
fn short_logarithmic_axes_have_ticks_all_the_same() {
    for (low, high) in [(2.0, 7.0), (6.31, 6.34), (0.9, 1.1), (3.0, 3.0), (1e-30, 1e30)] {
        let axis = plot::axis::Axis::new(
            String::new(),
            plot::axis::Kind::Logarithmic,
            [low, high].into_iter(),
            false,
        );
        let labelled = axis.ticks.iter().filter(|tick| tick.label.is_some()).count();
        assert!((2..=10).contains(&labelled), "{low} to {high}: {labelled} labels");
        assert!(
            axis.ticks
                .iter()
                .all(|tick| (-1e-6..1.000_001).contains(&axis.position(tick.value)))
        );
    }
}

#[test]
fn series_are_told_apart_without_colour() {
    let chart = plot::chart(&sample::experiment(), &sample::experiment().plots[0], &sample::rows());
    assert_eq!(chart.series.len(), 4);
    assert!(chart.series.iter().all(|series| series.phases == [8.0]));
    let svg = plot::svg::standalone(&chart).unwrap();
    // The second series is dashed: its path begins anew for each dash; every series has its own kind of marker and its
    // name.
    let path = |index: usize| {
        svg.split(&format!("<path class=\"s{index}\" stroke-width=\"9\" d=\""))
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap()
    };
    assert_eq!(path(0).matches('M').count(), 1);
    assert!(path(1).matches('M').count() > 20);
    assert!(svg.contains("<circle class=\"f0\"") && svg.contains("<polygon class=\"f1\""));
    for series in &chart.series {
        assert!(svg.contains(&format!(">{}</text>", series.name)));
    }
    assert!(svg.contains("prefers-color-scheme:dark") && !svg.contains("NaN"));
}

#[test]
fn an_axis_comes_before_a_figure_or_trace_of_its_name() {
    let mut rows = sample::rows();
    for row in &mut rows {
        row.record.result.metrics.insert("energy".into(), 4.5);
    }
    let chart = plot::chart(&sample::experiment(), &sample::experiment().plots[1], &rows);
    let names = ["dirichlet", "stretch", "lscm"].map(String::from).to_vec();
    assert_eq!(chart.x.kind, plot::axis::Kind::Category(names));
    let sheet = compare::Sheet::read(&jobs::write(&sample::experiment(), &rows).unwrap()).unwrap();
    assert!(compare::compare(&sheet, &sheet, 0.0, &[]).same());
}

#[test]
fn a_figure_against_a_figure_is_no_trace() {
    // The rows have a trace of the same name.
    let mut rows = sample::rows();
    for (place, row) in rows.iter_mut().enumerate() {
        row.record.result.metrics.insert("iteration".into(), place as f64);
    }
    let plot = Plot {
        series: vec!["energy".into()],
        ..plot("iteration", "d_ma", false)
    };
    assert!(
        rows.iter()
            .any(|row| row.record.result.traces.contains_key("iteration"))
    );
    let chart = plot::chart(&sample::experiment(), &plot, &rows);
    assert!(
        chart
            .series
            .iter()
            .all(|one| one.points.len() <= 2 && one.phases.is_empty())
    );
    assert!(!chart.series.is_empty());
}

#[test]
fn many_series_share_colours_by_the_first_axis_and_shapes_by_the_others() {
    let mut rows = Vec::new();
    for (row, family) in sample::study().0.iter().take(12).zip([0, 1, 2].repeat(4)) {
        let mut row = row.clone();
        row.axes[0].1 = format!("family {family}").into();
        row.axes[1].1 = (rows.len() / 3).into();
        rows.push(row);
    }
    let plot = Plot {
        series: vec!["family".into(), "seed".into()],
        ..plot("h", "error", true)
    };
    let chart = plot::chart(&sample::experiment(), &plot, &rows);
    assert_eq!(chart.series.len(), 12);
    for (left, right) in chart
        .series
        .iter()
        .flat_map(|left| chart.series.iter().map(move |right| (left, right)))
    {
        let parts = |one: &plot::Series| {
            one.name
                .split_once(", ")
                .map(|(a, b)| (a.to_owned(), b.to_owned()))
                .unwrap()
        };
        assert_eq!(left.look.colour == right.look.colour, parts(left).0 == parts(right).0);
        assert_eq!(left.look.shape == right.look.shape, parts(left).1 == parts(right).1);
    }
    // A number says which axis it is of.
    assert_eq!(chart.series[0].name, "family 0, seed 0");
}

#[test]
fn what_cannot_be_shown_on_a_plot_is_told() {
    let (mut rows, _) = sample::study();
    rows[3].record.result.metrics.insert("error".into(), -1.0);
    rows[4].record.result.metrics.insert("error".into(), f64::NAN);
    rows[5].record.result.metrics.clear();
    rows.truncate(6);
    let chart = plot::chart(&sample::experiment(), &plot("h", "error", true), &rows);
    let notes = chart.notes.join(" ");
    assert!(
        notes.contains("2 points are not shown") && notes.contains("even-2-0"),
        "{notes}"
    );
    let empty = plot::chart(&sample::experiment(), &plot("h", "error", true), &[]);
    assert!(plot::svg::standalone(&empty).is_ok() && plot::bitmap::write(&empty).is_ok());
    assert!(empty.notes.join(" ").contains("nothing to show"));
}

#[test]
fn two_result_sets_side_by_side() {
    let experiment = sample::experiment();
    let left = sample::rows();
    let mut right = sample::rows();
    right.remove(5);
    right[0].record.result.metrics.insert("d_ma".into(), 280.0);
    right[1].record.measurement.wall_seconds = vec![0.5];
    right[3].record.result.stop = "stalled".into();
    let sheet = |rows: &[_]| compare::Sheet::read(&jobs::write(&experiment, rows).unwrap()).unwrap();
    let comparison = compare::compare(&sheet(&left), &sheet(&right), 0.0, &[]);
    assert!(!comparison.same() && comparison.results().count() == 2);
    insta::assert_snapshot!("comparison", compare::describe(&comparison, "before", "after"));
    assert!(compare::compare(&sheet(&left), &sheet(&left), 0.0, &[]).same());
    // 254.9 against 280 is a tenth; the word of the end has no tolerance.
    let near = compare::compare(&sheet(&left), &sheet(&right), 0.2, &[]);
    assert_eq!(near.results().count(), 1);
    let chosen = compare::compare(&sheet(&left), &sheet(&right), 0.0, &["d_ma".to_string()]);
    assert!(chosen.results().all(|difference| difference.column.starts_with("d_ma")) && chosen.results().count() == 1);
    assert!(compare::Sheet::read(b"a,b\n1,2\n").is_err());
}

#[test]
fn columns_stand_side_by_side_for_the_values_across() {
    let experiment = sample::experiment();
    let table = Table {
        rows: vec!["model".into()],
        across: vec!["energy".into()],
        columns: vec!["d_ma".into()],
        published: None,
        ..experiment.tables[0].clone()
    };
    let rows = sample::rows();
    let grid = build(&experiment, &table, &rows);
    let heads: Vec<&str> = grid.head.iter().map(|head| head.text.as_str()).collect();
    assert_eq!(
        heads,
        [
            "model",
            "d_ma, energy dirichlet",
            "d_ma, energy stretch",
            "d_ma, energy lscm"
        ]
    );
    let stretch = rows
        .iter()
        .position(|row| row.axis("energy") == Some(&"stretch".into()));
    let ours = rows[stretch.expect("a job with stretch")].figure("d_ma");
    match grid.body[0][2].content {
        vargeo::report::table::Content::Figure { value, spread, .. } => assert_eq!((Some(value), spread), (ours, None)),
        ref other => panic!("{other:?}"),
    }
}
