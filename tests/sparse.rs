//! Sparse block systems: against dense algebra, against their own residual, and the same bits with any number of threads.

use crate::sample::{Noise, with_threads};
use vargeo::linalg::sparse::{BlockCholesky, BlockPattern, Elimination, Graph, PatternError, nested_dissection};
use vargeo::mesh::generate::lattice::kuhn;

/// A cube of `n^3` cubes, six tetrahedra each around the main diagonal.
fn grid(n: usize) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let mesh = kuhn(n);
    (mesh.points, mesh.cells)
}

fn inside(points: &[[f64; 3]]) -> Vec<bool> {
    points
        .iter()
        .map(|p| p.iter().all(|&c| c > 1e-9 && c < 1.0 - 1e-9))
        .collect()
}

/// Numbers in (-1, 1), the same on every run.
fn noise(count: usize, seed: u64) -> Vec<f64> {
    let mut noise = Noise(seed);
    (0..count).map(|_| noise.number()).collect()
}

/// For each cell a positive definite matrix `M M^T + I` as its ten blocks.
fn parts<const B: usize, const N: usize>(cells: usize) -> Vec<f64> {
    let size = B * N;
    let mut parts = Vec::new();
    for cell in 0..cells {
        let m = noise(size * size, cell as u64 + 1);
        let entry = |i: usize, j: usize| {
            (0..size).map(|k| m[i * size + k] * m[j * size + k]).sum::<f64>() + f64::from(u8::from(i == j))
        };
        for a in 0..N {
            for b in a..N {
                for row in 0..B {
                    for column in 0..B {
                        parts.push(entry(B * a + row, B * b + column));
                    }
                }
            }
        }
    }
    parts
}

/// The dense matrix over the free unknowns, summed straight from the parts.
fn dense<const B: usize, const N: usize>(
    pattern: &BlockPattern<B>,
    cells: &[[u32; N]],
    parts: &[f64],
) -> nalgebra::DMatrix<f64> {
    let mut matrix = nalgebra::DMatrix::zeros(pattern.dimension(), pattern.dimension());
    let mut blocks = parts.chunks(B * B);
    for cell in cells {
        for a in 0..N {
            for b in a..N {
                let block = blocks.next().unwrap();
                let (i, j) = (
                    pattern.free_index()[cell[a] as usize],
                    pattern.free_index()[cell[b] as usize],
                );
                if i == u32::MAX || j == u32::MAX {
                    continue;
                }
                for row in 0..B {
                    for column in 0..B {
                        let (i, j) = (B * i as usize + row, B * j as usize + column);
                        matrix[(i, j)] += block[row * B + column];
                        if a != b {
                            matrix[(j, i)] += block[row * B + column];
                        }
                    }
                }
            }
        }
    }
    matrix
}

fn agrees_with_dense<const B: usize, const N: usize>(points: &[[f64; 3]], cells: &[[u32; N]], free: &[bool]) {
    let pattern = BlockPattern::<B>::new(points, cells, free).unwrap();
    let parts = parts::<B, N>(cells.len());
    let mut values = vec![f64::NAN; pattern.values_len()];
    pattern.assemble(&parts, &mut values);
    pattern.add_to_diagonal(&mut values, 1, 0.25);
    let mut expected = dense(&pattern, cells, &parts);
    for c in 0..B {
        expected[(B + c, B + c)] += 0.25;
    }
    let scale = expected.amax();
    let x = noise(pattern.dimension(), 99);
    let mut product = vec![f64::NAN; x.len()];
    pattern.multiply(&values, &x, &mut product);
    let expected_product = &expected * nalgebra::DVector::from_column_slice(&x);
    for (a, b) in product.iter().zip(expected_product.iter()) {
        assert!((a - b).abs() < 1e-13 * scale, "{a} {b}");
    }
    for (a, b) in pattern.diagonal(&values).iter().zip(expected.diagonal().iter()) {
        assert!((a - b).abs() < 1e-13 * scale);
    }
    let mut cholesky = BlockCholesky::new(pattern);
    for shift in [0.0, 3.5] {
        cholesky.factorize(&values, shift).unwrap();
        let mut rhs: Vec<f64> = product.clone();
        rhs.extend_from_slice(&x);
        cholesky.solve_many_in_place(&mut rhs, 2);
        let shifted = &expected + nalgebra::DMatrix::identity(x.len(), x.len()) * shift;
        let solver = shifted.cholesky().unwrap();
        let first = solver.solve(&nalgebra::DVector::from_column_slice(&product));
        let second = solver.solve(&nalgebra::DVector::from_column_slice(&x));
        for (a, b) in rhs.iter().zip(first.iter().chain(second.iter())) {
            assert!((a - b).abs() < 1e-10, "{a} {b}");
        }
    }
    assert_eq!(cholesky.factorizations(), 2);
}

