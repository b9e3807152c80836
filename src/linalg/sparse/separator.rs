//! Small vertex separators by a multilevel scheme (Hendrickson and Rothberg 1998; Karypis and Kumar 1998).
//!
//! The graph is coarsened by matching along heavy edges. The coarsest graph is cut in several ways, across its principal
//! axes and by growing regions. The best cut is carried back level by level and improved on each by moves of single
//! vertices (Fiduccia and Mattheyses 1982; Ashcraft and Liu 1997).

use std::collections::BinaryHeap;

/// Coarsening ends at this many vertices.
const COARSEST: usize = 120;
/// Most weight of one side, as a share of both sides together.
const BALANCE: f64 = 0.6;
/// A pass ends after so many moves without a better separator.
const PATIENCE: usize = 60;
/// Most passes on one level.
const PASSES: usize = 10;
/// Regions grown on the coarsest graph.
const GROWN: usize = 3;

/// Where a vertex lies.
pub(super) const SEPARATOR: u8 = 2;

/// A graph with weights and places in space.
#[derive(Clone, Debug, Default)]
pub(super) struct Weighted {
    pub offsets: Vec<u32>,
    pub neighbours: Vec<u32>,
    pub edge_weights: Vec<u32>,
    pub weights: Vec<u32>,
    pub points: Vec<[f64; 3]>,
}

impl Weighted {
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    fn range(&self, vertex: usize) -> std::ops::Range<usize> {
        self.offsets[vertex] as usize..self.offsets[vertex + 1] as usize
    }

    fn neighbours(&self, vertex: usize) -> &[u32] {
        &self.neighbours[self.range(vertex)]
    }

    fn total(&self) -> i64 {
        self.weights.iter().map(|&weight| i64::from(weight)).sum()
    }
}

