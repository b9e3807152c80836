//! Cubic normals along the curves: `N = n1 psi_1 + n2 psi_2 + b1 psi_3 + b2 psi_4`, perpendicular to the curve
//! everywhere, with slopes `b` that agree on the twist at every corner of every patch.
//!
//! At a vertex write the slope along a curve that leaves with `t_i` and normal curvature `k_i` as
//! `b_i = -k_i t_i + s_i n x t_i + v_i n`. Then the corners ask for `s_i + s_{i+1} = (k_i - k_{i+1}) cot a_i`. At a
//! vertex with an odd number of quads this has one solution; at one with an even number it has a line of them (`s_i`
//! changed by `+m, -m, +m, ...`) if the [`enclosure`](super::enclosure) condition holds; at a boundary vertex always a
//! line. The two `v` of an edge follow from `X'.N = 0` at 1/3 and 2/3.
//!
//! [`exact`] takes the shortest `s` at every vertex on its own, or the member of all these lines for which the sum of
//! `|b|^2` is least, a sparse positive definite system with one unknown a line.
//!
//! Source: Xue, Demkowicz, Bajaj 2004, equations 6 to 9, whose solution in the sense of least squares is in
//! [`least_squares`](super::least_squares).

use super::continuity::larger;
use super::hermite;
use super::network::Network;
use crate::linalg::sparse::{BlockCholesky, BlockPattern};
use crate::linalg::vector3::{add, cross, dot, times};
use crate::mesh::length;

/// Slopes of the normals at both ends of every edge, in the direction of the edge.
pub type Slopes = Vec<[[f64; 3]; 2]>;

/// How far the slopes are from what they must fulfil.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// Largest `|X'.N|` over the curves, relative to the length of `X'`, at 0, 1/8, ..., 1.
    pub perpendicular: f64,
    /// Largest violation of the twist condition over the corners, `|b_i . t_j - b_j . t_i| / (|t_i| |t_j|)` times the
    /// mean length of the tangents.
    pub twist: f64,
    /// Longest slope.
    pub largest: f64,
}

/// The normal of an edge's curve, not of length 1.
pub fn normal(network: &Network, slopes: &Slopes, edge: usize, x: f64) -> [f64; 3] {
    hermite::combine(&hermite::values(x), &coefficients(network, slopes, edge))
}

/// Coefficients of an edge's normal over the four Hermite functions.
pub fn coefficients(network: &Network, slopes: &Slopes, edge: usize) -> [[f64; 3]; 4] {
    let [a, b] = network.connectivity.edges[edge];
    let [b1, b2] = slopes[edge];
    [network.normals[a as usize], network.normals[b as usize], b1, b2]
}

/// Measures slopes, however they were found.
pub fn residuals(network: &Network, slopes: &Slopes) -> Residuals {
    let mut found = Residuals::default();
    for edge in 0..slopes.len() {
        let curve = network.curve(edge);
        let normals = coefficients(network, slopes, edge);
        for sample in 0..=8 {
            let x = f64::from(sample) / 8.0;
            let slope = hermite::combine(&hermite::slopes(x), &curve);
            let normal = hermite::combine(&hermite::values(x), &normals);
            found.perpendicular = larger(found.perpendicular, dot(slope, normal).abs() / length(slope));
        }
        found.largest = slopes[edge]
            .iter()
            .map(|&slope| length(slope))
            .fold(found.largest, larger);
    }
    let mut spokes = Vec::new();
    for vertex in 0..network.points.len() {
        network.spokes(vertex, &mut spokes);
        let corners = network.connectivity.stars.row(vertex).len();
        for corner in 0..corners {
            let (a, b) = (&spokes[corner], &spokes[(corner + 1) % spokes.len()]);
            let outward = |spoke: &super::network::Spoke| {
                let slope = slopes[spoke.edge as usize][spoke.end];
                if spoke.end == 0 { slope } else { times(slope, -1.0) }
            };
            let (la, lb) = (length(a.tangent), length(b.tangent));
            let gap = dot(outward(a), b.tangent) - dot(outward(b), a.tangent);
            found.twist = larger(found.twist, gap.abs() * 0.5 * (la + lb) / (la * lb));
        }
    }
    found
}

