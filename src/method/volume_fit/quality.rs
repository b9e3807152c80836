//! How good the elements are: scaled Jacobians and determinants at a thousand points of each.

use super::invalid;
use crate::fem::batches::{Batches, unit_reference};
use crate::fem::quadrature::{CellQuadrature, Line, Scattered};
use crate::fem::space::Space;
use crate::linalg::processor::Processor;
use crate::linalg::vector3::{Columns, apply, cofactor, dot};
use crate::mesh;
use crate::mesh::mixed::Shape;
use crate::method::Failure;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Points a direction at which elements are judged: a thousand an element.
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

/// A thousand points that are random along each direction, with the ends among them.
fn random_points(shape: Shape) -> CellQuadrature {
    // Van der Corput numbers in coprime bases: as good as random, and the same on every machine.
    let radical = |mut index: usize, base: usize| {
        let (mut value, mut share) = (0.0, 1.0);
        while index > 0 {
            share /= base as f64;
            value += share * (index % base) as f64;
            index /= base;
        }
        value
    };
    let mut line: Vec<f64> = (1..SAMPLES - 1).map(|k| radical(k, 2)).collect();
    line.push(0.0);
    line.push(1.0);
    let even = |count: usize| vec![1.0 / count as f64; count];
    let fold = |mut u: f64, mut v: f64| {
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        [u, v]
    };
    match shape {
        Shape::Hexahedron => CellQuadrature::Hexahedron(Line {
            weights: even(line.len()),
            points: line,
        }),
        Shape::Prism => {
            let mut points = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
            points.extend((1..98).map(|k| fold(radical(k, 2), radical(k, 3))));
            CellQuadrature::Prism(
                Scattered {
                    weights: even(points.len()),
                    points,
                },
                Line {
                    weights: even(line.len()),
                    points: line,
                },
            )
        }
        Shape::Tetrahedron => {
            let mut points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let mut index = 1;
            while points.len() < SAMPLES.pow(3) {
                let point = [radical(index, 2), radical(index, 3), radical(index, 5)];
                index += 1;
                if point.iter().sum::<f64>() <= 1.0 {
                    points.push(point);
                }
            }
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

/// Judges every element at many points.
pub fn quality(space: &Space, references: &[Columns<f64>], x: &[f64]) -> Result<Quality, Failure> {
    let batches = Batches::new(space, references, &|kind| random_points(kind.shape)).map_err(invalid)?;
    let frames = Shape::ALL.map(corner_frames);
    let processor = Processor::detect();
    let cells = space.cells.len();
    let parts: Vec<BTreeMap<usize, [f64; 7]>> = batches
        .list()
        .into_par_iter()
        .map(|place| {
            let mut sums: BTreeMap<usize, [f64; 7]> = BTreeMap::new();
            batches.visit(processor, place, x, |cell, _, jacobian| {
                let frames = &frames[space.cells[cell].kind.shape as usize];
                let determinant = dot(jacobian[0], cofactor(&jacobian)[0]);
                let mut least = f64::INFINITY;
                for frame in frames {
                    let image = frame.map(|edge| apply(&jacobian, edge));
                    let product: f64 = image.iter().map(|edge| mesh::length(*edge)).product();
                    // The images' determinant over that of the frame is the map's own.
                    least = least.min(determinant / product.max(f64::MIN_POSITIVE));
                }
                let entry =
                    sums.entry(cell)
                        .or_insert([0.0, 0.0, f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0]);
                entry[0] += 1.0;
                entry[1] += least;
                entry[2] = entry[2].min(least);
                entry[3] = entry[3].min(determinant);
                entry[4] = entry[4].max(determinant);
                if determinant > 0.0 {
                    let logarithm = determinant.ln();
                    entry[5] += logarithm;
                    entry[6] += logarithm * logarithm;
                }
            });
            sums
        })
        .collect();
    let mut result = Quality {
        scaled_jacobian_mean: vec![f64::NAN; cells],
        scaled_jacobian_min: vec![f64::NAN; cells],
        least_determinant: vec![f64::NAN; cells],
        largest_determinant: vec![f64::NAN; cells],
        spread: 0.0,
    };
    let mut sums = [0.0; 3];
    for (cell, entry) in parts.into_iter().flatten() {
        result.scaled_jacobian_mean[cell] = entry[1] / entry[0];
        result.scaled_jacobian_min[cell] = entry[2];
        result.least_determinant[cell] = entry[3];
        result.largest_determinant[cell] = entry[4];
        for (sum, value) in sums.iter_mut().zip([entry[0], entry[5], entry[6]]) {
            *sum += value;
        }
    }
    let mean = sums[1] / sums[0];
    result.spread = (sums[2] / sums[0] - mean * mean).max(0.0).sqrt();
    Ok(result)
}
