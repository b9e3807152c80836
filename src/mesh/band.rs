//! Surfaces of revolution and their like: spherical caps, tubes that a free band joins, strips between two curves.

use super::TriangleMesh;
use super::planar::{self, Domain, Family};
use std::f64::consts::TAU;

/// A cross-section of a tube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    Circle,
    Square,
}

/// A tube made of a lower and an upper part that are kept, and a band between them that is free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    pub lower: Section,
    pub upper: Section,
    /// Radius of the circle, or half the side of the square.
    pub lower_size: f64,
    pub upper_size: f64,
    /// Height of the free band; it is centred at height 0.
    pub gap: f64,
    /// Height of each of the two kept parts.
    pub height: f64,
    /// Number of points around.
    pub around: usize,
}

/// A surface with its free vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    pub mesh: TriangleMesh,
    pub inside: Vec<bool>,
    pub free: Vec<bool>,
}

/// The point at the given share of a section's circumference.
fn on_section(section: Section, size: f64, share: f64) -> [f64; 2] {
    match section {
        Section::Circle => {
            let angle = TAU * share;
            [size * angle.cos(), size * angle.sin()]
        }
        Section::Square => {
            // From the middle of the right side on, by arc length.
            let along = (share * 8.0 + 1.0).rem_euclid(8.0);
            let (side, rest) = ((along / 2.0) as usize, along.rem_euclid(2.0) - 1.0);
            let [x, y] = match side {
                0 => [1.0, rest],
                1 => [-rest, 1.0],
                2 => [-1.0, -rest],
                _ => [rest, -1.0],
            };
            [size * x, size * y]
        }
    }
}

/// Meshes a joint with about equal edges; the free band is ruled.
///
/// # Errors
/// When so slender a shape would take too many triangles.
pub fn joint(joint: &Joint) -> Result<Band, String> {
    let circumference = |section: Section, size: f64| match section {
        Section::Circle => TAU * size,
        Section::Square => 8.0 * size,
    };
    let mean = 0.5 * (circumference(joint.lower, joint.lower_size) + circumference(joint.upper, joint.upper_size));
    let edge = mean / joint.around as f64;
    let slant = joint.gap.hypot(joint.upper_size - joint.lower_size);
    let rows = |length: f64| ((length / edge).round() as usize).max(3);
    let (kept, free_rows) = (rows(joint.height), rows(slant));
    let points = (2.0 * joint.height + slant) / edge * joint.around as f64;
    if !(points < 2e7) {
        return Err(format!(
            "{points:e} points are too many; take a shorter tube or fewer points around"
        ));
    }
    let total = 2 * kept + free_rows;
    let ring = |row: usize, share: f64| -> [f64; 3] {
        let low = on_section(joint.lower, joint.lower_size, share);
        let high = on_section(joint.upper, joint.upper_size, share);
        if row <= kept {
            let z = -0.5 * joint.gap - joint.height * (kept - row) as f64 / kept as f64;
            [low[0], low[1], z]
        } else if row >= kept + free_rows {
            let z = 0.5 * joint.gap + joint.height * (row - kept - free_rows) as f64 / kept as f64;
            [high[0], high[1], z]
        } else {
            let share = (row - kept) as f64 / free_rows as f64;
            let mix = |a: f64, b: f64| a + share * (b - a);
            [mix(low[0], high[0]), mix(low[1], high[1]), joint.gap * (share - 0.5)]
        }
    };
    let mesh = tube(total, joint.around, ring);
    let inside = (0..total)
        .flat_map(|row| std::iter::repeat_n(row >= kept && row < kept + free_rows, 2 * joint.around))
        .collect();
    let free = (0..=total)
        .flat_map(|row| std::iter::repeat_n(row > kept && row < kept + free_rows, joint.around))
        .collect();
    Ok(Band { mesh, inside, free })
}

/// Rows of points around an axis, joined by triangles that face outwards; alternating diagonals.
fn tube(rows: usize, around: usize, place: impl Fn(usize, f64) -> [f64; 3]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for row in 0..=rows {
        for step in 0..around {
            mesh.points.push(place(row, step as f64 / around as f64));
        }
    }
    let name = |row: usize, step: usize| (row * around + step % around) as u32;
    for row in 0..rows {
        for step in 0..around {
            let [a, b, c, d] = [
                name(row, step),
                name(row, step + 1),
                name(row + 1, step + 1),
                name(row + 1, step),
            ];
            if (row + step) % 2 == 0 {
                mesh.cells.extend([[a, b, c], [a, c, d]]);
            } else {
                mesh.cells.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    mesh
}

/// A strip around an axis between two closed curves: the straight tube that serves as its domain, and where its vertices
/// go, the two curves joined by straight lines.
pub fn strip(around: usize, waves: usize, height: f64) -> (Band, Vec<[f64; 3]>) {
    let edge = TAU / around as f64;
    let rows = ((height / edge).round() as usize).max(4);
    let lower = |share: f64| {
        let angle = TAU * share;
        [angle.cos(), angle.sin(), 0.0]
    };
    let upper = |share: f64| {
        let angle = TAU * share;
        let radius = 1.0 + 0.15 * (waves as f64 * angle).cos();
        let z = height + 0.2 * (waves as f64 * angle).sin();
        [radius * angle.cos(), radius * angle.sin(), z]
    };
    let mesh = tube(rows, around, |row, share| {
        let angle = TAU * share;
        [angle.cos(), angle.sin(), height * row as f64 / rows as f64]
    });
    let curves = tube(rows, around, |row, share| {
        let part = row as f64 / rows as f64;
        let (low, high) = (lower(share), upper(share));
        std::array::from_fn(|axis| low[axis] + part * (high[axis] - low[axis]))
    });
    let free = (0..=rows)
        .flat_map(|row| std::iter::repeat_n(row > 0 && row < rows, around))
        .collect();
    let inside = vec![true; mesh.cells.len()];
    (Band { mesh, inside, free }, curves.points)
}

/// A cap of the unit sphere up to an angle from the pole, with a hole where the rest of the sphere would be.
///
/// # Errors
/// When `rings` is odd or below 2.
pub fn cap(rings: usize, angle: f64) -> Result<TriangleMesh, String> {
    let mut mesh = planar::generate(Domain::Disk, Family::Regular, rings, 0)?.mesh;
    for point in &mut mesh.points {
        let radius = point[0].hypot(point[1]);
        let polar = radius * angle;
        let share = if radius > 0.0 { polar.sin() / radius } else { 0.0 };
        *point = [point[0] * share, point[1] * share, polar.cos()];
    }
    Ok(mesh)
}