/// What is known of a curve's end before the free parameters are chosen.
#[derive(Clone, Copy, Debug, Default)]
struct End {
    /// `-k t + s n x t` with a particular `s`, in the direction of the edge.
    slope: [f64; 3],
    /// `n x t` in the direction of the edge, with the sign of the spoke in the alternating family; zero at vertices
    /// without one.
    family: [f64; 3],
}

/// The equations of one edge: `M v = f - S m`, with `m` the parameters of the families at its ends.
struct EdgeSystem {
    matrix: [[f64; 2]; 2],
    family: [[f64; 2]; 2],
    rhs: [f64; 2],
    /// Square of the chord.
    square: f64,
}

impl EdgeSystem {
    fn new(network: &Network, ends: &[End; 2], edge: usize) -> Self {
        let [a, b] = network.connectivity.edges[edge].map(|vertex| vertex as usize);
        let normals = [network.normals[a], network.normals[b]];
        let chord = crate::mesh::subtract(network.points[b], network.points[a]);
        let mut system = Self {
            matrix: [[0.0; 2]; 2],
            family: [[0.0; 2]; 2],
            rhs: [0.0; 2],
            square: dot(chord, chord),
        };
        for (row, x) in [1.0 / 3.0, 2.0 / 3.0].into_iter().enumerate() {
            let slope = network.slope(edge, x);
            let values = hermite::values(x);
            let known = [normals[0], normals[1], ends[0].slope, ends[1].slope];
            system.rhs[row] = -dot(hermite::combine(&values, &known), slope);
            for end in 0..2 {
                system.matrix[row][end] = values[2 + end] * dot(slope, normals[end]);
                system.family[row][end] = values[2 + end] * dot(slope, ends[end].family);
            }
        }
        system
    }

    /// `(M M^T + small)^-1`: the small term only matters where the curve has no deflection along the normals.
    fn weight(&self) -> [[f64; 2]; 2] {
        let [[a, b], [c, d]] = self.matrix;
        let small = 1e-20 * self.square;
        let (p, q, r) = (a * a + b * b + small, a * c + b * d, c * c + d * d + small);
        let determinant = p * r - q * q;
        [[r / determinant, -q / determinant], [-q / determinant, p / determinant]]
    }

    /// The parameters `v` for given `m`: the exact solution, or the shortest nearly exact one of a singular system.
    fn solve(&self, parameters: [f64; 2]) -> [f64; 2] {
        let rhs: [f64; 2] = std::array::from_fn(|row| {
            self.rhs[row] - self.family[row][0] * parameters[0] - self.family[row][1] * parameters[1]
        });
        let [[a, b], [c, d]] = self.matrix;
        let determinant = a * d - b * c;
        let size = a.abs().max(b.abs()).max(c.abs()).max(d.abs());
        if determinant.abs() > 1e-9 * size * size && size * size > 1e-24 * self.square {
            return [
                (d * rhs[0] - b * rhs[1]) / determinant,
                (a * rhs[1] - c * rhs[0]) / determinant,
            ];
        }
        let weight = self.weight();
        let y: [f64; 2] = std::array::from_fn(|row| weight[row][0] * rhs[0] + weight[row][1] * rhs[1]);
        [a * y[0] + c * y[1], b * y[0] + d * y[1]]
    }
}

