//! Surfaces of triangles and quadrilaterals together, with no demand on how they hang together.

use super::{TriangleMesh, area_vector, cross, dot, format::Content, length, subtract};

/// Points, triangles and quadrilaterals; indices refer to `points`. Faces count triangles first, then quadrilaterals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    pub points: Vec<[f64; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub quads: Vec<[u32; 4]>,
}

/// An edge with the faces at it.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// The smaller vertex first.
    pub ends: [u32; 2],
    /// Ascending; two in the interior of a manifold.
    pub faces: Vec<u32>,
}

impl Surface {
    /// The triangles and quadrilaterals of a mesh file; vertices that none of them uses are left out.
    ///
    /// # Errors
    /// When there are none, an index is out of range or a coordinate is not finite.
    pub fn from_content(content: &Content) -> Result<Surface, String> {
        content.cells().check(content.points.len())?;
        if content.triangles.is_empty() && content.quads.is_empty() {
            let volumes = content.tetrahedra.len() + content.hexahedra.len() + content.prisms.len();
            if volumes > 0 {
                return Err(format!(
                    "there are {volumes} solid cells but no triangles or quadrilaterals; give the surface of the volume, or \
                     the file with its boundary faces"
                ));
            }
            return Err(format!(
                "there are {} points but no triangles or quadrilaterals; give a surface",
                content.points.len()
            ));
        }
        if let Some(vertex) = content
            .points
            .iter()
            .position(|point| point.iter().any(|x| !x.is_finite()))
        {
            return Err(format!(
                "vertex {vertex} (counted from 0) has a coordinate that is not finite"
            ));
        }
        let mut surface = Surface {
            points: content.points.clone(),
            triangles: content.triangles.clone(),
            quads: content.quads.clone(),
        };
        surface.drop_unused();
        Ok(surface)
    }

