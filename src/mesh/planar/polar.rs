//! Meshes of disks and annuli: concentric rings of points.

use super::delaunay::triangulate;
use super::{Domain, Family, Planar, Random, inside, split_at_centroids};
use crate::mesh::TriangleMesh;
use std::f64::consts::TAU;

pub(super) fn planar(domain: Domain, family: Family, cells: usize, seed: u64) -> Result<Planar, String> {
    let known = match domain {
        Domain::Disk => !matches!(family, Family::Equi | Family::UnionJack | Family::CrissCross),
        _ => true,
    };
    if !known {
        return Err(
            "there is no such mesh of a disk; its families are regular, centroid-split, perturbed, minimum-angle-30 \
             and minimum-angle-1"
                .to_string(),
        );
    }
    match (domain, family) {
        (_, Family::CentroidSplit) => Ok(split_at_centroids(planar(domain, Family::Regular, cells, seed)?)),
        (Domain::Disk, Family::Regular) => Ok(disk(cells)),
        (Domain::Disk, _) => {
            let regular = disk(cells);
            let rings = disk_rings(cells);
            moved(&regular.mesh, &rings, &[cells / 2, cells], family, cells, seed)
        }
        (_, Family::Perturbed | Family::MinimumAngle30 | Family::MinimumAngle1) => {
            let (regular, rings) = annulus(Family::Regular, cells)?;
            let marked = [0, cells / 4, 3 * cells / 4, cells];
            moved(&regular.mesh, &rings, &marked, family, cells, seed)
        }
        (_, family) => Ok(annulus(family, cells)?.0),
    }
}

/// First point of every ring, one more entry than rings.
fn disk_rings(cells: usize) -> Vec<usize> {
    let mut starts = vec![0];
    for ring in 0..=cells {
        starts.push(starts[ring] + (6 * ring).max(1));
    }
    starts
}

/// Ring `r` has `6 r` points at the radius `r / cells`: six sectors of triangles close to equilateral.
fn disk(cells: usize) -> Planar {
    let starts = disk_rings(cells);
    let mut mesh = TriangleMesh {
        points: vec![[0.0; 3]],
        cells: Vec::new(),
    };
    let mut within = Vec::new();
    for ring in 1..=cells {
        let radius = ring as f64 / cells as f64;
        let count = 6 * ring;
        for step in 0..count {
            let angle = TAU * step as f64 / count as f64;
            mesh.points.push([radius * angle.cos(), radius * angle.sin(), 0.0]);
        }
        let outer = |step: usize| (starts[ring] + step % count) as u32;
        let inner = |step: usize| {
            let below = 6 * (ring - 1);
            if below == 0 {
                0
            } else {
                (starts[ring - 1] + step % below) as u32
            }
        };
        for sector in 0..6 {
            for step in 0..ring {
                let (out, below) = (sector * ring + step, sector * (ring - 1) + step);
                mesh.cells.push([outer(out), outer(out + 1), inner(below)]);
                within.push(2 * ring <= cells);
                if step + 1 < ring {
                    mesh.cells.push([outer(out + 1), inner(below + 1), inner(below)]);
                    within.push(2 * ring <= cells);
                }
            }
        }
    }
    Planar { mesh, inside: within }
}

/// Rings of equally many points at equal distances, from the radius 1/4 to 5/4.
fn annulus(family: Family, cells: usize) -> Result<(Planar, Vec<usize>), String> {
    if !cells.is_multiple_of(4) {
        return Err(format!(
            "{cells} cells a unit do not meet the inner ring of an annulus; take a multiple of 4"
        ));
    }
    // Even for the alternating families; about square cells at the radius 3/4.
    let around = 2 * ((0.75 * TAU * cells as f64 / 2.0).round() as usize);
    let mut mesh = TriangleMesh::default();
    let mut within = Vec::new();
    let starts: Vec<usize> = (0..=cells + 1).map(|ring| ring * around).collect();
    let place = |ring: f64, step: f64| {
        let (radius, angle) = (0.25 + ring / cells as f64, TAU * step / around as f64);
        [radius * angle.cos(), radius * angle.sin(), 0.0]
    };
    for ring in 0..=cells {
        for step in 0..around {
            let shift = if family == Family::Equi { 0.5 * ring as f64 } else { 0.0 };
            mesh.points.push(place(ring as f64, step as f64 + shift));
        }
    }
    let name = |ring: usize, step: usize| (ring * around + step % around) as u32;
    for ring in 0..cells {
        let inner = ring >= cells / 4 && ring < 3 * cells / 4;
        for step in 0..around {
            // Counter-clockwise: outwards, then around.
            let [a, b, c, d] = [
                name(ring, step),
                name(ring + 1, step),
                name(ring + 1, step + 1),
                name(ring, step + 1),
            ];
            let before = mesh.cells.len();
            match family {
                Family::CrissCross => {
                    let middle = mesh.points.len() as u32;
                    mesh.points.push(place(ring as f64 + 0.5, step as f64 + 0.5));
                    mesh.cells
                        .extend([[a, b, middle], [b, c, middle], [c, d, middle], [d, a, middle]]);
                }
                // The outer ring stands half a cell further.
                Family::Equi => mesh.cells.extend([[a, b, d], [b, c, d]]),
                Family::UnionJack if (ring + step) % 2 == 1 => mesh.cells.extend([[a, b, d], [b, c, d]]),
                _ => mesh.cells.extend([[a, b, c], [a, c, d]]),
            }
            within.extend(std::iter::repeat_n(inner, mesh.cells.len() - before));
        }
    }
    Ok((Planar { mesh, inside: within }, starts))
}

