//! Numeric multifrontal Cholesky factorization and the triangular solves.

use super::dense::{factorize_columns, update_triangle};
use super::elimination::Elimination;
use super::pattern::BlockPattern;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, MatMut, MatRef, Par};
use std::fmt;

/// The matrix is not positive definite in floating-point arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotPositive {
    /// Vertex of the mesh at whose unknowns the factorization broke down.
    pub vertex: u32,
}

impl fmt::Display for NotPositive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the matrix is not positive definite: a pivot at vertex {} is not positive",
            self.vertex
        )
    }
}

impl std::error::Error for NotPositive {}

/// A Cholesky factorization `A = L L^T` that is renewed for matrices of one structure.
///
/// Memory for the factor and for the work is taken by the first factorization and kept.
#[derive(Debug)]
pub struct BlockCholesky<const B: usize> {
    pattern: BlockPattern<B>,
    factor: Vec<f64>,
    arena: Vec<f64>,
    factorized: bool,
    factorizations: u64,
}

impl<const B: usize> BlockCholesky<B> {
    pub fn new(pattern: BlockPattern<B>) -> Self {
        Self {
            pattern,
            factor: Vec::new(),
            arena: Vec::new(),
            factorized: false,
            factorizations: 0,
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
        self.factor.resize(elimination.factor_scalars(), 0.0);
        self.arena.resize(elimination.working_scalars(), 0.0);
        let numeric = Numeric {
            pattern: &self.pattern,
            elimination,
            values,
            shift,
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
}

impl<const B: usize> Numeric<'_, B> {
    /// Factorizes neighbouring branches side by side. `factor` is their part of the factor, `arena` their working memory
    /// one after another; each leaves its update at the start of its own. `Err`: the first column without a positive
    /// pivot.
    fn branches(&self, branches: &[u32], factor: &mut [f64], arena: &mut [f64]) -> Result<(), usize> {
        match branches {
            [] => Ok(()),
            &[front] => self.branch(front as usize, factor, arena),
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

    /// Factorizes a branch of the tree and leaves its update matrix at the start of `arena`.
    fn branch(&self, front: usize, factor: &mut [f64], arena: &mut [f64]) -> Result<(), usize> {
        let elimination = self.elimination;
        let children = elimination.children(front);
        let size = elimination.update(front) * elimination.update(front);
        let base = elimination.value_offsets[elimination.first[front] as usize];
        let (below, panel) = factor.split_at_mut(elimination.value_offsets[front] - base);
        if elimination.shared[front] {
            let (update, rest) = arena.split_at_mut(size);
            self.branches(children, below, rest)?;
            return self.front(front, panel, update, rest, |child| elimination.arena[child]);
        }
        let square = |child: usize| elimination.update(child) * elimination.update(child);
        let mut held = 0;
        for &child in children {
            let child = child as usize;
            let start = elimination.value_offsets[elimination.first[child] as usize] - base;
            let end = elimination.value_offsets[child + 1] - base;
            self.branch(child, &mut below[start..end], &mut arena[held..])?;
            held += square(child);
        }
        let (updates, rest) = arena.split_at_mut(held);
        self.front(front, panel, &mut rest[..size], updates, square)?;
        arena.copy_within(held..held + size, 0);
        Ok(())
    }

    /// Assembles and factorizes one front. `updates` holds the children's update matrices, `stride` apart.
    fn front(
        &self,
        front: usize,
        panel: &mut [f64],
        update: &mut [f64],
        updates: &[f64],
        stride: impl Fn(usize) -> usize,
    ) -> Result<(), usize> {
        let elimination = self.elimination;
        let (columns, size) = (elimination.columns(front), elimination.update(front));
        let height = columns + size;
        let start = elimination.begin[front] as usize;
        panel.fill(0.0);
        for column in 0..columns / B {
            for block in self.pattern.column_offsets[start + column]..self.pattern.column_offsets[start + column + 1] {
                let entries = &self.values[B * B * block..B * B * (block + 1)];
                let slot = self.pattern.slots[block] as usize;
                for c in 0..B {
                    for row in 0..B {
                        panel[(B * column + c) * height + B * slot + row] = entries[row * B + c];
                    }
                }
            }
            for c in 0..B {
                panel[(B * column + c) * (height + 1)] += self.shift;
            }
        }
        let mut offset = 0;
        for &child in elimination.children(front) {
            let child = child as usize;
            self.extend_add(child, &updates[offset..], columns, 0, panel, height);
            offset += stride(child);
        }
        let mut matrix = MatMut::from_column_major_slice_mut(panel, height, columns);
        factorize_columns(matrix.as_mut()).map_err(|column| B * start + column)?;
        if size == 0 {
            return Ok(());
        }
        let rows = matrix.as_ref().split_at_row(columns).1;
        update_triangle(
            MatMut::from_column_major_slice_mut(update, size, size),
            rows,
            Accum::Replace,
        );
        let mut offset = 0;
        for &child in elimination.children(front) {
            let child = child as usize;
            self.extend_add(child, &updates[offset..], columns, columns, update, size);
            offset += stride(child);
        }
        Ok(())
    }

    /// Adds a child's update to its parent's front: to the columns eliminated there (`shift == 0`) or to those above
    /// (`shift == columns`). `target` starts at row and column `shift` of the front and is `height` high.
    fn extend_add(
        &self,
        child: usize,
        source: &[f64],
        columns: usize,
        shift: usize,
        target: &mut [f64],
        height: usize,
    ) {
        let size = self.elimination.update(child);
        let runs = self.elimination.runs(child);
        for (index, run) in runs.iter().enumerate() {
            let first = B * run.parent as usize;
            if (first < columns) != (shift == 0) {
                continue;
            }
            for offset in 0..B * run.length as usize {
                let from = &source[(B * run.child as usize + offset) * size..][..size];
                let to = &mut target[(first - shift + offset) * height..][..height];
                // The lower triangle only: this run from its own row on, then all later runs.
                let own = B * run.length as usize - offset;
                add(
                    &mut to[first - shift + offset..][..own],
                    &from[B * run.child as usize + offset..][..own],
                );
                for run in &runs[index + 1..] {
                    let length = B * run.length as usize;
                    add(
                        &mut to[B * run.parent as usize - shift..][..length],
                        &from[B * run.child as usize..][..length],
                    );
                }
            }
        }
    }
}

#[inline]
fn add(target: &mut [f64], source: &[f64]) {
    for (target, source) in target.iter_mut().zip(source) {
        *target += source;
    }
}
