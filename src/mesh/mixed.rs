//! Volumes of hexahedra, prisms and tetrahedra that share quads and triangles.
//!
//! Cells are numbered hexahedra first, then prisms, then tetrahedra. Corners are numbered as in VTK; every cell that
//! passed [`MixedMesh::from_content`] has positive volume. Faces are listed counter-clockwise seen from outside.
//!
//! Guaranteed after [`MixedMesh::topology`]: every face has one or two cells, and the boundary is closed. Not guaranteed:
//! that every point of a cell has a positive Jacobian, or that distant cells do not overlap.

use super::format::Content;
use super::{TriangleMesh, connectivity, cross, dot, subtract};

/// The kinds of cells a mixed mesh is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shape {
    Hexahedron,
    Prism,
    Tetrahedron,
}

impl Shape {
    pub const ALL: [Shape; 3] = [Shape::Hexahedron, Shape::Prism, Shape::Tetrahedron];

    pub fn name(self) -> &'static str {
        match self {
            Shape::Hexahedron => "hexahedron",
            Shape::Prism => "prism",
            Shape::Tetrahedron => "tetrahedron",
        }
    }

    /// The number of corners.
    pub fn corners(self) -> usize {
        match self {
            Shape::Hexahedron => 8,
            Shape::Prism => 6,
            Shape::Tetrahedron => 4,
        }
    }

    /// Local corners of every edge.
    pub fn edges(self) -> &'static [[usize; 2]] {
        match self {
            Shape::Hexahedron => &[
                [0, 1],
                [1, 2],
                [3, 2],
                [0, 3],
                [4, 5],
                [5, 6],
                [7, 6],
                [4, 7],
                [0, 4],
                [1, 5],
                [2, 6],
                [3, 7],
            ],
            Shape::Prism => &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
            Shape::Tetrahedron => &[[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]],
        }
    }

    /// Local corners of every face, counter-clockwise seen from outside; triangles before quads.
    pub fn faces(self) -> &'static [&'static [usize]] {
        match self {
            Shape::Hexahedron => &[
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
                &[0, 1, 5, 4],
                &[2, 3, 7, 6],
                &[0, 4, 7, 3],
                &[1, 2, 6, 5],
            ],
            Shape::Prism => &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]],
            Shape::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[0, 3, 2], &[1, 2, 3]],
        }
    }

    /// Corners of the canonical cell: the unit cube, the unit right triangle times `[0, 1]`, the unit right simplex.
    pub fn canonical(self) -> &'static [[f64; 3]] {
        match self {
            Shape::Hexahedron => &[
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [1.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                [1.0, 0.0, 1.0],
                [1.0, 1.0, 1.0],
                [0.0, 1.0, 1.0],
            ],
            Shape::Prism => &[
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                [1.0, 0.0, 1.0],
                [0.0, 1.0, 1.0],
            ],
            Shape::Tetrahedron => &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        }
    }

    /// Volume of the canonical cell.
    pub fn canonical_volume(self) -> f64 {
        match self {
            Shape::Hexahedron => 1.0,
            Shape::Prism => 0.5,
            Shape::Tetrahedron => 1.0 / 6.0,
        }
    }

    /// For every corner, the three corners that its edges lead to, in an order of positive determinant.
    pub fn corner_frames(self) -> &'static [[usize; 3]] {
        match self {
            Shape::Hexahedron => &[
                [1, 3, 4],
                [2, 0, 5],
                [3, 1, 6],
                [0, 2, 7],
                [7, 5, 0],
                [4, 6, 1],
                [5, 7, 2],
                [6, 4, 3],
            ],
            Shape::Prism => &[[1, 2, 3], [2, 0, 4], [0, 1, 5], [5, 4, 0], [3, 5, 1], [4, 3, 2]],
            Shape::Tetrahedron => &[[1, 2, 3], [2, 0, 3], [0, 1, 3], [0, 2, 1]],
        }
    }
}

/// A volume mesh of mixed cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MixedMesh {
    pub points: Vec<[f64; 3]>,
    pub hexahedra: Vec<[u32; 8]>,
    pub prisms: Vec<[u32; 6]>,
    pub tetrahedra: Vec<[u32; 4]>,
}