#[test]
fn blocks_agree_with_dense_algebra() {
    let (points, cells) = grid(5);
    agrees_with_dense::<3, 4>(&points, &cells, &inside(&points));
    agrees_with_dense::<1, 4>(&points, &cells, &vec![true; points.len()]);
    let triangles: Vec<[u32; 3]> = cells
        .iter()
        .flat_map(|c| [[c[0], c[1], c[2]], [c[1], c[2], c[3]]])
        .collect();
    agrees_with_dense::<2, 3>(&points, &triangles, &vec![true; points.len()]);
    let edges: Vec<[u32; 2]> = cells.iter().flat_map(|c| [[c[2], c[3]], [c[0], c[1]]]).collect();
    agrees_with_dense::<1, 2>(&points, &edges, &vec![true; points.len()]);
}

#[test]
fn pivots_of_known_signs_agree_with_dense_algebra() {
    // Saddle points with a vertex's two unknowns together: a negative diagonal and a positive definite coupling.
    let (points, cells) = grid(6);
    let edges: Vec<[u32; 2]> = cells
        .iter()
        .flat_map(|c| [[c[2], c[3]], [c[0], c[1]], [c[1], c[2]]])
        .collect();
    let graph = Graph::of_cells(points.len(), &edges, Some);
    let pattern = BlockPattern::<2>::of_graph(&graph, &nested_dissection(&graph, &points));
    let mut values = vec![0.0; pattern.values_len()];
    let mut expected = nalgebra::DMatrix::zeros(pattern.dimension(), pattern.dimension());
    let amounts = noise(graph.neighbours.len(), 5);
    for vertex in 0..graph.len() {
        let mut couple = |other: usize, block: [f64; 4]| {
            let (start, exchanged) = pattern.block(vertex, other).expect("an edge");
            let [a, b, c, d] = block;
            values[start..start + 4].copy_from_slice(&if exchanged { [a, c, b, d] } else { block });
            for (index, value) in [a, b, c, d].into_iter().enumerate() {
                expected[(2 * vertex + index / 2, 2 * other + index % 2)] = value;
            }
        };
        for &other in graph.neighbours(vertex as u32) {
            couple(other as usize, [0.0, -1.0, -1.0, 0.0]);
        }
        let degree = graph.degree(vertex as u32) as f64;
        couple(vertex, [-1.5 - amounts[vertex], degree + 0.1, degree + 0.1, 0.0]);
    }
    let right = noise(pattern.dimension(), 8);
    let mut factor = BlockCholesky::with_signs(pattern, [-1.0, 1.0]);
    factor.factorize(&values, 0.0).expect("signs as expected");
    let mut x = right.clone();
    factor.solve_in_place(&mut x);
    let dense = expected
        .lu()
        .solve(&nalgebra::DVector::from_column_slice(&right))
        .expect("regular");
    for (a, b) in x.iter().zip(dense.iter()) {
        assert!((a - b).abs() < 1e-10 * dense.amax(), "{a} {b}");
    }
    let wrong: Vec<f64> = values.iter().map(|value| -value).collect();
    assert!(factor.factorize(&wrong, 0.0).is_err(), "the wrong signs are told");
}

