//! Shape quality of tetrahedra and triangles: scaled Jacobian, dihedral angles, edge lengths.
//!
//! The scaled Jacobian of a tetrahedron is the smallest over its corners of `sqrt(2) det / (|e1| |e2| |e3|)`, where `e1`,
//! `e2`, `e3` are the edges at the corner (Knupp, "Algebraic mesh quality metrics", 2001): 1 for the regular
//! tetrahedron, 0 for a flat one, negative for an inverted one.

use super::connectivity::{TETRAHEDRON_EDGES, TETRAHEDRON_FACETS};
use super::{Mesh, TetrahedralMesh, TriangleMesh, area_vector, determinant, dot, length, subtract};
use std::f64::consts::SQRT_2;

/// Scaled Jacobian of one tetrahedron; zero when a vertex is repeated.
pub fn scaled_jacobian(corners: [[f64; 3]; 4]) -> f64 {
    let edge = |a: usize, b: usize| length(subtract(corners[a], corners[b]));
    let [ab, ac, ad, bc, bd, cd] = TETRAHEDRON_EDGES.map(|[a, b]| edge(a, b));
    let largest = (ab * ac * ad).max(ab * bc * bd).max(ac * bc * cd).max(ad * bd * cd);
    if largest > 0.0 {
        SQRT_2 * determinant(corners) / largest
    } else {
        0.0
    }
}

/// The six dihedral angles in degrees, in the order of [`TETRAHEDRON_EDGES`]; not-a-number where a face has no area.
pub fn dihedral_angles(corners: [[f64; 3]; 4]) -> [f64; 6] {
    let normals = TETRAHEDRON_FACETS.map(|facet| area_vector(facet.map(|corner| corners[corner])));
    TETRAHEDRON_EDGES.map(|[a, b]| {
        // The faces at edge (a, b) are those opposite the two other vertices.
        let mut others = (0..4).filter(|&corner| corner != a && corner != b);
        let (Some(i), Some(j)) = (others.next(), others.next()) else {
            return f64::NAN;
        };
        let cosine = dot(normals[i], normals[j]) / (length(normals[i]) * length(normals[j]));
        180.0 - cosine.clamp(-1.0, 1.0).acos().to_degrees()
    })
}

/// Smallest, mean and largest of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    pub min: f64,
    pub mean: f64,
    pub max: f64,
}

impl Spread {
    /// Over all values that are numbers; `None` without any.
    pub fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (mut spread, mut count) = (
            Self {
                min: f64::INFINITY,
                mean: 0.0,
                max: f64::NEG_INFINITY,
            },
            0usize,
        );
        for value in values.filter(|value| !value.is_nan()) {
            spread.min = spread.min.min(value);
            spread.max = spread.max.max(value);
            spread.mean += value;
            count += 1;
        }
        spread.mean /= count as f64;
        (count > 0).then_some(spread)
    }
}

/// Lengths of the edges, each counted once.
pub fn edge_lengths<const N: usize>(mesh: &Mesh<N>) -> Option<Spread> {
    let edges = super::connectivity::edges(&mesh.cells, mesh.points.len());
    Spread::of(edges.iter().map(|edge| {
        let [a, b] = edge.map(|vertex| mesh.points[vertex as usize]);
        length(subtract(a, b))
    }))
}

/// Scaled Jacobians of all tetrahedra.
pub fn scaled_jacobians(mesh: &TetrahedralMesh) -> Option<Spread> {
    Spread::of(mesh.cells.iter().map(|&cell| scaled_jacobian(mesh.corners(cell))))
}

/// All dihedral angles, in degrees.
pub fn all_dihedral_angles(mesh: &TetrahedralMesh) -> Option<Spread> {
    Spread::of(mesh.cells.iter().flat_map(|&cell| dihedral_angles(mesh.corners(cell))))
}

/// All angles of all triangles, in degrees; not-a-number where an edge has no length.
pub fn triangle_angles(mesh: &TriangleMesh) -> Option<Spread> {
    Spread::of(mesh.cells.iter().flat_map(|&cell| {
        let corners = mesh.corners(cell);
        (0..3).map(move |i| {
            let a = subtract(corners[(i + 1) % 3], corners[i]);
            let b = subtract(corners[(i + 2) % 3], corners[i]);
            (dot(a, b) / (length(a) * length(b)))
                .clamp(-1.0, 1.0)
                .acos()
                .to_degrees()
        })
    }))
}
