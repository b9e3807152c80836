//! The distortion energy of a high-order volume: the mean over the reference cells of a density of the Jacobian.
//!
//! `E(x) = 1/|Omega| sum_cells sum_q w_q |det A| psi(J_q)` with `J = J_h A^-1` (Jin et al. 2013, equations 2, 7 and
//! 8), and its gradient by the nodes. Plus infinity where the density is a barrier and a determinant at a quadrature
//! point is not positive. Positive determinants at all quadrature points do not prove a valid cell; see
//! [`certificate`](super::certificate).
//!
//! Eight cells go side by side in vector lanes; batches go to threads. Sums have a fixed order: the same bits with any
//! number of threads, and on every processor.

use super::batches::{Batch, Batches, Group, load_coefficients};
use super::element::Room;
use crate::energy::mapping::Density;
use crate::energy::spectrum::{Slopes, stress_by_invariants};
use crate::energy::{Energy, Variables, invariants};
use crate::linalg::eigen3::symmetric_eigen;
use crate::linalg::lanes::{Lanes, Vector, WIDTH, load, store};
use crate::linalg::processor::{Kernel, Processor};
use crate::linalg::vector3::{Columns, add, apply, cofactor, dot, times};
use rayon::prelude::*;
use std::sync::Mutex;

/// Points done at a time; their intermediate results stay in the first-level cache.
const CHUNK: usize = 16;

/// What one evaluation tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    pub value: f64,
    /// The least determinant of a Jacobian at a quadrature point.
    pub least_determinant: f64,
}

/// The energy as a function of the nodes, three numbers each.
pub struct VolumeEnergy {
    batches: Batches,
    density: Density,
    processor: Processor,
    /// One over the sum of the reference volumes.
    normalization: f64,
    /// Where the derivatives of a node are found among all coefficients: lane numbers, doubled, plus one for a minus.
    offsets: Vec<usize>,
    places: Vec<u64>,
    list: Vec<(usize, usize)>,
    scratch: Mutex<Vec<Box<Scratch>>>,
    forces: Mutex<Vec<Lanes>>,
}

impl VolumeEnergy {
    /// # Errors
    /// When the energy is no barrier and depends on singular values: its sign across an inversion is not provided for; or
    /// when a second barrier is added to it.
    pub fn new(batches: Batches, density: Density) -> Result<VolumeEnergy, String> {
        let energy = density.energy();
        if density.barrier().is_some() {
            return Err("a barrier beside the energy is not provided for high-order elements".to_string());
        }
        if energy.variables() == Variables::SingularValues && !energy.is_barrier() {
            return Err(format!(
                "the energy {:?} has no barrier against inversion; choose one that has, such as hencky",
                energy.name()
            ));
        }
        let mut offsets = vec![0; batches.nodes + 1];
        let each = |visit: &mut dyn FnMut(usize, u64)| {
            for group in &batches.groups {
                for (number, batch) in group.batches.iter().enumerate() {
                    let start = (group.start + number * group.coefficients()) * WIDTH;
                    for (place, slot) in batch.slots.iter().enumerate() {
                        let (function, lane) = (place / WIDTH, place % WIDTH);
                        if let Some((node, sign)) = slot.node()
                            && lane < batch.filled
                        {
                            let lane = (start + 3 * function * WIDTH + lane) as u64;
                            visit(node, lane << 1 | u64::from(sign < 0.0));
                        }
                    }
                }
            }
        };
        each(&mut |node, _| offsets[node + 1] += 1);
        for node in 0..batches.nodes {
            offsets[node + 1] += offsets[node];
        }
        let mut next = offsets.clone();
        let mut places = vec![0; offsets[batches.nodes]];
        each(&mut |node, place| {
            places[next[node]] = place;
            next[node] += 1;
        });
        let volume: f64 = batches
            .groups
            .iter()
            .map(|group| {
                let canonical: f64 = group.weights.iter().sum();
                let scales = group.batches.iter().flat_map(|batch| &batch.scale.0[..batch.filled]);
                canonical * scales.sum::<f64>()
            })
            .sum();
        Ok(VolumeEnergy {
            list: batches.list(),
            batches,
            density,
            processor: Processor::detect(),
            normalization: 1.0 / volume,
            offsets,
            places,
            scratch: Mutex::new(Vec::new()),
            forces: Mutex::new(Vec::new()),
        })
    }

