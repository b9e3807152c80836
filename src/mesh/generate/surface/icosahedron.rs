//! Ellipsoids over the icosahedron: every triangle of its subdivision becomes three quadrilaterals, so that vertices have
//! valence 3 (centres), 4 (middles of edges), 5 (old vertices) and, from level 1 on, 6.

use super::analytic::Analytic;
use super::{AXES, GeneratedSurface, Parameter, SurfaceGenerator, normalized, on};
use crate::mesh::dot;
use crate::mesh::generate::Arguments;
use crate::mesh::quadrilateral::QuadrilateralMesh;

pub(super) const GENERATOR: SurfaceGenerator = SurfaceGenerator {
    name: "icosahedron",
    doc: "an ellipsoid over the subdivided icosahedron, three quadrilaterals a triangle: valences 3, 4, 5 and 6",
    parameters: &[
        Parameter {
            name: "level",
            whole: true,
            default: 1.0,
            min: 0.0,
            max: 8.0,
            doc: "how often the triangles are divided into four; the surface has 60 * 4^level quadrilaterals",
        },
        AXES[0],
        AXES[1],
        AXES[2],
    ],
    build,
};

/// The icosahedron with outward triangles.
fn icosahedron() -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points = Vec::with_capacity(12);
    for a in [-1.0, 1.0] {
        for b in [-golden, golden] {
            points.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
        }
    }
    let near = |a: usize, b: usize| {
        let difference = crate::mesh::subtract(points[a], points[b]);
        dot(difference, difference) < 4.5
    };
    let mut triangles = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let outward = dot(points[a], crate::mesh::cross(points[b], points[c])) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] }.map(|vertex| vertex as u32));
                }
            }
        }
    }
    (points.into_iter().map(normalized).collect(), triangles)
}

fn build(arguments: &Arguments) -> Result<GeneratedSurface, String> {
    let (mut points, mut triangles) = icosahedron();
    for _ in 0..arguments.number("level") as usize {
        let mut edges: Vec<[u32; 2]> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]))
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let old = points.len();
        for &[a, b] in &edges {
            let (a, b) = (points[a as usize], points[b as usize]);
            points.push(normalized(std::array::from_fn(|axis| a[axis] + b[axis])));
        }
        let middle = |a: u32, b: u32| (old + edges.partition_point(|edge| *edge < [a.min(b), a.max(b)])) as u32;
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let whole = QuadrilateralMesh {
        points,
        ..QuadrilateralMesh::default()
    };
    let split = whole.split(&triangles);
    let axes = arguments.axes();
    let points = split
        .points
        .into_iter()
        .map(normalized)
        .map(|point| std::array::from_fn(|axis| axes[axis] * point[axis]))
        .collect();
    Ok(on(Analytic::Ellipsoid { axes }, points, split.quads))
}
