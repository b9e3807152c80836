//! The settings of a volume fit: their declaration as data, and the typed form that the computation reads.

use super::files::FILES;
use crate::energy;
use crate::fem::basis;
use crate::fem::quadrature::{RULES, Rule};
use crate::fem::space::HIGHEST_ORDER;
use crate::method::Failure;
use crate::method::setting::{Default, Field, Kind};
use serde_json::Value;

fn energy_names() -> Vec<(&'static str, String)> {
    let barriers = energy::energies().iter().filter(|energy| energy.is_barrier());
    barriers
        .map(|energy| (energy.name(), energy.formula().to_string()))
        .collect()
}

fn basis_names() -> Vec<(&'static str, String)> {
    let bases = basis::bases().iter();
    bases.map(|basis| (basis.name(), basis.summary().to_string())).collect()
}

fn rule_names() -> Vec<(&'static str, String)> {
    RULES
        .iter()
        .map(|&(name, _, meaning)| (name, meaning.to_string()))
        .collect()
}

const ORDER: Kind = Kind::Integer {
    min: 1,
    max: HIGHEST_ORDER as i64,
};

/// A file of the result.
static FILE: Kind = Kind::Choice(FILES);

/// A stage of the schedule.
static STAGE: &[Field] = &[
    Field {
        name: "lambda",
        kind: Kind::Number { min: 1e-9, max: 1e9 },
        default: Default::Required,
        doc: "Weight of the volume energy beside the surface energy.",
    },
    Field {
        name: "order",
        kind: ORDER,
        default: Default::Required,
        doc: "Order of the elements; never lower than in the stage before.",
    },
    Field {
        name: "iterations",
        kind: Kind::Integer { min: 0, max: 1_000_000 },
        default: Default::Absent,
        doc: "Most iterations of this stage; `iteration_limit` when absent.",
    },
];

