//! Subdivision of volumes by multi-linear averaging (Bajaj, Schaefer, Warren and Xu 2002): every cell is cut at the
//! middles of its edges, faces and itself into hexahedra, one a corner; then every vertex moves to the mean of the
//! centroids of the new cells around it.
//!
//! Features are kept by averaging within the least submanifold that a vertex lies on: cells inside, quads on the
//! boundary, edges along creases; corners stay. Regular insides tend to the tricubic B-spline.
//!
//! Guaranteed: rows of weights sum to 1, and all weights are positive. Not guaranteed: that cells of positive volume stay
//! so, and smoothness at irregular edges.

use super::linear_map::LinearMap;
use super::mixed::{Face, MixedMesh, Topology};
use super::{area_vector, dot, length, subtract};
use std::collections::BTreeMap;

/// What stays sharp.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Features {
    /// Edges of the boundary, smaller vertex first, ascending.
    pub creases: Vec<[u32; 2]>,
    /// Vertices that do not move, ascending.
    pub corners: Vec<u32>,
}

/// A subdivided volume of hexahedra and the map from control points to its points.
#[derive(Clone, Debug, PartialEq)]
pub struct Subdivided {
    pub mesh: MixedMesh,
    pub map: LinearMap,
    pub features: Features,
}

/// The unit normal of a face of three or four corners.
fn normal(points: &[[f64; 3]], face: &Face) -> [f64; 3] {
    let at = |place: usize| points[face.corners()[place] as usize];
    let mut sum = area_vector([at(0), at(1), at(2)]);
    if face.corners().len() == 4 {
        let other = area_vector([at(0), at(2), at(3)]);
        sum = std::array::from_fn(|axis| sum[axis] + other[axis]);
    }
    let size = length(sum).max(f64::MIN_POSITIVE);
    sum.map(|coordinate| coordinate / size)
}

/// Edges of the boundary bent by more than an angle in degrees, and the vertices where other than two of them meet or
/// where two turn by more than that.
pub fn features(mesh: &MixedMesh, topology: &Topology, degrees: f64) -> Features {
    let limit = degrees.to_radians().cos();
    let mut sides: BTreeMap<[u32; 2], Vec<[f64; 3]>> = BTreeMap::new();
    for (_, face) in topology.boundary() {
        let own = normal(&mesh.points, face);
        let corners = face.corners();
        for (place, &a) in corners.iter().enumerate() {
            let b = corners[(place + 1) % corners.len()];
            sides.entry([a.min(b), a.max(b)]).or_default().push(own);
        }
    }
    let sharp = sides.into_iter().filter(|(_, normals)| match normals[..] {
        [first, second] => dot(first, second) < limit,
        _ => true,
    });
    let creases: Vec<[u32; 2]> = sharp.map(|(edge, _)| edge).collect();
    let mut around: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &[a, b] in &creases {
        around.entry(a).or_default().push(b);
        around.entry(b).or_default().push(a);
    }
    let turned = |vertex: u32, [a, b]: [u32; 2]| {
        let from = subtract(mesh.points[vertex as usize], mesh.points[a as usize]);
        let to = subtract(mesh.points[b as usize], mesh.points[vertex as usize]);
        dot(from, to) < limit * length(from) * length(to)
    };
    let corners = around.iter().filter(|(vertex, others)| match others[..] {
        [a, b] => turned(**vertex, [a, b]),
        _ => true,
    });
    Features {
        corners: corners.map(|(&vertex, _)| vertex).collect(),
        creases,
    }
}

