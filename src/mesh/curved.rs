//! Volumes of curved cells in the form in which programs exchange them: points on an even lattice in every cell, through
//! which the cell's polynomial of that order goes (Lagrange form).
//!
//! Cells that share an edge or a face share its points where their orders agree. The file formats differ only in the
//! order in which they list a cell's points; most peel it: corners, edges, faces, then the inside as a cell of lower
//! order.

use super::mixed::Shape;
use std::collections::BTreeMap;

/// A cell with `order + 1` points along every edge.
#[derive(Clone, Debug, PartialEq)]
pub struct CurvedCell {
    pub shape: Shape,
    pub order: usize,
    /// Points in the order of [`lattice`].
    pub nodes: Vec<u32>,
}

/// Points and cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurvedMesh {
    pub points: Vec<[f64; 3]>,
    pub cells: Vec<CurvedCell>,
}

/// Coordinates of a cell's lattice points times the order: the last coordinate runs fastest.
pub fn lattice(shape: Shape, order: usize) -> Vec<[usize; 3]> {
    let mut points = Vec::new();
    for i in 0..=order {
        for j in 0..=order {
            for k in 0..=order {
                let inside = match shape {
                    Shape::Hexahedron => true,
                    Shape::Prism => i + j <= order,
                    Shape::Tetrahedron => i + j + k <= order,
                };
                if inside {
                    points.push([i, j, k]);
                }
            }
        }
    }
    points
}

/// Where in [`lattice`] the listed points are.
///
/// # Panics
/// When a listed point is not in the lattice.
pub fn places(shape: Shape, order: usize, listed: &[[usize; 3]]) -> Vec<usize> {
    let find: BTreeMap<[usize; 3], usize> = lattice(shape, order)
        .into_iter()
        .enumerate()
        .map(|(place, point)| (point, place))
        .collect();
    listed.iter().map(|point| find[point]).collect()
}

/// A lattice of order `n` on a line: ends, then between.
pub fn peeled_line(n: usize) -> Vec<usize> {
    if n == 0 {
        return vec![0];
    }
    [0, n].into_iter().chain(1..n).collect()
}

/// A lattice of order `n` on a triangle: corners, edges in a cycle, then the triangle inside.
pub fn peeled_triangle(n: usize) -> Vec<[usize; 2]> {
    if n == 0 {
        return vec![[0, 0]];
    }
    let mut points = vec![[0, 0], [n, 0], [0, n]];
    points.extend((1..n).map(|s| [s, 0]));
    points.extend((1..n).map(|s| [n - s, s]));
    points.extend((1..n).map(|s| [0, n - s]));
    if n >= 3 {
        points.extend(peeled_triangle(n - 3).into_iter().map(|[i, j]| [i + 1, j + 1]));
    }
    points
}

/// A lattice of order `n` on a quad: corners, edges in a cycle, then the quad inside.
pub fn peeled_quad(n: usize) -> Vec<[usize; 2]> {
    if n == 0 {
        return vec![[0, 0]];
    }
    let mut points = vec![[0, 0], [n, 0], [n, n], [0, n]];
    points.extend((1..n).map(|s| [s, 0]));
    points.extend((1..n).map(|s| [n, s]));
    points.extend((1..n).map(|s| [n - s, n]));
    points.extend((1..n).map(|s| [0, n - s]));
    if n >= 2 {
        points.extend(peeled_quad(n - 2).into_iter().map(|[i, j]| [i + 1, j + 1]));
    }
    points
}

/// Lattice points inside a face of a cell, peeled, by the face's corners in the listed order.
pub fn peeled_face(shape: Shape, order: usize, corners: &[usize]) -> Vec<[usize; 3]> {
    let at = |corner: usize| shape.canonical()[corners[corner]].map(|coordinate| coordinate as usize);
    let between = |first: usize, along: &[(usize, usize)]| -> [usize; 3] {
        std::array::from_fn(|axis| {
            let start = (order * at(first)[axis]) as isize;
            let moved = along
                .iter()
                .map(|&(corner, steps)| (at(corner)[axis] as isize - at(first)[axis] as isize) * steps as isize);
            (start + moved.sum::<isize>()) as usize
        })
    };
    match corners.len() {
        3 if order >= 3 => {
            let inside = peeled_triangle(order - 3).into_iter();
            inside.map(|[s, t]| between(0, &[(1, s + 1), (2, t + 1)])).collect()
        }
        4 if order >= 2 => {
            let inside = peeled_quad(order - 2).into_iter();
            inside.map(|[s, t]| between(0, &[(1, s + 1), (3, t + 1)])).collect()
        }
        _ => Vec::new(),
    }
}

/// Lattice points inside an edge from one corner to another.
pub fn edge_points(shape: Shape, order: usize, [from, to]: [usize; 2]) -> Vec<[usize; 3]> {
    let ends = [from, to].map(|corner| shape.canonical()[corner].map(|coordinate| coordinate as usize));
    (1..order)
        .map(|step| std::array::from_fn(|axis| ends[0][axis] * (order - step) + ends[1][axis] * step))
        .collect()
}

/// Lattice points of the corners.
pub fn corner_points(shape: Shape, order: usize) -> Vec<[usize; 3]> {
    let corners = shape.canonical().iter();
    corners
        .map(|corner| corner.map(|coordinate| order * coordinate as usize))
        .collect()
}

/// A hexahedron or tetrahedron peeled: corners, edges, faces as listed, then the cell inside likewise.
pub fn peeled_cell(shape: Shape, order: usize, edges: &[[usize; 2]], faces: &[&[usize]]) -> Vec<[usize; 3]> {
    if order == 0 {
        return vec![[0; 3]];
    }
    let mut points = corner_points(shape, order);
    points.extend(edges.iter().flat_map(|&edge| edge_points(shape, order, edge)));
    points.extend(faces.iter().flat_map(|face| peeled_face(shape, order, face)));
    let inside = if shape == Shape::Tetrahedron { 4 } else { 2 };
    if order >= inside {
        let inner = peeled_cell(shape, order - inside, edges, faces).into_iter();
        points.extend(inner.map(|point| point.map(|coordinate| coordinate + 1)));
    }
    points
}
