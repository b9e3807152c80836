//! A closed surface of genus 0 laid onto a convex polyhedron, one to one.
//!
//! The polyhedron's corners become the surface's vertices nearest to the corners of its bounding box, its edges become
//! shortest paths along mesh edges that do not cross, and each patch between them is embedded onto its flat side by
//! a harmonic map.
//!
//! Guarantees: when it succeeds, every triangle has positive area on its side, and the map is one to one. Does not
//! guarantee: success, since the mesh edges may leave no room for the paths; low distortion, since long limbs shrink on
//! their way to a flat side.

use super::harmonic::embed;
use super::layout::{Layout, Sheet, corner_vertices};
use crate::mesh::connectivity;
use crate::mesh::{length, subtract};

/// A convex polyhedron around the origin.
#[derive(Debug)]
pub struct Polyhedron {
    /// With its article.
    pub name: &'static str,
    pub corners: &'static [[f64; 3]],
    /// Corners of each side, counter-clockwise seen from outside.
    pub sides: &'static [&'static [usize]],
}

/// The cube `[-1, 1]^3`; corner `x + 2 y + 4 z` with bits for the signs.
pub const CUBE: Polyhedron = Polyhedron {
    name: "a cube",
    corners: &[
        [-1.0, -1.0, -1.0],
        [1.0, -1.0, -1.0],
        [-1.0, 1.0, -1.0],
        [1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0],
        [1.0, -1.0, 1.0],
        [-1.0, 1.0, 1.0],
        [1.0, 1.0, 1.0],
    ],
    sides: &[
        &[0, 4, 6, 2],
        &[1, 3, 7, 5],
        &[0, 1, 5, 4],
        &[2, 6, 7, 3],
        &[0, 2, 3, 1],
        &[4, 5, 7, 6],
    ],
};

/// The octahedron with corners at distance 1 on the axes.
pub const OCTAHEDRON: Polyhedron = Polyhedron {
    name: "an octahedron",
    corners: &[
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ],
    sides: &[
        &[0, 2, 4],
        &[2, 1, 4],
        &[1, 3, 4],
        &[3, 0, 4],
        &[2, 0, 5],
        &[1, 2, 5],
        &[3, 1, 5],
        &[0, 3, 5],
    ],
};

/// The regular tetrahedron in the cube `[-1, 1]^3`.
pub const TETRAHEDRON: Polyhedron = Polyhedron {
    name: "a tetrahedron",
    corners: &[[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]],
    sides: &[&[0, 1, 2], &[0, 2, 3], &[0, 3, 1], &[1, 3, 2]],
};

impl Polyhedron {
    /// The neighbours of a corner, counter-clockwise seen from outside.
    pub(super) fn rotation(&self, corner: usize) -> Vec<usize> {
        // A side lies between the edge to its next corner and, counter-clockwise, the edge to its previous one.
        let step = |from: Option<usize>| {
            self.sides.iter().find_map(|side| {
                let at = side.iter().position(|&c| c == corner)?;
                let (next, previous) = (side[(at + 1) % side.len()], side[(at + side.len() - 1) % side.len()]);
                (from.is_none_or(|from| from == next)).then_some(if from.is_none() { next } else { previous })
            })
        };
        let mut ring: Vec<usize> = Vec::new();
        let mut last = None;
        while let Some(next) = step(last) {
            if ring.contains(&next) {
                break;
            }
            ring.push(next);
            last = Some(next);
        }
        ring
    }

    /// Every edge once, as a pair of corners, smaller first.
    pub(super) fn edges(&self) -> Vec<[usize; 2]> {
        let pairs = self.sides.iter().flat_map(|side| {
            (0..side.len())
                .map(|at| [side[at], side[(at + 1) % side.len()]])
                .filter(|[a, b]| a < b)
        });
        let mut edges: Vec<[usize; 2]> = pairs.collect();
        edges.sort_unstable();
        edges
    }
}

