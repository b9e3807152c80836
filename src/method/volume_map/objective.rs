//! The energy of a map as a function of the coordinates of its free vertices, with optional springs to the targets.
//!
//! With hard constraints the free vertices are those inside; with soft ones all are free and the boundary is pulled:
//! `E(u) + w sum |u_b - p_b|^2`. One analysis of the sparsity serves every Hessian.

use super::settings::Hessian;
use crate::energy::mapping::{Density, MappingEnergy};
use crate::linalg::sparse::{BlockCholesky, BlockPattern, NotPositive};
use crate::mesh::TetrahedralMesh;
use crate::method::Failure;
use crate::optimize::{NewtonObjective, NoDirection, Objective, norm};
use std::cell::Cell;
use std::rc::Rc;

/// Share of the negative curvature below which none is kept.
const LEAST_KEPT: f64 = 1.0 / 64.0;

/// Springs from the boundary vertices to their targets.
#[derive(Clone, Debug, PartialEq)]
pub struct Pull {
    pub weight: f64,
    /// A point for every vertex; only those of boundary vertices are read.
    pub targets: Vec<[f64; 3]>,
}

/// What is known of a map beside its energy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// Density and barrier, without the pull.
    pub distortion: f64,
    /// Sum of squared distances of the boundary to its targets.
    pub positional: f64,
    pub weight: f64,
    pub min_determinant: f64,
}

/// See the module.
pub struct MapObjective {
    mapping: MappingEnergy,
    cholesky: BlockCholesky<3>,
    hessian: Hessian,
    /// Share of the negative curvature to be tried next.
    kept: f64,
    /// Coordinates of all vertices: fixed ones for good, free ones of the last point.
    positions: Vec<f64>,
    /// Three numbers a vertex: gradients and directions before they are gathered.
    rows: Vec<f64>,
    determinants: Vec<f64>,
    parts: Vec<f64>,
    matrix: Vec<f64>,
    boundary: Vec<u32>,
    pull: Option<Pull>,
    /// Whether determinants may be negative: then no step is limited.
    folds: bool,
    latest: Rc<Cell<Evaluation>>,
}

impl MapObjective {
    /// The objective over the vertices with `free`, the others standing at `positions`.
    ///
    /// # Errors
    /// When the mesh gives no linear system.
    pub fn new(
        mapping: MappingEnergy,
        source: &TetrahedralMesh,
        free: &[bool],
        boundary: &[u32],
        positions: &[[f64; 3]],
        hessian: Hessian,
    ) -> Result<MapObjective, Failure> {
        let pattern = BlockPattern::new(&source.points, &source.cells, free)
            .map_err(|error| Failure::invalid(format!("the source mesh gives no linear system: {error}")))?;
        let parts = vec![0.0; pattern.parts_len()];
        let matrix = vec![0.0; pattern.values_len()];
        let folds = !mapping.density().is_barrier();
        let cells = mapping.cells();
        Ok(MapObjective {
            mapping,
            cholesky: BlockCholesky::new(pattern),
            hessian,
            kept: 1.0,
            positions: positions.as_flattened().to_vec(),
            rows: vec![0.0; 3 * positions.len()],
            determinants: vec![0.0; cells],
            parts,
            matrix,
            boundary: boundary.to_vec(),
            pull: None,
            folds,
            latest: Rc::default(),
        })
    }

    /// Replaces the springs.
    pub fn set_pull(&mut self, pull: Option<Pull>) {
        self.pull = pull;
    }

    /// Where the last evaluation with derivatives leaves what it found out.
    pub fn latest(&self) -> Rc<Cell<Evaluation>> {
        self.latest.clone()
    }

    /// The coordinates of the free vertices.
    pub fn unknowns(&self, positions: &[[f64; 3]]) -> Vec<f64> {
        self.cholesky
            .pattern()
            .vertices()
            .iter()
            .flat_map(|&vertex| positions[vertex as usize])
            .collect()
    }

    /// The positions of all vertices.
    pub fn positions(&mut self, x: &[f64]) -> Vec<[f64; 3]> {
        self.place(x);
        self.positions.as_chunks().0.to_vec()
    }

    /// The determinants of all tetrahedra.
    pub fn determinants(&mut self, x: &[f64]) -> &[f64] {
        self.place(x);
        self.mapping.determinants(&self.positions, &mut self.determinants);
        &self.determinants
    }

