//! Products of 3-vectors and 3x3 matrices for any [`Scalar`]. A matrix is an array of its columns.

use super::scalar::Scalar;

pub type Vector3<S> = [S; 3];
/// Columns: `matrix[column][row]`.
pub type Columns<S> = [Vector3<S>; 3];

#[inline(always)]
pub fn add<S: Scalar>(a: Vector3<S>, b: Vector3<S>) -> Vector3<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub fn subtract<S: Scalar>(a: Vector3<S>, b: Vector3<S>) -> Vector3<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub fn times<S: Scalar>(a: Vector3<S>, factor: S) -> Vector3<S> {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

#[inline(always)]
pub fn dot<S: Scalar>(a: Vector3<S>, b: Vector3<S>) -> S {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub fn cross<S: Scalar>(a: Vector3<S>, b: Vector3<S>) -> Vector3<S> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// `matrix x`.
#[inline(always)]
pub fn apply<S: Scalar>(matrix: &Columns<S>, x: Vector3<S>) -> Vector3<S> {
    add(
        add(times(matrix[0], x[0]), times(matrix[1], x[1])),
        times(matrix[2], x[2]),
    )
}

/// `matrix^T x`.
#[inline(always)]
pub fn apply_transposed<S: Scalar>(matrix: &Columns<S>, x: Vector3<S>) -> Vector3<S> {
    [dot(matrix[0], x), dot(matrix[1], x), dot(matrix[2], x)]
}

/// The derivative of the determinant by the matrix: columns `m1 x m2, m2 x m0, m0 x m1`.
#[inline(always)]
pub fn cofactor<S: Scalar>(m: &Columns<S>) -> Columns<S> {
    [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])]
}

/// The entries 00 01 02 11 12 22 of a symmetric matrix.
#[inline(always)]
pub fn upper_entries<S>(entry: impl Fn(usize, usize) -> S) -> [S; 6] {
    [
        entry(0, 0),
        entry(0, 1),
        entry(0, 2),
        entry(1, 1),
        entry(1, 2),
        entry(2, 2),
    ]
}

/// `sum_ij a_ij b_ij`.
#[inline(always)]
pub fn inner<S: Scalar>(a: &Columns<S>, b: &Columns<S>) -> S {
    dot(a[0], b[0]) + dot(a[1], b[1]) + dot(a[2], b[2])
}