/// A face with its corners as listed by its first cell, counter-clockwise seen from outside that cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// The fourth is [`NONE`] for a triangle.
    pub corners: [u32; 4],
    /// The cells on both sides; the second is [`NONE`] on the boundary.
    pub cells: [u32; 2],
}

/// No corner, no cell.
pub const NONE: u32 = u32::MAX;

impl Face {
    pub fn corners(&self) -> &[u32] {
        &self.corners[..if self.corners[3] == NONE { 3 } else { 4 }]
    }

    pub fn on_boundary(&self) -> bool {
        self.cells[1] == NONE
    }
}

/// Edges and faces of a mesh, each once, and those of every cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// Smaller vertex first, in lexicographic order.
    pub edges: Vec<[u32; 2]>,
    /// In the order of their sorted corners, triangles and quads together.
    pub faces: Vec<Face>,
    /// Edges of every cell in the order of [`Shape::edges`].
    pub cell_edges: Vec<Vec<u32>>,
    /// Faces of every cell in the order of [`Shape::faces`].
    pub cell_faces: Vec<Vec<u32>>,
}

impl MixedMesh {
    pub fn cells(&self) -> usize {
        self.hexahedra.len() + self.prisms.len() + self.tetrahedra.len()
    }

    /// Shape and corners of a cell.
    pub fn cell(&self, index: usize) -> (Shape, &[u32]) {
        let (h, p) = (self.hexahedra.len(), self.prisms.len());
        if index < h {
            (Shape::Hexahedron, &self.hexahedra[index])
        } else if index < h + p {
            (Shape::Prism, &self.prisms[index - h])
        } else {
            (Shape::Tetrahedron, &self.tetrahedra[index - h - p])
        }
    }

    /// All cells in order.
    pub fn iter(&self) -> impl Iterator<Item = (Shape, &[u32])> {
        (0..self.cells()).map(|index| self.cell(index))
    }

    /// Adds a cell. Its number among all cells depends on its shape.
    pub fn push(&mut self, shape: Shape, corners: &[u32]) {
        match shape {
            Shape::Hexahedron => self.hexahedra.push(std::array::from_fn(|corner| corners[corner])),
            Shape::Prism => self.prisms.push(std::array::from_fn(|corner| corners[corner])),
            Shape::Tetrahedron => self.tetrahedra.push(std::array::from_fn(|corner| corners[corner])),
        }
    }

    /// From a file's content. Reversed cells are turned, points without a cell dropped; each is named in the notices.
    ///
    /// # Errors
    /// When there is no volume cell, a pyramid, a cell with a corner twice, or one without volume.
    pub fn from_content(content: &Content) -> Result<(MixedMesh, Vec<String>), String> {
        if let Some(pyramid) = content.pyramids.first() {
            return Err(format!(
                "the mesh holds {} pyramids, the first with vertices {pyramid:?}; only hexahedra, prisms and tetrahedra are \
                 supported: split the pyramids into tetrahedra together with their neighbours",
                content.pyramids.len()
            ));
        }
        let mut mesh = MixedMesh {
            points: content.points.clone(),
            hexahedra: content.hexahedra.clone(),
            prisms: content.prisms.clone(),
            tetrahedra: content.tetrahedra.clone(),
        };
        if mesh.cells() == 0 {
            return Err(format!(
                "the mesh has {} points but no hexahedra, prisms or tetrahedra; give a volume mesh",
                mesh.points.len()
            ));
        }
        for (index, (shape, corners)) in mesh.iter().enumerate() {
            for (place, corner) in corners.iter().enumerate() {
                if *corner as usize >= mesh.points.len() {
                    return Err(format!(
                        "{} {index} names vertex {corner}, but there are {} (from 0)",
                        shape.name(),
                        mesh.points.len()
                    ));
                }
                if corners[..place].contains(corner) {
                    return Err(format!(
                        "{} {index} with vertices {corners:?} has a vertex twice; remove the cell or make it another kind",
                        shape.name()
                    ));
                }
            }
        }
        let mut notices = mesh.drop_unused_points();
        let turned = mesh.turn_reversed();
        if turned > 0 {
            notices.push(format!("{turned} cells were numbered inside out and have been turned"));
        }
        Ok((mesh, notices))
    }

