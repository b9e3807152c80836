//! Scaled Jacobian: how far a cell's corners are from those of the ideal cell (Knupp 2001).
//!
//! At every corner of a cell, three edges make a frame; its determinant over the product of the edge lengths, divided by
//! the same figure of the ideal cell, is 1 for the ideal cell, 0 for a flat corner and negative for an inverted one. A
//! cell's scaled Jacobian is the least of its corners'. The formula of each kind of cell stands with the meshes, which
//! need it to judge their own quality.

use super::{Better, Metric};
use crate::mesh::TetrahedralMesh;
use crate::mesh::quality::scaled_jacobian;

/// Metrics over all cells of a mesh.
pub const METRICS: &[Metric] = &[
    Metric {
        name: "scaled_jacobian_min",
        symbol: "min SJ",
        unit: "",
        floor: None,
        better: Better::Higher,
        definition: "Smallest scaled Jacobian of an image tetrahedron: sqrt(2) det / product of the three edge lengths at a corner, \
         least over the corners; 1 for the regular tetrahedron.",
    },
    Metric {
        name: "scaled_jacobian_mean",
        symbol: "mean SJ",
        unit: "",
        floor: None,
        better: Better::Higher,
        definition: "Mean over the image tetrahedra of their scaled Jacobians.",
    },
];

/// Scaled Jacobians of a mesh's cells.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaledJacobians {
    pub cells: Vec<f64>,
    /// Infinite for a mesh without cells.
    pub min: f64,
    /// Not-a-number for a mesh without cells.
    pub mean: f64,
}

impl ScaledJacobians {
    /// From the figures of the cells, whatever their kind.
    pub fn new(cells: Vec<f64>) -> Self {
        Self {
            min: cells.iter().copied().fold(f64::INFINITY, f64::min),
            mean: cells.iter().sum::<f64>() / cells.len() as f64,
            cells,
        }
    }

    /// Of a tetrahedral mesh.
    pub fn of_tetrahedra(mesh: &TetrahedralMesh) -> Self {
        Self::new(
            mesh.cells
                .iter()
                .map(|&cell| scaled_jacobian(mesh.corners(cell)))
                .collect(),
        )
    }
}
