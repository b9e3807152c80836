//! The gate: every kind of condition, met and failed, and JUnit of it.

use crate::sample::{self, condition};
use serde_json::json;
use std::collections::BTreeMap;
use vargeo::experiment::file::{Bound, Comparison, Condition, Expectation, Experiment};
use vargeo::report::gate::{self, Outcome, Verdict, holds};
use vargeo::report::{junit, rate};

fn expectation(condition: Condition) -> Expectation {
    Expectation {
        condition,
        stop: None,
        bounds: BTreeMap::new(),
        comparisons: Vec::new(),
        line: 7,
    }
}

fn judge(change: impl FnOnce(&mut Expectation)) -> Vec<Verdict> {
    let mut one = expectation(condition(&[("model", &[json!("ball")])]));
    change(&mut one);
    let experiment = Experiment {
        expectations: vec![one],
        ..sample::experiment()
    };
    gate::judge(&experiment, &sample::rows(), &[])
}

fn outcomes(verdicts: &[Verdict]) -> Vec<(&str, Outcome)> {
    verdicts
        .iter()
        .map(|verdict| (verdict.subject.as_str(), verdict.outcome))
        .collect()
}

#[test]
fn bounds_hold_at_their_ends() {
    let bound = |min, max, equals, tolerance| Bound {
        min,
        max,
        equals,
        tolerance,
    };
    assert!(holds(&bound(Some(1.0), Some(2.0), None, None), 1.0));
    assert!(holds(&bound(Some(1.0), Some(2.0), None, None), 2.0));
    assert!(!holds(&bound(Some(1.0), Some(2.0), None, None), 2.1));
    assert!(holds(&bound(None, None, Some(-10.0), Some(0.1)), -11.0));
    assert!(!holds(&bound(None, None, Some(-10.0), None), -10.000_001));
    assert!(!holds(&bound(Some(f64::NEG_INFINITY), None, None, None), f64::NAN));
    assert!(!holds(&bound(None, Some(9.0), None, None), f64::INFINITY));
}

#[test]
fn figures_are_held_against_bounds_in_every_job() {
    let verdicts = judge(|one| {
        one.bounds.insert(
            "d_ma".into(),
            Bound {
                max: Some(20.0),
                ..Bound::default()
            },
        );
    });
    assert_eq!(
        outcomes(&verdicts),
        [
            ("ball-dirichlet", Outcome::Failed),
            ("ball-stretch", Outcome::Met),
            ("ball-lscm", Outcome::Failed)
        ]
    );
    assert_eq!(verdicts[0].found, "273.7");
    assert_eq!(verdicts[0].expected, "d_ma at most 20");
    assert_eq!(verdicts[0].place, "line 7");
    assert!(
        verdicts[2].found.contains("time-limit: stopped after 600 s"),
        "a job without figure fails with its reason"
    );
}

#[test]
fn stops_can_be_expected_of_failed_jobs() {
    let verdicts = judge(|one| {
        one.condition = condition(&[("energy", &[json!("lscm")])]);
        one.stop = Some("time-limit".into());
    });
    assert_eq!(
        outcomes(&verdicts),
        [("ball-lscm", Outcome::Met), ("duck-lscm", Outcome::Failed)]
    );
}

#[test]
fn comparisons_take_the_job_that_differs_in_the_given_axes_only() {
    let below = |energy: &str, factor| Comparison {
        metric: "d_ma".into(),
        other: condition(&[("energy", &[json!(energy)])]),
        factor,
    };
    let verdicts = judge(|one| {
        one.condition = condition(&[("energy", &[json!("stretch")])]);
        one.comparisons = vec![below("dirichlet", 1.0), below("dirichlet", 0.01)];
    });
    assert_eq!(
        outcomes(&verdicts),
        [
            ("ball-stretch", Outcome::Met),
            ("ball-stretch", Outcome::Failed),
            ("duck-stretch", Outcome::Met),
            ("duck-stretch", Outcome::Failed),
            ("horse-stretch", Outcome::Skipped),
            ("horse-stretch", Outcome::Skipped),
        ]
    );
    assert!(verdicts[0].expected.contains("of ball-dirichlet") && verdicts[2].expected.contains("of duck-dirichlet"));
    let none = judge(|one| one.comparisons = vec![below("hencky", 1.0)]);
    assert!(none.iter().all(|verdict| verdict.outcome == Outcome::Failed));
}

#[test]
fn an_expectation_that_matches_no_job_fails() {
    let verdicts = judge(|one| one.condition = condition(&[("energy", &[json!("strech")])]));
    assert_eq!(outcomes(&verdicts), [("", Outcome::Failed)]);
    assert!(!gate::passes(&verdicts));
    assert!(verdicts[0].expected.contains("energy = strech"));
}

#[test]
fn missing_optional_models_open_the_gate() {
    let verdicts = judge(|one| {
        one.condition = condition(&[("model", &[json!("horse")])]);
        one.bounds.insert(
            "inverted".into(),
            Bound {
                equals: Some(0.0),
                ..Bound::default()
            },
        );
    });
    assert_eq!(outcomes(&verdicts), [("horse-stretch", Outcome::Skipped)]);
    assert!(gate::passes(&verdicts));
}

#[test]
fn numbers_of_axes_match_by_value() {
    let (rows, _) = sample::study();
    assert!(rows[0].matches(&condition(&[("seed", &[json!(1.0)])])));
    assert!(!rows[0].matches(&condition(&[("seed", &[json!(2), json!(3)])])));
    assert!(
        rows[0].matches(&condition(&[("solver.newton.omega", &[json!(100_000_000)])])),
        "a setting held fixed"
    );
    assert!(!rows[0].matches(&condition(&[("solver.newton.relaxation", &[json!(true)])])));
}

#[test]
fn rates_are_gated() {
    let (rows, expected) = sample::study();
    let experiment = Experiment {
        rates: vec![expected],
        expectations: Vec::new(),
        ..sample::experiment()
    };
    let verdicts = gate::judge(&experiment, &rows, &rate::fits(&experiment, &rows));
    assert_eq!(
        outcomes(&verdicts),
        [("even", Outcome::Met), ("random", Outcome::Failed)]
    );
    let empty = gate::judge(&experiment, &[], &[]);
    assert_eq!(outcomes(&empty), [("", Outcome::Failed)]);
}

#[test]
fn junit_names_what_failed() {
    let experiment = sample::experiment();
    let rows = sample::rows();
    let verdicts = gate::judge(&experiment, &rows, &[]);
    let mut document = junit::Document::new(&experiment.name);
    document.add(&experiment.name, &rows, &verdicts);
    let xml = document.write().unwrap();
    assert!(xml.contains("tests=\"7\"") && xml.contains("errors=\"1\""), "{xml}");
    assert!(xml.contains("time-limit: stopped after 600 s"));
    assert!(xml.contains("classname=\"sample line 12\""));
    assert!(xml.contains("time=\"1.500\""));
}
