//! Connectivity of simplicial meshes by counting sorts over flat arrays: facets, boundary, edges, incidence, components,
//! topology.
//!
//! Every function works on the cells alone, takes time and memory linear in them (buckets are the facets or edges that
//! share a smallest vertex), and returns the same order every time. Indices must be below the number of vertices given;
//! [`super::check`] proves that for data from outside.

/// Stands for "no neighbour": the facet lies on the boundary.
pub const NONE: u32 = u32::MAX;
/// Stands for "more than one neighbour": three or more cells share the facet.
pub const CROWDED: u32 = u32::MAX - 1;

/// Local vertices of the facets of a tetrahedron, facet `i` opposite vertex `i`, counter-clockwise seen from outside.
pub const TETRAHEDRON_FACETS: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
/// Local vertices of the six edges of a tetrahedron.
pub const TETRAHEDRON_EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Lists of variable length in two flat arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Row `i` is `items[offsets[i]..offsets[i + 1]]`.
    pub offsets: Vec<usize>,
    pub items: Vec<u32>,
}

impl Rows {
    pub fn row(&self, index: usize) -> &[u32] {
        &self.items[self.offsets[index]..self.offsets[index + 1]]
    }

    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Starts of `rows` buckets from the bucket number of every entry.
fn bucket_offsets(rows: usize, buckets: impl Iterator<Item = u32>) -> Vec<usize> {
    let mut offsets = vec![0usize; rows + 1];
    for bucket in buckets {
        offsets[bucket as usize + 1] += 1;
    }
    for row in 0..rows {
        offsets[row + 1] += offsets[row];
    }
    offsets
}

/// The cells around every vertex, ascending.
pub fn incidence<const N: usize>(cells: &[[u32; N]], vertices: usize) -> Rows {
    let offsets = bucket_offsets(vertices, cells.iter().flatten().copied());
    let mut next = offsets.clone();
    let mut items = vec![0u32; cells.len() * N];
    for (cell, corners) in cells.iter().enumerate() {
        for &vertex in corners {
            items[next[vertex as usize]] = cell as u32;
            next[vertex as usize] += 1;
        }
    }
    Rows { offsets, items }
}

/// The edges of the cells, each once, smaller vertex first, in lexicographic order.
pub fn edges<const N: usize>(cells: &[[u32; N]], vertices: usize) -> Vec<[u32; 2]> {
    let pairs = || {
        cells.iter().flat_map(|cell| {
            (0..N).flat_map(move |a| (a + 1..N).map(move |b| [cell[a].min(cell[b]), cell[a].max(cell[b])]))
        })
    };
    let offsets = bucket_offsets(vertices, pairs().map(|[low, _]| low));
    let mut next = offsets.clone();
    let mut others = vec![0u32; offsets[vertices]];
    for [low, high] in pairs() {
        others[next[low as usize]] = high;
        next[low as usize] += 1;
    }
    let mut edges = Vec::with_capacity(cells.len() + 2 * vertices);
    for low in 0..vertices {
        let bucket = &mut others[offsets[low]..offsets[low + 1]];
        bucket.sort_unstable();
        let mut last = NONE;
        for &high in bucket.iter() {
            if high != last {
                edges.push([low as u32, high]);
                last = high;
            }
        }
    }
    edges
}

/// The vertices joined to every vertex by one of `edges`, ascending when `edges` come from [`edges`].
pub fn vertex_neighbours(edges: &[[u32; 2]], vertices: usize) -> Rows {
    let offsets = bucket_offsets(vertices, edges.iter().flatten().copied());
    let mut next = offsets.clone();
    let mut items = vec![0u32; edges.len() * 2];
    // Smaller neighbours first: over lexicographic edges both sweeps then fill each row in ascending order.
    for &[low, high] in edges {
        items[next[high as usize]] = low;
        next[high as usize] += 1;
    }
    for &[low, high] in edges {
        items[next[low as usize]] = high;
        next[low as usize] += 1;
    }
    Rows { offsets, items }
}

/// The cell on the other side of every facet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facets<const N: usize> {
    /// For each cell, the cell that shares the facet opposite its vertex `i`; [`NONE`] or [`CROWDED`] otherwise.
    pub neighbours: Vec<[u32; N]>,
    /// Number of facets shared by three or more cells, and the first cell that has one.
    pub crowded: usize,
    pub first_crowded: u32,
}

