//! The settings of a surface fit: their declaration as data, and the typed form that the computation reads.

use crate::method::Failure;
use crate::method::setting::{Default, Field, Kind};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

const NUMBERS: Kind = Kind::Number { min: 0.0, max: 1e12 };

/// Files beside the pictures' mesh.
const EXPORTS: &[(&str, &str)] = &[
    (
        "control",
        "`control.obj`: the control mesh that was solved for, where it is subdivided",
    ),
    ("obj", "`fit.obj`: the fitted surface alone"),
];

/// Everything that `[settings]` may hold.
pub static FIELDS: &[Field] = &[
    Field {
        name: "preset",
        kind: Kind::Choice(&[
            (
                "best",
                "stages of growing anisotropy and falling regularization, vertices on the limit surface",
            ),
            (
                "paper",
                "one stage with anisotropy 50 and regularization 0.0002, vertices of the subdivided mesh",
            ),
        ]),
        default: Default::Text("best"),
        doc: "Chooses every setting that the file leaves open. A setting in the file wins over the preset.",
    },
    Field {
        name: "terms",
        kind: Kind::Choice(&[
            ("symmetric", "both terms"),
            (
                "target-to-fit",
                "from the target to the fit's vertices only; spurious parts stay",
            ),
            (
                "fit-to-target",
                "from the fit to the target's samples only; parts of the target may be missed",
            ),
        ]),
        default: Default::Text("symmetric"),
        doc: "The squared distance terms that are minimized (equation 3 of the paper).",
    },
    Field {
        name: "anisotropy",
        kind: Kind::OneOf(&[
            Kind::Number { min: 1e-3, max: 1e6 },
            Kind::List(&Kind::Number { min: 1e-3, max: 1e6 }),
        ]),
        default: Default::Absent,
        doc: "Factor s along the target's normals (section 3.6 of the paper): a list with one entry a stage, the last entry \
              of a shorter list holding on; or a number, which the preset's stages then end with and do not exceed \
              before, or which holds in all stages where `regularization` is a list. Preset best: [1, 1, 10, 50], \
              paper: 50.",
    },
    Field {
        name: "regularization",
        kind: Kind::OneOf(&[NUMBERS, Kind::List(&NUMBERS)]),
        default: Default::Absent,
        doc: "Factor lambda of |L X|^2 with the graph Laplacian L of the fitted mesh X, the target scaled to diagonal 1: a \
              list with one entry a stage, or a number, which the preset's stages end with and do not go below \
              before; or holds in all stages where `anisotropy` is a list. Preset best: \
              [0.02, 0.002, 0.002, 0.0002], paper: 0.0002.",
    },
    Field {
        name: "approach",
        kind: Kind::Choice(&[
            ("auto", "near for a template of voxels, far for any other"),
            (
                "near",
                "no stage with more regularization than the last: the template lies within a face or two of its target, and \
                 needs no drawing near, which would close its holes",
            ),
            ("far", "the stages as they stand"),
        ]),
        default: Default::Absent,
        doc: "How far from the target the template is taken to start. Auto, but far where `regularization` is a list.",
    },
    Field {
        name: "evenness",
        kind: Kind::OneOf(&[NUMBERS, Kind::List(&NUMBERS)]),
        default: Default::Absent,
        doc: "Factor mu of |P L X|^2 with the projection P along the fit, whose normals are those at the start of the stage: \
              spreads vertices evenly and keeps faces from folding without drawing the fit off the target: a list with one \
              entry a stage, or a number, which the preset's stages end with, or which holds in all stages where \
              `anisotropy` or `regularization` is a list. Preset best: [0, 0, 0.005], paper: 0.",
    },
    Field {
        name: "unfolding",
        kind: NUMBERS,
        default: Default::Absent,
        doc: "Factor of a term on the corners of faces that are folded or nearly so, in stages of their own after the last: one \
              where faces are folded then, and another with ten times the factor where some still are; after that some may \
              stay. 0 for none. Preset best: 10000, paper: 0.",
    },
    Field {
        name: "gradient",
        kind: Kind::Choice(&[
            ("complete", "the derivative of the value"),
            (
                "paper",
                "equation 4 for the sites, which is exact without anisotropy only",
            ),
        ]),
        default: Default::Text("complete"),
        doc: "The gradient of the term from the target to the fit's vertices.",
    },
    Field {
        name: "compatibility",
        kind: Kind::Number { min: 0.0, max: 100.0 },
        default: Default::Number(0.0),
        doc: "Weight of 1 - n . N beside the squared distance, with the normals of both surfaces, in squared diagonals: tells \
              the two sides of a thin sheet apart. Needs a target that is oriented.",
    },
    Field {
        name: "subdivisions",
        kind: Kind::Integer { min: 0, max: 5 },
        default: Default::Integer(2),
        doc: "Catmull-Clark levels between the control mesh and the fitted mesh; 0 fits the template itself.",
    },
    Field {
        name: "limit",
        kind: Kind::Boolean,
        default: Default::Absent,
        doc: "Whether the fitted mesh has its vertices on the limit surface of the subdivision. Without effect for 0 \
              subdivisions. Preset best: true, paper: false.",
    },
    Field {
        name: "crease_angle",
        kind: Kind::Number { min: 0.0, max: 180.0 },
        default: Default::Number(180.0),
        doc: "Edges of the template with a larger angle between its faces' normals, in degrees, stay sharp under \
              subdivision.",
    },
    Field {
        name: "refinements",
        kind: Kind::Integer { min: 0, max: 6 },
        default: Default::Integer(0),
        doc: "How often the control mesh is subdivided after a fit and fitted again with the last stage.",
    },
    Field {
        name: "sampling",
        kind: Kind::Choice(&[
            (
                "auto",
                "facets where they are small and one to sixteen times as many as the fit's vertices, else tessellation",
            ),
            ("facets", "the centres of the target's triangles, with their normals"),
            (
                "tessellation",
                "a centroidal Voronoi tessellation of the target with `samples` points",
            ),
        ]),
        default: Default::Text("auto"),
        doc: "The points of the target that the fit's distance is measured to.",
    },
    Field {
        name: "samples",
        kind: Kind::Integer {
            min: 0,
            max: 10_000_000,
        },
        default: Default::Integer(0),
        doc: "Points of a tessellation; 0 for as many as the fitted mesh has vertices.",
    },
    Field {
        name: "sampling_iterations",
        kind: Kind::Integer { min: 0, max: 10_000 },
        default: Default::Integer(30),
        doc: "Iterations of the tessellation.",
    },
    Field {
        name: "seed",
        kind: Kind::Integer { min: 0, max: i64::MAX },
        default: Default::Integer(1),
        doc: "Start of the points from which a tessellation begins.",
    },
    Field {
        name: "iteration_limit",
        kind: Kind::Integer { min: 0, max: 1_000_000 },
        default: Default::Integer(100),
        doc: "Most iterations of a stage.",
    },
    Field {
        name: "change_tolerance",
        kind: Kind::OneOf(&[
            Kind::Number { min: 0.0, max: 1.0 },
            Kind::List(&Kind::Number { min: 0.0, max: 1.0 }),
        ]),
        default: Default::Absent,
        doc: "A stage is done when one step lowers the energy by less than this share of it; or a list with one entry a \
              stage. Preset best: [0.001, 0.0003, 0.001, 0.0003], paper: 0.0001.",
    },
    Field {
        name: "gradient_tolerance",
        kind: Kind::Number { min: 0.0, max: 1e12 },
        default: Default::Number(1e-9),
        doc: "A stage is done when the Euclidean norm of the gradient is below this.",
    },
    Field {
        name: "preconditioner",
        kind: Kind::Choice(&[
            (
                "hessian",
                "both terms with the cells held still, and the regularizer; made anew every five evaluations",
            ),
            ("none", "plain L-BFGS, as in the paper"),
        ]),
        default: Default::Absent,
        doc: "The model of the Hessian that L-BFGS starts its own from. Preset best: hessian, paper: none.",
    },
    Field {
        name: "memory",
        kind: Kind::Integer { min: 1, max: 1000 },
        default: Default::Integer(10),
        doc: "Steps that L-BFGS remembers.",
    },
    Field {
        name: "feature_angle",
        kind: Kind::Number { min: 1.0, max: 180.0 },
        default: Default::Number(30.0),
        doc: "Edges of the target with a larger angle between its normals, in degrees, are the crease lines that the \
              crease metrics measure; changes no fit.",
    },
    Field {
        name: "export",
        kind: Kind::List(&Kind::Choice(EXPORTS)),
        default: Default::Absent,
        doc: "Files beside the mesh that is pictured, which shows target and fit side by side. All when absent.",
    },
];

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Terms {
    Symmetric,
    TargetToFit,
    FitToTarget,
}

