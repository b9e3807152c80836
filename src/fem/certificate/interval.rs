//! The line functions of a cell on dyadic intervals: Bernstein coefficients, and bounds of what they leave out.

use super::bernstein::row_norm;
use super::{Certifier, rounding};
use crate::fem::functions::line_table;

/// The line functions of an order on an interval in Bernstein form.
#[derive(Clone)]
pub(super) struct Interval {
    /// `degree + 1` coefficients a function.
    pub(super) values: Vec<f64>,
    pub(super) slopes: Vec<f64>,
    /// Bounds of the error of each function and of its derivative.
    pub(super) value_errors: Vec<f64>,
    pub(super) slope_errors: Vec<f64>,
    /// Bounds of their size.
    pub(super) value_sizes: Vec<f64>,
    pub(super) slope_sizes: Vec<f64>,
    pub(super) degree: usize,
}

impl Certifier {
    /// The functions of an order on the interval of this number among the `2^level`.
    pub(super) fn interval(&self, order: usize, level: u32, index: u32) -> Interval {
        if let Some(known) = self.intervals.get(&(order, level, index)) {
            return known.clone();
        }
        let degree = self.degree(order);
        let (points, convert) = &self.lines[&degree];
        let width = 0.5_f64.powi(level as i32);
        let start = f64::from(index) * width;
        let places: Vec<f64> = points.iter().map(|t| start + width * t).collect();
        let table = line_table(self.basis, order, &places);
        let norm = row_norm(convert);
        let mut result = Interval {
            values: Vec::new(),
            slopes: Vec::new(),
            value_errors: Vec::new(),
            slope_errors: Vec::new(),
            value_sizes: Vec::new(),
            slope_sizes: Vec::new(),
            degree,
        };
        let radius = 0.5 * width;
        // |f - interpolant| <= max |f^(m+1)| r^(m+1) / (2^m (m+1)!).
        let share: f64 = (1..=degree + 1).map(|k| radius / k as f64).product::<f64>() / 2.0_f64.powi(degree as i32);
        for function in 0..=order {
            let frequency = match function {
                0 | 1 => 0.0,
                j => self.basis.frequency(j - 1).unwrap_or(0.0) * std::f64::consts::PI,
            };
            let (value_error, slope_error) = if frequency == 0.0 {
                (0.0, 0.0)
            } else {
                let bound = std::f64::consts::SQRT_2 * frequency.powi(degree as i32) * share;
                (bound, bound * frequency)
            };
            for (entries, out, errors, sizes, error) in [
                (
                    &table.values,
                    &mut result.values,
                    &mut result.value_errors,
                    &mut result.value_sizes,
                    value_error,
                ),
                (
                    &table.derivatives[0],
                    &mut result.slopes,
                    &mut result.slope_errors,
                    &mut result.slope_sizes,
                    slope_error,
                ),
            ] {
                let sampled: Vec<f64> = (0..=degree)
                    .map(|point| entries[point * table.functions + function])
                    .collect();
                let size = sampled.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                let mut largest = 0.0_f64;
                for row in 0..=degree {
                    let value: f64 = (0..=degree)
                        .map(|column| convert[(row, column)] * sampled[column])
                        .sum();
                    largest = largest.max(value.abs());
                    out.push(value);
                }
                let error = error + rounding(degree + 1, norm) * size;
                errors.push(error);
                sizes.push(largest + error);
            }
        }
        result
    }
}
