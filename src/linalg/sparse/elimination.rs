//! Symbolic factorization: which dense fronts a Cholesky factorization consists of, for a given order of the vertices.
//!
//! Everything counts in vertices; a vertex stands for `block` unknowns that stay together.

use super::graph::Graph;

/// A parent index that means "none".
pub(super) const ROOT: u32 = u32::MAX;

/// A child's front is merged into its parent's if the merged front has at most so many columns of unknowns and at most
/// this share of explicit zeros. Fewer, larger fronts run faster although they do more arithmetic.
const RELAXATION: [(usize, f64); 4] = [(18, 0.8), (60, 0.4), (200, 0.12), (usize::MAX, 0.04)];

/// Branches with less than this share of all arithmetic are factorized one after another: every branch under way holds
/// working memory of its own, and large fronts keep all threads busy anyway.
const BRANCH_SHARE: f64 = 0.2;
/// Nor is a branch below this many operations worth sharing out.
const BRANCH_OPERATIONS: f64 = 2e6;

/// Consecutive rows of a child's update that go to consecutive rows of its parent's front, counted in vertices.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub child: u32,
    pub parent: u32,
    pub length: u32,
}

/// Columns of an update matrix that are stored side by side: each strip begins at its first diagonal entry, so that
/// little more than the lower triangle is stored. A whole number of vertices.
pub(super) fn strip_width(block: usize) -> usize {
    (240 / block).max(1) * block
}

/// Where the strip after `skipped` strips starts in an update matrix of the given size.
pub(super) fn strip_start(size: usize, width: usize, skipped: usize) -> usize {
    skipped * width * size - width * width * (skipped * skipped.saturating_sub(1) / 2)
}

/// The fronts of a Cholesky factorization, children before parents.
///
/// Front `s` eliminates the vertices at the positions `begin[s]..begin[s + 1]` of the order and updates those at the
/// positions `rows(s)`, all of which are eliminated later.
#[derive(Clone, Debug)]
pub struct Elimination {
    /// Unknowns a vertex.
    pub(super) block: usize,
    /// The vertex at each position.
    pub(super) order: Vec<u32>,
    pub(super) begin: Vec<u32>,
    row_offsets: Vec<usize>,
    rows: Vec<u32>,
    pub(super) parent: Vec<u32>,
    child_offsets: Vec<usize>,
    children: Vec<u32>,
    /// First front of the branch that ends with this one.
    pub(super) first: Vec<u32>,
    /// Where each front's part of the factor starts, in scalars; one more entry than fronts.
    pub(super) value_offsets: Vec<usize>,
    run_offsets: Vec<usize>,
    runs: Vec<Run>,
    /// Scalars of working memory that a branch needs.
    pub(super) arena: Vec<usize>,
    /// Whether the children of this front are factorized side by side.
    pub(super) shared: Vec<bool>,
    operations: f64,
}

impl Elimination {
    /// Analyses the elimination of `graph`'s vertices, `block` unknowns each, in an order that causes the same fill as
    /// `order` (entry `k` is the vertex eliminated `k`-th) and keeps the columns of a front together.
    pub fn new(graph: &Graph, order: &[u32], block: usize) -> Self {
        let count = graph.len();
        let tree = Tree::new(graph, order);
        let fronts = amalgamate(&tree, block);
        let mut order = Vec::with_capacity(count);
        let mut begin = vec![0u32];
        for &front in &fronts.sequence {
            for &member in &fronts.members[front as usize] {
                let columns = tree.supernode_begin[member as usize]..tree.supernode_begin[member as usize + 1];
                order.extend_from_slice(&tree.order[columns.start as usize..columns.end as usize]);
            }
            begin.push(order.len() as u32);
        }
        let fronts_count = begin.len() - 1;
        let mut name = vec![ROOT; fronts.members.len()];
        for (index, &front) in fronts.sequence.iter().enumerate() {
            name[front as usize] = index as u32;
        }
        let parent: Vec<u32> = fronts
            .sequence
            .iter()
            .map(|&front| match fronts.parent[front as usize] {
                ROOT => ROOT,
                parent => name[parent as usize],
            })
            .collect();
        let mut child_offsets = vec![0usize; fronts_count + 1];
        for &up in parent.iter().filter(|&&up| up != ROOT) {
            child_offsets[up as usize + 1] += 1;
        }
        for front in 0..fronts_count {
            child_offsets[front + 1] += child_offsets[front];
        }
        let mut next = child_offsets.clone();
        let mut children = vec![0u32; child_offsets[fronts_count]];
        let mut first: Vec<u32> = (0..fronts_count as u32).collect();
        for (front, &up) in parent.iter().enumerate() {
            if up != ROOT {
                children[next[up as usize]] = front as u32;
                next[up as usize] += 1;
                first[up as usize] = first[up as usize].min(first[front]);
            }
        }

        let mut elimination = Self {
            block,
            order,
            begin,
            row_offsets: vec![0],
            rows: Vec::new(),
            parent,
            child_offsets,
            children,
            first,
            value_offsets: vec![0],
            run_offsets: vec![0],
            runs: Vec::new(),
            arena: Vec::with_capacity(fronts_count),
            shared: Vec::with_capacity(fronts_count),
            operations: 0.0,
        };
        elimination.find_rows(graph);
        elimination.find_runs();
        elimination.plan_memory();
        elimination
    }

