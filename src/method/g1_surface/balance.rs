//! Tangents and slopes of normals found together, so that neither goes far to spare the other.
//!
//! Unknown are the tangents `t` of all curves in their planes and, at every curve end, the two free numbers of the slope
//! `b = -k t + s n x t + v n` (see [`edge_normals`](super::edge_normals)). Conditions are `s_i + s_j = (k_i - k_j) cot
//! a_ij` at every corner of a quad and `X'.N = 0` at 1/3 and 2/3 of every curve; the enclosure condition is the
//! alternating sum of the first kind around a vertex. Tangents that meet the enclosure condition alone can leave a
//! curve whose two equations for its two `v` are all but singular (every arc that is symmetric and shallow), so that
//! `v` grows without bound and the surface folds. Here the sum of `w |t - t_natural|^2 / |d|^2 + (s |t|)^2 + v^2` is
//! made small under all conditions, with `d` the chord, by Newton's method with steps `y = J^T (J J^T)^-1 (J y - c)`
//! in the scaled unknowns `y`.
//!
//! An edge's unknowns stand in six conditions: four corners and its own two. The latter are eliminated edge by edge,
//! which leaves a sparse positive semidefinite system over the corners.
//!
//! Guaranteed: tangents stay in the tangent planes. Not guaranteed: the least sum of all; that the conditions can be met:
//! the residual tells.

use super::continuity::larger;
use super::edge_normals::Slopes;
use super::hermite;
use super::network::{Network, Spoke, in_plane};
use crate::linalg::sparse::{BlockCholesky, BlockPattern};
use crate::linalg::vector3::{add, cross, dot, subtract, times};
use crate::mesh::connectivity::NONE;
use crate::mesh::length;
use crate::optimize::{Iterate, Observer};
use rayon::prelude::*;

/// What [`balance`] found.
#[derive(Clone, Debug, Default)]
pub struct Balanced {
    pub slopes: Slopes,
    pub iterations: u64,
    pub factorizations: u64,
    /// Largest violation of a condition, as a pure number.
    pub residual: f64,
    /// Longest change of a tangent, relative to its length before.
    pub largest_change: f64,
}

/// Unknowns of an edge: two tangents with three components each, `s` and `v` at both ends.
const UNKNOWNS: usize = 10;

/// The conditions in which the unknowns of one edge stand.
#[derive(Clone, Copy)]
struct Edge {
    /// Corners before and after the edge (counter-clockwise) at its start, then at its end; [`NONE`] on the boundary.
    corners: [u32; 4],
    /// Derivatives of the conditions at these corners and of the edge's own two, by scaled unknowns.
    rows: [[f64; UNKNOWNS]; 6],
    /// The edge's own conditions.
    own: [f64; 2],
}

/// The free numbers of the slopes at both ends of an edge.
#[derive(Clone, Copy, Default)]
struct Free {
    s: [f64; 2],
    v: [f64; 2],
}

struct State<'a> {
    network: &'a mut Network,
    natural: Vec<[[f64; 3]; 2]>,
    free: Vec<Free>,
    /// For every edge: length of the chord, lengths of the natural tangents.
    sizes: Vec<[f64; 3]>,
    /// Square root of the tangents' weight.
    stiffness: f64,
    /// Edges whose unknowns may change.
    active: Vec<bool>,
}

/// Slopes to start from, and the edges whose unknowns may change; the others stay as they are.
pub struct Start<'a> {
    pub slopes: &'a Slopes,
    pub active: Vec<bool>,
    /// Tangents of the natural cubics, from which the changes count.
    pub natural: Vec<[[f64; 3]; 2]>,
}

