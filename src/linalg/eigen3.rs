//! Eigenvalues and eigenvectors of a symmetric 3x3 matrix by Jacobi rotations, branch-free.

use super::jet::SYMMETRIC;
use super::scalar::Real;
use super::svd3::{binary_scale, rotation};
use super::vector3::{Columns, Vector3};

/// Sweeps converge quadratically; four are usual.
const SWEEPS: usize = 12;
/// Square of the largest off-diagonal entry, relative to the largest entry, that counts as zero.
const DIAGONAL: f64 = 1e-36;

/// Eigenvalues in no particular order, and orthonormal eigenvectors as columns.
#[derive(Clone, Copy, Debug)]
pub struct SymmetricEigen<R> {
    pub values: Vector3<R>,
    pub vectors: Columns<R>,
}

/// The eigensystem of the symmetric matrix with entries 00, 01, 02, 11, 12, 22. Errors are relative to the largest entry.
#[inline(always)]
pub fn symmetric_eigen<R: Real>(matrix: &[R; 6]) -> SymmetricEigen<R> {
    let (zero, one) = (R::constant(0.0), R::constant(1.0));
    let mut largest = zero;
    for &entry in matrix {
        largest = largest.max(entry.abs());
    }
    let (scale, inverse) = binary_scale(largest);
    let mut a = [[zero; 3]; 3];
    for (&(i, j), &entry) in SYMMETRIC.iter().zip(matrix) {
        a[i][j] = entry * inverse;
        a[j][i] = a[i][j];
    }
    let mut vectors = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    let threshold = R::constant(DIAGONAL);
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for (p, q, r) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            let off = a[p][q];
            let needed = threshold.less(off * off);
            if R::any(needed) {
                rotated = true;
                let (cosine, sine) = rotation(a[p][p], a[q][q], off);
                let (cosine, sine) = (R::select(needed, cosine, one), R::select(needed, sine, zero));
                let shift = R::select(needed, off * sine / cosine, zero);
                a[p][p] = a[p][p] - shift;
                a[q][q] = a[q][q] + shift;
                a[p][q] = R::select(needed, zero, off);
                a[q][p] = a[p][q];
                let (x, y) = (a[r][p], a[r][q]);
                a[r][p] = x * cosine - y * sine;
                a[r][q] = x * sine + y * cosine;
                a[p][r] = a[r][p];
                a[q][r] = a[r][q];
                for row in 0..3 {
                    let (x, y) = (vectors[p][row], vectors[q][row]);
                    vectors[p][row] = x * cosine - y * sine;
                    vectors[q][row] = x * sine + y * cosine;
                }
            }
        }
        if !rotated {
            break;
        }
    }
    SymmetricEigen {
        values: [a[0][0] * scale, a[1][1] * scale, a[2][2] * scale],
        vectors,
    }
}
