//! Conversions from values at points to Bernstein coefficients, and the parts that cells are cut into.
//!
//! The inverse of the collocation matrix is written down rather than computed, since the error of an LU factorization
//! grows with the square of its norm. On lines nothing cancels. On lattices, with barycentric coordinates l of a
//! simplex, the Lagrange function of the lattice point `a / n` is `prod_i (n l_i) (n l_i - 1) ... (n l_i - a_i + 1) /
//! a_i!`; expanded by Stirling numbers s and raised to degree n, its Bernstein coefficient b is `prod_i b_i! / n! sum_k
//! (n - |k|)! prod_i s(a_i, k_i) n^k_i / (a_i! (b_i - k_i)!)`. The sum cancels, hence twice the digits.

use super::double_double::DoubleDouble;
use nalgebra::DMatrix;

/// Points of a cell's side and the matrix from values there to Bernstein coefficients.
#[derive(Clone, Debug)]
pub(super) struct Conversion<const N: usize> {
    pub(super) points: Vec<[f64; N]>,
    pub(super) matrix: DMatrix<f64>,
    /// The largest sum of sizes in a row of the matrix.
    pub(super) norm: f64,
    /// Bounds the Lebesgue constant of interpolation at the points.
    pub(super) lebesgue: f64,
}

/// The largest sum of sizes in a row.
pub(super) fn row_norm(matrix: &DMatrix<f64>) -> f64 {
    matrix
        .row_iter()
        .map(|row| row.iter().map(|entry| entry.abs()).sum::<f64>())
        .fold(0.0, f64::max)
}

fn binomial(n: usize, k: usize) -> f64 {
    (1..=k).map(|i| (n + 1 - i) as f64 / i as f64).product()
}

/// Chebyshev points of the unit interval.
pub(super) fn line_conversion(degree: usize) -> (Vec<f64>, DMatrix<f64>) {
    let count = degree + 1;
    let points: Vec<f64> = (0..count)
        .map(|k| 0.5 - 0.5 * ((2 * k + 1) as f64 * std::f64::consts::PI / (2 * count) as f64).cos())
        .collect();
    let mut matrix = DMatrix::zeros(count, count);
    for (column, &x) in points.iter().enumerate() {
        // The product of all `t - y` by factors of `t^i (1 - t)^(degree - i)`. The summands of each have one sign.
        let mut product = vec![1.0];
        let mut scale = 1.0;
        for &y in points.iter().filter(|&&y| y != x) {
            let mut next = vec![0.0; product.len() + 1];
            for (i, &term) in product.iter().enumerate() {
                next[i] -= y * term;
                next[i + 1] += (1.0 - y) * term;
            }
            product = next;
            scale *= x - y;
        }
        for (row, term) in product.into_iter().enumerate() {
            matrix[(row, column)] = term / (scale * binomial(degree, row));
        }
    }
    (points, matrix)
}

