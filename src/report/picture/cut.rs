//! What is seen of a mesh: its boundary faces, or what a plane leaves of them and the section through the cells.

use super::solid::Solid;
use crate::mesh::bounding_box;

/// A polygon to draw, of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    pub corners: Vec<[f64; 3]>,
    pub cell: u32,
    /// Whether the side from each corner to the next is drawn.
    pub sides: Vec<bool>,
    /// Lies in the cutting plane.
    pub section: bool,
}

/// Keeps the points with `normal . x <= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    pub normal: [f64; 3],
    pub offset: f64,
}

fn dot(left: [f64; 3], right: [f64; 3]) -> f64 {
    left[0] * right[0] + left[1] * right[1] + left[2] * right[2]
}

impl Plane {
    /// The plane through the middle of the points, square to the [axis](opened_along) that shows most; what is nearer to the
    /// eye goes.
    pub fn towards(eye: [f64; 3], points: &[[f64; 3]]) -> Plane {
        let axis = opened_along(eye, points);
        let [low, high] = bounding_box(points).unwrap_or_default();
        let mut normal = [0.0; 3];
        normal[axis] = eye[axis].signum();
        Plane {
            normal,
            offset: normal[axis] * 0.5 * (low[axis] + high[axis]),
        }
    }

    fn height(&self, point: [f64; 3]) -> f64 {
        dot(self.normal, point) - self.offset
    }
}

/// A body is flat when its shortest extent is less than this share of the next.
const FLAT: f64 = 0.5;

/// The axis square to which points are cut open: that which points most at the eye, or along which the body is flat, as a
/// plane across a flat body takes most of its outline away.
pub fn opened_along(eye: [f64; 3], points: &[[f64; 3]]) -> usize {
    let [low, high] = bounding_box(points).unwrap_or_default();
    let mut axes = [0, 1, 2];
    axes.sort_by(|&left, &right| (high[left] - low[left]).total_cmp(&(high[right] - low[right])));
    if high[axes[0]] - low[axes[0]] < FLAT * (high[axes[1]] - low[axes[1]]) {
        return axes[0];
    }
    axes.sort_by(|&left, &right| eye[right].abs().total_cmp(&eye[left].abs()));
    axes[0]
}

/// The faces of tetrahedra that belong to one cell only, with that cell.
pub fn boundary(tetrahedra: &[[u32; 4]]) -> Vec<([u32; 3], u32)> {
    let mut faces: Vec<([u32; 3], [u32; 3], u32)> = Vec::with_capacity(4 * tetrahedra.len());
    for (index, cell) in tetrahedra.iter().enumerate() {
        for face in [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]] {
            let corners = face.map(|corner: usize| cell[corner]);
            let mut key = corners;
            key.sort_unstable();
            faces.push((key, corners, index as u32));
        }
    }
    faces.sort_unstable();
    let mut boundary = Vec::new();
    let mut start = 0;
    while start < faces.len() {
        let end = start
            + faces[start..]
                .iter()
                .take_while(|face| face.0 == faces[start].0)
                .count();
        if end - start == 1 {
            boundary.push((faces[start].1, faces[start].2));
        }
        start = end;
    }
    boundary
}

/// Everything to draw of the mesh at these positions.
pub fn facets(solid: &Solid, points: &[[f64; 3]], plane: Option<&Plane>) -> Vec<Facet> {
    let faces: Vec<([u32; 3], u32)> = if solid.is_volume() {
        boundary(&solid.tetrahedra)
    } else {
        solid
            .triangles
            .iter()
            .zip(0..)
            .map(|(triangle, index)| (*triangle, index))
            .collect()
    };
    let at = |index: u32| points[index as usize];
    let mut facets: Vec<Facet> = Vec::with_capacity(faces.len());
    for (face, cell) in faces {
        let corners: Vec<[f64; 3]> = face.iter().map(|&corner| at(corner)).collect();
        let sides = [0, 1, 2].map(|side| solid.is_edge(face[side], face[(side + 1) % 3]));
        let (corners, sides) = match plane {
            Some(plane) => clip(&corners, &sides, plane),
            None => (corners, sides.to_vec()),
        };
        if corners.len() >= 3 {
            facets.push(Facet {
                corners,
                cell,
                sides,
                section: false,
            });
        }
    }
    let Some(plane) = plane else { return facets };
    for (tetrahedron, cell) in solid.tetrahedra.iter().zip(0..) {
        let corners = section(tetrahedron.map(at), plane);
        if corners.len() >= 3 {
            facets.push(Facet {
                // Where cells were split into tetrahedra, their inner faces are no edges of the section.
                sides: vec![solid.diagonals.is_empty(); corners.len()],
                corners,
                cell,
                section: true,
            });
        }
    }
    facets
}

fn between(from: [f64; 3], to: [f64; 3], share: f64) -> [f64; 3] {
    [0, 1, 2].map(|axis| from[axis] + share * (to[axis] - from[axis]))
}

/// What the plane leaves of a polygon, and which of its sides are drawn: those of the polygon, and the cut.
fn clip(corners: &[[f64; 3]], sides: &[bool], plane: &Plane) -> (Vec<[f64; 3]>, Vec<bool>) {
    let mut kept = Vec::with_capacity(4);
    let mut drawn = Vec::with_capacity(4);
    for (index, &corner) in corners.iter().enumerate() {
        let next = corners[(index + 1) % corners.len()];
        let (here, there) = (plane.height(corner), plane.height(next));
        if here <= 0.0 {
            kept.push(corner);
            drawn.push(sides[index]);
        }
        if (here <= 0.0) != (there <= 0.0) {
            kept.push(between(corner, next, here / (here - there)));
            // Going out, the cut follows; coming in, the rest of the side.
            drawn.push(here <= 0.0 || sides[index]);
        }
    }
    (kept, drawn)
}

/// The triangle or quadrilateral in which a plane meets a tetrahedron, corners in order around it.
fn section(corners: [[f64; 3]; 4], plane: &Plane) -> Vec<[f64; 3]> {
    let heights = corners.map(|corner| plane.height(corner));
    let below: Vec<usize> = (0..4).filter(|&corner| heights[corner] <= 0.0).collect();
    let above: Vec<usize> = (0..4).filter(|&corner| heights[corner] > 0.0).collect();
    let crossing = |from: usize, to: usize| {
        between(
            corners[from],
            corners[to],
            heights[from] / (heights[from] - heights[to]),
        )
    };
    match (below.as_slice(), above.as_slice()) {
        ([one], [a, b, c]) | ([a, b, c], [one]) => [a, b, c].map(|&other| crossing(*one, other)).to_vec(),
        ([a, b], [c, d]) => vec![crossing(*a, *c), crossing(*a, *d), crossing(*b, *d), crossing(*b, *c)],
        _ => Vec::new(),
    }
}
