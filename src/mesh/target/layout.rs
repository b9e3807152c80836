//! The edges of a polyhedron laid over a surface, as paths of mesh edges that do not cross.
//!
//! Guarantees: paths share nothing but corners, and leave each corner in the polyhedron's own order; the patches between
//! them are those of the polyhedron's sides. Does not guarantee: that there is a way where the mesh is coarse.

use super::polyhedron::Polyhedron;
use crate::mesh::connectivity::{self, NONE, Rows};
use crate::mesh::{bounding_box, dot, length, subtract};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A closed triangle surface with its vertices' neighbours at hand.
pub(super) struct Sheet<'a> {
    pub(super) points: &'a [[f64; 3]],
    pub(super) triangles: &'a [[u32; 3]],
    /// Triangles around every vertex.
    around: Rows,
}

impl<'a> Sheet<'a> {
    pub(super) fn new(points: &'a [[f64; 3]], triangles: &'a [[u32; 3]]) -> Self {
        Self {
            points,
            triangles,
            around: connectivity::incidence(triangles, points.len()),
        }
    }

    /// The vertices around one, counter-clockwise.
    fn ring(&self, vertex: u32) -> Vec<u32> {
        let fan = self.around.row(vertex as usize);
        let wedge = |&triangle: &u32| {
            let corners = self.triangles[triangle as usize];
            let at = corners.iter().position(|&v| v == vertex).unwrap_or(0);
            [corners[(at + 1) % 3], corners[(at + 2) % 3]]
        };
        let mut ring = vec![wedge(&fan[0])[0]];
        while ring.len() < fan.len() {
            let last = ring[ring.len() - 1];
            match fan.iter().map(wedge).find(|[from, _]| *from == last) {
                Some([_, to]) => ring.push(to),
                None => break,
            }
        }
        ring
    }

    /// The triangle to the left of the edge from one vertex to another.
    fn left_of(&self, from: u32, to: u32) -> Option<u32> {
        self.around.row(from as usize).iter().copied().find(|&triangle| {
            let corners = self.triangles[triangle as usize];
            (0..3).any(|i| corners[i] == from && corners[(i + 1) % 3] == to)
        })
    }
}

/// The edges of a polyhedron laid over a surface.
pub(super) struct Layout<'a> {
    polyhedron: &'a Polyhedron,
    sheet: &'a Sheet<'a>,
    /// Vertex of each corner.
    corners: Vec<u32>,
    /// Paths by edge, from its first corner to its second, both included.
    pub(super) paths: Vec<([usize; 2], Vec<u32>)>,
    /// Whether a vertex is a corner or on a path.
    pub(super) taken: Vec<bool>,
    /// Whether a vertex is next to a corner, next to a path.
    near: Vec<[bool; 2]>,
    /// How many times longer a step counts that ends next to a corner or to a path: keeps room for later paths.
    detour: [f64; 2],
}

impl<'a> Layout<'a> {
    pub(super) fn new(polyhedron: &'a Polyhedron, sheet: &'a Sheet<'a>, corners: &[u32], detour: [f64; 2]) -> Self {
        let mut taken = vec![false; sheet.points.len()];
        let mut near = vec![[false; 2]; sheet.points.len()];
        for &corner in corners {
            taken[corner as usize] = true;
            sheet
                .ring(corner)
                .iter()
                .for_each(|&vertex| near[vertex as usize][0] = true);
        }
        Self {
            polyhedron,
            sheet,
            corners: corners.to_vec(),
            paths: Vec::new(),
            taken,
            near,
            detour,
        }
    }

    /// The path that leaves `from` towards `to`, in that direction, if it is laid.
    fn path(&self, from: usize, to: usize) -> Option<Vec<u32>> {
        let (edge, path) = self
            .paths
            .iter()
            .find(|(edge, _)| *edge == [from.min(to), from.max(to)])?;
        Some(if edge[0] == from {
            path.clone()
        } else {
            path.iter().rev().copied().collect()
        })
    }

    /// The neighbours of a corner's vertex through which a new path to corner `to` may leave: those between the laid
    /// paths that come before and after it in the polyhedron's own order around the corner.
    fn gate(&self, from: usize, to: usize) -> Vec<u32> {
        let order = self.polyhedron.rotation(from);
        let ring = self.sheet.ring(self.corners[from]);
        let at = order.iter().position(|&corner| corner == to).unwrap_or(0);
        let place = |offset: usize| {
            let path = self.path(from, order[(at + offset) % order.len()])?;
            ring.iter().position(|&vertex| vertex == path[1])
        };
        let after = (1..order.len()).find_map(place);
        let before = (1..order.len()).rev().find_map(place);
        let (Some(before), Some(after)) = (before, after) else {
            return ring;
        };
        let count = if before == after {
            ring.len()
        } else {
            (after + ring.len() - before) % ring.len()
        };
        (1..count).map(|step| ring[(before + step) % ring.len()]).collect()
    }

