//! Times and figures of volumetric maps on given meshes: what the speed claims of the method rest on.
//!
//! `cargo bench --bench volume_map -- --mesh FILE --target FILE [--scale S] [--energies a,b] [--set key=value ...]`
//!
//! `--set` takes the settings of an experiment file, `solver=l-bfgs`, `relaxed-newton.weight=1e6`. Without files the
//! generated standard case runs: a bumpy twisted ball onto a cube. Wall and processor seconds are both shown, for on a
//! shared machine only the latter compare. `RAYON_NUM_THREADS` sets the number of threads.

use serde_json::{Map, Value, json};
use std::time::Instant;
use vargeo::method::model::{LoadedModel, Part};
use vargeo::method::{Inputs, Method, volume_map::VolumeMap};
use vargeo::optimize::{Iterate, Observer, StopReason};

/// Prints phases with their times, and iterates when asked for.
struct Watch {
    phases: Vec<(String, Instant, f64)>,
    verbose: bool,
}

impl Observer for Watch {
    fn phase(&mut self, name: &str) {
        self.phases
            .push((name.to_string(), Instant::now(), processor_seconds()));
    }

    fn iterate(&mut self, iterate: &Iterate) {
        if self.verbose {
            println!(
                "    {:4} E {:.10} |g| {:.3e} step {:.3e}",
                iterate.iteration, iterate.energy, iterate.gradient_norm, iterate.step
            );
        }
    }

    fn stop(&self) -> Option<StopReason> {
        None
    }
}

/// Seconds that all threads of this process have run; 0 where the system does not tell.
fn processor_seconds() -> f64 {
    let Ok(stat) = std::fs::read_to_string("/proc/self/stat") else {
        return 0.0;
    };
    let Some((_, after)) = stat.rsplit_once(')') else {
        return 0.0;
    };
    let ticks: f64 = after
        .split_whitespace()
        .skip(11)
        .take(2)
        .filter_map(|word| word.parse::<f64>().ok())
        .sum();
    ticks / 100.0
}

fn main() {
    let mut mesh = None;
    let mut target = None;
    let mut scale = 1.0;
    let mut energies = vec!["stretch".to_string()];
    let mut settings = Map::new();
    let mut verbose = false;
    let mut save = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut next = || arguments.next().unwrap_or_default();
        match argument.as_str() {
            "--mesh" => mesh = Some(next()),
            "--target" => target = Some(next()),
            "--scale" => scale = next().parse().unwrap_or(1.0),
            "--energies" => energies = next().split(',').map(str::to_string).collect(),
            "--verbose" => verbose = true,
            "--save" => save = Some(next()),
            "--set" => set(&mut settings, &next()),
            // What cargo passes.
            "--bench" => {}
            other => eprintln!("unknown argument {other}"),
        }
    }
    let file = |path: &str, scale: f64| {
        let bytes = std::fs::read(path).unwrap_or_else(|error| {
            eprintln!("{path}: {error}");
            std::process::exit(2);
        });
        Part::File {
            name: path.to_string(),
            bytes,
            parameters: json!({ "scale": scale }),
        }
    };
    let mut model = LoadedModel::default();
    model.parts.insert(
        "mesh".into(),
        mesh.as_deref().map_or_else(
            || Part::Generated {
                generator: "bumpy".into(),
                parameters: json!({ "tetrahedra": 12_600 }),
            },
            |path| file(path, 1.0),
        ),
    );
    model.parts.insert(
        "target".into(),
        target.as_deref().map_or_else(
            || Part::Generated {
                generator: "cube".into(),
                parameters: json!({}),
            },
            |path| file(path, scale),
        ),
    );
    println!(
        "{:24} {:>10} {:>5} {:>4} {:>8} {:>9} {:>8} {:>9} {:>5} {:>9} {:>10} {:>7} {:>7}",
        "energy", "stop", "inv", "flat", "D_aa", "D_ma", "D_av", "D_mv", "it", "E", "|Cu-p|^2", "wall s", "cpu s"
    );
    for energy in &energies {
        settings.insert("energy".into(), json!(energy));
        let settings = Value::Object(settings.clone());
        let mut watch = Watch {
            phases: Vec::new(),
            verbose,
        };
        let (start, processor) = (Instant::now(), processor_seconds());
        let outcome = VolumeMap.run(
            Inputs {
                settings: &settings,
                model: model.clone(),
            },
            &mut watch,
        );
        let (wall, processor_end) = (start.elapsed().as_secs_f64(), processor_seconds());
        match outcome {
            Ok(outcome) => {
                let metric = |name: &str| outcome.metrics.get(name).copied().unwrap_or(f64::NAN);
                println!(
                    "{energy:24} {:>10} {:5} {:4} {:8.4} {:9.3} {:8.4} {:9.3} {:5} {:9.6} {:10.2e} {wall:7.2} {:7.2}",
                    outcome.stop,
                    metric("inverted"),
                    metric("degenerate"),
                    metric("d_aa"),
                    metric("d_ma"),
                    metric("d_av"),
                    metric("d_mv"),
                    outcome.counters.get("iterations").copied().unwrap_or(0),
                    metric("energy"),
                    metric("constraint_residual"),
                    processor_end - processor,
                );
                println!("    {}", outcome.reason);
                println!(
                    "    mean det error {:.1e}, min det {:.3e}, scaled Jacobian {:.3e} to mean {:.4}, counters {:?}",
                    metric("mean_determinant_error"),
                    metric("min_determinant"),
                    metric("scaled_jacobian_min"),
                    metric("scaled_jacobian_mean"),
                    outcome.counters
                );
                for notice in &outcome.notices {
                    println!("    notice: {notice}");
                }
                if let (Some(path), Some(mesh)) = (&save, &outcome.mesh)
                    && let Err(error) = std::fs::write(path, mesh)
                {
                    eprintln!("{path}: {error}");
                }
            }
            Err(failure) => println!("{energy:24} failed ({}): {}", failure.kind, failure.reason),
        }
        let ends = watch
            .phases
            .iter()
            .skip(1)
            .map(|(_, at, cpu)| (*at, *cpu))
            .chain([(Instant::now(), processor_end)]);
        let phases: Vec<String> = watch
            .phases
            .iter()
            .zip(ends)
            .map(|((name, at, cpu), (end, cpu_end))| {
                format!("{name} {:.2} s (cpu {:.2})", (end - *at).as_secs_f64(), cpu_end - cpu)
            })
            .collect();
        println!("    {}", phases.join(", "));
    }
}

/// `path.to.key=value` into a table of settings; numbers and booleans are recognised.
fn set(settings: &mut Map<String, Value>, assignment: &str) {
    let Some((path, word)) = assignment.split_once('=') else {
        return;
    };
    let value = word
        .parse::<i64>()
        .map(Value::from)
        .or_else(|_| word.parse::<f64>().map(Value::from))
        .or_else(|_| word.parse::<bool>().map(Value::from))
        .unwrap_or_else(|_| Value::from(word));
    match path.split_once('.') {
        None => {
            settings.insert(path.to_string(), value);
        }
        Some((table, key)) => {
            if let Value::Object(table) = settings.entry(table).or_insert_with(|| json!({})) {
                table.insert(key.to_string(), value);
            }
        }
    }
}