/// Moves the points at random and triangulates anew. The points of the `marked` rings stay on their circles; the first
/// and the last of them bound the domain, the two in the middle (or the one) the inner domain.
fn moved(
    mesh: &TriangleMesh,
    starts: &[usize],
    marked: &[usize],
    family: Family,
    cells: usize,
    seed: u64,
) -> Result<Planar, String> {
    let step = family.amplitude() / cells as f64;
    let mut random = Random::new(seed);
    let mut points = Vec::with_capacity(mesh.points.len());
    for ring in 0..starts.len() - 1 {
        for point in &mesh.points[starts[ring]..starts[ring + 1]] {
            let radius = point[0].hypot(point[1]);
            // Points of small rings stand closer to each other than a cell.
            let spacing = TAU * radius / (starts[ring + 1] - starts[ring]) as f64;
            let step = step * (spacing * cells as f64).min(1.0);
            let (dx, dy) = (step * random.signed(), step * random.signed());
            points.push(if marked.contains(&ring) {
                let turn = if radius > 0.0 { dx / radius } else { 0.0 };
                [
                    point[0] * turn.cos() - point[1] * turn.sin(),
                    point[0] * turn.sin() + point[1] * turn.cos(),
                ]
            } else {
                [point[0] + dx, point[1] + dy]
            });
        }
    }
    let polygon = |ring: usize| starts[ring]..starts[ring + 1];
    let mut constraints = Vec::new();
    for &ring in marked {
        let range = polygon(ring);
        for point in range.clone() {
            let next = if point + 1 == range.end { range.start } else { point + 1 };
            constraints.push([point, next]);
        }
    }
    let polygons: Vec<Vec<[f64; 2]>> = marked.iter().map(|&ring| points[polygon(ring)].to_vec()).collect();
    let mesh = triangulate(points, &constraints, family.minimum_angle())?;
    // Rings of a disk: inner, outer. Of an annulus: hole, inner, outer, rim.
    if let [hole, low, high, _] = &polygons[..] {
        let kept = inside(&mesh, |x, y| !encloses(hole, x, y));
        let cells = mesh.cells.iter().zip(&kept).filter(|(_, kept)| **kept);
        let mesh = compact(TriangleMesh {
            cells: cells.map(|(&cell, _)| cell).collect(),
            points: mesh.points,
        });
        let inside = inside(&mesh, |x, y| encloses(high, x, y) && !encloses(low, x, y));
        return Ok(Planar { mesh, inside });
    }
    let inner = &polygons[0];
    let inside = inside(&mesh, |x, y| encloses(inner, x, y));
    Ok(Planar { mesh, inside })
}

/// Leaves out the points that no cell names, which refinement may have put into a hole.
fn compact(mesh: TriangleMesh) -> TriangleMesh {
    let mut used = vec![false; mesh.points.len()];
    for &vertex in mesh.cells.iter().flatten() {
        used[vertex as usize] = true;
    }
    let mut name = vec![0u32; mesh.points.len()];
    let mut points = Vec::new();
    for (vertex, &point) in mesh.points.iter().enumerate() {
        if used[vertex] {
            name[vertex] = points.len() as u32;
            points.push(point);
        }
    }
    let cells = mesh
        .cells
        .iter()
        .map(|cell| cell.map(|vertex| name[vertex as usize]))
        .collect();
    TriangleMesh { points, cells }
}

/// Whether a polygon around the origin, counter-clockwise and star-shaped, encloses a point.
fn encloses(polygon: &[[f64; 2]], x: f64, y: f64) -> bool {
    let turn = |point: &[f64; 2]| point[1].atan2(point[0]).rem_euclid(TAU);
    let angle = y.atan2(x).rem_euclid(TAU);
    // The points follow each other by angle from their first one on.
    let first = turn(&polygon[0]);
    let after = |angle: f64| (angle - first).rem_euclid(TAU);
    let wanted = after(angle);
    let upper = polygon[1..].partition_point(|point| after(turn(point)) <= wanted) + 1;
    let (a, b) = (polygon[upper - 1], polygon[upper % polygon.len()]);
    (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) > 0.0
}
