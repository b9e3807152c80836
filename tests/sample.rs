//! Samples for tests of many properties: models and runs of methods, numbers, an experiment with every end of a job.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use vargeo::experiment::file::{
    Axis, Bound, Comparison, Condition, Expectation, Experiment, Limits, Origin, Plot, Published, Rate, Table, Timing,
};
use vargeo::experiment::job::{Job, JobPart, Key};
use vargeo::experiment::record::{JobResult, Measurement, Phase, Record, Status};
use vargeo::method::model::{LoadedModel, ModelKind, Part};
use vargeo::method::setting::Field;
use vargeo::method::{Failure, Inputs, Method, Outcome};
use vargeo::metric::{Better, Metric};
use vargeo::optimize::{Observer, Silent};
use vargeo::report::Row;

/// A part of a model from a generator.
pub(crate) fn generated(generator: &str, parameters: Value) -> Part {
    Part::Generated {
        generator: generator.to_string(),
        parameters,
    }
}

/// A part of a model from a file that holds these bytes.
pub(crate) fn file(name: &str, bytes: impl Into<Vec<u8>>) -> Part {
    Part::File {
        name: name.to_string(),
        bytes: bytes.into(),
        parameters: json!({}),
    }
}

/// A model of parts by role.
pub(crate) fn model<'a>(parts: impl IntoIterator<Item = (&'a str, Part)>) -> LoadedModel {
    let parts = parts.into_iter().map(|(role, part)| (role.to_string(), part));
    LoadedModel { parts: parts.collect() }
}

/// What a method makes of a model.
pub(crate) fn run(method: &dyn Method, model: LoadedModel, settings: Value) -> Result<Outcome, Failure> {
    let inputs = Inputs {
        settings: &settings,
        model,
    };
    method.run(inputs, &mut Silent)
}

/// All figures of an outcome, to the bit.
pub(crate) fn metric_bits(outcome: &Outcome) -> Vec<u64> {
    outcome.metrics.values().map(|value| value.to_bits()).collect()
}

/// What comes out with so many threads.
pub(crate) fn with_threads<R: Send>(threads: usize, run: impl FnOnce() -> R + Send) -> R {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads").install(run)
}

/// Numbers in [-1, 1) from a linear congruential generator, the same on every run.
pub(crate) struct Noise(pub u64);

impl Noise {
    pub(crate) fn number(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn point(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.number())
    }

    pub(crate) fn points(&mut self, count: usize) -> Vec<[f64; 3]> {
        (0..count).map(|_| self.point()).collect()
    }
}

pub(crate) struct Sample;

impl Method for Sample {
    fn name(&self) -> &'static str {
        "volume-map"
    }
    fn version(&self) -> u32 {
        3
    }
    fn summary(&self) -> &'static str {
        "maps a tetrahedral mesh onto a target"
    }
    fn source(&self) -> &'static str {
        "a paper on volumetric maps"
    }
    fn model(&self) -> &'static ModelKind {
        &ModelKind { roles: &[] }
    }
    fn settings(&self) -> &'static [Field] {
        &[]
    }
    fn metrics(&self) -> &'static [Metric] {
        const fn metric(name: &'static str, better: Better, definition: &'static str) -> Metric {
            Metric {
                name,
                symbol: name,
                unit: "",
                floor: Some(1.0),
                better,
                definition,
            }
        }
        const METRICS: &[Metric] = &[
            metric("d_aa", Better::Lower, "mean angle distortion"),
            metric("d_ma", Better::Lower, "maximum angle distortion"),
            metric("inverted", Better::Lower, "inverted tetrahedra"),
            metric("scaled_jacobian_min", Better::Higher, "lowest scaled Jacobian"),
            metric("error", Better::Lower, "L2 error"),
        ];
        METRICS
    }
    fn run(&self, _: Inputs<'_>, _: &mut dyn Observer) -> Result<Outcome, Failure> {
        Err(Failure {
            kind: "invalid-input".into(),
            reason: "a sample does not run".into(),
        })
    }
}

pub(crate) fn condition(entries: &[(&str, &[Value])]) -> Condition {
    entries
        .iter()
        .map(|(axis, values)| (axis.to_string(), values.to_vec()))
        .collect()
}

