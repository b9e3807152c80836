//! Meshes in flat arrays: triangle surfaces and tetrahedral volumes, their connectivity, generators, readers and writers.
//!
//! Nothing here opens a file: readers take bytes, writers take `std::io::Write`.

pub mod format;

/// A mesh of cells with `N` vertices each: `points` in model units, `cells` as indices into `points`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh<const N: usize> {
    pub points: Vec<[f64; 3]>,
    pub cells: Vec<[u32; N]>,
}

/// Triangles; a positive orientation is counter-clockwise seen from outside.
pub type TriangleMesh = Mesh<3>;
/// Tetrahedra (0,1,2,3), positively oriented when `det[x1-x0, x2-x0, x3-x0] > 0`.
pub type TetrahedralMesh = Mesh<4>;
