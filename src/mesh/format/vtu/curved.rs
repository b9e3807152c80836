//! Writing curved cells as VTK's Lagrange cells, which ParaView shows curved ("Nonlinear Subdivision Level").

use super::write::{Body, FieldView, document};
use crate::mesh::curved::{CurvedMesh, corner_points, edge_points, peeled_cell, places};
use crate::mesh::mixed::Shape;
use std::collections::BTreeMap;

/// The highest order: VTK 9.7 evaluates Lagrange cells up to it without loss.
pub const HIGHEST_ORDER: usize = 16;

/// VTK's number of a shape's Lagrange cell.
fn code(shape: Shape) -> u8 {
    match shape {
        Shape::Tetrahedron => 71,
        Shape::Hexahedron => 72,
        Shape::Prism => 73,
    }
}

/// A cell's lattice points in VTK's order (that of files of version 2.2: the fourth upright edge of a hexahedron after
/// the third in the cycle).
pub fn order_of_points(shape: Shape, order: usize) -> Vec<[usize; 3]> {
    let edges: &[[usize; 2]] = match shape {
        Shape::Tetrahedron => &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
        Shape::Prism => &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
        Shape::Hexahedron => shape.edges(),
    };
    if shape == Shape::Tetrahedron {
        let faces: &[&[usize]] = &[&[0, 1, 3], &[2, 3, 1], &[0, 3, 2], &[0, 2, 1]];
        return peeled_cell(shape, order, edges, faces);
    }
    let mut points = corner_points(shape, order);
    points.extend(edges.iter().flat_map(|&edge| edge_points(shape, order, edge)));
    let n = order;
    let rows = |make: &dyn Fn(usize, usize) -> Option<[usize; 3]>| -> Vec<[usize; 3]> {
        let pairs = (1..n).flat_map(|slow| (1..n).map(move |fast| (slow, fast)));
        pairs.filter_map(|(slow, fast)| make(slow, fast)).collect()
    };
    if shape == Shape::Hexahedron {
        for (axis, end) in [(0, 0), (0, n), (1, 0), (1, n), (2, 0), (2, n)] {
            points.extend(rows(&|slow, fast| {
                Some(match axis {
                    0 => [end, fast, slow],
                    1 => [fast, end, slow],
                    _ => [fast, slow, end],
                })
            }));
        }
        for k in 1..n {
            points.extend(rows(&|slow, fast| Some([fast, slow, k])));
        }
    } else {
        let level = |k: usize| rows(&|slow, fast| (fast + slow < n).then_some([fast, slow, k]));
        points.extend(level(0));
        points.extend(level(n));
        points.extend(rows(&|slow, fast| Some([fast, 0, slow])));
        points.extend(rows(&|slow, fast| Some([n - fast, fast, slow])));
        points.extend(rows(&|slow, fast| Some([0, n - fast, slow])));
        points.extend((1..n).flat_map(level));
    }
    points
}

/// A VTU file of Lagrange cells with fields of one row a cell. Points keep their bits.
pub fn write_curved(mesh: &CurvedMesh, cell_data: &[FieldView<'_>]) -> Vec<u8> {
    let mut orders: BTreeMap<(Shape, usize), Vec<usize>> = BTreeMap::new();
    let mut corners = Vec::new();
    let mut ends = Vec::with_capacity(mesh.cells.len());
    for cell in &mesh.cells {
        let order = orders
            .entry((cell.shape, cell.order))
            .or_insert_with(|| places(cell.shape, cell.order, &order_of_points(cell.shape, cell.order)));
        corners.extend(order.iter().map(|&place| cell.nodes[place]));
        ends.push(corners.len() as i64);
    }
    let types: Vec<u8> = mesh.cells.iter().map(|cell| code(cell.shape)).collect();
    document(
        "2.2",
        &Body {
            points: &mesh.points,
            corners: &corners,
            ends: &ends,
            types: &types,
        },
        &[],
        cell_data,
    )
}