    /// Triangles with vertices of the same coordinates made one, and without flat ones. All points stay.
    pub fn welded(mesh: &TriangleMesh) -> Surface {
        let key = |vertex: u32| mesh.points[vertex as usize].map(|x| (x + 0.0).to_bits());
        let mut order: Vec<u32> = (0..mesh.points.len() as u32).collect();
        order.sort_unstable_by_key(|&vertex| (key(vertex), vertex));
        let mut first = vec![0u32; mesh.points.len()];
        for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
            for &vertex in same {
                first[vertex as usize] = same[0];
            }
        }
        Surface {
            points: mesh.points.clone(),
            triangles: mesh
                .cells
                .iter()
                .filter(|&&cell| length(area_vector(mesh.corners(cell))) > 0.0)
                .map(|cell| cell.map(|vertex| first[vertex as usize]))
                .collect(),
            quads: Vec::new(),
        }
    }

    /// Leaves out points that no face uses; returns how many.
    pub fn drop_unused(&mut self) -> usize {
        let mut used = vec![false; self.points.len()];
        let corners = self.triangles.as_flattened().iter().chain(self.quads.as_flattened());
        corners.for_each(|&vertex| used[vertex as usize] = true);
        let before = self.points.len();
        let mut place = vec![0u32; before];
        let mut kept = 0;
        for vertex in 0..before {
            place[vertex] = kept as u32;
            if used[vertex] {
                self.points[kept] = self.points[vertex];
                kept += 1;
            }
        }
        self.points.truncate(kept);
        let corners = self.triangles.as_flattened_mut().iter_mut();
        corners
            .chain(self.quads.as_flattened_mut())
            .for_each(|vertex| *vertex = place[*vertex as usize]);
        before - kept
    }

    /// Number of faces.
    pub fn faces(&self) -> usize {
        self.triangles.len() + self.quads.len()
    }

    /// The corners of a face in order.
    pub fn face(&self, face: usize) -> &[u32] {
        match face.checked_sub(self.triangles.len()) {
            None => &self.triangles[face],
            Some(quad) => &self.quads[quad],
        }
    }

    /// The centre of a face: the mean of its corners.
    pub fn centre(&self, face: usize) -> [f64; 3] {
        let corners = self.face(face);
        let share = 1.0 / corners.len() as f64;
        std::array::from_fn(|axis| {
            corners
                .iter()
                .map(|&corner| share * self.points[corner as usize][axis])
                .sum()
        })
    }

    /// The triangles, and every quadrilateral as two triangles, cut from its first corner to its third.
    pub fn cut(&self) -> Vec<[u32; 3]> {
        let halves = |&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]];
        let mut cells = self.triangles.clone();
        cells.extend(self.quads.iter().flat_map(halves));
        cells
    }

    /// The face that each triangle of [`Surface::cut`] belongs to.
    pub fn cut_faces(&self) -> Vec<u32> {
        let triangles = self.triangles.len() as u32;
        let halves = (0..self.quads.len() as u32).flat_map(|quad| [triangles + quad; 2]);
        (0..triangles).chain(halves).collect()
    }

    /// The surface as triangles.
    pub fn triangulated(&self) -> TriangleMesh {
        TriangleMesh {
            points: self.points.clone(),
            cells: self.cut(),
        }
    }

    /// The edges in lexicographic order of their ends. A face that names a vertex twice in a row has no edge there.
    pub fn edges(&self) -> Vec<Edge> {
        let mut all: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * self.triangles.len() + 4 * self.quads.len());
        for face in 0..self.faces() {
            let corners = self.face(face);
            for (index, &a) in corners.iter().enumerate() {
                let b = corners[(index + 1) % corners.len()];
                if a != b {
                    all.push(([a.min(b), a.max(b)], face as u32));
                }
            }
        }
        all.sort_unstable();
        all.dedup();
        all.chunk_by(|a, b| a.0 == b.0)
            .map(|same| Edge {
                ends: same[0].0,
                faces: same.iter().map(|&(_, face)| face).collect(),
            })
            .collect()
    }

    /// Twice the oriented area of a face, by its diagonals where it has four corners.
    pub fn face_vector(&self, face: usize) -> [f64; 3] {
        let point = |index: usize| self.points[self.face(face)[index] as usize];
        if face < self.triangles.len() {
            cross(subtract(point(1), point(0)), subtract(point(2), point(0)))
        } else {
            cross(subtract(point(2), point(0)), subtract(point(3), point(1)))
        }
    }

    /// Edges between two faces whose normals differ by more than `angle` degrees, whatever the faces' orientation, or
    /// that have one face or more than two.
    pub fn creases(&self, angle: f64) -> Vec<[u32; 2]> {
        let least = angle.to_radians().cos();
        let runs = |face: u32, [a, b]: [u32; 2]| {
            let corners = self.face(face as usize);
            (0..corners.len()).any(|index| corners[index] == a && corners[(index + 1) % corners.len()] == b)
        };
        self.edges()
            .into_iter()
            .filter(|edge| match edge.faces[..] {
                [first, second] => {
                    let (one, two) = (self.face_vector(first as usize), self.face_vector(second as usize));
                    // Neighbours that run along their edge in the same direction are oriented differently.
                    let sign = if runs(first, edge.ends) == runs(second, edge.ends) {
                        -1.0
                    } else {
                        1.0
                    };
                    sign * dot(one, two) < least * length(one) * length(two)
                }
                _ => true,
            })
            .map(|edge| edge.ends)
            .collect()
    }

    /// The scaled Jacobian of every face: over its corners the least of `n . (a x b) / (|a| |b|)` with the edges `a`, `b`
    /// at the corner and the face's unit normal; over the same of the regular triangle where it has three corners. 1 for
    /// a rectangle and a regular triangle, negative where a quadrilateral folds over, 0 without area or out of range.
    pub fn scaled_jacobians(&self) -> Vec<f64> {
        (0..self.faces())
            .map(|face| {
                let corners = self.face(face);
                let normal = self.face_vector(face);
                let size = length(normal);
                if !(size > 0.0 && size.is_finite()) {
                    return 0.0;
                }
                let count = corners.len();
                let point = |index: usize| self.points[corners[index % count] as usize];
                let least = (0..count)
                    .map(|index| {
                        let ahead = subtract(point(index + 1), point(index));
                        let back = subtract(point(index + count - 1), point(index));
                        let lengths = length(ahead) * length(back);
                        if lengths > 0.0 {
                            dot(normal, cross(ahead, back)) / (size * lengths)
                        } else {
                            0.0
                        }
                    })
                    .fold(f64::INFINITY, f64::min);
                if count == 3 { least * 2.0 / 3.0f64.sqrt() } else { least }
            })
            .collect()
    }
}
