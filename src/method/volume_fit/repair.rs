//! Mending single elements: those that are invalid somewhere move, and those around them; all others stay.
//!
//! The patch of elements has a volume energy of its own. In place of the surface energy stands its model about the
//! boundary as it was: a parabola, as stiff along the surface as along its normals (see [`super::preconditioner`]).
//! First determinants are turned, then the barrier spaces them out. Not guaranteed: success, and that the mended map is a
//! minimum of the whole energy; it differs from one in the patch alone.

use super::fit::{Fit, interrupted};
use super::objective::Parts;
use super::preconditioner::{self, Model};
use super::untangle;
use super::untangle::{Quiet, Round, Softness, TANGLED, Turned, turn};
use super::validity::Certificates;
use crate::energy::mapping::Density;
use crate::fem::batches::{Batches, reference_volume};
use crate::fem::boundary::Boundary;
use crate::fem::space::{Kind, Space};
use crate::fem::volume_energy::VolumeEnergy;
use crate::linalg::vector3::{Columns, subtract};
use crate::mesh::mixed::{MixedMesh, Topology};
use crate::method::Failure;
use crate::optimize::lbfgs::Lbfgs;
use crate::optimize::{Objective, Observer, Solution, StopReason, Stopping};

/// Iterations at most with one regularization, and with the barrier.
const TURNING: u64 = 60;
const SPACING: u64 = 150;

/// Share of the energy below which its change ends a minimization.
const CHANGE: f64 = 1e-6;

/// Quadrature points a direction that every repair has more than the one before.
const EXTRA: usize = 3;

/// Where mending was in vain the fit is made once more from its start, with so many times the points. Not at once: a fit
/// that slips through a fold and is mended can end nearer the target than one that the barrier stops there.
const AFRESH: usize = 3;

/// Rounds before that.
const PATIENCE: usize = 3;

/// Quadrature points of the whole mesh at most for which that is done: it takes long.
const MOST_POINTS: usize = 1_000_000;

/// A map with fewer failing elements is not taken when its surface energy is so many times higher, and by more than the
/// volume energy weighs. That one itself is of no use here: where elements fail, its points were too few to measure it.
const FARTHER: f64 = 4.0;

/// Elements are mended in their places when at most one in so many fails.
const FEW: usize = 5;

/// Elements that may move, as a mesh of their own.
struct Patch {
    /// Their numbers in the whole mesh, ascending.
    cells: Vec<usize>,
    mesh: MixedMesh,
    topology: Topology,
    space: Space,
    references: Vec<Columns<f64>>,
    x: Vec<f64>,
    /// For every node, the node of the whole space; nothing where that has none.
    nodes: Vec<Option<usize>>,
    /// Whether no element outside has the node.
    free: Vec<bool>,
}

impl Patch {
    /// The elements `seeds` and those that share a vertex with them.
    fn around(fit: &Fit<'_>, seeds: &[usize]) -> Result<Patch, Failure> {
        let volume = &fit.volume;
        let mut touched = vec![false; volume.points.len()];
        for &seed in seeds {
            volume
                .cell(seed)
                .1
                .iter()
                .for_each(|&corner| touched[corner as usize] = true);
        }
        let near = |(_, corners): (_, &[u32])| corners.iter().any(|&corner| touched[corner as usize]);
        let chosen: Vec<bool> = volume.iter().map(near).collect();
        let cells: Vec<usize> = (0..volume.cells()).filter(|&cell| chosen[cell]).collect();
        // Vertices keep their order, and with it the orientation of edges and faces.
        let mut vertices: Vec<u32> = cells.iter().flat_map(|&cell| volume.cell(cell).1.to_vec()).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut mesh = MixedMesh {
            points: vertices.iter().map(|&vertex| volume.points[vertex as usize]).collect(),
            ..MixedMesh::default()
        };
        for &cell in &cells {
            let (shape, corners) = volume.cell(cell);
            let local = corners
                .iter()
                .map(|corner| vertices.partition_point(|vertex| vertex < corner) as u32);
            mesh.push(shape, &local.collect::<Vec<_>>());
        }
        let topology = mesh.topology().map_err(Failure::invalid)?;
        let orders: Vec<usize> = cells.iter().map(|&cell| fit.space.orders[cell]).collect();
        let space = Space::new(&mesh, &topology, fit.settings.basis, &orders).map_err(Failure::invalid)?;
        let mut inside = vec![true; fit.space.nodes];
        for (cell, _) in fit.space.cells.iter().zip(&chosen).filter(|(_, chosen)| !**chosen) {
            for (node, _) in cell.slots.iter().filter_map(|slot| slot.node()) {
                inside[node] = false;
            }
        }
        let mut nodes = vec![None; space.nodes];
        let mut x = vec![0.0; 3 * space.nodes];
        for (own, &cell) in space.cells.iter().zip(&cells) {
            for (slot, whole) in own.slots.iter().zip(&fit.space.cells[cell].slots) {
                if let (Some((node, _)), Some((place, _))) = (slot.node(), whole.node()) {
                    nodes[node] = Some(place);
                    x[3 * node..3 * node + 3].copy_from_slice(&fit.x[3 * place..3 * place + 3]);
                }
            }
        }
        let free = nodes.iter().map(|node| node.is_some_and(|node| inside[node])).collect();
        Ok(Patch {
            references: cells.iter().map(|&cell| fit.references[cell]).collect(),
            cells,
            mesh,
            topology,
            space,
            x,
            nodes,
            free,
        })
    }

