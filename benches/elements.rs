//! Time per unknown for energy and gradient of 8^3 hexahedra of orders 2 to 8, on one thread, with `order + 1` Gauss
//! points a direction (exact to twice the order).
//!
//! `cargo bench --bench elements [cells a side]`. Each figure is a mean over 0.5 s of this thread's own time.

use std::hint::black_box;
use std::time::Instant;
use vargeo::energy::find;
use vargeo::energy::mapping::Density;
use vargeo::fem::basis;
use vargeo::fem::batches::{Batches, references_of_volume};
use vargeo::fem::quadrature::Rule;
use vargeo::fem::space::Space;
use vargeo::fem::volume_energy::VolumeEnergy;
use vargeo::linalg::processor::Processor;
use vargeo::mesh::mixed::MixedMesh;

/// Seconds that this thread has run, so that other load does not count; wall time where the system does not tell.
fn clock(start: Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    match told
        .as_deref()
        .and_then(|text| text.split(' ').next())
        .and_then(|word| word.parse::<f64>().ok())
    {
        Some(nanoseconds) => nanoseconds * 1e-9,
        None => start.elapsed().as_secs_f64(),
    }
}

fn grid(n: u32) -> MixedMesh {
    let side = n + 1;
    let at = |i: u32, j: u32, k: u32| i + side * (j + side * k);
    let mut mesh = MixedMesh::default();
    for k in 0..side {
        for j in 0..side {
            for i in 0..side {
                let [x, y, z] = [i, j, k].map(|c| f64::from(c) / f64::from(n));
                mesh.points
                    .push([x + 0.05 * (3.0 * y).sin(), y + 0.1 * x * z, z - 0.05 * x * x]);
            }
        }
    }
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                let level = |k: u32| [at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k)];
                let ([a, b, c, d], [e, f, g, h]) = (level(k), level(k + 1));
                mesh.hexahedra.push([a, b, c, d, e, f, g, h]);
            }
        }
    }
    mesh
}

fn main() {
    // Rayon runs what one thread asks for on that thread when its pool is that thread.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool of one thread");
    let side = std::env::args()
        .filter_map(|word| word.parse().ok())
        .next()
        .unwrap_or(8);
    let mesh = grid(side);
    let topology = mesh.topology().expect("a grid");
    let references = references_of_volume(mesh.iter().map(|cell| cell.0), mesh.volume());
    println!(
        "{:>22} {:>5} {:>9} {:>14} {:>11}",
        "energy", "order", "unknowns", "processor", "ns/unknown"
    );
    pool.install(|| {
        for energy in ["hencky", "symmetric-dirichlet"] {
            for order in [2, 3, 4, 6, 8, 12] {
                let orders = vec![order; mesh.cells()];
                let space = Space::new(&mesh, &topology, basis::bases()[0], &orders).expect("a space");
                let batches = Batches::new(&space, &references, &|kind| {
                    Rule::Gauss.cell(kind.shape, kind.order + 1)
                });
                let energy_of = find(energy).expect("a listed energy");
                let mut volume =
                    VolumeEnergy::new(batches.expect("batches"), Density::new(energy_of)).expect("an energy");
                let x = space.linear(&mesh.points);
                let mut gradient = vec![0.0; x.len()];
                for processor in Processor::available().into_iter().rev() {
                    volume.set_processor(processor);
                    volume.add_gradient(&x, 1.0, &mut gradient);
                    let origin = Instant::now();
                    let (start, mut runs) = (clock(origin), 0);
                    while clock(origin) - start < 0.5 || runs < 2 {
                        black_box(volume.add_gradient(&x, 1.0, &mut gradient));
                        runs += 1;
                    }
                    let seconds = (clock(origin) - start) / f64::from(runs);
                    println!(
                        "{energy:>22} {order:>5} {:>9} {:>14} {:>11.1}",
                        x.len(),
                        format!("{processor:?}").chars().skip(10).take(9).collect::<String>(),
                        1e9 * seconds / x.len() as f64
                    );
                }
            }
        }
    });
}