    /// The shortest free path between two corners that keeps the polyhedron's order around both, and its length.
    fn shortest(&self, from: usize, to: usize) -> Option<(f64, Vec<u32>)> {
        let (start, end) = (self.corners[from], self.corners[to]);
        let (leave, arrive) = (self.gate(from, to), self.gate(to, from));
        let count = self.sheet.points.len();
        let mut distance = vec![f64::INFINITY; count];
        let mut previous = vec![NONE; count];
        let mut queue = BinaryHeap::new();
        distance[start as usize] = 0.0;
        // Distances are not negative, so that their bits are ordered as they are; ties go to the smaller vertex.
        queue.push(Reverse((0u64, start)));
        while let Some(Reverse((bits, vertex))) = queue.pop() {
            if vertex == end {
                break;
            }
            if bits > distance[vertex as usize].to_bits() {
                continue;
            }
            for &triangle in self.sheet.around.row(vertex as usize) {
                for next in self.sheet.triangles[triangle as usize] {
                    let allowed = if next == end {
                        arrive.contains(&vertex) || vertex == start
                    } else {
                        !self.taken[next as usize]
                    };
                    if next == vertex || !allowed || (vertex == start && !leave.contains(&next)) {
                        continue;
                    }
                    if vertex == start && next == end && !arrive.contains(&start) {
                        continue;
                    }
                    let [a, b] = [vertex, next].map(|v| self.sheet.points[v as usize]);
                    let [corner, path] = self.near[next as usize];
                    let weight = match next == end {
                        true => 1.0,
                        false => 1.0 + f64::from(corner) * self.detour[0] + f64::from(path) * self.detour[1],
                    };
                    let reached = f64::from_bits(bits) + weight * length(subtract(a, b));
                    if reached < distance[next as usize] {
                        distance[next as usize] = reached;
                        previous[next as usize] = vertex;
                        queue.push(Reverse((reached.to_bits(), next)));
                    }
                }
            }
        }
        if previous[end as usize] == NONE {
            return None;
        }
        let mut path = vec![end];
        while path[path.len() - 1] != start {
            path.push(previous[path[path.len() - 1] as usize]);
        }
        path.reverse();
        Some((distance[end as usize], path))
    }

    /// The path without the detours around a single triangle that the clearance can cause; two steps along a triangle
    /// whose third edge joins path vertices would lie on one line in the target, and the triangle with them.
    fn straightened(&self, mut path: Vec<u32>) -> Vec<u32> {
        let mut at = 1;
        while at + 1 < path.len() {
            let ends = [path[at - 1], path[at + 1]];
            let cut = |&triangle: &u32| {
                ends.iter()
                    .all(|end| self.sheet.triangles[triangle as usize].contains(end))
            };
            if self.sheet.around.row(path[at] as usize).iter().any(cut) {
                path.remove(at);
                at = at.max(2) - 1;
            } else {
                at += 1;
            }
        }
        path
    }

    /// Lays all edges: first a tree that reaches every corner, then the rest, always the shortest next. In the disc that
    /// remains around a tree, the order around the corners decides how every further path must run.
    pub(super) fn route(&mut self) -> Result<(), String> {
        let edges = self.polyhedron.edges();
        let mut reached = vec![false; self.corners.len()];
        reached[0] = true;
        while self.paths.len() < edges.len() {
            let tree = reached.contains(&false);
            let mut best: Option<(f64, [usize; 2], Vec<u32>)> = None;
            for &[a, b] in &edges {
                let laid = self.paths.iter().any(|(edge, _)| *edge == [a, b]);
                if laid || (tree && reached[a] == reached[b]) {
                    continue;
                }
                match self.shortest(a, b) {
                    Some((distance, path)) => {
                        if best.as_ref().is_none_or(|(shortest, ..)| distance < *shortest) {
                            best = Some((distance, [a, b], path));
                        }
                    }
                    // A tree edge may be replaced by another one; a later edge has only one way to run.
                    None if tree => {}
                    None => {
                        let [a, b] = [a, b].map(|corner| self.corners[corner]);
                        return Err(format!(
                            "no free path of mesh edges is left between vertices {a} and {b}"
                        ));
                    }
                }
            }
            let Some((_, edge, path)) = best else {
                return Err("no free path of mesh edges is left between two corners".to_string());
            };
            let path = self.straightened(path);
            for &vertex in &path {
                self.taken[vertex as usize] = true;
                for &triangle in self.sheet.around.row(vertex as usize) {
                    self.sheet.triangles[triangle as usize]
                        .iter()
                        .for_each(|&v| self.near[v as usize][1] = true);
                }
            }
            edge.iter().for_each(|&corner| reached[corner] = true);
            self.paths.push((edge, path));
        }
        Ok(())
    }

