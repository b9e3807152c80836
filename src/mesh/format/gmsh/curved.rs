//! Writing curved cells as Gmsh's complete elements of high order, in MSH 4.1 text.

use crate::mesh::bounding_box;
use crate::mesh::curved::{
    CurvedMesh, corner_points, edge_points, peeled_cell, peeled_face, peeled_line, peeled_triangle, places,
};
use crate::mesh::mixed::Shape;
use std::collections::BTreeMap;
use std::io::Write as _;

/// The highest order of all three shapes.
pub const HIGHEST_ORDER: usize = 9;

/// Gmsh's number of a shape's complete element, by order from 1.
fn codes(shape: Shape) -> &'static [u8] {
    match shape {
        Shape::Tetrahedron => &[4, 11, 29, 30, 31, 71, 72, 73, 74],
        Shape::Hexahedron => &[5, 12, 92, 93, 94, 95, 96, 97, 98],
        Shape::Prism => &[6, 13, 90, 91, 106, 107, 108, 109, 110],
    }
}

/// A cell's lattice points in Gmsh's order.
pub fn order_of_points(shape: Shape, order: usize) -> Vec<[usize; 3]> {
    match shape {
        Shape::Tetrahedron => {
            let edges = [[0, 1], [1, 2], [2, 0], [3, 0], [3, 2], [3, 1]];
            let faces: &[&[usize]] = &[&[0, 2, 1], &[0, 1, 3], &[0, 3, 2], &[3, 1, 2]];
            peeled_cell(shape, order, &edges, faces)
        }
        Shape::Hexahedron => {
            let edges = [
                [0, 1],
                [0, 3],
                [0, 4],
                [1, 2],
                [1, 5],
                [2, 3],
                [2, 6],
                [3, 7],
                [4, 5],
                [4, 7],
                [5, 6],
                [6, 7],
            ];
            let faces: &[&[usize]] = &[
                &[0, 3, 2, 1],
                &[0, 1, 5, 4],
                &[0, 4, 7, 3],
                &[1, 2, 6, 5],
                &[2, 3, 7, 6],
                &[4, 5, 6, 7],
            ];
            peeled_cell(shape, order, &edges, faces)
        }
        Shape::Prism => {
            let edges = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 4], [2, 5], [3, 4], [3, 5], [4, 5]];
            let faces: &[&[usize]] = &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[0, 3, 5, 2], &[1, 2, 5, 4]];
            let mut points = corner_points(shape, order);
            points.extend(edges.iter().flat_map(|&edge| edge_points(shape, order, edge)));
            points.extend(faces.iter().flat_map(|face| peeled_face(shape, order, face)));
            if order >= 3 {
                for [i, j] in peeled_triangle(order - 3) {
                    points.extend(peeled_line(order - 2).into_iter().map(|k| [i + 1, j + 1, k + 1]));
                }
            }
            points
        }
    }
}

/// An MSH 4.1 file of complete elements. Numbers are the shortest decimals that read back to the same bits.
///
/// # Errors
/// When a cell's order is above [`HIGHEST_ORDER`], for which Gmsh has no element.
pub fn write_curved(mesh: &CurvedMesh) -> Result<Vec<u8>, String> {
    if let Some(cell) = mesh.cells.iter().position(|cell| cell.order > HIGHEST_ORDER) {
        return Err(format!(
            "cell {cell} has order {}; Gmsh's elements end at order {HIGHEST_ORDER}",
            mesh.cells[cell].order
        ));
    }
    let mut groups: BTreeMap<(Shape, usize), Vec<usize>> = BTreeMap::new();
    for (number, cell) in mesh.cells.iter().enumerate() {
        groups.entry((cell.shape, cell.order)).or_default().push(number);
    }
    let mut out = Vec::new();
    // Writing to memory cannot fail.
    let _ = write!(out, "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1");
    let [low, high] = bounding_box(&mesh.points).unwrap_or_default();
    for value in low.iter().chain(&high) {
        let _ = write!(out, " {value:?}");
    }
    let points = mesh.points.len();
    let _ = write!(
        out,
        " 0 0\n$EndEntities\n$Nodes\n1 {points} 1 {points}\n3 1 0 {points}\n"
    );
    for row in 1..=points {
        let _ = writeln!(out, "{row}");
    }
    for [x, y, z] in &mesh.points {
        let _ = writeln!(out, "{x:?} {y:?} {z:?}");
    }
    let cells = mesh.cells.len();
    let _ = write!(out, "$EndNodes\n$Elements\n{} {cells} 1 {cells}\n", groups.len());
    for ((shape, order), members) in groups {
        let _ = writeln!(out, "3 1 {} {}", codes(shape)[order - 1], members.len());
        let listed = places(shape, order, &order_of_points(shape, order));
        for cell in members {
            let _ = write!(out, "{}", cell + 1);
            for &place in &listed {
                let _ = write!(out, " {}", mesh.cells[cell].nodes[place] + 1);
            }
            out.push(b'\n');
        }
    }
    out.extend_from_slice(b"$EndElements\n");
    Ok(out)
}