/// Matches the facets (edges of triangles, faces of tetrahedra) of all cells. Facets are equal when their vertex sets
/// are; orientation plays no part.
pub fn facets<const N: usize>(cells: &[[u32; N]], vertices: usize) -> Facets<N> {
    /// The facet opposite `local`: its smallest vertex, and the others sorted and packed.
    fn key<const N: usize>(cell: &[u32; N], local: usize) -> (u32, u64) {
        let mut sorted = [0u32; N];
        let mut count = 0;
        for (index, &vertex) in cell.iter().enumerate() {
            if index != local {
                // Insertion sort of at most three numbers.
                let mut place = count;
                while place > 0 && sorted[place - 1] > vertex {
                    sorted[place] = sorted[place - 1];
                    place -= 1;
                }
                sorted[place] = vertex;
                count += 1;
            }
        }
        (
            sorted[0],
            sorted[1..count]
                .iter()
                .fold(0, |packed, &vertex| packed << 32 | u64::from(vertex)),
        )
    }
    let all = || (0..cells.len()).flat_map(|cell| (0..N).map(move |local| (cell, local)));
    let offsets = bucket_offsets(vertices, all().map(|(cell, local)| key(&cells[cell], local).0));
    let mut next = offsets.clone();
    let mut entries = vec![(0u64, 0u32, 0u8); cells.len() * N];
    for (cell, local) in all() {
        let (low, rest) = key(&cells[cell], local);
        entries[next[low as usize]] = (rest, cell as u32, local as u8);
        next[low as usize] += 1;
    }
    let mut found = Facets {
        neighbours: vec![[NONE; N]; cells.len()],
        crowded: 0,
        first_crowded: NONE,
    };
    for low in 0..vertices {
        let bucket = &mut entries[offsets[low]..offsets[low + 1]];
        bucket.sort_unstable();
        for same in bucket.chunk_by(|a, b| a.0 == b.0) {
            match same {
                [_] => {}
                &[(_, a, i), (_, b, j)] => {
                    found.neighbours[a as usize][i as usize] = b;
                    found.neighbours[b as usize][j as usize] = a;
                }
                many => {
                    found.crowded += 1;
                    for &(_, cell, local) in many {
                        found.neighbours[cell as usize][local as usize] = CROWDED;
                        found.first_crowded = found.first_crowded.min(cell);
                    }
                }
            }
        }
    }
    found
}

/// The boundary surface of a tetrahedral mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Boundary {
    /// Oriented outward when the tetrahedra are positively oriented; in the order of their tetrahedra.
    pub triangles: Vec<[u32; 3]>,
    /// The tetrahedron behind each triangle.
    pub cells: Vec<u32>,
    /// Whether a vertex lies on the boundary, for every vertex of the mesh.
    pub mask: Vec<bool>,
    /// The boundary vertices, ascending.
    pub vertices: Vec<u32>,
}

impl Boundary {
    /// The index within [`Boundary::vertices`] of every vertex of the mesh; [`NONE`] for interior ones.
    pub fn places(&self) -> Vec<u32> {
        let mut places = vec![NONE; self.mask.len()];
        for (place, &vertex) in (0..).zip(&self.vertices) {
            places[vertex as usize] = place;
        }
        places
    }
}

/// The boundary of tetrahedra: the faces with one tetrahedron.
pub fn boundary(cells: &[[u32; 4]], vertices: usize) -> Boundary {
    boundary_from(cells, vertices, &facets(cells, vertices))
}