    /// Removes points that no cell uses.
    pub fn drop_unused_points(&mut self) -> Vec<String> {
        let mut used = vec![false; self.points.len()];
        for (_, corners) in self.iter() {
            for &corner in corners {
                used[corner as usize] = true;
            }
        }
        let unused = used.iter().filter(|&&used| !used).count();
        if unused == 0 {
            return Vec::new();
        }
        let mut names = vec![NONE; self.points.len()];
        let mut kept = Vec::with_capacity(self.points.len() - unused);
        for (vertex, point) in self.points.iter().enumerate() {
            if used[vertex] {
                names[vertex] = kept.len() as u32;
                kept.push(*point);
            }
        }
        self.points = kept;
        self.rename(&names);
        vec![format!("{unused} points belong to no cell and were left out")]
    }

    /// Replaces every vertex number by its entry in `names`.
    pub fn rename(&mut self, names: &[u32]) {
        let corners = self.hexahedra.as_flattened_mut().iter_mut();
        let corners = corners.chain(self.prisms.as_flattened_mut());
        for corner in corners.chain(self.tetrahedra.as_flattened_mut()) {
            *corner = names[*corner as usize];
        }
    }

    /// Turns cells that are numbered the other way round and counts them: in every connected part all cells are numbered
    /// as their neighbours are, and its volume is positive. A cell that folding has turned inside out is left alone.
    fn turn_reversed(&mut self) -> usize {
        let mut faces = Vec::new();
        for (index, (shape, corners)) in self.iter().enumerate() {
            for face in shape.faces() {
                let (sorted, cycle) = face_key(corners, face);
                faces.push((sorted, index, cycle));
            }
        }
        faces.sort_unstable();
        // Neighbours, and whether they are numbered alike: then their common face runs in opposite ways.
        let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); self.cells()];
        for pair in faces.windows(2) {
            let ((key, first, cycle), (other, second, cycle_there)) = (pair[0], pair[1]);
            if key == other {
                let corners = if cycle[3] == NONE { 3 } else { 4 };
                let alike = reversed_cycle(&cycle[..corners], &cycle_there);
                neighbours[first].push((second, alike));
                neighbours[second].push((first, alike));
            }
        }
        let volumes: Vec<f64> = self
            .iter()
            .map(|(shape, corners)| volume(&self.points, shape, corners))
            .collect();
        let mut turns: Vec<Option<bool>> = vec![None; volumes.len()];
        for start in 0..turns.len() {
            if turns[start].is_some() {
                continue;
            }
            turns[start] = Some(false);
            let mut part = vec![(start, false)];
            let mut next = 0;
            while let Some(&(cell, turn)) = part.get(next) {
                next += 1;
                for &(other, alike) in &neighbours[cell] {
                    if turns[other].is_none() {
                        turns[other] = Some(turn == alike);
                        part.push((other, turn == alike));
                    }
                }
            }
            let whole: f64 = part
                .iter()
                .map(|&(cell, turn)| if turn { -volumes[cell] } else { volumes[cell] })
                .sum();
            if whole < 0.0 {
                for (cell, turn) in part {
                    turns[cell] = Some(!turn);
                }
            }
        }
        let mut turned = 0;
        let mut turns = turns
            .into_iter()
            .map(|turn| turn == Some(true))
            .inspect(|&turn| turned += usize::from(turn));
        // The order of `iter`.
        for (cell, turn) in self.hexahedra.iter_mut().zip(&mut turns) {
            if turn {
                *cell = [cell[4], cell[5], cell[6], cell[7], cell[0], cell[1], cell[2], cell[3]];
            }
        }
        for (cell, turn) in self.prisms.iter_mut().zip(&mut turns) {
            if turn {
                *cell = [cell[3], cell[4], cell[5], cell[0], cell[1], cell[2]];
            }
        }
        for (cell, turn) in self.tetrahedra.iter_mut().zip(&mut turns) {
            if turn {
                cell.swap(2, 3);
            }
        }
        turned
    }

    /// Sum of the volumes, with faces taken as bilinear.
    pub fn volume(&self) -> f64 {
        self.iter()
            .map(|(shape, corners)| volume(&self.points, shape, corners))
            .sum()
    }

    /// Edges, faces and what they belong to.
    ///
    /// # Errors
    /// When a face belongs to three cells, two cells lie on the same side of a face, or the boundary is not closed.
    pub fn topology(&self) -> Result<Topology, String> {
        let cells = self.cells();
        let mut sets: Vec<(Vec<u32>, usize)> = self.iter().map(|cell| cell.1.to_vec()).zip(0..).collect();
        sets.iter_mut().for_each(|set| set.0.sort_unstable());
        sets.sort_unstable();
        if let Some(pair) = sets.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(format!(
                "cells {} and {} have the same vertices {:?}; remove one",
                pair[0].1, pair[1].1, pair[0].0
            ));
        }
        let mut edges = Vec::new();
        let mut faces = Vec::new();
        for (index, (shape, corners)) in self.iter().enumerate() {
            for &[a, b] in shape.edges() {
                edges.push([corners[a].min(corners[b]), corners[a].max(corners[b])]);
            }
            for (place, face) in shape.faces().iter().enumerate() {
                let (sorted, cycle) = face_key(corners, face);
                faces.push((sorted, index as u32, place as u32, cycle));
            }
        }
        edges.sort_unstable();
        edges.dedup();
        faces.sort_unstable();
        let mut topology = Topology {
            cell_edges: vec![Vec::new(); cells],
            cell_faces: vec![Vec::new(); cells],
            edges,
            faces: Vec::new(),
        };
        for (index, (shape, corners)) in self.iter().enumerate() {
            topology.cell_faces[index] = vec![NONE; shape.faces().len()];
            for &[a, b] in shape.edges() {
                let edge = [corners[a].min(corners[b]), corners[a].max(corners[b])];
                let place = topology.edges.binary_search(&edge);
                topology.cell_edges[index].push(place.expect("every edge was listed") as u32);
            }
        }
        let mut start = 0;
        while start < faces.len() {
            let (sorted, first, place, cycle) = faces[start];
            let count = faces[start..].iter().take_while(|face| face.0 == sorted).count();
            if count > 2 {
                return Err(format!(
                    "the face with vertices {:?} belongs to {count} cells, the first three are {}, {} and {}; a face may \
                     belong to two",
                    &cycle[..if cycle[3] == NONE { 3 } else { 4 }],
                    first,
                    faces[start + 1].1,
                    faces[start + 2].1
                ));
            }
            let number = topology.faces.len() as u32;
            let mut face = Face {
                corners: cycle,
                cells: [first, NONE],
            };
            topology.cell_faces[first as usize][place as usize] = number;
            if count == 2 {
                let (_, second, place, other) = faces[start + 1];
                if !reversed_cycle(face.corners(), &other) {
                    return Err(format!(
                        "cells {first} and {second} lie on the same side of their face with vertices {:?}, or number it \
                         differently; renumber or remove one of them",
                        face.corners()
                    ));
                }
                face.cells[1] = second;
                topology.cell_faces[second as usize][place as usize] = number;
            }
            topology.faces.push(face);
            start += count;
        }
        topology.check_boundary()?;
        Ok(topology)
    }
}

