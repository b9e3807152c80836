//! What a reader wants to know of a mesh: counts, sizes, boundary, topology, quality.

use super::connectivity::{self, Boundary, Surface};
use super::quality::{self, Spread};
use super::{TetrahedralMesh, TriangleMesh, bounding_box};

/// What there is to say about a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// 3 for triangles, 4 for tetrahedra.
    pub corners: usize,
    pub vertices: usize,
    pub edges: usize,
    pub cells: usize,
    /// Lower and upper corner.
    pub bounding_box: [[f64; 3]; 2],
    /// Volume of tetrahedra; area of triangles.
    pub measure: f64,
    /// Area of the boundary of tetrahedra; the volume inside a closed surface.
    pub second_measure: Option<f64>,
    /// Parts that share no vertex.
    pub components: usize,
    pub boundary_vertices: usize,
    /// Boundary triangles of tetrahedra; boundary edges of triangles.
    pub boundary_facets: usize,
    /// The components of the boundary of tetrahedra; of the surface itself for triangles.
    pub surfaces: Vec<Surface>,
    /// Interior edges that join two boundary vertices; zero for triangles.
    pub boundary_chords: usize,
    /// Tetrahedra with four boundary vertices; zero for triangles.
    pub boundary_cells: usize,
    /// Of tetrahedra only.
    pub scaled_jacobian: Option<Spread>,
    /// Dihedral angles of tetrahedra, angles of triangles, in degrees.
    pub angles: Option<Spread>,
    pub edge_length: Option<Spread>,
}

/// Sums up a mesh that has no error by [`super::check`], or at least sound indices and coordinates; `None` without
/// points.
pub fn summarize_tetrahedra(mesh: &TetrahedralMesh) -> Option<Summary> {
    let vertices = mesh.points.len();
    let boundary: Boundary = connectivity::boundary(&mesh.cells, vertices);
    let surface = TriangleMesh {
        points: mesh.points.clone(),
        cells: boundary.triangles.clone(),
    };
    Some(Summary {
        corners: 4,
        vertices,
        edges: connectivity::edges(&mesh.cells, vertices).len(),
        cells: mesh.cells.len(),
        bounding_box: bounding_box(&mesh.points)?,
        measure: mesh.volume(),
        second_measure: Some(surface.area()),
        components: connectivity::components(&mesh.cells, vertices).count,
        boundary_vertices: boundary.vertices.len(),
        boundary_facets: boundary.triangles.len(),
        surfaces: connectivity::surface_topology(&surface.cells, vertices).components,
        boundary_chords: super::split::boundary_chords(mesh, &boundary).len(),
        boundary_cells: super::split::boundary_cells(mesh, &boundary).len(),
        scaled_jacobian: quality::scaled_jacobians(mesh),
        angles: quality::all_dihedral_angles(mesh),
        edge_length: quality::edge_lengths(mesh),
    })
}

/// As [`summarize_tetrahedra`], for triangles.
pub fn summarize_triangles(mesh: &TriangleMesh) -> Option<Summary> {
    let vertices = mesh.points.len();
    let topology = connectivity::surface_topology(&mesh.cells, vertices);
    let closed = topology.boundary_edges == 0 && topology.components.iter().all(|part| part.genus.is_some());
    Some(Summary {
        corners: 3,
        vertices,
        edges: topology.components.iter().map(|part| part.edges).sum(),
        cells: mesh.cells.len(),
        bounding_box: bounding_box(&mesh.points)?,
        measure: mesh.area(),
        second_measure: closed.then(|| mesh.enclosed_volume()),
        components: topology.components.len(),
        boundary_vertices: topology.boundary_vertices,
        boundary_facets: topology.boundary_edges,
        surfaces: topology.components,
        boundary_chords: 0,
        boundary_cells: 0,
        scaled_jacobian: None,
        angles: quality::triangle_angles(mesh),
        edge_length: quality::edge_lengths(mesh),
    })
}

impl Summary {
    /// The summary as lines of a label and a value.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let solid = self.corners == 4;
        let point = |p: [f64; 3]| format!("({}, {}, {})", number(p[0]), number(p[1]), number(p[2]));
        let spread = |s: &Option<Spread>| match s {
            Some(s) => format!("{} to {}, mean {}", number(s.min), number(s.max), number(s.mean)),
            None => "undefined".to_string(),
        };
        let [low, high] = self.bounding_box;
        let mut rows = vec![
            ("vertices", self.vertices.to_string()),
            ("edges", self.edges.to_string()),
            (if solid { "tetrahedra" } else { "triangles" }, self.cells.to_string()),
            ("box", format!("{} to {}", point(low), point(high))),
            (if solid { "volume" } else { "area" }, number(self.measure)),
        ];
        if let Some(measure) = self.second_measure {
            rows.push((if solid { "boundary area" } else { "volume inside" }, number(measure)));
        }
        rows.push(("components", self.components.to_string()));
        let facets = if solid { "triangles" } else { "edges" };
        rows.push((
            "boundary",
            format!("{} vertices, {} {facets}", self.boundary_vertices, self.boundary_facets),
        ));
        // Parts beyond the first few would only repeat themselves.
        let surfaces = self.surfaces.iter().take(5).map(|part| {
            let genus = part
                .genus
                .map_or("no manifold".to_string(), |genus| format!("genus {genus}"));
            let rim = match part.loops {
                0 => "closed".to_string(),
                1 => "1 boundary loop".to_string(),
                loops => format!("{loops} boundary loops"),
            };
            format!("{genus}, {rim} ({} triangles)", part.triangles)
        });
        let mut surfaces = surfaces.collect::<Vec<_>>().join("; ");
        if self.surfaces.len() > 5 {
            surfaces += &format!("; and {} more", self.surfaces.len() - 5);
        }
        rows.push((if solid { "boundary surfaces" } else { "surfaces" }, surfaces));
        if solid {
            rows.push((
                "interior edges between boundary vertices",
                self.boundary_chords.to_string(),
            ));
            rows.push((
                "tetrahedra with boundary vertices only",
                self.boundary_cells.to_string(),
            ));
            rows.push(("scaled Jacobian", spread(&self.scaled_jacobian)));
        }
        rows.push((
            if solid {
                "dihedral angles (degrees)"
            } else {
                "angles (degrees)"
            },
            spread(&self.angles),
        ));
        rows.push(("edge lengths", spread(&self.edge_length)));
        rows
    }
}

/// A number with six significant digits, without trailing zeros.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 {
            "0".to_string()
        } else {
            value.to_string()
        };
    }
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    if (1e-4..1e9).contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}
