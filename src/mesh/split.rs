//! Conforming subdivision of a tetrahedral mesh: chosen edges at their midpoints, chosen faces and tetrahedra at their
//! centroids, with every tetrahedron around them.
//!
//! Needed before a map with fixed boundary: an edge that joins two vertices of one flat side of the target, or a
//! tetrahedron with all its vertices on the boundary, can make every map onto the target fold.
//!
//! Guarantees: the result is conforming; orientation and volume are kept; new vertices come after the old ones in the
//! order in which the simplices were given; the pieces of a tetrahedron stand together in the place of the old one.
//! Does not guarantee: shape quality; each midpoint split halves a dihedral angle.

use super::TetrahedralMesh;
use super::connectivity::{self, Boundary, NONE};

/// A subdivided mesh and where its parts come from.
#[derive(Clone, Debug, PartialEq)]
pub struct Refinement {
    pub mesh: TetrahedralMesh,
    /// For every new vertex the vertices whose mean it is, filled up with [`NONE`]; they precede it in the numbering.
    pub parents: Vec<[u32; 4]>,
    /// The tetrahedron of the original mesh that every tetrahedron is a piece of.
    pub origin: Vec<u32>,
}

impl Refinement {
    /// Extends data on the old vertices to the new ones by the mean over their parents.
    pub fn carry(&self, data: &mut Vec<[f64; 3]>) {
        for parents in &self.parents {
            let count = parents.iter().take_while(|&&parent| parent != NONE).count();
            let mut sum = [0.0; 3];
            for &parent in &parents[..count] {
                let value = data[parent as usize];
                sum = std::array::from_fn(|axis| sum[axis] + value[axis]);
            }
            data.push(sum.map(|component| component / count as f64));
        }
    }

    /// This refinement followed by one of its mesh.
    fn then(mut self, next: Refinement) -> Refinement {
        self.parents.extend(next.parents);
        Refinement {
            mesh: next.mesh,
            parents: self.parents,
            origin: next.origin.iter().map(|&cell| self.origin[cell as usize]).collect(),
        }
    }
}

/// Splits the given simplices (edges, faces or tetrahedra as `K` vertices) at their centroids, and all tetrahedra that
/// contain them.
///
/// A tetrahedron with several of them is split by one after the other in the given order, so that neighbours agree on
/// their common face. Repeated simplices count once; those that the mesh does not have are passed over.
pub fn split<const K: usize>(mesh: &TetrahedralMesh, simplices: &[[u32; K]]) -> Refinement {
    if simplices.is_empty() {
        let origin = (0..mesh.cells.len() as u32).collect();
        return Refinement {
            mesh: mesh.clone(),
            parents: Vec::new(),
            origin,
        };
    }
    // Sorted keys, each with the rank of its first appearance.
    let mut keys: Vec<([u32; K], u32)> = simplices
        .iter()
        .enumerate()
        .map(|(rank, simplex)| {
            let mut key = *simplex;
            key.sort_unstable();
            (key, rank as u32)
        })
        .collect();
    keys.sort_unstable();
    keys.dedup_by_key(|&mut (key, _)| key);

    // Ranks of the simplices in every tetrahedron, ascending.
    let mut offsets = vec![0usize];
    let mut ranks: Vec<u32> = Vec::new();
    let mut present = vec![false; simplices.len()];
    for cell in &mesh.cells {
        let start = ranks.len();
        let mut sorted = *cell;
        sorted.sort_unstable();
        for subset in subsets::<K>() {
            let key = subset.map(|local| sorted[local]);
            if let Ok(place) = keys.binary_search_by(|(other, _)| other.cmp(&key)) {
                ranks.push(keys[place].1);
                present[keys[place].1 as usize] = true;
            }
        }
        ranks[start..].sort_unstable();
        offsets.push(ranks.len());
    }

    let mut points = mesh.points.clone();
    let mut parents = Vec::new();
    let mut number = vec![NONE; simplices.len()];
    for (rank, simplex) in simplices.iter().enumerate().filter(|&(rank, _)| present[rank]) {
        number[rank] = (mesh.points.len() + parents.len()) as u32;
        let mut all = [NONE; 4];
        all[..K].copy_from_slice(simplex);
        parents.push(all);
    }

    let mut cells = Vec::with_capacity(mesh.cells.len() + ranks.len() * K);
    let mut origin = Vec::with_capacity(cells.capacity());
    let (mut pieces, mut next) = (Vec::new(), Vec::new());
    for (index, &cell) in mesh.cells.iter().enumerate() {
        pieces.clear();
        pieces.push(cell);
        for &rank in &ranks[offsets[index]..offsets[index + 1]] {
            let simplex = &simplices[rank as usize];
            next.clear();
            for piece in &pieces {
                if simplex.iter().all(|vertex| piece.contains(vertex)) {
                    next.extend(
                        simplex.iter().map(|&gone| {
                            piece.map(|vertex| if vertex == gone { number[rank as usize] } else { vertex })
                        }),
                    );
                } else {
                    next.push(*piece);
                }
            }
            std::mem::swap(&mut pieces, &mut next);
        }
        cells.extend_from_slice(&pieces);
        origin.resize(cells.len(), index as u32);
    }
    let mut refined = Refinement {
        mesh: TetrahedralMesh::default(),
        parents,
        origin,
    };
    refined.carry(&mut points);
    refined.mesh = TetrahedralMesh { points, cells };
    refined
}

