//! Cubes of a grid whose centres lie within a closed surface, made into a manifold.

use super::grid::selected;
use crate::mesh::connectivity::{DisjointSets, surface_topology};
use crate::mesh::mixed::MixedMesh;
use crate::mesh::surface::Surface;
use crate::mesh::{TriangleMesh, bounding_box};

/// Cubes with `along` of them on the longest side of the surface's box. Where cubes would touch in an edge or a corner
/// only, more are added until the boundary is a manifold. In the surface's units.
///
/// # Errors
/// When no centre lies within, or the surface is empty.
pub fn voxels(surface: &TriangleMesh, along: usize) -> Result<MixedMesh, String> {
    let mut cubes = Cubes::within(surface, along, [0.0; 3])?;
    cubes.repair(true);
    Ok(cubes.mesh())
}

/// Places of the grid that are tried along an axis, as shares of a cube.
const PLACES: [f64; 3] = [0.0, 1.0 / 3.0, 2.0 / 3.0];
/// Cubes of a grid beyond which no other places are tried.
const MOST: usize = 1_000_000;

/// As [`voxels`], and where their boundary differs from a closed surface in holes or pieces, the grid is moved by thirds
/// of a cube and cubes are also taken away instead of added. Of all these the one that differs least is taken, and
/// among equals the one with the fewest cubes added or taken away. The second result is what is left of the
/// difference: that of the Euler characteristics and twice that of the numbers of pieces, 0 also for an open surface.
///
/// Not guaranteed: that the holes are where the surface has them, for the numbers alone are compared; and grids of more
/// than a million cubes stay where they are.
///
/// # Errors
/// As [`voxels`].
pub fn matching(surface: &TriangleMesh, along: usize) -> Result<(MixedMesh, u64), String> {
    let mut plain = Cubes::within(surface, along, [0.0; 3])?;
    plain.repair(true);
    let Some(wanted) = figures(surface) else {
        return Ok((plain.mesh(), 0));
    };
    let difference = |cubes: &Cubes| {
        let (pieces, euler) = cubes.figures();
        euler.abs_diff(wanted.1) + 2 * pieces.abs_diff(wanted.0)
    };
    let least = difference(&plain);
    if least == 0 || plain.inside.len() > MOST {
        return Ok((plain.mesh(), least));
    }
    let (mut rank, mut best) = ((least, 0), plain);
    for place in 0..27 {
        let place = [place / 9, place / 3 % 3, place % 3].map(|third| PLACES[third]);
        // A grid elsewhere may miss what is thin.
        let Ok(cubes) = Cubes::within(surface, along, place) else {
            continue;
        };
        for fill in [true, false] {
            let mut repaired = cubes.clone();
            repaired.repair(fill);
            if !repaired.inside.contains(&true) {
                continue;
            }
            let changed = cubes.inside.iter().zip(&repaired.inside).filter(|(a, b)| a != b);
            let next = (difference(&repaired), changed.count());
            if next < rank && next.0 < least {
                (rank, best) = (next, repaired);
            }
        }
    }
    Ok((best.mesh(), rank.0))
}

/// Number of pieces and Euler characteristic of a closed manifold; `None` for anything else.
fn figures(surface: &TriangleMesh) -> Option<(u64, i64)> {
    let joined = Surface::welded(surface);
    let topology = surface_topology(&joined.triangles, joined.points.len());
    let closed = topology.boundary_edges == 0 && topology.crowded_edges == 0 && topology.pinched.is_empty();
    closed.then(|| {
        let euler = topology.components.iter().map(|part| part.euler()).sum();
        (topology.components.len() as u64, euler)
    })
}

/// The cubes of a grid, and which of them are wanted.
#[derive(Clone)]
struct Cubes {
    counts: [usize; 3],
    start: [f64; 3],
    size: f64,
    /// The first axis runs fastest.
    inside: Vec<bool>,
}

