//! Products of a small matrix with one index of an array of lanes, the whole of sum factorization.

use crate::linalg::lanes::{Lanes, Vector};
use crate::linalg::processor::Kernel;

/// `output[o][r][i] = sum_c matrix[r][c] input[o][c][i]`, added to what is there if `add`.
///
/// `inner`, the length of the last index, is a multiple of 3: the components of a vector run fastest.
pub struct Contraction<'a> {
    /// Row-major, `rows x columns`.
    pub matrix: &'a [f64],
    pub rows: usize,
    pub columns: usize,
    pub outer: usize,
    pub inner: usize,
    pub input: &'a [Lanes],
    pub output: &'a mut [Lanes],
    pub add: bool,
}

/// Rows done at once: with three components, as many sums as hide the latency of an addition.
const ROWS: usize = 2;

impl Kernel for Contraction<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let (rows, columns, inner) = (self.rows, self.columns, self.inner);
        assert!(inner % 3 == 0 && self.matrix.len() == rows * columns);
        assert!(self.input.len() >= self.outer * columns * inner);
        assert!(self.output.len() >= self.outer * rows * inner);
        for o in 0..self.outer {
            let input = &self.input[o * columns * inner..(o + 1) * columns * inner];
            let output = &mut self.output[o * rows * inner..(o + 1) * rows * inner];
            let mut row = 0;
            while row < rows {
                let pair = row + ROWS <= rows;
                let first = &self.matrix[row * columns..(row + 1) * columns];
                let second = if pair {
                    &self.matrix[(row + 1) * columns..(row + 2) * columns]
                } else {
                    first
                };
                for i in (0..inner).step_by(3) {
                    let zero = V::constant(0.0);
                    let mut sums = [zero; 6];
                    let mut place = i;
                    for (&a, &b) in first.iter().zip(second) {
                        let (a, b) = (V::constant(a), V::constant(b));
                        let values = &input[place..place + 3];
                        for component in 0..3 {
                            let value = V::load(&values[component]);
                            sums[component] = sums[component] + a * value;
                            sums[3 + component] = sums[3 + component] + b * value;
                        }
                        place += inner;
                    }
                    for r in 0..if pair { 2 } else { 1 } {
                        let out = &mut output[(row + r) * inner + i..(row + r) * inner + i + 3];
                        for component in 0..3 {
                            let mut sum = sums[3 * r + component];
                            if self.add {
                                sum = V::load(&out[component]) + sum;
                            }
                            sum.store(&mut out[component]);
                        }
                    }
                }
                row += ROWS;
            }
        }
    }
}
