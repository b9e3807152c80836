//! Conditions and errors of a function of the plane.

use super::domain::{Domain, Place};
use super::function::Function;
use super::scheme::{Data, Taylor};
use crate::fem::triangle_rule::DEGREE_4;
use crate::mesh::{area_vector, cross, dot, length, subtract};

fn plane(point: [f64; 3]) -> [f64; 2] {
    [point[0], point[1]]
}

/// The derivatives of a function that a Taylor expansion needs.
pub struct Derivatives {
    gradient: Box<dyn Fn([f64; 2]) -> [f64; 2]>,
    hessian: Box<dyn Fn([f64; 2]) -> [f64; 3]>,
}

impl Derivatives {
    pub fn of(function: &'static Function) -> Self {
        Self {
            gradient: Box::new(|point| function.gradient(point)),
            hessian: Box::new(|point| function.hessian(point)),
        }
    }
}

/// Samples the conditions and the right-hand side of `Laplacian^order u = g`.
pub fn sample<'a>(domain: &Domain<'_>, function: &Function, derivatives: &'a Derivatives, order: usize) -> Data<'a> {
    let points = &domain.mesh.points;
    let conormal = domain
        .edges
        .iter()
        .flat_map(|edge| {
            edge.vertices.map(|vertex| {
                let gradient = function.gradient(plane(points[vertex as usize]));
                gradient[0] * edge.conormal[0] + gradient[1] * edge.conormal[1]
            })
        })
        .collect();
    let at = |times: u32| {
        points
            .iter()
            .map(|&point| function.laplacian(plane(point), times))
            .collect()
    };
    Data {
        components: 1,
        values: points.iter().map(|&point| function.value(plane(point))).collect(),
        source: at(order as u32),
        conormal,
        laplacian: at(1),
        taylor: Some(Taylor {
            gradient: &*derivatives.gradient,
            hessian: &*derivatives.hessian,
        }),
    }
}

/// Differences to the function over the domain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    pub l2: f64,
    pub h1: f64,
    pub max: f64,
}

/// Measures a piecewise linear function.
pub fn errors(domain: &Domain<'_>, function: &Function, values: &[f64]) -> Errors {
    let mesh = domain.mesh;
    let mut errors = Errors::default();
    for (&cell, _) in mesh.cells.iter().zip(&domain.inside).filter(|(_, inside)| **inside) {
        let corners = mesh.corners(cell);
        let normal = area_vector(corners);
        let doubled = length(normal);
        let nodal = cell.map(|vertex| values[vertex as usize]);
        let mut gradient = [0.0; 3];
        for corner in 0..3 {
            let opposite = subtract(corners[(corner + 2) % 3], corners[(corner + 1) % 3]);
            let turned = cross(normal, opposite);
            for axis in 0..3 {
                gradient[axis] += nodal[corner] * turned[axis] / dot(normal, normal);
            }
        }
        for (weight, barycentric) in DEGREE_4 {
            let sum = |of: &dyn Fn(usize) -> f64| (0..3).map(|corner| barycentric[corner] * of(corner)).sum::<f64>();
            let point = [sum(&|corner| corners[corner][0]), sum(&|corner| corners[corner][1])];
            let value = sum(&|corner| nodal[corner]) - function.value(point);
            let exact = function.gradient(point);
            let slope = [gradient[0] - exact[0], gradient[1] - exact[1]];
            errors.l2 += weight * doubled / 2.0 * value * value;
            errors.h1 += weight * doubled / 2.0 * (slope[0] * slope[0] + slope[1] * slope[1]);
        }
    }
    errors.l2 = errors.l2.sqrt();
    errors.h1 = errors.h1.sqrt();
    for (vertex, &place) in domain.places.iter().enumerate() {
        if matches!(place, Place::Interior | Place::Boundary) {
            let difference = (values[vertex] - function.value(plane(mesh.points[vertex]))).abs();
            errors.max = if difference.is_nan() {
                f64::NAN
            } else {
                errors.max.max(difference)
            };
        }
    }
    errors
}
