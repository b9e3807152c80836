//! Hexahedra with 5 by 5 by 5 control points, and the sign of their Jacobian determinant on the whole of them.
//!
//! The map is `X = sum P_ijk B_i(u) B_j(v) B_k(w)` over Bernstein polynomials of degree 4. Its determinant is a
//! polynomial of degree 11 in every variable; its Bernstein coefficients follow from products of polynomials, and the
//! least of them is a lower bound. Where that is not positive the cube is halved and the bound sharpens, until it is
//! positive or a corner of a part shows a determinant that is not.
//!
//! Guaranteed: [`Verdict::Positive`] up to the rounding of the coefficients, for which a margin is kept. Not
//! guaranteed: a verdict for determinants that touch zero; then the bisection ends undecided.

use crate::linalg::vector3::{cross, dot};

/// Control points: entry `25 i + 5 j + k` belongs to `B_i(u) B_j(v) B_k(w)`.
pub type ControlPoints = [[f64; 3]; 125];

/// Coefficients along a side of the determinant's array.
const SIDE: usize = 12;
const BINOMIAL_3: [f64; 4] = [1.0, 3.0, 3.0, 1.0];
const BINOMIAL_4: [f64; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];
const BINOMIAL_11: [f64; SIDE] = [
    1.0, 11.0, 55.0, 165.0, 330.0, 462.0, 462.0, 330.0, 165.0, 55.0, 11.0, 1.0,
];

/// What is proven of a determinant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Positive everywhere; `bound` is below the least value.
    Positive { bound: f64, parts: usize },
    /// Not positive somewhere: the value there.
    NotPositive { value: f64 },
    /// Neither was shown within the allowed number of parts.
    Undecided { bound: f64 },
}

/// The hexahedron between six faces by linear blending (Gordon and Hall 1973): faces less edges plus corners. Faces
/// are given by their 25 control points in the frame of the hexahedron: `u = 0, 1` with parameters (v, w), `v = 0, 1`
/// with (u, w), `w = 0, 1` with (u, v); entry `5 a + b`. They must agree along their common edges.
pub fn transfinite(faces: &[[[f64; 3]; 25]; 6]) -> ControlPoints {
    let mut points = [[0.0; 3]; 125];
    let blend = |index: usize, end: usize| {
        let t = index as f64 / 4.0;
        if end == 0 { 1.0 - t } else { t }
    };
    // Each end of the hexahedron's edges and corners is read off a face that holds it.
    for i in 0..5 {
        for j in 0..5 {
            for k in 0..5 {
                let point = &mut points[25 * i + 5 * j + k];
                for axis in 0..3 {
                    let mut value = 0.0;
                    for end in 0..2 {
                        value += blend(i, end) * faces[end][5 * j + k][axis];
                        value += blend(j, end) * faces[2 + end][5 * i + k][axis];
                        value += blend(k, end) * faces[4 + end][5 * i + j][axis];
                    }
                    for a in 0..2 {
                        for b in 0..2 {
                            value -= blend(i, a) * blend(j, b) * faces[a][20 * b + k][axis];
                            value -= blend(i, a) * blend(k, b) * faces[a][5 * j + 4 * b][axis];
                            value -= blend(j, a) * blend(k, b) * faces[2 + a][5 * i + 4 * b][axis];
                            for c in 0..2 {
                                let corner = faces[a][20 * b + 4 * c][axis];
                                value += blend(i, a) * blend(j, b) * blend(k, c) * corner;
                            }
                        }
                    }
                    point[axis] = value;
                }
            }
        }
    }
    points
}

/// A vector polynomial with scaled coefficients (each times its binomials), dimensions, and entry `(i ny + j) nz + k`.
struct Polynomial {
    size: [usize; 3],
    values: Vec<[f64; 3]>,
}

/// The derivative of the map by variable `axis`, scaled.
fn derivative(points: &ControlPoints, axis: usize) -> Polynomial {
    let mut size = [5; 3];
    size[axis] = 4;
    let stride = [25, 5, 1][axis];
    let mut values = Vec::with_capacity(100);
    for i in 0..size[0] {
        for j in 0..size[1] {
            for k in 0..size[2] {
                let place = 25 * i + 5 * j + k;
                let weights = [i, j, k];
                let weight: f64 = (0..3)
                    .map(|d| {
                        if d == axis {
                            BINOMIAL_3[weights[d]]
                        } else {
                            BINOMIAL_4[weights[d]]
                        }
                    })
                    .product();
                let (low, high) = (points[place], points[place + stride]);
                values.push(std::array::from_fn(|c| 4.0 * weight * (high[c] - low[c])));
            }
        }
    }
    Polynomial { size, values }
}

/// Bernstein coefficients of the determinant of degree 11, entry `(12 i + j) 12 + k`.
pub fn determinant(points: &ControlPoints) -> Vec<f64> {
    let [u, v, w] = [0, 1, 2].map(|axis| derivative(points, axis));
    // X_v x X_w: degrees 8, 7, 7.
    let size = [9, 8, 8];
    let mut area = vec![[0.0; 3]; size.iter().product()];
    convolve(&v, &w, |place, a, b| {
        let product = cross(a, b);
        for axis in 0..3 {
            area[place][axis] += product[axis];
        }
    });
    let area = Polynomial { size, values: area };
    let mut values = vec![0.0; SIDE * SIDE * SIDE];
    convolve(&u, &area, |place, a, b| values[place] += dot(a, b));
    for i in 0..SIDE {
        for j in 0..SIDE {
            for k in 0..SIDE {
                values[(SIDE * i + j) * SIDE + k] /= BINOMIAL_11[i] * BINOMIAL_11[j] * BINOMIAL_11[k];
            }
        }
    }
    values
}