#[test]
fn known_signs_give_the_same_bits_with_any_number_of_threads() {
    // Three unknowns a vertex and fronts large enough to be shared: -, +, - as in a chain of two saddle points.
    let (points, cells) = grid(13);
    let graph = Graph::of_cells(points.len(), &cells, Some);
    let solve = |threads: usize| {
        with_threads(threads, || {
            let pattern = BlockPattern::<3>::of_graph(&graph, &nested_dissection(&graph, &points));
            let mut values = vec![0.0; pattern.values_len()];
            for vertex in 0..graph.len() {
                // v: -K, w: +1 and -1 to v, u: K to w, with K a graph's Laplacian plus a little.
                let k = graph.degree(vertex as u32) as f64 + 0.5;
                let (start, _) = pattern.block(vertex, vertex).expect("the diagonal");
                values[start..start + 9].copy_from_slice(&[-k, -1.0, 0.0, -1.0, 0.5, k, 0.0, k, 0.0]);
                for &other in graph.neighbours(vertex as u32) {
                    let (start, _) = pattern.block(vertex, other as usize).expect("an edge");
                    values[start..start + 9].copy_from_slice(&[1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, -1.0, 0.0]);
                }
            }
            let mut factor = BlockCholesky::with_signs(pattern, [-1.0, 1.0, -1.0]);
            factor.factorize(&values, 0.0).expect("signs as expected");
            let dimension = factor.pattern().dimension();
            let right = noise(2 * dimension, 11);
            let mut x = right.clone();
            factor.solve_many_in_place(&mut x, 2);
            for (x, right) in x.chunks(dimension).zip(right.chunks(dimension)) {
                let mut image = vec![0.0; dimension];
                factor.pattern().multiply(&values, x, &mut image);
                let size = x.iter().fold(0.0f64, |size, x| size.max(x.abs()));
                for (image, right) in image.iter().zip(right) {
                    assert!((image - right).abs() < 1e-11 * size.max(1.0), "{image} {right}");
                }
            }
            x.iter().map(|x| x.to_bits()).collect::<Vec<u64>>()
        })
    };
    let one = solve(1);
    assert_eq!(one, solve(2));
    assert_eq!(one, solve(4));
}

#[test]
fn a_matrix_that_is_not_positive_is_named_and_recovered_from() {
    let (points, cells) = grid(4);
    let pattern = BlockPattern::<3>::new(&points, &cells, &inside(&points)).unwrap();
    let mut values = vec![0.0; pattern.values_len()];
    pattern.assemble(&parts::<3, 4>(cells.len()), &mut values);
    let middle = pattern.vertices().len() / 2;
    let vertex = pattern.vertices()[middle];
    let mut damaged = values.clone();
    let mut cholesky = BlockCholesky::new(pattern);
    for amount in [-1e6, f64::NAN] {
        damaged.copy_from_slice(&values);
        cholesky.pattern().add_to_diagonal(&mut damaged, middle, amount);
        assert_eq!(cholesky.factorize(&damaged, 0.0).unwrap_err().vertex, vertex);
    }
    // A shift that outweighs the damage makes it positive again, and the failure leaves nothing behind.
    damaged.copy_from_slice(&values);
    cholesky.pattern().add_to_diagonal(&mut damaged, middle, -1e6);
    cholesky.factorize(&damaged, 2e6).unwrap();
    cholesky.factorize(&values, 0.0).unwrap();
    assert_eq!(cholesky.factorizations(), 4);
    assert!(residual(&cholesky, &values) < 1e-13);
}

/// Of a solution for a noisy right-hand side, relative.
fn residual(cholesky: &BlockCholesky<3>, values: &[f64]) -> f64 {
    let rhs = noise(cholesky.pattern().dimension(), 7);
    let mut x = rhs.clone();
    cholesky.solve_in_place(&mut x);
    let mut product = vec![0.0; rhs.len()];
    cholesky.pattern().multiply(values, &x, &mut product);
    let difference: f64 = product.iter().zip(&rhs).map(|(a, b)| (a - b) * (a - b)).sum();
    (difference / rhs.iter().map(|b| b * b).sum::<f64>()).sqrt()
}

