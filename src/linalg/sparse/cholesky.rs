//! Numeric multifrontal factorization `L J L^T` and the triangular solves.
//!
//! `J` is the identity for positive definite matrices, a Cholesky factorization. Symmetric indefinite matrices whose
//! pivots have known signs in every order of the vertices, such as those of saddle points with a vertex's unknowns
//! kept together, need no pivoting either: `J` holds the signs.

use super::dense::{factorize_columns, times_signs, update_rectangle, update_triangle};
use super::elimination::{Elimination, strip_start, strip_width};
use super::pattern::BlockPattern;
use crate::linalg::fresh_memory::zeros;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;
use std::fmt;

/// Fronts with more entries than this are assembled by several threads.
const SHARED_FRONT: usize = 1 << 18;

/// The matrix is not positive definite in floating-point arithmetic, or a pivot has not the sign it should have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotPositive {
    /// Vertex of the mesh at whose unknowns the factorization broke down.
    pub vertex: u32,
}

impl fmt::Display for NotPositive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the matrix is not of the expected definiteness: a pivot at vertex {} has the wrong sign",
            self.vertex
        )
    }
}

impl std::error::Error for NotPositive {}

/// A factorization `A = L J L^T` that is renewed for matrices of one structure.
///
/// Memory for the factor and for the work is taken by the first factorization and kept.
#[derive(Debug)]
pub struct BlockCholesky<const B: usize> {
    pattern: BlockPattern<B>,
    /// The diagonal of `J` at the columns of the largest front; empty for the identity.
    signs: Vec<f64>,
    factor: Vec<f64>,
    arena: Vec<f64>,
    factorized: bool,
    factorizations: u64,
}

impl<const B: usize> BlockCholesky<B> {
    /// For positive definite matrices.
    pub fn new(pattern: BlockPattern<B>) -> Self {
        Self {
            pattern,
            signs: Vec::new(),
            factor: Vec::new(),
            arena: Vec::new(),
            factorized: false,
            factorizations: 0,
        }
    }

    /// For matrices whose pivots have these signs, `1.0` or `-1.0`, at every vertex.
    pub fn with_signs(pattern: BlockPattern<B>, signs: [f64; B]) -> Self {
        let elimination = &pattern.elimination;
        let fronts = 0..elimination.fronts();
        let widest = fronts.map(|front| elimination.columns(front)).max().unwrap_or(0);
        Self {
            signs: signs.into_iter().cycle().take(widest).collect(),
            ..Self::new(pattern)
        }
    }

    pub fn pattern(&self) -> &BlockPattern<B> {
        &self.pattern
    }

    /// Number of factorizations begun, failed ones included.
    pub fn factorizations(&self) -> u64 {
        self.factorizations
    }

    /// Bytes of the factor and of the working memory.
    pub fn bytes(&self) -> usize {
        let elimination = &self.pattern.elimination;
        std::mem::size_of::<f64>() * (elimination.factor_scalars() + elimination.working_scalars())
    }

    /// Factorizes `A + shift I`. After a failure there is no factorization until the next success.
    pub fn factorize(&mut self, values: &[f64], shift: f64) -> Result<(), NotPositive> {
        assert_eq!(values.len(), self.pattern.values_len(), "a matrix of this structure");
        self.factorized = false;
        self.factorizations += 1;
        let elimination = &self.pattern.elimination;
        if self.factor.is_empty() {
            self.factor = zeros(elimination.factor_scalars());
            self.arena = zeros(elimination.working_scalars());
        }
        let numeric = Numeric {
            pattern: &self.pattern,
            elimination,
            values,
            shift,
            signs: (!self.signs.is_empty()).then_some(&self.signs),
        };
        let roots = (0..elimination.fronts() as u32)
            .filter(|&front| elimination.is_root(front))
            .collect::<Vec<_>>();
        numeric
            .branches(&roots, &mut self.factor, &mut self.arena)
            .map_err(|column| {
                let free = elimination.order[column / B];
                NotPositive {
                    vertex: self.pattern.vertices()[free as usize],
                }
            })?;
        self.factorized = true;
        Ok(())
    }