/// As [`boundary`], from facets that are at hand already.
pub fn boundary_from(cells: &[[u32; 4]], vertices: usize, facets: &Facets<4>) -> Boundary {
    let mut found = Boundary {
        mask: vec![false; vertices],
        ..Boundary::default()
    };
    for (index, (cell, neighbours)) in cells.iter().zip(&facets.neighbours).enumerate() {
        for (local, &neighbour) in neighbours.iter().enumerate() {
            if neighbour == NONE {
                let triangle = TETRAHEDRON_FACETS[local].map(|corner| cell[corner]);
                for vertex in triangle {
                    found.mask[vertex as usize] = true;
                }
                found.triangles.push(triangle);
                found.cells.push(index as u32);
            }
        }
    }
    found.vertices = (0..vertices as u32)
        .filter(|&vertex| found.mask[vertex as usize])
        .collect();
    found
}

/// Disjoint sets with path halving; the smaller index is always the root, so that labels do not depend on the order of
/// the unions.
pub(crate) struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    pub(crate) fn new(count: usize) -> Self {
        Self {
            parents: (0..count as u32).collect(),
        }
    }

    pub(crate) fn root(&mut self, mut item: u32) -> u32 {
        while self.parents[item as usize] != item {
            self.parents[item as usize] = self.parents[self.parents[item as usize] as usize];
            item = self.parents[item as usize];
        }
        item
    }

    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}

/// Connected components, numbered by their smallest vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Components {
    pub count: usize,
    /// Component of every vertex; [`NONE`] for a vertex without cells.
    pub of_vertex: Vec<u32>,
}

/// Components of cells joined by shared vertices.
pub fn components<const N: usize>(cells: &[[u32; N]], vertices: usize) -> Components {
    let mut sets = DisjointSets::new(vertices);
    let mut used = vec![false; vertices];
    for cell in cells {
        for &vertex in cell {
            used[vertex as usize] = true;
            sets.join(cell[0], vertex);
        }
    }
    let mut found = Components {
        count: 0,
        of_vertex: vec![NONE; vertices],
    };
    for vertex in (0..vertices).filter(|&vertex| used[vertex]) {
        let root = sets.root(vertex as u32) as usize;
        if root == vertex {
            found.of_vertex[vertex] = found.count as u32;
            found.count += 1;
        } else {
            found.of_vertex[vertex] = found.of_vertex[root];
        }
    }
    found
}

/// Vertices whose cells do not hang together through facets at the vertex: two parts touch there in a point (or, for
/// tetrahedra, along an edge). Ascending. Vertices of facets with three or more cells are passed over.
pub fn pinched_vertices<const N: usize>(cells: &[[u32; N]], vertices: usize, facets: &Facets<N>) -> Vec<u32> {
    let mut corners = DisjointSets::new(cells.len() * N);
    for (index, (cell, neighbours)) in cells.iter().zip(&facets.neighbours).enumerate() {
        for (local, &neighbour) in neighbours.iter().enumerate() {
            // Each pair once.
            if neighbour >= CROWDED || neighbour as usize > index {
                continue;
            }
            let other = &cells[neighbour as usize];
            for (corner, vertex) in cell.iter().enumerate().filter(|&(corner, _)| corner != local) {
                if let Some(place) = other.iter().position(|v| v == vertex) {
                    corners.join((index * N + corner) as u32, neighbour * N as u32 + place as u32);
                }
            }
        }
    }
    let mut fans = vec![0u8; vertices];
    let mut crowded = vec![false; vertices];
    for (index, cell) in cells.iter().enumerate() {
        for (corner, &vertex) in cell.iter().enumerate() {
            let item = (index * N + corner) as u32;
            if corners.root(item) == item {
                fans[vertex as usize] = fans[vertex as usize].saturating_add(1);
            }
            let other = |local: usize| local != corner && facets.neighbours[index][local] == CROWDED;
            crowded[vertex as usize] |= (0..N).any(other);
        }
    }
    (0..vertices as u32)
        .filter(|&vertex| fans[vertex as usize] > 1 && !crowded[vertex as usize])
        .collect()
}

