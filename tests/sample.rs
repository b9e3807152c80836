//! A constructed experiment with records of every kind of end, for the tests of the report.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use vargeo::experiment::file::{
    Axis, Bound, Comparison, Condition, Expectation, Experiment, Limits, Origin, Plot, Published, Rate, Table, Timing,
};
use vargeo::experiment::job::{Job, JobPart, Key};
use vargeo::experiment::record::{JobResult, Measurement, Phase, Record, Status};
use vargeo::mesh::format::{Cells, vtu};
use vargeo::method::model::ModelKind;
use vargeo::method::setting::Field;
use vargeo::method::{Failure, Inputs, Method, Outcome};
use vargeo::metric::{Better, Metric};
use vargeo::optimize::Observer;
use vargeo::report::Row;

pub struct Sample;

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

pub fn condition(entries: &[(&str, &[Value])]) -> Condition {
    entries
        .iter()
        .map(|(axis, values)| (axis.to_string(), values.to_vec()))
        .collect()
}

/// A row with an outcome.
pub fn row(name: &str, axes: &[(&str, Value)], metrics: &[(&str, f64)]) -> Row {
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
pub fn ended(name: &str, axes: &[(&str, Value)], status: Status, stop: &str, reason: &str) -> Row {
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
pub fn rows() -> Vec<Row> {
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

pub fn published() -> Published {
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

pub fn experiment() -> Experiment {
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
pub fn study() -> (Vec<Row>, Rate) {
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

/// Bytes in a file of their own, as a store holds them.
pub fn stored(bytes: &[u8]) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("stored");
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(vargeo::experiment::job::sha256(bytes));
    let mut file = tempfile::NamedTempFile::new_in(&folder).expect("a file");
    std::io::Write::write_all(&mut file, bytes).expect("room for it");
    file.persist(&path).expect("a file");
    path
}

/// A grid of six tetrahedra a cell mapped onto a bulging, twisted one, as a VTU file with the fields of a map.
pub fn mesh(size: u32, twist: f64) -> Vec<u8> {
    let at = |i: u32, j: u32, k: u32| (k * (size + 1) + j) * (size + 1) + i;
    let mut state = 12_345u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let mut source = Vec::new();
    let mut image = Vec::new();
    for k in 0..=size {
        for j in 0..=size {
            for i in 0..=size {
                let place = [i, j, k].map(|index| 2.0 * f64::from(index) / f64::from(size) - 1.0);
                let inner = [i, j, k].iter().all(|index| *index > 0 && *index < size);
                let shake = if inner { 0.5 / f64::from(size) } else { 0.0 };
                let place = place.map(|part| part + shake * random());
                let [x, y, z] = place;
                // The cube onto the ball, then twisted about the third axis.
                let ball = [
                    x * (1.0 - y * y / 2.0 - z * z / 2.0 + y * y * z * z / 3.0).sqrt(),
                    y * (1.0 - z * z / 2.0 - x * x / 2.0 + z * z * x * x / 3.0).sqrt(),
                    z * (1.0 - x * x / 2.0 - y * y / 2.0 + x * x * y * y / 3.0).sqrt(),
                ];
                let (sine, cosine) = (twist * ball[2]).sin_cos();
                source.push(place);
                image.push([
                    cosine * ball[0] - sine * ball[1],
                    sine * ball[0] + cosine * ball[1],
                    ball[2],
                ]);
            }
        }
    }
    let mut cells: Vec<[u32; 4]> = Vec::new();
    for k in 0..size {
        for j in 0..size {
            for i in 0..size {
                let corner = |bits: u32| at(i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2));
                for (first, second) in [(1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)] {
                    cells.push([corner(0), corner(first), corner(second), corner(7)]);
                }
            }
        }
    }
    let determinant = |points: &[[f64; 3]], cell: &[u32; 4]| {
        let edge =
            |index: usize| [0, 1, 2].map(|axis| points[cell[index] as usize][axis] - points[cell[0] as usize][axis]);
        let (a, b, c) = (edge(1), edge(2), edge(3));
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    let determinants: Vec<f64> = cells
        .iter()
        .map(|cell| determinant(&image, cell) / determinant(&source, cell))
        .collect();
    let edges = |points: &[[f64; 3]], cell: &[u32; 4]| {
        let mut sum = 0.0;
        for i in 0..4 {
            for j in 0..i {
                sum += (0..3)
                    .map(|axis| (points[cell[i] as usize][axis] - points[cell[j] as usize][axis]).powi(2))
                    .sum::<f64>();
            }
        }
        sum
    };
    let angle: Vec<f64> = cells
        .iter()
        .zip(&determinants)
        .map(|(cell, det)| edges(&image, cell) / edges(&source, cell) / det.abs().max(1e-9).powf(2.0 / 3.0))
        .collect();
    let volume: Vec<f64> = determinants
        .iter()
        .map(|det| det.abs().max(1e-12).max(1.0 / det.abs().max(1e-12)))
        .collect();
    let density: Vec<f64> = angle
        .iter()
        .zip(&volume)
        .map(|(angle, volume)| angle * angle + volume)
        .collect();
    let jacobian: Vec<f64> = determinants
        .iter()
        .zip(&angle)
        .map(|(det, angle)| det.signum() / angle)
        .collect();
    let inverted: Vec<f64> = determinants
        .iter()
        .enumerate()
        .map(|(index, det)| f64::from(u8::from(*det <= 0.0 || index % 977 == 5)))
        .collect();
    vtu::write(
        &image,
        Cells {
            tetrahedra: &cells,
            ..Cells::default()
        },
        &[("source", 3, source.as_flattened())],
        &[
            ("angle_distortion", 1, &angle),
            ("volume_distortion", 1, &volume),
            ("determinant", 1, &determinants),
            ("energy_density", 1, &density),
            ("scaled_jacobian", 1, &jacobian),
            ("inverted", 1, &inverted),
        ],
    )
}
