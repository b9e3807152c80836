//! The energy of a piecewise affine map of a tetrahedral mesh, its derivatives and its largest valid step.
//!
//! `E(u) = sum_t W_t Psi(J_t) + w / m sum_t phi(det J_t)` over m tetrahedra, with a density Psi, given weights W and,
//! where there is one, a barrier phi of weight w. `J_t = sum_a u_a G_a^T` with the gradients G of the four hat functions
//! on the tetrahedron at rest.
//!
//! Eight tetrahedra go side by side in vector lanes; chunks of 64 go to threads. Every sum has a fixed order: the same
//! input gives the same bits with any number of threads and on every processor.

mod kernels;
pub mod max_step;

use super::Energy;
use super::lim_barrier::LimBarrier;
use crate::linalg::lanes::{Lanes, WIDTH};
use crate::linalg::processor::Processor;
use crate::linalg::vector3::{cofactor, dot, subtract};
use crate::mesh::TetrahedralMesh;
use kernels::{Batch, CHUNK, Scratch};
use rayon::prelude::*;
use std::fmt;
use std::sync::{Arc, Mutex};

/// Numbers per tetrahedron in the result of [`MappingEnergy::hessian`]: ten blocks of 3x3.
pub const BLOCK_NUMBERS: usize = 90;
/// The vertices (a, b) of the ten blocks, in order.
pub const BLOCK_PAIRS: [(usize, usize); 10] = [
    (0, 0),
    (0, 1),
    (0, 2),
    (0, 3),
    (1, 1),
    (1, 2),
    (1, 3),
    (2, 2),
    (2, 3),
    (3, 3),
];

/// Tetrahedra per chunk.
const CHUNK_CELLS: usize = CHUNK * WIDTH;
/// Vertices per chunk when forces are gathered.
const CHUNK_VERTICES: usize = 1024;

/// What is summed over the tetrahedra: an energy, and a barrier for those that have none.
#[derive(Clone)]
pub struct Density {
    energy: Held,
    barrier: Option<(f64, LimBarrier)>,
}

#[derive(Clone)]
enum Held {
    Listed(&'static dyn Energy),
    Shared(Arc<dyn Energy>),
}

impl Density {
    /// An energy of the list.
    pub fn new(energy: &'static dyn Energy) -> Density {
        Density {
            energy: Held::Listed(energy),
            barrier: None,
        }
    }

    /// Any other density, such as [`Untangling`](super::untangling::Untangling) with its parameters.
    pub fn of(energy: impl Energy + 'static) -> Density {
        Density {
            energy: Held::Shared(Arc::new(energy)),
            barrier: None,
        }
    }

    /// Adds `weight` times the mean of a barrier over the tetrahedra.
    pub fn with_barrier(mut self, weight: f64, barrier: LimBarrier) -> Density {
        self.barrier = Some((weight, barrier));
        self
    }

    pub fn energy(&self) -> &dyn Energy {
        match &self.energy {
            Held::Listed(energy) => *energy,
            Held::Shared(energy) => energy.as_ref(),
        }
    }

    pub fn barrier(&self) -> Option<(f64, LimBarrier)> {
        self.barrier
    }

    /// Whether the sum is plus infinity as soon as one determinant is not positive.
    pub fn is_barrier(&self) -> bool {
        self.energy().is_barrier() || self.barrier.is_some()
    }
}

impl fmt::Debug for Density {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Density")
            .field("energy", &self.energy().name())
            .field("barrier", &self.barrier)
            .finish()
    }
}

/// Why a mesh at rest, its weights or scales cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub enum InvalidRest {
    /// The mesh has no tetrahedron.
    Empty,
    /// More tetrahedra than 32-bit corner numbers allow.
    TooLarge { cells: usize },
    /// A tetrahedron names a vertex that is not there.
    Vertex { cell: usize, vertex: u32, vertices: usize },
    /// A tetrahedron is flat, reversed or not finite.
    Volume { cell: usize, volume: f64 },
    /// As many weights or scales as tetrahedra are needed.
    Count {
        what: &'static str,
        given: usize,
        needed: usize,
    },
    /// A weight must be finite and not negative, a scale finite and positive.
    Number {
        what: &'static str,
        cell: usize,
        value: f64,
    },
}