/// Positions on the polyhedron for all vertices of a surface.
///
/// `triangles` are counter-clockwise seen from outside, over `points` that are all used.
///
/// # Errors
/// When the surface is not a closed manifold of genus 0 in one part, when there is no room for the edges, or when
/// triangles shrink below the resolution of the numbers.
pub fn lay(polyhedron: &Polyhedron, points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Vec<[f64; 3]>, String> {
    let name = polyhedron.name;
    let mend = "give the target as a file of boundary positions";
    let topology = connectivity::surface_topology(triangles, points.len());
    match topology.components.as_slice() {
        [part] if part.genus == Some(0) && part.loops == 0 => {}
        [part] => {
            let what = match part.genus {
                Some(genus) => format!("has genus {genus}"),
                None => "is not an oriented manifold".to_string(),
            };
            return Err(format!("the boundary {what}, but {name} has genus 0; {mend}"));
        }
        parts => {
            return Err(format!(
                "the boundary has {} parts, but {name} has one; {mend}",
                parts.len()
            ));
        }
    }
    let refuse = |reason: String| format!("the boundary cannot be laid onto {name}: {reason}; refine it, or {mend}");
    let layout = match lay_edges(polyhedron, points, triangles) {
        Ok(found) => found,
        Err(reason) => {
            // On a long or thin shape the paths can get into each other's way. The shape of another polyhedron that
            // found its place, blown up to a sphere, has more room.
            let rounded = [&TETRAHEDRON, &CUBE]
                .into_iter()
                .filter(|other| other.name != name)
                .find_map(|other| {
                    let layout = lay_edges(other, points, triangles).ok()?;
                    let mut sphere = place(other, &layout, points, triangles).ok()?;
                    for point in &mut sphere {
                        let distance = length(*point);
                        *point = point.map(|coordinate| coordinate / distance);
                    }
                    lay_edges(polyhedron, &sphere, triangles).ok()
                });
            rounded.ok_or_else(|| refuse(reason))?
        }
    };
    place(polyhedron, &layout, points, triangles).map_err(refuse)
}

/// The paths and patches of a polyhedron on a surface.
struct Edges {
    /// As [`Layout::paths`].
    paths: Vec<([usize; 2], Vec<u32>)>,
    /// Whether a vertex lies on a path.
    on_path: Vec<bool>,
    /// The side of every triangle.
    side_of: Vec<u32>,
}

/// Lays the edges of a polyhedron over a surface by the distances between `points`.
fn lay_edges(polyhedron: &Polyhedron, points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Edges, String> {
    let sheet = Sheet::new(points, triangles);
    // First the nearest corners and plain shortest paths; where they leave no room, roomier corners, then paths that
    // keep ever more away from each other; last the least demanding corners, for the coarsest meshes.
    const PLANS: [(usize, [f64; 2]); 6] = [
        (1, [0.0, 0.0]),
        (2, [0.0, 0.0]),
        (2, [4.0, 1.0]),
        (2, [16.0, 4.0]),
        (1, [4.0, 1.0]),
        (0, [0.0, 0.0]),
    ];
    let mut reason = None;
    for (spare, detour) in PLANS {
        let attempt = corner_vertices(polyhedron, &sheet, spare).and_then(|corners| {
            let mut layout = Layout::new(polyhedron, &sheet, &corners, detour);
            layout.route()?;
            let side_of = layout.patches()?;
            Ok(Edges {
                paths: layout.paths,
                on_path: layout.taken,
                side_of,
            })
        });
        match attempt {
            Ok(edges) => return Ok(edges),
            Err(failed) => reason = reason.or(Some(failed)),
        }
    }
    Err(reason.unwrap_or_default())
}

/// Places the vertices of the paths along the polyhedron's edges by their distances, and those between on its sides.
fn place(
    polyhedron: &Polyhedron,
    edges: &Edges,
    points: &[[f64; 3]],
    triangles: &[[u32; 3]],
) -> Result<Vec<[f64; 3]>, String> {
    let mut positions = vec![[f64::NAN; 3]; points.len()];
    for ([from, to], path) in &edges.paths {
        let (start, end) = (polyhedron.corners[*from], polyhedron.corners[*to]);
        let mut along = vec![0.0];
        for step in path.windows(2) {
            let [a, b] = [step[0], step[1]].map(|vertex| points[vertex as usize]);
            along.push(along[along.len() - 1] + length(subtract(a, b)));
        }
        let whole = along[along.len() - 1];
        for (&vertex, &distance) in path.iter().zip(&along) {
            let fraction = distance / whole;
            positions[vertex as usize] = std::array::from_fn(|axis| start[axis] + fraction * (end[axis] - start[axis]));
        }
        // The fraction 1 can miss the corner by a rounding.
        positions[path[path.len() - 1] as usize] = end;
    }
    for (side, corners) in polyhedron.sides.iter().enumerate() {
        let patch: Vec<[u32; 3]> = triangles
            .iter()
            .zip(&edges.side_of)
            .filter(|(_, of)| **of == side as u32)
            .map(|(t, _)| *t)
            .collect();
        let outline = corners
            .iter()
            .map(|&corner| polyhedron.corners[corner])
            .collect::<Vec<_>>();
        embed(&patch, points, &edges.on_path, &outline, &mut positions)?;
    }
    Ok(positions)
}