impl Topology {
    /// The faces with one cell only.
    pub fn boundary(&self) -> impl Iterator<Item = (usize, &Face)> {
        self.faces.iter().enumerate().filter(|(_, face)| face.on_boundary())
    }

    /// Whether every directed edge of the boundary has its reverse, and no boundary triangle lies on a boundary quad:
    /// where it is otherwise, faces do not match.
    fn check_boundary(&self) -> Result<(), String> {
        let mut sides = Vec::new();
        let mut halves = Vec::new();
        for (_, face) in self.boundary() {
            if let [a, b, c, d] = *face.corners() {
                for mut half in [[a, b, c], [b, c, d], [c, d, a], [d, a, b]] {
                    half.sort_unstable();
                    halves.push((half, [a, b, c, d]));
                }
            }
        }
        halves.sort_unstable();
        for (_, face) in self.boundary() {
            if let [a, b, c] = *face.corners() {
                let mut key = [a, b, c];
                key.sort_unstable();
                if let Ok(place) = halves.binary_search_by(|half| half.0.cmp(&key)) {
                    return Err(format!(
                        "the triangle with vertices {:?} lies on the quad with vertices {:?}: a cell's quad meets two \
                         triangles there, which leaves a crack; cut the cell, or join the two others by a prism",
                        face.corners(),
                        halves[place].1
                    ));
                }
            }
        }
        for (_, face) in self.boundary() {
            let corners = face.corners();
            for (place, &corner) in corners.iter().enumerate() {
                sides.push([corner, corners[(place + 1) % corners.len()]]);
            }
        }
        sides.sort_unstable();
        for &[a, b] in &sides {
            if sides.binary_search(&[b, a]).is_err() {
                return Err(format!(
                    "the boundary is open at the edge of vertices {a} and {b}; do a quad and two triangles meet there?"
                ));
            }
        }
        Ok(())
    }