    /// The instruction set to use; results do not depend on it.
    pub fn set_processor(&mut self, processor: Processor) {
        self.processor = processor;
    }

    pub fn nodes(&self) -> usize {
        self.batches.nodes
    }

    pub fn energy(&self) -> &dyn Energy {
        self.density.energy()
    }

    pub fn batches(&self) -> &Batches {
        &self.batches
    }

    /// Quadrature points of all cells.
    pub fn points(&self) -> usize {
        let groups = self.batches.groups.iter();
        groups
            .map(|group| {
                let cells: usize = group.batches.iter().map(|batch| batch.filled).sum();
                cells * group.element.points()
            })
            .sum()
    }

    /// The cells with a determinant that is not positive at one of their points, ascending.
    pub fn inverted(&self, x: &[f64]) -> Vec<usize> {
        let lists: Vec<Vec<usize>> = self
            .list
            .par_iter()
            .map(|&place| {
                let mut cells = Vec::new();
                self.batches.visit(self.processor, place, x, |cell, _, jacobian| {
                    if !(dot(jacobian[0], cofactor(&jacobian)[0]) > 0.0) && cells.last() != Some(&cell) {
                        cells.push(cell);
                    }
                });
                cells
            })
            .collect();
        let mut cells = lists.concat();
        cells.sort_unstable();
        cells
    }

    /// The energy.
    ///
    /// # Panics
    /// As the other methods, when there are not three numbers a node.
    pub fn value(&self, x: &[f64]) -> Evaluation {
        assert_eq!(x.len(), 3 * self.nodes(), "three numbers a node");
        let parts: Vec<Evaluation> = self
            .list
            .par_iter()
            .map(|&(group, batch)| {
                let group = &self.batches.groups[group];
                self.with_scratch(|scratch| {
                    let mut none = [];
                    self.batch(scratch, group, &group.batches[batch], x, &mut none)
                })
            })
            .collect();
        self.sum(&parts)
    }

    /// The energy; its derivative times `factor` is added to `gradient`, unless the energy is not finite.
    pub fn add_gradient(&self, x: &[f64], factor: f64, gradient: &mut [f64]) -> Evaluation {
        assert_eq!(x.len(), 3 * self.nodes(), "three numbers a node");
        assert_eq!(gradient.len(), 3 * self.nodes(), "three numbers a node");
        let mut forces = std::mem::take(&mut *self.forces.lock().unwrap_or_else(|poison| poison.into_inner()));
        forces.resize(self.batches.coefficients, Lanes::ZERO);
        let mut jobs = Vec::with_capacity(self.list.len());
        let mut rest = forces.as_mut_slice();
        for &(group, batch) in &self.list {
            let (part, after) = rest.split_at_mut(self.batches.groups[group].coefficients());
            jobs.push((group, batch, part));
            rest = after;
        }
        let parts: Vec<Evaluation> = jobs
            .into_par_iter()
            .map(|(group, batch, forces)| {
                let group = &self.batches.groups[group];
                self.with_scratch(|scratch| self.batch(scratch, group, &group.batches[batch], x, forces))
            })
            .collect();
        let evaluation = self.sum(&parts);
        if evaluation.value.is_finite() {
            let scale = factor * self.normalization;
            let flat = |place: u64| {
                let lane = (place >> 1) as usize;
                let sign = if place & 1 == 1 { -1.0 } else { 1.0 };
                std::array::from_fn::<f64, 3, _>(|axis| sign * forces[lane / WIDTH + axis].0[lane % WIDTH])
            };
            gradient
                .par_chunks_mut(3 * 1024)
                .enumerate()
                .for_each(|(chunk, gradient)| {
                    for (local, gradient) in gradient.chunks_exact_mut(3).enumerate() {
                        let node = chunk * 1024 + local;
                        let mut sum = [0.0; 3];
                        for &place in &self.places[self.offsets[node]..self.offsets[node + 1]] {
                            sum = add(sum, flat(place));
                        }
                        for axis in 0..3 {
                            gradient[axis] += scale * sum[axis];
                        }
                    }
                });
        }
        *self.forces.lock().unwrap_or_else(|poison| poison.into_inner()) = forces;
        evaluation
    }