    /// Exchanges the density, for instance for an untangling with less regularization.
    pub fn set_density(&mut self, density: Density) {
        self.folds = !density.is_barrier();
        self.mapping.set_density(density);
    }

    /// Sum of squared distances of the boundary to its targets; 0 without springs.
    pub fn positional(&mut self, x: &[f64]) -> f64 {
        self.place(x);
        self.squared_distances()
    }

    /// Everything that a trace tells of a point.
    pub fn describe(&mut self, x: &[f64]) -> Evaluation {
        self.place(x);
        let distortion = self.mapping.value(&self.positions);
        self.evaluation(distortion)
    }

    /// Evaluates at `x` with gradient and Hessian, negative eigenvalues of each cell's Hessian multiplied by `negative`:
    /// 0 projects them away, 1 leaves the Hessian as it is. Returns the value.
    pub fn assemble(&mut self, x: &[f64], gradient: &mut [f64], negative: f64) -> f64 {
        self.place(x);
        self.mapping.set_negative_part(negative);
        let distortion = self.mapping.hessian(&self.positions, &mut self.rows, &mut self.parts);
        self.cholesky.pattern().assemble(&self.parts, &mut self.matrix);
        if let Some(pull) = &self.pull {
            for &vertex in &self.boundary {
                let free = self.cholesky.pattern().free_index()[vertex as usize] as usize;
                self.cholesky
                    .pattern()
                    .add_to_diagonal(&mut self.matrix, free, 2.0 * pull.weight);
            }
        }
        self.finish_gradient(distortion, gradient)
    }

    /// Mean of the assembled Hessian's diagonal over the vertices that are not pulled.
    pub fn mean_diagonal(&self) -> f64 {
        let pattern = self.cholesky.pattern();
        let mut diagonal = pattern.diagonal(&self.matrix);
        if let Some(pull) = &self.pull {
            for &vertex in &self.boundary {
                let free = pattern.free_index()[vertex as usize] as usize;
                for entry in &mut diagonal[3 * free..3 * free + 3] {
                    *entry -= 2.0 * pull.weight;
                }
            }
        }
        diagonal.iter().map(|entry| entry.abs()).sum::<f64>() / diagonal.len().max(1) as f64
    }

    /// Norm of a gradient in which the slopes at pulled vertices are divided by the weight, where that exceeds 1: what
    /// convergence is judged by, since the springs' slopes are large while their displacements are small.
    pub fn balanced_norm(&self, gradient: &[f64]) -> f64 {
        let total: f64 = gradient.iter().map(|slope| slope * slope).sum();
        let Some(pull) = self.pull.as_ref().filter(|pull| pull.weight > 1.0) else {
            return total.sqrt();
        };
        let (mut inside, mut pulled) = (0.0, 0.0);
        let mut next = self.boundary.iter().peekable();
        for (&vertex, slopes) in self.cholesky.pattern().vertices().iter().zip(gradient.chunks_exact(3)) {
            let square: f64 = slopes.iter().map(|slope| slope * slope).sum();
            // Both lists ascend.
            if next.next_if_eq(&&vertex).is_some() {
                pulled += square;
            } else {
                inside += square;
            }
        }
        (inside + pulled / (pull.weight * pull.weight)).sqrt()
    }

    /// Factorizes the assembled Hessian plus `shift` on its diagonal.
    pub fn factorize(&mut self, shift: f64) -> Result<(), NotPositive> {
        self.cholesky.factorize(&self.matrix, shift)
    }

    /// Replaces a right-hand side by the solution with the last factorization.
    pub fn solve(&self, right: &mut [f64]) {
        self.cholesky.solve_in_place(right);
    }

    fn place(&mut self, x: &[f64]) {
        for (&vertex, point) in self.cholesky.pattern().vertices().iter().zip(x.chunks_exact(3)) {
            self.positions[3 * vertex as usize..3 * vertex as usize + 3].copy_from_slice(point);
        }
    }

    fn squared_distances(&self) -> f64 {
        let Some(pull) = &self.pull else { return 0.0 };
        self.boundary
            .iter()
            .map(|&vertex| {
                let there = pull.targets[vertex as usize];
                (0..3)
                    .map(|axis| (self.positions[3 * vertex as usize + axis] - there[axis]).powi(2))
                    .sum::<f64>()
            })
            .sum()
    }