    fn find_rows(&mut self, graph: &Graph) {
        let position = inverse(&self.order);
        let mut mark = vec![ROOT; graph.len()];
        for front in 0..self.fronts() {
            let columns = self.begin[front] as usize..self.begin[front + 1] as usize;
            let end = columns.end as u32;
            let start = self.rows.len();
            for column in columns {
                for &neighbour in graph.neighbours(self.order[column]) {
                    let row = position[neighbour as usize];
                    if row >= end && mark[row as usize] != front as u32 {
                        mark[row as usize] = front as u32;
                        self.rows.push(row);
                    }
                }
            }
            for child in self.child_offsets[front]..self.child_offsets[front + 1] {
                let child = self.children[child] as usize;
                for index in self.row_offsets[child]..self.row_offsets[child + 1] {
                    let row = self.rows[index];
                    if row >= end && mark[row as usize] != front as u32 {
                        mark[row as usize] = front as u32;
                        self.rows.push(row);
                    }
                }
            }
            self.rows[start..].sort_unstable();
            self.row_offsets.push(self.rows.len());
            let (columns, rows) = (self.columns(front), self.rows(front).len() * self.block);
            self.value_offsets
                .push(self.value_offsets[front] + columns * (columns + rows));
        }
    }

    fn find_runs(&mut self) {
        for front in 0..self.fronts() {
            if self.parent[front] != ROOT {
                let up = self.parent[front] as usize;
                let (start, end) = (self.begin[up], self.begin[up + 1]);
                let above = &self.rows[self.row_offsets[up]..self.row_offsets[up + 1]];
                let mut place = 0;
                for (index, &row) in self.rows[self.row_offsets[front]..self.row_offsets[front + 1]]
                    .iter()
                    .enumerate()
                {
                    let target = if row < end {
                        row - start
                    } else {
                        while above[place] != row {
                            place += 1;
                        }
                        end - start + place as u32
                    };
                    // A run does not cross from the parent's columns to its rows.
                    match self.runs[self.run_offsets[front]..].last_mut() {
                        Some(run) if run.parent + run.length == target && target != end - start => run.length += 1,
                        _ => self.runs.push(Run {
                            child: index as u32,
                            parent: target,
                            length: 1,
                        }),
                    }
                }
            }
            self.run_offsets.push(self.runs.len());
        }
    }

    fn plan_memory(&mut self) {
        let mut work: Vec<f64> = Vec::with_capacity(self.fronts());
        for front in 0..self.fronts() {
            let own = operations(self.columns(front), self.update(front));
            let below: f64 = self.children(front).iter().map(|&child| work[child as usize]).sum();
            work.push(own + below);
            self.operations += own;
        }
        for (front, &work) in work.iter().enumerate() {
            let own = self.update_scalars(front);
            let shared =
                self.children(front).len() > 1 && work > (self.operations * BRANCH_SHARE).max(BRANCH_OPERATIONS);
            let mut peak = 0;
            let mut held = 0;
            for &child in self.children(front) {
                let child = child as usize;
                if shared {
                    held += self.arena[child];
                } else {
                    peak = peak.max(held + self.arena[child]);
                    held += self.update_scalars(child);
                }
            }
            self.arena.push(peak.max(held + own));
            self.shared.push(shared);
        }
    }

    /// The vertex eliminated at each position.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Number of fronts.
    pub fn fronts(&self) -> usize {
        self.begin.len() - 1
    }

    /// Unknowns that a front eliminates.
    pub fn columns(&self, front: usize) -> usize {
        (self.begin[front + 1] - self.begin[front]) as usize * self.block
    }

    /// Unknowns that a front updates.
    pub fn update(&self, front: usize) -> usize {
        (self.row_offsets[front + 1] - self.row_offsets[front]) * self.block
    }