    fn sum(&self, parts: &[Evaluation]) -> Evaluation {
        Evaluation {
            value: self.normalization * parts.iter().map(|part| part.value).sum::<f64>(),
            least_determinant: parts
                .iter()
                .map(|part| part.least_determinant)
                .fold(f64::INFINITY, f64::min),
        }
    }

    fn with_scratch<T>(&self, work: impl FnOnce(&mut Scratch) -> T) -> T {
        let pool = || self.scratch.lock().unwrap_or_else(|poison| poison.into_inner());
        let held = pool().pop();
        let mut scratch = held.unwrap_or_default();
        let result = work(&mut scratch);
        pool().push(scratch);
        result
    }

    /// One batch; forces are wanted unless there is no room for them.
    fn batch(
        &self,
        scratch: &mut Scratch,
        group: &Group,
        batch: &Batch,
        x: &[f64],
        forces: &mut [Lanes],
    ) -> Evaluation {
        let element = &group.element;
        scratch.coefficients.resize(group.coefficients(), Lanes::ZERO);
        load_coefficients(batch, x, &mut scratch.coefficients);
        element.jacobians(
            self.processor,
            &scratch.coefficients,
            &mut scratch.jacobians,
            &mut scratch.rooms,
        );
        let mut sums = [Lanes::ZERO, Lanes([f64::INFINITY; WIDTH])];
        let by_invariants = self.energy().variables() == Variables::Invariants;
        for (chunk, weights) in group.weights.chunks(CHUNK).enumerate() {
            let start = 3 * CHUNK * chunk;
            let count = weights.len();
            let [du, dv, dw] = &mut scratch.jacobians;
            let mut raw = [du, dv, dw].map(|direction| &mut direction[start..start + 3 * count]);
            let points = &mut scratch.points;
            self.processor.run(Unfold {
                raw: &mut raw,
                inverse: &batch.inverse,
                by_invariants,
                points,
                least: &mut sums[1],
            });
            self.energy()
                .slopes_in_lanes(self.processor, &points.variables[..count], &mut points.slopes[..count]);
            self.processor.run(Stresses {
                raw: &mut raw,
                inverse: &batch.inverse,
                scale: &batch.scale,
                weights,
                by_invariants,
                points,
                sum: &mut sums[0],
            });
        }
        if !forces.is_empty() {
            element.gather(self.processor, &scratch.jacobians, forces, &mut scratch.rooms);
        }
        let least_determinant = sums[1].0.iter().copied().fold(f64::INFINITY, f64::min);
        let invalid = self.energy().is_barrier() && !(least_determinant > 0.0);
        Evaluation {
            value: if invalid { f64::INFINITY } else { sums[0].0.iter().sum() },
            least_determinant: if sums[1].0.iter().any(|value| value.is_nan()) {
                f64::NAN
            } else {
                least_determinant
            },
        }
    }
}

#[derive(Default)]
struct Scratch {
    coefficients: Vec<Lanes>,
    jacobians: [Vec<Lanes>; 3],
    rooms: Room,
    points: Points,
}

/// What is known about the points of a chunk.
struct Points {
    variables: [[Lanes; 3]; CHUNK],
    vectors: [[[Lanes; 3]; 3]; CHUNK],
    slopes: [Slopes<Lanes>; CHUNK],
}

impl Default for Points {
    fn default() -> Self {
        let zero = Lanes::ZERO;
        Points {
            variables: [[zero; 3]; CHUNK],
            vectors: [[[zero; 3]; 3]; CHUNK],
            slopes: [Slopes {
                value: zero,
                partials: [zero; 3],
            }; CHUNK],
        }
    }
}