/// A row with an outcome.
pub(crate) fn row(name: &str, axes: &[(&str, Value)], metrics: &[(&str, f64)]) -> Row {
    Row {
        name: name.into(),
        axes: axes
            .iter()
            .map(|(axis, value)| (axis.to_string(), value.clone()))
            .collect(),
        record: Record {
            key: Key(format!("{:064x}", name.bytes().map(u64::from).sum::<u64>())),
            job: Job {
                record_schema: 1,
                method: "volume-map".into(),
                method_version: 3,
                model: BTreeMap::from([(
                    "mesh".to_string(),
                    JobPart::Generated {
                        generator: "ball".into(),
                        parameters: json!({ "tetrahedra": 12_600 }),
                    },
                )]),
                settings: json!({ "barrier": "auto", "solver": { "newton": { "omega": 1e8 } } }),
            },
            result: JobResult {
                status: Status::Done,
                stop: "converged".into(),
                reason: "gradient below tolerance".into(),
                metrics: metrics.iter().map(|(name, value)| (name.to_string(), *value)).collect(),
                traces: BTreeMap::new(),
                counters: BTreeMap::from([("iterations".to_string(), 17)]),
                notices: Vec::new(),
                artifacts: BTreeMap::new(),
            },
            measurement: Measurement {
                version: "0.1.0".into(),
                commit: "1234567".into(),
                target: "x86_64 avx2".into(),
                host: "a processor, Linux".into(),
                threads: 2,
                started: 1_767_225_600,
                exclusive: true,
                wall_seconds: vec![1.5, 1.25, 1.75],
                cpu_seconds: vec![2.5, 2.25, 2.75],
                phases: vec![Phase {
                    name: "minimize".into(),
                    wall_seconds: 1.0,
                    cpu_seconds: 2.0,
                }],
                peak_memory: 123 << 20,
                inputs: BTreeMap::new(),
            },
        },
        cached: false,
        mesh: None,
        files: Vec::new(),
    }
}

/// A row without an outcome.
pub(crate) fn ended(name: &str, axes: &[(&str, Value)], status: Status, stop: &str, reason: &str) -> Row {
    let mut row = row(name, axes, &[]);
    row.record.result.status = status;
    row.record.result.stop = stop.into();
    row.record.result.reason = reason.into();
    row.record.result.counters.clear();
    row.record.measurement.wall_seconds.clear();
    row.record.measurement.cpu_seconds.clear();
    row
}

/// Two models, four energies; one job of each other end.
pub(crate) fn rows() -> Vec<Row> {
    let axes = |model: &str, energy: &str| [("model", json!(model)), ("energy", json!(energy))];
    let mut rows = Vec::new();
    for (model, factor) in [("ball", 1.0), ("duck", 1.7)] {
        for (energy, d_aa, d_ma, inverted) in [("dirichlet", 3.2, 273.7, 21.0), ("stretch", 2.8, 12.34567, 0.0)] {
            let mut row = row(
                &format!("{model}-{energy}"),
                &axes(model, energy),
                &[
                    ("d_aa", d_aa * factor),
                    ("d_ma", d_ma * factor),
                    ("inverted", inverted),
                    ("scaled_jacobian_min", 0.000_123_456 * factor),
                ],
            );
            let iterations: Vec<f64> = (0..40).map(f64::from).collect();
            let fall = if energy == "stretch" { 0.8f64 } else { 0.93 };
            row.record.result.traces = BTreeMap::from([
                (
                    "energy".to_string(),
                    iterations
                        .iter()
                        .map(|i| factor * (6.0 + 900.0 * fall.powf(*i)))
                        .collect(),
                ),
                (
                    "gradient_norm".to_string(),
                    iterations.iter().map(|i| factor * 50.0 * fall.powf(2.0 * i)).collect(),
                ),
                (
                    "phase".to_string(),
                    iterations.iter().map(|i| f64::from(u8::from(*i >= 8.0))).collect(),
                ),
                ("iteration".to_string(), iterations),
            ]);
            rows.push(row);
        }
    }
    rows[2].record.result.stop = "step-limit".into();
    rows[2].record.result.reason = "500 iterations used, gradient 3e-2".into();
    rows[0].record.result.notices = vec!["12 tetrahedra were turned over to face outwards".into()];
    rows.push(ended(
        "ball-lscm",
        &axes("ball", "lscm"),
        Status::Failed,
        "time-limit",
        "stopped after 600 s at iteration 212",
    ));
    rows.push(ended(
        "duck-lscm",
        &axes("duck", "lscm"),
        Status::Refused,
        "infeasible",
        "boundary triangle 17 is inverted on the target; split its tetrahedron",
    ));
    rows.push(ended(
        "horse-stretch",
        &axes("horse", "stretch"),
        Status::Skipped,
        "missing-model",
        "models/horse.mesh is not there",
    ));
    rows
}

