//! The paper's linear system for the slopes of the normals, in the sense of least squares.
//!
//! Unknown are the six components of `b1, b2` of every curve; equations are `t1.b1 = -l1`, `t2.b2 = -l2`, `X'.N = 0`
//! at 1/3 and 2/3 of every curve, and the twist condition at every corner: on a closed surface as many as unknowns,
//! with one rank less for every vertex of even valence. Source: Xue, Demkowicz, Bajaj 2004, equations 7 to 9, solved
//! there by a singular value decomposition.
//!
//! Small networks are solved in the same way. Larger ones by steps of `(A^T A + m I)^-1 A^T r` with a sparse Cholesky
//! factorization, which stay in the range of `A^T` and so approach the shortest solution; parts that belong to singular
//! values far below `sqrt m` are left out, as a tolerance would.

use super::edge_normals::Slopes;
use super::hermite;
use super::network::Network;
use crate::linalg::sparse::{BlockCholesky, BlockPattern};
use crate::linalg::vector3::{dot, times};
use faer::Mat;

/// Networks of at most this many curves are solved by a singular value decomposition.
pub const DENSE: usize = 200;

/// Steps on larger networks end at this change, relative to the solution.
const SETTLED: f64 = 1e-12;

/// A solution and what is known of the system.
pub struct Solved {
    pub slopes: Slopes,
    /// Rank of the matrix at the tolerance; unknown for large networks.
    pub rank: Option<usize>,
    /// Where the steps on a large network did not settle: the last change, relative to the solution.
    pub unsettled: Option<f64>,
}

/// An equation: up to two curve ends (`2 edge + end`) with their coefficient vectors, and the right-hand side.
struct Equation {
    ends: [(usize, [f64; 3]); 2],
    rhs: f64,
}

/// Visits all equations: four for every curve, then one for every corner.
fn equations(network: &Network) -> Vec<Equation> {
    let mut all = Vec::with_capacity(4 * network.tangents.len() + 4 * network.quads.len());
    for (edge, &[t1, t2]) in network.tangents.iter().enumerate() {
        let [a, b] = network.connectivity.edges[edge].map(|vertex| vertex as usize);
        let (first, second) = (2 * edge, 2 * edge + 1);
        let bends = [a, b].map(|vertex| network.spoke(edge as u32, vertex).bend);
        all.push(Equation {
            ends: [(first, t1), (second, [0.0; 3])],
            rhs: -bends[0],
        });
        all.push(Equation {
            ends: [(first, [0.0; 3]), (second, t2)],
            rhs: -bends[1],
        });
        for x in [1.0 / 3.0, 2.0 / 3.0] {
            let slope = network.slope(edge, x);
            let values = hermite::values(x);
            let known = [network.normals[a], network.normals[b], [0.0; 3], [0.0; 3]];
            all.push(Equation {
                ends: [(first, times(slope, values[2])), (second, times(slope, values[3]))],
                rhs: -dot(hermite::combine(&values, &known), slope),
            });
        }
    }
    let mut spokes = Vec::new();
    for vertex in 0..network.points.len() {
        network.spokes(vertex, &mut spokes);
        for corner in 0..network.connectivity.stars.row(vertex).len() {
            let (a, b) = (spokes[corner], spokes[(corner + 1) % spokes.len()]);
            let signed =
                |spoke: &super::network::Spoke, tangent| times(tangent, if spoke.end == 0 { 1.0 } else { -1.0 });
            all.push(Equation {
                ends: [
                    (2 * a.edge as usize + a.end, signed(&a, b.tangent)),
                    (2 * b.edge as usize + b.end, times(signed(&b, a.tangent), -1.0)),
                ],
                rhs: 0.0,
            });
        }
    }
    all
}

/// Solves the system; `tolerance` is the share of the largest singular value below which one counts as zero.
///
/// # Errors
/// When a decomposition fails or the mesh is too large for the sparse factorization.
pub fn solve(network: &Network, tolerance: f64) -> Result<Solved, String> {
    let equations = equations(network);
    let unknowns = 6 * network.tangents.len();
    let (solution, rank, unsettled) = if network.tangents.len() <= DENSE {
        let (solution, rank) = dense(&equations, unknowns, tolerance)?;
        (solution, Some(rank), None)
    } else {
        let (solution, change) = sparse(network, &equations, unknowns)?;
        (solution, None, Some(change).filter(|change| !(*change <= SETTLED)))
    };
    let slopes = solution
        .as_chunks::<6>()
        .0
        .iter()
        .map(|&[a, b, c, d, e, f]| [[a, b, c], [d, e, f]])
        .collect();
    Ok(Solved {
        slopes,
        rank,
        unsettled,
    })
}

