//! The boundary of a high-order volume as a triangulated lattice of samples that follow the nodes linearly.
//!
//! Every boundary face carries the same lattice of `m` intervals a side; samples on shared edges and corners are one. So
//! the surface is closed, and derivatives by the samples pull back to the nodes by the transposed evaluation.

use super::functions::{Table, line_table, triangle_inside, triangle_table};
use super::space::{Slot, Space, quad_frame};
use crate::mesh::mixed::{MixedMesh, NONE, Topology};
use std::collections::BTreeMap;

/// A boundary face in its own frame.
struct Patch {
    /// Corners in the frame: a quad's `(0,0), (1,0), (1,1), (0,1)`; a triangle's ascending.
    corners: [u32; 4],
    order: usize,
    /// By function: a quad's `(i, j)` at `i n + j` over line functions, a triangle's as tabulated with the last corner
    /// last.
    slots: Vec<Slot>,
    /// Number of every lattice point, and whether this face is the one to place it.
    samples: Vec<u32>,
    owned: Vec<bool>,
    /// The face in the topology.
    face: usize,
}

/// The sampled boundary.
pub struct Boundary {
    patches: Vec<Patch>,
    intervals: usize,
    lines: BTreeMap<usize, Table<1>>,
    triangles_of: BTreeMap<usize, Table<2>>,
    /// Number of samples.
    pub samples: usize,
    /// Triangles over the samples, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The patch of every triangle.
    pub patch_of: Vec<u32>,
    /// Samples at the mesh's vertices: vertex, sample.
    pub corners: Vec<(u32, u32)>,
    /// Polylines of samples along the boundary's edges.
    pub edges: Vec<Vec<u32>>,
}

