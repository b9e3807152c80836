//! Coordinates in which a surface is built: its box about the origin, its diagonal between 1 and 2.
//!
//! Patches are evaluated as sums of coefficients; far from the origin these lose as many digits as the distance has
//! more than the size, and very small or large sizes meet thresholds that were meant for neither. Here the size is a
//! power of two and the origin a multiple of it, so that entering loses nothing for coordinates that are not
//! themselves rounded.

use crate::linalg::vector3::{add, subtract, times};
use crate::mesh::{bounding_box, length};
use std::collections::BTreeMap;

/// See the module. The default leaves everything as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    origin: [f64; 3],
    size: f64,
}

impl Default for Frame {
    fn default() -> Self {
        Self {
            origin: [0.0; 3],
            size: 1.0,
        }
    }
}

/// Metrics with a unit, and the power of the unit of length in it.
const UNITS: [(&str, i32); 10] = [
    ("distance_max", 1),
    ("distance_rms", 1),
    ("edge_length", 1),
    ("area", 2),
    ("curve_energy", 2),
    ("natural_energy", 2),
    ("node_energy_before", 2),
    ("node_energy", 2),
    ("node_change", 2),
    ("hexahedra_volume", 3),
];

impl Frame {
    /// The frame of these points.
    pub fn of(points: &[[f64; 3]]) -> Self {
        let Some([low, high]) = bounding_box(points) else {
            return Self::default();
        };
        let extent = subtract(high, low);
        let diagonal = length(extent);
        if !diagonal.is_normal() {
            return Self::default();
        }
        // The exponent alone.
        let size = f64::from_bits(diagonal.to_bits() & 0x7ff0_0000_0000_0000);
        let centre = add(low, times(extent, 0.5));
        Self {
            origin: centre.map(|coordinate| (coordinate / size).round() * size),
            size,
        }
    }

    /// Carries points of the file into the frame.
    pub fn enter(&self, points: &mut [[f64; 3]]) {
        for point in points {
            *point = times(subtract(*point, self.origin), 1.0 / self.size);
        }
    }

    /// Carries points of the frame back to the coordinates of the file.
    pub fn leave(&self, points: &mut [[f64; 3]]) {
        for point in points {
            *point = add(times(*point, self.size), self.origin);
        }
    }

    /// Carries metrics back to the units of the file.
    pub fn leave_metrics(&self, metrics: &mut BTreeMap<String, f64>) {
        for (name, power) in UNITS {
            if let Some(value) = metrics.get_mut(name) {
                *value *= self.size.powi(power);
            }
        }
    }

    /// Carries curvatures back to the units of the file: their unit is that of length to the power of `-power`.
    pub fn leave_curvatures(&self, values: &mut [f64], power: i32) {
        for value in values {
            *value /= self.size.powi(power);
        }
    }
}
