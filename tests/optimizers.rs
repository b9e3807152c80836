//! Minimizers on functions with known minima: every stop reason, and an energy that never increases.

use vargeo::optimize::lbfgs::Lbfgs;
use vargeo::optimize::line_search::{Backtracking, Start, StrongWolfe};
use vargeo::optimize::newton::Newton;
use vargeo::optimize::{
    Iterate, Minimizer, NewtonObjective, NoDirection, Objective, Observer, Silent, Solution, StopReason, Stopping,
    minimizers,
};

/// A smooth function of a few unknowns by closures; the Hessian's eigenvalues are made positive.
struct Function {
    dimension: usize,
    value: fn(&[f64]) -> f64,
    gradient: fn(&[f64]) -> Vec<f64>,
    hessian: fn(&[f64]) -> Vec<f64>,
    max_step: fn(&[f64], &[f64]) -> f64,
}

impl Objective for Function {
    fn dimension(&self) -> usize {
        self.dimension
    }
    fn value(&mut self, x: &[f64]) -> f64 {
        (self.value)(x)
    }
    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        gradient.copy_from_slice(&(self.gradient)(x));
        (self.value)(x)
    }
    fn max_step(&mut self, x: &[f64], direction: &[f64]) -> f64 {
        (self.max_step)(x, direction)
    }
}

impl NewtonObjective for Function {
    fn newton_direction(&mut self, x: &[f64], gradient: &mut [f64], direction: &mut [f64]) -> Result<f64, NoDirection> {
        let value = self.gradient(x, gradient);
        if !value.is_finite() {
            return Err(NoDirection::NotFinite);
        }
        let n = self.dimension;
        let mut eigen = nalgebra::DMatrix::from_row_slice(n, n, &(self.hessian)(x)).symmetric_eigen();
        eigen.eigenvalues.apply(|value| *value = value.abs().max(1e-8));
        let positive = eigen.recompose().cholesky().expect("positive by construction");
        let step = positive.solve(&nalgebra::DVector::from_column_slice(gradient));
        direction.copy_from_slice((-step).as_slice());
        Ok(value)
    }
}

const FREE: fn(&[f64], &[f64]) -> f64 = |_, _| f64::INFINITY;

/// Minimum 0 at (1, 1), along a curved valley.
fn rosenbrock() -> Function {
    Function {
        dimension: 2,
        value: |x| (1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2),
        gradient: |x| {
            let valley = x[1] - x[0] * x[0];
            vec![-2.0 * (1.0 - x[0]) - 400.0 * x[0] * valley, 200.0 * valley]
        },
        hessian: |x| {
            vec![
                2.0 - 400.0 * x[1] + 1200.0 * x[0] * x[0],
                -400.0 * x[0],
                -400.0 * x[0],
                200.0,
            ]
        },
        max_step: FREE,
    }
}

/// x - ln x summed over coordinates with weights, infinite where a coordinate is not positive: minimum at the weights.
fn barrier(max_step: fn(&[f64], &[f64]) -> f64) -> Function {
    const WEIGHTS: [f64; 3] = [1.0, 1e-3, 50.0];
    Function {
        dimension: 3,
        value: |x| {
            if x.iter().all(|&x| x > 0.0) {
                x.iter().zip(WEIGHTS).map(|(x, w)| x - w * x.ln()).sum()
            } else {
                f64::INFINITY
            }
        },
        gradient: |x| x.iter().zip(WEIGHTS).map(|(x, w)| 1.0 - w / x).collect(),
        hessian: |x| {
            let mut hessian = vec![0.0; 9];
            for i in 0..3 {
                hessian[4 * i] = WEIGHTS[i] / (x[i] * x[i]);
            }
            hessian
        },
        max_step,
    }
}

/// Hears every iterate and asks to stop after some.
struct Recorder {
    iterates: Vec<Iterate>,
    stop_after: usize,
    reason: StopReason,
}

impl Recorder {
    fn new() -> Self {
        Self {
            iterates: Vec::new(),
            stop_after: usize::MAX,
            reason: StopReason::Cancelled,
        }
    }
}

impl Observer for Recorder {
    fn phase(&mut self, _name: &str) {}
    fn iterate(&mut self, iterate: &Iterate) {
        self.iterates.push(*iterate);
    }
    fn stop(&self) -> Option<StopReason> {
        (self.iterates.len() >= self.stop_after).then_some(self.reason)
    }
}

fn with(minimizer: Minimizer, stopping: Stopping) -> Minimizer {
    match minimizer {
        Minimizer::Newton(newton) => Minimizer::Newton(Newton { stopping, ..newton }),
        Minimizer::Lbfgs(lbfgs) => Minimizer::Lbfgs(Lbfgs { stopping, ..lbfgs }),
    }
}

