//! Turning inverted elements before the barrier takes over, by a falling regularization of the determinant (Garanzha et
//! al. 2021), beside the surface energy that holds the boundary.
//!
//! Success is judged at the quadrature points. Not guaranteed: success.

use super::fit::Fit;
use super::objective::FitObjective;
use crate::energy::mapping::Density;
use crate::energy::untangling::Untangling;
use crate::fem::volume_energy::Evaluation;
use crate::method::Failure;
use crate::optimize::lbfgs::Lbfgs;
use crate::optimize::{Iterate, Observer, StopReason, Stopping};

/// Values of the regularization at most, and iterations with each.
const ROUNDS: usize = 60;
const ITERATIONS: u64 = 60;
/// Weight of the regularized energy beside the surface's.
const LAMBDA: f64 = 0.05;
/// Least share by which the regularized determinant falls from round to round.
const DECREASE: f64 = 0.1;

/// The kind of the failure to untangle.
pub(super) const TANGLED: &str = "tangled";

/// The regularization to start with.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Softness {
    /// For a template that may lie anyhow.
    Full,
    /// For a map that is nearly right: no softer than its least determinant asks for.
    Slight,
}

impl Softness {
    pub(super) fn of(self, least: f64) -> f64 {
        match self {
            Softness::Full => 1.0,
            Softness::Slight => (2.0 * least.abs()).clamp(1e-6, 1.0),
        }
    }
}

/// Passes on the wish to stop, and nothing else.
pub(super) struct Quiet<'a>(pub(super) &'a mut dyn Observer);

impl Observer for Quiet<'_> {
    fn phase(&mut self, _name: &str) {}
    fn iterate(&mut self, _iterate: &Iterate) {}
    fn stop(&self) -> Option<StopReason> {
        self.0.stop()
    }
}

/// What the minimization of the regularized energy came to.
pub(super) struct Round {
    /// The energy before it.
    pub(super) before: f64,
    pub(super) after: Evaluation,
}

/// How turning ended.
pub(super) enum Turned {
    Positive,
    /// With this least determinant.
    Stuck(f64),
    Stopped(StopReason),
}

/// Minimizes with a falling regularization, first with `epsilon`, until the least determinant is positive.
pub(super) fn turn(
    epsilon: f64,
    mut least: f64,
    mut minimize: impl FnMut(Untangling, &mut dyn Observer) -> Result<Round, Failure>,
    observer: &mut dyn Observer,
) -> Result<Turned, Failure> {
    let mut regularization = Untangling { epsilon, lambda: 1.0 };
    for _ in 0..ROUNDS {
        if least > 0.0 {
            return Ok(Turned::Positive);
        }
        let round = minimize(regularization, observer)?;
        if let Some(stop) = observer.stop() {
            return Ok(Turned::Stopped(stop));
        }
        least = round.after.least_determinant;
        // The next epsilon: the least determinant is to look worse by a share.
        let fall = (1.0 - round.after.value / round.before).clamp(DECREASE, 0.9);
        let wanted = (1.0 - fall) * regularization.chi(least);
        let square = 4.0 * wanted * (wanted - least);
        regularization.epsilon = if square > 0.0 {
            square.sqrt().min(0.9 * regularization.epsilon)
        } else {
            0.5 * regularization.epsilon
        };
        if !(regularization.epsilon > 1e-12) {
            break;
        }
    }
    Ok(if least > 0.0 {
        Turned::Positive
    } else {
        Turned::Stuck(least)
    })
}

/// Moves the nodes until all determinants at quadrature points are positive. `Some` when the observer asked to stop.
///
/// # Errors
/// `tangled` when elements stay inverted.
pub(super) fn untangle(
    fit: &mut Fit<'_>,
    softness: Softness,
    observer: &mut dyn Observer,
) -> Result<Option<StopReason>, Failure> {
    observer.phase("untangle");
    let boundary = fit.boundary(&fit.space);
    let mut samples = Vec::new();
    boundary.positions(&fit.x, &mut samples);
    let mut surface = fit.surface_energy(&boundary, &samples)?;
    let least = fit.volume_energy(&fit.space)?.value(&fit.x).least_determinant;
    let turned = turn(
        softness.of(least),
        least,
        |regularization, observer| {
            let volume = fit.volume_energy_of(&fit.space, Density::of(regularization))?;
            let mut objective = FitObjective::new(&volume, &boundary, surface.as_mut(), LAMBDA);
            let lbfgs = Lbfgs {
                stopping: Stopping {
                    gradient_norm: 1e-10,
                    relative_decrement: 0.0,
                    relative_change: 1e-4,
                    iterations: ITERATIONS,
                    ..Stopping::default()
                },
                ..Lbfgs::default()
            };
            let before = volume.value(&fit.x).value;
            let solution = lbfgs.minimize(&mut objective, std::mem::take(&mut fit.x), &mut Quiet(observer));
            fit.x = solution.x;
            fit.count("iterations", solution.counters.iterations);
            fit.count("evaluations", solution.counters.evaluations);
            let after = volume.value(&fit.x);
            Ok(Round { before, after })
        },
        observer,
    )?;
    match turned {
        Turned::Positive => Ok(None),
        Turned::Stopped(stop) => Ok(Some(stop)),
        Turned::Stuck(least) => Err(Failure {
            kind: TANGLED.to_string(),
            reason: format!(
                "elements stay inverted: the least determinant at a quadrature point is {least:.3e} after untangling; use \
                 a better template, more elements, or a larger lambda"
            ),
        }),
    }
}