    /// Scalars that a front's update matrix takes.
    pub(super) fn update_scalars(&self, front: usize) -> usize {
        let (size, width) = (self.update(front), strip_width(self.block));
        let strips = size / width;
        let rest = size - strips * width;
        strip_start(size, width, strips) + rest * rest
    }

    /// Positions that a front updates, increasing.
    pub fn rows(&self, front: usize) -> &[u32] {
        &self.rows[self.row_offsets[front]..self.row_offsets[front + 1]]
    }

    pub(super) fn is_root(&self, front: u32) -> bool {
        self.parent[front as usize] == ROOT
    }

    pub(super) fn children(&self, front: usize) -> &[u32] {
        &self.children[self.child_offsets[front]..self.child_offsets[front + 1]]
    }

    pub(super) fn runs(&self, front: usize) -> &[Run] {
        &self.runs[self.run_offsets[front]..self.run_offsets[front + 1]]
    }

    /// Scalars of the factor, explicit zeros and the unused upper halves of the diagonal blocks included.
    pub fn factor_scalars(&self) -> usize {
        self.value_offsets[self.fronts()]
    }

    /// Scalars of working memory during a factorization.
    pub fn working_scalars(&self) -> usize {
        (0..self.fronts())
            .filter(|&front| self.parent[front] == ROOT)
            .map(|front| self.arena[front])
            .sum()
    }

    /// Floating-point operations of one factorization, a multiplication with its addition counted as two.
    pub fn operations(&self) -> f64 {
        self.operations
    }
}

fn operations(columns: usize, update: usize) -> f64 {
    let (columns, update) = (columns as f64, update as f64);
    columns * columns * columns / 3.0 + columns * columns * update + columns * update * update
}

/// The inverse of a permutation.
pub(super) fn inverse(permutation: &[u32]) -> Vec<u32> {
    let mut inverse = vec![0u32; permutation.len()];
    for (index, &image) in permutation.iter().enumerate() {
        inverse[image as usize] = index as u32;
    }
    inverse
}

/// A postordered elimination tree with its fundamental supernodes.
struct Tree {
    order: Vec<u32>,
    supernode_begin: Vec<u32>,
    /// Supernode above each supernode.
    parent: Vec<u32>,
    /// Rows of a supernode below its own columns.
    rows: Vec<u32>,
}

impl Tree {
    fn new(graph: &Graph, order: &[u32]) -> Self {
        let count = graph.len();
        let position = inverse(order);
        // Elimination tree with path compression (Liu 1986).
        let mut parent = vec![ROOT; count];
        let mut ancestor = vec![ROOT; count];
        for (k, &vertex) in order.iter().enumerate() {
            let k = k as u32;
            for &neighbour in graph.neighbours(vertex) {
                let mut node = position[neighbour as usize];
                while node < k {
                    let above = ancestor[node as usize];
                    ancestor[node as usize] = k;
                    if above == ROOT {
                        parent[node as usize] = k;
                        break;
                    }
                    if above == k {
                        break;
                    }
                    node = above;
                }
            }
        }
        let sequence = postorder(&parent);
        let name = inverse(&sequence);
        let order: Vec<u32> = sequence.iter().map(|&node| order[node as usize]).collect();
        let parent: Vec<u32> = sequence
            .iter()
            .map(|&node| match parent[node as usize] {
                ROOT => ROOT,
                above => name[above as usize],
            })
            .collect();
        let position = inverse(&order);
        // Rows of each column: walk up the tree from each entry of a row until a column already seen in that row.
        let mut below = vec![0u32; count];
        let mut mark = vec![ROOT; count];
        let mut children = vec![0u32; count];
        for (k, &vertex) in order.iter().enumerate() {
            mark[k] = k as u32;
            for &neighbour in graph.neighbours(vertex) {
                let mut node = position[neighbour as usize];
                while node < k as u32 && mark[node as usize] != k as u32 {
                    below[node as usize] += 1;
                    mark[node as usize] = k as u32;
                    node = parent[node as usize];
                }
            }
            if parent[k] != ROOT {
                children[parent[k] as usize] += 1;
            }
        }
        let mut supernode_begin = vec![];
        let mut supernode = vec![0u32; count];
        for k in 0..count {
            let joins = k > 0 && parent[k - 1] == k as u32 && children[k] == 1 && below[k - 1] == below[k] + 1;
            if !joins {
                supernode_begin.push(k as u32);
            }
            supernode[k] = supernode_begin.len() as u32 - 1;
        }
        let supernodes = supernode_begin.len();
        supernode_begin.push(count as u32);
        let last = |s: usize| supernode_begin[s + 1] as usize - 1;
        Self {
            parent: (0..supernodes)
                .map(|s| match parent[last(s)] {
                    ROOT => ROOT,
                    above => supernode[above as usize],
                })
                .collect(),
            rows: (0..supernodes).map(|s| below[last(s)]).collect(),
            order,
            supernode_begin,
        }
    }
}