/// Turns derivatives by canonical coordinates into Jacobians, and finds the variables of the energy.
struct Unfold<'a, 'b> {
    raw: &'a mut [&'b mut [Lanes]; 3],
    inverse: &'a [Lanes; 9],
    by_invariants: bool,
    points: &'a mut Points,
    least: &'a mut Lanes,
}

#[inline(always)]
fn vector<V: Vector>(lanes: &[Lanes], point: usize) -> [V; 3] {
    [
        V::load(&lanes[3 * point]),
        V::load(&lanes[3 * point + 1]),
        V::load(&lanes[3 * point + 2]),
    ]
}

#[inline(always)]
fn put<V: Vector>(value: [V; 3], lanes: &mut [Lanes], point: usize) {
    for component in 0..3 {
        value[component].store(&mut lanes[3 * point + component]);
    }
}

impl Kernel for Unfold<'_, '_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let inverse: [V; 9] = load(self.inverse);
        let mut least = V::load(self.least);
        let count = self.raw[0].len() / 3;
        for point in 0..count {
            let raw: Columns<V> = [
                vector(self.raw[0], point),
                vector(self.raw[1], point),
                vector(self.raw[2], point),
            ];
            let mut jacobian = raw;
            for (column, out) in jacobian.iter_mut().enumerate() {
                *out = apply(&raw, [inverse[column], inverse[3 + column], inverse[6 + column]]);
                put(*out, self.raw[column], point);
            }
            let invariants = invariants(&jacobian);
            // A comparison that not-a-number fails keeps it.
            least = V::select(least.less(invariants[2]), least, invariants[2]);
            if self.by_invariants {
                store(invariants, &mut self.points.variables[point]);
            } else {
                let [a, b, c] = jacobian;
                let gram = [dot(a, a), dot(a, b), dot(a, c), dot(b, b), dot(b, c), dot(c, c)];
                let eigen = symmetric_eigen(&gram);
                for k in 0..3 {
                    eigen.values[k].sqrt().store(&mut self.points.variables[point][k]);
                    store(eigen.vectors[k], &mut self.points.vectors[point][k]);
                }
            }
        }
        least.store(self.least);
    }
}

/// Replaces Jacobians by the derivatives of the weighted energy by the canonical coordinates' derivatives.
struct Stresses<'a, 'b> {
    raw: &'a mut [&'b mut [Lanes]; 3],
    inverse: &'a [Lanes; 9],
    scale: &'a Lanes,
    weights: &'a [f64],
    by_invariants: bool,
    points: &'a mut Points,
    sum: &'a mut Lanes,
}

impl Kernel for Stresses<'_, '_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let inverse: [V; 9] = load(self.inverse);
        let scale = V::load(self.scale);
        let mut sum = V::load(self.sum);
        for (point, &weight) in self.weights.iter().enumerate() {
            let weight = V::constant(weight) * scale;
            let jacobian: Columns<V> = [
                vector(self.raw[0], point),
                vector(self.raw[1], point),
                vector(self.raw[2], point),
            ];
            let slopes = Slopes::<V>::load(&self.points.slopes[point]);
            let stress = if self.by_invariants {
                stress_by_invariants(&jacobian, slopes.partials)
            } else {
                // P = J V diag(g'(s) / s) V^T.
                let zero = V::constant(0.0);
                let mut stress = [[zero; 3]; 3];
                for k in 0..3 {
                    let v: [V; 3] = load(&self.points.vectors[point][k]);
                    let s = V::load(&self.points.variables[point][k]);
                    let along = times(apply(&jacobian, v), slopes.partials[k] / s);
                    for column in 0..3 {
                        stress[column] = add(stress[column], times(along, v[column]));
                    }
                }
                stress
            };
            sum = sum + weight * slopes.value;
            for direction in 0..3 {
                let mut row = times(stress[0], inverse[3 * direction] * weight);
                for column in 1..3 {
                    row = add(row, times(stress[column], inverse[3 * direction + column] * weight));
                }
                put(row, self.raw[direction], point);
            }
        }
        sum.store(self.sum);
    }
}
