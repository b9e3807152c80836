//! The sets of vertices and edges that the systems speak of: the open domain, its boundary, and the rings outside.

use crate::linalg::sparse::Graph;
use crate::mesh::connectivity::{self, CROWDED, Facets, NONE};
use crate::mesh::{TriangleMesh, dot, length, subtract};
use crate::method::Failure;

/// Where a vertex stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the open domain: solved for.
    Interior,
    /// Fixed vertex of a triangle of the domain.
    Boundary,
    /// Outside, joined to a boundary vertex by an edge.
    FirstRing,
    /// Outside, joined to the first ring by an edge.
    SecondRing,
    Outside,
}

/// An edge of the domain's boundary, with the domain on its left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryEdge {
    pub vertices: [u32; 2],
    /// The triangle of the domain at the edge.
    pub triangle: u32,
    /// Unit vector in the plane of that triangle, away from the domain.
    pub conormal: [f64; 3],
    pub length: f64,
}

/// A domain within a mesh.
#[derive(Clone, Debug)]
pub struct Domain<'a> {
    pub mesh: &'a TriangleMesh,
    /// Whether a triangle belongs to the domain.
    pub inside: Vec<bool>,
    pub places: Vec<Place>,
    pub edges: Vec<BoundaryEdge>,
    pub graph: Graph,
    /// Whether a vertex lies on the boundary of the mesh.
    pub rim: Vec<bool>,
}

/// The triangles beside each triangle of a mesh, which has to be an oriented manifold: handles and boundary loops rely
/// on it.
///
/// # Errors
/// Names the first triangle or vertex where it is none, or two neighbours that are oriented against each other.
pub fn manifold(mesh: &TriangleMesh) -> Result<Facets<3>, Failure> {
    let vertices = mesh.points.len();
    let facets = connectivity::facets(&mesh.cells, vertices);
    if facets.crowded > 0 {
        return Err(Failure::invalid(format!(
            "{} edges have three or more triangles, the first at triangle {} (counted from 0); the surface must be a \
             manifold: separate the sheets there",
            facets.crowded, facets.first_crowded
        )));
    }
    if let Some(&pinched) = connectivity::pinched_vertices(&mesh.cells, vertices, &facets).first() {
        return Err(Failure::invalid(format!(
            "parts of the surface touch in the single vertex {pinched} (counted from 0); the surface must be a manifold: \
             split the vertex"
        )));
    }
    for (index, (cell, neighbours)) in mesh.cells.iter().zip(&facets.neighbours).enumerate() {
        for (corner, &neighbour) in neighbours.iter().enumerate() {
            let (from, to) = (cell[(corner + 1) % 3], cell[(corner + 2) % 3]);
            let same = |other: &[u32; 3]| (0..3).any(|i| other[i] == from && other[(i + 1) % 3] == to);
            if mesh.cells.get(neighbour as usize).is_some_and(same) {
                return Err(Failure::invalid(format!(
                    "triangles {index} and {neighbour} (counted from 0) run along their edge from vertex {from} to {to} in the \
                     same direction; turn one of them round, so that all are oriented alike (a surface with one side, \
                     such as a Moebius strip, has no such orientation)"
                )));
            }
        }
    }
    Ok(facets)
}

impl<'a> Domain<'a> {
    /// The domain of the triangles `inside`; its vertices with `free` are solved for.
    ///
    /// # Errors
    /// For a mesh that is not a manifold, no free vertex, or a part without a fixed one.
    pub fn new(mesh: &'a TriangleMesh, inside: Vec<bool>, free: &[bool]) -> Result<Self, Failure> {
        let vertices = mesh.points.len();
        let facets = manifold(mesh)?;
        let graph = Graph::of_cells(vertices, &mesh.cells, Some);
        let mut rim = vec![false; vertices];
        let mut edges = Vec::new();
        for (index, (cell, neighbours)) in mesh.cells.iter().zip(&facets.neighbours).enumerate() {
            for (corner, &neighbour) in neighbours.iter().enumerate() {
                let ends = [cell[(corner + 1) % 3], cell[(corner + 2) % 3]];
                if neighbour == NONE {
                    for end in ends {
                        rim[end as usize] = true;
                    }
                }
                let beyond = neighbour < CROWDED && inside[neighbour as usize];
                if inside[index] && !beyond {
                    edges.push(boundary_edge(mesh, index as u32, ends, cell[corner]));
                }
            }
        }
        let mut places = vec![Place::Outside; vertices];
        for (cell, _) in mesh.cells.iter().zip(&inside).filter(|(_, inside)| **inside) {
            for &vertex in cell {
                places[vertex as usize] = if free[vertex as usize] {
                    Place::Interior
                } else {
                    Place::Boundary
                };
            }
        }
        for (from, ring) in [
            (Place::Boundary, Place::FirstRing),
            (Place::FirstRing, Place::SecondRing),
        ] {
            for vertex in 0..vertices as u32 {
                let near = graph
                    .neighbours(vertex)
                    .iter()
                    .any(|&other| places[other as usize] == from);
                if places[vertex as usize] == Place::Outside && near {
                    places[vertex as usize] = ring;
                }
            }
        }
        let domain = Self {
            mesh,
            inside,
            places,
            edges,
            graph,
            rim,
        };
        domain.check()?;
        Ok(domain)
    }