    /// Replaces `rhs` by the solution of the factorized system.
    ///
    /// # Panics
    /// Without a successful factorization, and if `rhs` has another length than the system.
    pub fn solve_in_place(&self, rhs: &mut [f64]) {
        self.solve_many_in_place(rhs, 1);
    }

    /// The same for `count` right-hand sides, one after another in `rhs`.
    pub fn solve_many_in_place(&self, rhs: &mut [f64], count: usize) {
        assert!(self.factorized, "solve needs a successful factorization");
        let dimension = self.pattern.dimension();
        assert_eq!(rhs.len(), dimension * count, "right-hand sides of this system");
        if dimension == 0 || count == 0 {
            return;
        }
        let elimination = &self.pattern.elimination;
        let mut x = vec![0.0; rhs.len()];
        for (x, rhs) in x.chunks_exact_mut(dimension).zip(rhs.chunks_exact(dimension)) {
            for (free, &position) in self.pattern.position.iter().enumerate() {
                let position = position as usize;
                x[B * position..B * (position + 1)].copy_from_slice(&rhs[B * free..B * (free + 1)]);
            }
        }
        let widest = (0..elimination.fronts())
            .map(|front| elimination.update(front))
            .max()
            .unwrap_or(0);
        let mut gathered = vec![0.0; widest * count];
        for front in 0..elimination.fronts() {
            let (square, below) = self.front(front);
            let (columns, update) = (square.nrows(), below.nrows());
            let start = B * elimination.begin[front] as usize;
            let mut x = MatMut::from_column_major_slice_mut(&mut x, dimension, count);
            let mut own = x.as_mut().subrows_mut(start, columns);
            solve_lower_triangular_in_place(square, own.as_mut(), Par::Seq);
            let gathered = &mut gathered[..update * count];
            let mut product = MatMut::from_column_major_slice_mut(gathered, update, count);
            matmul(product.as_mut(), Accum::Replace, below, own.as_ref(), 1.0, Par::Seq);
            for column in 0..count {
                for (slot, &row) in elimination.rows(front).iter().enumerate() {
                    for c in 0..B {
                        x[(B * row as usize + c, column)] -= product[(B * slot + c, column)];
                    }
                }
            }
        }
        if !self.signs.is_empty() {
            for x in x.chunks_exact_mut(B) {
                x.iter_mut().zip(&self.signs).for_each(|(x, sign)| *x *= sign);
            }
        }
        for front in (0..elimination.fronts()).rev() {
            let (square, below) = self.front(front);
            let (columns, update) = (square.nrows(), below.nrows());
            let start = B * elimination.begin[front] as usize;
            let mut x = MatMut::from_column_major_slice_mut(&mut x, dimension, count);
            let gathered = &mut gathered[..update * count];
            let mut known = MatMut::from_column_major_slice_mut(gathered, update, count);
            for column in 0..count {
                for (slot, &row) in elimination.rows(front).iter().enumerate() {
                    for c in 0..B {
                        known[(B * slot + c, column)] = x[(B * row as usize + c, column)];
                    }
                }
            }
            let mut own = x.as_mut().subrows_mut(start, columns);
            matmul(
                own.as_mut(),
                Accum::Add,
                below.transpose(),
                known.as_ref(),
                -1.0,
                Par::Seq,
            );
            solve_upper_triangular_in_place(square.transpose(), own, Par::Seq);
        }
        for (x, rhs) in x.chunks_exact(dimension).zip(rhs.chunks_exact_mut(dimension)) {
            for (free, &position) in self.pattern.position.iter().enumerate() {
                let position = position as usize;
                rhs[B * free..B * (free + 1)].copy_from_slice(&x[B * position..B * (position + 1)]);
            }
        }
    }

    /// Square and lower part of a front's columns of the factor.
    fn front(&self, front: usize) -> (MatRef<'_, f64>, MatRef<'_, f64>) {
        let elimination = &self.pattern.elimination;
        let (columns, update) = (elimination.columns(front), elimination.update(front));
        let values = &self.factor[elimination.value_offsets[front]..elimination.value_offsets[front + 1]];
        MatRef::from_column_major_slice(values, columns + update, columns).split_at_row(columns)
    }
}

