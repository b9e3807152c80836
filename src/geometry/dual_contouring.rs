//! Quadrilaterals around a closed triangulated surface, by dual contouring of its signed distance.
//!
//! The sign at the centres of a grid's cubes tells which lie within (a manifold repair adds some, see
//! [`voxels`]); every pair of neighbours with different signs gives a quad, every corner of
//! the grid around which signs differ a vertex. Where a pair's segment meets the surface follows from the two
//! distances. The vertex is where the tangent planes at these places meet in the sense of least squares, pulled
//! towards their mean, and kept within its cube. Source: Ju, Losasso, Schaefer, Warren 2002, Dual contouring of
//! Hermite data.
//!
//! Guaranteed: quads form closed manifold surfaces, oriented outward, however the surface is shaped. Not guaranteed:
//! parts thinner than a cube, and handles or gaps narrower than one; that quads are convex.

use crate::geometry::closest_point::ClosestPoint;
use crate::linalg::vector3::{add, dot, subtract, times};
use crate::mesh::connectivity::{NONE, surface_topology};
use crate::mesh::template::voxels::voxels;
use crate::mesh::{TriangleMesh, bounding_box};
use nalgebra::{Matrix3, Vector3};

/// Weight of the pull towards the mean against the tangent planes.
const PULL: f64 = 0.05;

/// Points and quads around `surface`, with `along` cubes on the longest side of its box. `project` gives the nearest
/// point of the surface and a normal there, of any length.
///
/// # Errors
/// When the surface is open, not a manifold, or holds no cube.
pub fn dual_contour(
    surface: &TriangleMesh,
    nearest: &ClosestPoint,
    project: &dyn Fn([f64; 3]) -> ([f64; 3], [f64; 3]),
    along: usize,
) -> Result<(Vec<[f64; 3]>, Vec<[u32; 4]>), String> {
    let topology = surface_topology(&surface.cells, surface.points.len());
    if topology.boundary_edges > 0 {
        return Err(format!(
            "the surface is open: {} edges have one triangle; close its holes, since inside and outside must be known",
            topology.boundary_edges
        ));
    }
    if topology.crowded_edges > 0 {
        return Err(format!(
            "{} edges of the surface have three or more triangles, the first at triangle {} (from 0); remove the surplus",
            topology.crowded_edges, topology.first_crowded
        ));
    }
    let [low, high] = bounding_box(&surface.points).ok_or("the surface has no points")?;
    let size = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max) / along as f64;
    let cubes = voxels(surface, along)?;
    let boundary: Vec<[u32; 4]> = cubes.topology()?.boundary().map(|(_, face)| face.corners).collect();
    // The corners of the grid on the boundary, numbered as they come.
    let mut names = vec![NONE; cubes.points.len()];
    let mut corners: Vec<[f64; 3]> = Vec::new();
    let mut quads = boundary;
    for vertex in quads.iter_mut().flatten() {
        let name = &mut names[*vertex as usize];
        if *name == NONE {
            *name = corners.len() as u32;
            corners.push(cubes.points[*vertex as usize]);
        }
        *vertex = *name;
    }
    // For every corner: number of crossings, their sum, and the normal equations of the planes about the corner.
    let mut counts = vec![0.0f64; corners.len()];
    let mut sums = vec![[0.0; 3]; corners.len()];
    let mut matrices = vec![Matrix3::<f64>::zeros(); corners.len()];
    let mut right = vec![Vector3::<f64>::zeros(); corners.len()];
    for quad in &quads {
        let [a, b, c, d] = quad.map(|vertex| corners[vertex as usize]);
        let centre = times(add(add(a, b), add(c, d)), 0.25);
        let face = crate::linalg::vector3::cross(subtract(c, a), subtract(d, b));
        let step = times(face, 0.5 * size / dot(face, face).sqrt());
        let [inside, outside] = [subtract(centre, step), add(centre, step)]
            .map(|point| nearest.nearest(point, None).squared_distance.sqrt());
        let share = inside / (inside + outside).max(f64::MIN_POSITIVE);
        let (crossing, normal) = project(add(centre, times(step, 2.0 * share - 1.0)));
        let normal = times(normal, 1.0 / dot(normal, normal).sqrt().max(f64::MIN_POSITIVE));
        for vertex in quad.map(|vertex| vertex as usize) {
            let away = subtract(crossing, corners[vertex]);
            counts[vertex] += 1.0;
            sums[vertex] = add(sums[vertex], away);
            for row in 0..3 {
                for column in 0..3 {
                    matrices[vertex][(row, column)] += normal[row] * normal[column];
                }
                right[vertex][row] += normal[row] * dot(normal, away);
            }
        }
    }
    let points = (0..corners.len())
        .map(|vertex| {
            let mean = times(sums[vertex], 1.0 / counts[vertex]);
            let pull = PULL * counts[vertex];
            let matrix = matrices[vertex] + Matrix3::identity() * pull;
            let rhs = right[vertex] + Vector3::from(mean) * pull;
            let place = matrix.cholesky().map_or(mean, |factor| factor.solve(&rhs).into());
            let within: [f64; 3] = place.map(|component: f64| component.clamp(-0.5 * size, 0.5 * size));
            add(corners[vertex], within)
        })
        .collect();
    Ok((points, quads))
}
