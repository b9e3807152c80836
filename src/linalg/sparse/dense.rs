//! Dense partial factorization `L J L^T` of a front, on blocks cut at places that depend on the sizes alone.
//!
//! `J` is a diagonal of signs that are known beforehand. Without signs it is the identity: a Cholesky factorization.
//! Threads take whole blocks, so the number of threads cannot change a bit of the result.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::{ldlt, llt};
use faer::linalg::matmul::{matmul, triangular};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Mat, MatMut, MatRef, Par, Spec};
use triangular::BlockStructure::{Rectangular, TriangularLower};

/// Columns factorized in one piece.
const PANEL: usize = 128;
/// Edge of the triangles updated in one piece.
const TRIANGLE: usize = 256;
/// Multiplications of the products done in one piece.
const PIECE: usize = 1 << 24;

/// The diagonal of `J` at the columns of a front, or of a part of it; `None` where all are positive.
pub(super) type Signs<'a> = Option<&'a [f64]>;

/// Factorizes the columns of a front in place: the upper square becomes its factor `L`, the rows below become `X` with
/// `X J L^T` what they were. Only the lower triangle of the square is read. `Err(k)`: the pivot of column `k` has not the
/// sign that `signs` say.
pub(super) fn factorize_columns(panel: MatMut<'_, f64>, signs: Signs<'_>) -> Result<(), usize> {
    let columns = panel.ncols();
    if columns <= PANEL {
        let (mut square, mut rows) = panel.split_at_row_mut(columns);
        match signs {
            None => positive(square.as_mut())?,
            Some(signs) => signed(square.as_mut(), signs)?,
        }
        solve(square.as_ref(), rows.as_mut());
        for column in (0..columns).filter(|&column| signs.is_some_and(|signs| signs[column] < 0.0)) {
            rows.as_mut()
                .col_mut(column)
                .iter_mut()
                .for_each(|value| *value = -*value);
        }
        return Ok(());
    }
    let half = (columns / 2).next_multiple_of(16);
    let (mut left, right) = panel.split_at_col_mut(half);
    let (first, second) = (signs.map(|signs| &signs[..half]), signs.map(|signs| &signs[half..]));
    factorize_columns(left.as_mut(), first)?;
    let (_, mut right) = right.split_at_row_mut(half);
    let below = left.as_ref().split_at_row(half).1;
    let (beside, under) = below.split_at_row(columns - half);
    let (square, rows) = right.as_mut().split_at_row_mut(columns - half);
    let turned = times_signs(beside, first);
    let beside_signed = turned.as_ref().map_or(beside, Mat::as_ref);
    rayon::join(
        || update_triangle(square, beside, beside_signed, Accum::Add),
        || update_rectangle(rows, under, beside_signed, Accum::Add),
    );
    factorize_columns(right, second).map_err(|column| column + half)
}

/// Cholesky factor of a small square in place.
fn positive(mut square: MatMut<'_, f64>) -> Result<(), usize> {
    let size = square.nrows();
    let scratch = llt::factor::cholesky_in_place_scratch::<f64>(size, Par::Seq, Spec::default());
    let mut memory = MemBuffer::new(scratch);
    llt::factor::cholesky_in_place(
        square.as_mut(),
        Default::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Spec::default(),
    )
    .map_err(|llt::factor::LltError::NonPositivePivot { index }| index)?;
    match (0..size).find(|&column| !square[(column, column)].is_finite()) {
        Some(column) => Err(column),
        None => Ok(()),
    }
}

/// `L` with `L J L^T` a small square, in place.
fn signed(mut square: MatMut<'_, f64>, signs: &[f64]) -> Result<(), usize> {
    let size = square.nrows();
    let scratch = ldlt::factor::cholesky_in_place_scratch::<f64>(size, Par::Seq, Spec::default());
    let mut memory = MemBuffer::new(scratch);
    ldlt::factor::cholesky_in_place(
        square.as_mut(),
        Default::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Spec::default(),
    )
    .map_err(|ldlt::factor::LdltError::ZeroPivot { index }| index)?;
    for column in 0..size {
        let pivot = square[(column, column)] * signs[column];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err(column);
        }
        let root = pivot.sqrt();
        square[(column, column)] = root;
        for row in column + 1..size {
            square[(row, column)] *= root;
        }
    }
    Ok(())
}

/// `rows J`; `None` where `J` is the identity.
pub(super) fn times_signs(rows: MatRef<'_, f64>, signs: Signs<'_>) -> Option<Mat<f64>> {
    signs.map(|signs| {
        Mat::from_fn(rows.nrows(), rows.ncols(), |row, column| {
            signs[column] * rows[(row, column)]
        })
    })
}

/// `rows <- rows L^-T` for a lower triangular `L`.
fn solve(triangle: MatRef<'_, f64>, rows: MatMut<'_, f64>) {
    let count = rows.nrows();
    if count * triangle.nrows() * triangle.nrows() > PIECE {
        let (upper, lower) = rows.split_at_row_mut((count / 2).next_multiple_of(16));
        rayon::join(|| solve(triangle, upper), || solve(triangle, lower));
    } else {
        solve_lower_triangular_in_place(triangle, rows.transpose_mut(), Par::Seq);
    }
}

/// Lower triangle of `target - left right^T`, or of `-left right^T` with `Accum::Replace`; `right` is `left J`.
pub(super) fn update_triangle(target: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>, beta: Accum) {
    let size = target.nrows();
    if size > TRIANGLE && size * size * left.ncols() > PIECE {
        let half = (size / 2).next_multiple_of(16);
        let (first, _, mixed, second) = target.split_at_mut(half, half);
        let (left_upper, left_lower) = left.split_at_row(half);
        let (right_upper, right_lower) = right.split_at_row(half);
        rayon::join(
            || update_rectangle(mixed, left_lower, right_upper, beta),
            || {
                rayon::join(
                    || update_triangle(first, left_upper, right_upper, beta),
                    || update_triangle(second, left_lower, right_lower, beta),
                )
            },
        );
    } else {
        triangular::matmul(
            target,
            TriangularLower,
            beta,
            left,
            Rectangular,
            right.transpose(),
            Rectangular,
            -1.0,
            Par::Seq,
        );
    }
}

/// `target - left right^T`, or `-left right^T` with `Accum::Replace`.
pub(super) fn update_rectangle(target: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>, beta: Accum) {
    let (rows, columns) = (target.nrows(), target.ncols());
    if rows * columns * left.ncols() <= PIECE || rows.max(columns) <= 64 {
        matmul(target, beta, left, right.transpose(), -1.0, Par::Seq);
    } else if rows >= columns {
        let half = (rows / 2).next_multiple_of(16);
        let (upper, lower) = target.split_at_row_mut(half);
        let (left_upper, left_lower) = left.split_at_row(half);
        rayon::join(
            || update_rectangle(upper, left_upper, right, beta),
            || update_rectangle(lower, left_lower, right, beta),
        );
    } else {
        let half = (columns / 2).next_multiple_of(16);
        let (first, second) = target.split_at_col_mut(half);
        let (right_upper, right_lower) = right.split_at_row(half);
        rayon::join(
            || update_rectangle(first, left, right_upper, beta),
            || update_rectangle(second, left, right_lower, beta),
        );
    }
}
