//! Order, analysis, factorization and solution of linear elasticity with a fixed boundary, beside faer's own sparse
//! Cholesky with its minimum-degree order.
//!
//! `cargo bench --bench factorization -- [--no-faer] [--size N]... [FILE.mesh]...`: cubes of N^3 cubes, six tetrahedra
//! each, and tetrahedral meshes in MEDIT text format. Without arguments: N = 12, 20 and 28.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{MatMut, Par, Side, Spec};
use std::time::Instant;
use vargeo::linalg::sparse::{BlockCholesky, BlockPattern, FIXED, nested_dissection};

struct Mesh {
    name: String,
    points: Vec<[f64; 3]>,
    cells: Vec<[u32; 4]>,
}

fn main() {
    let mut meshes = Vec::new();
    let mut beside = true;
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--no-faer" => beside = false,
            "--size" => {
                let size = arguments.next().and_then(|size| size.parse().ok());
                meshes.push(grid(size.expect("--size is followed by a whole number")));
            }
            path => meshes.push(medit(path)),
        }
    }
    if meshes.is_empty() {
        meshes.extend([12, 20, 28].map(grid));
    }
    println!("times in seconds; order, analysis and faer's analysis on one thread; factor on 1 and 2 threads");
    for mesh in &meshes {
        measure(mesh, beside);
    }
}

fn measure(mesh: &Mesh, beside: bool) {
    let free = interior(mesh);
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool of one thread");
    let two = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .build()
        .expect("a pool of two threads");
    let mut order_seconds = 0.0;
    let (pattern, seconds) = one.install(|| {
        timed(|| {
            BlockPattern::<3>::with_order(&mesh.points, &mesh.cells, &free, |graph, points| {
                let (order, seconds) = timed(|| nested_dissection(graph, points));
                order_seconds = seconds;
                order
            })
            .expect("a valid mesh")
        })
    });
    let parts = elasticity(mesh);
    let mut values = vec![0.0; pattern.values_len()];
    pattern.assemble(&parts, &mut values);
    let ((), assemble) = one.install(|| timed(|| pattern.assemble(&parts, &mut values)));
    let elimination = pattern.elimination();
    println!(
        "\n{}: {} tetrahedra, {} unknowns",
        mesh.name,
        mesh.cells.len(),
        pattern.dimension()
    );
    println!(
        "  vargeo: {} fronts, {:.1} M scalars in the factor, {:.1} M at work, {:.2} G operations",
        elimination.fronts(),
        elimination.factor_scalars() as f64 * 1e-6,
        elimination.working_scalars() as f64 * 1e-6,
        elimination.operations() * 1e-9
    );
    let operations = elimination.operations();
    let rhs: Vec<f64> = (0..pattern.dimension())
        .map(|index| (index as f64 * 0.7).sin())
        .collect();
    let mut cholesky = BlockCholesky::new(pattern);
    cholesky
        .factorize(&values, 0.0)
        .expect("elasticity with a fixed boundary is positive definite");
    let best = |cholesky: &mut BlockCholesky<3>, pool: &rayon::ThreadPool| {
        (0..3)
            .map(|_| pool.install(|| timed(|| cholesky.factorize(&values, 0.0).expect("positive definite")).1))
            .fold(f64::INFINITY, f64::min)
    };
    let factor = [best(&mut cholesky, &one), best(&mut cholesky, &two)];
    let mut x = rhs.clone();
    let ((), solve) = one.install(|| timed(|| cholesky.solve_in_place(&mut x)));
    let mut product = vec![0.0; rhs.len()];
    let ((), multiply) = timed(|| cholesky.pattern().multiply(&values, &x, &mut product));
    println!(
        "    order {order_seconds:.3}  analysis {:.3}  assembly {assemble:.4}  factor {:.3} / {:.3} ({:.1} / {:.1} G/s)  solve {solve:.4}  product {multiply:.4}  residual {:.1e}",
        seconds - order_seconds,
        factor[0],
        factor[1],
        operations * 1e-9 / factor[0],
        operations * 1e-9 / factor[1],
        residual(&product, &rhs)
    );
    if beside {
        faer_beside(mesh, cholesky.pattern(), &parts, &rhs);
    }
}

