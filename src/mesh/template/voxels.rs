//! Cubes of a grid whose centres lie within a closed surface, made into a manifold.

use super::grid::selected;
use crate::mesh::mixed::MixedMesh;
use crate::mesh::{TriangleMesh, bounding_box};

/// Cubes with `along` of them on the longest side of the surface's box. Where cubes would touch in an edge or a corner
/// only, more are added until the boundary is a manifold. In the surface's units.
///
/// # Errors
/// When no centre lies within, or the surface is empty.
pub fn voxels(surface: &TriangleMesh, along: usize) -> Result<MixedMesh, String> {
    let [low, high] = bounding_box(&surface.points).ok_or("the target has no points")?;
    let longest = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    if !(longest > 0.0) {
        return Err("the target has no extent".to_string());
    }
    let size = longest / along as f64;
    // One empty layer around, so that additions have room.
    let counts: [usize; 3] = std::array::from_fn(|axis| ((high[axis] - low[axis]) / size - 1e-9).ceil() as usize + 2);
    let start: [f64; 3] = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]) - 0.5 * counts[axis] as f64 * size);
    let place = |[i, j, k]: [usize; 3]| i + counts[0] * (j + counts[1] * k);
    let mut inside = vec![false; counts.iter().product()];
    // Off the middle by an irrational share, so that the line meets no edge of a regular surface.
    let x = |i: usize| start[0] + (i as f64 + 0.5 + 1.1234567e-5) * size;
    let y = |j: usize| start[1] + (j as f64 + 0.5 - 2.7182818e-5) * size;
    // Every triangle is asked by the columns under its box alone, with one to spare for rounding.
    let mut columns = vec![Vec::new(); counts[0] * counts[1]];
    for &cell in &surface.cells {
        let corners = surface.corners(cell);
        let [across, along] = [0, 1].map(|axis| {
            let ends = corners.map(|corner| (corner[axis] - start[axis]) / size);
            let first = ends.into_iter().fold(f64::INFINITY, f64::min) - 1.5;
            let last = ends.into_iter().fold(f64::NEG_INFINITY, f64::max) + 1.5;
            (first.max(0.0) as usize)..(last.max(0.0) as usize).min(counts[axis])
        });
        for j in along {
            for i in across.clone() {
                columns[i + counts[0] * j].extend(crossing(corners, x(i), y(j)));
            }
        }
    }
    for (column, heights) in columns.iter_mut().enumerate() {
        heights.sort_by(f64::total_cmp);
        for k in 0..counts[2] {
            let z = start[2] + (k as f64 + 0.5) * size;
            let below = heights.partition_point(|&height| height < z);
            inside[column + counts[0] * counts[1] * k] = below % 2 == 1;
        }
    }
    if !inside.contains(&true) {
        return Err(format!(
            "no voxel of {size:.3e} has its centre within the target; use more of them, or is the target open?"
        ));
    }
    while repair(&counts, &mut inside) {}
    let mut mesh = selected(counts, |index| inside[place(index)]);
    for point in &mut mesh.points {
        for axis in 0..3 {
            point[axis] = start[axis] + point[axis] * size;
        }
    }
    Ok(mesh)
}

/// The height at which the vertical line through (x, y) meets a triangle.
fn crossing(corners: [[f64; 3]; 3], x: f64, y: f64) -> Option<f64> {
    let side = |a: [f64; 3], b: [f64; 3]| (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
    let [a, b, c] = corners;
    let weights = [side(b, c), side(c, a), side(a, b)];
    let sum: f64 = weights.iter().sum();
    let same = weights.iter().all(|&w| w > 0.0) || weights.iter().all(|&w| w < 0.0);
    (same && sum != 0.0).then(|| (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) / sum)
}

/// Fills around vertices where the cubes inside, or those outside, do not hang together by faces. True when it did.
fn repair(counts: &[usize; 3], inside: &mut [bool]) -> bool {
    let mut changed = false;
    for k in 1..counts[2] {
        for j in 1..counts[1] {
            for i in 1..counts[0] {
                let at = |corner: usize| {
                    let [a, b, c] = [corner & 1, corner >> 1 & 1, corner >> 2];
                    (i - 1 + a) + counts[0] * ((j - 1 + b) + counts[1] * (k - 1 + c))
                };
                let pattern = (0..8).fold(0u8, |bits, corner| bits | (u8::from(inside[at(corner)])) << corner);
                if !hangs_together(pattern) || !hangs_together(!pattern) {
                    (0..8).for_each(|corner| inside[at(corner)] = true);
                    changed = true;
                }
            }
        }
    }
    changed
}

/// Whether the corners of a cube in the set hang together along its edges.
fn hangs_together(set: u8) -> bool {
    if set == 0 {
        return true;
    }
    let mut reached = 1u8 << set.trailing_zeros();
    loop {
        let mut next = reached;
        for corner in 0..8 {
            if reached >> corner & 1 == 1 {
                for axis in 0..3 {
                    next |= 1 << (corner ^ (1 << axis)) & set;
                }
            }
        }
        if next == reached {
            return reached == set;
        }
        reached = next;
    }
}
