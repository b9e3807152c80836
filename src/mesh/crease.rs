//! Creases of a quadrilateral surface: which edges are sharp, and the surface cut open along them.
//!
//! [`by_angle`], [`by_label`], [`by_corner_normals`] and [`by_list`] name sharp edges; [`cut`] gives every vertex on a
//! crease one copy for each of the smooth sides around it. Along a crease the cut surface has a boundary on either
//! side with equal points, so that what is built over it may have a normal a side, and [`Cut::creases`] tells which
//! boundary edges belong together.
//!
//! Guarantees: quads keep their order and the order of their corners; the first side of a vertex keeps its number; copies
//! follow in the order of their vertices. Where a single crease ends within the surface (a dart) the vertex stays
//! whole, so that the surface is smooth there. Does not guarantee: that an edge is sharp to the eye because it is
//! named.

use super::connectivity::NONE;
use super::quadrilateral::{Connectivity, QuadrilateralMesh, quad_and_corner};
use super::{cross, dot, length, subtract};

/// The sine between normals of one corner and another that are written with few digits but mean the same.
const ALIKE: f64 = 1e-3;

/// A surface cut along its creases.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cut {
    /// With copies of the vertices on creases.
    pub mesh: QuadrilateralMesh,
    pub connectivity: Connectivity,
    /// For every vertex its number before the cut.
    pub original: Vec<u32>,
    /// The two boundary edges that every crease edge has become.
    pub creases: Vec<[u32; 2]>,
    /// Vertices at which three or more crease edges meet.
    pub corners: usize,
    /// Inner vertices at which one crease edge ends.
    pub darts: usize,
    /// Sharp edges between two such ends: with one side at either end they have no two sides and stay smooth.
    pub lone: Vec<[u32; 2]>,
}

/// Marks inner edges whose quads' planes (those of both diagonals) meet at more than this angle, in degrees.
pub fn by_angle(mesh: &QuadrilateralMesh, connectivity: &Connectivity, degrees: f64) -> Vec<bool> {
    let normals: Vec<[f64; 3]> = mesh
        .quads
        .iter()
        .map(|&quad| {
            let [a, b, c, d] = mesh.corners(quad);
            cross(subtract(c, a), subtract(d, b))
        })
        .collect();
    marked(connectivity, |first, second| {
        let (a, b) = (normals[first], normals[second]);
        length(cross(a, b)).atan2(dot(a, b)).to_degrees() > degrees
    })
}

/// Marks inner edges between quads with different labels.
pub fn by_label(connectivity: &Connectivity, labels: &[f64]) -> Vec<bool> {
    marked(connectivity, |first, second| labels[first] != labels[second])
}

/// Marks inner edges whose quads have normals that differ by more than rounding at one of its ends. `normals` stand at
/// the corners of `quads`; the quads of `connectivity` are the same, but may run the other way.
pub fn by_corner_normals(connectivity: &Connectivity, quads: &[[u32; 4]], normals: &[[[f64; 3]; 4]]) -> Vec<bool> {
    let at = |quad: usize, vertex: u32| {
        let corner = quads[quad].iter().position(|&other| other == vertex);
        corner.map(|corner| normals[quad][corner])
    };
    let differ = |[first, second]: [usize; 2], vertex: u32| match (at(first, vertex), at(second, vertex)) {
        (Some(a), Some(b)) => length(cross(a, b)) > ALIKE * length(a) * length(b) || dot(a, b) < 0.0,
        _ => false,
    };
    let inner = |(edge, sides): (&[u32; 2], &[u32; 2])| {
        !sides.contains(&NONE) && {
            let both = sides.map(|side| quad_and_corner(side).0);
            edge.iter().any(|&vertex| differ(both, vertex))
        }
    };
    connectivity.edges.iter().zip(&connectivity.sides).map(inner).collect()
}