fn faer_beside(mesh: &Mesh, pattern: &BlockPattern<3>, parts: &[f64], rhs: &[f64]) {
    let (offsets, rows, values) = lower_columns(mesh, pattern, parts);
    let n = pattern.dimension();
    let structure = SymbolicSparseColMatRef::new_checked(n, n, &offsets, None, &rows);
    let matrix = SparseColMatRef::new(structure, &values[..]);
    let order = pattern.elimination().order();
    let forward: Vec<usize> = order
        .iter()
        .flat_map(|&vertex| (0..3).map(move |component| 3 * vertex as usize + component))
        .collect();
    let mut inverse = vec![0; n];
    for (position, &unknown) in forward.iter().enumerate() {
        inverse[unknown] = position;
    }
    let ours = PermRef::new_checked(&forward, &inverse, n);
    faer_factorization("minimum degree", matrix, SymmetricOrdering::Amd, rhs);
    faer_factorization("the order of vargeo", matrix, SymmetricOrdering::Custom(ours), rhs);
}

fn faer_factorization(
    name: &str,
    matrix: SparseColMatRef<'_, usize, f64>,
    order: SymmetricOrdering<'_, usize>,
    rhs: &[f64],
) {
    let (structure, n) = (matrix.symbolic(), rhs.len());
    let (symbolic, analysis) = timed(|| {
        factorize_symbolic_cholesky(structure, Side::Lower, order, Default::default()).expect("enough memory")
    });
    let mut factor = vec![0.0; symbolic.len_val()];
    let mut seconds = [f64::INFINITY; 2];
    let mut solve = 0.0;
    let mut x = rhs.to_vec();
    for (seconds, par) in seconds.iter_mut().zip([Par::Seq, Par::rayon(2)]) {
        let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(par, Spec::default()));
        let stack = MemStack::new(&mut memory);
        for _ in 0..2 {
            let (result, time) = timed(|| {
                symbolic
                    .factorize_numeric_llt(
                        &mut factor,
                        matrix,
                        Side::Lower,
                        Default::default(),
                        par,
                        stack,
                        Spec::default(),
                    )
                    .map(|_| ())
            });
            result.expect("positive definite");
            *seconds = seconds.min(time);
        }
    }
    let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
    let solver = faer::sparse::linalg::cholesky::LltRef::<usize, f64>::new(&symbolic, &factor);
    for _ in 0..2 {
        x.copy_from_slice(rhs);
        let right = MatMut::from_column_major_slice_mut(&mut x, n, 1);
        solve = timed(|| {
            solver.solve_in_place_with_conj(faer::Conj::No, right, Par::Seq, MemStack::new(&mut memory));
        })
        .1;
    }
    println!(
        "  faer, {name}: {:.1} M scalars in the factor\n    order and analysis {analysis:.3}  factor {:.3} / {:.3}  solve {solve:.4}",
        symbolic.len_val() as f64 * 1e-6,
        seconds[0],
        seconds[1]
    );
}