    fn volume_energy(&self, fit: &Fit<'_>, density: Density) -> Result<VolumeEnergy, Failure> {
        let quadrature = |kind: Kind| fit.quadrature(kind);
        let batches = Batches::new(&self.space, &self.references, &quadrature).map_err(Failure::invalid)?;
        VolumeEnergy::new(batches, density).map_err(Failure::invalid)
    }
}

/// The patch's volume energy, and the model of the surface energy about the boundary as it was.
struct PatchObjective<'a> {
    volume: &'a VolumeEnergy,
    lambda: f64,
    boundary: &'a Boundary,
    /// Samples of the boundary as it was, and how the energy bends there: 00 01 02 11 12 22.
    anchors: &'a [[f64; 3]],
    blocks: &'a [[f64; 6]],
    /// One over the diagonal of a model of the Hessian; 0 for nodes that stay.
    inverse: &'a [f64],
    samples: Vec<[f64; 3]>,
}

impl Objective for PatchObjective<'_> {
    fn dimension(&self) -> usize {
        3 * self.inverse.len()
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        gradient.fill(0.0);
        let volume = self.volume.add_gradient(x, self.lambda, gradient);
        if !volume.value.is_finite() {
            return f64::INFINITY;
        }
        self.boundary.positions(x, &mut self.samples);
        let mut surface = 0.0;
        for ((sample, anchor), [a, b, c, d, e, f]) in self.samples.iter_mut().zip(self.anchors).zip(self.blocks) {
            let [x, y, z] = subtract(*sample, *anchor);
            let force = [a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z];
            surface += 0.5 * (force[0] * x + force[1] * y + force[2] * z);
            *sample = force;
        }
        self.boundary.add_gradient(&self.samples, gradient);
        for (gradient, &inverse) in gradient.chunks_exact_mut(3).zip(self.inverse) {
            if inverse == 0.0 {
                gradient.fill(0.0);
            }
        }
        surface + self.lambda * volume.value
    }

    fn is_preconditioned(&self) -> bool {
        true
    }

    fn precondition(&mut self, vector: &mut [f64]) {
        for (values, &inverse) in vector.chunks_exact_mut(3).zip(self.inverse) {
            values.iter_mut().for_each(|value| *value *= inverse);
        }
    }
}

