//! The stages of an evaluation over one chunk of tetrahedra, in vector lanes.
//!
//! Positions are gathered, Jacobians and their invariants formed and, where needed, decomposed; then the energy's own
//! kernel runs over the chunk; then values, forces and Hessian blocks are put together. Only the energy's stage depends
//! on the energy, so the others are compiled once.

use super::BLOCK_NUMBERS;
use super::max_step::smallest_positive_root;
use crate::energy::lim_barrier::LimBarrier;
use crate::energy::spectrum::{Slopes, Spectrum, block, in_frame, stress_by_invariants, stress_by_singular_values};
use crate::energy::{Energy, Variables, invariants, with_sign_of};
use crate::linalg::lanes::{Lanes, Vector, WIDTH, load, store};
use crate::linalg::processor::{Kernel, Processor};
use crate::linalg::svd3::signed_svd;
use crate::linalg::vector3::{Columns, add, apply, cofactor, dot, inner, times};

/// Batches of eight tetrahedra per chunk; their scratch stays in the first-level cache.
pub const CHUNK: usize = 8;

/// Eight tetrahedra at rest.
#[derive(Clone)]
pub struct Batch {
    pub vertices: [[u32; WIDTH]; 4],
    /// Gradients of the hat functions of vertices 1, 2, 3; that of vertex 0 is minus their sum.
    pub gradients: [[Lanes; 3]; 3],
    pub weights: Lanes,
}

/// What is summed: the energy, and a barrier with its weight per tetrahedron.
#[derive(Clone, Copy)]
pub struct Terms<'a> {
    pub processor: Processor,
    pub energy: &'a dyn Energy,
    pub barrier: Option<(f64, LimBarrier)>,
}

type Matrix = [[Lanes; 3]; 3];

/// Everything that is known about one chunk; entry n is batch n.
pub struct Scratch {
    /// Edges from vertex 0, as columns; then `edges * gradients`.
    edges: [Matrix; CHUNK],
    direction_edges: [Matrix; CHUNK],
    jacobians: [Matrix; CHUNK],
    invariants: [[Lanes; 3]; CHUNK],
    singular_values: [[Lanes; 3]; CHUNK],
    u: [Matrix; CHUNK],
    v: [Matrix; CHUNK],
    values: [Lanes; CHUNK],
    slopes: [Slopes<Lanes>; CHUNK],
    spectra: [Spectrum<Lanes>; CHUNK],
    /// Forces at vertices 1, 2, 3.
    forces: [[[Lanes; 3]; 3]; CHUNK],
    /// Row-major blocks (1,1), (1,2), (1,3), (2,2), (2,3), (3,3) of one batch.
    blocks: [[Lanes; 9]; 6],
}

impl Scratch {
    pub fn new() -> Box<Scratch> {
        let zero = Lanes::ZERO;
        let matrix = [[zero; 3]; 3];
        let slopes = Slopes {
            value: zero,
            partials: [zero; 3],
        };
        let spectrum = Spectrum {
            value: zero,
            partials: [zero; 3],
            scaling: [zero; 6],
            flip: [zero; 3],
            twist: [zero; 3],
        };
        Box::new(Scratch {
            edges: [matrix; CHUNK],
            direction_edges: [matrix; CHUNK],
            jacobians: [matrix; CHUNK],
            invariants: [[zero; 3]; CHUNK],
            singular_values: [[zero; 3]; CHUNK],
            u: [matrix; CHUNK],
            v: [matrix; CHUNK],
            values: [zero; CHUNK],
            slopes: [slopes; CHUNK],
            spectra: [spectrum; CHUNK],
            forces: [matrix; CHUNK],
            blocks: [[zero; 9]; 6],
        })
    }

    pub fn values(&mut self, terms: Terms<'_>, batches: &[Batch], positions: &[f64]) {
        let count = batches.len();
        self.decompose(terms, batches, positions, false);
        let variables = match terms.energy.variables() {
            Variables::Invariants => &self.invariants[..count],
            Variables::SingularValues => &self.singular_values[..count],
        };
        terms
            .energy
            .values_in_lanes(terms.processor, variables, &mut self.values[..count]);
        terms.processor.run(WeighValues {
            terms,
            batches,
            scratch: self,
        });
    }

