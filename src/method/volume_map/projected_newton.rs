//! Projected Newton with hard constraints: the boundary stands on its target, the interior moves.
//!
//! The negative eigenvalues of every tetrahedron's Hessian are known (Smith, de Goes, Kim 2019). By default as large a
//! share of them is kept as leaves the whole positive definite: all of them near a minimum, where convergence is then
//! quadratic, none where that fails. The first step tried is at most 0.9 of the largest that inverts no tetrahedron
//! (Smith, Schaefer 2015), then halved until the energy has decreased enough, or doubled while that pays.
//!
//! Guaranteed: the energy never increases; no tetrahedron is inverted if none was and the energy or its barrier forbids
//! it. Not guaranteed: a global minimum.

use super::objective::MapObjective;
use super::settings::Settings;
use super::trace::{Recorder, Trace};
use crate::optimize::line_search::Backtracking;
use crate::optimize::newton::Newton;
use crate::optimize::{Observer, Solution, Stopping};

/// Minimizes over the free vertices from `start`.
pub fn minimize(
    objective: &mut MapObjective,
    settings: &Settings,
    start: &[[f64; 3]],
    observer: &mut dyn Observer,
    trace: &mut Trace,
) -> Solution {
    let newton = Newton {
        stopping: Stopping {
            gradient_norm: settings.gradient_tolerance,
            relative_decrement: settings.energy_tolerance,
            relative_change: settings.change_tolerance,
            iterations: settings.iteration_limit,
            ..Stopping::default()
        },
        line_search: Backtracking {
            grow: true,
            ..Backtracking::default()
        },
    };
    let x = objective.unknowns(start);
    let mut recorder = Recorder {
        latest: objective.latest(),
        observer,
        trace,
    };
    newton.minimize(objective, x, &mut recorder)
}