impl Fit<'_> {
    /// Makes determinants at the points of this volume energy positive again: elements that a stage before left valid at
    /// its own points may be invalid at others. `Some` when the observer asked to stop.
    ///
    /// # Errors
    /// `tangled` when elements stay inverted.
    pub(super) fn mend(
        &mut self,
        volume: &VolumeEnergy,
        observer: &mut dyn Observer,
    ) -> Result<Option<StopReason>, Failure> {
        let inverted = volume.inverted(&self.x);
        if inverted.is_empty() {
            return Ok(None);
        }
        if self.few(&inverted) {
            observer.phase("repair");
            repair(self, &inverted, observer)?;
            if let Some(stop) = observer.stop() {
                return Ok(Some(stop));
            }
            if volume.value(&self.x).value.is_finite() {
                return Ok(None);
            }
        }
        untangle::untangle(self, Softness::Slight, observer)
    }

    /// Whether so few elements fail that the rest may stay where it is.
    fn few(&self, failing: &[usize]) -> bool {
        failing.len() * FEW <= self.volume.cells()
    }

    /// Mends elements that fail between the points: a few in their places, or else, and where that was in vain, by going
    /// on with the whole fit, with more points, or once from its start. `Some` when the observer asked to stop.
    pub(super) fn repair(&mut self, observer: &mut dyn Observer) -> Result<Option<StopReason>, Failure> {
        if self.settings.repairs == 0 {
            return Ok(None);
        }
        let start = self.last;
        let bearable = FARTHER * start.surface + self.lambda * start.volume;
        observer.phase("certify");
        let mut certificates = Certificates::of_all(&self.space, &self.references, &self.x, observer);
        let before = certificates.failing().len();
        // The best so far; the rounds go on from where they are.
        let mut best = (certificates.clone(), self.space.clone(), self.x.clone());
        let mut in_place = false;
        let usual = self.settings.quadrature_points(self.space.highest_order());
        let cost = self.volume.cells() * (AFRESH * usual).pow(3);
        let mut may_start_afresh = self.start.is_some() && cost <= MOST_POINTS;
        let mut stuck = false;
        for round in 0..self.settings.repairs {
            let failing = certificates.failing();
            if failing.is_empty() || observer.stop().is_some() {
                break;
            }
            observer.phase("repair");
            in_place = !in_place && !stuck && self.few(&failing);
            let afresh = may_start_afresh && !in_place && (stuck || round >= PATIENCE);
            if afresh {
                (may_start_afresh, stuck) = (false, false);
            }
            self.extra_points += if afresh { (AFRESH - 1) * usual } else { EXTRA };
            let moved = if in_place {
                repair(self, &failing, observer)?
            } else if afresh {
                self.start_afresh(observer)?
            } else {
                self.repair_all(observer)?
            };
            let now = self.energy()?;
            let dear = !(now.surface < bearable && now.volume.is_finite());
            if dear && !moved.is_empty() {
                self.notices.push(format!(
                    "a repair was not taken: it moved the boundary off the target, from the surface energy {:.3e} to {:.3e}",
                    start.surface, now.surface
                ));
            }
            if dear || observer.stop().is_some() {
                (certificates, self.space, self.x) = best.clone();
                stuck = !in_place && !afresh;
                if stuck && !may_start_afresh {
                    break;
                }
                continue;
            }
            observer.phase("certify");
            certificates.renew(&moved, &self.space, &self.references, &self.x, observer);
            if observer.stop().is_none() && certificates.failing().len() < best.0.failing().len() {
                best = (certificates.clone(), self.space.clone(), self.x.clone());
            }
        }
        (certificates, self.space, self.x) = best;
        if before > 0 {
            self.notices.push(format!(
                "{before} elements were invalid between quadrature points after the last stage; after repairs with up to \
                 {} points more a direction {} are left",
                self.extra_points,
                certificates.failing().len()
            ));
            let fine = self.energy()?;
            self.extra_points = 0;
            let usual = self.energy()?;
            // What was mended at more points may still fail at the usual ones.
            self.last = if usual.volume.is_finite() { usual } else { fine };
        }
        self.certificates = Some(certificates);
        Ok(observer.stop())
    }

    /// Goes through the stages again from the template: where many elements fold between the points, the way there is to be
    /// taken with more of them. Gives all elements: none where they got tangled.
    fn start_afresh(&mut self, observer: &mut dyn Observer) -> Result<Vec<usize>, Failure> {
        let Some((orders, x)) = self.start.clone() else {
            return Ok(Vec::new());
        };
        self.space =
            Space::new(&self.volume, &self.topology, self.settings.basis, &orders).map_err(Failure::invalid)?;
        self.x = x;
        let settings = self.settings;
        for stage in &settings.stages {
            let orders: Vec<usize> = self.space.orders.iter().map(|&order| order.max(stage.order)).collect();
            self.raise(&orders)?;
            match self.stage(stage, observer) {
                Ok((stop, _)) if interrupted(stop) => break,
                Ok(_) => {}
                Err(failure) if failure.kind == TANGLED => {
                    self.notices
                        .push(format!("a fit from the start was given up: {}", failure.reason));
                    return Ok(Vec::new());
                }
                Err(failure) => return Err(failure),
            }
        }
        Ok((0..self.volume.cells()).collect())
    }

    /// Goes on with the last stage. Gives all elements: none where they got tangled.
    fn repair_all(&mut self, observer: &mut dyn Observer) -> Result<Vec<usize>, Failure> {
        let last = self.settings.stages[self.settings.stages.len() - 1];
        match self.stage(&last, observer) {
            Ok(_) => Ok((0..self.volume.cells()).collect()),
            Err(failure) if failure.kind == TANGLED => {
                self.notices.push(format!("a repair was given up: {}", failure.reason));
                Ok(Vec::new())
            }
            Err(failure) => Err(failure),
        }
    }

    /// The parts of the energy at the present map.
    fn energy(&self) -> Result<Parts, Failure> {
        let volume = self.volume_energy(&self.space)?.value(&self.x);
        let boundary = self.boundary(&self.space);
        let mut samples = Vec::new();
        boundary.positions(&self.x, &mut samples);
        let mut surface = 0.0;
        if let Some(mut energy) = self.surface_energy(&boundary, &samples)? {
            surface = energy.gradient(&samples, &mut vec![[0.0; 3]; samples.len()]);
        }
        Ok(Parts {
            surface,
            volume: volume.value,
            least_determinant: volume.least_determinant,
        })
    }
}