/// The rank of the system at the tolerance, for networks of at most [`DENSE`] curves.
pub fn rank(network: &Network, tolerance: f64) -> Option<usize> {
    if network.tangents.len() > DENSE {
        return None;
    }
    let matrix = matrix(&equations(network), 6 * network.tangents.len());
    let values = matrix.singular_values().ok()?;
    let largest = values.iter().copied().fold(0.0, f64::max);
    Some(values.iter().filter(|&&value| value > tolerance * largest).count())
}

fn matrix(equations: &[Equation], unknowns: usize) -> Mat<f64> {
    let mut matrix = Mat::<f64>::zeros(equations.len(), unknowns);
    for (row, equation) in equations.iter().enumerate() {
        for (end, coefficients) in equation.ends {
            for axis in 0..3 {
                matrix[(row, 3 * end + axis)] += coefficients[axis];
            }
        }
    }
    matrix
}

fn dense(equations: &[Equation], unknowns: usize, tolerance: f64) -> Result<(Vec<f64>, usize), String> {
    let matrix = matrix(equations, unknowns);
    let decomposition = matrix
        .thin_svd()
        .map_err(|error| format!("the singular value decomposition of the normals' system failed: {error:?}"))?;
    let (u, v) = (decomposition.U(), decomposition.V());
    let values = decomposition.S().column_vector();
    let largest = (0..values.nrows()).map(|index| values[index]).fold(0.0, f64::max);
    let mut solution = vec![0.0; unknowns];
    let mut rank = 0;
    for index in 0..values.nrows() {
        if values[index] > tolerance * largest {
            rank += 1;
            let along: f64 = equations
                .iter()
                .enumerate()
                .map(|(row, equation)| u[(row, index)] * equation.rhs)
                .sum();
            for (unknown, value) in solution.iter_mut().enumerate() {
                *value += v[(unknown, index)] * along / values[index];
            }
        }
    }
    Ok((solution, rank))
}

fn sparse(network: &Network, equations: &[Equation], unknowns: usize) -> Result<(Vec<f64>, f64), String> {
    // A node for every curve end, near its vertex so that the order of elimination sees the surface.
    let points: Vec<[f64; 3]> = (0..2 * network.tangents.len())
        .map(|node| {
            let curve = network.curve(node / 2);
            let near = if node % 2 == 0 { 0.75 } else { 0.25 };
            std::array::from_fn(|axis| near * curve[0][axis] + (1.0 - near) * curve[1][axis])
        })
        .collect();
    let cells: Vec<[u32; 2]> = equations
        .iter()
        .map(|equation| equation.ends.map(|(node, _)| node as u32))
        .collect();
    let pattern =
        BlockPattern::<3>::new(&points, &cells, &vec![true; points.len()]).map_err(|error| error.to_string())?;
    let mut parts = vec![0.0; pattern.parts_len()];
    for (parts, equation) in parts.as_chunks_mut::<27>().0.iter_mut().zip(equations) {
        let [(_, a), (_, b)] = equation.ends;
        for (block, (x, y)) in [(a, a), (a, b), (b, b)].into_iter().enumerate() {
            for row in 0..3 {
                for column in 0..3 {
                    parts[9 * block + 3 * row + column] = x[row] * y[column];
                }
            }
        }
    }
    let mut values = vec![0.0; pattern.values_len()];
    pattern.assemble(&parts, &mut values);
    drop(parts);
    let largest = pattern.diagonal(&values).into_iter().fold(0.0, f64::max);
    let mut solver = BlockCholesky::new(pattern);
    let mut shift = 1e-12 * largest;
    while let Err(error) = solver.factorize(&values, shift) {
        shift *= 10.0;
        if !(shift < largest) {
            return Err(format!("the normals' system: {error}"));
        }
    }
    let mut solution = vec![0.0; unknowns];
    let mut step = vec![0.0; unknowns];
    let mut relative = f64::INFINITY;
    for _ in 0..30 {
        step.fill(0.0);
        for equation in equations {
            let value = |(node, coefficients): (usize, [f64; 3]), x: &[f64]| -> f64 {
                (0..3).map(|axis| coefficients[axis] * x[3 * node + axis]).sum()
            };
            let residual = equation.rhs - value(equation.ends[0], &solution) - value(equation.ends[1], &solution);
            for (node, coefficients) in equation.ends {
                for axis in 0..3 {
                    step[3 * node + axis] += coefficients[axis] * residual;
                }
            }
        }
        solver.solve_in_place(&mut step);
        let (mut change, mut size) = (0.0f64, 0.0f64);
        for (value, step) in solution.iter_mut().zip(&step) {
            *value += step;
            change = change.max(step.abs());
            size = size.max(value.abs());
        }
        relative = change / size.max(f64::MIN_POSITIVE);
        if relative <= SETTLED {
            break;
        }
    }
    Ok((solution, relative))
}