/// Topology of one connected component of a triangle surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    pub vertices: usize,
    pub edges: usize,
    pub triangles: usize,
    /// Closed curves of edges with one triangle.
    pub loops: usize,
    /// Number of handles, from `V - E + F = 2 - 2 g - loops`; `None` unless the component is a manifold that can be
    /// oriented consistently as it stands.
    pub genus: Option<usize>,
}

impl Surface {
    /// `V - E + F`.
    pub fn euler(&self) -> i64 {
        self.vertices as i64 - self.edges as i64 + self.triangles as i64
    }
}

/// Topology of a triangle surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceTopology {
    /// One entry a component, in the order of the components' smallest vertices.
    pub components: Vec<Surface>,
    /// Edges with three or more triangles, and the first triangle that has one.
    pub crowded_edges: usize,
    pub first_crowded: u32,
    /// Vertices where parts touch in a point, ascending.
    pub pinched: Vec<u32>,
    /// Pairs of neighbouring triangles that run along their edge in the same direction, as the first of the pair.
    pub disoriented: Vec<u32>,
    /// Edges with one triangle, and their vertices.
    pub boundary_edges: usize,
    pub boundary_vertices: usize,
}

/// Analyses triangles given by vertices; degenerate or repeated triangles spoil the counts and should be gone.
pub fn surface_topology(triangles: &[[u32; 3]], vertices: usize) -> SurfaceTopology {
    let parts = components(triangles, vertices);
    let facets = facets(triangles, vertices);
    let mut found = SurfaceTopology {
        components: vec![Surface::default(); parts.count],
        pinched: pinched_vertices(triangles, vertices, &facets),
        crowded_edges: facets.crowded,
        first_crowded: facets.first_crowded,
        ..SurfaceTopology::default()
    };
    let mut spoiled = vec![false; parts.count];
    for &part in parts.of_vertex.iter().filter(|&&part| part != NONE) {
        found.components[part as usize].vertices += 1;
    }
    for [low, _] in edges(triangles, vertices) {
        found.components[parts.of_vertex[low as usize] as usize].edges += 1;
    }
    for &vertex in &found.pinched {
        spoiled[parts.of_vertex[vertex as usize] as usize] = true;
    }
    let mut rims = DisjointSets::new(vertices);
    let mut on_rim = vec![false; vertices];
    for (index, (triangle, neighbours)) in triangles.iter().zip(&facets.neighbours).enumerate() {
        let part = parts.of_vertex[triangle[0] as usize] as usize;
        found.components[part].triangles += 1;
        for (local, &neighbour) in neighbours.iter().enumerate() {
            let (from, to) = (triangle[(local + 1) % 3], triangle[(local + 2) % 3]);
            match neighbour {
                NONE => {
                    found.boundary_edges += 1;
                    on_rim[from as usize] = true;
                    on_rim[to as usize] = true;
                    rims.join(from, to);
                }
                CROWDED => spoiled[part] = true,
                other if (other as usize) > index => {
                    let other = &triangles[other as usize];
                    if (0..3).any(|i| other[i] == from && other[(i + 1) % 3] == to) {
                        found.disoriented.push(index as u32);
                        spoiled[part] = true;
                    }
                }
                _ => {}
            }
        }
    }
    found.boundary_vertices = on_rim.iter().filter(|&&on| on).count();
    for (vertex, &part) in parts.of_vertex.iter().enumerate() {
        if on_rim[vertex] && rims.root(vertex as u32) as usize == vertex {
            found.components[part as usize].loops += 1;
        }
    }
    for (part, &spoiled) in found.components.iter_mut().zip(&spoiled) {
        let handles = 2 - part.euler() - part.loops as i64;
        if !spoiled && handles >= 0 && handles % 2 == 0 {
            part.genus = Some((handles / 2) as usize);
        }
    }
    found
}