/// Everything that `[settings]` may hold.
pub static FIELDS: &[Field] = &[
    Field {
        name: "preset",
        kind: Kind::Choice(&[
            (
                "best",
                "integrated Legendre, Lobatto quadrature, preconditioned L-BFGS, a far phase in steps",
            ),
            (
                "paper",
                "integrated Fourier, trapezoid rule, plain L-BFGS until the gradient norm is 1e-8",
            ),
        ]),
        default: Default::Text("best"),
        doc: "Chooses every setting that the file leaves open. A setting in the file wins over the preset.",
    },
    Field {
        name: "order",
        kind: ORDER,
        default: Default::Integer(4),
        doc: "Final order of the elements, where no `schedule` is given.",
    },
    Field {
        name: "raise",
        kind: Kind::Choice(&[
            ("double", "orders 1, 2, 4, 8, ... up to the final one"),
            ("step", "every order from 1 up to the final one"),
            ("direct", "the final order at once, in both phases"),
        ]),
        default: Default::Text("double"),
        doc: "How the order is raised, where no `schedule` is given. The far phase has order 1 unless direct.",
    },
    Field {
        name: "lambda_far",
        kind: Kind::Number { min: 0.0, max: 1e9 },
        default: Default::Absent,
        doc: "Weight of the volume energy in the far phase, which brings a template that is far away near as a whole, where the \
              close phase would crush its outer layer; 0 leaves the far phase out. 50 when absent.",
    },
    Field {
        name: "lambda",
        kind: Kind::Number { min: 1e-9, max: 1e9 },
        default: Default::Number(0.05),
        doc: "Weight of the volume energy in the close phase. It costs distance: where orders no longer bring the boundary nearer, \
              a smaller one does, or a finer target.",
    },
    Field {
        name: "far_steps",
        kind: Kind::Integer { min: 1, max: 50 },
        default: Default::Absent,
        doc: "Stages of the far phase: 1 keeps lambda_far; more go down to lambda in geometric steps. Preset best: 3, paper: 1.",
    },
    Field {
        name: "schedule",
        kind: Kind::List(&Kind::Table(STAGE)),
        default: Default::Absent,
        doc: "The stages one by one, `[{ lambda = 50, order = 1 }, { lambda = 0.05, order = 2 }]`, instead of the fields above.",
    },
    Field {
        name: "adaptive",
        kind: Kind::Boolean,
        default: Default::Boolean(false),
        doc: "Raise the order of single elements where it is needed most, instead of all alike, up to `order`.",
    },
    Field {
        name: "adaptive_indicator",
        kind: Kind::Choice(&[
            ("distance", "where an element's boundary is farthest from the target"),
            (
                "energy",
                "where the energy promises to fall most (its gradient by functions that are not there yet)",
            ),
        ]),
        default: Default::Text("distance"),
        doc: "Which elements are raised.",
    },
    Field {
        name: "adaptive_share",
        kind: Kind::Number { min: 0.01, max: 1.0 },
        default: Default::Number(0.5),
        doc: "By energy, the share of the indicator that the elements chosen in a step must have together (Doerfler); by \
              distance, those are chosen whose distance is at least the largest less this share.",
    },
    Field {
        name: "adaptive_steps",
        kind: Kind::Integer { min: 1, max: 100 },
        default: Default::Integer(8),
        doc: "Steps of raising orders.",
    },
    Field {
        name: "energy",
        kind: Kind::Named(energy_names),
        default: Default::Text("hencky"),
        doc: "The distortion density; only barriers against inversion are allowed.",
    },
    Field {
        name: "basis",
        kind: Kind::Named(basis_names),
        default: Default::Absent,
        doc: "Functions of edges, faces and cells. Preset best: integrated-legendre, paper: integrated-fourier.",
    },
    Field {
        name: "quadrature",
        kind: Kind::Named(rule_names),
        default: Default::Absent,
        doc: "Rule for the volume energy. Preset best: lobatto, whose points on corners and edges keep these valid; paper: \
              trapezoid.",
    },
    Field {
        name: "quadrature_points",
        kind: Kind::OneOf(&[
            Kind::Choice(&[(
                "auto",
                "Gauss and Lobatto: order + 2 and order + 3 for polynomials, 2 order else, 3 at least; trapezoid: 2 order - 1",
            )]),
            Kind::Integer { min: 2, max: 40 },
        ]),
        default: Default::Text("auto"),
        doc: "Points a direction.",
    },
    Field {
        name: "surface_samples",
        kind: Kind::OneOf(&[
            Kind::Choice(&[(
                "auto",
                "2 order - 2 or more, so that there are half as many samples as target triangles (16 at most)",
            )]),
            Kind::Integer { min: 1, max: 64 },
        ]),
        default: Default::Text("auto"),
        doc: "Intervals between samples along every edge of the boundary.",
    },
    Field {
        name: "anisotropy",
        kind: Kind::Number { min: 1.0, max: 1e4 },
        default: Default::Number(50.0),
        doc: "Weight of the distance along normals against that along the surface; 1 is the plain distance. Features are kept \
              by large ones.",
    },
    Field {
        name: "distance",
        kind: Kind::Choice(&[
            ("symmetric", "both terms"),
            (
                "to-target",
                "only from the template's surface to sites on the target (inverse fitting)",
            ),
            (
                "from-target",
                "only from the target's surface to samples of the template",
            ),
            ("none", "the volume energy alone: the boundary is free"),
        ]),
        default: Default::Text("symmetric"),
        doc: "The terms of the surface energy. A point cloud allows to-target only.",
    },
    Field {
        name: "solver",
        kind: Kind::Choice(&[
            (
                "preconditioned-l-bfgs",
                "L-BFGS from a factorized constant model of the Hessian",
            ),
            ("l-bfgs", "L-BFGS as in the paper"),
        ]),
        default: Default::Absent,
        doc: "The minimizer. Preset best: preconditioned-l-bfgs, paper: l-bfgs.",
    },
    Field {
        name: "memory",
        kind: Kind::Integer { min: 1, max: 100 },
        default: Default::Integer(10),
        doc: "Steps that L-BFGS remembers.",
    },
    Field {
        name: "refresh",
        kind: Kind::Integer { min: 1, max: 1_000_000 },
        default: Default::Integer(50),
        doc: "Iterations after which the preconditioner follows the surface's normals again.",
    },
    Field {
        name: "iteration_limit",
        kind: Kind::Integer { min: 0, max: 1_000_000 },
        default: Default::Integer(200),
        doc: "Most iterations of a stage.",
    },
    Field {
        name: "gradient_tolerance",
        kind: Kind::Number { min: 0.0, max: 1e9 },
        default: Default::Number(1e-8),
        doc: "A stage has converged when the norm of the gradient is below this; the target has a box of diagonal 1.",
    },
    Field {
        name: "change_tolerance",
        kind: Kind::Number { min: 0.0, max: 1.0 },
        default: Default::Absent,
        doc: "A stage has converged when an iteration lowers the energy by less than this share. Preset best: 1e-5, paper: 0.",
    },
    Field {
        name: "coarse_tolerance",
        kind: Kind::Number { min: 0.0, max: 1.0 },
        default: Default::Absent,
        doc: "The same for all stages but the last, where larger: 1e-3 saves most of their iterations, but leaves some \
              templates worse placed for the next order. 0 when absent.",
    },
    Field {
        name: "untangle",
        kind: Kind::Boolean,
        default: Default::Boolean(true),
        doc: "Untangle a template with inverted elements before fitting, by a regularized energy beside the surface energy. \
              Otherwise such a template is refused.",
    },
    Field {
        name: "repairs",
        kind: Kind::Integer { min: 0, max: 10 },
        default: Default::Absent,
        doc: "How often, at most, a fit with elements that are invalid between quadrature points is gone on with, with more \
              points. Preset best: 3, paper: 0.",
    },
    Field {
        name: "subdivision_levels",
        kind: Kind::Integer { min: 0, max: 6 },
        default: Default::Integer(0),
        doc: "Fit a subdivision volume: the control points of so many levels of multi-linear averaging, level by level, with \
              trilinear hexahedra; 0 fits elements. Needs order 1.",
    },
    Field {
        name: "crease_angle",
        kind: Kind::Number { min: 0.0, max: 180.0 },
        default: Default::Number(40.0),
        doc: "Edges of a subdivision's template bent by more than this, in degrees, stay creases; 180 keeps none.",
    },
    Field {
        name: "files",
        kind: Kind::List(&FILE),
        default: Default::Absent,
        doc: "Files beside the picture: lagrange, gmsh, coefficients. All when absent and there are at most 300000 nodes, else \
              the coefficients alone.",
    },
];

