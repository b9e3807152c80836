//! A closed surface of genus 0 laid onto a convex polyhedron, one to one.
//!
//! The polyhedron's corners become the surface's vertices nearest to the corners of its bounding box, its edges become
//! shortest paths along mesh edges that do not cross, and each patch between them is embedded onto its flat side by
//! Tutte's theorem: with a convex outline and positive weights no triangle turns over (Tutte, "How to draw a graph",
//! 1963; Floater, "Parametrization and smooth approximation of surface triangulations", 1997).
//!
//! Guarantees: when it succeeds, every triangle has positive area on its side, and the map is one to one. Does not
//! guarantee: success, since the mesh edges may leave no room for the paths; low distortion, since long limbs shrink on
//! their way to a flat side.

use crate::mesh::connectivity::{self, NONE, Rows};
use crate::mesh::{area_vector, bounding_box, dot, length, subtract};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A convex polyhedron around the origin.
#[derive(Debug)]
pub struct Polyhedron {
    pub name: &'static str,
    pub corners: &'static [[f64; 3]],
    /// Corners of each side, counter-clockwise seen from outside.
    pub sides: &'static [&'static [usize]],
}

/// The cube `[-1, 1]^3`; corner `x + 2 y + 4 z` with bits for the signs.
pub const CUBE: Polyhedron = Polyhedron {
    name: "cube",
    corners: &[
        [-1.0, -1.0, -1.0],
        [1.0, -1.0, -1.0],
        [-1.0, 1.0, -1.0],
        [1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0],
        [1.0, -1.0, 1.0],
        [-1.0, 1.0, 1.0],
        [1.0, 1.0, 1.0],
    ],
    sides: &[
        &[0, 4, 6, 2],
        &[1, 3, 7, 5],
        &[0, 1, 5, 4],
        &[2, 6, 7, 3],
        &[0, 2, 3, 1],
        &[4, 5, 7, 6],
    ],
};

/// The octahedron with corners at distance 1 on the axes.
pub const OCTAHEDRON: Polyhedron = Polyhedron {
    name: "octahedron",
    corners: &[
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ],
    sides: &[
        &[0, 2, 4],
        &[2, 1, 4],
        &[1, 3, 4],
        &[3, 0, 4],
        &[2, 0, 5],
        &[1, 2, 5],
        &[3, 1, 5],
        &[0, 3, 5],
    ],
};

/// The regular tetrahedron in the cube `[-1, 1]^3`.
pub const TETRAHEDRON: Polyhedron = Polyhedron {
    name: "tetrahedron",
    corners: &[[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]],
    sides: &[&[0, 1, 2], &[0, 2, 3], &[0, 3, 1], &[1, 3, 2]],
};

impl Polyhedron {
    /// The neighbours of a corner, counter-clockwise seen from outside.
    fn rotation(&self, corner: usize) -> Vec<usize> {
        // A side lies between the edge to its next corner and, counter-clockwise, the edge to its previous one.
        let step = |from: Option<usize>| {
            self.sides.iter().find_map(|side| {
                let at = side.iter().position(|&c| c == corner)?;
                let (next, previous) = (side[(at + 1) % side.len()], side[(at + side.len() - 1) % side.len()]);
                (from.is_none_or(|from| from == next)).then_some(if from.is_none() { next } else { previous })
            })
        };
        let mut ring: Vec<usize> = Vec::new();
        let mut last = None;
        while let Some(next) = step(last) {
            if ring.contains(&next) {
                break;
            }
            ring.push(next);
            last = Some(next);
        }
        ring
    }

    /// Every edge once, as a pair of corners, smaller first.
    fn edges(&self) -> Vec<[usize; 2]> {
        let pairs = self.sides.iter().flat_map(|side| {
            (0..side.len())
                .map(|at| [side[at], side[(at + 1) % side.len()]])
                .filter(|[a, b]| a < b)
        });
        let mut edges: Vec<[usize; 2]> = pairs.collect();
        edges.sort_unstable();
        edges
    }
}

/// A closed triangle surface with its vertices' neighbours at hand.
struct Sheet<'a> {
    points: &'a [[f64; 3]],
    triangles: &'a [[u32; 3]],
    /// Triangles around every vertex.
    around: Rows,
}

impl Sheet<'_> {
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
struct Layout<'a> {
    polyhedron: &'a Polyhedron,
    sheet: &'a Sheet<'a>,
    /// Vertex of each corner.
    corners: Vec<u32>,
    /// Paths by edge, from its first corner to its second, both included.
    paths: Vec<([usize; 2], Vec<u32>)>,
    /// Whether a vertex is a corner or on a path.
    taken: Vec<bool>,
}

