//! Whether the boundary alone forbids a map without inversions, and splits that make room where the mesh is to blame.
//!
//! Three obstacles occur in practice, all visible before any optimization:
//!
//! 1. A boundary triangle that is turned over or flattened on a planar face of the target. The tetrahedron behind it has
//!    its fourth vertex inside the target, so it is inverted or flat in every map: each such tetrahedron raises the lower
//!    bound of inversions by one. Only another target mends it.
//! 2. An interior edge or face whose vertices all lie on one planar face of the target. Its image lies in that plane,
//!    while the tetrahedra around it must fill all sides of it. A split at its middle mends it.
//! 3. A tetrahedron with all four vertices on the boundary whose image is inverted or flat. Nothing can move it; a split
//!    frees it.
//!
//! Planar faces are found on any target: triangles are gathered across edges while their vertices stay on one plane. On
//! a curved target only the third check applies. Orientation is decided by exact predicates, but whether vertices lie on
//! one plane by a tolerance: an obstacle of the first two kinds is certain only as far as the target's faces are flat to
//! rounding. Not guaranteed: that a boundary which passes has a map without inversions; no complete test is known in
//! three dimensions.

use crate::mesh::connectivity::{self, Boundary, NONE};
use crate::mesh::split::{self, Refinement};
use crate::mesh::{self, TetrahedralMesh};

/// Distance from a plane, relative to the diagonal of the target's box, up to which a vertex lies on it.
const PLANE_TOLERANCE: f64 = 1e-7;
/// Cosine between a triangle's normal and a plane's, below which the triangle belongs to another face although it is so
/// thin that its vertices are near the plane.
const NORMAL_TOLERANCE: f64 = 0.9;

/// Planar faces of the target, made of two or more boundary triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarFaces {
    /// Number of faces.
    pub count: usize,
    /// The face of every boundary triangle, [`NONE`] for a triangle on no planar face.
    pub of_triangle: Vec<u32>,
    /// Outward normal of each face: the side that most of its area shows.
    normals: Vec<[f64; 3]>,
    /// Faces at every vertex, ascending.
    of_vertex: Vec<Vec<u32>>,
}

impl PlanarFaces {
    /// Whether all these vertices lie on one planar face.
    fn common(&self, vertices: &[u32]) -> bool {
        let Some((&first, others)) = vertices.split_first() else {
            return false;
        };
        self.of_vertex[first as usize].iter().any(|face| {
            others
                .iter()
                .all(|&vertex| self.of_vertex[vertex as usize].contains(face))
        })
    }
}

/// Finds the planar faces of the boundary's image. `positions` holds a point for every vertex of the mesh.
pub fn planar_faces(triangles: &[[u32; 3]], positions: &[[f64; 3]]) -> PlanarFaces {
    let corners = |triangle: u32| triangles[triangle as usize].map(|vertex| positions[vertex as usize]);
    let vectors: Vec<[f64; 3]> = (0..triangles.len() as u32)
        .map(|index| mesh::area_vector(corners(index)))
        .collect();
    let on_boundary: Vec<[f64; 3]> = triangles
        .iter()
        .flatten()
        .map(|&vertex| positions[vertex as usize])
        .collect();
    let tolerance = PLANE_TOLERANCE * mesh::diagonal(&on_boundary);
    let facets = connectivity::facets(triangles, positions.len());

    // The largest triangles have the most trustworthy planes.
    let mut seeds: Vec<u32> = (0..triangles.len() as u32).collect();
    let area = |index: u32| mesh::length(vectors[index as usize]);
    seeds.sort_by(|&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));

    let mut of_triangle = vec![NONE; triangles.len()];
    let mut tried = vec![NONE; triangles.len()];
    let mut normals = Vec::new();
    let mut region = Vec::new();
    for &seed in &seeds {
        if of_triangle[seed as usize] != NONE || area(seed) == 0.0 {
            continue;
        }
        region.clear();
        region.push(seed);
        tried[seed as usize] = seed;
        let origin = corners(seed)[0];
        // Sum of area vectors turned to one side: the plane's normal sharpens as the region grows.
        let mut sum = vectors[seed as usize];
        let mut next = 0;
        while next < region.len() {
            for &neighbour in &facets.neighbours[region[next] as usize] {
                let index = neighbour as usize;
                if index >= triangles.len() || of_triangle[index] != NONE || tried[index] == seed {
                    continue;
                }
                tried[index] = seed;
                let size = mesh::length(sum);
                let normal = sum.map(|component| component / size);
                let off = |point: [f64; 3]| mesh::dot(mesh::subtract(point, origin), normal).abs();
                if corners(neighbour).iter().any(|&point| off(point) > tolerance) {
                    continue;
                }
                let along = mesh::dot(vectors[index], normal);
                if along.abs() < NORMAL_TOLERANCE * area(neighbour) {
                    continue;
                }
                let sign = if along < 0.0 { -1.0 } else { 1.0 };
                sum = std::array::from_fn(|axis| sum[axis] + sign * vectors[index][axis]);
                region.push(neighbour);
            }
            next += 1;
        }
        if region.len() < 2 {
            continue;
        }
        let size = mesh::length(sum);
        let normal = sum.map(|component| component / size);
        let shown: f64 = region
            .iter()
            .map(|&index| mesh::dot(vectors[index as usize], normal))
            .sum();
        normals.push(if shown < 0.0 {
            normal.map(|component| -component)
        } else {
            normal
        });
        for &index in &region {
            of_triangle[index as usize] = normals.len() as u32 - 1;
        }
    }

    let mut of_vertex = vec![Vec::new(); positions.len()];
    for (triangle, &face) in triangles.iter().zip(&of_triangle).filter(|&(_, &face)| face != NONE) {
        for &vertex in triangle {
            let faces: &mut Vec<u32> = &mut of_vertex[vertex as usize];
            if let Err(place) = faces.binary_search(&face) {
                faces.insert(place, face);
            }
        }
    }
    PlanarFaces {
        count: normals.len(),
        of_triangle,
        normals,
        of_vertex,
    }
}