/// Marks every vertex with its side, 0 or 1, or as part of the separator: no edge joins the two sides.
pub(super) fn separate(graph: &Weighted, seed: u64) -> Vec<u8> {
    let mut random = Random(seed ^ (graph.len() as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let mut levels: Vec<(Weighted, Vec<u32>)> = Vec::new();
    loop {
        let finest = levels.last().map_or(graph, |(graph, _)| graph);
        if finest.len() <= COARSEST {
            break;
        }
        let coarser = coarsen(finest, &mut random);
        // A graph that hardly shrinks, such as a star, is cut as it is.
        if coarser.0.len() as f64 > 0.95 * finest.len() as f64 {
            break;
        }
        levels.push(coarser);
    }
    let coarsest = levels.last().map_or(graph, |(graph, _)| graph);
    let mut side = cut(coarsest, &mut random);
    for level in (0..levels.len()).rev() {
        let finer = if level == 0 { graph } else { &levels[level - 1].0 };
        let fine_side: Vec<u8> = levels[level].1.iter().map(|&coarse| side[coarse as usize]).collect();
        side = fine_side;
        Refinement::new(finer, &mut side).run();
    }
    side
}

/// Merges pairs of neighbours that share the heaviest edges. Returns the coarse graph and each vertex's place in it.
fn coarsen(graph: &Weighted, random: &mut Random) -> (Weighted, Vec<u32>) {
    let count = graph.len();
    let none = u32::MAX;
    let heaviest = (1.5 * graph.total() as f64 / COARSEST as f64).max(2.0);
    // Vertices of low degree have the fewest choices and come first; chance breaks ties.
    let mut sequence: Vec<(u32, u32, u32)> = (0..count as u32)
        .map(|v| (graph.range(v as usize).len() as u32, random.next() as u32, v))
        .collect();
    sequence.sort_unstable();
    let mut mate = vec![none; count];
    for &(_, _, vertex) in &sequence {
        let vertex = vertex as usize;
        if mate[vertex] != none {
            continue;
        }
        let mut best: Option<(u32, std::cmp::Reverse<u32>, u32)> = None;
        for index in graph.range(vertex) {
            let other = graph.neighbours[index];
            let joint = graph.weights[vertex] + graph.weights[other as usize];
            if mate[other as usize] == none && f64::from(joint) <= heaviest {
                let candidate = (
                    graph.edge_weights[index],
                    std::cmp::Reverse(graph.weights[other as usize]),
                    other,
                );
                if best.is_none_or(|best| candidate > best) {
                    best = Some(candidate);
                }
            }
        }
        let other = best.map_or(vertex as u32, |(_, _, other)| other);
        mate[vertex] = other;
        mate[other as usize] = vertex as u32;
    }
    let mut name = vec![none; count];
    let mut pairs: Vec<[u32; 2]> = Vec::with_capacity(count / 2 + 1);
    for vertex in 0..count as u32 {
        if name[vertex as usize] == none {
            let other = mate[vertex as usize];
            name[vertex as usize] = pairs.len() as u32;
            name[other as usize] = pairs.len() as u32;
            pairs.push([vertex, other]);
        }
    }
    let mut coarse = Weighted {
        offsets: Vec::with_capacity(pairs.len() + 1),
        neighbours: Vec::with_capacity(graph.neighbours.len() / 2),
        edge_weights: Vec::with_capacity(graph.neighbours.len() / 2),
        weights: Vec::with_capacity(pairs.len()),
        points: Vec::with_capacity(pairs.len()),
    };
    coarse.offsets.push(0);
    // Where the edge to a coarse vertex stands in the current list, if it lies past the list's start.
    let mut slot = vec![0u32; pairs.len()];
    for (index, &[a, b]) in pairs.iter().enumerate() {
        let start = coarse.neighbours.len();
        let members: &[u32] = if a == b { &[a] } else { &[a, b] };
        let (mut weight, mut place) = (0, [0.0; 3]);
        for &member in members {
            let member = member as usize;
            weight += graph.weights[member];
            for (place, point) in place.iter_mut().zip(graph.points[member]) {
                *place += f64::from(graph.weights[member]) * point;
            }
            for edge in graph.range(member) {
                let target = name[graph.neighbours[edge] as usize];
                if target as usize == index {
                    continue;
                }
                let at = slot[target as usize] as usize;
                if at >= start && at < coarse.neighbours.len() && coarse.neighbours[at] == target {
                    coarse.edge_weights[at] += graph.edge_weights[edge];
                } else {
                    slot[target as usize] = coarse.neighbours.len() as u32;
                    coarse.neighbours.push(target);
                    coarse.edge_weights.push(graph.edge_weights[edge]);
                }
            }
        }
        coarse.offsets.push(coarse.neighbours.len() as u32);
        coarse.weights.push(weight);
        coarse.points.push(place.map(|sum| sum / f64::from(weight)));
    }
    (coarse, name)
}

/// The best of several separators of a small graph.
fn cut(graph: &Weighted, random: &mut Random) -> Vec<u8> {
    let mut best: Option<((i64, i64), Vec<u8>)> = None;
    let mut consider = |mut side: Vec<u8>| {
        let cost = Refinement::new(graph, &mut side).run();
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, side));
        }
    };
    for axis in principal_axes(graph) {
        let along = |v: u32| -> f64 { graph.points[v as usize].iter().zip(axis).map(|(p, a)| p * a).sum() };
        let mut sequence: Vec<u32> = (0..graph.len() as u32).collect();
        sequence.sort_by(|&a, &b| along(a).total_cmp(&along(b)));
        consider(split(graph, &sequence));
    }
    // Only a graph that resists coarsening is large here.
    for _ in 0..if graph.len() <= 8 * COARSEST { GROWN } else { 0 } {
        consider(split(graph, &grow(graph, (random.next() % graph.len() as u64) as u32)));
    }
    best.map_or_else(Vec::new, |(_, side)| side)
}

/// The first half of a sequence of all vertices, by weight, against the rest, parted by those of the first half that
/// touch the rest.
fn split(graph: &Weighted, sequence: &[u32]) -> Vec<u8> {
    let mut side = vec![1u8; graph.len()];
    let half = graph.total() / 2;
    let mut weight = 0;
    for &vertex in sequence {
        if weight >= half {
            break;
        }
        weight += i64::from(graph.weights[vertex as usize]);
        side[vertex as usize] = 0;
    }
    let touching: Vec<usize> = (0..graph.len())
        .filter(|&v| side[v] == 0 && graph.neighbours(v).iter().any(|&other| side[other as usize] == 1))
        .collect();
    for vertex in touching {
        side[vertex] = SEPARATOR;
    }
    side
}

