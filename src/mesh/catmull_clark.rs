//! Catmull-Clark subdivision as a linear map (Catmull and Clark 1978; creases: DeRose, Kass, Truong 1998; limit
//! positions: Halstead, Kass, DeRose 1993).
//!
//! Faces may have three or four corners; after one level all have four. Edges at the boundary, edges with three or more
//! faces and edges that are named as creases stay sharp: they follow the cubic B-spline of their own vertices. Vertices
//! with three or more sharp edges stay where they are, and so do those at which several surfaces touch in a point.
//!
//! Guaranteed: rows of weights sum to 1. Not guaranteed: the exact limit of a vertex at which one crease ends inside the
//! surface, which [`limit`] takes for smooth; each level of subdivision before it makes the error smaller.

use super::linear_map::LinearMap;
use super::surface::{Edge, Surface};
use std::collections::BTreeSet;

/// A subdivided surface and the map from control points to its points.
#[derive(Clone, Debug, PartialEq)]
pub struct Subdivided {
    pub surface: Surface,
    pub map: LinearMap,
    /// Sharp edges, smaller vertex first, ascending.
    pub creases: Vec<[u32; 2]>,
    /// The control face that each face lies in.
    pub parents: Vec<u32>,
}

/// What a vertex sees around it.
struct Ring {
    /// Indices of its edges and faces.
    edges: Vec<u32>,
    faces: Vec<u32>,
    sharp: Vec<u32>,
}

fn rings(surface: &Surface, edges: &[Edge], sharp: &[bool]) -> Vec<Ring> {
    let mut rings: Vec<Ring> = (0..surface.points.len())
        .map(|_| Ring {
            edges: Vec::new(),
            faces: Vec::new(),
            sharp: Vec::new(),
        })
        .collect();
    for (index, edge) in edges.iter().enumerate() {
        for end in edge.ends {
            rings[end as usize].edges.push(index as u32);
            if sharp[index] {
                rings[end as usize].sharp.push(index as u32);
            }
        }
    }
    for face in 0..surface.faces() {
        for &corner in surface.face(face) {
            rings[corner as usize].faces.push(face as u32);
        }
    }
    rings
}

fn other(edge: &Edge, vertex: usize) -> u32 {
    let [a, b] = edge.ends;
    if a as usize == vertex { b } else { a }
}

/// Edges, and whether each is sharp.
fn sharpness(surface: &Surface, creases: &[[u32; 2]]) -> (Vec<Edge>, Vec<bool>) {
    let edges = surface.edges();
    let named: BTreeSet<[u32; 2]> = creases.iter().map(|&[a, b]| [a.min(b), a.max(b)]).collect();
    let sharp = edges
        .iter()
        .map(|edge| edge.faces.len() != 2 || named.contains(&edge.ends))
        .collect();
    (edges, sharp)
}

/// Subdivides `levels` times; `creases` are edges of the control mesh that stay sharp.
pub fn subdivide(control: &Surface, creases: &[[u32; 2]], levels: usize) -> Subdivided {
    let mut result = Subdivided {
        surface: control.clone(),
        map: LinearMap::identity(control.points.len()),
        creases: creases.iter().map(|&[a, b]| [a.min(b), a.max(b)]).collect(),
        parents: (0..control.faces() as u32).collect(),
    };
    for _ in 0..levels {
        let next = once(&result.surface, &result.creases);
        result = Subdivided {
            map: next.map.after(&result.map),
            parents: next.parents.iter().map(|&face| result.parents[face as usize]).collect(),
            ..next
        };
    }
    result
}