/// What the boundary forces, by vertices of the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacles {
    pub planar_faces: usize,
    /// Boundary triangles turned over on their planar target face.
    pub inverted_triangles: Vec<[u32; 3]>,
    /// Boundary triangles without area on their planar target face.
    pub flat_triangles: Vec<[u32; 3]>,
    /// Interior edges within one planar target face.
    pub edges: Vec<[u32; 2]>,
    /// Interior faces within one planar target face.
    pub faces: Vec<[u32; 3]>,
    /// Tetrahedra with all vertices on the boundary and an inverted or flat image.
    pub tetrahedra: Vec<u32>,
    /// Tetrahedra that are inverted or flat in every map.
    pub lower_bound: usize,
}

impl Obstacles {
    /// Whether some tetrahedron is inverted or flat in every map of this connectivity.
    pub fn forbid(&self) -> bool {
        self.lower_bound > 0
    }

    /// The obstacles in a sentence each, with the first few of each kind by vertex or cell number.
    pub fn sentences(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        let mut say = |count: usize, one: &str, many: &str, list: String| {
            if count > 0 {
                let what = if count == 1 { one } else { many };
                sentences.push(format!("{count} {what}: {list}"));
            }
        };
        say(
            self.inverted_triangles.len(),
            "boundary triangle is turned over on its planar target face",
            "boundary triangles are turned over on their planar target faces",
            first_of(&self.inverted_triangles, |triangle| format!("{triangle:?}")),
        );
        say(
            self.flat_triangles.len(),
            "boundary triangle has no area on its planar target face",
            "boundary triangles have no area on their planar target faces",
            first_of(&self.flat_triangles, |triangle| format!("{triangle:?}")),
        );
        say(
            self.edges.len(),
            "interior edge lies within one planar target face",
            "interior edges lie within one planar target face",
            first_of(&self.edges, |edge| format!("{edge:?}")),
        );
        say(
            self.faces.len(),
            "interior face lies within one planar target face",
            "interior faces lie within one planar target face",
            first_of(&self.faces, |face| format!("{face:?}")),
        );
        say(
            self.tetrahedra.len(),
            "tetrahedron has all vertices on the boundary, which inverts or flattens it",
            "tetrahedra have all vertices on the boundary, which inverts or flattens them",
            first_of(&self.tetrahedra, |cell| format!("{cell}")),
        );
        sentences
    }
}

/// At most ten of a list, and how many more there are.
fn first_of<T>(list: &[T], show: impl Fn(&T) -> String) -> String {
    const SHOWN: usize = 10;
    let mut text = list.iter().take(SHOWN).map(show).collect::<Vec<_>>().join(", ");
    if list.len() > SHOWN {
        text.push_str(&format!(" and {} more", list.len() - SHOWN));
    }
    text
}

