//! Surfaces of quadrilaterals: points, quads, normals where known, and how the quads hang together.
//!
//! [`QuadrilateralMesh::from_content`] takes what a mesh file holds, [`check`] proves it sound, [`Connectivity::of`]
//! lists its edges with the quads on both sides and the star of every vertex in cyclic order.
//!
//! Guarantees: after [`check`] without a [`Severity::Error`], every index is in range, every coordinate finite, every
//! vertex used, no quad is repeated or has a side without length, an edge has at most two quads, neighbours are
//! oriented alike, and the quads at a vertex form one fan. Does not guarantee: that quads are planar or convex, or
//! that distant parts do not intersect each other.

use super::check::{Element, FLAT, Problem, Problems, Severity, counted, elementary};
use super::connectivity::{NONE, Rows};
use super::format::{Content, Field};
use super::{cross, dot, length, subtract};

/// A surface of quadrilaterals in flat arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuadrilateralMesh {
    /// In model units.
    pub points: Vec<[f64; 3]>,
    /// Corners counter-clockwise seen from outside, as indices into `points`.
    pub quads: Vec<[u32; 4]>,
    /// One a point, where the source has them; of any length but zero, not checked against the orientation.
    pub normals: Option<Vec<[f64; 3]>>,
}

/// What to do with triangles among the quads of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Triangles {
    /// An error that says so.
    #[default]
    Refuse,
    /// Every triangle becomes three quads about its centre and every quad four, so that the mesh stays conforming.
    Split,
}

/// The normals in the data of a file's points: a field of three components named `normals` or `normal`, in any case,
/// or three fields `nx`, `ny`, `nz` as in PLY files.
fn normals(content: &Content) -> Option<Vec<[f64; 3]>> {
    let named = |name: &str, components: usize| {
        let same = |field: &&Field| field.components == components && field.name.eq_ignore_ascii_case(name);
        content.point_data.iter().find(same)
    };
    if let Some(field) = named("normals", 3).or_else(|| named("normal", 3)) {
        return Some(field.values.as_chunks().0.to_vec());
    }
    let [x, y, z] = [named("nx", 1)?, named("ny", 1)?, named("nz", 1)?];
    let columns = x.values.iter().zip(&y.values).zip(&z.values);
    Some(columns.map(|((&x, &y), &z)| [x, y, z]).collect())
}

impl QuadrilateralMesh {
    /// The surface in a mesh file. Normals are taken from point fields `normals` or `nx`, `ny`, `nz`.
    /// Solid cells are passed over, with a notice in the second part of the result.
    ///
    /// # Errors
    /// When there are no quads, or triangles beside them and `triangles` does not ask for a split.
    pub fn from_content(content: &Content, triangles: Triangles) -> Result<(Self, Vec<String>), String> {
        let mut notices = Vec::new();
        let solid = content.tetrahedra.len() + content.hexahedra.len() + content.prisms.len() + content.pyramids.len();
        if solid > 0 {
            notices.push(format!(
                "{solid} solid cells passed over: a surface is made of quadrilaterals"
            ));
        }
        if !content.triangles.is_empty() && triangles == Triangles::Refuse {
            return Err(format!(
                "there are {} triangles (the first with vertices {:?}, counted from 0) among {} quadrilaterals; remesh \
                 them, or ask for a split: every triangle into three quadrilaterals and every quadrilateral into four",
                content.triangles.len(),
                content.triangles[0],
                content.quads.len()
            ));
        }
        if content.quads.is_empty() && content.triangles.is_empty() {
            return Err(
                "there are no quadrilaterals; check that the file holds a surface of quadrilaterals".to_string(),
            );
        }
        let mesh = Self {
            points: content.points.clone(),
            quads: content.quads.clone(),
            normals: normals(content),
        };
        if content.triangles.is_empty() {
            return Ok((mesh, notices));
        }
        content.cells().check(content.points.len())?;
        notices.push(format!(
            "{} triangles split into three quadrilaterals each, {} quadrilaterals into four",
            content.triangles.len(),
            content.quads.len()
        ));
        Ok((mesh.split(&content.triangles), notices))
    }