const EXACT: Stopping = Stopping {
    gradient_norm: 1e-9,
    relative_decrement: 0.0,
    relative_change: 0.0,
    absolute_change: 0.0,
    iterations: 500,
};

/// Every minimizer on a function, with what must hold of any run.
fn run(minimizer: Minimizer, mut function: Function, start: &[f64]) -> Solution {
    let mut recorder = Recorder::new();
    let solution = with(minimizer, EXACT).minimize(&mut function, start.to_vec(), &mut recorder);
    let iterates = &recorder.iterates;
    assert_eq!(
        iterates.len() as u64,
        solution.counters.iterations + 1,
        "the start and every accepted iterate are told"
    );
    for (index, iterate) in iterates.iter().enumerate() {
        assert_eq!(iterate.iteration, index as u64);
        assert!(iterate.energy.is_finite());
    }
    assert!(
        iterates.windows(2).all(|pair| pair[1].energy <= pair[0].energy),
        "the energy never increases"
    );
    assert_eq!(solution.value, function.value(&solution.x));
    assert!(solution.counters.evaluations >= solution.counters.iterations);
    solution
}

#[test]
fn known_minima_are_found() {
    let flip = |x: &[f64], d: &[f64]| {
        x.iter()
            .zip(d)
            .map(|(x, d)| if *d < 0.0 { -x / d } else { f64::INFINITY })
            .fold(f64::INFINITY, f64::min)
    };
    for minimizer in minimizers() {
        let solution = run(minimizer, rosenbrock(), &[-1.2, 1.0]);
        assert_eq!(solution.stop, StopReason::Converged, "{}", minimizer.name());
        assert!(solution.x.iter().all(|x| (x - 1.0).abs() < 1e-7), "{:?}", solution.x);
        // With the exact bound on the step, without one, and with one that is far too generous.
        for bound in [flip, FREE, |_: &[f64], _: &[f64]| 1e9] {
            let solution = run(minimizer, barrier(bound), &[3.0, 2.0, 1.0]);
            assert_eq!(
                solution.stop,
                StopReason::Converged,
                "{} {}",
                minimizer.name(),
                solution.reason
            );
            for (x, expected) in solution.x.iter().zip([1.0, 1e-3, 50.0]) {
                assert!((x - expected).abs() < 1e-5 * expected, "{:?}", solution.x);
            }
        }
    }
}

#[test]
fn newton_solves_a_quadratic_in_one_step_and_converges_quadratically() {
    let quadratic = Function {
        dimension: 2,
        value: |x| 0.5 * (3.0 * x[0] * x[0] + 2.0 * x[0] * x[1] + x[1] * x[1]) - x[0],
        gradient: |x| vec![3.0 * x[0] + x[1] - 1.0, x[0] + x[1]],
        hessian: |_| vec![3.0, 1.0, 1.0, 1.0],
        max_step: FREE,
    };
    let solution = run(Minimizer::Newton(Newton::default()), quadratic, &[10.0, -7.0]);
    assert_eq!(solution.counters.iterations, 1);
    assert!((solution.x[0] - 0.5).abs() < 1e-12 && (solution.x[1] + 0.5).abs() < 1e-12);
    let mut recorder = Recorder::new();
    Newton {
        stopping: EXACT,
        ..Newton::default()
    }
    .minimize(&mut rosenbrock(), vec![1.2, 1.2], &mut recorder);
    let last: Vec<f64> = recorder
        .iterates
        .iter()
        .rev()
        .take(2)
        .map(|iterate| iterate.gradient_norm)
        .collect();
    assert!(last[0] < 1e-2 * last[1].powf(1.5), "{last:?}");
}