pub(crate) fn published() -> Published {
    let row = |energy: &str, d_aa: f64, d_ma: f64, seconds: u32| {
        BTreeMap::from([
            ("model".to_string(), json!("ball")),
            ("energy".to_string(), json!(energy)),
            ("d_aa".to_string(), json!(d_aa)),
            ("d_ma".to_string(), json!(d_ma)),
            ("seconds".to_string(), json!(seconds)),
        ])
    };
    Published {
        source: "Table 1 of the paper".into(),
        machine: Some("one core of a 3.4 GHz processor".into()),
        rows: vec![
            row("dirichlet", 3.2, 200.1, 47),
            row("stretch", 2.9, 30.5, 98),
            row("lscm", 6.7, 652.1, 1018),
        ],
    }
}

pub(crate) fn experiment() -> Experiment {
    Experiment {
        name: "sample".into(),
        title: "Energies on one volumetric map".into(),
        description: "Four energies on two models.".into(),
        method: &Sample,
        claims: vec!["VM1".into(), "VM2".into()],
        models: Vec::new(),
        settings: json!({ "barrier": "auto" }),
        axes: vec![Axis {
            name: "model".into(),
            values: vec![json!("ball"), json!("duck")],
        }],
        zips: Vec::new(),
        excludes: Vec::new(),
        limits: Limits::default(),
        timing: Timing {
            exclusive: true,
            repeat: 3,
            threads: None,
        },
        tables: vec![Table {
            name: "distortion".into(),
            title: Some("Distortion by energy".into()),
            rows: vec!["model".into(), "energy".into()],
            columns: ["d_aa", "d_ma", "scaled_jacobian_min", "inverted", "seconds"]
                .map(String::from)
                .to_vec(),
            across: Vec::new(),
            condition: Condition::new(),
            published: Some(published()),
        }],
        plots: vec![
            Plot {
                name: "energy".into(),
                title: Some("Energy over the iterations".into()),
                x: "iteration".into(),
                y: "energy".into(),
                series: vec!["model".into(), "energy".into()],
                log_x: false,
                log_y: true,
                condition: Condition::new(),
            },
            Plot {
                name: "angles".into(),
                title: None,
                x: "energy".into(),
                y: "d_ma".into(),
                series: vec!["model".into()],
                log_x: false,
                log_y: true,
                condition: Condition::new(),
            },
        ],
        rates: Vec::new(),
        expectations: vec![Expectation {
            condition: condition(&[("energy", &[json!("stretch")])]),
            stop: Some("converged".into()),
            bounds: BTreeMap::from([
                (
                    "d_ma".to_string(),
                    Bound {
                        max: Some(20.0),
                        ..Bound::default()
                    },
                ),
                (
                    "inverted".to_string(),
                    Bound {
                        equals: Some(0.0),
                        ..Bound::default()
                    },
                ),
            ]),
            comparisons: vec![Comparison {
                metric: "d_ma".into(),
                other: condition(&[("energy", &[json!("dirichlet")])]),
                factor: 1.0,
            }],
            line: 12,
        }],
        origin: Origin::default(),
    }
}

/// A study of an error against h for two families and three seeds: slopes 2 and 1.5.
pub(crate) fn study() -> (Vec<Row>, Rate) {
    let mut rows = Vec::new();
    for (family, slope) in [("even", 2.0), ("random", 1.5)] {
        for seed in 1..=3 {
            for level in 0..5 {
                let h = 0.2 / f64::from(1 << level);
                // A deterministic disturbance of up to two per cent that differs by seed and level.
                let noise = 1.0 + 0.01 * f64::from((2 * seed + 3 * level + seed * level) % 5 - 2);
                rows.push(row(
                    &format!("{family}-{seed}-{level}"),
                    &[("family", json!(family)), ("seed", json!(seed)), ("h", json!(h))],
                    &[("error", 3.0 * h.powf(slope) * noise)],
                ));
            }
        }
    }
    let rate = Rate {
        name: "convergence".into(),
        x: "h".into(),
        y: "error".into(),
        series: vec!["family".into()],
        condition: Condition::new(),
        window: None,
        expect: Some(Bound {
            min: Some(1.75),
            ..Bound::default()
        }),
    };
    (rows, rate)
}