/// All vertices in the order in which a region grows from `start`, always by the vertex that adds the least boundary.
fn grow(graph: &Weighted, start: u32) -> Vec<u32> {
    let count = graph.len();
    let mut inside = vec![false; count];
    // Neighbours of each vertex that are neither inside nor on the region's boundary.
    let mut reached = vec![false; count];
    let mut sequence = Vec::with_capacity(count);
    let mut next = Some(start);
    while let Some(vertex) = next {
        inside[vertex as usize] = true;
        reached[vertex as usize] = true;
        sequence.push(vertex);
        for &other in graph.neighbours(vertex as usize) {
            reached[other as usize] = true;
        }
        let price = |v: u32| -> i64 {
            let fresh = graph
                .neighbours(v as usize)
                .iter()
                .filter(|&&other| !reached[other as usize]);
            fresh
                .map(|&other| i64::from(graph.weights[other as usize]))
                .sum::<i64>()
                - i64::from(graph.weights[v as usize])
        };
        next = (0..count as u32)
            .filter(|&v| reached[v as usize] && !inside[v as usize])
            .min_by_key(|&v| (price(v), v))
            .or_else(|| (0..count as u32).find(|&v| !inside[v as usize]));
    }
    sequence
}

/// The directions of greatest, middle and least extent.
fn principal_axes(graph: &Weighted) -> [[f64; 3]; 3] {
    let total = graph.total() as f64;
    let weighted = |v: usize| f64::from(graph.weights[v]) / total;
    let mut centre = nalgebra::Vector3::zeros();
    for (v, &point) in graph.points.iter().enumerate() {
        centre += weighted(v) * nalgebra::Vector3::from(point);
    }
    let mut spread = nalgebra::Matrix3::zeros();
    for (v, &point) in graph.points.iter().enumerate() {
        let offset = nalgebra::Vector3::from(point) - centre;
        spread += weighted(v) * offset * offset.transpose();
    }
    if !spread.iter().all(|entry| entry.is_finite()) {
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    }
    let vectors = spread.symmetric_eigen().eigenvectors;
    [0, 1, 2].map(|axis| [vectors[(0, axis)], vectors[(1, axis)], vectors[(2, axis)]])
}

/// Improvement of a separator by moving its vertices to one of the sides; whatever they touch on the other side joins
/// the separator.
struct Refinement<'a> {
    graph: &'a Weighted,
    side: &'a mut [u8],
    /// Weight of the two sides and of the separator.
    weight: [i64; 3],
    /// Weight of each separator vertex's neighbours on each side.
    touched: Vec<[i64; 2]>,
    /// Pass in which a vertex was moved last.
    moved: Vec<u32>,
    limit: i64,
}

impl<'a> Refinement<'a> {
    fn new(graph: &'a Weighted, side: &'a mut [u8]) -> Self {
        let mut weight = [0; 3];
        for (vertex, &side) in side.iter().enumerate() {
            weight[side as usize] += i64::from(graph.weights[vertex]);
        }
        let limit = (BALANCE * graph.total() as f64) as i64;
        let mut refinement = Self {
            graph,
            touched: vec![[0; 2]; side.len()],
            moved: vec![0; side.len()],
            side,
            weight,
            limit,
        };
        for vertex in 0..refinement.side.len() {
            if refinement.side[vertex] == SEPARATOR {
                refinement.touched[vertex] = refinement.count(vertex);
            }
        }
        refinement
    }

    fn count(&self, vertex: usize) -> [i64; 2] {
        let mut touched = [0; 2];
        for &other in self.graph.neighbours(vertex) {
            if let Some(sum) = touched.get_mut(self.side[other as usize] as usize) {
                *sum += i64::from(self.graph.weights[other as usize]);
            }
        }
        touched
    }

    /// Lower is better: the separator's weight once both sides are light enough, then the difference of the sides.
    fn cost(&self) -> (i64, i64) {
        let heavier = self.weight[0].max(self.weight[1]);
        let excess = (heavier - self.limit).max(0);
        (self.weight[2] + 8 * excess, (self.weight[0] - self.weight[1]).abs())
    }

    fn gain(&self, vertex: usize, to: usize) -> i64 {
        i64::from(self.graph.weights[vertex]) - self.touched[vertex][1 - to]
    }

    fn run(mut self) -> (i64, i64) {
        for pass in 1..=PASSES as u32 {
            let before = self.cost();
            self.pass(pass);
            if self.cost() >= before {
                break;
            }
        }
        self.cost()
    }