/// One factorization under way.
struct Numeric<'a, const B: usize> {
    pattern: &'a BlockPattern<B>,
    elimination: &'a Elimination,
    values: &'a [f64],
    shift: f64,
    signs: Option<&'a [f64]>,
}

/// Which end of its working memory a branch leaves its update at.
#[derive(Clone, Copy, PartialEq)]
enum End {
    Low,
    High,
}

impl<const B: usize> Numeric<'_, B> {
    /// Factorizes neighbouring branches side by side. `factor` is their part of the factor, `arena` their working memory
    /// one after another; each leaves its update at the start of its own. `Err`: the first column without a positive
    /// pivot.
    fn branches(&self, branches: &[u32], factor: &mut [f64], arena: &mut [f64]) -> Result<(), usize> {
        match branches {
            [] => Ok(()),
            &[front] => self.branch(front as usize, factor, arena, End::Low),
            _ => {
                let (left, right) = branches.split_at(branches.len() / 2);
                let offset =
                    |front: u32| self.elimination.value_offsets[self.elimination.first[front as usize] as usize];
                let (left_factor, right_factor) = factor.split_at_mut(offset(right[0]) - offset(left[0]));
                let need = left.iter().map(|&front| self.elimination.arena[front as usize]).sum();
                let (left_arena, right_arena) = arena.split_at_mut(need);
                let (first, second) = rayon::join(
                    || self.branches(left, left_factor, left_arena),
                    || self.branches(right, right_factor, right_arena),
                );
                first.and(second)
            }
        }
    }

    /// Factorizes a branch of the tree and leaves its update at the given end of `arena`. The children's updates pile up
    /// at the other end, so that nothing needs to be moved.
    fn branch(&self, front: usize, factor: &mut [f64], arena: &mut [f64], end: End) -> Result<(), usize> {
        let elimination = self.elimination;
        let children = elimination.children(front);
        let size = elimination.update_scalars(front);
        let base = elimination.value_offsets[elimination.first[front] as usize];
        let (below, panel) = factor.split_at_mut(elimination.value_offsets[front] - base);
        let mut sources = Vec::with_capacity(children.len());
        if elimination.shared[front] {
            let (update, mut rest) = cut(arena, size, end);
            self.branches(children, below, rest)?;
            for &child in children {
                let (source, further) = std::mem::take(&mut rest).split_at_mut(elimination.arena[child as usize]);
                sources.push((child as usize, &*source));
                rest = further;
            }
            return self.front(front, panel, update, &sources);
        }
        let other = if end == End::Low { End::High } else { End::Low };
        let mut rest = arena;
        for &child in children {
            let child = child as usize;
            let start = elimination.value_offsets[elimination.first[child] as usize] - base;
            let stop = elimination.value_offsets[child + 1] - base;
            self.branch(child, &mut below[start..stop], rest, other)?;
            let (source, further) = cut(rest, elimination.update_scalars(child), other);
            sources.push((child, &*source));
            rest = further;
        }
        self.front(front, panel, cut(rest, size, end).0, &sources)
    }

    /// Assembles and factorizes one front. `sources` are the children with their updates.
    fn front(
        &self,
        front: usize,
        panel: &mut [f64],
        update: &mut [f64],
        sources: &[(usize, &[f64])],
    ) -> Result<(), usize> {
        let elimination = self.elimination;
        let (columns, size) = (elimination.columns(front), elimination.update(front));
        let height = columns + size;
        let width = strip_width(B);
        let large = height * height > SHARED_FRONT;
        let assemble = |(index, strip): (usize, &mut [f64])| {
            let first = index * width;
            strip.fill(0.0);
            self.scatter(elimination.begin[front] as usize + first / B, strip, height, first);
            for &(child, source) in sources {
                self.extend_add(child, source, first, 0, strip, height);
            }
        };
        if large {
            panel.par_chunks_mut(width * height).enumerate().for_each(assemble);
        } else {
            panel.chunks_mut(width * height).enumerate().for_each(assemble);
        }
        let mut matrix = MatMut::from_column_major_slice_mut(panel, height, columns);
        let signs = self.signs.map(|signs| &signs[..columns]);
        factorize_columns(matrix.as_mut(), signs).map_err(|column| B * elimination.begin[front] as usize + column)?;
        let rows = matrix.as_ref().split_at_row(columns).1;
        let mut strips = Vec::with_capacity(size.div_ceil(width));
        let mut rest = update;
        for first in (0..size).step_by(width) {
            let (strip, further) = std::mem::take(&mut rest).split_at_mut((size - first) * width.min(size - first));
            strips.push((first, strip));
            rest = further;
        }
        let renew = |(first, strip): (usize, &mut [f64])| {
            let height = size - first;
            let width = strip.len() / height;
            let (beside, under) = rows.split_at_row(first).1.split_at_row(width);
            let (square, rectangle) = MatMut::from_column_major_slice_mut(strip, height, width).split_at_row_mut(width);
            let turned = times_signs(beside, signs);
            let right = turned.as_ref().map_or(beside, Mat::as_ref);
            update_triangle(square, beside, right, Accum::Replace);
            update_rectangle(rectangle, under, right, Accum::Replace);
            for &(child, source) in sources {
                self.extend_add(child, source, columns + first, columns + first, strip, height);
            }
        };
        if large {
            strips.into_par_iter().for_each(renew);
        } else {
            strips.into_iter().for_each(renew);
        }
        Ok(())
    }

    /// Copies the matrix's columns from position `start` on into a strip of a front's columns, which begins at column
    /// `first` of the front and is `height` high.
    fn scatter(&self, start: usize, strip: &mut [f64], height: usize, first: usize) {
        for (index, columns) in strip.chunks_exact_mut(B * height).enumerate() {
            let blocks = self.pattern.column_offsets[start + index]..self.pattern.column_offsets[start + index + 1];
            for block in blocks {
                let entries = &self.values[B * B * block..B * B * (block + 1)];
                let slot = B * self.pattern.slots[block] as usize;
                for (c, column) in columns.chunks_exact_mut(height).enumerate() {
                    for (row, target) in column[slot..slot + B].iter_mut().enumerate() {
                        *target = entries[row * B + c];
                    }
                }
            }
            for (c, column) in columns.chunks_exact_mut(height).enumerate() {
                column[first + B * index + c] += self.shift;
            }
        }
    }

    /// Adds a child's update to a strip of its parent's front. The strip begins at row `top` and column `first` of the
    /// front and is `height` high.
    fn extend_add(&self, child: usize, source: &[f64], first: usize, top: usize, strip: &mut [f64], height: usize) {
        let size = self.elimination.update(child);
        let width = strip_width(B);
        let last = first + strip.len() / height;
        let runs = self.elimination.runs(child);
        let start = runs.partition_point(|run| B * (run.parent + run.length) as usize <= first);
        for (index, run) in runs.iter().enumerate().skip(start) {
            let (from, to, length) = (B * run.child as usize, B * run.parent as usize, B * run.length as usize);
            if to >= last {
                break;
            }
            for offset in first.saturating_sub(to)..length.min(last - to) {
                let column = from + offset;
                // The source's strips grow shorter; `diagonal` is where the column's own row is stored.
                let skipped = column / width;
                let (above, tall) = (skipped * width, size - skipped * width);
                let diagonal = strip_start(size, width, skipped) + (column - above) * (tall + 1);
                let source = &source[diagonal..diagonal + size - column];
                let target = &mut strip[(to + offset - first) * height..][..height];
                // The lower triangle only: this run from the diagonal on, then all later runs.
                add(
                    &mut target[to + offset - top..][..length - offset],
                    &source[..length - offset],
                );
                for run in &runs[index + 1..] {
                    let (from, to, length) = (B * run.child as usize, B * run.parent as usize, B * run.length as usize);
                    add(&mut target[to - top..][..length], &source[from - column..][..length]);
                }
            }
        }
    }
}

/// A piece of the given size from one end, and the rest.
fn cut(slice: &mut [f64], size: usize, end: End) -> (&mut [f64], &mut [f64]) {
    match end {
        End::Low => slice.split_at_mut(size),
        End::High => {
            let (rest, piece) = slice.split_at_mut(slice.len() - size);
            (piece, rest)
        }
    }
}

#[inline]
fn add(target: &mut [f64], source: &[f64]) {
    for (target, source) in target.iter_mut().zip(source) {
        *target += source;
    }
}