impl State<'_> {
    /// The slopes of the normals.
    fn slopes(&self) -> Slopes {
        (0..self.free.len()).map(|edge| self.slope(edge)).collect()
    }

    fn slope(&self, edge: usize) -> [[f64; 3]; 2] {
        let ends = self.network.connectivity.edges[edge].map(|vertex| vertex as usize);
        std::array::from_fn(|end| {
            let normal = self.network.normals[ends[end]];
            let tangent = self.network.tangents[edge][end];
            let curvature = self.network.spoke(edge as u32, ends[end]).curvature();
            let across = times(cross(normal, tangent), self.free[edge].s[end]);
            add(
                add(times(tangent, -curvature), across),
                times(normal, self.free[edge].v[end]),
            )
        })
    }

    /// Scaled unknowns of an edge.
    fn unknowns(&self, edge: usize) -> [f64; UNKNOWNS] {
        let [chord, first, second] = self.sizes[edge];
        let mut y = [0.0; UNKNOWNS];
        for end in 0..2 {
            let change = subtract(self.network.tangents[edge][end], self.natural[edge][end]);
            for axis in 0..3 {
                y[3 * end + axis] = self.stiffness * change[axis] / chord;
            }
            y[6 + end] = self.free[edge].s[end] * [first, second][end];
            y[8 + end] = self.free[edge].v[end];
        }
        y
    }

    /// Sets an edge's unknowns from scaled ones.
    fn set(&mut self, edge: usize, y: &[f64; UNKNOWNS]) {
        let [chord, first, second] = self.sizes[edge];
        let ends = self.network.connectivity.edges[edge];
        for end in 0..2 {
            let change = [y[3 * end], y[3 * end + 1], y[3 * end + 2]];
            let normal = self.network.normals[ends[end] as usize];
            if !self.network.on_crease[edge] {
                let moved = add(self.natural[edge][end], times(change, chord / self.stiffness));
                self.network.tangents[edge][end] = in_plane(moved, normal);
            }
            self.free[edge].s[end] = y[6 + end] / [first, second][end];
            self.free[edge].v[end] = y[8 + end];
        }
    }

    /// Factors from scaled to plain unknowns; the tangents of creases do not change.
    fn factors(&self, edge: usize) -> [f64; UNKNOWNS] {
        let [chord, first, second] = self.sizes[edge];
        let t = if self.network.on_crease[edge] {
            0.0
        } else {
            chord / self.stiffness
        };
        [t, t, t, t, t, t, 1.0 / first, 1.0 / second, 1.0, 1.0]
    }

    /// The conditions at all corners, by corner number (`4 quad + corner`), scaled to pure numbers.
    fn corners(&self) -> Vec<f64> {
        let mut values = vec![0.0; 4 * self.network.quads.len()];
        let mut spokes = Vec::new();
        for vertex in 0..self.network.points.len() {
            self.network.spokes(vertex, &mut spokes);
            let normal = self.network.normals[vertex];
            for (index, &corner) in self.network.connectivity.stars.row(vertex).iter().enumerate() {
                let (a, b) = (&spokes[index], &spokes[(index + 1) % spokes.len()]);
                values[corner as usize] = self.scale(a, b) * self.corner(a, b, normal);
            }
        }
        values
    }

    fn s(&self, spoke: &Spoke) -> f64 {
        self.free[spoke.edge as usize].s[spoke.end]
    }

    fn corner(&self, a: &Spoke, b: &Spoke, normal: [f64; 3]) -> f64 {
        let cotangent = dot(a.tangent, b.tangent) / dot(normal, cross(a.tangent, b.tangent));
        self.s(a) + self.s(b) - (a.curvature() - b.curvature()) * cotangent
    }

    /// The length that makes a corner's condition a pure number: it stays the same while tangents change.
    fn scale(&self, a: &Spoke, b: &Spoke) -> f64 {
        0.5 * (self.sizes[a.edge as usize][1 + a.end] + self.sizes[b.edge as usize][1 + b.end])
    }

    /// An edge's own conditions: `X'.N / |d|` at 1/3 and 2/3 over `psi_5` there.
    fn own(&self, edge: usize) -> [f64; 2] {
        let curve = self.network.curve(edge);
        let ends = self.network.connectivity.edges[edge].map(|vertex| vertex as usize);
        let [b1, b2] = self.slope(edge);
        let normals = [self.network.normals[ends[0]], self.network.normals[ends[1]], b1, b2];
        [1.0 / 3.0, 2.0 / 3.0].map(|x| {
            let values = hermite::values(x);
            let slope = hermite::combine(&hermite::slopes(x), &curve);
            dot(slope, hermite::combine(&values, &normals)) / (values[4] * self.sizes[edge][0])
        })
    }

    /// Derivatives of an edge's own conditions by plain unknowns, tangents projected into their planes.
    fn own_rows(&self, edge: usize) -> [[f64; UNKNOWNS]; 2] {
        let curve = self.network.curve(edge);
        let ends = self.network.connectivity.edges[edge].map(|vertex| vertex as usize);
        let n = ends.map(|vertex| self.network.normals[vertex]);
        let t = self.network.tangents[edge];
        let k: [f64; 2] = std::array::from_fn(|end| self.network.spoke(edge as u32, ends[end]).curvature());
        let [b1, b2] = self.slope(edge);
        [1.0 / 3.0, 2.0 / 3.0].map(|x| {
            let (values, slopes) = (hermite::values(x), hermite::slopes(x));
            let slope = hermite::combine(&slopes, &curve);
            let normal = hermite::combine(&values, &[n[0], n[1], b1, b2]);
            let scale = 1.0 / (values[4] * self.sizes[edge][0]);
            let mut row = [0.0; UNKNOWNS];
            for end in 0..2 {
                let other = 1 - end;
                let square = |end: usize| dot(t[end], t[end]);
                let along = |end: usize| dot(t[end], slope) / square(end);
                let mut gradient = times(normal, slopes[2 + end]);
                let weight = values[2 + end];
                gradient = add(gradient, times(slope, -weight * k[end]));
                gradient = add(gradient, times(cross(slope, n[end]), weight * self.free[edge].s[end]));
                gradient = add(gradient, times(t[end], 2.0 * weight * k[end] * along(end)));
                // The curvature at the other end: l1 = (6d - 2 t2).n1, l2 = (-6d + 2 t1).n2.
                let sign = if end == 0 { 2.0 } else { -2.0 };
                gradient = add(gradient, times(n[other], -sign * values[2 + other] * along(other)));
                let gradient = in_plane(gradient, n[end]);
                for axis in 0..3 {
                    row[3 * end + axis] = scale * gradient[axis];
                }
                row[6 + end] = scale * weight * dot(cross(n[end], t[end]), slope);
                row[8 + end] = scale * weight * dot(n[end], slope);
            }
            row
        })
    }

    /// Derivatives of all conditions, edge by edge, by scaled unknowns.
    fn linearize(&self) -> Vec<Edge> {
        let blank = Edge {
            corners: [NONE; 4],
            rows: [[0.0; UNKNOWNS]; 6],
            own: [0.0; 2],
        };
        let mut edges = vec![blank; self.free.len()];
        edges.par_iter_mut().enumerate().for_each(|(index, edge)| {
            if !self.active[index] {
                return;
            }
            edge.own = self.own(index);
            let own = self.own_rows(index);
            edge.rows[4] = own[0];
            edge.rows[5] = own[1];
        });
        let mut spokes = Vec::new();
        for vertex in 0..self.network.points.len() {
            self.network.spokes(vertex, &mut spokes);
            let normal = self.network.normals[vertex];
            for (index, &corner) in self.network.connectivity.stars.row(vertex).iter().enumerate() {
                let (a, b) = (spokes[index], spokes[(index + 1) % spokes.len()]);
                if !self.active[a.edge as usize] && !self.active[b.edge as usize] {
                    continue;
                }
                let scale = self.scale(&a, &b);
                let area = dot(normal, cross(a.tangent, b.tangent));
                let cotangent = dot(a.tangent, b.tangent) / area;
                let difference = (a.curvature() - b.curvature()) / area;
                let by_a = subtract(b.tangent, times(cross(b.tangent, normal), cotangent));
                let by_b = subtract(a.tangent, times(cross(normal, a.tangent), cotangent));
                for (spoke, by, sign, place) in [(a, by_a, -cotangent, 1), (b, by_b, cotangent, 0)] {
                    let square = dot(spoke.tangent, spoke.tangent);
                    let near = add(
                        times(by, -difference),
                        times(spoke.tangent, -2.0 * sign * spoke.curvature() / square),
                    );
                    let far = times(normal, 2.0 * sign / square);
                    let other = self.network.connectivity.other_end(spoke.edge, vertex as u32) as usize;
                    let direction = if spoke.end == 0 { scale } else { -scale };
                    let near = times(in_plane(near, normal), direction);
                    let far = times(in_plane(far, self.network.normals[other]), -direction);
                    if !self.active[spoke.edge as usize] {
                        continue;
                    }
                    let edge = &mut edges[spoke.edge as usize];
                    let slot = 2 * spoke.end + place;
                    edge.corners[slot] = corner;
                    for axis in 0..3 {
                        edge.rows[slot][3 * spoke.end + axis] = near[axis];
                        edge.rows[slot][3 * (1 - spoke.end) + axis] = far[axis];
                    }
                    edge.rows[slot][6 + spoke.end] = scale;
                }
            }
        }
        edges.par_iter_mut().enumerate().for_each(|(index, edge)| {
            let factors = self.factors(index);
            for row in &mut edge.rows {
                for (value, factor) in row.iter_mut().zip(factors) {
                    *value *= factor;
                }
            }
        });
        edges
    }

    /// Root of the sum of the squares of all conditions, and the largest of them.
    fn violation(&self) -> (f64, f64) {
        let corners = self.corners();
        let own: Vec<[f64; 2]> = (0..self.free.len())
            .into_par_iter()
            .map(|edge| self.own(edge))
            .collect();
        let all = || corners.iter().copied().chain(own.iter().flatten().copied());
        let squares: f64 = all().map(|value| value * value).sum();
        (
            squares.sqrt(),
            all().fold(0.0, |worst, value| larger(worst, value.abs())),
        )
    }
}