impl fmt::Display for InvalidRest {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            InvalidRest::Empty => write!(out, "the mesh has no tetrahedra"),
            InvalidRest::TooLarge { cells } => {
                write!(
                    out,
                    "{cells} tetrahedra are too many: at most {} are supported",
                    u32::MAX / 4
                )
            }
            InvalidRest::Vertex { cell, vertex, vertices } => {
                write!(
                    out,
                    "tetrahedron {cell} names vertex {vertex}, but the mesh has {vertices} vertices"
                )
            }
            InvalidRest::Volume { cell, volume } => write!(
                out,
                "tetrahedron {cell} has volume {volume:e} at rest: all must be positive, remove or reorient it"
            ),
            InvalidRest::Count { what, given, needed } => {
                write!(out, "{given} {what} were given for {needed} tetrahedra")
            }
            InvalidRest::Number { what, cell, value } => {
                write!(out, "{what} of tetrahedron {cell} is {value}, which is not allowed")
            }
        }
    }
}

impl std::error::Error for InvalidRest {}

/// A density summed over a mesh, as a function of its vertices' positions.
///
/// Positions, directions and gradients are flat: x, y, z of vertex 0, then of vertex 1, and so on.
pub struct MappingEnergy {
    vertices: usize,
    cells: usize,
    batches: Vec<Batch>,
    /// Corners `4 cell + corner` around each vertex, in increasing order: those of vertex v are
    /// `corners[offsets[v]..offsets[v + 1]]`.
    offsets: Vec<u32>,
    corners: Vec<u32>,
    density: Density,
    negative_part: f64,
    processor: Processor,
    /// Forces at all corners, kept between calls.
    forces: Mutex<Vec<f64>>,
}

impl MappingEnergy {
    /// For a mesh at rest with positive volumes, a weight W_t per tetrahedron, and, if given, a factor per tetrahedron by
    /// which its shape at rest is enlarged.
    pub fn new(
        rest: &TetrahedralMesh,
        weights: &[f64],
        density: Density,
        rest_scale: Option<&[f64]>,
    ) -> Result<MappingEnergy, InvalidRest> {
        let (vertices, cells) = (rest.points.len(), rest.cells.len());
        if cells == 0 {
            return Err(InvalidRest::Empty);
        }
        if cells > (u32::MAX / 4) as usize {
            return Err(InvalidRest::TooLarge { cells });
        }
        check_numbers("weights", weights, cells, |weight| weight >= 0.0)?;
        if let Some(scales) = rest_scale {
            check_numbers("rest scales", scales, cells, |scale| scale > 0.0)?;
        }
        let mut batches = vec![Batch::default(); cells.div_ceil(WIDTH)];
        let mut offsets = vec![0_u32; vertices + 1];
        for (cell, corners) in rest.cells.iter().enumerate() {
            for &vertex in corners {
                if vertex as usize >= vertices {
                    return Err(InvalidRest::Vertex { cell, vertex, vertices });
                }
                offsets[vertex as usize + 1] += 1;
            }
        }
        // Lanes past the end repeat the last tetrahedron and are left out of every sum.
        for lane in 0..batches.len() * WIDTH {
            let cell = lane.min(cells - 1);
            let corners = rest.cells[cell];
            let [x0, x1, x2, x3] = corners.map(|vertex| rest.points[vertex as usize]);
            let edges = [subtract(x1, x0), subtract(x2, x0), subtract(x3, x0)];
            let cof = cofactor(&edges);
            let determinant = dot(edges[0], cof[0]);
            let scale = rest_scale.map_or(1.0, |scales| scales[cell]);
            let inverse = 1.0 / (determinant * scale);
            if !(determinant > 0.0 && inverse.is_finite()) {
                return Err(InvalidRest::Volume {
                    cell,
                    volume: determinant / 6.0,
                });
            }
            let batch = &mut batches[lane / WIDTH];
            for a in 0..4 {
                batch.vertices[a][lane % WIDTH] = corners[a];
            }
            for a in 0..3 {
                for i in 0..3 {
                    batch.gradients[a][i].0[lane % WIDTH] = cof[a][i] * inverse;
                }
            }
            batch.weights.0[lane % WIDTH] = weights[cell];
        }
        for vertex in 0..vertices {
            offsets[vertex + 1] += offsets[vertex];
        }
        let mut next = offsets.clone();
        let mut corners = vec![0_u32; 4 * cells];
        for (corner, &vertex) in rest.cells.iter().flatten().enumerate() {
            let place = &mut next[vertex as usize];
            corners[*place as usize] = corner as u32;
            *place += 1;
        }
        Ok(MappingEnergy {
            vertices,
            cells,
            batches,
            offsets,
            corners,
            density,
            negative_part: 0.0,
            processor: Processor::detect(),
            forces: Mutex::new(Vec::new()),
        })
    }

    pub fn vertices(&self) -> usize {
        self.vertices
    }

    pub fn cells(&self) -> usize {
        self.cells
    }

