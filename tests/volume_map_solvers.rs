//! The solvers of volumetric maps: why they stop, what they do where the energy gives no direction, the same bits.

use crate::sample::with_threads;
use crate::volume_map::{close, map, metric, onto_cube, twisted_grid};
use serde_json::{Value, json};
use std::cell::Cell;
use vargeo::method::Outcome;
use vargeo::optimize::{Iterate, Observer, Silent, StopReason};

#[test]
fn same_bits_with_any_number_of_threads() {
    let run = |threads: usize, chosen: Value| {
        with_threads(threads, || map(twisted_grid(6), chosen, &mut Silent).expect("a map"))
    };
    for chosen in [
        json!({ "energy": "stretch" }),
        json!({ "energy": "arap", "solver": "l-bfgs", "iteration_limit": 30 }),
        json!({ "energy": "stretch", "preset": "paper", "iteration_limit": 20 }),
        json!({ "energy": "arap", "preset": "paper", "solver": "locally-injective", "iteration_limit": 10 }),
    ] {
        let one = run(1, chosen.clone());
        for threads in [2, 4] {
            let other = run(threads, chosen.clone());
            assert!(
                one.mesh == other.mesh,
                "{chosen}: the mesh differs with {threads} threads"
            );
            let bits = |outcome: &Outcome| -> Vec<u64> {
                let values = outcome.metrics.values().chain(outcome.traces.values().flatten());
                values.map(|value| value.to_bits()).collect()
            };
            assert!(
                bits(&one) == bits(&other),
                "{chosen}: figures differ with {threads} threads"
            );
            assert_eq!(one.counters, other.counters, "{chosen}");
        }
    }
}

/// Asks to stop after a number of iterates.
struct Impatient {
    left: Cell<u64>,
    stop: StopReason,
}

impl Observer for Impatient {
    fn phase(&mut self, _name: &str) {}
    fn iterate(&mut self, _iterate: &Iterate) {
        self.left.set(self.left.get().saturating_sub(1));
    }
    fn stop(&self) -> Option<StopReason> {
        (self.left.get() == 0).then_some(self.stop)
    }
}

#[test]
fn every_solver_tells_why_it_stopped() {
    for solver in ["projected-newton", "relaxed-newton", "locally-injective", "l-bfgs"] {
        let chosen = |iterations: u64| json!({ "energy": "stretch", "solver": solver, "iteration_limit": iterations });
        let limited = map(twisted_grid(4), chosen(2), &mut Silent).expect("a map");
        assert_eq!(limited.stop, "step-limit", "{solver}: {}", limited.reason);
        assert_eq!(limited.counters["iterations"], 2);
        assert_eq!(metric(&limited, "inverted"), 0.0, "{solver}");
        let rows = limited.traces["iteration"].len();
        assert!(
            rows == 3 && limited.traces.values().all(|column| column.len() == rows),
            "{solver}: {rows} rows"
        );
        for (stop, word) in [
            (StopReason::TimeLimit, "time-limit"),
            (StopReason::Cancelled, "cancelled"),
        ] {
            let mut impatient = Impatient {
                left: Cell::new(1),
                stop,
            };
            let stopped = map(twisted_grid(4), chosen(500), &mut impatient).expect("a map");
            assert_eq!(stopped.stop, word, "{solver}: {}", stopped.reason);
            assert!(stopped.mesh.is_some());
        }
    }
    // Quasi-Newton with a criterion beyond the reach of rounding runs until nothing moves.
    let stuck =
        json!({ "energy": "arap", "gradient_tolerance": 0.0, "energy_tolerance": 0.0, "iteration_limit": 100_000 });
    let stalled = map(twisted_grid(4), stuck, &mut Silent).expect("a map");
    assert_eq!(stalled.stop, "stalled", "{}", stalled.reason);
}

/// LPM has no stiffness at all where the map shrinks every length below 1/sqrt 3: the positive part of its Hessian is
/// zero.
#[test]
fn a_hessian_without_any_positive_part_still_gives_a_descent() {
    for solver in ["projected-newton", "relaxed-newton"] {
        let ball = onto_cube("ball", json!({ "tetrahedra": 96, "radius": 2.0 }), json!({}));
        let chosen = json!({
            "energy": "lpm", "solver": solver, "barrier": "none", "rescale": false, "iteration_limit": 50,
            "projected-newton": { "hessian": "projected" },
        });
        let outcome = map(ball, chosen, &mut Silent).expect("a map");
        assert_ne!(outcome.stop, "not-finite", "{solver}: {}", outcome.reason);
        let energies = &outcome.traces["energy"];
        assert!(energies.last() < energies.first(), "{solver}: {energies:?}");
    }
}

/// MIPS comes first where the exponential of AMIPS is far beyond use on a start that is valid.
#[test]
fn an_energy_beyond_measure_is_approached() {
    let bumpy = onto_cube(
        "bumpy",
        json!({ "tetrahedra": 4_000, "amplitude": 0.3, "twist": 300.0 }),
        json!({ "swirl": 1.8 }),
    );
    let chosen = json!({ "energy": "amips", "iteration_limit": 20 });
    let outcome = map(bumpy, chosen, &mut Silent).expect("a map");
    assert!(outcome.counters["approach_iterations"] > 0);
    assert_ne!(outcome.stop, "not-finite", "{}", outcome.reason);
    assert!(metric(&outcome, "inverted") == 0.0 && metric(&outcome, "energy").is_finite());
}

/// On this body the gradient criterion stalls and relaxation gets the solver going again.
#[test]
fn relaxation_saves_iterations() {
    let solve = |relaxation: bool| {
        let bumpy = onto_cube(
            "bumpy",
            json!({ "tetrahedra": 1500 }),
            json!({ "swirl": 1.0, "warp": 0.12 }),
        );
        let chosen = json!({ "preset": "paper", "energy": "lpm", "relaxed-newton": { "relaxation": relaxation } });
        map(bumpy, chosen, &mut Silent).expect("a map")
    };
    let (with, without) = (solve(true), solve(false));
    for outcome in [&with, &without] {
        assert_eq!(outcome.stop, "converged", "{}", outcome.reason);
    }
    assert!(with.counters["relaxations"] > 0 && with.counters["relaxation_iterations"] > 0);
    assert_eq!(without.counters["relaxations"], 0);
    assert!(
        with.counters["iterations"] < without.counters["iterations"],
        "{:?} {:?}",
        with.counters,
        without.counters
    );
    close("energy", metric(&with, "energy"), metric(&without, "energy"), 1e-3);
}
