//! How good the elements are: scaled Jacobians and determinants.
//!
//! Means are taken over a thousand points spread evenly over the canonical cell, extremes over these and a lattice
//! with the corners, edges and faces, where elements fail first.

use crate::fem::batches::{Batches, unit_reference};
use crate::fem::quadrature::{CellQuadrature, Line, Rule, Scattered};
use crate::fem::space::{Kind, Space};
use crate::linalg::processor::Processor;
use crate::linalg::vector3::{Columns, apply, cofactor, dot};
use crate::mesh;
use crate::mesh::mixed::Shape;
use crate::method::Failure;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Points a direction over which means are taken: a thousand an element.
const SAMPLES: usize = 10;

/// Figures of every element.
#[derive(Clone, Debug, Default)]
pub struct Quality {
    pub scaled_jacobian_mean: Vec<f64>,
    pub scaled_jacobian_min: Vec<f64>,
    pub least_determinant: Vec<f64>,
    pub largest_determinant: Vec<f64>,
    /// Standard deviation of the logarithm of positive determinants over all points.
    pub spread: f64,
}

/// A thousand points that share the cell's volume evenly.
fn even_points(shape: Shape) -> CellQuadrature {
    let even = |count: usize| vec![1.0 / count as f64; count];
    let middle = |k: usize| (k as f64 + 0.5) / SAMPLES as f64;
    let line = || Line {
        points: (0..SAMPLES).map(middle).collect(),
        weights: even(SAMPLES),
    };
    match shape {
        Shape::Hexahedron => CellQuadrature::Hexahedron(line()),
        Shape::Prism => {
            // The middles of the hundred small triangles.
            let mut points = Vec::new();
            for i in 0..SAMPLES {
                for j in 0..SAMPLES - i {
                    let at = |share: f64| [i, j].map(|index| (index as f64 + share) / SAMPLES as f64);
                    points.push(at(1.0 / 3.0));
                    if i + j + 1 < SAMPLES {
                        points.push(at(2.0 / 3.0));
                    }
                }
            }
            let triangle = Scattered {
                weights: even(points.len()),
                points,
            };
            CellQuadrature::Prism(triangle, line())
        }
        Shape::Tetrahedron => {
            // Halton's points: as even as random ones or more so, and the same on every machine.
            let radical = |mut index: usize, base: usize| {
                let (mut value, mut share) = (0.0, 1.0);
                while index > 0 {
                    share /= base as f64;
                    value += share * (index % base) as f64;
                    index /= base;
                }
                value
            };
            let points: Vec<[f64; 3]> = (1..)
                .map(|index| [2, 3, 5].map(|base| radical(index, base)))
                .filter(|point| point.iter().sum::<f64>() <= 1.0)
                .take(SAMPLES.pow(3))
                .collect();
            CellQuadrature::Tetrahedron(Scattered {
                weights: even(points.len()),
                points,
            })
        }
    }
}

/// For each corner of the ideal element its three unit edges; equal ones once.
fn corner_frames(shape: Shape) -> Vec<Columns<f64>> {
    let reference = unit_reference(shape);
    let canonical = shape.canonical();
    let mut frames: Vec<Columns<f64>> = Vec::new();
    for (corner, ends) in shape.corner_frames().iter().enumerate() {
        let frame = ends.map(|end| {
            let edge = mesh::subtract(canonical[end], canonical[corner]);
            apply(&reference, edge)
        });
        // Frames that differ by signs alone give the same figure.
        let same =
            |other: &Columns<f64>| (0..3).all(|i| (0..3).any(|j| (dot(frame[i], other[j]).abs() - 1.0).abs() < 1e-12));
        if !frames.iter().any(same) {
            frames.push(frame);
        }
    }
    frames
}

/// The lower of two numbers, not-a-number if one is: a determinant that is none must not pass for a good one.
fn lower(a: f64, b: f64) -> f64 {
    if a.is_nan() || a < b { a } else { b }
}

