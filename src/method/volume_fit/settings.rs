//! The settings of a volume fit in the typed form that it reads.

use super::fields::FIELDS;
use crate::energy;
use crate::fem::basis;
use crate::fem::quadrature::{RULES, Rule};
use crate::fem::space::HIGHEST_ORDER;
use crate::method::Failure;
use crate::method::setting::fill;
use serde_json::Value;

/// A stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    pub lambda: f64,
    pub order: usize,
    pub iterations: u64,
    /// Share of its change in an iteration below which the energy has converged.
    pub tolerance: f64,
}

/// Which terms the surface energy has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Terms {
    pub to_target: bool,
    pub from_target: bool,
}

/// The typed settings.
#[derive(Clone)]
pub struct Settings {
    pub stages: Vec<Stage>,
    pub order: usize,
    pub adaptive: Option<Adaptive>,
    pub energy: &'static dyn energy::Energy,
    pub basis: &'static dyn basis::Basis,
    pub rule: Rule,
    pub points: Option<usize>,
    pub samples: Option<usize>,
    pub anisotropy: f64,
    pub terms: Terms,
    pub preconditioned: bool,
    pub memory: usize,
    pub refresh: u64,
    pub gradient_tolerance: f64,
    /// Tolerance of stages before the last.
    pub coarse_tolerance: f64,
    pub untangle: bool,
    pub repairs: usize,
    pub levels: usize,
    pub crease_angle: f64,
    /// Nothing when the file leaves it open.
    pub files: Option<Vec<String>>,
}

/// What chooses the elements whose orders are raised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Indicator {
    Distance,
    Energy,
}

/// Raising single orders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptive {
    pub indicator: Indicator,
    pub share: f64,
    pub steps: usize,
    pub most: usize,
}

fn invalid(reason: String) -> Failure {
    Failure::invalid(format!("settings of volume-fit: {reason}"))
}

/// What the presets choose: field, best, paper.
fn presets() -> [(&'static str, Value, Value); 7] {
    [
        ("basis", "integrated-legendre".into(), "integrated-fourier".into()),
        ("quadrature", "lobatto".into(), "trapezoid".into()),
        ("solver", "preconditioned-l-bfgs".into(), "l-bfgs".into()),
        ("lambda_far", 5.0.into(), 50.0.into()),
        ("change_tolerance", 1e-5.into(), 0.0.into()),
        ("coarse_tolerance", 0.0.into(), 0.0.into()),
        ("repairs", 10.into(), 0.into()),
    ]
}

/// The settings with what the preset chooses in its place, and without those that another switches off.
pub fn canonical(settings: &Value) -> Value {
    let mut table = fill(FIELDS, settings);
    let paper = table.remove("preset").is_some_and(|preset| preset == "paper");
    for (name, best, printed) in presets() {
        table.entry(name).or_insert(if paper { printed } else { best });
    }
    if table.get("adaptive") == Some(&Value::from(false)) {
        table.retain(|name, _| !name.starts_with("adaptive_"));
    }
    Value::Object(table)
}

/// Those of these fields that differ from what they are when the file leaves them open.
pub fn given<'a>(settings: &Value, fields: &[&'a str]) -> Vec<&'a str> {
    let [own, usual] = [settings, &Value::Null].map(canonical);
    let differs = |field: &&&str| own.get(**field).is_some_and(|value| Some(value) != usual.get(**field));
    fields.iter().filter(differs).copied().collect()
}

