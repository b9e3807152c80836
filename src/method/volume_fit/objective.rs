//! What a fit minimizes: `E = E_S + lambda E_Omega` over the nodes (Jin et al. 2013, equation 1).

use super::chart::Chart;
use super::preconditioner::Preconditioner;
use super::surface_energy::SurfaceEnergy;
use crate::fem::boundary::Boundary;
use crate::fem::volume_energy::VolumeEnergy;
use crate::optimize::Objective;
use std::cell::Cell;
use std::rc::Rc;

/// The parts of the energy at the last point that was evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    pub surface: f64,
    pub volume: f64,
    pub least_determinant: f64,
}

impl Parts {
    /// The energy with this weight of the volume's.
    pub fn total(&self, lambda: f64) -> f64 {
        self.surface + lambda * self.volume
    }
}

/// The energy of one stage.
pub struct FitObjective<'a> {
    pub volume: &'a VolumeEnergy,
    pub boundary: &'a Boundary,
    pub surface: Option<&'a mut SurfaceEnergy>,
    pub lambda: f64,
    pub preconditioner: Option<Preconditioner>,
    pub latest: Rc<Cell<Parts>>,
    /// Determinants below this count as outside the domain: one step may not crush an element at once, or the next ones
    /// have nowhere to go.
    pub floor: Rc<Cell<f64>>,
    pub samples: Vec<[f64; 3]>,
    pub forces: Vec<[f64; 3]>,
    /// What the unknowns stand for; the nodes themselves when absent.
    pub chart: Option<&'a Chart>,
    /// Nodes of the unknowns, and the gradient by them.
    pub nodes: [Vec<f64>; 2],
}

impl<'a> FitObjective<'a> {
    /// Over the nodes, without a preconditioner or a floor.
    pub fn new(
        volume: &'a VolumeEnergy,
        boundary: &'a Boundary,
        surface: Option<&'a mut SurfaceEnergy>,
        lambda: f64,
    ) -> FitObjective<'a> {
        FitObjective {
            volume,
            boundary,
            surface,
            lambda,
            preconditioner: None,
            latest: Rc::default(),
            floor: Rc::new(Cell::new(f64::NEG_INFINITY)),
            samples: Vec::new(),
            forces: Vec::new(),
            chart: None,
            nodes: Default::default(),
        }
    }
}

impl Objective for FitObjective<'_> {
    fn dimension(&self) -> usize {
        self.chart.map_or(3 * self.volume.nodes(), Chart::unknowns)
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let Some(chart) = self.chart else {
            return self.at_nodes(x, gradient);
        };
        let [mut nodes, mut forces] = std::mem::take(&mut self.nodes);
        nodes.resize(3 * self.volume.nodes(), 0.0);
        forces.resize(nodes.len(), 0.0);
        chart.expand(x, &mut nodes);
        let value = self.at_nodes(&nodes, &mut forces);
        chart.restrict(&forces, gradient);
        self.nodes = [nodes, forces];
        value
    }

    fn is_preconditioned(&self) -> bool {
        self.preconditioner.is_some()
    }

    fn precondition(&mut self, vector: &mut [f64]) {
        if let Some(preconditioner) = &mut self.preconditioner {
            preconditioner.apply(vector);
        }
    }
}

impl FitObjective<'_> {
    /// The value, and the gradient by the nodes.
    fn at_nodes(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        gradient.fill(0.0);
        let volume = self.volume.add_gradient(x, self.lambda, gradient);
        if !volume.value.is_finite() || volume.least_determinant < self.floor.get() {
            // The surface does not matter where a cell is inverted.
            return f64::INFINITY;
        }
        let mut parts = Parts {
            surface: 0.0,
            volume: volume.value,
            least_determinant: volume.least_determinant,
        };
        if let Some(surface) = &mut self.surface {
            self.boundary.positions(x, &mut self.samples);
            self.forces.resize(self.samples.len(), [0.0; 3]);
            parts.surface = surface.gradient(&self.samples, &mut self.forces);
            if !parts.surface.is_finite() {
                return f64::INFINITY;
            }
            self.boundary.add_gradient(&self.forces, gradient);
        }
        self.latest.set(parts);
        parts.total(self.lambda)
    }
}