    /// Forces go to `forces`, twelve a tetrahedron.
    pub fn gradients(&mut self, terms: Terms<'_>, batches: &[Batch], positions: &[f64], forces: &mut [f64]) {
        let count = batches.len();
        self.decompose(terms, batches, positions, false);
        let variables = match terms.energy.variables() {
            Variables::Invariants => &self.invariants[..count],
            Variables::SingularValues => &self.singular_values[..count],
        };
        terms
            .energy
            .slopes_in_lanes(terms.processor, variables, &mut self.slopes[..count]);
        terms.processor.run(Forces {
            terms,
            batches,
            scratch: self,
        });
        self.write_forces(forces);
    }

    /// Forces as above; Hessian blocks go to `blocks`, ninety numbers a tetrahedron.
    pub fn hessians(
        &mut self,
        terms: Terms<'_>,
        negative_part: f64,
        batches: &[Batch],
        positions: &[f64],
        forces: &mut [f64],
        blocks: &mut [f64],
    ) {
        let count = batches.len();
        self.decompose(terms, batches, positions, true);
        terms.energy.spectra_in_lanes(
            terms.processor,
            &self.singular_values[..count],
            &self.invariants[..count],
            &mut self.spectra[..count],
        );
        for n in 0..count {
            self.slopes[n] = Slopes {
                value: self.spectra[n].value,
                partials: self.spectra[n].partials,
            };
        }
        terms.processor.run(Forces {
            terms,
            batches,
            scratch: self,
        });
        self.write_forces(forces);
        for (n, (batch, blocks)) in batches.iter().zip(blocks.chunks_mut(BLOCK_NUMBERS * WIDTH)).enumerate() {
            terms.processor.run(Blocks {
                terms,
                negative_part,
                batch,
                n,
                scratch: self,
            });
            self.write_blocks(blocks);
        }
    }

    pub fn determinants(&mut self, processor: Processor, batches: &[Batch], positions: &[f64], out: &mut [f64]) {
        gather_edges(batches, positions, &mut self.edges);
        processor.run(Jacobians { batches, scratch: self });
        for (out, invariants) in out.chunks_mut(WIDTH).zip(&self.invariants) {
            out.copy_from_slice(&invariants[2].0[..out.len()]);
        }
    }

    pub fn singular_values(&mut self, processor: Processor, batches: &[Batch], positions: &[f64], out: &mut [f64]) {
        gather_edges(batches, positions, &mut self.edges);
        processor.run(Jacobians { batches, scratch: self });
        processor.run(Decompositions {
            count: batches.len(),
            scratch: self,
        });
        for (out, s) in out.chunks_mut(3 * WIDTH).zip(&self.singular_values) {
            for (lane, out) in out.chunks_exact_mut(3).enumerate() {
                for i in 0..3 {
                    out[i] = s[i].0[lane];
                }
            }
        }
    }

    /// The smallest positive root of `det(edges + t direction_edges)` over the chunk.
    pub fn max_step(&mut self, processor: Processor, batches: &[Batch], positions: &[f64], direction: &[f64]) -> f64 {
        gather_edges(batches, positions, &mut self.edges);
        gather_edges(batches, direction, &mut self.direction_edges);
        processor.run(Cubics {
            count: batches.len(),
            scratch: self,
        });
        let mut least = f64::INFINITY;
        for cubic in &self.invariants[..batches.len()] {
            for lane in 0..WIDTH {
                least = smallest_positive_root(cubic[0].0[lane], cubic[1].0[lane], cubic[2].0[lane], least);
            }
        }
        least
    }

    /// The sum of the first `count` weighted values, in their order.
    pub fn sum(&self, count: usize) -> f64 {
        self.values
            .iter()
            .flat_map(|lanes| lanes.0)
            .take(count)
            .fold(0.0, |sum, value| sum + value)
    }

    /// Jacobians and invariants, and singular values where the energy or the Hessian needs them.
    fn decompose(&mut self, terms: Terms<'_>, batches: &[Batch], positions: &[f64], hessian: bool) {
        gather_edges(batches, positions, &mut self.edges);
        terms.processor.run(Jacobians { batches, scratch: self });
        if hessian || terms.energy.variables() == Variables::SingularValues {
            terms.processor.run(Decompositions {
                count: batches.len(),
                scratch: self,
            });
        }
    }

    fn write_forces(&self, forces: &mut [f64]) {
        for (forces, lanes) in forces.chunks_mut(12 * WIDTH).zip(&self.forces) {
            for (lane, force) in forces.chunks_exact_mut(12).enumerate() {
                for i in 0..3 {
                    let [f1, f2, f3] = [lanes[0][i].0[lane], lanes[1][i].0[lane], lanes[2][i].0[lane]];
                    force[i] = -(f1 + f2 + f3);
                    force[3 + i] = f1;
                    force[6 + i] = f2;
                    force[9 + i] = f3;
                }
            }
        }
    }