/// What a shell does not read: it has no surface energy and one term.
pub const WITHOUT_EFFECT_ON_SHELLS: &[&str] = &[
    "lambda",
    "lambda_far",
    "adaptive",
    "adaptive_indicator",
    "adaptive_share",
    "adaptive_steps",
    "distance",
    "anisotropy",
    "surface_samples",
    "repairs",
    "crease_angle",
];

/// What a subdivision volume does not read.
pub const WITHOUT_EFFECT_ON_SUBDIVISIONS: &[&str] = &[
    "adaptive",
    "adaptive_indicator",
    "adaptive_share",
    "adaptive_steps",
    "repairs",
    "raise",
    "solver",
    "refresh",
];

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
    Failure {
        kind: "invalid-input".to_string(),
        reason: format!("settings of volume-fit: {reason}"),
    }
}

/// What the presets choose: field, best, paper.
const PRESETS: &[(&str, &str, &str)] = &[
    ("basis", "integrated-legendre", "integrated-fourier"),
    ("quadrature", "lobatto", "trapezoid"),
    ("solver", "preconditioned-l-bfgs", "l-bfgs"),
];

impl Settings {
    /// Reads validated settings.
    ///
    /// # Errors
    /// A value that the declaration does not allow, or a schedule that lowers the order.
    pub fn resolve(settings: &Value) -> Result<Settings, Failure> {
        let declared = |name: &str| {
            FIELDS
                .iter()
                .find(|field| field.name == name)
                .map(|field| &field.default)
        };
        let text = |name: &str| -> String {
            let given = settings.get(name).and_then(Value::as_str);
            match (given, declared(name)) {
                (Some(word), _) => word.to_string(),
                (None, Some(Default::Text(word))) => word.to_string(),
                _ => String::new(),
            }
        };
        let number = |name: &str| -> f64 {
            let given = settings.get(name).and_then(Value::as_f64);
            match (given, declared(name)) {
                (Some(number), _) => number,
                (None, Some(Default::Number(number))) => *number,
                (None, Some(Default::Integer(number))) => *number as f64,
                _ => 0.0,
            }
        };
        let flag = |name: &str| -> bool {
            let given = settings.get(name).and_then(Value::as_bool);
            match (given, declared(name)) {
                (Some(flag), _) => flag,
                (None, Some(Default::Boolean(flag))) => *flag,
                _ => false,
            }
        };
        let whole = |name: &str| settings.get(name).and_then(Value::as_u64).map(|value| value as usize);
        let paper = text("preset") == "paper";
        let chosen = |name: &str| -> String {
            let word = text(name);
            if !word.is_empty() {
                return word;
            }
            let preset = PRESETS.iter().find(|preset| preset.0 == name);
            preset.map_or(String::new(), |(_, best, printed)| {
                (if paper { *printed } else { *best }).to_string()
            })
        };
        let far = settings.get("lambda_far").and_then(Value::as_f64);
        let far = far.unwrap_or(50.0);
        let order = number("order") as usize;
        let limit = number("iteration_limit") as u64;
        let given = |name: &str, best: f64| {
            let value = settings.get(name).and_then(Value::as_f64);
            value.unwrap_or(if paper { 0.0 } else { best })
        };
        let tolerance = given("change_tolerance", 1e-5);
        let coarse_tolerance = tolerance.max(given("coarse_tolerance", 0.0));
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
                    &text("raise"),
                    (far, whole("far_steps").unwrap_or(if paper { 1 } else { 3 })),
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
        let energy = energy::find(&text("energy")).filter(|energy| energy.is_barrier());
        let basis = basis::find(&chosen("basis"));
        let rule = RULES.iter().find(|rule| rule.0 == chosen("quadrature"));
        let (Some(energy), Some(basis), Some(rule)) = (energy, basis, rule) else {
            return Err(invalid(format!(
                "energy {:?}, basis {:?} or quadrature {:?} is unknown; `vargeo list` names them",
                text("energy"),
                chosen("basis"),
                chosen("quadrature")
            )));
        };
        let terms = match text("distance").as_str() {
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
            preconditioned: chosen("solver") == "preconditioned-l-bfgs",
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
            repairs: whole("repairs").unwrap_or(if paper { 0 } else { 3 }),
        })
    }

    /// Points a direction for cells of an order.
    pub fn quadrature_points(&self, order: usize) -> usize {
        self.points.unwrap_or(match self.rule {
            Rule::Gauss if self.basis.is_polynomial() => (order + 2).max(3),
            Rule::Lobatto if self.basis.is_polynomial() => order + 3,
            Rule::Gauss | Rule::Lobatto => (2 * order).max(3),
            Rule::Trapezoid => (2 * order - 1).max(2),
        })
    }
}

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
