//! Triangles of a target turned so that all together enclose a volume.
//!
//! Distances do not depend on which way a triangle faces, the enclosed volume does, and with it the scale of lengths.
//! From triangle to triangle the orientation is carried over the edges that two of them share, vertices at one place
//! being one. Each connected piece is then turned to enclose a positive volume, and once more where an odd number of the
//! others wind around it: a cavity. Left alone is what has an edge with one triangle or more than two, and what cannot be
//! oriented.

use super::target::Closure;
use crate::mesh::{self, TriangleMesh};
use std::collections::BTreeMap;

/// Turns what faces the wrong way where some edges have triangles of opposite orientations; the number of triangles
/// turned.
pub fn orient(surface: &mut TriangleMesh) -> usize {
    let closure = Closure::of(surface);
    if closure.open > 0 || closure.turned == 0 {
        return 0;
    }
    // Both sides of every edge: the triangle, and whether it runs from the smaller to the larger vertex.
    let mut sides: BTreeMap<[u32; 2], Vec<(usize, bool)>> = BTreeMap::new();
    for (index, [a, b, c]) in closure.joined.cells.iter().copied().enumerate() {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            sides.entry([a.min(b), a.max(b)]).or_default().push((index, a < b));
        }
    }
    if sides.values().any(|sides| sides.len() != 2) {
        return 0;
    }
    let count = closure.joined.cells.len();
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); count];
    for sides in sides.values() {
        let [(first, one), (second, other)] = [sides[0], sides[1]];
        neighbours[first].push((second, one == other));
        neighbours[second].push((first, one == other));
    }
    let mut turned: Vec<Option<bool>> = vec![None; count];
    let mut pieces: Vec<Vec<usize>> = Vec::new();
    for start in 0..count {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        let mut piece = vec![start];
        let mut next = 0;
        while next < piece.len() {
            let own = turned[piece[next]] == Some(true);
            for &(neighbour, unlike) in &neighbours[piece[next]] {
                match turned[neighbour] {
                    None => {
                        turned[neighbour] = Some(own != unlike);
                        piece.push(neighbour);
                    }
                    // One-sided: a way around came back the other way.
                    Some(other) if other != (own != unlike) => return 0,
                    Some(_) => {}
                }
            }
            next += 1;
        }
        pieces.push(piece);
    }
    let mut turned: Vec<bool> = turned.into_iter().map(|turned| turned == Some(true)).collect();
    let corners = |index: usize, turned: &[bool]| -> [[f64; 3]; 3] {
        let [a, b, c] = surface.corners(surface.cells[closure.kept[index]]);
        if turned[index] { [a, c, b] } else { [a, b, c] }
    };
    for piece in &pieces {
        let volume: f64 = piece
            .iter()
            .map(|&index| {
                let [a, b, c] = corners(index, &turned);
                mesh::determinant([[0.0; 3], a, b, c])
            })
            .sum();
        if volume < 0.0 {
            for &index in piece {
                turned[index] = !turned[index];
            }
        }
    }
    let around: Vec<bool> = (0..pieces.len())
        .map(|own| {
            let point = corners(pieces[own][0], &turned)[0];
            let others = pieces.iter().enumerate().filter(|other| other.0 != own);
            let angle: f64 = others
                .flat_map(|other| other.1)
                .map(|&index| solid_angle(corners(index, &turned), point))
                .sum();
            (angle / (4.0 * std::f64::consts::PI)).round().rem_euclid(2.0) == 1.0
        })
        .collect();
    for (piece, around) in pieces.iter().zip(around) {
        for &index in piece {
            turned[index] ^= around;
        }
    }
    let mut result = 0;
    for (index, _) in turned.iter().enumerate().filter(|turned| *turned.1) {
        surface.cells[closure.kept[index]].swap(1, 2);
        result += 1;
    }
    result
}

/// The solid angle of a triangle seen from a point, positive from within (Van Oosterom and Strackee 1983).
fn solid_angle(corners: [[f64; 3]; 3], point: [f64; 3]) -> f64 {
    let [a, b, c] = corners.map(|corner| mesh::subtract(corner, point));
    let [la, lb, lc] = [a, b, c].map(mesh::length);
    let above = mesh::determinant([[0.0; 3], a, b, c]);
    let below = la * lb * lc + mesh::dot(a, b) * lc + mesh::dot(b, c) * la + mesh::dot(c, a) * lb;
    2.0 * above.atan2(below)
}