/// Moves the elements `seeds` and those about them until determinants are positive at the quadrature's points, and then to
/// the least energy. Gives the elements that moved: none, and the map as it was, where determinants could not be turned or
/// the observer asked to stop.
fn repair(fit: &mut Fit<'_>, seeds: &[usize], observer: &mut dyn Observer) -> Result<Vec<usize>, Failure> {
    let patch = Patch::around(fit, seeds)?;
    let barrier = patch.volume_energy(fit, Density::new(fit.settings.energy))?;
    let own: f64 = (patch.mesh.iter().zip(&patch.references))
        .map(|((shape, _), reference)| reference_volume(shape, reference))
        .sum();
    let intervals = fit.intervals(patch.space.highest_order());
    let boundary = Boundary::new(&patch.mesh, &patch.topology, &patch.space, intervals);
    let mut anchors = Vec::new();
    boundary.positions(&patch.x, &mut anchors);
    let model = Model {
        mesh: &patch.mesh,
        topology: &patch.topology,
        space: &patch.space,
        boundary: &boundary,
        samples: &anchors,
        x: &patch.x,
        references: &patch.references,
        lambda: fit.lambda,
        volume: fit.reference_volume,
        surface: fit.surface_factor(),
        // Stiff along the surface too: a parabola about a plane does not see where the surface bends away.
        anisotropy: 1.0,
    };
    let blocks = preconditioner::sample_blocks(&model);
    let diagonal = preconditioner::diagonal(&model).map_err(Failure::invalid)?;
    let inverse: Vec<f64> = (diagonal.iter().zip(&patch.free))
        .map(|(&value, &free)| if free { 1.0 / value.max(f64::MIN_POSITIVE) } else { 0.0 })
        .collect();
    let mut x = patch.x.clone();
    let minimize = |volume: &VolumeEnergy, x: Vec<f64>, iterations: u64, observer: &mut dyn Observer| -> Solution {
        let mut objective = PatchObjective {
            volume,
            lambda: fit.lambda * own / fit.reference_volume,
            boundary: &boundary,
            anchors: &anchors,
            blocks: &blocks,
            inverse: &inverse,
            samples: Vec::new(),
        };
        let lbfgs = Lbfgs {
            stopping: Stopping {
                gradient_norm: fit.settings.gradient_tolerance,
                relative_decrement: 0.0,
                relative_change: CHANGE,
                iterations,
                ..Stopping::default()
            },
            ..Lbfgs::default()
        };
        lbfgs.minimize(&mut objective, x, &mut Quiet(observer))
    };
    let mut counted = [0; 2];
    let mut count = |solution: &Solution| {
        counted[0] += solution.counters.iterations;
        counted[1] += solution.counters.evaluations;
    };
    let least = barrier.value(&x).least_determinant;
    let turned = turn(
        Softness::Slight.of(least),
        least,
        |regularization, observer| {
            let volume = patch.volume_energy(fit, Density::of(regularization))?;
            let before = volume.value(&x).value;
            let solution = minimize(&volume, std::mem::take(&mut x), TURNING, observer);
            count(&solution);
            x = solution.x;
            let after = volume.value(&x);
            Ok(Round { before, after })
        },
        observer,
    )?;
    let mut moved = Vec::new();
    if matches!(turned, Turned::Positive) {
        let solution = minimize(&barrier, x, SPACING, observer);
        count(&solution);
        for (node, (place, free)) in patch.nodes.iter().zip(&patch.free).enumerate() {
            if let (Some(place), true) = (place, free) {
                fit.x[3 * place..3 * place + 3].copy_from_slice(&solution.x[3 * node..3 * node + 3]);
            }
        }
        moved = patch.cells;
    }
    fit.count("iterations", counted[0]);
    fit.count("evaluations", counted[1]);
    Ok(moved)
}