    /// Splits every face at its centre and the middles of its sides: quads into four, the `triangles` into three quads.
    /// Old points keep their numbers; then follow the middles of the edges in lexicographic order, then the centres of
    /// the quads and of the triangles. Normals of new points are the mean of the old ones.
    pub fn split(&self, triangles: &[[u32; 3]]) -> Self {
        let sides = |corners: &[u32], visit: &mut dyn FnMut([u32; 2])| {
            for (index, &corner) in corners.iter().enumerate() {
                let next = corners[(index + 1) % corners.len()];
                visit([corner.min(next), corner.max(next)]);
            }
        };
        let mut edges = Vec::with_capacity(4 * self.quads.len() + 3 * triangles.len());
        for quad in &self.quads {
            sides(quad, &mut |edge| edges.push(edge));
        }
        for triangle in triangles {
            sides(triangle, &mut |edge| edges.push(edge));
        }
        edges.sort_unstable();
        edges.dedup();
        let old = self.points.len();
        let centres = old + edges.len();
        let mean = |values: &[[f64; 3]], corners: &[u32]| -> [f64; 3] {
            std::array::from_fn(|axis| {
                corners.iter().map(|&corner| values[corner as usize][axis]).sum::<f64>() / corners.len() as f64
            })
        };
        let extend = |values: &[[f64; 3]]| -> Vec<[f64; 3]> {
            let mut all = values.to_vec();
            all.extend(edges.iter().map(|edge| mean(values, edge)));
            all.extend(self.quads.iter().map(|quad| mean(values, quad)));
            all.extend(triangles.iter().map(|triangle| mean(values, triangle)));
            all
        };
        let middle = |a: u32, b: u32| {
            let edge = [a.min(b), a.max(b)];
            (old + edges.partition_point(|other| *other < edge)) as u32
        };
        let mut quads = Vec::with_capacity(4 * self.quads.len() + 3 * triangles.len());
        let mut divide = |corners: &[u32], centre: u32| {
            let count = corners.len();
            for index in 0..count {
                let [before, here, after] = [index + count - 1, index, index + 1].map(|place| corners[place % count]);
                quads.push([here, middle(here, after), centre, middle(before, here)]);
            }
        };
        for (index, quad) in self.quads.iter().enumerate() {
            divide(quad, (centres + index) as u32);
        }
        for (index, triangle) in triangles.iter().enumerate() {
            divide(triangle, (centres + self.quads.len() + index) as u32);
        }
        Self {
            points: extend(&self.points),
            quads,
            normals: self.normals.as_deref().map(extend),
        }
    }

    /// The points of one quad.
    pub fn corners(&self, quad: [u32; 4]) -> [[f64; 3]; 4] {
        quad.map(|vertex| self.points[vertex as usize])
    }

    /// Sum over the quads of the areas of two triangles, cut along the diagonal from the first corner.
    pub fn area(&self) -> f64 {
        let area = |&quad: &[u32; 4]| {
            let [a, b, c, d] = self.corners(quad);
            let triangle = |b, c| length(cross(subtract(b, a), subtract(c, a))) / 2.0;
            triangle(b, c) + triangle(c, d)
        };
        self.quads.iter().map(area).sum()
    }
}

/// Number of the side that runs from corner `k` to corner `k + 1` of a quad: `4 quad + k`.
pub type Side = u32;

/// The quad and the corner (the side starts there) behind the number of a side.
pub fn quad_and_corner(side: Side) -> (usize, usize) {
    (side as usize / 4, side as usize % 4)
}

/// How the quads of a surface hang together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Connectivity {
    /// Every edge once, smaller vertex first, in lexicographic order.
    pub edges: Vec<[u32; 2]>,
    /// For every edge the side that runs along it and the side that runs against it; [`NONE`] where there is none.
    pub sides: Vec<[Side; 2]>,
    /// For every quad the edges of its sides: entry `k` runs from corner `k` to corner `k + 1`.
    pub quad_edges: Vec<[u32; 4]>,
    /// The corners (`4 quad + corner`) around every vertex, counter-clockwise seen from outside. The fan of an interior
    /// vertex starts with its smallest corner, that of a boundary vertex at the boundary.
    pub stars: Rows,
    /// Whether a vertex lies on the boundary.
    pub on_boundary: Vec<bool>,
}