    /// Moves each vertex at most once and keeps the best state on the way.
    fn pass(&mut self, pass: u32) {
        // Entries grow stale when gains change; they are checked when taken.
        let mut queues: [BinaryHeap<(i64, std::cmp::Reverse<u32>)>; 2] = Default::default();
        for vertex in 0..self.side.len() {
            if self.side[vertex] == SEPARATOR {
                for (to, queue) in queues.iter_mut().enumerate() {
                    queue.push((self.gain(vertex, to), std::cmp::Reverse(vertex as u32)));
                }
            }
        }
        let mut best = self.cost();
        // Each move with the vertices that it drew into the separator.
        let mut log: Vec<(u32, u8)> = Vec::new();
        let mut drawn: Vec<u32> = Vec::new();
        let mut drawn_ends: Vec<usize> = Vec::new();
        let mut kept = 0;
        let mut idle = 0;
        while idle <= PATIENCE {
            let tops = [0, 1].map(|to| {
                loop {
                    let &(gain, std::cmp::Reverse(vertex)) = queues[to].peek()?;
                    let vertex = vertex as usize;
                    let stale = self.side[vertex] != SEPARATOR
                        || self.moved[vertex] == pass
                        || gain != self.gain(vertex, to)
                        || self.weight[to] + i64::from(self.graph.weights[vertex]) > self.limit;
                    if !stale {
                        return Some((gain, vertex));
                    }
                    queues[to].pop();
                }
            });
            let lighter = usize::from(self.weight[1] < self.weight[0]);
            let to = match tops {
                [None, None] => break,
                [Some(_), None] => 0,
                [None, Some(_)] => 1,
                [Some((a, _)), Some((b, _))] if a == b => lighter,
                [Some((a, _)), Some((b, _))] => usize::from(b > a),
            };
            let Some((_, vertex)) = tops[to] else { break };
            queues[to].pop();
            self.moved[vertex] = pass;
            self.shift(vertex, to, &mut drawn, |refinement, changed| {
                if refinement.moved[changed] != pass {
                    for (to, queue) in queues.iter_mut().enumerate() {
                        queue.push((refinement.gain(changed, to), std::cmp::Reverse(changed as u32)));
                    }
                }
            });
            log.push((vertex as u32, to as u8));
            drawn_ends.push(drawn.len());
            let cost = self.cost();
            if cost < best {
                best = cost;
                kept = log.len();
                idle = 0;
            } else {
                idle += 1;
            }
        }
        while log.len() > kept {
            if let Some((vertex, to)) = log.pop() {
                drawn_ends.pop();
                let start = drawn_ends.last().copied().unwrap_or(0);
                self.undo(vertex as usize, to as usize, &drawn[start..]);
                drawn.truncate(start);
            }
        }
    }

    /// Moves a separator vertex to side `to`; its neighbours on the other side join the separator and are listed in
    /// `drawn`. `changed` hears of every separator vertex whose gains have changed.
    fn shift(&mut self, vertex: usize, to: usize, drawn: &mut Vec<u32>, mut changed: impl FnMut(&Self, usize)) {
        let graph = self.graph;
        let weight = i64::from(graph.weights[vertex]);
        self.side[vertex] = to as u8;
        self.weight[2] -= weight;
        self.weight[to] += weight;
        for &other in graph.neighbours(vertex) {
            let other = other as usize;
            if self.side[other] == SEPARATOR {
                self.touched[other][to] += weight;
                changed(self, other);
            } else if self.side[other] as usize == 1 - to {
                let drawn_weight = i64::from(graph.weights[other]);
                self.side[other] = SEPARATOR;
                self.weight[1 - to] -= drawn_weight;
                self.weight[2] += drawn_weight;
                drawn.push(other as u32);
                for &third in graph.neighbours(other) {
                    let third = third as usize;
                    if self.side[third] == SEPARATOR && third != other {
                        self.touched[third][1 - to] -= drawn_weight;
                        changed(self, third);
                    }
                }
                self.touched[other] = self.count(other);
                changed(self, other);
            }
        }
    }

    fn undo(&mut self, vertex: usize, to: usize, drawn: &[u32]) {
        let graph = self.graph;
        for &other in drawn.iter().rev() {
            let other = other as usize;
            let weight = i64::from(graph.weights[other]);
            self.side[other] = (1 - to) as u8;
            self.weight[2] -= weight;
            self.weight[1 - to] += weight;
            for &third in graph.neighbours(other) {
                if self.side[third as usize] == SEPARATOR {
                    self.touched[third as usize][1 - to] += weight;
                }
            }
        }
        let weight = i64::from(graph.weights[vertex]);
        self.side[vertex] = SEPARATOR;
        self.weight[to] -= weight;
        self.weight[2] += weight;
        for &other in graph.neighbours(vertex) {
            if self.side[other as usize] == SEPARATOR {
                self.touched[other as usize][to] -= weight;
            }
        }
        self.touched[vertex] = self.count(vertex);
    }
}

/// A small generator of pseudo-random numbers (Steele, Lea and Flood 2014), so that an order is always the same.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
}
