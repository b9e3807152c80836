//! Structure of a symmetric block matrix over the free vertices of a mesh, and the sum of the cells' parts.

use super::elimination::{Elimination, inverse};
use super::graph::Graph;
use super::nested_dissection::nested_dissection;
use rayon::prelude::*;
use std::fmt;

/// Index of a vertex that is not free.
pub const FIXED: u32 = u32::MAX;

/// Blocks summed by one thread at a time.
const CHUNK: usize = 2048;

/// Why no structure could be made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PatternError {
    /// `free` and `points` differ in length.
    Lengths { points: usize, free: usize },
    /// A cell names a vertex that does not exist.
    Vertex { cell: usize, vertex: u32, points: usize },
    /// A cell names a vertex twice.
    Repeated { cell: usize, vertex: u32 },
    /// The parts of the cells cannot be numbered.
    TooLarge { cells: usize },
}

impl fmt::Display for PatternError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lengths { points, free } => {
                write!(
                    f,
                    "{points} points but {free} marks of free vertices: give one mark a point"
                )
            }
            Self::Vertex { cell, vertex, points } => {
                write!(
                    f,
                    "cell {cell} names vertex {vertex}, but there are only {points} points, counted from 0"
                )
            }
            Self::Repeated { cell, vertex } => {
                write!(
                    f,
                    "cell {cell} names vertex {vertex} twice: remove degenerate cells first"
                )
            }
            Self::TooLarge { cells } => write!(f, "{cells} cells are too many for one matrix: split the mesh"),
        }
    }
}

impl std::error::Error for PatternError {}

/// Structure of a symmetric matrix with a `B x B` block for each free vertex and each two free vertices of one cell.
///
/// Unknowns are numbered vertex by vertex: unknown `B f + c` is component `c` of the `f`-th free vertex, free vertices
/// counted in the order of the mesh. This is the layout of every vector here. Fixed vertices have no unknowns: their
/// rows and columns are left out.
///
/// A matrix of this structure is a slice of [`values_len`](Self::values_len) scalars: the blocks of the lower triangle
/// in an order of elimination of its own, each row-major.
#[derive(Clone, Debug)]
pub struct BlockPattern<const B: usize> {
    /// Vertex of the mesh behind each free vertex.
    vertices: Vec<u32>,
    /// Free vertex of each vertex of the mesh, or `FIXED`.
    free: Vec<u32>,
    /// Position of each free vertex in the elimination.
    pub(super) position: Vec<u32>,
    /// Blocks of column `k` are `column_offsets[k]..column_offsets[k + 1]`, the diagonal one first.
    pub(super) column_offsets: Vec<usize>,
    /// Position of each block's row, increasing within a column.
    pub(super) rows: Vec<u32>,
    /// Row of each block within its front, in vertices.
    pub(super) slots: Vec<u32>,
    /// Parts summed into each block: twice the part's number, plus one if it is to be transposed.
    part_offsets: Vec<u32>,
    parts: Vec<u32>,
    /// Length of the parts array, in blocks.
    parts_len: usize,
    pub(super) elimination: Elimination,
}

impl<const B: usize> BlockPattern<B> {
    /// The structure over the vertices with `free[v]`, ordered by nested dissection at the given points.
    ///
    /// Cells may be tetrahedra, triangles or edges.
    pub fn new<const N: usize>(points: &[[f64; 3]], cells: &[[u32; N]], free: &[bool]) -> Result<Self, PatternError> {
        Self::with_order(points, cells, free, nested_dissection)
    }

