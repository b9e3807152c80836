//! Dense partial Cholesky factorization of a front, on blocks cut at places that depend on the sizes alone.
//!
//! Threads take whole blocks, so the number of threads cannot change a bit of the result.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::{matmul, triangular};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, MatMut, MatRef, Par, Spec};
use triangular::BlockStructure::{Rectangular, TriangularLower};

/// Columns factorized in one piece.
const PANEL: usize = 128;
/// Edge of the triangles updated in one piece.
const TRIANGLE: usize = 256;
/// Multiplications of the products done in one piece.
const PIECE: usize = 1 << 24;

/// Factorizes the columns of a front in place: the upper square becomes its Cholesky factor, the rows below are solved
/// against it. Only the lower triangle of the square is read. `Err(k)`: the pivot of column `k` is not positive.
pub(super) fn factorize_columns(panel: MatMut<'_, f64>) -> Result<(), usize> {
    let columns = panel.ncols();
    if columns <= PANEL {
        let (mut square, rows) = panel.split_at_row_mut(columns);
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(columns, Par::Seq, Spec::default()));
        cholesky_in_place(
            square.as_mut(),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Spec::default(),
        )
        .map_err(|faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index }| index)?;
        for column in 0..columns {
            if !square[(column, column)].is_finite() {
                return Err(column);
            }
        }
        solve(square.as_ref(), rows);
        return Ok(());
    }
    let half = (columns / 2).next_multiple_of(16);
    let (mut left, right) = panel.split_at_col_mut(half);
    factorize_columns(left.as_mut())?;
    let (_, mut right) = right.split_at_row_mut(half);
    let below = left.as_ref().split_at_row(half).1;
    let (beside, under) = below.split_at_row(columns - half);
    let (square, rows) = right.as_mut().split_at_row_mut(columns - half);
    rayon::join(
        || update_triangle(square, beside, Accum::Add),
        || update_rectangle(rows, under, beside, Accum::Add),
    );
    factorize_columns(right).map_err(|column| column + half)
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

/// Lower triangle of `target - rows rows^T`, or of `-rows rows^T` with `Accum::Replace`.
pub(super) fn update_triangle(target: MatMut<'_, f64>, rows: MatRef<'_, f64>, beta: Accum) {
    let size = target.nrows();
    if size > TRIANGLE && size * size * rows.ncols() > PIECE {
        let half = (size / 2).next_multiple_of(16);
        let (first, _, mixed, second) = target.split_at_mut(half, half);
        let (upper, lower) = rows.split_at_row(half);
        rayon::join(
            || update_rectangle(mixed, lower, upper, beta),
            || {
                rayon::join(
                    || update_triangle(first, upper, beta),
                    || update_triangle(second, lower, beta),
                )
            },
        );
    } else {
        triangular::matmul(
            target,
            TriangularLower,
            beta,
            rows,
            Rectangular,
            rows.transpose(),
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