/// Slopes that fulfil all conditions, provided the enclosure condition holds: with `shortest` those for which the sum of
/// `|b|^2` over all curve ends is least, otherwise the shortest cyclic solution at every vertex on its own.
///
/// # Errors
/// When the mesh is too large for the sparse factorization, or the system is not positive definite to working precision.
pub fn exact(network: &Network, shortest: bool) -> Result<Slopes, String> {
    let mut ends = vec![[End::default(); 2]; network.tangents.len()];
    let mut spokes = Vec::new();
    let mut shears: Vec<f64> = Vec::new();
    let mut has_family = vec![false; network.points.len()];
    for vertex in 0..network.points.len() {
        network.spokes(vertex, &mut spokes);
        let normal = network.normals[vertex];
        let (corners, count) = (network.connectivity.stars.row(vertex).len(), spokes.len());
        let sign = |index: usize| if index.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut wanted = Vec::with_capacity(corners);
        for corner in 0..corners {
            let (a, b) = (&spokes[corner], &spokes[(corner + 1) % count]);
            let cotangent = dot(a.tangent, b.tangent) / dot(normal, cross(a.tangent, b.tangent));
            wanted.push((a.curvature() - b.curvature()) * cotangent);
        }
        let alternating = |values: &[f64]| -> f64 { values.iter().enumerate().map(|(i, value)| sign(i) * value).sum() };
        has_family[vertex] = corners < count || corners.is_multiple_of(2);
        if corners == count && corners.is_multiple_of(2) {
            // What rounding leaves of the enclosure condition is shared out.
            let excess = alternating(&wanted) / corners as f64;
            for (index, value) in wanted.iter_mut().enumerate() {
                *value -= sign(index) * excess;
            }
        }
        shears.clear();
        shears.push(if corners == count && !corners.is_multiple_of(2) {
            alternating(&wanted) / 2.0
        } else {
            0.0
        });
        for index in 1..count {
            shears.push(wanted[index - 1] - shears[index - 1]);
        }
        if has_family[vertex] {
            let excess = alternating(&shears) / count as f64;
            for (index, value) in shears.iter_mut().enumerate() {
                *value -= sign(index) * excess;
            }
        }
        for (index, spoke) in spokes.iter().enumerate() {
            let direction = if spoke.end == 0 { 1.0 } else { -1.0 };
            let across = times(cross(normal, spoke.tangent), direction);
            let along = times(spoke.tangent, -spoke.curvature() * direction);
            ends[spoke.edge as usize][spoke.end] = End {
                slope: add(along, times(across, shears[index])),
                family: times(across, if has_family[vertex] { sign(index) } else { 0.0 }),
            };
        }
    }
    let parameters = if shortest {
        shortest_parameters(network, &ends, &has_family)?
    } else {
        vec![0.0; network.points.len()]
    };
    let slopes = ends.iter().enumerate().map(|(edge, ends)| {
        let vertices = network.connectivity.edges[edge].map(|vertex| vertex as usize);
        let chosen = vertices.map(|vertex| parameters[vertex]);
        let along = EdgeSystem::new(network, ends, edge).solve(chosen);
        std::array::from_fn(|end| {
            add(
                add(ends[end].slope, times(ends[end].family, chosen[end])),
                times(network.normals[vertices[end]], along[end]),
            )
        })
    });
    Ok(slopes.collect())
}

/// The parameters of the families that make the sum of `|b|^2` least.
fn shortest_parameters(network: &Network, ends: &[[End; 2]], has_family: &[bool]) -> Result<Vec<f64>, String> {
    let mut parameters = vec![0.0; network.points.len()];
    if !has_family.contains(&true) {
        return Ok(parameters);
    }
    let pattern = BlockPattern::<1>::new(&network.points, &network.connectivity.edges, has_family)
        .map_err(|error| error.to_string())?;
    let mut parts = vec![0.0; pattern.parts_len()];
    let mut rhs = vec![0.0; pattern.dimension()];
    for (edge, parts) in parts.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        let system = EdgeSystem::new(network, &ends[edge], edge);
        let weight = system.weight();
        let inner = |a: [f64; 2], b: [f64; 2]| -> f64 {
            (0..2)
                .map(|row| a[row] * (weight[row][0] * b[0] + weight[row][1] * b[1]))
                .sum()
        };
        let columns: [[f64; 2]; 2] = std::array::from_fn(|end| [system.family[0][end], system.family[1][end]]);
        let square = |end: usize| dot(ends[edge][end].family, ends[edge][end].family);
        *parts = [
            square(0) + inner(columns[0], columns[0]),
            inner(columns[0], columns[1]),
            square(1) + inner(columns[1], columns[1]),
        ];
        for end in 0..2 {
            let vertex = network.connectivity.edges[edge][end] as usize;
            let place = pattern.free_index()[vertex] as usize;
            if let Some(value) = rhs.get_mut(place) {
                *value += inner(columns[end], system.rhs) - dot(ends[edge][end].family, ends[edge][end].slope);
            }
        }
    }
    let mut matrix = vec![0.0; pattern.values_len()];
    pattern.assemble(&parts, &mut matrix);
    let mut solver = BlockCholesky::new(pattern);
    solver
        .factorize(&matrix, 0.0)
        .map_err(|error| format!("the slopes of the normals: {error}"))?;
    solver.solve_in_place(&mut rhs);
    for (&vertex, value) in solver.pattern().vertices().iter().zip(rhs) {
        parameters[vertex as usize] = value;
    }
    Ok(parameters)
}
