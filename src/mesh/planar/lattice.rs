//! Meshes over the lattice of the square `[-1, 1]^2`, which has the lines `|x| = 1/2`, `|y| = 1/2` and the axes.

use super::delaunay::triangulate;
use super::{Domain, Family, Planar, Random, split_at_centroids};
use crate::mesh::TriangleMesh;

pub(super) fn mesh(domain: Domain, family: Family, cells: usize, seed: u64) -> Result<TriangleMesh, String> {
    match family {
        Family::Regular | Family::UnionJack | Family::CrissCross => Ok(structured(family, cells)),
        Family::CentroidSplit => {
            let mesh = structured(Family::Regular, cells);
            let inside = vec![false; mesh.cells.len()];
            Ok(split_at_centroids(Planar { mesh, inside }).mesh)
        }
        Family::Equi => {
            let points = shifted_rows(domain, cells);
            let constraints = constraints(domain, &points);
            triangulate(points, &constraints, None)
        }
        Family::Perturbed | Family::MinimumAngle30 | Family::MinimumAngle1 => {
            let points = perturbed(domain, family.amplitude(), cells, seed);
            let constraints = constraints(domain, &points);
            triangulate(points, &constraints, family.minimum_angle())
        }
    }
}

/// Coordinate of a lattice line, exact on the lines that matter.
fn line(index: usize, cells: usize) -> f64 {
    index as f64 / cells as f64 - 1.0
}

fn structured(family: Family, cells: usize) -> TriangleMesh {
    let lines = 2 * cells + 1;
    let mut mesh = TriangleMesh::default();
    for i in 0..lines {
        for j in 0..lines {
            mesh.points.push([line(i, cells), line(j, cells), 0.0]);
        }
    }
    let name = |i: usize, j: usize| (i * lines + j) as u32;
    for i in 0..lines - 1 {
        for j in 0..lines - 1 {
            let [a, b, c, d] = [name(i, j), name(i + 1, j), name(i + 1, j + 1), name(i, j + 1)];
            match family {
                Family::CrissCross => {
                    let (low, high) = (mesh.points[a as usize], mesh.points[c as usize]);
                    let middle = mesh.points.len() as u32;
                    mesh.points
                        .push([(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, 0.0]);
                    mesh.cells
                        .extend([[a, b, middle], [b, c, middle], [c, d, middle], [d, a, middle]]);
                }
                Family::UnionJack if (i + j) % 2 == 1 => mesh.cells.extend([[a, b, d], [b, c, d]]),
                _ => mesh.cells.extend([[a, b, c], [a, c, d]]),
            }
        }
    }
    mesh
}

/// Rows of points, every second one shifted by half a cell but for the points on lines that must be edges.
fn shifted_rows(domain: Domain, cells: usize) -> Vec<[f64; 2]> {
    let lines = 2 * cells + 1;
    let half = 0.5 / cells as f64;
    let mut points = Vec::new();
    for j in 0..lines {
        let y = line(j, cells);
        let mut row: Vec<f64> = if j % 2 == 0 {
            (0..lines).map(|i| line(i, cells)).collect()
        } else {
            let shifted = (0..lines - 1).map(|i| line(i, cells) + half);
            let mut row = vec![-1.0, -0.5, 0.5, 1.0];
            if domain == Domain::LShape {
                row.push(0.0);
            }
            row.extend(shifted);
            row
        };
        row.sort_by(f64::total_cmp);
        points.extend(row.into_iter().map(|x| [x, y]));
    }
    points
}

/// Lattice points moved at random; those on a line that must be edges stay on it, corners stay where they are.
fn perturbed(domain: Domain, amplitude: f64, cells: usize, seed: u64) -> Vec<[f64; 2]> {
    let lines = 2 * cells + 1;
    let kept = |value: f64| value.abs() == 1.0 || value.abs() == 0.5;
    let middle = |value: f64| domain == Domain::LShape && value == 0.0;
    let mut random = Random::new(seed);
    let mut points = Vec::with_capacity(lines * lines);
    for i in 0..lines {
        for j in 0..lines {
            let (x, y) = (line(i, cells), line(j, cells));
            let (dx, dy) = (random.signed(), random.signed());
            let step = amplitude / cells as f64;
            let corner = (kept(x) || middle(x)) && (kept(y) || middle(y));
            let on_x = kept(x) || middle(x) || corner;
            let on_y = kept(y) || middle(y) || corner;
            points.push([
                if on_x { x } else { x + step * dx },
                if on_y { y } else { y + step * dy },
            ]);
        }
    }
    points
}

/// Pairs of neighbouring points along the outer and the inner boundary.
fn constraints(domain: Domain, points: &[[f64; 2]]) -> Vec<[usize; 2]> {
    // Axis that is constant, its value, and the interval of the other.
    let mut segments: Vec<(usize, f64, [f64; 2])> = Vec::new();
    for axis in 0..2 {
        for value in [-1.0, 1.0] {
            segments.push((axis, value, [-1.0, 1.0]));
        }
        segments.push((axis, -0.5, [-0.5, 0.5]));
        match domain {
            Domain::LShape => {
                segments.push((axis, 0.5, [-0.5, 0.0]));
                segments.push((axis, 0.0, [0.0, 0.5]));
            }
            _ => segments.push((axis, 0.5, [-0.5, 0.5])),
        }
    }
    let mut edges = Vec::new();
    for (axis, value, [low, high]) in segments {
        let other = 1 - axis;
        let mut on: Vec<usize> = (0..points.len())
            .filter(|&point| points[point][axis] == value && (low..=high).contains(&points[point][other]))
            .collect();
        on.sort_by(|&a, &b| points[a][other].total_cmp(&points[b][other]));
        edges.extend(on.windows(2).map(|pair| [pair[0], pair[1]]));
    }
    edges
}