/// What keeps quads from forming an oriented surface with at most two quads an edge and one fan a vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Defects {
    /// Edges with three or more quads: the edge, and how many quads it has.
    pub crowded: Vec<([u32; 2], usize)>,
    /// Pairs of neighbours that run along their edge in the same direction.
    pub disoriented: Vec<[u32; 2]>,
    /// Vertices whose quads form several fans, ascending.
    pub pinched: Vec<u32>,
}

impl Defects {
    pub fn is_empty(&self) -> bool {
        self.crowded.is_empty() && self.disoriented.is_empty() && self.pinched.is_empty()
    }
}

/// Every side with its edge, sorted: edge, side, and whether the side runs along the edge.
fn sorted_sides(quads: &[[u32; 4]]) -> Vec<([u32; 2], Side)> {
    let mut all: Vec<([u32; 2], Side)> = Vec::with_capacity(4 * quads.len());
    for (index, quad) in quads.iter().enumerate() {
        for corner in 0..4 {
            let (a, b) = (quad[corner], quad[(corner + 1) % 4]);
            all.push(([a.min(b), a.max(b)], (4 * index + corner) as Side));
        }
    }
    all.sort_unstable();
    all
}

/// Whether a side runs from the smaller vertex to the larger one.
fn runs_along(quads: &[[u32; 4]], side: Side) -> bool {
    let (quad, corner) = quad_and_corner(side);
    quads[quad][corner] < quads[quad][(corner + 1) % 4]
}

impl Connectivity {
    /// The connectivity of quads over `vertices` points. Indices must be in range and no quad may name a vertex twice.
    ///
    /// # Errors
    /// Where the quads form no oriented surface.
    pub fn of(quads: &[[u32; 4]], vertices: usize) -> Result<Self, Defects> {
        let all = sorted_sides(quads);
        let mut found = Self {
            quad_edges: vec![[0; 4]; quads.len()],
            on_boundary: vec![false; vertices],
            ..Self::default()
        };
        let mut defects = Defects::default();
        // The side that runs the other way, for every side.
        let mut twins = vec![NONE; 4 * quads.len()];
        for same in all.chunk_by(|a, b| a.0 == b.0) {
            let edge = same[0].0;
            let index = found.edges.len() as u32;
            let mut sides = [NONE; 2];
            for &(_, side) in same {
                let (quad, corner) = quad_and_corner(side);
                found.quad_edges[quad][corner] = index;
                sides[usize::from(!runs_along(quads, side))] = side;
            }
            match same {
                [_] => {
                    for vertex in edge {
                        found.on_boundary[vertex as usize] = true;
                    }
                }
                &[(_, a), (_, b)] => {
                    if sides.contains(&NONE) {
                        defects.disoriented.push([a / 4, b / 4]);
                    } else {
                        twins[a as usize] = b;
                        twins[b as usize] = a;
                    }
                }
                many => defects.crowded.push((edge, many.len())),
            }
            found.edges.push(edge);
            found.sides.push(sides);
        }
        if !defects.is_empty() {
            return Err(defects);
        }
        found.stars = stars(quads, vertices, &twins, &mut defects.pinched);
        if defects.is_empty() { Ok(found) } else { Err(defects) }
    }

    /// Number of edges at a vertex.
    pub fn valence(&self, vertex: usize) -> usize {
        self.stars.row(vertex).len() + usize::from(self.on_boundary[vertex])
    }

    /// The edges at a vertex, counter-clockwise; spoke `i` is the right and spoke `i + 1` the left side of corner `i` of
    /// its star, where the last corner of an interior vertex ends at spoke 0 again.
    pub fn spokes(&self, vertex: usize) -> impl Iterator<Item = u32> {
        let corners = self.stars.row(vertex);
        let edge = |corner: u32, back: usize| {
            let (quad, corner) = quad_and_corner(corner);
            self.quad_edges[quad][(corner + back) % 4]
        };
        let last = corners.last().filter(|_| self.on_boundary[vertex]);
        let last = last.map(move |&corner| edge(corner, 3));
        corners.iter().map(move |&corner| edge(corner, 0)).chain(last)
    }

    /// The vertex at the other end of an edge.
    pub fn other_end(&self, edge: u32, vertex: u32) -> u32 {
        let [a, b] = self.edges[edge as usize];
        if a == vertex { b } else { a }
    }

    /// Number of edges with one quad.
    pub fn boundary_edges(&self) -> usize {
        self.sides.iter().filter(|sides| sides.contains(&NONE)).count()
    }

