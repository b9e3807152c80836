//! L-BFGS with hard constraints: no Hessian, little memory, many cheap iterations.
//!
//! Guaranteed: the energy never increases; no tetrahedron is inverted if none was and the energy or its barrier forbids
//! it. Not guaranteed: a global minimum.

use super::objective::MapObjective;
use super::settings::Settings;
use super::trace::{Recorder, Trace};
use crate::optimize::lbfgs::Lbfgs;
use crate::optimize::{Observer, Solution, Stopping};

/// Minimizes over the free vertices from `start`.
pub fn minimize(
    objective: &mut MapObjective,
    settings: &Settings,
    start: &[[f64; 3]],
    observer: &mut dyn Observer,
    trace: &mut Trace,
) -> Solution {
    let lbfgs = Lbfgs {
        stopping: Stopping {
            gradient_norm: settings.gradient_tolerance,
            relative_decrement: settings.energy_tolerance,
            relative_change: settings.change_tolerance,
            iterations: settings.iteration_limit,
            ..Stopping::default()
        },
        memory: usize::try_from(settings.l_bfgs.memory).unwrap_or(usize::MAX),
        ..Lbfgs::default()
    };
    let x = objective.unknowns(start);
    let mut recorder = Recorder {
        latest: objective.latest(),
        observer,
        trace,
    };
    lbfgs.minimize(objective, x, &mut recorder)
}