/// A lattice of the triangle.
pub(super) fn triangle_conversion(degree: usize) -> Conversion<2> {
    let mut index = Vec::new();
    for i in 0..=degree {
        for j in 0..=degree - i {
            index.push([i, j]);
        }
    }
    let share = |k: usize| k as f64 / degree as f64;
    let points: Vec<[f64; 2]> = index.iter().map(|&[i, j]| [share(i), share(j)]).collect();
    let bernstein = |points: &[[f64; 2]]| {
        DMatrix::from_fn(points.len(), index.len(), |row, column| {
            let ([u, v], [i, j]) = (points[row], index[column]);
            let rest = degree - i - j;
            binomial(degree, i)
                * binomial(degree - i, j)
                * u.powi(i as i32)
                * v.powi(j as i32)
                * (1.0 - u - v).max(0.0).powi(rest as i32)
        })
    };
    let children = triangle_children(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        .map(|corners| points.iter().map(|&[u, v]| in_triangle(&corners, u, v)).collect());
    let weights: Vec<[usize; 3]> = index.iter().map(|&[i, j]| [degree - i - j, i, j]).collect();
    conversion(&points, lattice_matrix(degree, &weights), &bernstein, &children)
}

/// A lattice of the tetrahedron.
pub(super) fn tetrahedron_conversion(degree: usize) -> Conversion<3> {
    let mut index = Vec::new();
    for i in 0..=degree {
        for j in 0..=degree - i {
            for k in 0..=degree - i - j {
                index.push([i, j, k]);
            }
        }
    }
    let share = |k: usize| k as f64 / degree as f64;
    let points: Vec<[f64; 3]> = index.iter().map(|&[i, j, k]| [share(i), share(j), share(k)]).collect();
    let bernstein = |points: &[[f64; 3]]| {
        DMatrix::from_fn(points.len(), index.len(), |row, column| {
            let ([u, v, w], [i, j, k]) = (points[row], index[column]);
            let rest = degree - i - j - k;
            binomial(degree, i)
                * binomial(degree - i, j)
                * binomial(degree - i - j, k)
                * u.powi(i as i32)
                * v.powi(j as i32)
                * w.powi(k as i32)
                * (1.0 - u - v - w).max(0.0).powi(rest as i32)
        })
    };
    let whole = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let children =
        tetrahedron_children(&whole).map(|corners| points.iter().map(|&node| in_tetrahedron(&corners, node)).collect());
    let weights: Vec<[usize; 4]> = index.iter().map(|&[i, j, k]| [degree - i - j - k, i, j, k]).collect();
    conversion(&points, lattice_matrix(degree, &weights), &bernstein, &children)
}

/// From values at the points with these weights, each times the degree, to Bernstein coefficients in the same order.
fn lattice_matrix<const M: usize>(degree: usize, index: &[[usize; M]]) -> DMatrix<f64> {
    let zero = DoubleDouble::from(0.0);
    let one = DoubleDouble::from(1.0);
    let mut factorials = vec![one];
    for k in 1..=degree {
        factorials.push(factorials[k - 1] * (k as f64).into());
    }
    // Coefficients of x (x - 1) ... (x - a + 1).
    let mut stirling = vec![vec![one]];
    for a in 0..degree {
        let last = &stirling[a];
        let next = (0..=a + 1).map(|k| {
            let shifted = if k > 0 { last[k - 1] } else { zero };
            let own = last.get(k).copied().unwrap_or(zero);
            shifted + own * (-(a as f64)).into()
        });
        let next = next.collect();
        stirling.push(next);
    }
    // By a and b the numbers s(a, k) n^k / (a! (b - k)!).
    let factor = |a: usize, b: usize| -> Vec<DoubleDouble> {
        let mut power = one;
        let mut result = Vec::new();
        for k in 0..=a.min(b) {
            result.push(stirling[a][k] * power / (factorials[a] * factorials[b - k]));
            power = power * (degree as f64).into();
        }
        result
    };
    let factors: Vec<Vec<Vec<DoubleDouble>>> = (0..=degree)
        .map(|a| (0..=degree).map(|b| factor(a, b)).collect())
        .collect();
    DMatrix::from_fn(index.len(), index.len(), |row, column| {
        let mut product = vec![one];
        let mut scale = one;
        for (&a, &b) in index[column].iter().zip(&index[row]) {
            let factor = &factors[a][b];
            let mut next = vec![zero; product.len() + factor.len() - 1];
            for (i, &left) in product.iter().enumerate() {
                for (k, &right) in factor.iter().enumerate() {
                    next[i + k] = next[i + k] + left * right;
                }
            }
            product = next;
            scale = scale * factorials[b];
        }
        let sum = product
            .iter()
            .enumerate()
            .fold(zero, |sum, (m, &term)| sum + factorials[degree - m] * term);
        (sum * scale / factorials[degree]).high
    })
}

/// Points of a side above which the Lebesgue constant is not sharpened.
const MOST_SHARPENED: usize = 300;

/// The conversion for these points. The sizes of the Lagrange functions' Bernstein coefficients bound the Lebesgue
/// constant; on the children of the side, where `children` are the same points, they do so more sharply.
fn conversion<const N: usize, const C: usize>(
    points: &[[f64; N]],
    matrix: DMatrix<f64>,
    bernstein: &dyn Fn(&[[f64; N]]) -> DMatrix<f64>,
    children: &[Vec<[f64; N]>; C],
) -> Conversion<N> {
    let norm = row_norm(&matrix);
    let lebesgue = if points.len() <= MOST_SHARPENED {
        let there = children
            .iter()
            .map(|child| row_norm(&(&matrix * (bernstein(child) * &matrix))));
        there.fold(1.0, f64::max)
    } else {
        norm
    };
    Conversion {
        points: points.to_vec(),
        matrix,
        norm,
        lebesgue,
    }
}

pub(super) fn in_triangle(corners: &[[f64; 2]; 3], u: f64, v: f64) -> [f64; 2] {
    [0, 1].map(|axis| (1.0 - u - v) * corners[0][axis] + u * corners[1][axis] + v * corners[2][axis])
}

pub(super) fn in_tetrahedron(corners: &[[f64; 3]; 4], [u, v, w]: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        (1.0 - u - v - w) * corners[0][axis] + u * corners[1][axis] + v * corners[2][axis] + w * corners[3][axis]
    })
}

fn middle<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]))
}

pub(super) fn triangle_children(&[a, b, c]: &[[f64; 2]; 3]) -> [[[f64; 2]; 3]; 4] {
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
}

/// Bey's eight: four at the corners, four of the octahedron between.
pub(super) fn tetrahedron_children(&[a, b, c, d]: &[[f64; 3]; 4]) -> [[[f64; 3]; 4]; 8] {
    let (ab, ac, ad) = (middle(a, b), middle(a, c), middle(a, d));
    let (bc, bd, cd) = (middle(b, c), middle(b, d), middle(c, d));
    [
        [a, ab, ac, ad],
        [ab, b, bc, bd],
        [ac, bc, c, cd],
        [ad, bd, cd, d],
        [ab, ac, ad, bd],
        [ab, ac, bc, bd],
        [ac, ad, bd, cd],
        [ac, bc, bd, cd],
    ]
}
