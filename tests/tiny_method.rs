//! A method with one setting of every kind, for tests of the experiment file, the plan and the key.

use serde_json::Value;
use vargeo::method::model::{Generator, ModelKind, Role};
use vargeo::method::setting::{Default, Field, Kind};
use vargeo::method::{Failure, Inputs, Method, Outcome};
use vargeo::metric::{Better, Metric};
use vargeo::optimize::Observer;

pub(crate) struct Tiny;

/// The methods that tests read files with.
pub(crate) const METHODS: &[&'static dyn Method] = &[&Tiny];

const POSITIVE: Kind = Kind::Number {
    min: f64::MIN_POSITIVE,
    max: f64::MAX,
};

const fn field(name: &'static str, kind: Kind, default: Default) -> Field {
    Field {
        name,
        kind,
        default,
        doc: "A setting of the tiny method.",
    }
}

fn energies() -> Vec<(&'static str, String)> {
    ["dirichlet", "arap", "stretch", "hencky"]
        .map(|name| (name, format!("the energy {name}")))
        .to_vec()
}

pub(crate) static SETTINGS: &[Field] = &[
    field("energy", Kind::Named(energies), Default::Text("stretch")),
    field("order", Kind::Integer { min: 1, max: 16 }, Default::Integer(2)),
    field("lambda", Kind::Number { min: 0.0, max: 100.0 }, Default::Number(0.5)),
    field("untangle", Kind::Boolean, Default::Boolean(true)),
    field(
        "solver",
        Kind::Choice(&[("newton", "second order"), ("l-bfgs", "first order")]),
        Default::Text("newton"),
    ),
    field(
        "newton",
        Kind::Table(&[
            field("omega", POSITIVE, Default::Number(1e8)),
            field("relaxation", Kind::Boolean, Default::Boolean(true)),
        ]),
        Default::Fields,
    ),
    field(
        "barrier",
        Kind::OneOf(&[
            Kind::Choice(&[("auto", "when needed"), ("none", "never")]),
            Kind::Table(&[field("width", POSITIVE, Default::Required)]),
        ]),
        Default::Text("auto"),
    ),
    field("patience", Kind::Duration, Default::Absent),
    field("cache", Kind::Size, Default::Text("1 MiB")),
    field("label", Kind::Text, Default::Absent),
    field("schedule", Kind::List(&POSITIVE), Default::Absent),
];

const TETRAHEDRA: Kind = Kind::Integer { min: 1, max: 1_000_000 };

static MODEL: ModelKind = ModelKind {
    roles: &[
        Role {
            name: "mesh",
            required: true,
            file: true,
            file_parameters: &[field("scale", POSITIVE, Default::Number(1.0))],
            generator_key: "generate",
            generators: &[
                Generator {
                    name: "ball",
                    parameters: &[field("tetrahedra", TETRAHEDRA, Default::Integer(100))],
                    doc: "A ball.",
                },
                Generator {
                    name: "bar",
                    parameters: &[
                        field("tetrahedra", TETRAHEDRA, Default::Required),
                        field("length", POSITIVE, Default::Number(2.0)),
                    ],
                    doc: "A bar.",
                },
            ],
            doc: "The source.",
        },
        Role {
            name: "target",
            required: false,
            file: false,
            file_parameters: &[],
            generator_key: "shape",
            generators: &[Generator {
                name: "cube",
                parameters: &[field(
                    "swirl",
                    Kind::Number { min: 0.0, max: 2.0 },
                    Default::Number(0.0),
                )],
                doc: "A cube.",
            }],
            doc: "The target.",
        },
    ],
};

const fn metric(name: &'static str) -> Metric {
    Metric {
        name,
        symbol: name,
        unit: "",
        floor: Some(0.0),
        better: Better::Lower,
        definition: "A metric of the tiny method.",
    }
}

static METRICS: &[Metric] = &[metric("inverted"), metric("d_ma"), metric("l2_error"), metric("h")];

impl Method for Tiny {
    fn name(&self) -> &'static str {
        "tiny"
    }
    fn version(&self) -> u32 {
        3
    }
    fn summary(&self) -> &'static str {
        "has a setting of every kind"
    }
    fn source(&self) -> &'static str {
        "nowhere"
    }
    fn model(&self) -> &'static ModelKind {
        &MODEL
    }
    fn settings(&self) -> &'static [Field] {
        SETTINGS
    }
    fn check(&self, settings: &Value) -> Vec<(String, String)> {
        if settings["solver"] == "l-bfgs" && settings["barrier"] == "none" {
            vec![("barrier".into(), "the l-bfgs solver needs a barrier".into())]
        } else {
            Vec::new()
        }
    }
    fn canonical(&self, mut settings: Value) -> Value {
        if settings["solver"] != "newton"
            && let Some(table) = settings.as_object_mut()
        {
            table.remove("newton");
        }
        settings
    }
    fn metrics(&self) -> &'static [Metric] {
        METRICS
    }
    fn traces(&self) -> &'static [(&'static str, &'static str)] {
        &[("iteration", "number of the step"), ("energy", "what is minimized")]
    }
    fn counters(&self) -> &'static [(&'static str, &'static str)] {
        &[("iterations", "steps")]
    }
    fn run(&self, _inputs: Inputs<'_>, _observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        Ok(Outcome::default())
    }
}