/// Judges every element at many points.
pub fn quality(space: &Space, references: &[Columns<f64>], x: &[f64]) -> Result<Quality, Failure> {
    let inside = figures(space, references, x, &|kind| even_points(kind.shape))?;
    let lattice = figures(space, references, x, &|kind| {
        Rule::Trapezoid.cell(kind.shape, SAMPLES + 1)
    })?;
    let mut result = Quality::default();
    let mut sums = [0.0; 3];
    for (inside, lattice) in inside.iter().zip(&lattice) {
        result.scaled_jacobian_mean.push(inside.scaled_jacobian / inside.points);
        result
            .scaled_jacobian_min
            .push(lower(inside.least_scaled_jacobian, lattice.least_scaled_jacobian));
        result
            .least_determinant
            .push(lower(inside.least_determinant, lattice.least_determinant));
        result
            .largest_determinant
            .push(inside.largest_determinant.max(lattice.largest_determinant));
        for (sum, value) in sums
            .iter_mut()
            .zip([inside.points, inside.logarithm, inside.squared_logarithm])
        {
            *sum += value;
        }
    }
    let mean = sums[1] / sums[0];
    result.spread = (sums[2] / sums[0] - mean * mean).max(0.0).sqrt();
    Ok(result)
}

/// Sums and extremes over the points of one element.
#[derive(Clone, Copy, Debug)]
struct Figures {
    points: f64,
    scaled_jacobian: f64,
    least_scaled_jacobian: f64,
    least_determinant: f64,
    largest_determinant: f64,
    /// Of positive determinants.
    logarithm: f64,
    squared_logarithm: f64,
}

/// The figures of every element over the points of a quadrature.
fn figures(
    space: &Space,
    references: &[Columns<f64>],
    x: &[f64],
    points: &dyn Fn(Kind) -> CellQuadrature,
) -> Result<Vec<Figures>, Failure> {
    let batches = Batches::new(space, references, points).map_err(Failure::invalid)?;
    let frames = Shape::ALL.map(corner_frames);
    let processor = Processor::detect();
    let none = Figures {
        points: 0.0,
        scaled_jacobian: 0.0,
        least_scaled_jacobian: f64::INFINITY,
        least_determinant: f64::INFINITY,
        largest_determinant: f64::NEG_INFINITY,
        logarithm: 0.0,
        squared_logarithm: 0.0,
    };
    let parts: Vec<BTreeMap<usize, Figures>> = batches
        .list()
        .into_par_iter()
        .map(|place| {
            let mut sums: BTreeMap<usize, Figures> = BTreeMap::new();
            batches.visit(processor, place, x, |cell, _, jacobian| {
                let frames = &frames[space.cells[cell].kind.shape as usize];
                let determinant = dot(jacobian[0], cofactor(&jacobian)[0]);
                let mut least = f64::INFINITY;
                for frame in frames {
                    let image = frame.map(|edge| apply(&jacobian, edge));
                    let product: f64 = image.iter().map(|edge| mesh::length(*edge)).product();
                    // The images' determinant over that of the frame is the map's own.
                    least = lower(least, determinant / product.max(f64::MIN_POSITIVE));
                }
                let entry = sums.entry(cell).or_insert(none);
                entry.points += 1.0;
                entry.scaled_jacobian += least;
                entry.least_scaled_jacobian = lower(entry.least_scaled_jacobian, least);
                entry.least_determinant = lower(entry.least_determinant, determinant);
                entry.largest_determinant = entry.largest_determinant.max(determinant);
                if determinant > 0.0 {
                    let logarithm = determinant.ln();
                    entry.logarithm += logarithm;
                    entry.squared_logarithm += logarithm * logarithm;
                }
            });
            sums
        })
        .collect();
    let mut result = vec![none; space.cells.len()];
    for (cell, entry) in parts.into_iter().flatten() {
        result[cell] = entry;
    }
    Ok(result)
}
