//! Writing Bezier cells: tensor products of Bernstein polynomials over control points, which VTK since 9.0 evaluates
//! exactly.

use super::write::{Body, FieldView, document};

/// VTK's numbers of its Bezier cells.
const QUADRILATERAL: u8 = 77;
const HEXAHEDRON: u8 = 79;

/// The control points `(i, j)` of a quadrilateral in VTK's order: corners, then the sides (each in the direction in
/// which `i` or `j` grows), then the inside row by row.
pub fn quadrilateral_order(order: usize) -> Vec<[usize; 2]> {
    let n = order;
    let mut places = vec![[0, 0], [n, 0], [n, n], [0, n]];
    places.extend((1..n).map(|i| [i, 0]));
    places.extend((1..n).map(|j| [n, j]));
    places.extend((1..n).map(|i| [i, n]));
    places.extend((1..n).map(|j| [0, j]));
    places.extend((1..n).flat_map(|j| (1..n).map(move |i| [i, j])));
    places
}

/// The control points `(i, j, k)` of a hexahedron in VTK's order, that of files of version 2.2: corners, the edges of the
/// bottom, of the top and the upright ones, faces of constant `i`, `j`, `k`, the inside.
pub fn hexahedron_order(order: usize) -> Vec<[usize; 3]> {
    let n = order;
    let square = [[0, 0], [n, 0], [n, n], [0, n]];
    let mut places: Vec<[usize; 3]> = Vec::with_capacity((n + 1).pow(3));
    for k in [0, n] {
        places.extend(square.map(|[i, j]| [i, j, k]));
    }
    for k in [0, n] {
        places.extend((1..n).map(|i| [i, 0, k]));
        places.extend((1..n).map(|j| [n, j, k]));
        places.extend((1..n).map(|i| [i, n, k]));
        places.extend((1..n).map(|j| [0, j, k]));
    }
    for [i, j] in square {
        places.extend((1..n).map(|k| [i, j, k]));
    }
    let inner = || (1..n).flat_map(|slow| (1..n).map(move |fast| (fast, slow)));
    for i in [0, n] {
        places.extend(inner().map(|(j, k)| [i, j, k]));
    }
    for j in [0, n] {
        places.extend(inner().map(|(i, k)| [i, j, k]));
    }
    for k in [0, n] {
        places.extend(inner().map(|(i, j)| [i, j, k]));
    }
    places.extend((1..n).flat_map(|k| inner().map(move |(i, j)| [i, j, k])));
    places
}

/// A VTU file of Bezier quadrilaterals. Every cell has its own `(order + 1)^2` control points, entry `(order + 1) i + j`
/// belonging to `B_i(u) B_j(v)`; they keep their bits. Fields have a row a cell.
///
/// # Panics
/// When the number of points is no multiple of that, or a field has another number of rows.
pub fn write_bezier_quadrilaterals(points: &[[f64; 3]], order: usize, cell_data: &[FieldView<'_>]) -> Vec<u8> {
    let places = quadrilateral_order(order);
    let places: Vec<usize> = places.into_iter().map(|[i, j]| (order + 1) * i + j).collect();
    write(points, QUADRILATERAL, &places, cell_data)
}

/// The same for hexahedra of `(order + 1)^3` control points: entry `((order + 1) i + j) (order + 1) + k` belongs to
/// `B_i(u) B_j(v) B_k(w)`.
///
/// # Panics
/// As [`write_bezier_quadrilaterals`].
pub fn write_bezier_hexahedra(points: &[[f64; 3]], order: usize, cell_data: &[FieldView<'_>]) -> Vec<u8> {
    let side = order + 1;
    let places = hexahedron_order(order);
    let places: Vec<usize> = places.into_iter().map(|[i, j, k]| (side * i + j) * side + k).collect();
    write(points, HEXAHEDRON, &places, cell_data)
}

fn write(points: &[[f64; 3]], code: u8, places: &[usize], cell_data: &[FieldView<'_>]) -> Vec<u8> {
    let count = points.len() / places.len();
    assert_eq!(points.len(), count * places.len(), "every cell has its control points");
    let starts = (0..count).map(|cell| cell * places.len());
    let corners: Vec<u32> = starts
        .clone()
        .flat_map(|start| places.iter().map(move |place| (start + place) as u32))
        .collect();
    let ends: Vec<i64> = starts.map(|start| (start + places.len()) as i64).collect();
    document(
        "2.2",
        &Body {
            points,
            corners: &corners,
            ends: &ends,
            types: &vec![code; count],
        },
        &[],
        cell_data,
    )
}