    pub fn density(&self) -> &Density {
        &self.density
    }

    /// Exchanges the density, for instance for an untangling with a smaller epsilon.
    pub fn set_density(&mut self, density: Density) {
        self.density = density;
    }

    /// Exchanges the weights W_t.
    pub fn set_weights(&mut self, weights: &[f64]) -> Result<(), InvalidRest> {
        check_numbers("weights", weights, self.cells, |weight| weight >= 0.0)?;
        for lane in 0..self.batches.len() * WIDTH {
            self.batches[lane / WIDTH].weights.0[lane % WIDTH] = weights[lane.min(self.cells - 1)];
        }
        Ok(())
    }

    /// How much of the negative curvature [`MappingEnergy::hessian`] keeps: 0, the start value, projects to a positive
    /// matrix; 1 gives the Hessian itself; -1 takes absolute eigenvalues (Chen et al. 2024).
    pub fn set_negative_part(&mut self, factor: f64) {
        self.negative_part = factor;
    }

    /// The instruction set to use; results do not depend on it.
    pub fn set_processor(&mut self, processor: Processor) {
        self.processor = processor;
    }

    /// The energy, plus infinity outside its domain.
    ///
    /// # Panics
    /// As all methods here, when a slice has not the documented length.
    pub fn value(&self, positions: &[f64]) -> f64 {
        assert_eq!(positions.len(), 3 * self.vertices, "three coordinates a vertex");
        let parts: Vec<f64> = self
            .batches
            .par_chunks(CHUNK)
            .enumerate()
            .map_init(Scratch::new, |scratch, (chunk, batches)| {
                scratch.values(self.terms(), batches, positions);
                self.chunk_sum(scratch, chunk)
            })
            .collect();
        total(&parts)
    }

    /// The energy; its derivative by the positions goes to `gradient`, unspecified where the energy is not finite.
    pub fn gradient(&self, positions: &[f64], gradient: &mut [f64]) -> f64 {
        assert_eq!(positions.len(), 3 * self.vertices, "three coordinates a vertex");
        assert_eq!(gradient.len(), 3 * self.vertices, "three coordinates a vertex");
        let mut forces = self.take_forces();
        let parts: Vec<f64> = self
            .batches
            .par_chunks(CHUNK)
            .zip(forces.par_chunks_mut(12 * CHUNK_CELLS))
            .enumerate()
            .map_init(Scratch::new, |scratch, (chunk, (batches, forces))| {
                scratch.gradients(self.terms(), batches, positions, forces);
                self.chunk_sum(scratch, chunk)
            })
            .collect();
        self.gather(&forces, gradient);
        self.keep_forces(forces);
        total(&parts)
    }

    /// The energy, its derivative, and its second derivative as ten row-major 3x3 blocks a tetrahedron, those of the
    /// vertices [`BLOCK_PAIRS`]: `blocks[90 cell + 9 pair + 3 i + j] = d2E / du_ai du_bj`. The 12x12 matrix of every
    /// tetrahedron is projected to a positive one, see [`MappingEnergy::set_negative_part`]. Unspecified where the
    /// energy is not finite.
    pub fn hessian(&self, positions: &[f64], gradient: &mut [f64], blocks: &mut [f64]) -> f64 {
        assert_eq!(positions.len(), 3 * self.vertices, "three coordinates a vertex");
        assert_eq!(gradient.len(), 3 * self.vertices, "three coordinates a vertex");
        assert_eq!(blocks.len(), BLOCK_NUMBERS * self.cells, "ninety numbers a tetrahedron");
        let mut forces = self.take_forces();
        let parts: Vec<f64> = self
            .batches
            .par_chunks(CHUNK)
            .zip(forces.par_chunks_mut(12 * CHUNK_CELLS))
            .zip(blocks.par_chunks_mut(BLOCK_NUMBERS * CHUNK_CELLS))
            .enumerate()
            .map_init(Scratch::new, |scratch, (chunk, ((batches, forces), blocks))| {
                scratch.hessians(self.terms(), self.negative_part, batches, positions, forces, blocks);
                self.chunk_sum(scratch, chunk)
            })
            .collect();
        self.gather(&forces, gradient);
        self.keep_forces(forces);
        total(&parts)
    }

    /// `det J_t` of every tetrahedron.
    pub fn determinants(&self, positions: &[f64], determinants: &mut [f64]) {
        assert_eq!(positions.len(), 3 * self.vertices, "three coordinates a vertex");
        assert_eq!(determinants.len(), self.cells, "one number a tetrahedron");
        self.batches
            .par_chunks(CHUNK)
            .zip(determinants.par_chunks_mut(CHUNK_CELLS))
            .for_each_init(Scratch::new, |scratch, (batches, determinants)| {
                scratch.determinants(self.processor, batches, positions, determinants)
            });
    }

