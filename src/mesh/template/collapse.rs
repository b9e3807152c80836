//! Edge collapse: hexahedra become prisms, prisms become tetrahedra.

use super::within;
use crate::mesh::mixed::{MixedMesh, Shape};

/// Collapses every edge along `axis` whose middle lies in the box into its middle.
///
/// A hexahedron loses two opposite edges of a face and becomes a prism; a prism loses two upright edges and becomes a
/// tetrahedron.
///
/// # Errors
/// When no edge lies there, or a cell would become something else than these.
pub fn collapse(mesh: &MixedMesh, axis: usize, region: [[f64; 3]; 2]) -> Result<MixedMesh, String> {
    let mut target: Vec<u32> = (0..mesh.points.len() as u32).collect();
    let mut points = mesh.points.clone();
    let mut collapsed = 0;
    for (shape, corners) in mesh.iter() {
        for &[a, b] in shape.edges() {
            let (a, b) = (corners[a].min(corners[b]), corners[a].max(corners[b]));
            let (from, to) = (mesh.points[a as usize], mesh.points[b as usize]);
            let span: [f64; 3] = std::array::from_fn(|axis| (to[axis] - from[axis]).abs());
            let along = (0..3).all(|other| span[other] <= span[axis]) && span[axis] > 0.0;
            let middle = std::array::from_fn(|axis| 0.5 * (from[axis] + to[axis]));
            if along && within(middle, region) && target[b as usize] != a {
                if target[b as usize] != b || target[a as usize] != a {
                    return Err(format!(
                        "two collapsed edges meet at vertex {}; collapse them one after the other",
                        if target[a as usize] != a { a } else { b }
                    ));
                }
                target[b as usize] = a;
                points[a as usize] = middle;
                collapsed += 1;
            }
        }
    }
    if collapsed == 0 {
        return Err(format!(
            "no edge along axis {axis} has its middle between {:?} and {:?}, so there is nothing to collapse",
            region[0], region[1]
        ));
    }
    let mut result = MixedMesh {
        points,
        ..MixedMesh::default()
    };
    for (index, (shape, corners)) in mesh.iter().enumerate() {
        let merged: Vec<u32> = corners.iter().map(|&corner| target[corner as usize]).collect();
        let gone: Vec<[usize; 2]> = shape
            .edges()
            .iter()
            .copied()
            .filter(|&[a, b]| merged[a] == merged[b])
            .collect();
        match (shape, gone.len()) {
            (_, 0) => result.push(shape, &merged),
            (Shape::Hexahedron, 2) => match prism(&merged, gone[0], gone[1]) {
                Some(prism) => result.push(Shape::Prism, &prism),
                None => return Err(impossible(index, shape)),
            },
            (Shape::Prism, 2) if gone.iter().all(|[a, b]| a + 3 == *b) => {
                let kept = 3 - gone[0][0] - gone[1][0];
                let (p, q) = ((kept + 1) % 3, (kept + 2) % 3);
                result.push(
                    Shape::Tetrahedron,
                    &[merged[kept], merged[p], merged[q], merged[kept + 3]],
                );
            }
            _ => return Err(impossible(index, shape)),
        }
    }
    result.drop_unused_points();
    Ok(result)
}

fn impossible(cell: usize, shape: Shape) -> String {
    format!(
        "collapsing would turn {} {cell} into neither a prism nor a tetrahedron; collapse two opposite edges of one face \
         of a hexahedron, or two upright edges of a prism",
        shape.name()
    )
}

/// The prism left of a hexahedron without two opposite edges of a face; its triangles are the other faces at these edges.
fn prism(corners: &[u32], first: [usize; 2], second: [usize; 2]) -> Option<[u32; 6]> {
    let shape = Shape::Hexahedron;
    let face_of = |edge: [usize; 2], without: [usize; 2]| {
        shape
            .faces()
            .iter()
            .find(|face| edge.iter().all(|corner| face.contains(corner)) && !face.contains(&without[0]))
    };
    let both = shape
        .faces()
        .iter()
        .any(|face| first.iter().chain(&second).all(|corner| face.contains(corner)));
    let bottom = face_of(first, second)?;
    face_of(second, first)?;
    if !both {
        return None;
    }
    // Faces run counter-clockwise seen from outside; a prism's bottom the other way round.
    let mut below: Vec<usize> = bottom
        .iter()
        .rev()
        .copied()
        .filter(|&corner| corner != first[1])
        .collect();
    if below.len() != 3 {
        return None;
    }
    let above = |corner: usize| {
        shape
            .edges()
            .iter()
            .find_map(|&[a, b]| match (a == corner, b == corner) {
                (true, _) if !bottom.contains(&b) => Some(b),
                (_, true) if !bottom.contains(&a) => Some(a),
                _ => None,
            })
    };
    let top: Option<Vec<usize>> = below.iter().map(|&corner| above(corner)).collect();
    below.extend(top?);
    Some(std::array::from_fn(|place| corners[below[place]]))
}
