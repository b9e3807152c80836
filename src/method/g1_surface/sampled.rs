//! A triangulated surface on which the vertices of a quadrilateral mesh lie: nearest points, normals, and quads by
//! rays or by dual contouring.

use crate::geometry::closest_point::ClosestPoint;
use crate::geometry::dual_contouring::dual_contour;
use crate::geometry::ray::Rays;
use crate::linalg::vector3::{add, cross, dot, subtract, times};
use crate::mesh::generate::surface::cubed_sphere;
use crate::mesh::quadrilateral::{Connectivity, QuadrilateralMesh};
use crate::mesh::{TriangleMesh, area_vector, length};
use crate::optimize::Observer;
use rayon::prelude::*;
use std::sync::Arc;

/// More cubes than these are not contoured: they would take gigabytes.
const MOST_CUBES: f64 = 4e7;

/// See the module.
#[derive(Clone)]
pub struct Sampled {
    pub surface: Arc<TriangleMesh>,
    nearest: Arc<ClosestPoint>,
    /// A normal for every vertex: those of its triangles, weighted by their angles.
    normals: Arc<Vec<[f64; 3]>>,
}

impl Sampled {
    pub fn new(surface: TriangleMesh) -> Self {
        let mut normals = vec![[0.0; 3]; surface.points.len()];
        for &cell in &surface.cells {
            let corners = surface.corners(cell);
            let area = area_vector(corners);
            let unit = times(area, 1.0 / length(area).max(f64::MIN_POSITIVE));
            for corner in 0..3 {
                let a = subtract(corners[(corner + 1) % 3], corners[corner]);
                let b = subtract(corners[(corner + 2) % 3], corners[corner]);
                let angle = length(cross(a, b)).atan2(dot(a, b));
                let place = &mut normals[cell[corner] as usize];
                *place = add(*place, times(unit, angle));
            }
        }
        Self {
            nearest: Arc::new(ClosestPoint::new(&surface)),
            surface: Arc::new(surface),
            normals: Arc::new(normals),
        }
    }

    /// The distance of a point.
    pub fn distance(&self, point: [f64; 3]) -> f64 {
        self.nearest.nearest(point, None).squared_distance.sqrt()
    }

    /// The nearest point, and the normal there, interpolated over the triangle; not of length 1.
    pub fn project(&self, point: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let triangle = self.nearest.nearest(point, None).triangle;
        let foot = self.nearest.foot(triangle, point);
        let cell = self.surface.cells[triangle as usize];
        let corners = self.surface.corners(cell);
        let area = area_vector(corners);
        let square = dot(area, area).max(f64::MIN_POSITIVE);
        let mut normal = [0.0; 3];
        for corner in 0..3 {
            let (a, b) = (corners[(corner + 1) % 3], corners[(corner + 2) % 3]);
            let weight = dot(cross(subtract(a, foot), subtract(b, foot)), area) / square;
            let share = self.normals[cell[corner] as usize];
            normal = add(normal, times(share, weight / length(share).max(f64::MIN_POSITIVE)));
        }
        (foot, normal)
    }

    /// The subdivided cube shot along rays from the centre of the surface's box onto the last triangle that each hits,
    /// then [smoothed](Self::smoothed).
    ///
    /// # Errors
    /// Where a ray hits nothing.
    pub fn by_rays(
        &self,
        cells: usize,
        smoothing: usize,
        observer: &dyn Observer,
    ) -> Result<QuadrilateralMesh, String> {
        let (directions, quads) = cubed_sphere::directions(cells);
        let Some([low, high]) = crate::mesh::bounding_box(&self.surface.points) else {
            return Err("the surface has no points".to_string());
        };
        let centre = times(add(low, high), 0.5);
        let rays = Rays::new(&self.surface);
        let mut points = Vec::with_capacity(directions.len());
        for direction in directions {
            let hits = rays.hits(centre, direction);
            let Some(hit) = hits.last() else {
                return Err(format!(
                    "the ray from the centre of the box in direction {direction:?} meets no triangle; the surface \
                     must be closed around its centre"
                ));
            };
            points.push(add(centre, times(direction, hit.distance)));
        }
        self.smoothed(points, quads, smoothing, observer)
    }

    /// Quads around the surface by dual contouring of its signed distance, `cells` cubes along the longest side of its
    /// box, moved onto it and [smoothed](Self::smoothed).
    ///
    /// # Errors
    /// Where the surface is open, or too thin for the cubes.
    pub fn by_dual_contouring(
        &self,
        cells: usize,
        smoothing: usize,
        observer: &dyn Observer,
    ) -> Result<QuadrilateralMesh, String> {
        let Some([low, high]) = crate::mesh::bounding_box(&self.surface.points) else {
            return Err("the surface has no points".to_string());
        };
        let extent = subtract(high, low);
        let longest = extent.into_iter().fold(0.0, f64::max);
        let cubes: f64 = extent
            .iter()
            .map(|side| (cells as f64 * side / longest).ceil().max(1.0))
            .product();
        if !(cubes <= MOST_CUBES) {
            return Err(format!(
                "cells = {cells} asks for {cubes:.0} cubes in the box of the surface, more than the {MOST_CUBES:.0} that are \
                 made; use fewer cells"
            ));
        }
        let project = |point| self.project(point);
        let (points, quads) = dual_contour(&self.surface, &self.nearest, &project, cells)?;
        self.smoothed(points, quads, smoothing, observer)
    }

    /// Every vertex moves halfway to the mean of its neighbours and back onto the surface, `rounds` times, in the end
    /// onto the surface in any case. Normals are those of the surface.
    fn smoothed(
        &self,
        mut points: Vec<[f64; 3]>,
        quads: Vec<[u32; 4]>,
        rounds: usize,
        observer: &dyn Observer,
    ) -> Result<QuadrilateralMesh, String> {
        let connectivity = Connectivity::of(&quads, points.len())
            .map_err(|defects| format!("the quadrilaterals form no surface: {defects:?}; use more or fewer cells"))?;
        for _ in 0..rounds {
            if observer.stop().is_some() {
                return Err("stopped from outside while the quadrilaterals were smoothed".to_string());
            }
            let before = points.clone();
            points.par_iter_mut().enumerate().for_each(|(vertex, point)| {
                let mut sum = [0.0; 3];
                let mut count = 0.0;
                for edge in connectivity.spokes(vertex) {
                    sum = add(sum, before[connectivity.other_end(edge, vertex as u32) as usize]);
                    count += 1.0;
                }
                let target = times(add(before[vertex], times(sum, 1.0 / count)), 0.5);
                *point = self.project(target).0;
            });
        }
        let on: Vec<([f64; 3], [f64; 3])> = points.par_iter().map(|&point| self.project(point)).collect();
        Ok(QuadrilateralMesh {
            points: on.iter().map(|(point, _)| *point).collect(),
            quads,
            normals: Some(on.into_iter().map(|(_, normal)| normal).collect()),
        })
    }
}

impl std::fmt::Debug for Sampled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "a surface of {} triangles", self.surface.cells.len())
    }
}
