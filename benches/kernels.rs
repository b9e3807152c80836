//! Time per tetrahedron for value, gradient, projected Hessian and the largest valid step, on one thread.
//!
//! `cargo bench --bench kernels [tetrahedra]`; 100,000 tetrahedra by default. Each figure is a mean over 0.3 s.

use std::hint::black_box;
use std::time::Instant;
use vargeo::energy::lim_barrier::LimBarrier;
use vargeo::energy::mapping::{BLOCK_NUMBERS, Density, MappingEnergy};
use vargeo::energy::untangling::Untangling;
use vargeo::energy::{energies, find};
use vargeo::linalg::processor::Processor;
use vargeo::mesh::TetrahedralMesh;

/// A cube of n^3 cells of six tetrahedra.
fn grid(n: usize) -> TetrahedralMesh {
    let index = |c: [usize; 3]| (c[0] + (n + 1) * (c[1] + (n + 1) * c[2])) as u32;
    let mut mesh = TetrahedralMesh::default();
    let side = n + 1;
    for vertex in 0..side * side * side {
        let c = [vertex % side, vertex / side % side, vertex / (side * side)];
        mesh.points.push(c.map(|x| x as f64 / n as f64));
    }
    let paths = [
        ([0, 1, 2], false),
        ([1, 2, 0], false),
        ([2, 0, 1], false),
        ([0, 2, 1], true),
        ([2, 1, 0], true),
        ([1, 0, 2], true),
    ];
    for cube in 0..n * n * n {
        let start = [cube % n, cube / n % n, cube / (n * n)];
        for (axes, odd) in paths {
            let mut corner = start;
            let mut cell = [index(corner); 4];
            for step in 0..3 {
                corner[axes[step]] += 1;
                cell[step + 1] = index(corner);
            }
            if odd {
                cell.swap(1, 2);
            }
            mesh.cells.push(cell);
        }
    }
    mesh
}

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

/// Nanoseconds per tetrahedron, the mean over 0.3 s.
fn time(cells: usize, mut work: impl FnMut()) -> f64 {
    let start = Instant::now();
    work();
    let begin = clock(start);
    let mut runs = 0;
    while clock(start) - begin < 0.3 {
        work();
        runs += 1;
    }
    (clock(start) - begin) * 1e9 / (runs * cells) as f64
}

fn main() {
    let wanted: f64 = std::env::args()
        .skip(1)
        .find_map(|word| word.parse().ok())
        .unwrap_or(100_000.0);
    let mesh = grid((wanted / 6.0).cbrt().round().max(1.0) as usize);
    let cells = mesh.cells.len();
    // Smooth, with some noise: singular values differ, determinants are positive.
    let h = 1.0 / (wanted / 6.0).cbrt();
    let mut seed = 1_u64;
    let mut noise = || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / (1_u64 << 30) as f64 - 1.0
    };
    let positions: Vec<f64> = mesh
        .points
        .iter()
        .flat_map(|&[x, y, z]| {
            let bent = [x + 0.2 * y * y, 0.8 * y + 0.1 * z * x, 1.2 * z + 0.2 * x * y];
            bent.map(|c| c + 0.1 * h * noise())
        })
        .collect();
    let along: Vec<f64> = positions.iter().map(|_| noise() * h).collect();
    let weights = vec![1.0 / cells as f64; cells];
    let mut gradient = vec![0.0; positions.len()];
    let mut blocks = vec![0.0; BLOCK_NUMBERS * cells];
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");

    let mut densities: Vec<(String, Density)> = energies()
        .iter()
        .map(|&energy| (energy.name().to_string(), Density::new(energy)))
        .collect();
    let lpm = find("lpm").expect("in the list");
    densities.push((
        "lpm + barrier".to_string(),
        Density::new(lpm).with_barrier(0.01, LimBarrier::new(1.0)),
    ));
    densities.push((
        "untangling".to_string(),
        Density::of(Untangling {
            epsilon: 0.01,
            lambda: 1.0,
        }),
    ));

    for processor in Processor::available() {
        println!("{cells} tetrahedra, one thread, {processor:?}: nanoseconds per tetrahedron");
        println!(
            "{:26} {:>8} {:>8} {:>8} {:>8}",
            "", "value", "gradient", "Hessian", "max step"
        );
        for (name, density) in &densities {
            let mut energy = MappingEnergy::new(&mesh, &weights, density.clone(), None).expect("a valid mesh");
            energy.set_processor(processor);
            pool.install(|| {
                let value = time(cells, || {
                    black_box(energy.value(&positions));
                });
                let slope = time(cells, || {
                    black_box(energy.gradient(&positions, &mut gradient));
                });
                let hessian = time(cells, || {
                    black_box(energy.hessian(&positions, &mut gradient, &mut blocks));
                });
                let step = time(cells, || {
                    black_box(energy.max_step(&positions, &along));
                });
                println!("{name:26} {value:8.1} {slope:8.1} {hessian:8.1} {step:8.1}");
            });
        }
    }
}
