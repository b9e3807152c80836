//! Which way given normals point: inward or outward, part by part of a surface.

use super::creases::Creases;
use crate::linalg::vector3::{cross, dot, subtract};
use crate::mesh::quadrilateral::Connectivity;

/// For every vertex the least vertex of the connected part that it belongs to. Sides of a crease hang together.
pub fn parts(connectivity: &Connectivity, creases: Option<&Creases>) -> Vec<u32> {
    let Some(creases) = creases else {
        return connected(connectivity);
    };
    let whole = connected(&creases.whole_connectivity);
    creases.original.iter().map(|&vertex| whole[vertex as usize]).collect()
}

fn connected(connectivity: &Connectivity) -> Vec<u32> {
    let mut part: Vec<u32> = (0..connectivity.stars.len() as u32).collect();
    let root = |part: &mut [u32], mut vertex: u32| {
        while part[vertex as usize] != vertex {
            part[vertex as usize] = part[part[vertex as usize] as usize];
            vertex = part[vertex as usize];
        }
        vertex
    };
    for &[a, b] in &connectivity.edges {
        let (a, b) = (root(&mut part, a), root(&mut part, b));
        part[a.max(b) as usize] = a.min(b);
    }
    for vertex in 0..part.len() as u32 {
        part[vertex as usize] = root(&mut part, vertex);
    }
    part
}

/// For every vertex whether most normals of its part point to the back of their quads; vertices may be left out of the
/// vote.
pub fn backward(
    points: &[[f64; 3]],
    quads: &[[u32; 4]],
    normals: &[[f64; 3]],
    parts: &[u32],
    used: impl Fn(usize) -> bool,
) -> Vec<bool> {
    // Parts are named by vertices of the whole mesh, which are no more than those of the cut one.
    let mut votes = vec![0i64; normals.len()];
    for &quad in quads {
        let corners = quad.map(|vertex| points[vertex as usize]);
        let face = cross(subtract(corners[2], corners[0]), subtract(corners[3], corners[1]));
        for vertex in quad.map(|vertex| vertex as usize) {
            if used(vertex) {
                let vote = if dot(face, normals[vertex]) < 0.0 { 1 } else { -1 };
                votes[parts[vertex] as usize] += vote;
            }
        }
    }
    parts.iter().map(|&part| votes[part as usize] > 0).collect()
}