impl Layout<'_> {
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
                    let reached = f64::from_bits(bits) + length(subtract(a, b));
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

    /// Lays all edges: first a tree that reaches every corner, then the rest, always the shortest next. In the disc that
    /// remains around a tree, the order around the corners decides how every further path must run.
    fn route(&mut self) -> Result<(), String> {
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
            for &vertex in &path {
                self.taken[vertex as usize] = true;
            }
            edge.iter().for_each(|&corner| reached[corner] = true);
            self.paths.push((edge, path));
        }
        Ok(())
    }

    /// The side of the polyhedron that each triangle belongs to.
    fn patches(&self) -> Result<Vec<u32>, String> {
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

/// Positions on the polyhedron for all vertices of a surface.
///
/// `triangles` are counter-clockwise seen from outside, over `points` that are all used.
///
/// # Errors
/// When the surface is not a closed manifold of genus 0 in one part, when there is no room for the edges, or when
/// triangles shrink below the resolution of the numbers.
pub fn lay(polyhedron: &Polyhedron, points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Vec<[f64; 3]>, String> {
    let name = polyhedron.name;
    let mend = "give the target as a file of boundary positions";
    let topology = connectivity::surface_topology(triangles, points.len());
    match topology.components.as_slice() {
        [part] if part.genus == Some(0) && part.loops == 0 => {}
        [part] => {
            let what = match part.genus {
                Some(genus) => format!("has genus {genus}"),
                None => "is not an oriented manifold".to_string(),
            };
            return Err(format!("the boundary {what}, but a {name} has genus 0; {mend}"));
        }
        parts => {
            return Err(format!(
                "the boundary has {} parts, but a {name} has one; {mend}",
                parts.len()
            ));
        }
    }
    let sheet = Sheet {
        points,
        triangles,
        around: connectivity::incidence(triangles, points.len()),
    };
    let corners = corner_vertices(polyhedron, &sheet)?;
    let mut taken = vec![false; points.len()];
    corners.iter().for_each(|&vertex| taken[vertex as usize] = true);
    let mut layout = Layout {
        polyhedron,
        sheet: &sheet,
        corners,
        paths: Vec::new(),
        taken,
    };
    let refuse = |reason: String| format!("the boundary cannot be laid onto a {name}: {reason}; refine it, or {mend}");
    layout.route().map_err(refuse)?;
    let side_of = layout.patches().map_err(refuse)?;

    let mut positions = vec![[f64::NAN; 3]; points.len()];
    for ([from, to], path) in &layout.paths {
        let (start, end) = (polyhedron.corners[*from], polyhedron.corners[*to]);
        let mut along = vec![0.0];
        for step in path.windows(2) {
            let [a, b] = [step[0], step[1]].map(|vertex| points[vertex as usize]);
            along.push(along[along.len() - 1] + length(subtract(a, b)));
        }
        let whole = along[along.len() - 1];
        for (&vertex, &distance) in path.iter().zip(&along) {
            let fraction = distance / whole;
            positions[vertex as usize] = std::array::from_fn(|axis| start[axis] + fraction * (end[axis] - start[axis]));
        }
        // The fraction 1 can miss the corner by a rounding.
        positions[path[path.len() - 1] as usize] = end;
    }
    for (side, corners) in polyhedron.sides.iter().enumerate() {
        let patch: Vec<[u32; 3]> = triangles
            .iter()
            .zip(&side_of)
            .filter(|(_, of)| **of == side as u32)
            .map(|(t, _)| *t)
            .collect();
        let outline = corners
            .iter()
            .map(|&corner| polyhedron.corners[corner])
            .collect::<Vec<_>>();
        embed(&patch, points, &layout.taken, &outline, &mut positions).map_err(refuse)?;
    }
    Ok(positions)
}

/// The vertices nearest to the polyhedron's corners, after the surface's bounding box and the polyhedron's have been
/// scaled to the same cube. No two of them are neighbours, and each has room for the edges that meet there.
fn corner_vertices(polyhedron: &Polyhedron, sheet: &Sheet) -> Result<Vec<u32>, String> {
    let Some([low, high]) = bounding_box(sheet.points) else {
        return Err("the mesh has no boundary".to_string());
    };
    let mut chosen: Vec<u32> = Vec::new();
    let mut near = vec![false; sheet.points.len()];
    for (corner, wanted) in polyhedron.corners.iter().enumerate() {
        let needed = polyhedron.rotation(corner).len();
        let mut best = (f64::INFINITY, NONE);
        for (vertex, point) in sheet.points.iter().enumerate() {
            let offset: [f64; 3] = std::array::from_fn(|axis| {
                let extent = (high[axis] - low[axis]).max(f64::MIN_POSITIVE);
                (2.0 * point[axis] - low[axis] - high[axis]) / extent - wanted[axis]
            });
            let room = sheet.around.row(vertex).len() >= needed.max(4);
            if room && !near[vertex] && dot(offset, offset) < best.0 {
                best = (dot(offset, offset), vertex as u32);
            }
        }
        if best.1 == NONE {
            let (count, name) = (sheet.points.len(), polyhedron.name);
            return Err(format!(
                "{count} boundary vertices are too few for a {name}; refine the mesh"
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

/// Places the interior vertices of a patch (those not `fixed`) inside its convex outline by a discrete harmonic map.
fn embed(
    patch: &[[u32; 3]],
    points: &[[f64; 3]],
    fixed: &[bool],
    outline: &[[f64; 3]],
    positions: &mut [[f64; 3]],
) -> Result<(), String> {
    // Affine coordinates (s, t) of the side: exact on its plane for sides along the axes.
    let origin = outline[0];
    let (u, v) = (
        subtract(outline[1], origin),
        subtract(outline[outline.len() - 1], origin),
    );
    let (uu, uv, vv) = (dot(u, u), dot(u, v), dot(v, v));
    let flat = |point: [f64; 3]| {
        let offset = subtract(point, origin);
        let (ou, ov) = (dot(offset, u), dot(offset, v));
        let scale = uu * vv - uv * uv;
        [(vv * ou - uv * ov) / scale, (uu * ov - uv * ou) / scale]
    };
    let mut free: Vec<u32> = patch
        .iter()
        .flatten()
        .copied()
        .filter(|&vertex| !fixed[vertex as usize])
        .collect();
    free.sort_unstable();
    free.dedup();
    let place = |vertex: u32| free.binary_search(&vertex);
    // Cotangent weights, as of the discrete Laplacian, and kept positive, which Tutte's theorem asks for. The floor is
    // the cotangent of 89 degrees: larger ones draw long triangles together, smaller ones let patches collapse.
    let mut weights: Vec<([u32; 2], f64)> = Vec::with_capacity(3 * patch.len());
    for triangle in patch {
        let corners = triangle.map(|vertex| points[vertex as usize]);
        let area = length(area_vector(corners));
        for at in 0..3 {
            let (a, b) = ((at + 1) % 3, (at + 2) % 3);
            let cotangent = dot(subtract(corners[a], corners[at]), subtract(corners[b], corners[at])) / area;
            let pair = [triangle[a].min(triangle[b]), triangle[a].max(triangle[b])];
            weights.push((pair, if cotangent.is_finite() { cotangent } else { 0.0 }));
        }
    }
    weights.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); free.len()];
    let mut diagonal = vec![0.0; free.len()];
    let mut right = vec![[0.0; 2]; free.len()];
    for same in weights.chunk_by(|a, b| a.0 == b.0) {
        let [a, b] = same[0].0;
        let weight = same.iter().map(|(_, weight)| weight).sum::<f64>().clamp(0.0175, 100.0);
        for (a, b) in [(a, b), (b, a)] {
            let Ok(row) = place(a) else { continue };
            diagonal[row] += weight;
            match place(b) {
                Ok(column) => rows[row].push((column, weight)),
                Err(_) => {
                    let [s, t] = flat(positions[b as usize]);
                    right[row][0] += weight * s;
                    right[row][1] += weight * t;
                }
            }
        }
    }
    let coordinates = solve(&rows, &diagonal, &right)?;
    for (&vertex, [s, t]) in free.iter().zip(coordinates) {
        positions[vertex as usize] = std::array::from_fn(|axis| origin[axis] + s * u[axis] + t * v[axis]);
    }
    Ok(())
}

/// Solves `diagonal x - rows x = right` for two right-hand sides by conjugate gradients with the diagonal as
/// preconditioner. The matrix is symmetric positive definite: an irreducible Laplacian with boundary values.
fn solve(rows: &[Vec<(usize, f64)>], diagonal: &[f64], right: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, String> {
    let count = rows.len();
    let mut solution = vec![[0.5f64; 2]; count];
    for side in 0..2 {
        let apply = |x: &[f64], y: &mut [f64]| {
            for (row, entries) in rows.iter().enumerate() {
                y[row] =
                    diagonal[row] * x[row] - entries.iter().map(|&(column, weight)| weight * x[column]).sum::<f64>();
            }
        };
        let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut x: Vec<f64> = solution.iter().map(|value| value[side]).collect();
        let mut product = vec![0.0; count];
        apply(&x, &mut product);
        let mut residual: Vec<f64> = (0..count).map(|row| right[row][side] - product[row]).collect();
        let scaled = |residual: &[f64]| residual.iter().zip(diagonal).map(|(r, d)| r / d).collect::<Vec<f64>>();
        let mut preconditioned = scaled(&residual);
        let mut direction = preconditioned.clone();
        let mut square = inner(&residual, &preconditioned);
        let goal = 1e-30 * diagonal.iter().sum::<f64>();
        let mut step = 0;
        while square > goal {
            if step > 20 * count + 1000 {
                return Err("the linear system of a side did not converge".to_string());
            }
            step += 1;
            apply(&direction, &mut product);
            let length = square / inner(&direction, &product);
            for row in 0..count {
                x[row] += length * direction[row];
                residual[row] -= length * product[row];
            }
            preconditioned = scaled(&residual);
            let next = inner(&residual, &preconditioned);
            for row in 0..count {
                direction[row] = preconditioned[row] + next / square * direction[row];
            }
            square = next;
        }
        for (value, x) in solution.iter_mut().zip(x) {
            value[side] = x;
        }
    }
    Ok(solution)
}