/// The matrix as compressed columns of its lower triangle.
fn lower_columns(mesh: &Mesh, pattern: &BlockPattern<3>, parts: &[f64]) -> (Vec<usize>, Vec<usize>, Vec<f64>) {
    let free = pattern.free_index();
    let mut entries: Vec<(usize, usize, f64)> = Vec::new();
    let mut blocks = parts.chunks(9);
    for cell in &mesh.cells {
        for a in 0..4 {
            for (b, block) in (a..4).zip(blocks.by_ref()) {
                let (i, j) = (free[cell[a] as usize], free[cell[b] as usize]);
                if i == FIXED || j == FIXED {
                    continue;
                }
                for (index, &value) in block.iter().enumerate() {
                    let (row, column) = (3 * i as usize + index / 3, 3 * j as usize + index % 3);
                    if i != j || row >= column {
                        entries.push((row.min(column), row.max(column), value));
                    }
                }
            }
        }
    }
    entries.sort_by_key(|entry| (entry.0, entry.1));
    let mut offsets = vec![0; pattern.dimension() + 1];
    let (mut rows, mut values): (Vec<usize>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut last = None;
    for (column, row, value) in entries {
        if last == Some((column, row)) {
            *values.last_mut().expect("an entry came before") += value;
        } else {
            rows.push(row);
            values.push(value);
            offsets[column + 1] += 1;
            last = Some((column, row));
        }
    }
    for column in 0..pattern.dimension() {
        offsets[column + 1] += offsets[column];
    }
    (offsets, rows, values)
}

fn residual(product: &[f64], rhs: &[f64]) -> f64 {
    let difference: f64 = product.iter().zip(rhs).map(|(a, b)| (a - b) * (a - b)).sum();
    (difference / rhs.iter().map(|b| b * b).sum::<f64>()).sqrt()
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}

/// Stiffness of linear elasticity, both Lame moduli 1.
fn elasticity(mesh: &Mesh) -> Vec<f64> {
    let mut parts = Vec::with_capacity(90 * mesh.cells.len());
    for cell in &mesh.cells {
        let p = cell.map(|vertex| nalgebra::Vector3::from(mesh.points[vertex as usize]));
        let edges = nalgebra::Matrix3::from_columns(&[p[1] - p[0], p[2] - p[0], p[3] - p[0]]);
        let volume = edges.determinant().abs() / 6.0;
        let inverse = edges.try_inverse().expect("no flat tetrahedron");
        let mut gradients = [nalgebra::Vector3::zeros(); 4];
        for a in 1..4 {
            gradients[a] = inverse.row(a - 1).transpose();
            gradients[0] -= gradients[a];
        }
        for a in 0..4 {
            for b in a..4 {
                let (g, h) = (gradients[a], gradients[b]);
                let block =
                    volume * (nalgebra::Matrix3::identity() * g.dot(&h) + h * g.transpose() + g * h.transpose());
                parts.extend((0..9).map(|index| block[(index / 3, index % 3)]));
            }
        }
    }
    parts
}

/// Vertices on no boundary triangle.
fn interior(mesh: &Mesh) -> Vec<bool> {
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for &[a, b, c, d] in &mesh.cells {
        for mut face in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
            face.sort_unstable();
            faces.push(face);
        }
    }
    faces.sort_unstable();
    let mut free = vec![false; mesh.points.len()];
    for &vertex in mesh.cells.iter().flatten() {
        free[vertex as usize] = true;
    }
    for run in faces.chunk_by(|a, b| a == b).filter(|run| run.len() == 1) {
        for &vertex in &run[0] {
            free[vertex as usize] = false;
        }
    }
    free
}

fn grid(n: usize) -> Mesh {
    let m = n + 1;
    // Slightly irregular, so that no order is favoured by symmetry.
    let points = (0..m * m * m)
        .map(|v| [v % m, v / m % m, v / m / m].map(|c| c as f64 + 0.1 * ((v * 37 + c * 11) as f64).sin()))
        .collect();
    let mut cells = Vec::new();
    for cube in 0..n * n * n {
        for axes in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut at = [cube % n, cube / n % n, cube / n / n];
            let mut cell = [(at[0] + m * (at[1] + m * at[2])) as u32; 4];
            for (place, axis) in axes.into_iter().enumerate() {
                at[axis] += 1;
                cell[place + 1] = (at[0] + m * (at[1] + m * at[2])) as u32;
            }
            cells.push(cell);
        }
    }
    Mesh {
        name: format!("cube of {n}^3 cubes"),
        points,
        cells,
    }
}

/// The points and tetrahedra of a MEDIT text file.
fn medit(path: &str) -> Mesh {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("cannot read {path}: {error}"));
    let mut words = text.split_whitespace();
    let mut mesh = Mesh {
        name: path.rsplit('/').next().unwrap_or(path).into(),
        points: vec![],
        cells: vec![],
    };
    while let Some(word) = words.next() {
        let mut number = || {
            words
                .next()
                .and_then(|word| word.parse::<f64>().ok())
                .expect("a number")
        };
        match word {
            "Vertices" => {
                for _ in 0..number() as usize {
                    mesh.points.push([number(), number(), number()]);
                    number();
                }
            }
            "Tetrahedra" => {
                for _ in 0..number() as usize {
                    mesh.cells.push([0; 4].map(|_| number() as u32 - 1));
                    number();
                }
            }
            _ => {}
        }
    }
    mesh
}