    /// The same with an order of elimination of the caller's: it gets the graph of the free vertices and their places,
    /// and returns the free vertex to be eliminated first, second and so on.
    pub fn with_order<const N: usize>(
        points: &[[f64; 3]],
        cells: &[[u32; N]],
        free: &[bool],
        order: impl FnOnce(&Graph, &[[f64; 3]]) -> Vec<u32>,
    ) -> Result<Self, PatternError> {
        if points.len() != free.len() {
            return Err(PatternError::Lengths {
                points: points.len(),
                free: free.len(),
            });
        }
        let pairs = N * (N + 1) / 2;
        if cells.len().saturating_mul(pairs) >= (u32::MAX / 2) as usize || points.len() >= FIXED as usize {
            return Err(PatternError::TooLarge { cells: cells.len() });
        }
        for (index, cell) in cells.iter().enumerate() {
            for (place, &vertex) in cell.iter().enumerate() {
                if vertex as usize >= points.len() {
                    return Err(PatternError::Vertex {
                        cell: index,
                        vertex,
                        points: points.len(),
                    });
                }
                if cell[..place].contains(&vertex) {
                    return Err(PatternError::Repeated { cell: index, vertex });
                }
            }
        }
        let vertices: Vec<u32> = (0..points.len() as u32)
            .filter(|&vertex| free[vertex as usize])
            .collect();
        let mut name = vec![FIXED; points.len()];
        for (index, &vertex) in vertices.iter().enumerate() {
            name[vertex as usize] = index as u32;
        }
        let count = vertices.len();
        let graph = Graph::of_cells(count, cells, |vertex| {
            Some(name[vertex as usize]).filter(|&index| index != FIXED)
        });
        let places: Vec<[f64; 3]> = vertices.iter().map(|&vertex| points[vertex as usize]).collect();
        let structure = Self::of_graph(&graph, &order(&graph, &places));
        let (position, column_offsets, rows) = (&structure.position, &structure.column_offsets, &structure.rows);

        // Sort the parts by the block they belong to, keeping the order of the cells.
        let none = u32::MAX;
        let mut targets = vec![none; cells.len() * pairs];
        targets
            .par_chunks_mut(pairs.max(1))
            .zip(cells)
            .for_each(|(targets, cell)| {
                let place = cell.map(|vertex| match name[vertex as usize] {
                    FIXED => FIXED,
                    index => position[index as usize],
                });
                let mut target = targets.iter_mut();
                for a in 0..N {
                    for (b, target) in (a..N).zip(target.by_ref()) {
                        if place[a] != FIXED && place[b] != FIXED {
                            let (column, row) = (place[a].min(place[b]) as usize, place[a].max(place[b]));
                            let blocks = &rows[column_offsets[column]..column_offsets[column + 1]];
                            let block = column_offsets[column] + blocks.partition_point(|&other| other < row);
                            *target = (block as u32) << 1 | u32::from(place[a] < place[b]);
                        }
                    }
                }
            });
        let mut part_offsets = vec![0u32; rows.len() + 1];
        for &target in targets.iter().filter(|&&target| target != none) {
            part_offsets[(target >> 1) as usize + 1] += 1;
        }
        for block in 0..rows.len() {
            part_offsets[block + 1] += part_offsets[block];
        }
        let mut next = part_offsets.clone();
        let mut parts = vec![0u32; part_offsets[rows.len()] as usize];
        for (part, &target) in targets.iter().enumerate().filter(|&(_, &target)| target != none) {
            let place = &mut next[(target >> 1) as usize];
            parts[*place as usize] = (part as u32) << 1 | (target & 1);
            *place += 1;
        }
        Ok(Self {
            vertices,
            free: name,
            part_offsets,
            parts,
            parts_len: cells.len() * pairs,
            ..structure
        })
    }

    /// The structure over the vertices of a graph, all free, in an order of elimination: entry `k` of `order` is the
    /// vertex to be eliminated `k`-th. Its matrices are filled block by block ([`block`](Self::block)), not from
    /// cells.
    pub fn of_graph(graph: &Graph, order: &[u32]) -> Self {
        let elimination = Elimination::new(graph, order, B);
        let count = graph.len();
        let position = inverse(&elimination.order);

        let mut column_offsets = Vec::with_capacity(count + 1);
        column_offsets.push(0);
        let mut rows = Vec::with_capacity(count + graph.neighbours.len() / 2);
        for (column, &vertex) in elimination.order.iter().enumerate() {
            let start = rows.len();
            rows.push(column as u32);
            rows.extend(
                graph
                    .neighbours(vertex)
                    .iter()
                    .map(|&neighbour| position[neighbour as usize])
                    .filter(|&row| row > column as u32),
            );
            rows[start..].sort_unstable();
            column_offsets.push(rows.len());
        }
        let mut slots = vec![0u32; rows.len()];
        for front in 0..elimination.fronts() {
            let (begin, end) = (elimination.begin[front], elimination.begin[front + 1]);
            let below = elimination.rows(front);
            for block in column_offsets[begin as usize]..column_offsets[end as usize] {
                slots[block] = if rows[block] < end {
                    rows[block] - begin
                } else {
                    end - begin + below.partition_point(|&row| row < rows[block]) as u32
                };
            }
        }

        Self {
            vertices: (0..count as u32).collect(),
            free: (0..count as u32).collect(),
            position,
            column_offsets,
            part_offsets: vec![0; rows.len() + 1],
            rows,
            slots,
            parts: Vec::new(),
            parts_len: 0,
            elimination,
        }
    }

    /// Where a matrix holds the block of two free vertices: the index of its first scalar, and whether the block there
    /// is the one with `row` and `column` exchanged. `None` where the structure has no such block.
    pub fn block(&self, row: usize, column: usize) -> Option<(usize, bool)> {
        let (row, column) = (self.position[row], self.position[column]);
        let (low, high) = (row.min(column) as usize, row.max(column));
        let blocks = self.column_offsets[low]..self.column_offsets[low + 1];
        let found = self.rows[blocks.clone()].binary_search(&high).ok()?;
        Some((B * B * (blocks.start + found), row < column))
    }