    /// `V - E + F`.
    pub fn euler(&self) -> i64 {
        self.stars.len() as i64 - self.edges.len() as i64 + self.quad_edges.len() as i64
    }

    /// Number of vertices by valence: entry `n` for valence `n`.
    pub fn valences(&self) -> Vec<usize> {
        let mut counts = Vec::new();
        for vertex in 0..self.stars.len() {
            let valence = self.valence(vertex);
            if counts.len() <= valence {
                counts.resize(valence + 1, 0);
            }
            counts[valence] += 1;
        }
        counts
    }
}

/// The fans of corners around all vertices; vertices with several fans go to `pinched`.
fn stars(quads: &[[u32; 4]], vertices: usize, twins: &[Side], pinched: &mut Vec<u32>) -> Rows {
    let mut offsets = vec![0usize; vertices + 1];
    for &vertex in quads.iter().flatten() {
        offsets[vertex as usize + 1] += 1;
    }
    for vertex in 0..vertices {
        offsets[vertex + 1] += offsets[vertex];
    }
    // The first corner of every vertex, or the one at the boundary: the side before which no quad follows clockwise.
    let mut first = vec![NONE; vertices];
    let mut at_boundary = vec![false; vertices];
    for (index, quad) in quads.iter().enumerate() {
        for (corner, &vertex) in quad.iter().enumerate() {
            let side = (4 * index + corner) as Side;
            let place = &mut first[vertex as usize];
            if twins[side as usize] == NONE && !at_boundary[vertex as usize] {
                *place = side;
                at_boundary[vertex as usize] = true;
            } else if *place == NONE {
                *place = side;
            }
        }
    }
    let mut items = vec![0u32; 4 * quads.len()];
    for vertex in 0..vertices {
        let row = &mut items[offsets[vertex]..offsets[vertex + 1]];
        let mut corner = first[vertex];
        let mut seen = 0;
        while corner != NONE && seen < row.len() {
            row[seen] = corner;
            seen += 1;
            // The side before this corner ends here; its twin starts here and is the next corner counter-clockwise.
            let before = corner - corner % 4 + (corner + 3) % 4;
            corner = twins[before as usize];
            if corner == first[vertex] {
                break;
            }
        }
        if seen < row.len() {
            pinched.push(vertex as u32);
        }
    }
    Rows { offsets, items }
}

/// Turns quads round so that neighbours agree, each component in the way most of its quads (or, on a tie, its first one)
/// are listed. Returns how many were turned, or the first quad that can be turned neither way (a one-sided surface).
/// Crowded edges are passed over.
pub fn orient(quads: &mut [[u32; 4]]) -> Result<usize, usize> {
    let all = sorted_sides(quads);
    let mut neighbours = vec![[NONE; 4]; quads.len()];
    for same in all.chunk_by(|a, b| a.0 == b.0) {
        if let &[(_, a), (_, b)] = same {
            let ((p, i), (q, j)) = (quad_and_corner(a), quad_and_corner(b));
            // The lowest bit tells whether the two disagree.
            let disagree = u32::from(runs_along(quads, a) == runs_along(quads, b));
            neighbours[p][i] = (q as u32) << 1 | disagree;
            neighbours[q][j] = (p as u32) << 1 | disagree;
        }
    }
    const UNSEEN: u8 = 2;
    let mut flips = vec![UNSEEN; quads.len()];
    let mut turned = 0;
    let mut queue = Vec::new();
    for seed in 0..quads.len() {
        if flips[seed] != UNSEEN {
            continue;
        }
        flips[seed] = 0;
        queue.clear();
        queue.push(seed);
        let mut next = 0;
        while next < queue.len() {
            let quad = queue[next];
            next += 1;
            for entry in neighbours[quad] {
                if entry == NONE {
                    continue;
                }
                let (other, wanted) = ((entry >> 1) as usize, flips[quad] ^ (entry & 1) as u8);
                if flips[other] == UNSEEN {
                    flips[other] = wanted;
                    queue.push(other);
                } else if flips[other] != wanted {
                    return Err(other);
                }
            }
        }
        let flipped = queue.iter().filter(|&&quad| flips[quad] == 1).count();
        let minority = u8::from(2 * flipped <= queue.len());
        for &quad in queue.iter().filter(|&&quad| flips[quad] == minority) {
            quads[quad].swap(1, 3);
            turned += 1;
        }
    }
    Ok(turned)
}

