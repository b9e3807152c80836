//! How far to go along a direction: backtracking for Newton's method, strong Wolfe for L-BFGS.
//!
//! Every accepted point has a finite value that was computed at that very point; a bound on the step is a help, never
//! trusted alone. A value of infinity or not-a-number counts as a step too long.

use super::Objective;
use super::entries::{combine, dot, norm};

/// Share of the largest safe step that is tried first.
pub const SAFETY: f64 = 0.9;

/// Where the search starts: a point, its value and gradient there, and the direction.
#[derive(Clone, Copy, Debug)]
pub struct Start<'a> {
    pub x: &'a [f64],
    pub value: f64,
    pub gradient: &'a [f64],
    pub direction: &'a [f64],
}

/// An accepted step; the point and, where asked for, its gradient are in the buffers given to the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Length factor.
    pub length: f64,
    pub value: f64,
    /// The gradient buffer holds the gradient at the new point.
    pub has_gradient: bool,
}

/// Backtracking until the energy has decreased enough (Armijo 1966).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Backtracking {
    /// Accepted when `E(x + t p) <= E(x) + decrease t g . p`.
    pub decrease: f64,
    /// Factor between trials.
    pub shrink: f64,
    /// Most trials.
    pub trials: u32,
    /// Accepted only if the gradient's norm does not grow either.
    pub gradient_decrease: bool,
    /// A first trial that lowers the energy almost as the slope promises is doubled as long as that helps: the model of
    /// the Hessian is then much too stiff, as one is that has lost its negative eigenvalues.
    pub grow: bool,
}

/// Share of the slope's promise from which on a longer step is tried. A quadratic keeps half of it at its minimum.
const PROMISING: f64 = 0.75;

impl Default for Backtracking {
    fn default() -> Self {
        Self {
            decrease: 1e-4,
            shrink: 0.5,
            trials: 60,
            gradient_decrease: false,
            grow: false,
        }
    }
}

impl Backtracking {
    /// Looks for an acceptable point from a full step or, if shorter, `SAFETY` of the largest safe step down.
    ///
    /// `point` and `gradient` are overwritten; `evaluations` is raised by every evaluation. `None`: no trial was
    /// acceptable, or the direction does not descend.
    pub fn search(
        &self,
        objective: &mut (impl Objective + ?Sized),
        start: Start<'_>,
        point: &mut [f64],
        gradient: &mut [f64],
        evaluations: &mut u64,
    ) -> Option<Step> {
        let slope = dot(start.gradient, start.direction);
        if slope >= 0.0 || !slope.is_finite() {
            return None;
        }
        let before = norm(start.gradient);
        let mut length = first_length(objective, &start);
        for trial in 0..self.trials {
            advance(&start, length, point);
            *evaluations += 1;
            let value = objective.value(point);
            if value.is_finite() && value <= start.value + self.decrease * length * slope {
                // Below the resolution of the coordinates nothing moves, and the energy cannot tell.
                if point == start.x {
                    return None;
                }
                if !self.gradient_decrease {
                    let mut step = Step {
                        length,
                        value,
                        has_gradient: false,
                    };
                    if self.grow && trial == 0 {
                        step = grow(objective, &start, slope, step, point, evaluations);
                    }
                    return Some(step);
                }
                *evaluations += 1;
                let value = objective.gradient(point, gradient);
                if value.is_finite() && norm(gradient) <= before {
                    return Some(Step {
                        length,
                        value,
                        has_gradient: true,
                    });
                }
            }
            length *= self.shrink;
        }
        None
    }
}

/// Doubles an accepted step while the energy keeps falling almost as the slope promises. `point` is the one returned.
fn grow(
    objective: &mut (impl Objective + ?Sized),
    start: &Start<'_>,
    slope: f64,
    first: Step,
    point: &mut [f64],
    evaluations: &mut u64,
) -> Step {
    let promising = |step: &Step| start.value - step.value >= -PROMISING * step.length * slope;
    if !promising(&first) {
        return first;
    }
    let limit = SAFETY * objective.max_step(start.x, start.direction);
    let mut step = first;
    while promising(&step) && 2.0 * step.length <= limit {
        let length = 2.0 * step.length;
        advance(start, length, point);
        *evaluations += 1;
        let value = objective.value(point);
        if !value.is_finite() || value >= step.value {
            advance(start, step.length, point);
            break;
        }
        step = Step { length, value, ..step };
    }
    step
}

