//! Undirected graphs in compressed form.

/// An undirected graph without loops: the neighbours of vertex `v` are `neighbours[offsets[v]..offsets[v + 1]]`, in
/// increasing order, and every edge is stored from both ends.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Graph {
    pub offsets: Vec<usize>,
    pub neighbours: Vec<u32>,
}

impl Graph {
    /// The graph on `count` vertices that joins all vertices of a cell with each other. `name` gives a vertex's place in
    /// the graph, or `None` for vertices that are left out.
    pub fn of_cells<const N: usize>(count: usize, cells: &[[u32; N]], name: impl Fn(u32) -> Option<u32>) -> Self {
        let mut offsets = vec![0usize; count + 1];
        let pairs = |cell: &[u32; N], visit: &mut dyn FnMut(u32, u32)| {
            let mut vertices = [0u32; N];
            let mut length = 0;
            for vertex in cell.iter().filter_map(|&vertex| name(vertex)) {
                vertices[length] = vertex;
                length += 1;
            }
            for &from in &vertices[..length] {
                for &to in &vertices[..length] {
                    if from != to {
                        visit(from, to);
                    }
                }
            }
        };
        for cell in cells {
            pairs(cell, &mut |from, _| offsets[from as usize + 1] += 1);
        }
        for vertex in 0..count {
            offsets[vertex + 1] += offsets[vertex];
        }
        let mut next = offsets.clone();
        let mut neighbours = vec![0u32; offsets[count]];
        for cell in cells {
            pairs(cell, &mut |from, to| {
                neighbours[next[from as usize]] = to;
                next[from as usize] += 1;
            });
        }
        // Cells share edges, so every list holds repetitions: sort each and close the gaps.
        let mut length = 0;
        let mut start = 0;
        for vertex in 0..count {
            let end = offsets[vertex + 1];
            neighbours[start..end].sort_unstable();
            let first = length;
            for index in start..end {
                let neighbour = neighbours[index];
                if length == first || neighbours[length - 1] != neighbour {
                    neighbours[length] = neighbour;
                    length += 1;
                }
            }
            offsets[vertex + 1] = length;
            start = end;
        }
        neighbours.truncate(length);
        neighbours.shrink_to_fit();
        Self { offsets, neighbours }
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Neighbours of a vertex in increasing order.
    pub fn neighbours(&self, vertex: u32) -> &[u32] {
        &self.neighbours[self.offsets[vertex as usize]..self.offsets[vertex as usize + 1]]
    }

    /// Number of neighbours of a vertex.
    pub fn degree(&self, vertex: u32) -> usize {
        self.neighbours(vertex).len()
    }
}