fn convolve(a: &Polynomial, b: &Polynomial, mut visit: impl FnMut(usize, [f64; 3], [f64; 3])) {
    let size: [usize; 3] = std::array::from_fn(|axis| a.size[axis] + b.size[axis] - 1);
    let mut first = a.values.iter();
    for i in 0..a.size[0] {
        for j in 0..a.size[1] {
            for k in 0..a.size[2] {
                let Some(&left) = first.next() else { return };
                let mut second = b.values.iter();
                for l in 0..b.size[0] {
                    for m in 0..b.size[1] {
                        let place = ((i + l) * size[1] + j + m) * size[2] + k;
                        for n in 0..b.size[2] {
                            if let Some(&right) = second.next() {
                                visit(place + n, left, right);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Rounding of the coefficients relative to the product of the three columns' sizes.
const MARGIN: f64 = 1e-13;

/// Whether the determinant is positive on the whole hexahedron; the cube is cut into at most `most` parts.
pub fn certify(points: &ControlPoints, most: usize) -> Verdict {
    let scale: f64 = (0..3)
        .map(|axis| {
            let derivative = derivative(points, axis);
            // Scaled coefficients are at most 6 * 6 * 3 times the plain ones.
            let largest = derivative
                .values
                .iter()
                .map(|value| dot(*value, *value))
                .fold(0.0, f64::max);
            largest.sqrt()
        })
        .product();
    let margin = MARGIN * scale;
    let mut stack = vec![(determinant(points), 0usize)];
    let mut bound = f64::INFINITY;
    let mut parts = 0;
    while let Some((values, axis)) = stack.pop() {
        parts += 1;
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let end = SIDE - 1;
        for corner in 0..8 {
            let [i, j, k] = [0, 1, 2].map(|bit| if corner >> bit & 1 == 1 { end } else { 0 });
            let value = values[(SIDE * i + j) * SIDE + k];
            if !(value > margin) {
                return Verdict::NotPositive { value };
            }
        }
        if least > margin {
            bound = bound.min(least);
            continue;
        }
        if parts + stack.len() >= most {
            return Verdict::Undecided { bound: least };
        }
        let [low, high] = halve(&values, axis);
        stack.push((low, (axis + 1) % 3));
        stack.push((high, (axis + 1) % 3));
    }
    Verdict::Positive { bound, parts }
}

/// The coefficients of both halves along an axis, by de Casteljau's scheme.
fn halve(values: &[f64], axis: usize) -> [Vec<f64>; 2] {
    let mut low = values.to_vec();
    let mut high = values.to_vec();
    let stride = [SIDE * SIDE, SIDE, 1][axis];
    let others = [[SIDE, 1], [SIDE * SIDE, 1], [SIDE * SIDE, SIDE]][axis];
    for a in 0..SIDE {
        for b in 0..SIDE {
            let start = a * others[0] + b * others[1];
            let mut row: [f64; SIDE] = std::array::from_fn(|index| values[start + index * stride]);
            for level in 0..SIDE {
                low[start + level * stride] = row[0];
                high[start + (SIDE - 1 - level) * stride] = row[SIDE - 1 - level];
                for index in 0..SIDE - 1 - level {
                    row[index] = 0.5 * (row[index] + row[index + 1]);
                }
            }
        }
    }
    [low, high]
}

/// The determinant and the product of the columns' lengths at a point.
pub fn jacobian(points: &ControlPoints, at: [f64; 3]) -> (f64, f64) {
    let values = at.map(bernstein);
    let slopes = at.map(slope);
    let column = |axis: usize| -> [f64; 3] {
        let factor = |d: usize, index: usize| if d == axis { slopes[d][index] } else { values[d][index] };
        let mut sum = [0.0; 3];
        for i in 0..5 {
            for j in 0..5 {
                let outer = factor(0, i) * factor(1, j);
                for k in 0..5 {
                    let weight = outer * factor(2, k);
                    for (total, coordinate) in sum.iter_mut().zip(points[25 * i + 5 * j + k]) {
                        *total += weight * coordinate;
                    }
                }
            }
        }
        sum
    };
    let columns = [column(0), column(1), column(2)];
    let sizes = columns.iter().map(|column| dot(*column, *column).sqrt()).product();
    (dot(columns[0], cross(columns[1], columns[2])), sizes)
}

/// The position at a point.
pub fn position(points: &ControlPoints, at: [f64; 3]) -> [f64; 3] {
    let [u, v, w] = at.map(bernstein);
    let mut sum = [0.0; 3];
    for i in 0..5 {
        for j in 0..5 {
            for k in 0..5 {
                for (total, coordinate) in sum.iter_mut().zip(points[25 * i + 5 * j + k]) {
                    *total += u[i] * v[j] * w[k] * coordinate;
                }
            }
        }
    }
    sum
}

fn bernstein(t: f64) -> [f64; 5] {
    let s = 1.0 - t;
    [
        s * s * s * s,
        4.0 * s * s * s * t,
        6.0 * s * s * t * t,
        4.0 * s * t * t * t,
        t * t * t * t,
    ]
}

fn slope(t: f64) -> [f64; 5] {
    let s = 1.0 - t;
    let cubic = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
    [
        -4.0 * cubic[0],
        4.0 * (cubic[0] - cubic[1]),
        4.0 * (cubic[1] - cubic[2]),
        4.0 * (cubic[2] - cubic[3]),
        4.0 * cubic[3],
    ]
}
