//! Rules on the canonical triangle and tetrahedron.

use super::Scattered;
use super::line::{gauss, gauss_jacobi};

/// Collapsed Gauss points, exact to total degree `2n - 1`; weights sum to 1/2.
pub fn gauss_triangle(n: usize) -> Scattered<2> {
    let (first, second) = (gauss_jacobi(n, 1), gauss(n));
    let mut rule = Scattered {
        points: Vec::with_capacity(n * n),
        weights: Vec::with_capacity(n * n),
    };
    for (&x, &a) in first.points.iter().zip(&first.weights) {
        for (&y, &b) in second.points.iter().zip(&second.weights) {
            rule.points.push([x, (1.0 - x) * y]);
            rule.weights.push(a * b);
        }
    }
    rule
}

/// Collapsed Gauss points, exact to total degree `2n - 1`; weights sum to 1/6.
pub fn gauss_tetrahedron(n: usize) -> Scattered<3> {
    let (first, second, third) = (gauss_jacobi(n, 2), gauss_jacobi(n, 1), gauss(n));
    let mut rule = Scattered {
        points: Vec::with_capacity(n * n * n),
        weights: Vec::with_capacity(n * n * n),
    };
    for (&x, &a) in first.points.iter().zip(&first.weights) {
        for (&y, &b) in second.points.iter().zip(&second.weights) {
            for (&z, &c) in third.points.iter().zip(&third.weights) {
                rule.points.push([x, (1.0 - x) * y, (1.0 - x) * (1.0 - y) * z]);
                rule.weights.push(a * b * c);
            }
        }
    }
    rule
}

/// Vertices of a lattice with `n` points a side, each with a third of the small triangles around it: exact for linear
/// functions.
pub fn lattice_triangle(n: usize) -> Scattered<2> {
    assert!(n > 1, "at least two points");
    let last = n - 1;
    let step = 1.0 / last as f64;
    let mut rule = Scattered {
        points: Vec::new(),
        weights: Vec::new(),
    };
    for i in 0..=last {
        for j in 0..=last - i {
            let on_sides = [i, j, last - i - j].iter().filter(|&&index| index == 0).count();
            let triangles = [6.0, 3.0, 1.0][on_sides];
            rule.points.push([i as f64 * step, j as f64 * step]);
            rule.weights.push(triangles / 3.0 * 0.5 * step * step);
        }
    }
    rule
}

/// Vertices of a lattice with `n` points a side. The lattice cuts the tetrahedron into small tetrahedra and octahedra;
/// each gives its volume in equal parts to its corners: exact for linear functions.
pub fn lattice_tetrahedron(n: usize) -> Scattered<3> {
    assert!(n > 1, "at least two points");
    let last = (n - 1) as i64;
    let step = 1.0 / last as f64;
    let mut shares = std::collections::BTreeMap::<[i64; 3], f64>::new();
    let cells: [(&[[i64; 3]], f64); 3] = [
        (&[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], 0.25),
        (
            &[[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]],
            2.0 / 3.0,
        ),
        (&[[1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 1, 1]], 0.25),
    ];
    for i in 0..=last {
        for j in 0..=last - i {
            for k in 0..=last - i - j {
                for (corners, share) in cells {
                    let corners = corners.iter().map(|c| [i + c[0], j + c[1], k + c[2]]);
                    if corners.clone().all(|corner| corner.iter().sum::<i64>() <= last) {
                        for corner in corners {
                            *shares.entry(corner).or_default() += share;
                        }
                    }
                }
            }
        }
    }
    Scattered {
        points: shares
            .keys()
            .map(|corner| corner.map(|index| index as f64 * step))
            .collect(),
        weights: shares.values().map(|share| share * step.powi(3) / 6.0).collect(),
    }
}

/// Nine tenths of one rule and a tenth of another, whose points a barrier is to guard.
pub fn mixed<const N: usize>(main: Scattered<N>, guard: Scattered<N>) -> Scattered<N> {
    let weights = main.weights.iter().map(|weight| 0.9 * weight);
    Scattered {
        weights: weights.chain(guard.weights.iter().map(|weight| 0.1 * weight)).collect(),
        points: [main.points, guard.points].concat(),
    }
}