/// The subsets of `K` of the numbers 0 to 3, as ascending arrays.
fn subsets<const K: usize>() -> impl Iterator<Item = [usize; K]> {
    (0u8..16).filter(|bits| bits.count_ones() as usize == K).map(|bits| {
        let mut chosen = (0..4).filter(move |local| bits >> local & 1 == 1);
        std::array::from_fn(|_| chosen.next().expect("as many bits are set as the array is long"))
    })
}

/// Interior edges whose two vertices both lie on the boundary, in lexicographic order.
pub fn boundary_chords(mesh: &TetrahedralMesh, boundary: &Boundary) -> Vec<[u32; 2]> {
    let vertices = mesh.points.len();
    let on_surface = connectivity::edges(&boundary.triangles, vertices);
    let mut on_surface = on_surface.iter().peekable();
    let mut chords = connectivity::edges(&mesh.cells, vertices);
    // Both lists are sorted and the first contains the second: one sweep tells them apart.
    chords.retain(|edge| {
        if on_surface.next_if_eq(&edge).is_some() {
            return false;
        }
        edge.iter().all(|&vertex| boundary.mask[vertex as usize])
    });
    chords
}

/// Tetrahedra whose four vertices all lie on the boundary, ascending.
pub fn boundary_cells(mesh: &TetrahedralMesh, boundary: &Boundary) -> Vec<u32> {
    let all_on = |cell: &[u32; 4]| cell.iter().all(|&vertex| boundary.mask[vertex as usize]);
    (0..mesh.cells.len() as u32)
        .filter(|&cell| all_on(&mesh.cells[cell as usize]))
        .collect()
}

/// Interior faces whose three vertices all lie on the boundary, vertices ascending, in the order of their tetrahedra.
pub fn boundary_faces(mesh: &TetrahedralMesh, boundary: &Boundary) -> Vec<[u32; 3]> {
    let facets = connectivity::facets(&mesh.cells, mesh.points.len());
    let mut faces = Vec::new();
    for (index, (cell, neighbours)) in mesh.cells.iter().zip(&facets.neighbours).enumerate() {
        for (local, &neighbour) in neighbours.iter().enumerate() {
            let mut face = connectivity::TETRAHEDRON_FACETS[local].map(|corner| cell[corner]);
            let once = neighbour < connectivity::CROWDED && neighbour as usize > index;
            if once && face.iter().all(|&vertex| boundary.mask[vertex as usize]) {
                face.sort_unstable();
                faces.push(face);
            }
        }
    }
    faces
}

/// Frees the interior from the boundary: splits every interior edge that joins two boundary vertices, then every interior
/// face and then every tetrahedron still with all its vertices on the boundary. The boundary itself stays as it is.
pub fn separate_boundary(mesh: &TetrahedralMesh) -> Refinement {
    let mut boundary = connectivity::boundary(&mesh.cells, mesh.points.len());
    let edges = split(mesh, &boundary_chords(mesh, &boundary));
    // New vertices lie inside, and the triangles of the boundary stay.
    boundary.mask.resize(edges.mesh.points.len(), false);
    let faces = split(&edges.mesh, &boundary_faces(&edges.mesh, &boundary));
    let refined = edges.then(faces);
    boundary.mask.resize(refined.mesh.points.len(), false);
    let left: Vec<[u32; 4]> = boundary_cells(&refined.mesh, &boundary)
        .iter()
        .map(|&cell| refined.mesh.cells[cell as usize])
        .collect();
    let cells = split(&refined.mesh, &left);
    refined.then(cells)
}