/// Checks a surface of quadrilaterals and turns quads round that are oriented opposite to their neighbours. Open
/// boundaries and separate parts are no problems. Errors come first in the list.
pub fn check(mesh: &mut QuadrilateralMesh) -> Vec<Problem> {
    let mut problems = Problems::default();
    if elementary(
        &mesh.points,
        &mesh.quads,
        ("quadrilateral", "quadrilaterals"),
        &mut problems,
    ) {
        shape_and_orientation(mesh, &mut problems);
    }
    let mut problems = problems.0;
    problems.sort_by_key(|problem| problem.severity);
    problems
}

/// The checks of [`check`] that rely on sound cells.
fn shape_and_orientation(mesh: &mut QuadrilateralMesh, problems: &mut Problems) {
    let total = mesh.quads.len();
    let short = |&quad: &usize| {
        let corners = mesh.corners(mesh.quads[quad]);
        let reach = (1..4).map(|corner| length(subtract(corners[corner], corners[0])));
        let reach = reach.fold(0.0, f64::max);
        (0..4).any(|corner| length(subtract(corners[(corner + 1) % 4], corners[corner])) <= FLAT * reach)
    };
    problems.add(
        "zero-length-edge",
        Severity::Error,
        Element::Cell,
        (0..total).filter(short),
        |count, first| {
            format!(
                "{} a side without length, the first is quadrilateral {first} with vertices {:?}; merge the two vertices and \
                 remesh there",
                counted(count, "quadrilateral has", "quadrilaterals have"),
                mesh.quads[first]
            )
        },
    );
    let turned = match orient(&mut mesh.quads) {
        Ok(turned) => turned,
        Err(first) => {
            problems.add(
                "one-sided",
                Severity::Error,
                Element::Cell,
                std::iter::once(first),
                |_, first| {
                    format!(
                        "the surface has one side only, as a Möbius strip: quadrilateral {first} fits its neighbours neither \
                         way round; cut it open"
                    )
                },
            );
            return;
        }
    };
    if turned > 0 {
        problems.0.push(Problem {
            kind: "inconsistent-orientation",
            severity: Severity::Repaired,
            count: turned,
            element: Element::Mesh,
            first: 0,
            message: format!(
                "{turned} of {total} quadrilaterals were oriented opposite to their neighbours; turned round"
            ),
        });
    }
    if let Err(defects) = Connectivity::of(&mesh.quads, mesh.points.len()) {
        if let Some((edge, quads)) = defects.crowded.first() {
            let count = defects.crowded.len();
            problems.0.push(Problem {
                kind: "non-manifold-edge",
                severity: Severity::Error,
                count,
                element: Element::Vertex,
                first: edge[0] as usize,
                message: format!(
                    "{} more than two quadrilaterals, the first is the edge between vertices {} and {} with {quads}; remove \
                     the surplus quadrilaterals or duplicate the vertices",
                    counted(count, "edge has", "edges have"),
                    edge[0],
                    edge[1]
                ),
            });
        }
        let pinched = defects.pinched.iter().map(|&vertex| vertex as usize);
        problems.add("pinched-vertex", Severity::Error, Element::Vertex, pinched, |count, first| {
            format!(
                "{} parts of the surface that share no edge there, the first is vertex {first}; duplicate such vertices",
                counted(count, "vertex joins", "vertices join")
            )
        });
    }
    let folded: Vec<usize> = (0..total)
        .filter(|&quad| {
            let corners = mesh.corners(mesh.quads[quad]);
            let normal = cross(subtract(corners[2], corners[0]), subtract(corners[3], corners[1]));
            (0..4).any(|corner| {
                let [before, here, after] = [corner + 3, corner, corner + 1].map(|place| corners[place % 4]);
                dot(cross(subtract(after, here), subtract(before, here)), normal) <= 0.0
            })
        })
        .collect();
    problems.add("concave", Severity::Warning, Element::Cell, folded.into_iter(), |count, first| {
        format!(
            "{count} of {total} quadrilaterals are not convex, the first is quadrilateral {first}; smooth surfaces over them \
             may fold"
        )
    });
}
