//! Time of the restricted Voronoi diagram with the centroidal energy and its gradient, on one thread and on several.
//!
//! `cargo bench --bench restricted_voronoi -- [surface.obj] [sites...]`; a bumpy torus of 60k triangles and 1k, 10k
//! and 100k sites by default. Sites are spread at random and relaxed by Lloyd's iteration. Figures for one thread are
//! its own time, for several the time on the wall; the best of several runs. `l-bfgs`: 30 iterations from scattered
//! sites. With the word `l-bfgs` only these, on one thread and two in turn, with the wall's time of both, which compare
//! only while nothing else runs.

use std::f64::consts::TAU;
use std::time::Instant;
use vargeo::geometry::centroidal_voronoi::{Method, Relaxation, relax, scatter};
use vargeo::geometry::point_tree::PointTree;
use vargeo::geometry::squared_distance::{Anisotropy, Options, SquaredDistance, Wanted};
use vargeo::optimize::Silent;

fn torus(n: usize, m: usize) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let mut points = Vec::new();
    let mut cells = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (i as f64 / n as f64 * TAU, j as f64 / m as f64 * TAU);
            let radius = 0.35 * (1.0 + 0.1 * (7.0 * a).sin() * (5.0 * b).cos());
            let ring = 1.0 + radius * b.cos();
            points.push([ring * a.cos(), ring * a.sin(), radius * b.sin()]);
            let at = |i: usize, j: usize| ((i % n) * m + j % m) as u32;
            cells.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            cells.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    (points, cells)
}

fn read(path: &str) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let text = std::fs::read_to_string(path).expect("a readable file");
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => points.push(std::array::from_fn(|_| {
                words.next().and_then(|w| w.parse().ok()).expect("a number")
            })),
            Some("f") => cells.push(std::array::from_fn(|_| {
                let index: u32 = words
                    .next()
                    .and_then(|w| w.split('/').next())
                    .and_then(|w| w.parse().ok())
                    .expect("an index");
                index - 1
            })),
            _ => {}
        }
    }
    (points, cells)
}

/// Seconds that this thread has run, so that other load does not count.
fn clock() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Milliseconds of the quickest run: of this thread alone, or by the clock on the wall.
fn best(runs: usize, alone: bool, mut work: impl FnMut()) -> f64 {
    let start = Instant::now();
    let now = || {
        if alone { clock() } else { start.elapsed().as_secs_f64() }
    };
    (0..runs).fold(f64::INFINITY, |best, _| {
        let begin = now();
        work();
        best.min((now() - begin) * 1e3)
    })
}

const RELAXATION: Relaxation = Relaxation {
    method: Method::Lbfgs,
    iterations: 30,
    tolerance: 0.0,
};

/// Relaxations on one thread and on two, again and again, so that both meet the same other load.
fn in_turn(points: &[[f64; 3]], cells: &[[u32; 3]], counts: &[usize]) {
    println!("{:>8} {:>9} {:>9} {:>9}", "sites", "1 thread", "2 threads", "ratio");
    let pools = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads")
    });
    for &count in counts {
        let start = scatter(points, cells, count, 1);
        let mut term = SquaredDistance::new(points, cells).expect("a valid surface");
        let mut least = [f64::INFINITY; 2];
        for _ in 0..(100_000 / count).clamp(3, 10) {
            for (pool, least) in pools.iter().zip(&mut least) {
                let time = pool.install(|| {
                    best(1, false, || {
                        relax(&mut term, points, &start, &RELAXATION, &mut Silent);
                    })
                });
                *least = least.min(time);
            }
        }
        let [one, two] = least;
        println!("{count:>8} {one:>9.1} {two:>9.1} {:>9.3}", one / two);
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let file = words.iter().find(|word| word.ends_with(".obj"));
    let mut counts: Vec<usize> = words.iter().filter_map(|word| word.parse().ok()).collect();
    if counts.is_empty() {
        counts = vec![1_000, 10_000, 100_000];
    }
    let (points, cells) = file.map_or_else(|| torus(300, 100), |file| read(file));
    println!("{} triangles; milliseconds", cells.len());
    if words.iter().any(|word| word == "l-bfgs") {
        return in_turn(&points, &cells, &counts);
    }
    println!(
        "{:>8} {:>7} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>8}",
        "sites", "threads", "tree", "value", "gradient", "s=50", "surface", "l-bfgs", "pieces"
    );
    for &count in &counts {
        let mut sites = scatter(&points, &cells, count, 7);
        let mut term = SquaredDistance::new(&points, &cells).expect("a valid surface");
        let mut tree = PointTree::default();
        let mut areas = vec![0.0; count];
        let mut moments = vec![[0.0; 3]; count];
        for _ in 0..20 {
            tree.set(&sites);
            let wanted = Wanted {
                areas: Some(&mut areas),
                moments: Some(&mut moments),
                ..Wanted::default()
            };
            term.evaluate(&points, &tree, &Options::default(), wanted);
            for ((site, area), moment) in sites.iter_mut().zip(&areas).zip(&moments) {
                if *area > 0.0 {
                    *site = moment.map(|x| x / area);
                }
            }
        }
        let mut pieces = 0;
        term.diagram().pieces(&points, &tree, None, |_| pieces += 1);
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads");
            let runs = 10;
            pool.install(|| {
                // Until the threads have found their processors.
                let start = Instant::now();
                while start.elapsed().as_secs_f64() < 0.5 {
                    term.evaluate(&points, &tree, &Options::default(), Wanted::default());
                }
                let mut gradient = vec![[0.0; 3]; count];
                let build = best(runs, threads == 1, || tree.set(&sites));
                let plain = Options::default();
                let stretched = Options {
                    anisotropy: Anisotropy::Facets(50.0),
                    ..Options::default()
                };
                let value = best(runs, threads == 1, || {
                    term.evaluate(&points, &tree, &plain, Wanted::default());
                });
                let mut by_sites = |options: &Options<'_>| {
                    best(runs, threads == 1, || {
                        let wanted = Wanted {
                            sites: Some(&mut gradient),
                            ..Wanted::default()
                        };
                        term.evaluate(&points, &tree, options, wanted);
                    })
                };
                let (gradient, anisotropic) = (by_sites(&plain), by_sites(&stretched));
                let mut forces = vec![[0.0; 3]; points.len()];
                let surface = best(runs, threads == 1, || {
                    let wanted = Wanted {
                        surface: Some(&mut forces),
                        ..Wanted::default()
                    };
                    term.evaluate(&points, &tree, &plain, wanted);
                });
                let start = scatter(&points, &cells, count, 1);
                let relaxed = best(1, threads == 1, || {
                    relax(&mut term, &points, &start, &RELAXATION, &mut Silent);
                });
                println!(
                    "{count:>8} {threads:>7} {build:>9.2} {value:>9.2} {gradient:>9.2} {anisotropic:>9.2} {surface:>9.2} {relaxed:>9.1} {pieces:>8}"
                );
            });
        }
    }
}
