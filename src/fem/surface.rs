//! Linear elements on triangle surfaces: the cotangent Laplacian and mass matrices, full and lumped.
//!
//! With the hat functions `p_i` of the vertices, over the selected triangles:
//! `L_ij = - integral grad p_i . grad p_j` (negative semidefinite, rows sum to 0; Pinkall and Polthier 1993),
//! `M_ij = integral p_i p_j`, and its lumped forms: barycentric, a third of the area of every triangle around a vertex;
//! hybrid, the Voronoi area in triangles without an obtuse angle, else half the area at the obtuse corner and a quarter
//! at the others (Meyer et al. 2003). Weakly `L u = M (Laplacian of u)`.
//!
//! Only the shape of the triangles counts, not their place in space. Not guaranteed: a maximum principle; cotangents of
//! obtuse angles are negative.

use crate::linalg::sparse::Graph;
use crate::mesh::{TriangleMesh, cross, dot, length, subtract};

/// A symmetric sparse matrix over the vertices, rows compressed, with the diagonal; columns ascend within a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pattern {
    pub offsets: Vec<usize>,
    pub columns: Vec<u32>,
}

impl Pattern {
    /// The range of a row in `columns` and in the values.
    pub fn row(&self, vertex: u32) -> std::ops::Range<usize> {
        self.offsets[vertex as usize]..self.offsets[vertex as usize + 1]
    }

    /// Where an entry stands in `columns` and in the values; where it would stand if the row has no such entry.
    pub fn place(&self, row: u32, column: u32) -> usize {
        let range = self.row(row);
        range.start + self.columns[range].partition_point(|&other| other < column)
    }
}

/// The operators of a surface. Rows of vertices without a selected triangle are zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceOperators {
    /// One structure for `laplacian` and `mass`.
    pub pattern: Pattern,
    /// `L`, in length^0.
    pub laplacian: Vec<f64>,
    /// `M`, in length^2.
    pub mass: Vec<f64>,
    /// Diagonal of the barycentric lumping.
    pub barycentric: Vec<f64>,
    /// Diagonal of the hybrid lumping.
    pub hybrid: Vec<f64>,
}

/// A triangle without area, where cotangents are infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Degenerate {
    pub triangle: u32,
    pub vertices: [u32; 3],
}

impl std::fmt::Display for Degenerate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [a, b, c] = self.vertices;
        write!(
            f,
            "triangle {} (vertices {a}, {b}, {c}, counted from 0) has no area; move its vertices apart or remove it",
            self.triangle
        )
    }
}

impl std::error::Error for Degenerate {}

impl SurfaceOperators {
    /// Assembles over the triangles with `selected`.
    ///
    /// # Errors
    /// The first triangle whose area is below 1e-12 of its longest edge squared.
    pub fn new(mesh: &TriangleMesh, selected: &[bool]) -> Result<Self, Degenerate> {
        Self::on_graph(mesh, &Graph::of_cells(mesh.points.len(), &mesh.cells, Some), selected)
    }

    /// The same with the graph of the mesh's edges, where it is at hand.
    ///
    /// # Errors
    /// As [`SurfaceOperators::new`].
    pub fn on_graph(mesh: &TriangleMesh, graph: &Graph, selected: &[bool]) -> Result<Self, Degenerate> {
        let vertices = mesh.points.len();
        let mut pattern = Pattern {
            offsets: Vec::with_capacity(vertices + 1),
            columns: Vec::with_capacity(graph.neighbours.len() + vertices),
        };
        pattern.offsets.push(0);
        for vertex in 0..vertices as u32 {
            let neighbours = graph.neighbours(vertex);
            let split = neighbours.partition_point(|&other| other < vertex);
            pattern.columns.extend_from_slice(&neighbours[..split]);
            pattern.columns.push(vertex);
            pattern.columns.extend_from_slice(&neighbours[split..]);
            pattern.offsets.push(pattern.columns.len());
        }
        let mut found = Self {
            laplacian: vec![0.0; pattern.columns.len()],
            mass: vec![0.0; pattern.columns.len()],
            barycentric: vec![0.0; vertices],
            hybrid: vec![0.0; vertices],
            pattern,
        };
        let diagonal: Vec<usize> = (0..vertices as u32).map(|v| found.pattern.place(v, v)).collect();
        for (index, (&cell, _)) in mesh.cells.iter().zip(selected).enumerate().filter(|(_, (_, on))| **on) {
            let corners = mesh.corners(cell);
            let edges: [[f64; 3]; 3] = std::array::from_fn(|i| subtract(corners[(i + 2) % 3], corners[(i + 1) % 3]));
            let squares = edges.map(|edge| dot(edge, edge));
            let doubled = length(cross(edges[0], edges[1]));
            let longest = squares.iter().copied().fold(0.0, f64::max);
            if !(doubled > 1e-12 * longest) {
                return Err(Degenerate {
                    triangle: index as u32,
                    vertices: cell,
                });
            }
            let area = doubled / 2.0;
            let cotangent: [f64; 3] = std::array::from_fn(|i| -dot(edges[(i + 1) % 3], edges[(i + 2) % 3]) / doubled);
            let obtuse = cotangent.iter().any(|&cotangent| cotangent < 0.0);
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let vertex = cell[i] as usize;
                found.barycentric[vertex] += area / 3.0;
                found.hybrid[vertex] += if !obtuse {
                    (squares[j] * cotangent[j] + squares[k] * cotangent[k]) / 8.0
                } else if cotangent[i] < 0.0 {
                    area / 2.0
                } else {
                    area / 4.0
                };
                found.mass[diagonal[vertex]] += area / 6.0;
                // The corners j and k face the edges that meet in i.
                found.laplacian[diagonal[vertex]] -= (cotangent[j] + cotangent[k]) / 2.0;
                for (from, to) in [(cell[j], cell[k]), (cell[k], cell[j])] {
                    let place = found.pattern.place(from, to);
                    found.laplacian[place] += cotangent[i] / 2.0;
                    found.mass[place] += area / 12.0;
                }
            }
        }
        Ok(found)
    }
}

/// The mean over the triangles of the mean length of their edges; edges between two triangles count twice.
pub fn mean_edge_length(mesh: &TriangleMesh) -> f64 {
    let sum: f64 = mesh
        .cells
        .iter()
        .map(|&cell| {
            let [a, b, c] = mesh.corners(cell);
            length(subtract(b, a)) + length(subtract(c, b)) + length(subtract(a, c))
        })
        .sum();
    sum / (3.0 * mesh.cells.len() as f64)
}
