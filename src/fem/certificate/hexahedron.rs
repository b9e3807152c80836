//! Hexahedra whose functions are not all polynomials: products of line functions, interpolated on boxes.

use super::{Certifier, NEGATIVE, Verdict, apply_right, determinant};
use crate::fem::functions::line_table;
use crate::fem::space::Kind;
use crate::linalg::vector3::{Columns, add, dot, times};

impl Certifier {
    pub(super) fn hexahedron(&self, kind: Kind, coefficients: &[[f64; 3]], inverse: &Columns<f64>) -> Verdict {
        let order = kind.order;
        let most = self.most(kind);
        let n = order + 1;
        let mut stack = vec![([0_u32; 3], 0_u32, f64::NEG_INFINITY)];
        let (mut parts, mut bound) = (0, f64::INFINITY);
        // Rounding in the sums, relative to the sizes of the terms.
        const SUMS: f64 = 1e-14;
        let mut control: Vec<Columns<f64>> = Vec::new();
        while let Some((place, level, _)) = stack.pop() {
            parts += 1;
            let intervals = place.map(|index| self.interval(order, level, index));
            let degree = intervals[0].degree;
            let m = degree + 1;
            control.clear();
            control.resize(m * m * m, [[0.0; 3]; 3]);
            let mut error = 0.0;
            for direction in 0..3 {
                let pick = |axis: usize| {
                    let interval = &intervals[axis];
                    if axis == direction {
                        (&interval.slopes, &interval.slope_errors, &interval.slope_sizes)
                    } else {
                        (&interval.values, &interval.value_errors, &interval.value_sizes)
                    }
                };
                let (first, second, third) = (pick(0), pick(1), pick(2));
                // Third index, then second, then first.
                let mut a = vec![[0.0; 3]; n * n * m];
                for ij in 0..n * n {
                    for k in 0..n {
                        let c = coefficients[ij * n + k];
                        if c != [0.0; 3] {
                            for z in 0..m {
                                a[ij * m + z] = add(a[ij * m + z], times(c, third.0[k * m + z]));
                            }
                        }
                    }
                }
                let mut b = vec![[0.0; 3]; n * m * m];
                for i in 0..n {
                    for j in 0..n {
                        for y in 0..m {
                            let weight = second.0[j * m + y];
                            for z in 0..m {
                                let out = &mut b[(i * m + y) * m + z];
                                *out = add(*out, times(a[(i * n + j) * m + z], weight));
                            }
                        }
                    }
                }
                for i in 0..n {
                    for x in 0..m {
                        let weight = first.0[i * m + x];
                        for yz in 0..m * m {
                            let out = &mut control[x * m * m + yz][direction];
                            *out = add(*out, times(b[i * m * m + yz], weight));
                        }
                    }
                }
                let mut column = [0.0; 3];
                for i in 0..n {
                    for j in 0..n {
                        for k in 0..n {
                            let c = coefficients[(i * n + j) * n + k];
                            let (low, high) = (
                                first.2[i] * second.2[j] * third.2[k],
                                (first.2[i] + first.1[i]) * (second.2[j] + second.1[j]) * (third.2[k] + third.1[k]),
                            );
                            for axis in 0..3 {
                                column[axis] += c[axis].abs() * (high - low + SUMS * high);
                            }
                        }
                    }
                }
                error += dot(column, column);
            }
            let width = 0.5_f64.powi(level as i32);
            let corner = place.map(|index| f64::from(index) * width);
            match self.part(&mut control, error.sqrt(), inverse) {
                Ok(least) => bound = bound.min(least),
                Err(rough) => {
                    // The control matrices at the corners are the Jacobian's values there, up to the error.
                    for i in 0..3 {
                        for j in 0..3 {
                            for k in 0..3 {
                                let point = [i, j, k];
                                let at: [f64; 3] =
                                    std::array::from_fn(|axis| corner[axis] + 0.5 * width * point[axis] as f64);
                                let value = self.hexahedron_determinant(order, coefficients, inverse, at);
                                if !(value > NEGATIVE) {
                                    return Verdict::Negative(at, value);
                                }
                            }
                        }
                    }
                    if parts + stack.len() + 8 > most || level > 20 {
                        let open = stack.iter().map(|part| part.2);
                        return Verdict::Undecided(open.fold(rough, f64::min));
                    }
                    for child in 0..8_u32 {
                        let half = [child & 1, child >> 1 & 1, child >> 2];
                        let child = std::array::from_fn(|axis| 2 * place[axis] + half[axis]);
                        stack.push((child, level + 1, rough));
                    }
                }
            }
        }
        Verdict::Positive(bound)
    }

    pub(super) fn hexahedron_determinant(
        &self,
        order: usize,
        coefficients: &[[f64; 3]],
        inverse: &Columns<f64>,
        point: [f64; 3],
    ) -> f64 {
        let n = order + 1;
        let lines = point.map(|x| line_table(self.basis, order, &[x]));
        let mut raw = [[0.0; 3]; 3];
        for i in 0..n {
            for j in 0..n {
                for k in 0..n {
                    let c = coefficients[(i * n + j) * n + k];
                    for (direction, column) in raw.iter_mut().enumerate() {
                        let factor = |axis: usize, function: usize| {
                            if axis == direction {
                                lines[axis].derivatives[0][function]
                            } else {
                                lines[axis].values[function]
                            }
                        };
                        *column = add(*column, times(c, factor(0, i) * factor(1, j) * factor(2, k)));
                    }
                }
            }
        }
        determinant(&apply_right(&raw, inverse))
    }
}