/// One level: the points are the old vertices, then a point an edge in lexicographic order, then a point a face.
fn once(surface: &Surface, creases: &[[u32; 2]]) -> Subdivided {
    let (edges, sharp) = sharpness(surface, creases);
    let rings = rings(surface, &edges, &sharp);
    let vertices = surface.points.len();
    let face_row = |face: u32, weight: f64| {
        let corners = surface.face(face as usize);
        let share = weight / corners.len() as f64;
        corners.iter().map(move |&corner| (corner, share))
    };
    let vertex_row = |(vertex, ring): (usize, &Ring)| -> Vec<(u32, f64)> {
        let here = vertex as u32;
        let count = ring.edges.len();
        match ring.sharp[..] {
            [first, second] => vec![
                (other(&edges[first as usize], vertex), 0.125),
                (other(&edges[second as usize], vertex), 0.125),
                (here, 0.75),
            ],
            // Interior, or the end of a crease.
            [] | [_] if ring.faces.len() == count && count >= 3 => {
                let n = count as f64;
                let mut row = vec![(here, (n - 3.0) / n)];
                for &face in &ring.faces {
                    row.extend(face_row(face, 1.0 / (n * n)));
                }
                for &edge in &ring.edges {
                    // The middle of the edge, twice over n.
                    row.push((here, 1.0 / (n * n)));
                    row.push((other(&edges[edge as usize], vertex), 1.0 / (n * n)));
                }
                row
            }
            _ => vec![(here, 1.0)],
        }
    };
    let edge_row = |(edge, &sharp): (&Edge, &bool)| -> Vec<(u32, f64)> {
        let weight = if sharp { 0.5 } else { 0.25 };
        let mut row: Vec<(u32, f64)> = edge.ends.iter().map(|&end| (end, weight)).collect();
        if !sharp {
            for &face in &edge.faces {
                row.extend(face_row(face, 0.25));
            }
        }
        row
    };
    let rows = rings
        .iter()
        .enumerate()
        .map(vertex_row)
        .chain(edges.iter().zip(&sharp).map(edge_row))
        .chain((0..surface.faces() as u32).map(|face| face_row(face, 1.0).collect()));
    let map = LinearMap::from_rows(vertices, rows);

    // A face that names a vertex twice in a row has no edge there: its vertex stands for the middle.
    let middle = |a: u32, b: u32| {
        let ends = [a.min(b), a.max(b)];
        match edges.binary_search_by_key(&ends, |edge| edge.ends) {
            Ok(edge) => (vertices + edge) as u32,
            Err(_) => a,
        }
    };
    let mut quads = Vec::new();
    let mut parents = Vec::new();
    for face in 0..surface.faces() {
        let corners = surface.face(face);
        let count = corners.len();
        let centre = (vertices + edges.len() + face) as u32;
        for index in 0..count {
            let [before, here, after] = [index + count - 1, index, index + 1].map(|place| corners[place % count]);
            quads.push([here, middle(here, after), centre, middle(before, here)]);
            parents.push(face as u32);
        }
    }
    let mut points = vec![[0.0; 3]; map.rows()];
    map.apply(&surface.points, &mut points);
    let mut creases: Vec<[u32; 2]> = edges
        .iter()
        .zip(&sharp)
        .enumerate()
        .filter(|(_, (_, sharp))| **sharp)
        .flat_map(|(index, (edge, _))| edge.ends.map(|end| [end, (vertices + index) as u32]))
        .collect();
    creases.sort_unstable();
    Subdivided {
        surface: Surface {
            points,
            triangles: Vec::new(),
            quads,
        },
        map,
        creases,
        parents,
    }
}

/// The map from a surface's points to where they go under endless subdivision.
///
/// # Panics
/// When a face has three corners: subdivide once first.
pub fn limit(surface: &Surface, creases: &[[u32; 2]]) -> LinearMap {
    assert!(surface.triangles.is_empty(), "quadrilaterals only");
    let (edges, sharp) = sharpness(surface, creases);
    let rings = rings(surface, &edges, &sharp);
    let rows = rings.iter().enumerate().map(|(vertex, ring)| {
        let here = vertex as u32;
        let count = ring.edges.len();
        match ring.sharp[..] {
            [first, second] => vec![
                (other(&edges[first as usize], vertex), 1.0 / 6.0),
                (other(&edges[second as usize], vertex), 1.0 / 6.0),
                (here, 4.0 / 6.0),
            ],
            [] | [_] if ring.faces.len() == count && count >= 3 => {
                let n = count as f64;
                let total = n * (n + 5.0);
                let mut row = vec![(here, n * n / total)];
                for &edge in &ring.edges {
                    row.push((other(&edges[edge as usize], vertex), 4.0 / total));
                }
                for &face in &ring.faces {
                    // The corner across the face.
                    let corners = surface.face(face as usize);
                    let place = corners.iter().position(|&corner| corner == here).unwrap_or(0);
                    row.push((corners[(place + 2) % 4], 1.0 / total));
                }
                row
            }
            _ => vec![(here, 1.0)],
        }
    });
    LinearMap::from_rows(surface.points.len(), rows)
}