fn inner(a: &[f64; UNKNOWNS], b: &[f64; UNKNOWNS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The inverse of the block of an edge's own two conditions, with a small shift where the curve is straight; zero for
/// edges that may not change.
fn inverse(edge: &Edge) -> [[f64; 2]; 2] {
    let [p, q, r] = [(4, 4), (4, 5), (5, 5)].map(|(a, b)| inner(&edge.rows[a], &edge.rows[b]));
    if p + r == 0.0 {
        return [[0.0; 2]; 2];
    }
    let shift = 1e-14 * (p + r);
    let (p, r) = (p + shift, r + shift);
    let determinant = p * r - q * q;
    [[r / determinant, -q / determinant], [-q / determinant, p / determinant]]
}

/// Steps that also lower the sum, then steps that only meet the conditions.
const BALANCING: u64 = 6;
const MOST_ITERATIONS: u64 = 30;
/// Violations below this are rounding.
const ROUNDING: f64 = 4e-15;

/// Moves the tangents and finds the slopes of the normals. `stiffness` is the weight `w` of the tangents' changes.
/// Without a start, everything is free and begins with the network's tangents, taken as the natural ones.
///
/// # Errors
/// When the mesh is too large for the sparse factorization, or the system breaks down.
pub fn balance(
    network: &mut Network,
    stiffness: f64,
    start: Option<Start<'_>>,
    observer: &mut dyn Observer,
) -> Result<Balanced, String> {
    let quads = network.quads.len();
    // A place for every corner, near its vertex, and four for the corners that boundary edges lack.
    let mut places = vec![[0.0; 3]; 4 * quads + 4];
    for (index, quad) in network.quads.iter().enumerate() {
        let corners = quad.map(|vertex| network.points[vertex as usize]);
        for corner in 0..4 {
            places[4 * index + corner] = std::array::from_fn(|axis| {
                0.7 * corners[corner][axis] + 0.1 * (0..4).map(|other| corners[other][axis]).sum::<f64>()
                    - 0.1 * corners[corner][axis]
            });
        }
    }
    let count = network.tangents.len();
    let mut numbers = vec![Free::default(); count];
    let (natural, active) = match start {
        None => (network.tangents.clone(), vec![true; count]),
        Some(start) => {
            for (edge, numbers) in numbers.iter_mut().enumerate() {
                for end in 0..2 {
                    let normal = network.normals[network.connectivity.edges[edge][end] as usize];
                    let (slope, tangent) = (start.slopes[edge][end], network.tangents[edge][end]);
                    numbers.s[end] = dot(slope, cross(normal, tangent)) / dot(tangent, tangent);
                    numbers.v[end] = dot(slope, normal);
                }
            }
            (start.natural, start.active)
        }
    };
    let sizes = natural
        .iter()
        .zip(&network.connectivity.edges)
        .map(|(tangents, ends)| {
            let [a, b] = ends.map(|vertex| network.points[vertex as usize]);
            [length(subtract(b, a)), length(tangents[0]), length(tangents[1])]
        })
        .collect();
    let mut state = State {
        free: numbers,
        active,
        natural,
        network,
        sizes,
        stiffness: stiffness.sqrt(),
    };
    let state_active = state.active.clone();
    let mut edges = state.linearize();
    let cells: Vec<[u32; 4]> = edges
        .iter()
        .map(|edge| {
            std::array::from_fn(|slot| {
                if edge.corners[slot] == NONE {
                    (4 * quads + slot) as u32
                } else {
                    edge.corners[slot]
                }
            })
        })
        .collect();
    let mut free = vec![false; places.len()];
    for &corner in edges
        .iter()
        .flat_map(|edge| &edge.corners)
        .filter(|&&corner| corner != NONE)
    {
        free[corner as usize] = true;
    }
    let pattern = BlockPattern::<1>::new(&places, &cells, &free).map_err(|error| error.to_string())?;
    let mut parts = vec![0.0; pattern.parts_len()];
    let mut matrix = vec![0.0; pattern.values_len()];
    let mut solver = BlockCholesky::new(pattern);
    let mut found = Balanced::default();
    let (mut norm, mut worst) = state.violation();
    while found.iterations < MOST_ITERATIONS && observer.stop().is_none() {
        let balancing = found.iterations < BALANCING;
        if !balancing && worst <= ROUNDING {
            break;
        }
        let corners = state.corners();
        parts.par_chunks_mut(10).zip(&edges).for_each(|(parts, edge)| {
            let small = inverse(edge);
            let across: [[f64; 2]; 4] =
                std::array::from_fn(|slot| [4, 5].map(|own| inner(&edge.rows[slot], &edge.rows[own])));
            let mut part = parts.iter_mut();
            for a in 0..4 {
                for b in a..4 {
                    let mut value = inner(&edge.rows[a], &edge.rows[b]);
                    for i in 0..2 {
                        for j in 0..2 {
                            value -= across[a][i] * small[i][j] * across[b][j];
                        }
                    }
                    if let Some(part) = part.next() {
                        *part = value;
                    }
                }
            }
        });
        solver.pattern().assemble(&parts, &mut matrix);
        // J y - c, or -c alone; the edges' own rows are eliminated.
        let place = solver.pattern().free_index().to_vec();
        let mut rhs: Vec<f64> = solver
            .pattern()
            .vertices()
            .iter()
            .map(|&corner| -corners[corner as usize])
            .collect();
        let mut own = vec![[0.0; 2]; edges.len()];
        for (index, edge) in edges.iter().enumerate() {
            let y = if balancing {
                state.unknowns(index)
            } else {
                [0.0; UNKNOWNS]
            };
            own[index] = std::array::from_fn(|row| inner(&edge.rows[4 + row], &y) - edge.own[row]);
            let small = inverse(edge);
            let weights: [f64; 2] =
                std::array::from_fn(|row| small[row][0] * own[index][0] + small[row][1] * own[index][1]);
            for slot in (0..4).filter(|&slot| edge.corners[slot] != NONE) {
                rhs[place[edge.corners[slot] as usize] as usize] += inner(&edge.rows[slot], &y)
                    - inner(&edge.rows[slot], &edge.rows[4]) * weights[0]
                    - inner(&edge.rows[slot], &edge.rows[5]) * weights[1];
            }
        }
        let largest = solver.pattern().diagonal(&matrix).into_iter().fold(0.0, f64::max);
        let mut shift = 1e-14 * largest;
        found.factorizations += 1;
        while let Err(error) = solver.factorize(&matrix, shift) {
            shift *= 100.0;
            found.factorizations += 1;
            if !(shift < largest) {
                return Err(format!("tangents and normals: {error}"));
            }
        }
        solver.solve_in_place(&mut rhs);
        let targets: Vec<[f64; UNKNOWNS]> = edges
            .par_iter()
            .enumerate()
            .map(|(index, edge)| {
                let multipliers: [f64; 4] = std::array::from_fn(|slot| {
                    let place = place.get(edge.corners[slot] as usize);
                    place.and_then(|&place| rhs.get(place as usize)).copied().unwrap_or(0.0)
                });
                let mut rest = own[index];
                for row in 0..2 {
                    for slot in 0..4 {
                        rest[row] -= inner(&edge.rows[4 + row], &edge.rows[slot]) * multipliers[slot];
                    }
                }
                let small = inverse(edge);
                let own = [0, 1].map(|row: usize| small[row][0] * rest[0] + small[row][1] * rest[1]);
                let mut y = if balancing {
                    [0.0; UNKNOWNS]
                } else {
                    state.unknowns(index)
                };
                for unknown in 0..UNKNOWNS {
                    for slot in 0..4 {
                        y[unknown] += multipliers[slot] * edge.rows[slot][unknown];
                    }
                    y[unknown] += own[0] * edge.rows[4][unknown] + own[1] * edge.rows[5][unknown];
                }
                y
            })
            .collect();
        let before: Vec<[f64; UNKNOWNS]> = (0..edges.len()).map(|edge| state.unknowns(edge)).collect();
        let old = state.network.tangents.clone();
        let mut step = 1.0;
        let mut accepted = false;
        let mut ended = false;
        while step > 1e-4 {
            for edge in (0..edges.len()).filter(|&edge| state_active[edge]) {
                let y =
                    std::array::from_fn(|unknown| (1.0 - step) * before[edge][unknown] + step * targets[edge][unknown]);
                state.set(edge, &y);
            }
            let (tried, tried_worst) = state.violation();
            if state.network.keeps_sides(&old) && (balancing || tried < norm) {
                // Near rounding the violation no longer falls by much.
                ended = !balancing && tried_worst < 1e-12 && tried > 0.5 * norm;
                (norm, worst) = (tried, tried_worst);
                accepted = true;
                break;
            }
            step /= 2.0;
        }
        if !accepted {
            for (edge, y) in before.iter().enumerate().filter(|&(edge, _)| state_active[edge]) {
                state.set(edge, y);
            }
            if !balancing {
                break;
            }
        }
        found.iterations += 1;
        observer.iterate(&Iterate {
            iteration: found.iterations,
            energy: worst,
            gradient_norm: norm,
            step,
        });
        if ended {
            break;
        }
        edges = state.linearize();
    }
    found.slopes = state.slopes();
    found.residual = worst;
    for (edge, tangents) in state.network.tangents.iter().enumerate() {
        for end in 0..2 {
            let change = length(subtract(tangents[end], state.natural[edge][end])) / state.sizes[edge][1 + end];
            found.largest_change = found.largest_change.max(change);
        }
    }
    Ok(found)
}