    /// Number of unknowns.
    pub fn dimension(&self) -> usize {
        B * self.vertices.len()
    }

    /// Vertices of the mesh that are free, increasing: unknowns `B f..B f + B` belong to `vertices()[f]`.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// For each vertex of the mesh its place among the free vertices, or [`FIXED`].
    pub fn free_index(&self) -> &[u32] {
        &self.free
    }

    /// Length of a matrix in scalars.
    pub fn values_len(&self) -> usize {
        B * B * self.rows.len()
    }

    /// Length that `assemble` expects: `B * B` scalars for every pair of a cell's vertices and every vertex itself.
    pub fn parts_len(&self) -> usize {
        B * B * self.parts_len
    }

    /// Fill, memory and arithmetic of the factorization.
    pub fn elimination(&self) -> &Elimination {
        &self.elimination
    }

    /// Sums the cells' parts into a matrix, replacing what it held.
    ///
    /// `parts` holds for each cell the blocks of its vertices `(a, b)` with `a <= b` in lexicographic order, for a
    /// tetrahedron (0,0), (0,1), (0,2), (0,3), (1,1), (1,2), (1,3), (2,2), (2,3), (3,3), each `B x B` row-major with the
    /// rows of `a` and the columns of `b`. Blocks of fixed vertices are not read. Each sum runs over the cells in order.
    pub fn assemble(&self, parts: &[f64], values: &mut [f64]) {
        assert_eq!(
            parts.len(),
            self.parts_len(),
            "one block for each pair of vertices of each cell"
        );
        assert_eq!(values.len(), self.values_len(), "a matrix of this structure");
        values
            .par_chunks_mut(CHUNK * B * B)
            .enumerate()
            .for_each(|(chunk, values)| {
                for (index, value) in values.chunks_exact_mut(B * B).enumerate() {
                    let block = chunk * CHUNK + index;
                    let mut sum = [[0.0; B]; B];
                    let range = self.part_offsets[block] as usize..self.part_offsets[block + 1] as usize;
                    for &part in &self.parts[range] {
                        let start = (part >> 1) as usize * B * B;
                        let part_values = &parts[start..start + B * B];
                        if part & 1 == 0 {
                            for row in 0..B {
                                for column in 0..B {
                                    sum[row][column] += part_values[row * B + column];
                                }
                            }
                        } else {
                            for row in 0..B {
                                for column in 0..B {
                                    sum[row][column] += part_values[column * B + row];
                                }
                            }
                        }
                    }
                    value.copy_from_slice(sum.as_flattened());
                }
            });
    }

    /// Adds `amount` to the diagonal entries of one free vertex, as a quadratic penalty `amount / 2 |x - target|^2` does.
    pub fn add_to_diagonal(&self, values: &mut [f64], free_vertex: usize, amount: f64) {
        let start = B * B * self.column_offsets[self.position[free_vertex] as usize];
        for component in 0..B {
            values[start + component * (B + 1)] += amount;
        }
    }

    /// Diagonal entries of a matrix, in the layout of a vector.
    pub fn diagonal(&self, values: &[f64]) -> Vec<f64> {
        let start = |&position: &u32| B * B * self.column_offsets[position as usize];
        self.position
            .iter()
            .map(start)
            .flat_map(|start| (0..B).map(move |component| values[start + component * (B + 1)]))
            .collect()
    }

    /// `result = A x`, one pass over the lower triangle.
    pub fn multiply(&self, values: &[f64], x: &[f64], result: &mut [f64]) {
        assert_eq!(values.len(), self.values_len(), "a matrix of this structure");
        assert!(
            x.len() == self.dimension() && result.len() == self.dimension(),
            "vectors of this structure"
        );
        result.fill(0.0);
        let order = &self.elimination.order;
        let vector = |slice: &[f64], free: usize| -> [f64; B] { std::array::from_fn(|c| slice[B * free + c]) };
        for (column, &free) in order.iter().enumerate() {
            let free = free as usize;
            let own = vector(x, free);
            let mut sum = [0.0; B];
            for block in self.column_offsets[column]..self.column_offsets[column + 1] {
                let entries = &values[B * B * block..B * B * (block + 1)];
                let other = order[self.rows[block] as usize] as usize;
                let there = vector(x, other);
                let diagonal = other == free;
                for row in 0..B {
                    let target = &mut result[B * other + row];
                    for c in 0..B {
                        *target += entries[row * B + c] * own[c];
                        if !diagonal {
                            sum[c] += entries[row * B + c] * there[row];
                        }
                    }
                }
            }
            for c in 0..B {
                result[B * free + c] += sum[c];
            }
        }
    }
}