impl Settings {
    /// Reads validated settings.
    ///
    /// # Errors
    /// A value that the declaration does not allow, or a schedule that lowers the order.
    pub fn resolve(settings: &Value) -> Result<Settings, Failure> {
        let settings = &canonical(settings);
        let text = |name: &str| settings.get(name).and_then(Value::as_str).unwrap_or_default();
        let number = |name: &str| settings.get(name).and_then(Value::as_f64).unwrap_or_default();
        let flag = |name: &str| settings.get(name).and_then(Value::as_bool).unwrap_or_default();
        // Absent where the word is "auto".
        let whole = |name: &str| settings.get(name).and_then(Value::as_u64).map(|value| value as usize);
        let order = number("order") as usize;
        let limit = number("iteration_limit") as u64;
        let tolerance = number("change_tolerance");
        let coarse_tolerance = tolerance.max(number("coarse_tolerance"));
        let mut stages = Vec::new();
        match settings.get("schedule").and_then(Value::as_array) {
            Some(list) => {
                for (index, stage) in list.iter().enumerate() {
                    let lambda = stage.get("lambda").and_then(Value::as_f64);
                    let order = stage.get("order").and_then(Value::as_u64);
                    let (Some(lambda), Some(order)) = (lambda, order) else {
                        return Err(invalid(format!("stage {index} of the schedule needs lambda and order")));
                    };
                    stages.push(Stage {
                        lambda,
                        order: order as usize,
                        iterations: stage.get("iterations").and_then(Value::as_u64).unwrap_or(limit),
                        tolerance,
                    });
                }
            }
            None => {
                stages = default_schedule(
                    order,
                    text("raise"),
                    (number("lambda_far"), number("far_steps") as usize),
                    number("lambda"),
                    limit,
                    tolerance,
                    flag("adaptive"),
                )
            }
        }
        let last = stages.len().saturating_sub(1);
        for stage in &mut stages[..last] {
            stage.tolerance = coarse_tolerance;
        }
        if stages.is_empty() {
            return Err(invalid("the schedule has no stage; give at least one".to_string()));
        }
        if let Some(place) = stages.windows(2).position(|pair| pair[1].order < pair[0].order) {
            return Err(invalid(format!(
                "stage {} of the schedule has order {}, lower than the {} before it; orders only rise",
                place + 1,
                stages[place + 1].order,
                stages[place].order
            )));
        }
        if let Some(stage) = stages.iter().find(|stage| !(1..=HIGHEST_ORDER).contains(&stage.order)) {
            return Err(invalid(format!(
                "order {} is not between 1 and {HIGHEST_ORDER}",
                stage.order
            )));
        }
        let levels = number("subdivision_levels") as usize;
        if let Some(stage) = stages.iter().find(|stage| levels > 0 && stage.order > 1) {
            return Err(invalid(format!(
                "a subdivision volume has trilinear hexahedra; order is {}, set order = 1",
                stage.order
            )));
        }
        let energy = energy::find(text("energy")).filter(|energy| energy.is_barrier());
        let basis = basis::find(text("basis"));
        let rule = RULES.iter().find(|rule| rule.0 == text("quadrature"));
        let (Some(energy), Some(basis), Some(rule)) = (energy, basis, rule) else {
            return Err(invalid(format!(
                "energy {:?}, basis {:?} or quadrature {:?} is unknown; `vargeo list` names them",
                text("energy"),
                text("basis"),
                text("quadrature")
            )));
        };
        let terms = match text("distance") {
            "to-target" => (true, false),
            "from-target" => (false, true),
            "none" => (false, false),
            _ => (true, true),
        };
        Ok(Settings {
            adaptive: flag("adaptive").then(|| Adaptive {
                indicator: if text("adaptive_indicator") == "energy" {
                    Indicator::Energy
                } else {
                    Indicator::Distance
                },
                share: number("adaptive_share"),
                steps: number("adaptive_steps") as usize,
                most: order,
            }),
            order: stages.last().map_or(order, |stage| stage.order),
            stages,
            energy,
            basis,
            rule: rule.1,
            points: whole("quadrature_points"),
            samples: whole("surface_samples"),
            anisotropy: number("anisotropy"),
            terms: Terms {
                to_target: terms.0,
                from_target: terms.1,
            },
            preconditioned: text("solver") == "preconditioned-l-bfgs",
            memory: number("memory") as usize,
            refresh: number("refresh") as u64,
            gradient_tolerance: number("gradient_tolerance"),
            coarse_tolerance,
            untangle: flag("untangle"),
            levels,
            crease_angle: number("crease_angle"),
            files: settings.get("files").and_then(Value::as_array).map(|names| {
                let words = names.iter().filter_map(Value::as_str).map(str::to_owned);
                words.collect()
            }),
            repairs: number("repairs") as usize,
        })
    }

    /// Points a direction for cells of an order.
    pub fn quadrature_points(&self, order: usize) -> usize {
        self.points.unwrap_or_else(|| self.usual_points(self.rule, order))
    }

    /// Points a direction of a rule for cells of an order where the file leaves them open.
    pub fn usual_points(&self, rule: Rule, order: usize) -> usize {
        let fewest = if self.adaptive.is_some() { ADAPTIVE_POINTS } else { 3 };
        match rule {
            Rule::Gauss if self.basis.is_polynomial() => (order + 2).max(fewest),
            Rule::Lobatto if self.basis.is_polynomial() => (order + 3).max(fewest),
            Rule::Gauss | Rule::Lobatto => (2 * order).max(fewest),
            Rule::Trapezoid => (2 * order - 1).max(2),
        }
    }
}

/// Points a direction of every element at least where single orders are raised: with a rule that grows with the order
/// each raised element shows inversions that the barrier did not see before.
const ADAPTIVE_POINTS: usize = 10;

/// The far phase at order 1, then the close phase through the orders.
fn default_schedule(
    order: usize,
    raise: &str,
    (far, far_steps): (f64, usize),
    close: f64,
    iterations: u64,
    tolerance: f64,
    adaptive: bool,
) -> Vec<Stage> {
    let direct = raise == "direct";
    let first = if direct { order } else { 1 };
    let mut stages = Vec::new();
    if far > 0.0 {
        for step in 0..far_steps {
            let share = step as f64 / far_steps as f64;
            stages.push(Stage {
                lambda: far.powf(1.0 - share) * close.powf(share),
                order: first,
                iterations,
                tolerance,
            });
        }
    }
    let mut here = first;
    loop {
        stages.push(Stage {
            lambda: close,
            order: here,
            iterations,
            tolerance,
        });
        if here >= order || adaptive {
            return stages;
        }
        here = if raise == "step" {
            here + 1
        } else {
            (2 * here).min(order)
        };
    }
}

/// Checks that go across fields.
pub fn check(settings: &Value) -> Vec<(String, String)> {
    match Settings::resolve(settings) {
        Err(failure) if settings.get("subdivision_levels").and_then(Value::as_u64).unwrap_or(0) > 0 => {
            vec![("subdivision_levels".to_string(), failure.reason)]
        }
        Err(failure) if settings.get("schedule").is_some() => vec![("schedule".to_string(), failure.reason)],
        _ => Vec::new(),
    }
}