    /// The blocks with vertex 0 are minus the sums of the others, because the hat functions sum to 1.
    fn write_blocks(&self, blocks: &mut [f64]) {
        for (lane, out) in blocks.chunks_exact_mut(BLOCK_NUMBERS).enumerate() {
            for i in 0..3 {
                for j in 0..3 {
                    let at = |pair: usize| self.blocks[pair][3 * i + j].0[lane];
                    let transposed = |pair: usize| self.blocks[pair][3 * j + i].0[lane];
                    let first = -(at(0) + transposed(1) + transposed(2));
                    let second = -(at(1) + at(3) + transposed(4));
                    let third = -(at(2) + at(4) + at(5));
                    // These are the columns' sums: block (0, b) = -sum_a block (a, b).
                    out[9 + 3 * i + j] = first;
                    out[18 + 3 * i + j] = second;
                    out[27 + 3 * i + j] = third;
                    for (pair, place) in [4, 5, 6, 7, 8, 9].into_iter().enumerate() {
                        out[9 * place + 3 * i + j] = at(pair);
                    }
                }
            }
            for i in 0..3 {
                for j in 0..3 {
                    // Block (0, 0) = -sum_b block (0, b)^T: symmetric up to rounding, and then exactly.
                    let sum = |i: usize, j: usize| out[9 + 3 * i + j] + out[18 + 3 * i + j] + out[27 + 3 * i + j];
                    out[3 * i + j] = -0.5 * (sum(i, j) + sum(j, i));
                }
            }
        }
    }
}

/// Edges from vertex 0 of vectors at the vertices.
fn gather_edges(batches: &[Batch], vectors: &[f64], edges: &mut [Matrix; CHUNK]) {
    for (batch, edges) in batches.iter().zip(edges) {
        for lane in 0..WIDTH {
            let at = |a: usize| {
                let start = 3 * batch.vertices[a][lane] as usize;
                [vectors[start], vectors[start + 1], vectors[start + 2]]
            };
            let origin = at(0);
            for a in 0..3 {
                let end = at(a + 1);
                for i in 0..3 {
                    edges[a][i].0[lane] = end[i] - origin[i];
                }
            }
        }
    }
}

#[inline(always)]
fn load_matrix<V: Vector>(matrix: &Matrix) -> Columns<V> {
    [load(&matrix[0]), load(&matrix[1]), load(&matrix[2])]
}

#[inline(always)]
fn store_matrix<V: Vector>(values: Columns<V>, matrix: &mut Matrix) {
    for (values, lanes) in values.into_iter().zip(matrix) {
        store(values, lanes);
    }
}

struct Jacobians<'a> {
    batches: &'a [Batch],
    scratch: &'a mut Scratch,
}

impl Kernel for Jacobians<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (n, batch) in self.batches.iter().enumerate() {
            let edges: Columns<V> = load_matrix(&self.scratch.edges[n]);
            let gradients: Columns<V> = load_matrix(&batch.gradients);
            let mut jacobian = edges;
            for (i, column) in jacobian.iter_mut().enumerate() {
                *column = apply(&edges, [gradients[0][i], gradients[1][i], gradients[2][i]]);
            }
            store(invariants(&jacobian), &mut self.scratch.invariants[n]);
            store_matrix(jacobian, &mut self.scratch.jacobians[n]);
        }
    }
}

struct Decompositions<'a> {
    count: usize,
    scratch: &'a mut Scratch,
}

impl Kernel for Decompositions<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for n in 0..self.count {
            let mut svd = signed_svd::<V>(&load_matrix(&self.scratch.jacobians[n]));
            svd.s[2] = with_sign_of(svd.s[2], V::load(&self.scratch.invariants[n][2]));
            store(svd.s, &mut self.scratch.singular_values[n]);
            store_matrix(svd.u, &mut self.scratch.u[n]);
            store_matrix(svd.v, &mut self.scratch.v[n]);
        }
    }
}

/// The weighted sum of the terms' values, plus infinity outside their domain.
#[inline(always)]
fn weigh<V: Vector>(terms: &Terms<'_>, weight: V, value: V, determinant: V) -> V {
    let mut sum = weight * value;
    if terms.energy.is_barrier() {
        sum = V::select(V::constant(0.0).less(determinant), sum, V::constant(f64::INFINITY));
    }
    if let Some((factor, barrier)) = terms.barrier {
        sum = sum + barrier.evaluate(determinant)[0].scale(factor);
    }
    sum
}