#[test]
fn degenerate_structures() {
    // Nothing free: an empty system that can be factorized and solved.
    let (points, cells) = grid(1);
    let pattern = BlockPattern::<3>::new(&points, &cells, &[false; 8]).unwrap();
    assert_eq!((pattern.dimension(), pattern.values_len()), (0, 0));
    pattern.assemble(&parts::<3, 4>(cells.len()), &mut []);
    let mut cholesky = BlockCholesky::new(pattern);
    cholesky.factorize(&[], 0.0).unwrap();
    cholesky.solve_in_place(&mut []);
    // Many separate vertices, then a star around one vertex, then a complete graph.
    let lonely = vec![[0.5; 3]; 3000];
    let none: [[u32; 2]; 0] = [];
    let star: Vec<[u32; 2]> = (1..3000).map(|leaf| [0, leaf]).collect();
    let complete: Vec<[u32; 2]> = (0..200).flat_map(|a| (0..a).map(move |b| [a, b])).collect();
    for edges in [&none[..], &star, &complete] {
        let pattern = BlockPattern::<1>::new(&lonely, edges, &[true; 3000]).unwrap();
        let mut values = vec![0.0; pattern.values_len()];
        pattern.assemble(&[1.0, -1.0, 1.0].repeat(edges.len()), &mut values);
        let mut cholesky = BlockCholesky::new(pattern);
        cholesky.factorize(&values, 1.0).unwrap();
        // The constant is an eigenvector of every graph Laplacian, so of the shifted one with the value 1.
        let mut x = vec![1.0; 3000];
        cholesky.solve_in_place(&mut x);
        assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-11));
    }
}

#[test]
fn invalid_structures_are_refused() {
    let points = [[0.0; 3]; 4];
    let new = |cells: &[[u32; 4]], free: &[bool]| BlockPattern::<3>::new(&points, cells, free).err();
    assert_eq!(new(&[], &[true; 3]), Some(PatternError::Lengths { points: 4, free: 3 }));
    let error = new(&[[0, 1, 2, 3], [0, 1, 2, 4]], &[true; 4]);
    assert_eq!(
        error,
        Some(PatternError::Vertex {
            cell: 1,
            vertex: 4,
            points: 4
        })
    );
    let error = new(&[[0, 1, 2, 1]], &[true; 4]);
    assert_eq!(error, Some(PatternError::Repeated { cell: 0, vertex: 1 }));
    assert!(error.unwrap().to_string().starts_with("cell 0 names vertex 1 twice"));
}

#[test]
fn nested_dissection_orders_every_vertex_once_and_with_little_fill() {
    let (points, cells) = grid(16);
    let graph = Graph::of_cells(points.len(), &cells, Some);
    let order = nested_dissection(&graph, &points);
    let mut sorted = order.clone();
    sorted.sort_unstable();
    assert!(sorted.iter().enumerate().all(|(index, &vertex)| index as u32 == vertex));
    // With the order of METIS (pymetis 2025.2.2) the same fronts take 3.55 G operations.
    let operations = Elimination::new(&graph, &order, 3).operations();
    assert!(operations < 1.15 * 3.55e9, "{operations:e}");
    let natural: Vec<u32> = (0..points.len() as u32).collect();
    assert!(operations < 0.5 * Elimination::new(&graph, &natural, 3).operations());
}

#[test]
fn the_same_bits_with_any_number_of_threads() {
    // Large enough for shared branches and shared fronts.
    let (points, cells) = grid(17);
    let free = inside(&points);
    let parts: Vec<f64> = parts::<3, 4>(64).into_iter().cycle().take(90 * cells.len()).collect();
    let solve = |threads: usize| {
        with_threads(threads, || {
            let pattern = BlockPattern::<3>::new(&points, &cells, &free).unwrap();
            let mut values = vec![0.0; pattern.values_len()];
            pattern.assemble(&parts, &mut values);
            let mut cholesky = BlockCholesky::new(pattern);
            cholesky.factorize(&values, 0.0).unwrap();
            let mut x = noise(cholesky.pattern().dimension(), 3);
            cholesky.solve_in_place(&mut x);
            assert!(residual(&cholesky, &values) < 1e-12);
            x.iter().map(|x| x.to_bits()).collect::<Vec<u64>>()
        })
    };
    let one = solve(1);
    assert_eq!(one, solve(2));
    assert_eq!(one, solve(4));
}
