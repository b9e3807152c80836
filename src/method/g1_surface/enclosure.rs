//! The enclosure condition at vertices with an even number of quads, and the tangents that meet it.
//!
//! Let curves leave a vertex with slopes `t_i` and normal curvatures `k_i`, and let a patch lie between `t_i` and
//! `t_{i+1}` at the angle `a_i`. A surface of class C2 within every patch and with a common normal along the curves
//! exists only if `sum_i (-1)^i (k_i - k_{i+1}) cot a_i = 0` when the number of patches is even: the twists of the
//! patches form a cyclic system with alternating null vector. Natural cubics violate it at ordinary vertices of
//! valence 4.
//!
//! [`enclose`] finds tangents in the tangent planes, near the given ones, that meet all these conditions: Newton's
//! method on all of them at once, each step the shortest one (`J^T (J J^T)^-1 g`), with a sparse Cholesky
//! factorization.
//!
//! Guaranteed: tangents stay in the tangent planes; the residual never grows. Not guaranteed: that a solution exists near
//! the start; the residual tells.

use super::continuity::larger;
use super::network::{Network, Spoke, in_plane};
use crate::linalg::sparse::{BlockCholesky, BlockPattern};
use crate::linalg::vector3::{add, cross, dot, subtract, times};
use crate::mesh::length;
use crate::optimize::{Iterate, Observer};

/// What [`enclose`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Enclosed {
    pub iterations: u64,
    pub factorizations: u64,
    /// Largest violation before and after, each multiplied by the mean length of the tangents at its vertex.
    pub before: f64,
    pub residual: f64,
    /// Longest change of a tangent, relative to its length before.
    pub largest_change: f64,
}

/// The violation of the condition at a vertex with these curves and this normal.
pub fn violation(spokes: &[Spoke], normal: [f64; 3]) -> f64 {
    let count = spokes.len();
    let mut sum = 0.0;
    for i in 0..count {
        let (a, b) = (&spokes[i], &spokes[(i + 1) % count]);
        let cotangent = dot(a.tangent, b.tangent) / dot(normal, cross(a.tangent, b.tangent));
        let term = (a.curvature() - b.curvature()) * cotangent;
        sum += if i % 2 == 0 { term } else { -term };
    }
    sum
}

/// The mean length of the tangents at a vertex: it makes the violation a pure number.
fn size(spokes: &[Spoke]) -> f64 {
    spokes.iter().map(|spoke| length(spoke.tangent)).sum::<f64>() / spokes.len() as f64
}

/// The scaled violations of all even vertices; zero elsewhere.
pub fn violations(network: &Network) -> Vec<f64> {
    let mut spokes = Vec::new();
    (0..network.points.len())
        .map(|vertex| {
            if !network.is_even(vertex) {
                return 0.0;
            }
            network.spokes(vertex, &mut spokes);
            size(&spokes) * violation(&spokes, network.normals[vertex])
        })
        .collect()
}

/// Derivatives of the conditions at both ends of every edge with respect to its two tangents:
/// `gradients[edge][end][which]`, projected into the tangent planes.
fn gradients(network: &Network) -> Vec<[[[f64; 3]; 2]; 2]> {
    let mut all = vec![[[[0.0; 3]; 2]; 2]; network.tangents.len()];
    let mut spokes = Vec::new();
    let mut near = Vec::new();
    let mut by_curvature = Vec::new();
    for vertex in 0..network.points.len() {
        if !network.is_even(vertex) {
            continue;
        }
        network.spokes(vertex, &mut spokes);
        let normal = network.normals[vertex];
        let count = spokes.len();
        let scale = size(&spokes);
        near.clear();
        near.resize(count, [0.0; 3]);
        by_curvature.clear();
        by_curvature.resize(count, 0.0);
        for i in 0..count {
            let j = (i + 1) % count;
            let (a, b) = (&spokes[i], &spokes[j]);
            let sign = if i % 2 == 0 { scale } else { -scale };
            let (along, area) = (dot(a.tangent, b.tangent), dot(normal, cross(a.tangent, b.tangent)));
            let cotangent = along / area;
            by_curvature[i] += sign * cotangent;
            by_curvature[j] -= sign * cotangent;
            let weight = sign * (a.curvature() - b.curvature()) / area;
            let by_first = subtract(b.tangent, times(cross(b.tangent, normal), cotangent));
            let by_second = subtract(a.tangent, times(cross(normal, a.tangent), cotangent));
            near[i] = add(near[i], times(by_first, weight));
            near[j] = add(near[j], times(by_second, weight));
        }
        for (i, spoke) in spokes.iter().enumerate() {
            let square = dot(spoke.tangent, spoke.tangent);
            let weight = by_curvature[i] / square;
            let own = subtract(near[i], times(spoke.tangent, 2.0 * weight * spoke.curvature()));
            let far = times(normal, 2.0 * weight);
            // The tangents of an edge point from its first to its second vertex.
            let sign = if spoke.end == 0 { 1.0 } else { -1.0 };
            let other = network.connectivity.other_end(spoke.edge, vertex as u32) as usize;
            let place = &mut all[spoke.edge as usize][spoke.end];
            place[spoke.end] = times(in_plane(own, normal), sign);
            place[1 - spoke.end] = times(in_plane(far, network.normals[other]), -sign);
        }
    }
    all
}

/// Residuals below this are rounding.
const ROUNDING: f64 = 2e-15;
const MOST_ITERATIONS: u64 = 40;