/// Looks for all obstacles. `positions` holds a point for every vertex; only those of boundary vertices are read.
pub fn check(source: &TetrahedralMesh, boundary: &Boundary, positions: &[[f64; 3]]) -> Obstacles {
    let planar = planar_faces(&boundary.triangles, positions);
    let mut inverted_triangles = Vec::new();
    let mut flat_triangles = Vec::new();
    let mut stuck = Vec::new();
    for (index, &triangle) in boundary.triangles.iter().enumerate() {
        let face = planar.of_triangle[index];
        if face == NONE {
            continue;
        }
        let side = side(
            triangle.map(|vertex| positions[vertex as usize]),
            planar.normals[face as usize],
        );
        if side < 0.0 {
            inverted_triangles.push(triangle);
        } else if side == 0.0 {
            flat_triangles.push(triangle);
        }
        if side <= 0.0 {
            stuck.push(boundary.cells[index]);
        }
    }
    let mut edges = split::boundary_chords(source, boundary);
    edges.retain(|edge| planar.common(edge));
    let mut faces = split::boundary_faces(source, boundary);
    faces.retain(|face| planar.common(face));
    let mut tetrahedra = split::boundary_cells(source, boundary);
    tetrahedra.retain(|&cell| !positive(source.cells[cell as usize], positions));
    stuck.extend_from_slice(&tetrahedra);
    stuck.sort_unstable();
    stuck.dedup();
    Obstacles {
        planar_faces: planar.count,
        inverted_triangles,
        flat_triangles,
        edges,
        faces,
        tetrahedra,
        lower_bound: stuck.len(),
    }
}

/// Sign of the triangle seen against `normal`: its exact orientation in the coordinate plane that the normal faces most.
fn side(corners: [[f64; 3]; 3], normal: [f64; 3]) -> f64 {
    let axis = (0..3).fold(0, |best, axis| {
        if normal[axis].abs() > normal[best].abs() {
            axis
        } else {
            best
        }
    });
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let [a, b, c] = corners.map(|point| robust::Coord {
        x: point[u],
        y: point[v],
    });
    let turn = robust::orient2d(a, b, c);
    if normal[axis] < 0.0 { -turn } else { turn }
}

/// Whether the image of a tetrahedron is positively oriented, decided exactly.
fn positive(cell: [u32; 4], positions: &[[f64; 3]]) -> bool {
    let [a, b, c, d] = cell.map(|vertex| {
        let [x, y, z] = positions[vertex as usize];
        robust::Coord3D { x, y, z }
    });
    // The predicate is positive when `d` lies below the plane in which a, b, c turn counter-clockwise.
    robust::orient3d(a, b, c, d) < 0.0
}

/// The splits of [`split_needed`], counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Splits {
    pub edges: usize,
    pub faces: usize,
    pub tetrahedra: usize,
}

/// Splits what stands in the way: edges and faces within one planar target face, the interior edges of tetrahedra that
/// the boundary inverts, and then such tetrahedra as are left. `carry` is called with each refinement, to extend data on
/// vertices; `positions` is extended by means.
pub fn split_needed(
    source: &TetrahedralMesh,
    positions: &mut Vec<[f64; 3]>,
    mut carry: impl FnMut(&Refinement),
) -> (TetrahedralMesh, Splits) {
    let mut splits = Splits::default();
    let boundary = connectivity::boundary(&source.cells, source.points.len());
    let obstacles = check(source, &boundary, positions);

    let mut wanted = obstacles.edges.clone();
    let chords = split::boundary_chords(source, &boundary);
    for &cell in &obstacles.tetrahedra {
        let cell = source.cells[cell as usize];
        for &[i, j] in &connectivity::TETRAHEDRON_EDGES {
            let edge = [cell[i].min(cell[j]), cell[i].max(cell[j])];
            if chords.binary_search(&edge).is_ok() {
                wanted.push(edge);
            }
        }
    }
    wanted.sort_unstable();
    wanted.dedup();
    splits.edges = wanted.len();
    let mut refined = split::split(source, &wanted);
    refined.carry(positions);
    carry(&refined);

    // New vertices lie inside: the boundary and its planes stay as they are.
    let mut boundary = connectivity::boundary(&refined.mesh.cells, refined.mesh.points.len());
    let faces = check(&refined.mesh, &boundary, positions).faces;
    if !faces.is_empty() {
        splits.faces = faces.len();
        refined = split::split(&refined.mesh, &faces);
        refined.carry(positions);
        carry(&refined);
        boundary = connectivity::boundary(&refined.mesh.cells, refined.mesh.points.len());
    }

    let left = check(&refined.mesh, &boundary, positions).tetrahedra;
    if !left.is_empty() {
        splits.tetrahedra = left.len();
        let left: Vec<[u32; 4]> = left.iter().map(|&cell| refined.mesh.cells[cell as usize]).collect();
        refined = split::split(&refined.mesh, &left);
        refined.carry(positions);
        carry(&refined);
    }
    (refined.mesh, splits)
}