struct WeighValues<'a> {
    terms: Terms<'a>,
    batches: &'a [Batch],
    scratch: &'a mut Scratch,
}

impl Kernel for WeighValues<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (n, batch) in self.batches.iter().enumerate() {
            let determinant = V::load(&self.scratch.invariants[n][2]);
            let value = V::load(&self.scratch.values[n]);
            weigh(&self.terms, V::load(&batch.weights), value, determinant).store(&mut self.scratch.values[n]);
        }
    }
}

struct Forces<'a> {
    terms: Terms<'a>,
    batches: &'a [Batch],
    scratch: &'a mut Scratch,
}

impl Kernel for Forces<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let by_invariants = self.terms.energy.variables() == Variables::Invariants;
        for (n, batch) in self.batches.iter().enumerate() {
            let jacobian: Columns<V> = load_matrix(&self.scratch.jacobians[n]);
            let determinant = V::load(&self.scratch.invariants[n][2]);
            let value = V::load(&self.scratch.slopes[n].value);
            let partials: [V; 3] = load(&self.scratch.slopes[n].partials);
            let weight = V::load(&batch.weights);
            let mut stress = if by_invariants {
                stress_by_invariants(&jacobian, partials)
            } else {
                stress_by_singular_values(
                    &load_matrix(&self.scratch.u[n]),
                    &load_matrix(&self.scratch.v[n]),
                    partials,
                )
            };
            for column in &mut stress {
                *column = times(*column, weight);
            }
            if let Some((factor, barrier)) = self.terms.barrier {
                let slope = barrier.evaluate(determinant)[1].scale(factor);
                let cof = cofactor(&jacobian);
                for (column, cof) in stress.iter_mut().zip(cof) {
                    *column = add(*column, times(cof, slope));
                }
            }
            weigh(&self.terms, weight, value, determinant).store(&mut self.scratch.values[n]);
            for a in 0..3 {
                store(
                    apply(&stress, load(&batch.gradients[a])),
                    &mut self.scratch.forces[n][a],
                );
            }
        }
    }
}

struct Blocks<'a> {
    terms: Terms<'a>,
    negative_part: f64,
    batch: &'a Batch,
    n: usize,
    scratch: &'a mut Scratch,
}

impl Kernel for Blocks<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let n = self.n;
        let mut spectrum = Spectrum::<V>::load(&self.scratch.spectra[n]).weighted(V::load(&self.batch.weights));
        if let Some((factor, barrier)) = self.terms.barrier {
            let s = load(&self.scratch.singular_values[n]);
            let determinant = V::load(&self.scratch.invariants[n][2]);
            spectrum = spectrum.plus(&barrier.spectrum::<V>(s, determinant), factor);
        }
        let spectrum = spectrum.filtered(self.negative_part);
        let pairs = spectrum.pairs();
        let u: Columns<V> = load_matrix(&self.scratch.u[n]);
        let v: Columns<V> = load_matrix(&self.scratch.v[n]);
        let gradients: Columns<V> = load_matrix(&self.batch.gradients);
        let framed = [
            in_frame(&v, gradients[0]),
            in_frame(&v, gradients[1]),
            in_frame(&v, gradients[2]),
        ];
        let places = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for (out, (a, b)) in self.scratch.blocks.iter_mut().zip(places) {
            let columns = block(&u, &spectrum, &pairs, framed[a], framed[b]);
            for i in 0..3 {
                for j in 0..3 {
                    // Diagonal blocks are made symmetric to the last bit.
                    let (row, column) = if a == b { (i.min(j), i.max(j)) } else { (i, j) };
                    columns[column][row].store(&mut out[3 * i + j]);
                }
            }
        }
    }
}

/// The coefficients of `det(edges + t direction_edges)` by t, t^2, t^3, divided by the constant one.
struct Cubics<'a> {
    count: usize,
    scratch: &'a mut Scratch,
}

impl Kernel for Cubics<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for n in 0..self.count {
            let d: Columns<V> = load_matrix(&self.scratch.edges[n]);
            let e: Columns<V> = load_matrix(&self.scratch.direction_edges[n]);
            let (cof_d, cof_e) = (cofactor(&d), cofactor(&e));
            let inverse = V::constant(1.0) / dot(d[0], cof_d[0]);
            let cubic = [
                inner(&e, &cof_d) * inverse,
                inner(&d, &cof_e) * inverse,
                dot(e[0], cof_e[0]) * inverse,
            ];
            store(cubic, &mut self.scratch.invariants[n]);
        }
    }
}