    /// The side of the polyhedron that each triangle belongs to.
    pub(super) fn patches(&self) -> Result<Vec<u32>, String> {
        let neighbours = connectivity::facets(self.sheet.triangles, self.sheet.points.len()).neighbours;
        let mut on_path: Vec<[u32; 2]> = self
            .paths
            .iter()
            .flat_map(|(_, path)| path.windows(2).map(|step| [step[0].min(step[1]), step[0].max(step[1])]))
            .collect();
        on_path.sort_unstable();
        let mut side_of = vec![NONE; self.sheet.triangles.len()];
        let crossing = "the paths of the edges do not bound the sides".to_string();
        for (side, corners) in self.polyhedron.sides.iter().enumerate() {
            let path = self.path(corners[0], corners[1]).ok_or_else(|| crossing.clone())?;
            let mut stack = vec![self.sheet.left_of(path[0], path[1]).ok_or_else(|| crossing.clone())?];
            while let Some(triangle) = stack.pop() {
                if side_of[triangle as usize] != NONE {
                    continue;
                }
                side_of[triangle as usize] = side as u32;
                let vertices = self.sheet.triangles[triangle as usize];
                for (local, &other) in neighbours[triangle as usize].iter().enumerate() {
                    let (a, b) = (vertices[(local + 1) % 3], vertices[(local + 2) % 3]);
                    if on_path.binary_search(&[a.min(b), a.max(b)]).is_err() {
                        stack.push(other);
                    }
                }
            }
        }
        if side_of.contains(&NONE) {
            return Err(crossing);
        }
        // Left of each path lies the side that runs along it in this direction.
        for (side, corners) in self.polyhedron.sides.iter().enumerate() {
            for at in 0..corners.len() {
                let path = self
                    .path(corners[at], corners[(at + 1) % corners.len()])
                    .ok_or_else(|| crossing.clone())?;
                for step in path.windows(2) {
                    let left = self.sheet.left_of(step[0], step[1]).ok_or_else(|| crossing.clone())?;
                    if side_of[left as usize] != side as u32 {
                        return Err(crossing);
                    }
                }
            }
        }
        Ok(side_of)
    }
}

/// The vertices nearest to the polyhedron's corners, after the surface's bounding box and the polyhedron's have been
/// scaled to the same cube. No two of them are neighbours, and each has at least `spare` neighbours more than edges.
pub(super) fn corner_vertices(polyhedron: &Polyhedron, sheet: &Sheet, spare: usize) -> Result<Vec<u32>, String> {
    let Some([low, high]) = bounding_box(sheet.points) else {
        return Err("the mesh has no boundary".to_string());
    };
    let mut chosen: Vec<u32> = Vec::new();
    let mut near = vec![false; sheet.points.len()];
    for (corner, wanted) in polyhedron.corners.iter().enumerate() {
        let needed = polyhedron.rotation(corner).len() + spare;
        let mut best = (f64::INFINITY, NONE);
        for (vertex, point) in sheet.points.iter().enumerate() {
            let offset: [f64; 3] = std::array::from_fn(|axis| {
                let extent = (high[axis] - low[axis]).max(f64::MIN_POSITIVE);
                (2.0 * point[axis] - low[axis] - high[axis]) / extent - wanted[axis]
            });
            let room = sheet.around.row(vertex).len() >= needed;
            if room && !near[vertex] && dot(offset, offset) < best.0 {
                best = (dot(offset, offset), vertex as u32);
            }
        }
        if best.1 == NONE {
            return Err(format!(
                "{} boundary vertices leave no room for its corners",
                sheet.points.len()
            ));
        }
        chosen.push(best.1);
        near[best.1 as usize] = true;
        for vertex in sheet.ring(best.1) {
            near[vertex as usize] = true;
        }
    }
    Ok(chosen)
}