#[test]
fn every_stop_reason_is_given() {
    for minimizer in minimizers() {
        let start = || vec![-1.2, 1.0];
        let stop = |stopping| {
            with(minimizer, stopping)
                .minimize(&mut rosenbrock(), start(), &mut Silent)
                .stop
        };
        assert_eq!(stop(Stopping { iterations: 3, ..EXACT }), StopReason::StepLimit);
        assert_eq!(
            stop(Stopping {
                gradient_norm: 1e3,
                ..EXACT
            }),
            StopReason::Converged
        );
        // Each criterion alone stops, earlier than the gradient would.
        let off = Stopping {
            gradient_norm: 0.0,
            ..EXACT
        };
        for stopping in [
            Stopping {
                relative_change: 0.5,
                ..off
            },
            Stopping {
                absolute_change: 1.0,
                ..off
            },
            Stopping {
                relative_decrement: 0.9,
                ..off
            },
        ] {
            let solution = with(minimizer, stopping).minimize(&mut rosenbrock(), start(), &mut Silent);
            assert_eq!(solution.stop, StopReason::Converged, "{}", solution.reason);
            assert!(solution.gradient_norm > 1e-9);
        }
        for reason in [StopReason::Cancelled, StopReason::TimeLimit] {
            let mut recorder = Recorder {
                stop_after: 3,
                reason,
                ..Recorder::new()
            };
            let solution = with(minimizer, EXACT).minimize(&mut rosenbrock(), start(), &mut recorder);
            assert_eq!((solution.stop, solution.counters.iterations), (reason, 2));
        }
        let outside = with(minimizer, EXACT).minimize(&mut barrier(FREE), vec![1.0, -1.0, 1.0], &mut Silent);
        assert_eq!(outside.stop, StopReason::NotFinite);
        // A gradient that points the wrong way: no step lowers the value.
        let mut lie = Function {
            gradient: |x| vec![-2.0 * x[0], -2.0 * x[1]],
            value: |x| x[0] * x[0] + x[1] * x[1],
            ..rosenbrock()
        };
        let solution = with(minimizer, EXACT).minimize(&mut lie, vec![1.0, 1.0], &mut Silent);
        assert_eq!((solution.stop, solution.counters.iterations), (StopReason::Stalled, 0));
        assert_eq!(solution.x, [1.0, 1.0]);
        // Already at the minimum.
        let solution = with(minimizer, EXACT).minimize(&mut rosenbrock(), vec![1.0, 1.0], &mut Silent);
        assert_eq!(
            (solution.stop, solution.counters.iterations),
            (StopReason::Converged, 0)
        );
    }
}

/// Steps cut short to a thousandth lower the value by less than a hundredth each, far from the minimum.
#[test]
fn a_step_cut_short_is_no_convergence() {
    let mut short = Function {
        max_step: |_, _| 1e-3,
        ..rosenbrock()
    };
    let newton = Newton {
        stopping: Stopping {
            relative_change: 0.01,
            iterations: 20,
            ..EXACT
        },
        ..Newton::default()
    };
    let solution = newton.minimize(&mut short, vec![-1.2, 1.0], &mut Silent);
    assert_eq!(
        (solution.stop, solution.counters.iterations),
        (StopReason::StepLimit, 20)
    );
}

/// A Hessian that is sixteen times too stiff costs one iteration where steps may grow, and dozens where they may not.
#[test]
fn steps_grow_where_the_model_is_too_stiff() {
    let iterations = |grow: bool| {
        let mut stiff = Function {
            dimension: 1,
            value: |x| x[0] * x[0],
            gradient: |x| vec![2.0 * x[0]],
            hessian: |_| vec![32.0],
            max_step: FREE,
        };
        let newton = Newton {
            stopping: EXACT,
            line_search: Backtracking {
                grow,
                ..Backtracking::default()
            },
        };
        let solution = newton.minimize(&mut stiff, vec![1.0], &mut Silent);
        assert_eq!(solution.stop, StopReason::Converged);
        solution.counters.iterations
    };
    assert!(
        iterations(true) <= 4 && iterations(false) > 100,
        "{} {}",
        iterations(true),
        iterations(false)
    );
}

#[test]
fn line_searches_keep_their_conditions() {
    let mut function = rosenbrock();
    let x = [-1.2, 1.0];
    let mut gradient = vec![0.0; 2];
    let value = function.gradient(&x, &mut gradient);
    let direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let start = Start {
        x: &x,
        value,
        gradient: &gradient,
        direction: &direction,
    };
    let slope: f64 = -gradient.iter().map(|g| g * g).sum::<f64>();
    let (mut point, mut ahead, mut evaluations) = (vec![0.0; 2], vec![0.0; 2], 0);
    let search = Backtracking {
        gradient_decrease: true,
        ..Backtracking::default()
    };
    let step = search
        .search(&mut function, start, &mut point, &mut ahead, &mut evaluations)
        .expect("a descent");
    assert!(step.has_gradient && ahead.iter().map(|g| g * g).sum::<f64>() <= -slope);
    assert!(step.value <= value + 1e-4 * step.length * slope);
    for first in [1e-6, 1.0, 1e3] {
        let wolfe = StrongWolfe {
            curvature: 0.1,
            ..StrongWolfe::default()
        };
        let step = wolfe
            .search(&mut function, start, first, &mut point, &mut ahead, &mut evaluations)
            .expect("a descent");
        let ahead_slope: f64 = ahead.iter().zip(&direction).map(|(g, d)| g * d).sum();
        assert!(step.value <= value + 1e-4 * step.length * slope && ahead_slope.abs() <= -0.1 * slope);
    }
    // Uphill there is no step.
    let uphill = Start {
        direction: &gradient,
        ..start
    };
    assert!(
        search
            .search(&mut function, uphill, &mut point, &mut ahead, &mut evaluations)
            .is_none()
    );
    assert!(
        StrongWolfe::default()
            .search(&mut function, uphill, 1.0, &mut point, &mut ahead, &mut evaluations)
            .is_none()
    );
}
