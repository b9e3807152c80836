//! Prisms whose functions are not all polynomials: triangle functions times line functions, interpolated on smaller
//! prisms.

use super::bernstein::{in_triangle, row_norm, triangle_children};
use super::chebyshev::{Interpolated, triangle_errors};
use super::{Certifier, NEGATIVE, Verdict, accumulate, apply_right, determinant, frobenius, rounding};
use crate::fem::functions::{Table, line_table, triangle_table};
use crate::fem::space::Kind;
use crate::linalg::vector3::{Columns, add, times};

impl Certifier {
    pub(super) fn prism(&self, kind: Kind, coefficients: &[[f64; 3]], inverse: &Columns<f64>) -> Verdict {
        let order = kind.order;
        let most = self.most(kind);
        let degree = self.degree(order);
        let (line_points, line_convert) = &self.lines[&degree];
        let conversion = &self.triangles[&degree];
        let (m, t) = (line_points.len(), conversion.points.len());
        let norm = row_norm(line_convert) * conversion.norm;
        let whole = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let lasts = [kind.last[0], kind.last[1], 2];
        let mut stack = vec![(whole, 0_u32, 0_u32, f64::NEG_INFINITY)];
        let (mut parts, mut bound) = (0, f64::INFINITY);
        while let Some((corners, index, level, _)) = stack.pop() {
            parts += 1;
            let points: Vec<[f64; 2]> = conversion
                .points
                .iter()
                .map(|&[u, v]| in_triangle(&corners, u, v))
                .collect();
            let width = 0.5_f64.powi(level as i32);
            let low = f64::from(index) * width;
            let heights: Vec<f64> = line_points.iter().map(|s| low + width * s).collect();
            let lines = line_table(self.basis, order, &heights);
            let tables = lasts.map(|last| triangle_table(self.basis, order, last, &points));
            let mut sampled = vec![[[0.0; 3]; 3]; t * m];
            for point in 0..t {
                // Over the triangle, then along the line.
                let levels: Vec<Columns<f64>> = (0..=order)
                    .map(|level| {
                        let table: &Table<2> = &tables[level.min(2)];
                        let mut sums = [[0.0; 3]; 3];
                        for function in 0..table.functions {
                            let c = coefficients[level * table.functions + function];
                            let place = point * table.functions + function;
                            sums[0] = add(sums[0], times(c, table.derivatives[0][place]));
                            sums[1] = add(sums[1], times(c, table.derivatives[1][place]));
                            sums[2] = add(sums[2], times(c, table.values[place]));
                        }
                        sums
                    })
                    .collect();
                for w in 0..m {
                    let mut raw = [[0.0; 3]; 3];
                    for (level, sums) in levels.iter().enumerate() {
                        let (value, slope) = (
                            lines.values[w * (order + 1) + level],
                            lines.derivatives[0][w * (order + 1) + level],
                        );
                        raw[0] = add(raw[0], times(sums[0], value));
                        raw[1] = add(raw[1], times(sums[1], value));
                        raw[2] = add(raw[2], times(sums[2], slope));
                    }
                    let value = determinant(&apply_right(&raw, inverse));
                    if !(value > NEGATIVE) {
                        let [u, v] = points[point];
                        return Verdict::Negative([u, v, heights[w]], value);
                    }
                    sampled[w * t + point] = raw;
                }
            }
            // The sizes of the terms summed.
            let largest = |values: &[f64], count: usize| -> Vec<f64> {
                let mut most = vec![0.0_f64; count];
                for row in values.chunks_exact(count) {
                    for (most, value) in most.iter_mut().zip(row) {
                        *most = most.max(value.abs());
                    }
                }
                most
            };
            let [values, slopes] = [&lines.values, &lines.derivatives[0]].map(|list| largest(list, order + 1));
            let sizes = tables.each_ref().map(|table| {
                [&table.derivatives[0], &table.derivatives[1], &table.values].map(|list| largest(list, table.functions))
            });
            let mut columns = [[0.0; 3]; 3];
            for level in 0..=order {
                let (table, functions) = (&sizes[level.min(2)], tables[level.min(2)].functions);
                for function in 0..functions {
                    let c = coefficients[level * functions + function];
                    for (direction, column) in columns.iter_mut().enumerate() {
                        let along = if direction == 2 { slopes[level] } else { values[level] };
                        *column = add(*column, times(c.map(f64::abs), table[direction][function] * along));
                    }
                }
            }
            let size = frobenius(&columns);
            let error =
                rounding(m + t, norm) * size + self.prism_error(order, lasts, &corners, (level, index), coefficients);
            // Along the line, then over the triangle.
            let mut along = vec![[[0.0; 3]; 3]; t * m];
            for row in 0..m {
                for w in 0..m {
                    let weight = line_convert[(row, w)];
                    for point in 0..t {
                        accumulate(&mut along[row * t + point], &sampled[w * t + point], weight);
                    }
                }
            }
            let mut control = vec![[[0.0; 3]; 3]; t * m];
            for level in 0..m {
                for row in 0..t {
                    for point in 0..t {
                        accumulate(
                            &mut control[level * t + row],
                            &along[level * t + point],
                            conversion.matrix[(row, point)],
                        );
                    }
                }
            }
            match self.part(&mut control, error, inverse) {
                Ok(least) => bound = bound.min(least),
                Err(rough) if parts + stack.len() + 8 > most || level > 20 => {
                    let open = stack.iter().map(|part| part.3);
                    return Verdict::Undecided(open.fold(rough, f64::min));
                }
                Err(rough) => {
                    for child in triangle_children(&corners) {
                        stack.push((child, 2 * index, level + 1, rough));
                        stack.push((child, 2 * index + 1, level + 1, rough));
                    }
                }
            }
        }
        Verdict::Positive(bound)
    }

    /// How much interpolation changes the derivatives on a part, at most, in the Frobenius norm. With interpolants marked
    /// by a star, `|t l - t* l*| <= |t| |l - l*| + |l*| |t - t*|`.
    fn prism_error(
        &self,
        order: usize,
        lasts: [usize; 3],
        corners: &[[f64; 2]; 3],
        (level, index): (u32, u32),
        coefficients: &[[f64; 3]],
    ) -> f64 {
        let degree = self.degree(order);
        let line = self.interval(order, level, index);
        let tables =
            lasts.map(|last| triangle_errors(self.basis, order, last, corners, degree, &self.triangles[&degree]));
        let mut columns = [[0.0; 3]; 3];
        for level in 0..=order {
            let table: &Vec<Interpolated<2>> = &tables[level.min(2)];
            for (function, triangle) in table.iter().enumerate() {
                let c = coefficients[level * table.len() + function];
                let errors = [
                    triangle.slope_sizes[0] * line.value_errors[level]
                        + line.value_sizes[level] * triangle.slope_errors[0],
                    triangle.slope_sizes[1] * line.value_errors[level]
                        + line.value_sizes[level] * triangle.slope_errors[1],
                    triangle.size * line.slope_errors[level] + line.slope_sizes[level] * triangle.error,
                ];
                for (column, error) in columns.iter_mut().zip(errors) {
                    *column = add(*column, times(c.map(f64::abs), error));
                }
            }
        }
        frobenius(&columns)
    }
}