/// Moves the tangents until the condition holds at every even vertex.
///
/// # Errors
/// When the mesh is too large for the sparse factorization.
pub fn enclose(network: &mut Network, observer: &mut dyn Observer) -> Result<Enclosed, String> {
    let free: Vec<bool> = (0..network.points.len())
        .map(|vertex| network.is_even(vertex))
        .collect();
    let mut done = Enclosed::default();
    let mut values = violations(network);
    let worst = |values: &[f64]| values.iter().fold(0.0f64, |worst, value| larger(worst, value.abs()));
    let norm = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
    done.before = worst(&values);
    done.residual = done.before;
    if !free.contains(&true) || done.residual <= ROUNDING {
        return Ok(done);
    }
    let pattern = BlockPattern::<1>::new(&network.points, &network.connectivity.edges, &free)
        .map_err(|error| error.to_string())?;
    let mut parts = vec![0.0; pattern.parts_len()];
    let mut matrix = vec![0.0; pattern.values_len()];
    let mut rhs = vec![0.0; pattern.dimension()];
    let mut solver = BlockCholesky::new(pattern);
    let start = network.tangents.clone();
    while done.iterations < MOST_ITERATIONS && done.residual > ROUNDING && observer.stop().is_none() {
        let gradients = gradients(network);
        for (parts, [first, second]) in parts.as_chunks_mut::<3>().0.iter_mut().zip(&gradients) {
            let inner = |a: &[[f64; 3]; 2], b: &[[f64; 3]; 2]| dot(a[0], b[0]) + dot(a[1], b[1]);
            *parts = [inner(first, first), inner(first, second), inner(second, second)];
        }
        let pattern = solver.pattern();
        pattern.assemble(&parts, &mut matrix);
        let largest = pattern.diagonal(&matrix).into_iter().fold(0.0, f64::max);
        for (value, &vertex) in rhs.iter_mut().zip(pattern.vertices()) {
            *value = values[vertex as usize];
        }
        let places = pattern.free_index().to_vec();
        // Where curves are symmetric a row vanishes, and so does its residual: a small shift leaves both alone.
        let mut shift = 1e-14 * largest;
        done.factorizations += 1;
        while solver.factorize(&matrix, shift).is_err() {
            shift *= 100.0;
            done.factorizations += 1;
            if !(shift < largest) {
                return Ok(done);
            }
        }
        solver.solve_in_place(&mut rhs);
        let before = network.tangents.clone();
        let size_before = norm(&values);
        let mut step = 1.0;
        let accepted = loop {
            for (edge, tangents) in network.tangents.iter_mut().enumerate() {
                if network.on_crease[edge] {
                    continue;
                }
                for which in 0..2 {
                    let mut change = [0.0; 3];
                    for end in 0..2 {
                        let place = places[network.connectivity.edges[edge][end] as usize];
                        if let Some(&weight) = rhs.get(place as usize) {
                            change = add(change, times(gradients[edge][end][which], weight));
                        }
                    }
                    tangents[which] = subtract(before[edge][which], times(change, step));
                }
            }
            let tried = violations(network);
            if norm(&tried) < size_before && network.keeps_sides(&before) {
                values = tried;
                break true;
            }
            step /= 2.0;
            if step < 1e-6 {
                network.tangents = before;
                break false;
            }
        };
        if !accepted {
            break;
        }
        done.iterations += 1;
        done.residual = worst(&values);
        observer.iterate(&Iterate {
            iteration: done.iterations,
            energy: done.residual,
            gradient_norm: norm(&values),
            step,
        });
        if step == 1.0 && norm(&values) > 0.5 * size_before && done.residual < 1e-12 {
            break;
        }
    }
    for (edge, tangents) in network.tangents.iter_mut().enumerate() {
        for end in 0..2 {
            // Rounding must not tilt a tangent out of its plane.
            if !network.on_crease[edge] {
                let normal = network.normals[network.connectivity.edges[edge][end] as usize];
                tangents[end] = in_plane(tangents[end], normal);
            }
            let change = length(subtract(tangents[end], start[edge][end])) / length(start[edge][end]);
            done.largest_change = done.largest_change.max(change);
        }
    }
    done.residual = worst(&violations(network));
    Ok(done)
}

impl Network {
    /// Whether no corner has turned over and no tangent has lost most of its length since these tangents.
    pub(super) fn keeps_sides(&self, before: &[[[f64; 3]; 2]]) -> bool {
        let turned = |edge: usize| {
            (0..2).any(|end| {
                let (old, new) = (before[edge][end], self.tangents[edge][end]);
                !(dot(old, new) > 0.1 * dot(old, old))
            })
        };
        if (0..self.tangents.len()).any(turned) {
            return false;
        }
        let tangent = |tangents: &[[[f64; 3]; 2]], spoke: &Spoke| {
            let sign = if spoke.end == 0 { 1.0 } else { -1.0 };
            times(tangents[spoke.edge as usize][spoke.end], sign)
        };
        let mut spokes = Vec::new();
        (0..self.points.len()).all(|vertex| {
            self.spokes(vertex, &mut spokes);
            let normal = self.normals[vertex];
            (0..self.connectivity.stars.row(vertex).len()).all(|corner| {
                let (a, b) = (&spokes[corner], &spokes[(corner + 1) % spokes.len()]);
                let area = |tangents: &[[[f64; 3]; 2]]| dot(normal, cross(tangent(tangents, a), tangent(tangents, b)));
                area(before) * area(&self.tangents) > 0.0
            })
        })
    }
}