/// One level.
///
/// # Errors
/// When the mesh does not conform, or a crease is not one of its edges.
pub fn subdivide(mesh: &MixedMesh, features: &Features) -> Result<Subdivided, String> {
    let topology = mesh.topology()?;
    let vertices = mesh.points.len();
    let (edges, faces) = (topology.edges.len(), topology.faces.len());
    let edge_point = |edge: u32| vertices as u32 + edge;
    let face_point = |face: u32| (vertices + edges) as u32 + face;
    let cell_point = |cell: usize| (vertices + edges + faces + cell) as u32;
    let mean = |corners: &[u32]| -> Vec<(u32, f64)> {
        let weight = 1.0 / corners.len() as f64;
        corners.iter().map(|&corner| (corner, weight)).collect()
    };
    let mut rows: Vec<Vec<(u32, f64)>> = (0..vertices as u32).map(|vertex| mean(&[vertex])).collect();
    rows.extend(topology.edges.iter().map(|edge| mean(edge)));
    rows.extend(topology.faces.iter().map(|face| mean(face.corners())));
    rows.extend(mesh.iter().map(|(_, corners)| mean(corners)));
    let middle = LinearMap::from_rows(vertices, rows.into_iter());

    let mut hexahedra = Vec::new();
    for (cell, (shape, corners)) in mesh.iter().enumerate() {
        for (corner, ends) in shape.corner_frames().iter().enumerate() {
            let edge = |end: usize| {
                let place = shape
                    .edges()
                    .iter()
                    .position(|&[a, b]| [a, b] == [corner, end] || [b, a] == [corner, end]);
                edge_point(topology.cell_edges[cell][place.unwrap_or(0)])
            };
            let face = |first: usize, second: usize| {
                let place = shape
                    .faces()
                    .iter()
                    .position(|face| [corner, first, second].iter().all(|one| face.contains(one)));
                face_point(topology.cell_faces[cell][place.unwrap_or(0)])
            };
            let [a, b, c] = *ends;
            hexahedra.push([
                corners[corner],
                edge(a),
                face(a, b),
                edge(b),
                edge(c),
                face(a, c),
                cell_point(cell),
                face(b, c),
            ]);
        }
    }
    // Creases are cut in two.
    let mut creases = Vec::with_capacity(2 * features.creases.len());
    for edge in &features.creases {
        let place = topology
            .edges
            .binary_search(edge)
            .map_err(|_| format!("the crease {edge:?} is not an edge of the mesh"))?;
        let middle = edge_point(place as u32);
        creases.extend(edge.map(|end| [end, middle]));
    }
    creases.sort_unstable();
    let mut result = MixedMesh {
        points: vec![[0.0; 3]; middle.rows()],
        hexahedra,
        ..MixedMesh::default()
    };
    let fine = result.topology()?;

    // Every vertex from the cells of the least submanifold that it lies on.
    let mut around: Vec<Vec<&[u32]>> = vec![Vec::new(); middle.rows()];
    let mut rank = vec![3_u8; middle.rows()];
    let lists: [(u8, Vec<&[u32]>); 3] = [
        (1, creases.iter().map(|crease| crease.as_slice()).collect()),
        (2, fine.boundary().map(|(_, face)| face.corners()).collect()),
        (3, result.hexahedra.iter().map(|corners| corners.as_slice()).collect()),
    ];
    for (dimension, cells) in &lists {
        for corner in cells.iter().copied().flatten() {
            let own = &mut rank[*corner as usize];
            *own = (*own).min(*dimension);
        }
    }
    for &corner in &features.corners {
        rank[corner as usize] = 0;
    }
    for (dimension, cells) in &lists {
        for &cell in cells {
            for &corner in cell {
                if rank[corner as usize] == *dimension {
                    around[corner as usize].push(cell);
                }
            }
        }
    }
    let averaged = around.iter().enumerate().map(|(vertex, cells)| {
        if cells.is_empty() {
            return vec![(vertex as u32, 1.0)];
        }
        let weight = 1.0 / cells.len() as f64;
        let corners = cells.iter().flat_map(|cell| {
            let share = weight / cell.len() as f64;
            cell.iter().map(move |&corner| (corner, share))
        });
        corners.collect()
    });
    let map = LinearMap::from_rows(middle.rows(), averaged).after(&middle);
    let mut points = vec![[0.0; 3]; map.rows()];
    map.apply(&mesh.points, &mut points);
    result.points = points;
    Ok(Subdivided {
        mesh: result,
        map,
        features: Features {
            creases,
            corners: features.corners.clone(),
        },
    })
}