/// Bracketing and zooming until the strong Wolfe conditions hold (Nocedal and Wright 2006, algorithms 3.5 and 3.6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrongWolfe {
    /// `E(x + t p) <= E(x) + decrease t g . p`.
    pub decrease: f64,
    /// `|g(x + t p) . p| <= curvature |g . p|`.
    pub curvature: f64,
    /// Most trials.
    pub trials: u32,
}

impl Default for StrongWolfe {
    fn default() -> Self {
        Self {
            decrease: 1e-4,
            curvature: 0.9,
            trials: 40,
        }
    }
}

/// A trial on the line.
#[derive(Clone, Copy)]
struct Trial {
    length: f64,
    value: f64,
    slope: f64,
}

impl StrongWolfe {
    /// Looks for an acceptable point, trying `length` first.
    ///
    /// When no point meets the curvature condition within the permitted trials, as at the edge of the domain, the best
    /// point with sufficient decrease is taken. `point` and `gradient` then belong to the accepted point.
    pub fn search(
        &self,
        objective: &mut (impl Objective + ?Sized),
        start: Start<'_>,
        length: f64,
        point: &mut [f64],
        gradient: &mut [f64],
        evaluations: &mut u64,
    ) -> Option<Step> {
        let slope = dot(start.gradient, start.direction);
        if slope >= 0.0 || !slope.is_finite() {
            return None;
        }
        let limit = SAFETY * objective.max_step(start.x, start.direction);
        let mut trials = self.trials;
        let mut best: Option<Trial> = None;
        let mut low = Trial {
            length: 0.0,
            value: start.value,
            slope,
        };
        let mut high: Option<Trial> = None;
        let mut next = length.min(limit);
        while trials > 0 {
            trials -= 1;
            advance(&start, next, point);
            *evaluations += 1;
            let value = objective.gradient(point, gradient);
            let trial = Trial {
                length: next,
                value,
                slope: dot(gradient, start.direction),
            };
            let finite = value.is_finite() && trial.slope.is_finite();
            let decreases = finite && value <= start.value + self.decrease * next * slope;
            if decreases && trial.slope.abs() <= -self.curvature * slope {
                return (point != start.x).then_some(Step {
                    length: next,
                    value,
                    has_gradient: true,
                });
            }
            if decreases && best.is_none_or(|best| value < best.value) {
                best = Some(trial);
            }
            if !decreases || value >= low.value {
                high = Some(Trial {
                    value: if finite { value } else { f64::INFINITY },
                    ..trial
                });
            } else {
                let rises = match high {
                    Some(high) => trial.slope * (high.length - low.length) >= 0.0,
                    None => trial.slope >= 0.0,
                };
                if rises {
                    high = Some(low);
                }
                low = trial;
                if high.is_none() && low.length >= limit {
                    break;
                }
            }
            next = match high {
                None => (4.0 * low.length).min(limit),
                Some(high) => between(low, high),
            };
            if let Some(high) = high
                && (high.length - low.length).abs() <= 1e-14 * high.length.max(low.length)
            {
                break;
            }
        }
        let best = best?;
        advance(&start, best.length, point);
        *evaluations += 1;
        let value = objective.gradient(point, gradient);
        (value.is_finite() && point != start.x).then_some(Step {
            length: best.length,
            value,
            has_gradient: true,
        })
    }
}

/// The minimum of the parabola through the low end's value and slope and the high end's value, kept off the ends; halfway
/// where there is no finite value at the high end.
fn between(low: Trial, high: Trial) -> f64 {
    let width = high.length - low.length;
    let bend = high.value - low.value - low.slope * width;
    let share = if bend.is_finite() && bend > 0.0 {
        -low.slope * width / (2.0 * bend)
    } else {
        0.5
    };
    low.length + width * share.clamp(0.1, 0.9)
}

fn first_length(objective: &mut (impl Objective + ?Sized), start: &Start<'_>) -> f64 {
    (SAFETY * objective.max_step(start.x, start.direction)).min(1.0)
}

fn advance(start: &Start<'_>, length: f64, point: &mut [f64]) {
    combine(start.x, length, start.direction, point);
}