/// Children before parents, each branch in one piece.
fn postorder(parent: &[u32]) -> Vec<u32> {
    let mut head = vec![ROOT; parent.len()];
    let mut next = vec![ROOT; parent.len()];
    for node in (0..parent.len()).rev() {
        if parent[node] != ROOT {
            next[node] = head[parent[node] as usize];
            head[parent[node] as usize] = node as u32;
        }
    }
    let mut sequence = Vec::with_capacity(parent.len());
    let mut stack = Vec::new();
    for root in (0..parent.len()).filter(|&node| parent[node] == ROOT) {
        stack.push(root as u32);
        while let Some(&node) = stack.last() {
            match head[node as usize] {
                ROOT => {
                    sequence.push(node);
                    stack.pop();
                }
                child => {
                    head[node as usize] = next[child as usize];
                    stack.push(child);
                }
            }
        }
    }
    sequence
}

/// Supernodes merged into fronts.
struct Fronts {
    /// Supernodes of each front, children first; empty for those merged into another.
    members: Vec<Vec<u32>>,
    parent: Vec<u32>,
    /// The fronts, children before parents.
    sequence: Vec<u32>,
}

fn amalgamate(tree: &Tree, block: usize) -> Fronts {
    let count = tree.parent.len();
    let mut columns: Vec<usize> = (0..count)
        .map(|s| (tree.supernode_begin[s + 1] - tree.supernode_begin[s]) as usize)
        .collect();
    let rows: Vec<usize> = tree.rows.iter().map(|&rows| rows as usize).collect();
    let mut zeros = vec![0usize; count];
    let mut members: Vec<Vec<u32>> = (0..count as u32).map(|s| vec![s]).collect();
    let mut children: Vec<Vec<u32>> = vec![Vec::new(); count];
    let mut parent = tree.parent.clone();
    // Peak of working memory of the branch, for the order in which children are visited.
    let mut peak = vec![0usize; count];
    for front in 0..count {
        let mut candidates = std::mem::take(&mut children[front]);
        let added = |child: u32, columns: &[usize]| {
            columns[child as usize] * (columns[front] + rows[front] - rows[child as usize])
        };
        candidates.sort_by_key(|&child| (added(child, &columns), child));
        let mut kept = Vec::new();
        for child in candidates {
            let merged_columns = columns[front] + columns[child as usize];
            let merged_zeros = zeros[front] + zeros[child as usize] + added(child, &columns);
            let entries = merged_columns * (merged_columns + 1) / 2 + merged_columns * rows[front];
            let merge = merged_zeros == 0
                || RELAXATION.iter().any(|&(limit, share)| {
                    merged_columns * block <= limit && merged_zeros as f64 <= share * entries as f64
                });
            if merge {
                columns[front] = merged_columns;
                zeros[front] = merged_zeros;
                let moved = std::mem::take(&mut members[child as usize]);
                members[front].extend(moved);
                for grandchild in std::mem::take(&mut children[child as usize]) {
                    parent[grandchild as usize] = front as u32;
                    kept.push(grandchild);
                }
            } else {
                kept.push(child);
            }
        }
        // Supernodes are numbered in postorder: increasing numbers keep children before parents.
        members[front].sort_unstable();
        let square = |front: u32| rows[front as usize] * rows[front as usize];
        kept.sort_by_key(|&child| {
            (
                std::cmp::Reverse(peak[child as usize].saturating_sub(square(child))),
                child,
            )
        });
        let mut held = 0;
        for &child in &kept {
            peak[front] = peak[front].max(held + peak[child as usize]);
            held += square(child);
        }
        peak[front] = peak[front].max(held + square(front as u32));
        children[front] = kept;
        if parent[front] != ROOT {
            children[parent[front] as usize].push(front as u32);
        }
    }
    let mut sequence = Vec::new();
    let mut stack: Vec<(u32, usize)> = Vec::new();
    for root in (0..count).filter(|&front| parent[front] == ROOT) {
        stack.push((root as u32, 0));
        while let Some((front, visited)) = stack.last_mut() {
            match children[*front as usize].get(*visited) {
                Some(&child) => {
                    *visited += 1;
                    stack.push((child, 0));
                }
                None => {
                    sequence.push(*front);
                    stack.pop();
                }
            }
        }
    }
    Fronts {
        members,
        parent,
        sequence,
    }
}