    fn check(&self) -> Result<(), Failure> {
        if self.count(Place::Interior) == 0 {
            return Err(Failure::invalid(
                "the conditions leave no vertex free, so there is nothing to solve for; fix fewer vertices or take a \
                 finer mesh"
                    .to_string(),
            ));
        }
        let parts = connectivity::components(&self.mesh.cells, self.places.len());
        let mut fixed = vec![false; parts.count];
        let mut free = vec![None; parts.count];
        for (vertex, &part) in parts.of_vertex.iter().enumerate().filter(|(_, part)| **part != NONE) {
            match self.places[vertex] {
                Place::Interior => free[part as usize] = free[part as usize].or(Some(vertex)),
                _ => fixed[part as usize] = true,
            }
        }
        if let Some((_, Some(vertex))) = fixed.iter().zip(&free).find(|(fixed, free)| !**fixed && free.is_some()) {
            let parts = if parts.count > 1 {
                format!(
                    "the mesh has {} parts that do not hang together, and the one",
                    parts.count
                )
            } else {
                "the mesh".to_string()
            };
            return Err(Failure::invalid(format!(
                "{parts} with vertex {vertex} (counted from 0) has no fixed vertex, so its place is open; fix some of its \
                 vertices"
            )));
        }
        Ok(())
    }

    /// How many vertices stand at a place.
    pub fn count(&self, place: Place) -> usize {
        self.places.iter().filter(|&&other| other == place).count()
    }

    /// Region conditions of order 2 or 3 need as many full rings of fixed vertices, less one, around the boundary.
    ///
    /// # Errors
    /// Names the first vertex at which the fixed region is too thin.
    pub fn check_rings(&self, order: usize) -> Result<(), Failure> {
        let thin = |vertex: usize| match self.places[vertex] {
            Place::Boundary => self.rim[vertex],
            Place::FirstRing => order == 3 && self.rim[vertex],
            _ => false,
        };
        match (0..self.places.len()).find(|&vertex| thin(vertex)) {
            None => Ok(()),
            Some(vertex) => Err(Failure::invalid(format!(
                "the fixed region is too thin: vertex {vertex} (counted from 0) lies on the boundary of the mesh, with \
                 fewer than {order} rings of fixed vertices between it and the free ones; fix {order} rings or use \
                 condition = \"curve\""
            ))),
        }
    }

    /// Curve conditions need a boundary made of edges, and no free vertex on the rim of the mesh.
    ///
    /// # Errors
    /// Names a vertex that is fixed but on no boundary edge, or free on the boundary of the domain.
    pub fn check_curve(&self) -> Result<(), Failure> {
        let mut on_edge = vec![false; self.places.len()];
        for edge in &self.edges {
            for vertex in edge.vertices {
                on_edge[vertex as usize] = true;
            }
        }
        for (vertex, &place) in self.places.iter().enumerate() {
            if place == Place::Interior && on_edge[vertex] {
                return Err(Failure::invalid(format!(
                    "vertex {vertex} (counted from 0) is free but lies on the curve that bounds the domain; fix it, so \
                     that the curve is made of edges between fixed vertices"
                )));
            }
            if place == Place::Boundary && !on_edge[vertex] {
                return Err(Failure::invalid(format!(
                    "fixed vertex {vertex} (counted from 0) lies within the domain and on none of its boundary edges; \
                     curves must be made of edges: use condition = \"region\" for fixed points"
                )));
            }
        }
        Ok(())
    }
}

fn boundary_edge(mesh: &TriangleMesh, triangle: u32, vertices: [u32; 2], opposite: u32) -> BoundaryEdge {
    let [a, b] = vertices.map(|vertex| mesh.points[vertex as usize]);
    let along = subtract(b, a);
    let size = length(along);
    let inwards = subtract(mesh.points[opposite as usize], a);
    let share = dot(inwards, along) / (size * size);
    let across: [f64; 3] = std::array::from_fn(|axis| share * along[axis] - inwards[axis]);
    let height = length(across);
    BoundaryEdge {
        vertices,
        triangle,
        conormal: across.map(|component| component / height),
        length: size,
    }
}
