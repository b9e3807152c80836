//! Time and figures of the distance between two surfaces.
//!
//! `cargo bench --bench hausdorff -- FIRST SECOND [...]`: the first surface against the second, both ways, then the next
//! pair. Without files a bumpy sphere against its noisy copy. `RAYON_NUM_THREADS` sets the number of threads,
//! `SPACING` the spacing of the samples as a share of the diagonal. Processor time is shown beside wall time, for
//! other load counts in the latter.

use std::time::Instant;
use vargeo::geometry::closest_point::ClosestPoint;
use vargeo::mesh::format;
use vargeo::mesh::{self, TriangleMesh};
use vargeo::metric::distance::{Sampling, one_sided};

fn read(path: &str) -> TriangleMesh {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let content = format::read(path, &bytes).unwrap_or_else(|error| panic!("{error}"));
    TriangleMesh {
        points: content.points,
        cells: content.triangles,
    }
}

/// A sphere of latitude and longitude with bumps and noise.
fn sphere(noise: f64) -> TriangleMesh {
    let (rows, columns) = (180u32, 170u32);
    let mut surface = TriangleMesh::default();
    for row in 0..=rows {
        for column in 0..columns {
            let theta = std::f64::consts::PI * f64::from(row) / f64::from(rows);
            let phi = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
            let bump = 1.0 + 0.1 * (5.0 * theta).sin() * (4.0 * phi).cos();
            let radius = bump + noise * (f64::from(row * 7919 + column * 104_729)).sin();
            surface.points.push([
                radius * theta.sin() * phi.cos(),
                radius * theta.sin() * phi.sin(),
                radius * theta.cos(),
            ]);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let at = |row: u32, column: u32| row * columns + column % columns;
            let [a, b, c, d] = [
                at(row, column),
                at(row + 1, column),
                at(row + 1, column + 1),
                at(row, column + 1),
            ];
            surface.cells.extend([[a, b, c], [a, c, d]]);
        }
    }
    surface
}

/// Seconds that all threads of this process have run; 0 where the system does not tell.
fn processor_seconds() -> f64 {
    let Ok(stat) = std::fs::read_to_string("/proc/self/stat") else {
        return 0.0;
    };
    let Some((_, after)) = stat.rsplit_once(')') else {
        return 0.0;
    };
    let ticks = after.split_whitespace().skip(11).take(2);
    ticks.filter_map(|word| word.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn main() {
    let files: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with("--"))
        .collect();
    if files.is_empty() {
        compare("noisy sphere", &sphere(0.002), &sphere(0.0));
    }
    for pair in files.chunks_exact(2) {
        compare(&pair.join(" against "), &read(&pair[0]), &read(&pair[1]));
    }
}

fn compare(title: &str, first: &TriangleMesh, second: &TriangleMesh) {
    println!("{title}, {} threads", rayon::current_num_threads());
    let mut sampling = Sampling::of_diagonal(mesh::diagonal(&second.points));
    if let Some(share) = std::env::var("SPACING").ok().and_then(|word| word.parse::<f64>().ok()) {
        sampling.spacing = share * mesh::diagonal(&second.points);
    }
    for (way, from, to) in [("forward", first, second), ("backward", second, first)] {
        let start = Instant::now();
        let tree = ClosestPoint::new(to);
        let built = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let processor = processor_seconds();
        let distance = one_sided(from, &tree, sampling, &|| false).expect("never stopped");
        let measured = start.elapsed().as_secs_f64();
        let processor = processor_seconds() - processor;
        println!(
            "  {way}: max {:.6e} (certain to {:.1e}) mean {:.6e} rms {:.6e}; tree {:.1} ms, {} samples in {:.3} s ({:.2} s on processors), {:.3} us a sample",
            distance.max,
            distance.bound - distance.max,
            distance.mean,
            distance.rms,
            1e3 * built,
            distance.samples,
            measured,
            processor,
            1e6 * processor / distance.samples as f64
        );
    }
}
