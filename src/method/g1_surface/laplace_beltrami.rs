//! A test problem that shows what the geometry does to a high-order simulation: `u - (surface Laplacian of u) = f` on
//! patches that stand for a surface given by a formula, with a known solution.
//!
//! The solution is the restriction of `exp(0.7 x - 0.4 y + 0.3 z) + x y - z^2 / 2`. Its Laplacian on the surface with
//! unit normal `n` and `k = div n` is `tr H - n.H n - k n.grad`, with gradient and Hessian in space. Data on the
//! patches are those of the nearest point of the true surface, as in the analysis of surface finite elements (Dziuk
//! 1988; Demlow 2009); on open surfaces the boundary values are given. Functions on the patches are tensor products of
//! Lagrange polynomials at Gauss-Lobatto points; the geometry is that of the patches at every order, so that nothing
//! but it limits the rates.

use super::network::in_plane;
use super::numbering::Numbering;
use super::patch::Patch;
use super::surface::{self, Place};
use crate::linalg::elementary;
use crate::linalg::sparse::{BlockCholesky, BlockPattern};
use crate::linalg::vector3::{add, dot, subtract, times};
use crate::mesh::generate::surface::analytic::Analytic;
use crate::mesh::quadrilateral::Connectivity;
use rayon::prelude::*;

/// What the solution is off by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved {
    pub unknowns: usize,
    /// `L2` norm of the error over that of the solution, both on the patches.
    pub error: f64,
    /// The same for the gradients along the patches, against that of the solution carried over by nearest points.
    pub gradient_error: f64,
}

/// The solution, its gradient in space and the right-hand side at a point of the surface.
fn data(exact: &Analytic, x: [f64; 3]) -> (f64, [f64; 3], f64) {
    let e = elementary::exp(0.7 * x[0] - 0.4 * x[1] + 0.3 * x[2]);
    let direction = [0.7, -0.4, 0.3];
    let value = e + x[0] * x[1] - 0.5 * x[2] * x[2];
    let gradient = [
        direction[0] * e + x[1],
        direction[1] * e + x[0],
        direction[2] * e - x[2],
    ];
    let mut hessian = [[0.0; 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            hessian[row][column] = direction[row] * direction[column] * e;
        }
    }
    hessian[0][1] += 1.0;
    hessian[1][0] += 1.0;
    hessian[2][2] -= 1.0;
    let n = exact.normal(x);
    let trace = hessian[0][0] + hessian[1][1] + hessian[2][2];
    let across: f64 = (0..3).map(|row| n[row] * dot(hessian[row], n)).sum();
    let along = dot(gradient, n);
    let laplacian = trace - across - exact.mean_curvature(x) * along;
    let tangential = std::array::from_fn(|axis| gradient[axis] - along * n[axis]);
    (value, tangential, value - laplacian)
}

/// The gradient in space, at `x`, of the function carried over from the surface by nearest points, from its gradient
/// along the surface at the nearest point `foot`: the derivative of the nearest point is `(I + d W)^-1 P`, with the
/// signed distance `d`, the projection `P` onto the tangent plane and the derivative `W` of the unit normal there
/// (Dziuk and Elliott 2013, Finite element methods for surface PDEs, section 4.1).
fn carried(exact: &Analytic, foot: [f64; 3], x: [f64; 3], gradient: [f64; 3]) -> [f64; 3] {
    let level = exact.derivatives(foot);
    let size = dot(level.gradient, level.gradient).sqrt();
    let normal = times(level.gradient, 1.0 / size);
    let distance = dot(subtract(x, foot), normal);
    let columns: [[f64; 3]; 3] = std::array::from_fn(|axis| {
        let mut unit = [0.0; 3];
        unit[axis] = 1.0;
        let along = in_plane(unit, normal);
        let bent = [0, 1, 2].map(|row: usize| dot(level.hessian[row], along) / size);
        add(unit, times(in_plane(bent, normal), distance))
    });
    let matrix = nalgebra::Matrix3::from_columns(&columns.map(nalgebra::Vector3::from));
    // Singular only in the centres of curvature, where there is no nearest point.
    let solved = matrix.lu().solve(&nalgebra::Vector3::from(gradient));
    in_plane(solved.map_or(gradient, Into::into), normal)
}

/// Values of the Legendre polynomial of this degree and its derivative.
fn legendre(degree: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    if degree == 0 {
        return (1.0, 0.0);
    }
    for n in 1..degree {
        let next = ((2 * n + 1) as f64 * x * value - n as f64 * before) / (n + 1) as f64;
        (before, value) = (value, next);
    }
    let n = degree as f64;
    (value, n * (x * value - before) / (x * x - 1.0))
}