    fn weight(&self) -> f64 {
        self.pull.as_ref().map_or(0.0, |pull| pull.weight)
    }

    fn evaluation(&mut self, distortion: f64) -> Evaluation {
        self.mapping.determinants(&self.positions, &mut self.determinants);
        let min_determinant = self.determinants.iter().copied().fold(f64::INFINITY, f64::min);
        Evaluation {
            distortion,
            positional: self.squared_distances(),
            weight: self.weight(),
            min_determinant,
        }
    }

    /// Adds the springs to the rows of the gradient and gathers those of the free vertices; returns the value.
    fn finish_gradient(&mut self, distortion: f64, gradient: &mut [f64]) -> f64 {
        if let Some(pull) = &self.pull {
            for &vertex in &self.boundary {
                let there = pull.targets[vertex as usize];
                for axis in 0..3 {
                    let index = 3 * vertex as usize + axis;
                    self.rows[index] += 2.0 * pull.weight * (self.positions[index] - there[axis]);
                }
            }
        }
        for (&vertex, gradient) in self
            .cholesky
            .pattern()
            .vertices()
            .iter()
            .zip(gradient.chunks_exact_mut(3))
        {
            gradient.copy_from_slice(&self.rows[3 * vertex as usize..3 * vertex as usize + 3]);
        }
        let evaluation = self.evaluation(distortion);
        self.latest.set(evaluation);
        distortion + evaluation.weight * evaluation.positional
    }
}

impl Objective for MapObjective {
    fn dimension(&self) -> usize {
        self.cholesky.pattern().dimension()
    }

    fn value(&mut self, x: &[f64]) -> f64 {
        self.place(x);
        self.mapping.value(&self.positions) + self.weight() * self.squared_distances()
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        self.place(x);
        let distortion = self.mapping.gradient(&self.positions, &mut self.rows);
        self.finish_gradient(distortion, gradient)
    }

    fn max_step(&mut self, x: &[f64], direction: &[f64]) -> f64 {
        if self.folds {
            return f64::INFINITY;
        }
        self.place(x);
        self.rows.fill(0.0);
        for (&vertex, direction) in self.cholesky.pattern().vertices().iter().zip(direction.chunks_exact(3)) {
            self.rows[3 * vertex as usize..3 * vertex as usize + 3].copy_from_slice(direction);
        }
        self.mapping.max_step(&self.positions, &self.rows)
    }
}

impl NewtonObjective for MapObjective {
    fn newton_direction(&mut self, x: &[f64], gradient: &mut [f64], direction: &mut [f64]) -> Result<f64, NoDirection> {
        let mut kept = if self.hessian == Hessian::OnDemand {
            self.kept
        } else {
            0.0
        };
        let mut first = true;
        let value = loop {
            let value = self.assemble(x, gradient, kept);
            if !value.is_finite() || gradient.iter().any(|slope| !slope.is_finite()) {
                return Err(NoDirection::NotFinite);
            }
            if kept == 0.0 || self.factorize(0.0).is_ok() {
                break value;
            }
            kept = if kept > LEAST_KEPT { 0.25 * kept } else { 0.0 };
            first = false;
        };
        if kept == 0.0 {
            // Projection may leave a vertex without any stiffness; a shift far below the others' is enough. Where it
            // leaves nothing at all, the gradient sets the scale, and the direction is that of steepest descent.
            let scale = self.mean_diagonal().max(norm(gradient));
            let mut shift = 0.0;
            while let Err(error) = self.factorize(shift) {
                shift = if shift == 0.0 { 1e-12 * scale } else { 100.0 * shift };
                if !(shift > 0.0 && shift <= scale) {
                    return Err(error.into());
                }
            }
        }
        self.kept = if first {
            (4.0 * kept).clamp(LEAST_KEPT, 1.0)
        } else {
            kept
        };
        for (direction, slope) in direction.iter_mut().zip(&*gradient) {
            *direction = -slope;
        }
        self.solve(direction);
        Ok(value)
    }

    fn factorizations(&self) -> u64 {
        self.cholesky.factorizations()
    }
}