impl Boundary {
    /// Samples the boundary with `intervals` a side.
    ///
    /// # Panics
    /// Without intervals.
    pub fn new(mesh: &MixedMesh, topology: &Topology, space: &Space, intervals: usize) -> Boundary {
        assert!(intervals > 0, "at least one interval");
        let m = intervals;
        let mut result = Boundary {
            patches: Vec::new(),
            intervals,
            lines: BTreeMap::new(),
            triangles_of: BTreeMap::new(),
            samples: 0,
            triangles: Vec::new(),
            patch_of: Vec::new(),
            corners: Vec::new(),
            edges: Vec::new(),
        };
        let mut corner_samples: BTreeMap<u32, u32> = BTreeMap::new();
        let mut edge_samples: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        debug_assert_eq!(mesh.points.len(), space.vertices);
        let points: Vec<f64> = (0..=m).map(|k| k as f64 / m as f64).collect();
        for (face, boundary) in topology.boundary() {
            let (start, order) = space.face(face);
            let edge = |a: u32, b: u32| {
                let place = topology.edges.binary_search(&[a.min(b), a.max(b)]);
                space.edge(place.expect("the edges of a face are listed"))
            };
            let quad = boundary.corners.len() == 4 && boundary.corners[3] != NONE;
            let mut corners = boundary.corners;
            let n = order + 1;
            let mut slots;
            // Lattice points of the frame: corner, edge or inside, and the triangles over them.
            let mut samples = Vec::new();
            let mut owned = Vec::new();
            let mut count = result.samples as u32;
            let mut corner_sample = |vertex: u32, count: &mut u32| match corner_samples.get(&vertex) {
                Some(&sample) => (sample, false),
                None => {
                    corner_samples.insert(vertex, *count);
                    result.corners.push((vertex, *count));
                    *count += 1;
                    (*count - 1, true)
                }
            };
            // The k-th of the m - 1 samples between two vertices, counted from the first.
            let mut edge_sample = |a: u32, b: u32, k: usize, count: &mut u32| {
                let key = [a.min(b), a.max(b)];
                let place = if a < b { k - 1 } else { m - 1 - k } as u32;
                match edge_samples.get(&key) {
                    Some(&first) => (first + place, false),
                    None => {
                        edge_samples.insert(key, *count);
                        *count += (m - 1) as u32;
                        (*count - (m - 1) as u32 + place, true)
                    }
                }
            };
            // Edges first met here are owned here, all their samples.
            let mut new_edges = std::collections::BTreeSet::new();
            if quad {
                corners = quad_frame(boundary.corners);
                let [a, b, c, d] = corners;
                slots = vec![Slot::ABSENT; n * n];
                for (vertex, i, j) in [(a, 0, 0), (b, 1, 0), (c, 1, 1), (d, 0, 1)] {
                    slots[i * n + j] = Slot::of(vertex as usize, false);
                }
                // Edges with the fixed index of the other direction.
                for (from, to, along_first, other) in
                    [(a, b, true, 0), (d, c, true, 1), (a, d, false, 0), (b, c, false, 1)]
                {
                    let (first, edge_order) = edge(from, to);
                    for j in 1..edge_order {
                        let place = if along_first {
                            (1 + j) * n + other
                        } else {
                            other * n + 1 + j
                        };
                        slots[place] = Slot::of(first + j - 1, from > to && j % 2 == 0);
                    }
                }
                for j in 1..order {
                    for k in 1..order {
                        slots[(1 + j) * n + 1 + k] = Slot::of(start + (j - 1) * (order - 1) + k - 1, false);
                    }
                }
                for i in 0..=m {
                    for j in 0..=m {
                        let side = |k: usize| if k == 0 { 0 } else { usize::from(k == m) + 1 };
                        let mut on_edge = |from: u32, to: u32, k: usize| {
                            let (sample, new) = edge_sample(from, to, k, &mut count);
                            let key = [from.min(to), from.max(to)];
                            if new {
                                new_edges.insert(key);
                            }
                            (sample, new_edges.contains(&key))
                        };
                        let (sample, own) = match (side(i), side(j)) {
                            (0, 0) => corner_sample(a, &mut count),
                            (2, 0) => corner_sample(b, &mut count),
                            (2, 2) => corner_sample(c, &mut count),
                            (0, 2) => corner_sample(d, &mut count),
                            (1, 0) => on_edge(a, b, i),
                            (1, 2) => on_edge(d, c, i),
                            (0, 1) => on_edge(a, d, j),
                            (2, 1) => on_edge(b, c, j),
                            _ => {
                                count += 1;
                                (count - 1, true)
                            }
                        };
                        samples.push(sample);
                        owned.push(own);
                    }
                }
                let same = cyclic(boundary.corners(), &corners);
                for i in 0..m {
                    for j in 0..m {
                        let at = |i: usize, j: usize| samples[i * (m + 1) + j];
                        let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                        // Alternate diagonals favour no direction.
                        let pair = if (i + j) % 2 == 0 {
                            [[p, q, r], [p, r, s]]
                        } else {
                            [[p, q, s], [q, r, s]]
                        };
                        for [x, y, z] in pair {
                            result.triangles.push(if same { [x, y, z] } else { [x, z, y] });
                            result.patch_of.push(result.patches.len() as u32);
                        }
                    }
                }
                result
                    .lines
                    .entry(order)
                    .or_insert_with(|| line_table(space.basis, order, &points));
            } else {
                let mut sorted = [corners[0], corners[1], corners[2]];
                sorted.sort_unstable();
                corners = [sorted[0], sorted[1], sorted[2], NONE];
                let [a, b, c] = sorted;
                slots = sorted.iter().map(|&vertex| Slot::of(vertex as usize, false)).collect();
                // The edges of the table are 01, 12, 20; the last runs from the larger to the smaller.
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    let (first, edge_order) = edge(from, to);
                    for j in 1..order {
                        slots.push(if j < edge_order {
                            Slot::of(first + j - 1, from > to && j % 2 == 0)
                        } else {
                            Slot::ABSENT
                        });
                    }
                }
                for number in 0..triangle_inside(order).len() {
                    slots.push(Slot::of(start + number, false));
                }
                let mut lattice = Vec::new();
                let mut numbers = BTreeMap::new();
                for i in 0..=m {
                    for j in 0..=m - i {
                        let k = m - i - j;
                        lattice.push([i as f64 / m as f64, j as f64 / m as f64]);
                        let mut on_edge = |from: u32, to: u32, k: usize| {
                            let (sample, new) = edge_sample(from, to, k, &mut count);
                            let key = [from.min(to), from.max(to)];
                            if new {
                                new_edges.insert(key);
                            }
                            (sample, new_edges.contains(&key))
                        };
                        let (sample, own) = if k == m {
                            corner_sample(a, &mut count)
                        } else if i == m {
                            corner_sample(b, &mut count)
                        } else if j == m {
                            corner_sample(c, &mut count)
                        } else if j == 0 {
                            on_edge(a, b, i)
                        } else if i == 0 {
                            on_edge(a, c, j)
                        } else if k == 0 {
                            on_edge(b, c, j)
                        } else {
                            count += 1;
                            (count - 1, true)
                        };
                        numbers.insert((i, j), sample);
                        samples.push(sample);
                        owned.push(own);
                    }
                }
                let same = cyclic(boundary.corners(), &sorted);
                let mut push = |[x, y, z]: [u32; 3]| {
                    result.triangles.push(if same { [x, y, z] } else { [x, z, y] });
                    result.patch_of.push(result.patches.len() as u32);
                };
                for i in 0..m {
                    for j in 0..m - i {
                        push([numbers[&(i, j)], numbers[&(i + 1, j)], numbers[&(i, j + 1)]]);
                        if i + j + 2 <= m {
                            push([numbers[&(i + 1, j)], numbers[&(i + 1, j + 1)], numbers[&(i, j + 1)]]);
                        }
                    }
                }
                result
                    .triangles_of
                    .entry(order)
                    .or_insert_with(|| triangle_table(space.basis, order, 2, &lattice));
            }
            result.samples = count as usize;
            result.patches.push(Patch {
                corners,
                order,
                slots,
                samples,
                owned,
                face,
            });
        }
        for (&[a, b], &first) in &edge_samples {
            let mut line = vec![corner_samples[&a]];
            line.extend((0..m - 1).map(|k| first + k as u32));
            line.push(corner_samples[&b]);
            result.edges.push(line);
        }
        if m == 1 {
            // Without samples between them, edges are the pairs of corners.
            result.edges = edge_samples
                .keys()
                .map(|[a, b]| vec![corner_samples[a], corner_samples[b]])
                .collect();
        }
        result
    }

    /// Intervals between samples along an edge.
    pub fn intervals(&self) -> usize {
        self.intervals
    }

    /// Number of boundary faces.
    pub fn patches(&self) -> usize {
        self.patches.len()
    }

    /// The topology's face behind a patch.
    pub fn face(&self, patch: usize) -> usize {
        self.patches[patch].face
    }

    /// The corners of a patch, the fourth [`NONE`] for a triangle.
    pub fn corners_of(&self, patch: usize) -> [u32; 4] {
        self.patches[patch].corners
    }

    /// Places of the samples.
    pub fn positions(&self, x: &[f64], positions: &mut Vec<[f64; 3]>) {
        positions.clear();
        positions.resize(self.samples, [0.0; 3]);
        let mut rows = Vec::new();
        for patch in &self.patches {
            let coefficients: Vec<[f64; 3]> = patch.slots.iter().map(|slot| value(*slot, x)).collect();
            self.each_sample(patch, &mut rows, &mut |sample, weights| {
                let mut sum = [0.0; 3];
                for (&weight, coefficient) in weights.iter().zip(&coefficients) {
                    for axis in 0..3 {
                        sum[axis] += weight * coefficient[axis];
                    }
                }
                positions[sample] = sum;
            });
        }
    }

    /// Adds to `gradient` the derivative by the nodes of what has these derivatives by the samples.
    pub fn add_gradient(&self, by_samples: &[[f64; 3]], gradient: &mut [f64]) {
        let mut rows = Vec::new();
        for patch in &self.patches {
            let mut sums = vec![[0.0; 3]; patch.slots.len()];
            self.each_sample(patch, &mut rows, &mut |sample, weights| {
                let force = by_samples[sample];
                for (&weight, sum) in weights.iter().zip(sums.iter_mut()) {
                    for axis in 0..3 {
                        sum[axis] += weight * force[axis];
                    }
                }
            });
            for (slot, sum) in patch.slots.iter().zip(sums) {
                if let Some((node, sign)) = slot.node() {
                    for axis in 0..3 {
                        gradient[3 * node + axis] += sign * sum[axis];
                    }
                }
            }
        }
    }

    /// Calls `visit(nodes and signs, weights, sample)` for every sample, each once.
    pub fn each_row(&self, mut visit: impl FnMut(&[Slot], &[f64], usize)) {
        let mut rows = Vec::new();
        for patch in &self.patches {
            self.each_sample(patch, &mut rows, &mut |sample, weights| {
                visit(&patch.slots, weights, sample)
            });
        }
    }

    fn each_sample(&self, patch: &Patch, row: &mut Vec<f64>, visit: &mut dyn FnMut(usize, &[f64])) {
        let n = patch.order + 1;
        if patch.corners[3] == NONE {
            let table = &self.triangles_of[&patch.order];
            for (point, (&sample, &own)) in patch.samples.iter().zip(&patch.owned).enumerate() {
                if own {
                    visit(
                        sample as usize,
                        &table.values[point * table.functions..(point + 1) * table.functions],
                    );
                }
            }
            return;
        }
        let table = &self.lines[&patch.order];
        let side = self.intervals + 1;
        row.resize(n * n, 0.0);
        for i in 0..side {
            for j in 0..side {
                let place = i * side + j;
                if !patch.owned[place] {
                    continue;
                }
                for k in 0..n {
                    let first = table.values[i * n + k];
                    for l in 0..n {
                        row[k * n + l] = first * table.values[j * n + l];
                    }
                }
                visit(patch.samples[place] as usize, &row[..n * n]);
            }
        }
    }
}

fn value(slot: Slot, x: &[f64]) -> [f64; 3] {
    match slot.node() {
        Some((node, sign)) => std::array::from_fn(|axis| sign * x[3 * node + axis]),
        None => [0.0; 3],
    }
}

/// Whether two lists of the same corners run in the same sense.
fn cyclic(first: &[u32], second: &[u32]) -> bool {
    let count = first.len();
    let start = second.iter().position(|&corner| corner == first[0]).unwrap_or(0);
    (0..count).all(|step| first[step] == second[(start + step) % count])
}
