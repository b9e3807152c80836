//! Conditions on a surface in space: places, conormal derivatives and Laplacians on the boundary of a domain.
//!
//! The surface beyond the curve gives tangents and curvatures, by the fits of [`super::seam`]; where there is none, the
//! surface as it is takes its place. With the unit conormal `c` away from the domain, the unit normal `N`, the normal
//! curvature `k` along `c`, and the arc length `s` along the curve,
//! `du/dn = speed scale (cos(angle) c + sin(angle) N)` and
//! `Laplacian u = d2u/ds2 + k_g du/dn + speed^2 (scale k + offset) N`, where `k_g` is the curvature of the boundary
//! within the domain. The speed is 1 unless the surface is mapped from a domain of another shape.

use super::domain::{Domain, Place};
use super::seam::Sides;
use super::settings::Settings;
use crate::mesh::{area_vector, cross, dot, length, subtract};

/// Boundary vertices whose angle differs by more than this from a straight one count as corners, in radians.
const CORNER: f64 = std::f64::consts::FRAC_PI_4;

/// What is prescribed, and for the boundary vertices what the surface beyond is to look like.
#[derive(Clone, Debug, Default)]
pub struct Prescribed {
    /// Three numbers for each end of every boundary edge.
    pub conormal: Vec<f64>,
    /// Three numbers a vertex.
    pub laplacian: Vec<f64>,
    /// Unit normal and normal curvature across, for every boundary vertex where they could be found.
    pub beyond: Vec<Option<([f64; 3], f64)>>,
}

fn scaled(vector: [f64; 3], factor: f64) -> [f64; 3] {
    vector.map(|component| component * factor)
}

fn sum(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

fn unit(vector: [f64; 3]) -> [f64; 3] {
    let size = length(vector);
    if size > 0.0 { scaled(vector, 1.0 / size) } else { vector }
}

/// Prescribes tangents and curvatures for a surface with the given places. `mapped` says that the places are not those of
/// the mesh. With `change` only the change against angle 0, scales 1 and offset 0 is prescribed, as displacements need
/// it.
pub fn prescribe(
    domain: &Domain<'_>,
    sides: &Sides<'_>,
    places: &[[f64; 3]],
    mapped: bool,
    change: bool,
    settings: &Settings,
) -> Prescribed {
    let vertices = domain.places.len();
    let angle = settings.tangents.angle.to_radians();
    let (sine, cosine) = (angle.sin(), angle.cos());
    let base = f64::from(u8::from(change));
    let mut found = Prescribed {
        conormal: Vec::with_capacity(6 * domain.edges.len()),
        laplacian: vec![0.0; 3 * vertices],
        beyond: vec![None; vertices],
    };
    // Sums over the two edges at a boundary vertex.
    let mut slope = vec![[0.0; 3]; vertices];
    let mut outwards = vec![[0.0; 3]; vertices];
    let mut speeds = vec![0.0; vertices];
    let mut second = vec![[0.0; 3]; vertices];
    let mut reach = vec![0.0; vertices];
    let mut count = vec![0.0; vertices];
    let fits: Vec<_> = (0..vertices as u32)
        .map(|vertex| {
            (domain.places[vertex as usize] == Place::Boundary)
                .then(|| sides.fit(places, vertex, !sides.has(vertex, false)))
                .flatten()
        })
        .collect();
    for edge in &domain.edges {
        let [a, b] = edge.vertices.map(|vertex| vertex as usize);
        let cell = domain.mesh.cells[edge.triangle as usize];
        let along = unit(subtract(places[b], places[a]));
        let flat = unit(area_vector(cell.map(|vertex| places[vertex as usize])));
        let speed = if mapped {
            speed(domain, edge.triangle, edge.vertices, places)
        } else {
            1.0
        };
        for end in [a, b] {
            let normal = fits[end].map_or(flat, |fit| fit.normal);
            let across = unit(cross(along, normal));
            let turned = sum(scaled(across, cosine), scaled(normal, sine));
            let derivative = sum(
                scaled(turned, speed * settings.tangents.scale),
                scaled(across, -base * speed),
            );
            found.conormal.extend(derivative);
            slope[end] = sum(slope[end], derivative);
            outwards[end] = sum(outwards[end], turned);
            speeds[end] += speed;
            count[end] += 1.0;
        }
        let step = scaled(subtract(places[b], places[a]), 1.0 / edge.length);
        second[a] = sum(second[a], step);
        second[b] = sum(second[b], scaled(step, -1.0));
        reach[a] += 0.5 * edge.length;
        reach[b] += 0.5 * edge.length;
    }
    let mut angles = vec![0.0; vertices];
    for (&cell, _) in domain
        .mesh
        .cells
        .iter()
        .zip(&domain.inside)
        .filter(|(_, inside)| **inside)
    {
        let corners = domain.mesh.corners(cell);
        for i in 0..3 {
            let sides = [1, 2].map(|step| subtract(corners[(i + step) % 3], corners[i]));
            angles[cell[i] as usize] += length(cross(sides[0], sides[1])).atan2(dot(sides[0], sides[1]));
        }
    }
    for vertex in (0..vertices).filter(|&vertex| count[vertex] > 0.0) {
        let Some(fit) = fits[vertex] else { continue };
        let turn = std::f64::consts::PI - angles[vertex];
        let geodesic = if turn.abs() < CORNER { turn / reach[vertex] } else { 0.0 };
        let direction = unit(outwards[vertex]);
        let straight = unit(sum(direction, scaled(fit.normal, -dot(direction, fit.normal))));
        let across = fit.curvature(straight);
        let speed = speeds[vertex] / count[vertex];
        let bend = settings.curvature.scale * across + settings.curvature.offset;
        let along = scaled(second[vertex], (1.0 - base) / reach[vertex]);
        let value = sum(
            sum(along, scaled(slope[vertex], geodesic / count[vertex])),
            scaled(fit.normal, speed * speed * (bend - base * across)),
        );
        found.laplacian[3 * vertex..3 * vertex + 3].copy_from_slice(&value);
        // The tangent turned about the curve turns the normal with it.
        let normal = sum(scaled(fit.normal, cosine), scaled(straight, -sine));
        let normal = if settings.tangents.scale < 0.0 {
            scaled(normal, -1.0)
        } else {
            normal
        };
        found.beyond[vertex] = Some((unit(normal), bend));
    }
    found
}

/// The length of the derivative along the conormal of the map from a triangle of the mesh to the given places.
fn speed(domain: &Domain<'_>, triangle: u32, [a, b]: [u32; 2], places: &[[f64; 3]]) -> f64 {
    let cell = domain.mesh.cells[triangle as usize];
    let Some(opposite) = cell.into_iter().find(|&vertex| vertex != a && vertex != b) else {
        return 1.0;
    };
    let point = |vertex: u32| domain.mesh.points[vertex as usize];
    let along = subtract(point(b), point(a));
    let inwards = subtract(point(opposite), point(a));
    let share = dot(inwards, along) / dot(along, along);
    let height = length(subtract(inwards, scaled(along, share)));
    let place = |vertex: u32| places[vertex as usize];
    let foot = sum(place(a), scaled(subtract(place(b), place(a)), share));
    // Across the image of the edge only.
    let direction = unit(subtract(place(b), place(a)));
    let image = subtract(foot, place(opposite));
    length(subtract(image, scaled(direction, dot(image, direction)))) / height
}
