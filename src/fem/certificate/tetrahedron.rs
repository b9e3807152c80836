//! Tetrahedra whose functions are not all polynomials, interpolated on smaller ones.

use super::bernstein::{in_tetrahedron, tetrahedron_children};
use super::chebyshev::tetrahedron_errors;
use super::{Certifier, NEGATIVE, Verdict, accumulate, apply_right, determinant, frobenius, rounding};
use crate::fem::functions::tetrahedron_table;
use crate::fem::space::Kind;
use crate::linalg::vector3::{Columns, add, times};

impl Certifier {
    pub(super) fn tetrahedron(&self, kind: Kind, coefficients: &[[f64; 3]], inverse: &Columns<f64>) -> Verdict {
        let order = kind.order;
        let most = self.most(kind);
        let degree = self.degree(order);
        let conversion = &self.tetrahedra[&degree];
        let t = conversion.points.len();
        let whole = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut stack = vec![(whole, 0, f64::NEG_INFINITY)];
        let (mut parts, mut bound) = (0, f64::INFINITY);
        while let Some((corners, level, _)) = stack.pop() {
            parts += 1;
            let points: Vec<[f64; 3]> = conversion
                .points
                .iter()
                .map(|&node| in_tetrahedron(&corners, node))
                .collect();
            let table = tetrahedron_table(self.basis, order, &points);
            let mut sampled = vec![[[0.0; 3]; 3]; t];
            for point in 0..t {
                let mut raw = [[0.0; 3]; 3];
                for function in 0..table.functions {
                    for (direction, column) in raw.iter_mut().enumerate() {
                        let slope = table.derivatives[direction][point * table.functions + function];
                        *column = add(*column, times(coefficients[function], slope));
                    }
                }
                let value = determinant(&apply_right(&raw, inverse));
                if !(value > NEGATIVE) {
                    return Verdict::Negative(points[point], value);
                }
                sampled[point] = raw;
            }
            let mut control = vec![[[0.0; 3]; 3]; t];
            for row in 0..t {
                for point in 0..t {
                    accumulate(&mut control[row], &sampled[point], conversion.matrix[(row, point)]);
                }
            }
            // The sizes of the terms summed.
            let mut columns = [[0.0; 3]; 3];
            for (function, c) in coefficients.iter().enumerate() {
                for (direction, column) in columns.iter_mut().enumerate() {
                    let slopes =
                        (0..t).map(|point| table.derivatives[direction][point * table.functions + function].abs());
                    *column = add(*column, times(c.map(f64::abs), slopes.fold(0.0, f64::max)));
                }
            }
            let mut wrong = [[0.0; 3]; 3];
            let errors = tetrahedron_errors(self.basis, order, &corners, degree, conversion);
            for (c, function) in coefficients.iter().zip(errors) {
                for (column, error) in wrong.iter_mut().zip(function.slope_errors) {
                    *column = add(*column, times(c.map(f64::abs), error));
                }
            }
            let error = rounding(t, conversion.norm) * frobenius(&columns) + frobenius(&wrong);
            match self.part(&mut control, error, inverse) {
                Ok(least) => bound = bound.min(least),
                Err(rough) if parts + stack.len() + 8 > most || level > 20 => {
                    let open = stack.iter().map(|part| part.2);
                    return Verdict::Undecided(open.fold(rough, f64::min));
                }
                Err(rough) => stack.extend(tetrahedron_children(&corners).map(|child| (child, level + 1, rough))),
            }
        }
        Verdict::Positive(bound)
    }
}