    /// The signed singular values `s0 >= s1 >= |s2|` of every J_t, three a tetrahedron.
    pub fn singular_values(&self, positions: &[f64], singular_values: &mut [f64]) {
        assert_eq!(positions.len(), 3 * self.vertices, "three coordinates a vertex");
        assert_eq!(singular_values.len(), 3 * self.cells, "three numbers a tetrahedron");
        self.batches
            .par_chunks(CHUNK)
            .zip(singular_values.par_chunks_mut(3 * CHUNK_CELLS))
            .for_each_init(Scratch::new, |scratch, (batches, values)| {
                scratch.singular_values(self.processor, batches, positions, values)
            });
    }

    /// The smallest positive t at which a tetrahedron of `positions + t direction` is flat; infinity if none ever is,
    /// 0 if one is flat already or a coordinate is not finite. Exact up to rounding, so callers stay below it and look
    /// at the value again.
    pub fn max_step(&self, positions: &[f64], direction: &[f64]) -> f64 {
        assert_eq!(positions.len(), 3 * self.vertices, "three coordinates a vertex");
        assert_eq!(direction.len(), 3 * self.vertices, "three coordinates a vertex");
        let parts: Vec<f64> = self
            .batches
            .par_chunks(CHUNK)
            .map_init(Scratch::new, |scratch, batches| {
                scratch.max_step(self.processor, batches, positions, direction)
            })
            .collect();
        parts.into_iter().fold(f64::INFINITY, f64::min)
    }

    fn terms(&self) -> kernels::Terms<'_> {
        let barrier = self
            .density
            .barrier
            .map(|(weight, barrier)| (weight / self.cells as f64, barrier));
        kernels::Terms {
            processor: self.processor,
            energy: self.density.energy(),
            barrier,
        }
    }

    /// The values of one chunk, without the lanes past the end.
    fn chunk_sum(&self, scratch: &Scratch, chunk: usize) -> f64 {
        let count = (self.cells - chunk * CHUNK_CELLS).min(CHUNK_CELLS);
        scratch.sum(count)
    }

    fn take_forces(&self) -> Vec<f64> {
        // A second caller at the same time gets an empty buffer and makes its own.
        let mut forces = self
            .forces
            .lock()
            .map(|mut kept| std::mem::take(&mut *kept))
            .unwrap_or_default();
        forces.resize(12 * self.cells, 0.0);
        forces
    }

    fn keep_forces(&self, forces: Vec<f64>) {
        if let Ok(mut kept) = self.forces.lock() {
            *kept = forces;
        }
    }

    /// Sums the forces of the corners at each vertex.
    fn gather(&self, forces: &[f64], gradient: &mut [f64]) {
        gradient
            .par_chunks_mut(3 * CHUNK_VERTICES)
            .enumerate()
            .for_each(|(chunk, gradient)| {
                for (local, sum) in gradient.chunks_exact_mut(3).enumerate() {
                    let vertex = chunk * CHUNK_VERTICES + local;
                    let (start, end) = (self.offsets[vertex] as usize, self.offsets[vertex + 1] as usize);
                    let mut total = [0.0; 3];
                    for &corner in &self.corners[start..end] {
                        let force = &forces[3 * corner as usize..3 * corner as usize + 3];
                        for i in 0..3 {
                            total[i] += force[i];
                        }
                    }
                    sum.copy_from_slice(&total);
                }
            });
    }
}

/// The sum of the chunks' values in their order.
fn total(parts: &[f64]) -> f64 {
    parts.iter().fold(0.0, |sum, part| sum + part)
}

fn check_numbers(
    what: &'static str,
    numbers: &[f64],
    cells: usize,
    allowed: impl Fn(f64) -> bool,
) -> Result<(), InvalidRest> {
    if numbers.len() != cells {
        return Err(InvalidRest::Count {
            what,
            given: numbers.len(),
            needed: cells,
        });
    }
    match numbers
        .iter()
        .position(|&number| !(number.is_finite() && allowed(number)))
    {
        Some(cell) => Err(InvalidRest::Number {
            what,
            cell,
            value: numbers[cell],
        }),
        None => Ok(()),
    }
}

impl Default for Batch {
    fn default() -> Batch {
        Batch {
            vertices: [[0; WIDTH]; 4],
            gradients: [[Lanes::ZERO; 3]; 3],
            weights: Lanes::ZERO,
        }
    }
}