/// Gauss points and weights on the unit interval.
fn gauss(count: usize) -> Vec<(f64, f64)> {
    (0..count)
        .map(|index| {
            let mut x = -(std::f64::consts::PI * (index as f64 + 0.75) / (count as f64 + 0.5)).cos();
            for _ in 0..20 {
                let (value, slope) = legendre(count, x);
                x -= value / slope;
            }
            let (_, slope) = legendre(count, x);
            ((1.0 + x) / 2.0, 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Gauss-Lobatto points on the unit interval: the ends and the zeros of the Legendre polynomial's derivative.
fn lobatto(order: usize) -> Vec<f64> {
    let mut points = vec![0.0];
    for index in 1..order {
        let mut x = -(std::f64::consts::PI * index as f64 / order as f64).cos();
        for _ in 0..30 {
            let (value, slope) = legendre(order, x);
            // (1 - x^2) P'' = 2 x P' - p (p + 1) P.
            let second = (2.0 * x * slope - (order * (order + 1)) as f64 * value) / (1.0 - x * x);
            x -= slope / second;
        }
        points.push((1.0 + x) / 2.0);
    }
    points.push(1.0);
    points
}

/// Values and slopes at `x` of the Lagrange polynomials at these points.
fn lagrange(points: &[f64], x: f64) -> (Vec<f64>, Vec<f64>) {
    let count = points.len();
    let mut values = vec![1.0; count];
    let mut slopes = vec![0.0; count];
    for i in 0..count {
        for j in (0..count).filter(|&j| j != i) {
            let scale = points[i] - points[j];
            slopes[i] = (slopes[i] * (x - points[j]) + values[i]) / scale;
            values[i] *= (x - points[j]) / scale;
        }
    }
    (values, slopes)
}

/// Solves the problem with functions of the given order, 1 to 6.
///
/// # Errors
/// For another order, or when the system cannot be solved.
pub fn solve(
    patches: &[Patch],
    quads: &[[u32; 4]],
    connectivity: &Connectivity,
    exact: &Analytic,
    order: usize,
) -> Result<Solved, String> {
    match order {
        1 => solve_order::<4>(patches, quads, connectivity, exact, order),
        2 => solve_order::<9>(patches, quads, connectivity, exact, order),
        3 => solve_order::<16>(patches, quads, connectivity, exact, order),
        4 => solve_order::<25>(patches, quads, connectivity, exact, order),
        5 => solve_order::<36>(patches, quads, connectivity, exact, order),
        6 => solve_order::<49>(patches, quads, connectivity, exact, order),
        _ => Err(format!(
            "the order of the test problem is {order}; it must be within 1 and 6"
        )),
    }
}

/// A point of the quadrature on a patch.
struct Sample {
    /// Area times weight.
    weight: f64,
    value: f64,
    /// Along the patch, of the solution carried over by nearest points.
    gradient: [f64; 3],
    load: f64,
    /// Vectors in the tangent plane whose products with `X_u`, `X_v` are 1 or 0.
    duals: [[f64; 3]; 2],
}

fn solve_order<const N: usize>(
    patches: &[Patch],
    quads: &[[u32; 4]],
    connectivity: &Connectivity,
    exact: &Analytic,
    order: usize,
) -> Result<Solved, String> {
    let nodes = lobatto(order);
    let inner = order - 1;
    let vertices = connectivity.stars.len();
    let numbering = Numbering::new(quads, connectivity, order)?;
    let total = numbering.len();
    let mut points = vec![[0.0; 3]; total];
    let mut free = vec![true; total];
    let places: Vec<Place> = nodes.iter().map(|&node| Place::new(node)).collect();
    let mut cells = Vec::with_capacity(patches.len());
    for (index, patch) in patches.iter().enumerate() {
        let cell: [u32; N] = std::array::from_fn(|local| {
            let (i, j) = (local % (order + 1), local / (order + 1));
            let name = numbering.point(index, i, j);
            points[name] = surface::position(patch, &places[i], &places[j]);
            name as u32
        });
        cells.push(cell);
    }
    for (edge, sides) in connectivity.sides.iter().enumerate() {
        if sides.contains(&crate::mesh::connectivity::NONE) {
            for vertex in connectivity.edges[edge] {
                free[vertex as usize] = false;
            }
            for step in 0..inner {
                free[vertices + edge * inner + step] = false;
            }
        }
    }

    let rule = gauss(order + 5);
    let basis: Vec<(Place, Vec<f64>, Vec<f64>)> = rule
        .iter()
        .map(|&(x, _)| {
            let (values, slopes) = lagrange(&nodes, x);
            (Place::new(x), values, slopes)
        })
        .collect();
    let samples: Vec<Vec<Sample>> = patches
        .par_iter()
        .map(|patch| {
            let mut samples = Vec::with_capacity(rule.len() * rule.len());
            for (j, (_, weight_v)) in rule.iter().enumerate() {
                for (i, (_, weight_u)) in rule.iter().enumerate() {
                    let jet = surface::first_derivatives(patch, &basis[i].0, &basis[j].0);
                    let (e, f, g) = (dot(jet.u, jet.u), dot(jet.u, jet.v), dot(jet.v, jet.v));
                    let determinant = e * g - f * f;
                    let foot = exact.closest(jet.position);
                    let (value, gradient, load) = data(exact, foot);
                    let gradient = carried(exact, foot, jet.position, gradient);
                    let duals = [
                        std::array::from_fn(|axis| (g * jet.u[axis] - f * jet.v[axis]) / determinant),
                        std::array::from_fn(|axis| (e * jet.v[axis] - f * jet.u[axis]) / determinant),
                    ];
                    let (by_u, by_v) = (dot(gradient, jet.u), dot(gradient, jet.v));
                    samples.push(Sample {
                        weight: determinant.sqrt() * weight_u * weight_v,
                        value,
                        gradient: add(times(duals[0], by_u), times(duals[1], by_v)),
                        load,
                        duals,
                    });
                }
            }
            samples
        })
        .collect();
    let pattern = BlockPattern::<1>::new(&points, &cells, &free).map_err(|error| error.to_string())?;
    let given: Vec<f64> = points
        .iter()
        .zip(&free)
        .map(|(&point, &free)| if free { 0.0 } else { data(exact, exact.closest(point)).0 })
        .collect();
    let per_cell = N * (N + 1) / 2;
    let mut parts = vec![0.0; pattern.parts_len()];
    let mut loads = vec![0.0; patches.len() * N];
    parts
        .par_chunks_mut(per_cell)
        .zip(loads.par_chunks_mut(N))
        .zip(&samples)
        .for_each(|((parts, loads), samples)| {
            let mut functions = [(0.0, [0.0; 3]); N];
            for (place, sample) in samples.iter().enumerate() {
                evaluate::<N>(place, rule.len(), order, &basis, sample, &mut functions);
                let mut part = parts.iter_mut();
                for a in 0..N {
                    let (value, gradient) = functions[a];
                    loads[a] += sample.weight * sample.load * value;
                    for (other, part) in functions[a..].iter().zip(part.by_ref()) {
                        *part += sample.weight * (value * other.0 + dot(gradient, other.1));
                    }
                }
            }
        });
    let mut matrix = vec![0.0; pattern.values_len()];
    pattern.assemble(&parts, &mut matrix);
    let mut rhs = vec![0.0; pattern.dimension()];
    for (index, cell) in cells.iter().enumerate() {
        let parts = &parts[index * per_cell..(index + 1) * per_cell];
        for a in 0..N {
            let Some(value) = rhs.get_mut(pattern.free_index()[cell[a] as usize] as usize) else {
                continue;
            };
            *value += loads[index * N + a];
            for b in (0..N).filter(|&b| !free[cell[b] as usize]) {
                let (low, high) = (a.min(b), a.max(b));
                let place = low * N - low * (low + 1) / 2 + high;
                *value -= parts[place] * given[cell[b] as usize];
            }
        }
    }
    drop(parts);
    let mut solver = BlockCholesky::new(pattern);
    solver
        .factorize(&matrix, 0.0)
        .map_err(|error| format!("the test problem on the surface: {error}"))?;
    solver.solve_in_place(&mut rhs);
    let mut solution = given;
    for (&node, value) in solver.pattern().vertices().iter().zip(rhs) {
        solution[node as usize] = value;
    }
    let errors: Vec<[f64; 4]> = cells
        .par_iter()
        .zip(&samples)
        .map(|(cell, samples)| {
            let mut sums = [0.0; 4];
            let mut functions = [(0.0, [0.0; 3]); N];
            for (place, sample) in samples.iter().enumerate() {
                evaluate::<N>(place, rule.len(), order, &basis, sample, &mut functions);
                let (mut value, mut gradient) = (0.0, [0.0; 3]);
                for (&node, function) in cell.iter().zip(&functions) {
                    value += solution[node as usize] * function.0;
                    for axis in 0..3 {
                        gradient[axis] += solution[node as usize] * function.1[axis];
                    }
                }
                let difference: [f64; 3] = std::array::from_fn(|axis| gradient[axis] - sample.gradient[axis]);
                sums[0] += sample.weight * (value - sample.value).powi(2);
                sums[1] += sample.weight * sample.value.powi(2);
                sums[2] += sample.weight * dot(difference, difference);
                sums[3] += sample.weight * dot(sample.gradient, sample.gradient);
            }
            sums
        })
        .collect();
    let sum = |index: usize| errors.iter().map(|sums| sums[index]).sum::<f64>();
    Ok(Solved {
        unknowns: solver.pattern().dimension(),
        error: (sum(0) / sum(1)).sqrt(),
        gradient_error: (sum(2) / sum(3)).sqrt(),
    })
}

/// Values and gradients of a patch's functions at a point of the quadrature.
fn evaluate<const N: usize>(
    place: usize,
    rule: usize,
    order: usize,
    basis: &[(Place, Vec<f64>, Vec<f64>)],
    sample: &Sample,
    functions: &mut [(f64, [f64; 3]); N],
) {
    let (_, values_u, slopes_u) = &basis[place % rule];
    let (_, values_v, slopes_v) = &basis[place / rule];
    for (local, function) in functions.iter_mut().enumerate() {
        let (i, j) = (local % (order + 1), local / (order + 1));
        let (by_u, by_v) = (slopes_u[i] * values_v[j], values_u[i] * slopes_v[j]);
        *function = (
            values_u[i] * values_v[j],
            std::array::from_fn(|axis| by_u * sample.duals[0][axis] + by_v * sample.duals[1][axis]),
        );
    }
}