impl Cubes {
    /// Those with their centres within a surface, the grid moved down by `place` cubes along each axis.
    fn within(surface: &TriangleMesh, along: usize, place: [f64; 3]) -> Result<Cubes, String> {
        let [low, high] = bounding_box(&surface.points).ok_or("the target has no points")?;
        let longest = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        if !(longest > 0.0) {
            return Err("the target has no extent".to_string());
        }
        let size = longest / along as f64;
        // One empty layer around, so that additions have room.
        let around: [usize; 3] =
            std::array::from_fn(|axis| ((high[axis] - low[axis]) / size - 1e-9).ceil() as usize + 2);
        let start: [f64; 3] = std::array::from_fn(|axis| {
            0.5 * (low[axis] + high[axis]) - 0.5 * around[axis] as f64 * size - place[axis] * size
        });
        let counts: [usize; 3] = std::array::from_fn(|axis| around[axis] + usize::from(place[axis] > 0.0));
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
        Ok(Cubes {
            counts,
            start,
            size,
            inside,
        })
    }

    /// The cubes in the surface's units.
    fn mesh(&self) -> MixedMesh {
        let [columns, rows, _] = self.counts;
        let mut mesh = selected(self.counts, |[i, j, k]| self.inside[i + columns * (j + rows * k)]);
        for point in &mut mesh.points {
            for axis in 0..3 {
                point[axis] = self.start[axis] + point[axis] * self.size;
            }
        }
        mesh
    }

    /// Adds cubes, or takes them away, around vertices where those inside, or those outside, do not hang together by
    /// faces.
    fn repair(&mut self, fill: bool) {
        while repair(&self.counts, &mut self.inside, fill) {}
    }

    /// Number of pieces and Euler characteristic of the boundary, which is a manifold.
    fn figures(&self) -> (u64, i64) {
        let [columns, rows, layers] = self.counts;
        let at = |i: usize, j: usize, k: usize| {
            // Indices below 0 have wrapped around.
            i < columns && j < rows && k < layers && self.inside[i + columns * (j + rows * k)]
        };
        // Vertices less edges plus faces less cubes: each counted at its vertex of the lowest indices.
        let mut euler = 0i64;
        for k in 0..=layers {
            for j in 0..=rows {
                for i in 0..=columns {
                    let pattern = (0..8).fold(0u8, |bits, corner| {
                        let [a, b, c] = [corner & 1, corner >> 1 & 1, corner >> 2];
                        let cube = at(
                            (i + a).wrapping_sub(1),
                            (j + b).wrapping_sub(1),
                            (k + c).wrapping_sub(1),
                        );
                        bits | u8::from(cube) << corner
                    });
                    let any = |mask: u8| i64::from(pattern & mask != 0);
                    euler += any(0xff) - any(0xaa) - any(0xcc) - any(0xf0);
                    euler += any(0x88) + any(0xa0) + any(0xc0) - any(0x80);
                }
            }
        }
        // Pieces of the inside and of the outside, all that surrounds the grid being one.
        let around = self.inside.len() as u32;
        let mut sets = DisjointSets::new(self.inside.len() + 1);
        for k in 0..layers {
            for j in 0..rows {
                for i in 0..columns {
                    let cube = i + columns * (j + rows * k);
                    let steps = [
                        (i + 1 < columns, 1),
                        (j + 1 < rows, columns),
                        (k + 1 < layers, columns * rows),
                    ];
                    for (_, step) in steps.into_iter().filter(|&(is_inner, _)| is_inner) {
                        if self.inside[cube] == self.inside[cube + step] {
                            sets.join(cube as u32, (cube + step) as u32);
                        }
                    }
                    let rim = [(i, columns), (j, rows), (k, layers)];
                    if !self.inside[cube] && rim.iter().any(|&(index, count)| index == 0 || index + 1 == count) {
                        sets.join(cube as u32, around);
                    }
                }
            }
        }
        let pieces = (0..=around).filter(|&cube| sets.root(cube) == cube).count();
        // A surface parts two pieces; that of a solid has twice its Euler characteristic.
        (pieces as u64 - 1, 2 * euler)
    }
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

/// Fills or empties around vertices where the cubes inside, or those outside, do not hang together by faces. True when it
/// did.
fn repair(counts: &[usize; 3], inside: &mut [bool], fill: bool) -> bool {
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
                    (0..8).for_each(|corner| inside[at(corner)] = fill);
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