/// Marks the listed edges; boundary edges among them stay unmarked.
///
/// # Errors
/// The first pair of vertices that is no edge, by its place in the list.
pub fn by_list(connectivity: &Connectivity, list: &[[u32; 2]]) -> Result<Vec<bool>, usize> {
    let mut named = vec![false; connectivity.edges.len()];
    for (place, &[a, b]) in list.iter().enumerate() {
        let edge = [a.min(b), a.max(b)];
        let index = connectivity.edges.binary_search(&edge).map_err(|_| place)?;
        named[index] = !connectivity.sides[index].contains(&NONE);
    }
    Ok(named)
}

fn marked(connectivity: &Connectivity, sharp: impl Fn(usize, usize) -> bool) -> Vec<bool> {
    let inner = |sides: &[u32; 2]| {
        !sides.contains(&NONE) && {
            let [first, second] = sides.map(|side| quad_and_corner(side).0);
            sharp(first, second)
        }
    };
    connectivity.sides.iter().map(inner).collect()
}

/// Number of sharp edges at every vertex.
fn counts(connectivity: &Connectivity, sharp: &[bool]) -> Vec<usize> {
    let mut counts = vec![0; connectivity.stars.len()];
    for (ends, _) in connectivity.edges.iter().zip(sharp).filter(|(_, sharp)| **sharp) {
        for &vertex in ends {
            counts[vertex as usize] += 1;
        }
    }
    counts
}

/// Cuts a surface along its sharp edges; normals of vertices are copied with them.
///
/// # Panics
/// When `sharp` does not tell of every edge, or marks one on the boundary.
pub fn cut(mesh: &QuadrilateralMesh, connectivity: &Connectivity, mut sharp: Vec<bool>) -> Cut {
    assert_eq!(sharp.len(), connectivity.edges.len(), "a mark for every edge");
    let mut found = Cut::default();
    // An edge is cut open where one of its ends falls apart: at two sharp edges, or one that runs into the boundary.
    let whole =
        |vertex: u32, counts: &[usize]| counts[vertex as usize] < 2 && !connectivity.on_boundary[vertex as usize];
    let before = counts(connectivity, &sharp);
    for (edge, mark) in sharp.iter_mut().enumerate() {
        let ends = connectivity.edges[edge];
        if *mark && ends.iter().all(|&vertex| whole(vertex, &before)) {
            *mark = false;
            found.lone.push(ends);
        }
    }
    let counts = counts(connectivity, &sharp);
    found.corners = counts.iter().filter(|&&count| count > 2).count();
    found.darts = (0..counts.len() as u32)
        .filter(|&vertex| counts[vertex as usize] == 1 && whole(vertex, &counts))
        .count();
    found.mesh = mesh.clone();
    found.original = (0..mesh.points.len() as u32).collect();
    for vertex in 0..mesh.points.len() {
        if whole(vertex as u32, &counts) || counts[vertex] == 0 {
            continue;
        }
        let corners = connectivity.stars.row(vertex);
        let spokes: Vec<u32> = connectivity.spokes(vertex).collect();
        // Sides start behind sharp spokes; around an inner vertex the corners before the first one belong to the last.
        let first = (0..corners.len())
            .find(|&corner| connectivity.on_boundary[vertex] || sharp[spokes[corner] as usize])
            .unwrap_or(0);
        let mut name = vertex as u32;
        for step in 0..corners.len() {
            let place = (first + step) % corners.len();
            if step > 0 && sharp[spokes[place] as usize] {
                name = found.mesh.points.len() as u32;
                found.mesh.points.push(mesh.points[vertex]);
                found.original.push(vertex as u32);
                if let (Some(all), Some(normals)) = (&mut found.mesh.normals, &mesh.normals) {
                    all.push(normals[vertex]);
                }
            }
            let (quad, corner) = quad_and_corner(corners[place]);
            found.mesh.quads[quad][corner] = name;
        }
    }
    found.connectivity = Connectivity::of(&found.mesh.quads, found.mesh.points.len())
        .expect("fans are cut into fans, edges into two with different ends");
    for (sides, _) in connectivity.sides.iter().zip(&sharp).filter(|(_, sharp)| **sharp) {
        found.creases.push(sides.map(|side| {
            let (quad, corner) = quad_and_corner(side);
            found.connectivity.quad_edges[quad][corner]
        }));
    }
    found
}