    /// Parts of the mesh that hang together by faces, and those that do by vertices: fewer where parts touch in an edge or
    /// a vertex only.
    pub fn bodies(&self) -> [usize; 2] {
        let cells = self.cell_faces.len();
        let pairs: Vec<[u32; 2]> = (self.faces.iter())
            .map(|face| {
                [
                    face.cells[0],
                    if face.on_boundary() {
                        face.cells[0]
                    } else {
                        face.cells[1]
                    },
                ]
            })
            .collect();
        let vertices = self.edges.iter().map(|edge| edge[1] as usize + 1).max().unwrap_or(0);
        [
            connectivity::components(&pairs, cells).count,
            connectivity::components(&self.edges, vertices).count,
        ]
    }

    /// The boundary as triangles, a quad as two.
    pub fn boundary_triangles(&self, points: &[[f64; 3]]) -> TriangleMesh {
        let mut cells = Vec::new();
        for (_, face) in self.boundary() {
            let corners = face.corners();
            cells.push([corners[0], corners[1], corners[2]]);
            if corners.len() == 4 {
                cells.push([corners[0], corners[2], corners[3]]);
            }
        }
        TriangleMesh {
            points: points.to_vec(),
            cells,
        }
    }
}

/// The vertices of a face of a cell in ascending order, and as they run; a triangle's fourth is [`NONE`].
fn face_key(corners: &[u32], face: &[usize]) -> ([u32; 4], [u32; 4]) {
    let mut cycle = [NONE; 4];
    for (corner, &local) in cycle.iter_mut().zip(face) {
        *corner = corners[local];
    }
    let mut sorted = cycle;
    sorted.sort_unstable();
    (sorted, cycle)
}

/// Whether `other` runs through the corners of `cycle` the other way round.
fn reversed_cycle(cycle: &[u32], other: &[u32; 4]) -> bool {
    let count = cycle.len();
    let Some(start) = other[..count].iter().position(|&corner| corner == cycle[0]) else {
        return false;
    };
    (0..count).all(|step| cycle[step] == other[(start + count - step) % count])
}

/// Volume within the faces of a cell, a quad taken as the mean of its two splits (exact for bilinear faces).
pub fn volume(points: &[[f64; 3]], shape: Shape, corners: &[u32]) -> f64 {
    let origin = points[corners[0] as usize];
    let at = |local: usize| subtract(points[corners[local] as usize], origin);
    let wedge = |a: usize, b: usize, c: usize| dot(at(a), cross(at(b), at(c))) / 6.0;
    let mut sum = 0.0;
    for face in shape.faces() {
        sum += match **face {
            [a, b, c] => wedge(a, b, c),
            [a, b, c, d] => 0.5 * (wedge(a, b, c) + wedge(a, c, d) + wedge(a, b, d) + wedge(b, c, d)),
            _ => 0.0,
        };
    }
    sum
}
