//! Tangents and curvatures at the boundary of a domain on a surface, from each of its two sides, and how they differ.
//!
//! At a boundary vertex a quadratic height function over the tangent plane is fitted to the vertices of one side, two
//! rings deep. It passes through the vertex. The two sides' normals and their normal curvatures across the seam then
//! compare: their differences measure how far the surface is from C1 and C2 there, up to the error of the fits, which
//! falls with the edge length.

use super::domain::Domain;
use crate::mesh::{area_vector, cross, dot, length, subtract};
use nalgebra::{SMatrix, SVector};

/// First and second derivatives of one side of a surface at a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    pub normal: [f64; 3],
    axes: [[f64; 3]; 2],
    slope: [f64; 2],
    second: [f64; 3],
}

impl Fit {
    /// Normal curvature along a tangent direction, positive towards the normal.
    pub fn curvature(&self, direction: [f64; 3]) -> f64 {
        let [x, y] = self.axes.map(|axis| dot(axis, direction));
        let [a, b] = self.slope;
        let first = (1.0 + a * a) * x * x + 2.0 * a * b * x * y + (1.0 + b * b) * y * y;
        let second = self.second[0] * x * x + 2.0 * self.second[1] * x * y + self.second[2] * y * y;
        second / (1.0 + a * a + b * b).sqrt() / first
    }
}

/// The triangles around every vertex.
pub struct Sides<'a> {
    domain: &'a Domain<'a>,
    around: crate::mesh::connectivity::Rows,
}

impl<'a> Sides<'a> {
    pub fn new(domain: &'a Domain<'a>) -> Self {
        Self {
            domain,
            around: crate::mesh::connectivity::incidence(&domain.mesh.cells, domain.places.len()),
        }
    }

    /// Whether a vertex has triangles on the given side.
    pub fn has(&self, vertex: u32, inside: bool) -> bool {
        let mut cells = self.around.row(vertex as usize).iter();
        cells.any(|&cell| self.domain.inside[cell as usize] == inside)
    }

    /// Fits one side of the surface with the given places; `None` where it has too few vertices.
    pub fn fit(&self, places: &[[f64; 3]], vertex: u32, inside: bool) -> Option<Fit> {
        let mesh = self.domain.mesh;
        let at = places[vertex as usize];
        let on_side = |vertex: u32| {
            self.around
                .row(vertex as usize)
                .iter()
                .copied()
                .filter(|&cell| self.domain.inside[cell as usize] == inside)
        };
        let mut normal = [0.0; 3];
        for cell in on_side(vertex) {
            let part = area_vector(mesh.cells[cell as usize].map(|corner| places[corner as usize]));
            (0..3).for_each(|axis| normal[axis] += part[axis]);
        }
        let mut near = vec![vertex];
        let mut start = 0;
        for ring in 0..4 {
            let end = near.len();
            for index in start..end {
                for cell in on_side(near[index]) {
                    for corner in mesh.cells[cell as usize] {
                        if !near.contains(&corner) {
                            near.push(corner);
                        }
                    }
                }
            }
            start = end;
            if ring > 0 && near.len() > 8 {
                break;
            }
        }
        let mut fit = None;
        // The second round starts from the normal of the first.
        for _ in 0..2 {
            fit = quadratic(places, at, &near[1..], normal);
            normal = fit?.normal;
        }
        fit
    }
}

fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let size = length(vector);
    (size > 0.0).then(|| vector.map(|component| component / size))
}

/// Least squares for the height over the plane across `normal`.
fn quadratic(places: &[[f64; 3]], at: [f64; 3], near: &[u32], normal: [f64; 3]) -> Option<Fit> {
    let normal = unit(normal)?;
    let least = (0..3).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()))?;
    let mut other = [0.0; 3];
    other[least] = 1.0;
    let first = unit(cross(normal, other))?;
    let axes = [first, cross(normal, first)];
    let scale = near
        .iter()
        .map(|&vertex| length(subtract(places[vertex as usize], at)))
        .fold(0.0, f64::max);
    if !(scale > 0.0) || near.len() < 5 {
        return None;
    }
    let mut matrix = SMatrix::<f64, 5, 5>::zeros();
    let mut right = SVector::<f64, 5>::zeros();
    for &vertex in near {
        let offset = subtract(places[vertex as usize], at).map(|component| component / scale);
        let [x, y] = axes.map(|axis| dot(axis, offset));
        let row = SVector::<f64, 5>::from([x, y, 0.5 * x * x, x * y, 0.5 * y * y]);
        matrix += row * row.transpose();
        right += row * dot(normal, offset);
    }
    let decomposition = matrix.symmetric_eigen();
    let largest = decomposition.eigenvalues.max();
    if !(decomposition.eigenvalues.min() > 1e-10 * largest) {
        return None;
    }
    let solution = decomposition.recompose().cholesky()?.solve(&right);
    let [a, b] = [solution[0], solution[1]];
    let fitted: [f64; 3] = std::array::from_fn(|axis| normal[axis] - a * axes[0][axis] - b * axes[1][axis]);
    Some(Fit {
        normal: unit(fitted)?,
        axes,
        slope: [a, b],
        second: [solution[2] / scale, solution[3] / scale, solution[4] / scale],
    })
}

/// How two sides differ along a seam.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jumps {
    /// Angles between normals, in degrees.
    pub tangent_max: f64,
    pub tangent_mean: f64,
    /// Differences of normal curvatures across the seam, in one over length.
    pub curvature_max: f64,
    pub curvature_mean: f64,
    /// Vertices that were measured.
    pub vertices: usize,
}

/// Measures the seam of a surface with the given places; `beyond` gives the other side at a vertex, as normal and normal
/// curvature along a direction across the seam.
pub fn jumps(
    sides: &Sides<'_>,
    places: &[[f64; 3]],
    beyond: impl Fn(u32, [f64; 3]) -> Option<([f64; 3], f64)>,
) -> Jumps {
    let mut jumps = Jumps::default();
    let mut seen = vec![false; places.len()];
    for edge in &sides.domain.edges {
        let [vertex, next] = edge.vertices;
        if std::mem::replace(&mut seen[vertex as usize], true) {
            continue;
        }
        let Some(own) = sides.fit(places, vertex, true) else {
            continue;
        };
        let along = subtract(places[next as usize], places[vertex as usize]);
        let across = cross(along, own.normal);
        let Some((normal, curvature)) = beyond(vertex, across) else {
            continue;
        };
        let angle = length(cross(own.normal, normal))
            .atan2(dot(own.normal, normal))
            .to_degrees();
        let difference = (own.curvature(across) - curvature).abs();
        jumps.tangent_max = jumps.tangent_max.max(angle);
        jumps.curvature_max = jumps.curvature_max.max(difference);
        jumps.tangent_mean += angle;
        jumps.curvature_mean += difference;
        jumps.vertices += 1;
    }
    let count = jumps.vertices.max(1) as f64;
    jumps.tangent_mean /= count;
    jumps.curvature_mean /= count;
    jumps
}
