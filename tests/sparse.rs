//! Sparse block systems: against dense algebra, against their own residual, and the same bits with any number of threads.

use vargeo::linalg::sparse::{BlockCholesky, BlockPattern, Graph, PatternError, nested_dissection};

/// A cube of `n^3` cubes, six tetrahedra each around the main diagonal.
pub fn grid(n: usize) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let m = n + 1;
    let points = (0..m * m * m)
        .map(|v| [v % m, v / m % m, v / m / m].map(|c| c as f64 / n as f64))
        .collect();
    let mut cells = Vec::new();
    for cube in 0..n * n * n {
        let corner = [cube % n, cube / n % n, cube / n / n];
        for axes in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut at = corner;
            let mut cell = [0u32; 4];
            let name = |at: [usize; 3]| (at[0] + m * (at[1] + m * at[2])) as u32;
            cell[0] = name(at);
            for (place, axis) in axes.into_iter().enumerate() {
                at[axis] += 1;
                cell[place + 1] = name(at);
            }
            cells.push(cell);
        }
    }
    (points, cells)
}

fn inside(points: &[[f64; 3]]) -> Vec<bool> {
    points
        .iter()
        .map(|p| p.iter().all(|&c| c > 1e-9 && c < 1.0 - 1e-9))
        .collect()
}

/// Numbers in (-1, 1), the same on every run.
fn noise(count: usize, mut seed: u64) -> Vec<f64> {
    (0..count)
        .map(|_| {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        })
        .collect()
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