impl Terms {
    pub fn from_target(self) -> bool {
        self != Terms::FitToTarget
    }

    pub fn to_target(self) -> bool {
        self != Terms::TargetToFit
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Approach {
    Auto,
    Near,
    Far,
}

impl Approach {
    /// Whether a template starts near, given whether it was made to.
    pub fn is_near(self, made_near: bool) -> bool {
        match self {
            Approach::Auto => made_near,
            Approach::Near => true,
            Approach::Far => false,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gradient {
    Complete,
    Paper,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    Auto,
    Facets,
    Tessellation,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preconditioning {
    Hessian,
    None,
}

/// The settings with nothing left open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    pub terms: Terms,
    /// One entry a stage, as are `regularization`, `evenness` and `change_tolerance`.
    pub anisotropy: Vec<f64>,
    pub regularization: Vec<f64>,
    pub approach: Approach,
    pub evenness: Vec<f64>,
    pub unfolding: f64,
    pub gradient: Gradient,
    pub compatibility: f64,
    pub subdivisions: usize,
    pub limit: bool,
    pub crease_angle: f64,
    pub refinements: usize,
    pub sampling: Sampling,
    pub samples: usize,
    pub sampling_iterations: u64,
    pub seed: u64,
    pub iteration_limit: u64,
    pub change_tolerance: Vec<f64>,
    pub gradient_tolerance: f64,
    pub preconditioner: Preconditioning,
    pub memory: usize,
    pub feature_angle: f64,
    pub export: Vec<String>,
}

/// One minimization of a schedule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    pub anisotropy: f64,
    pub regularization: f64,
    pub evenness: f64,
    /// Factor of the term on folded corners: 0 but in the stages that come after the schedule.
    pub unfolding: f64,
    pub change_tolerance: f64,
}

/// The schedule of the preset `best`: a stiff mesh is drawn near first, then let loose.
const ANISOTROPY: [f64; 4] = [1.0, 1.0, 10.0, 50.0];
const REGULARIZATION: [f64; 4] = [2e-2, 2e-3, 2e-3, 2e-4];
/// The plain distance hardly folds; the stretched one slides vertices along the target to gain a little distance.
const EVENNESS: [f64; 3] = [0.0, 0.0, 5e-3];

/// Corners that span next to nothing weigh next to nothing by area squared, so that the factor has to be large.
const UNFOLDING: f64 = 1e4;

/// The settings that may have one entry a stage.
const SCHEDULES: [&str; 4] = ["anisotropy", "regularization", "evenness", "change_tolerance"];

impl Settings {
    /// Reads validated settings, full or canonical. Fields that are absent take the preset's or the declared value.
    ///
    /// # Errors
    /// A value that the declaration does not allow, which validation would have found.
    pub fn resolve(settings: &Value) -> Result<Settings, Failure> {
        let mut table = Map::new();
        for field in FIELDS {
            let value = match (settings.get(field.name), &field.default) {
                (Some(value), _) => Some(value.clone()),
                (None, Default::Boolean(value)) => Some(Value::from(*value)),
                (None, Default::Integer(value)) => Some(Value::from(*value)),
                (None, Default::Number(value)) => Some(Value::from(*value)),
                (None, Default::Text(value)) => Some(Value::from(*value)),
                _ => None,
            };
            if let Some(value) = value {
                table.insert(field.name.to_string(), value);
            }
        }
        let paper = table.remove("preset").is_some_and(|preset| preset == "paper");
        // A number alone is where the schedule leads, unless the other one is a list with stages of its own.
        let listed = |table: &Map<String, Value>, name: &str| table.get(name).is_some_and(Value::is_array);
        let approach = if listed(&table, "regularization") {
            "far"
        } else {
            "auto"
        };
        table.entry("approach").or_insert(Value::from(approach));
        if !paper && !listed(&table, "anisotropy") && !listed(&table, "regularization") {
            let schedules = [
                ("anisotropy", &ANISOTROPY[..]),
                ("regularization", &REGULARIZATION[..]),
                ("evenness", &EVENNESS[..]),
            ];
            for (name, schedule) in schedules {
                if let Some(last) = table.get(name).and_then(Value::as_f64) {
                    let end = schedule.len() - 1;
                    let rises = schedule[0] < schedule[end];
                    let before = |&entry: &f64| if rises { entry.min(last) } else { entry.max(last) };
                    let mut stages: Vec<f64> = schedule[..end].iter().map(before).collect();
                    stages.push(last);
                    table.insert(name.to_string(), Value::from(stages));
                }
            }
        }
        let mut preset = |name: &str, best: Value, paper_value: Value| {
            table.entry(name).or_insert(if paper { paper_value } else { best });
        };
        preset("anisotropy", Value::from(&ANISOTROPY[..]), Value::from(vec![50.0]));
        preset(
            "regularization",
            Value::from(&REGULARIZATION[..]),
            Value::from(vec![2e-4]),
        );
        preset("evenness", Value::from(&EVENNESS[..]), Value::from(vec![0.0]));
        preset(
            "change_tolerance",
            Value::from(vec![1e-3, 3e-4, 1e-3, 3e-4]),
            Value::from(vec![1e-4]),
        );
        preset("unfolding", Value::from(UNFOLDING), Value::from(0.0));
        preset("limit", Value::from(true), Value::from(false));
        preset("preconditioner", Value::from("hessian"), Value::from("none"));
        let all: Vec<&str> = EXPORTS.iter().map(|(name, _)| *name).collect();
        table.entry("export").or_insert(Value::from(all));
        for name in SCHEDULES {
            if let Some(value) = table.get_mut(name)
                && value.is_number()
            {
                *value = Value::from(vec![value.clone()]);
            }
        }
        let mut settings: Settings = serde_json::from_value(Value::Object(table))
            .map_err(|error| Failure::invalid(format!("settings of surface-fit: {error}")))?;
        // Their order does not matter.
        settings.export.sort();
        settings.export.dedup();
        match empty_list(&settings) {
            Some(name) => Err(Failure::invalid(format!(
                "settings of surface-fit: {name} is an empty list; give one value a stage"
            ))),
            None => Ok(settings),
        }
    }

    /// The minimizations, one after the other.
    pub fn stages(&self) -> Vec<Stage> {
        // Tolerances alone make no stages.
        let count = self.anisotropy.len().max(self.regularization.len());
        let entry = |list: &[f64], stage: usize| list.get(stage).or(list.last()).copied().unwrap_or(0.0);
        // The last stage gets the last tolerance, however many there are.
        let tolerance = |stage: usize| {
            let last = self.change_tolerance.last().copied().unwrap_or(0.0);
            if stage + 1 == count {
                last
            } else {
                entry(&self.change_tolerance, stage)
            }
        };
        (0..count)
            .map(|stage| Stage {
                anisotropy: entry(&self.anisotropy, stage),
                regularization: entry(&self.regularization, stage),
                evenness: entry(&self.evenness, stage),
                unfolding: 0.0,
                change_tolerance: tolerance(stage),
            })
            .collect()
    }

    /// The minimizations from a template that starts near its target: none has more regularization than the last.
    pub fn stages_from_near(&self) -> Vec<Stage> {
        let mut stages = self.stages();
        let last = stages.last().map_or(0.0, |stage| stage.regularization);
        for stage in &mut stages {
            stage.regularization = stage.regularization.min(last);
        }
        stages
    }

    /// The settings as a table without those that cannot change the result.
    pub fn canonical(&self) -> Value {
        let Ok(Value::Object(mut table)) = serde_json::to_value(self) else {
            return Value::Null;
        };
        // The same stages under the same names, however they were written.
        let stages = self.stages();
        let column = |value: fn(&Stage) -> f64| Value::from(stages.iter().map(value).collect::<Vec<f64>>());
        table.insert("anisotropy".to_string(), column(|stage| stage.anisotropy));
        table.insert("regularization".to_string(), column(|stage| stage.regularization));
        table.insert("evenness".to_string(), column(|stage| stage.evenness));
        table.insert("change_tolerance".to_string(), column(|stage| stage.change_tolerance));
        if self.subdivisions == 0 {
            table.insert("limit".to_string(), Value::from(false));
            if self.refinements == 0 {
                table.remove("crease_angle");
            }
        }
        if self.sampling == Sampling::Facets {
            for name in ["samples", "sampling_iterations", "seed"] {
                table.remove(name);
            }
        }
        Value::Object(table)
    }
}

fn empty_list(settings: &Settings) -> Option<&'static str> {
    let lists = [
        &settings.anisotropy,
        &settings.regularization,
        &settings.evenness,
        &settings.change_tolerance,
    ];
    SCHEDULES
        .into_iter()
        .zip(lists)
        .find(|(_, list)| list.is_empty())
        .map(|(name, _)| name)
}

/// Checks that go across fields: path of the offending field and message.
pub fn check(settings: &Value) -> Vec<(String, String)> {
    SCHEDULES
        .into_iter()
        .filter(|name| settings.get(name).and_then(Value::as_array).is_some_and(Vec::is_empty))
        .map(|name| (name.to_string(), "an empty list; give one value a stage".to_string()))
        .collect()
}
