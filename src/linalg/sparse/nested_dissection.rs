//! Order of elimination by nested dissection (George 1973).
//!
//! A small separator parts the graph into two halves; both are ordered in the same way, then comes the separator. Small
//! remainders are ordered by minimum degree. The order depends on the graph and the points alone.

use super::graph::Graph;
use super::minimum_degree::minimum_degree;
use super::separator::{SEPARATOR, Weighted, separate};

/// Subgraphs of at most this many vertices are ordered by minimum degree.
pub(super) const LEAF: usize = 120;
/// A subgraph without separator and with more vertices than this is all but complete: any order serves.
const DENSE: usize = 4096;
/// Halves of at least this many vertices are ordered side by side.
const SHARED: usize = 2000;

/// An order of the graph's vertices for elimination: entry `k` is the vertex that is eliminated `k`-th.
///
/// `points` are the vertices' places in space; they help to find separators.
pub fn nested_dissection(graph: &Graph, points: &[[f64; 3]]) -> Vec<u32> {
    assert_eq!(graph.len(), points.len(), "one place a vertex");
    let mut order = vec![0; graph.len()];
    let whole = Weighted {
        offsets: graph.offsets.iter().map(|&offset| offset as u32).collect(),
        neighbours: graph.neighbours.clone(),
        edge_weights: vec![1; graph.neighbours.len()],
        weights: vec![1; graph.len()],
        points: points.to_vec(),
    };
    dissect(graph, whole, (0..graph.len() as u32).collect(), &mut order, 1);
    order
}

/// Orders the subgraph `part`, whose vertices are called `names` in the whole graph.
fn dissect(whole: &Graph, part: Weighted, names: Vec<u32>, order: &mut [u32], seed: u64) {
    if names.len() <= LEAF {
        return leaf(whole, &names, order);
    }
    let side = separate(&part, seed);
    let counts = [0u8, 1, SEPARATOR].map(|kind| side.iter().filter(|&&side| side == kind).count());
    if counts[0] == 0 || counts[1] == 0 {
        // Nothing separates a clique, and hardly anything what resembles one.
        return leaf(whole, &names, order);
    }
    let (halves, last) = order.split_at_mut(counts[0] + counts[1]);
    let (first, second) = halves.split_at_mut(counts[0]);
    let separator = (0..names.len()).filter(|&vertex| side[vertex] == SEPARATOR);
    for (place, vertex) in last.iter_mut().zip(separator) {
        *place = names[vertex];
    }
    let [(one, one_names), (two, two_names)] = [0, 1].map(|kind| extract(&part, &names, &side, kind));
    let shared = names.len() >= SHARED;
    drop((part, names, side));
    if shared {
        rayon::join(
            || dissect(whole, one, one_names, first, 2 * seed),
            || dissect(whole, two, two_names, second, 2 * seed + 1),
        );
    } else {
        dissect(whole, one, one_names, first, 2 * seed);
        dissect(whole, two, two_names, second, 2 * seed + 1);
    }
}

/// The subgraph of one side.
fn extract(part: &Weighted, names: &[u32], side: &[u8], kind: u8) -> (Weighted, Vec<u32>) {
    let mut inner = vec![0u32; side.len()];
    let mut count = 0;
    for (vertex, _) in side.iter().enumerate().filter(|&(_, &side)| side == kind) {
        inner[vertex] = count;
        count += 1;
    }
    let mut result = Weighted {
        offsets: vec![0],
        ..Weighted::default()
    };
    let mut inner_names = Vec::with_capacity(count as usize);
    for vertex in (0..side.len()).filter(|&vertex| side[vertex] == kind) {
        let range = part.offsets[vertex] as usize..part.offsets[vertex + 1] as usize;
        result.neighbours.extend(
            part.neighbours[range]
                .iter()
                .filter(|&&other| side[other as usize] == kind)
                .map(|&other| inner[other as usize]),
        );
        result.offsets.push(result.neighbours.len() as u32);
        result.points.push(part.points[vertex]);
        inner_names.push(names[vertex]);
    }
    result.edge_weights = vec![1; result.neighbours.len()];
    result.weights = vec![1; inner_names.len()];
    (result, inner_names)
}

/// Orders a small subgraph with its neighbours in the whole graph, all of which are eliminated later.
pub(super) fn leaf(whole: &Graph, names: &[u32], order: &mut [u32]) {
    if names.len() > DENSE {
        return order.copy_from_slice(names);
    }
    let inner = names.len();
    // Names are increasing, so a search finds a vertex's place.
    let mut outside: Vec<u32> = Vec::new();
    for &name in names {
        outside.extend(
            whole
                .neighbours(name)
                .iter()
                .filter(|other| names.binary_search(other).is_err()),
        );
    }
    outside.sort_unstable();
    outside.dedup();
    let edges = names.iter().enumerate().flat_map(|(from, &name)| {
        let outside = &outside;
        whole.neighbours(name).iter().filter_map(move |other| {
            let to = match names.binary_search(other) {
                Ok(place) => Some(place),
                Err(_) => outside.binary_search(other).ok().map(|place| inner + place),
            };
            to.map(|to| (from as u32, to as u32))
        })
    });
    for (place, vertex) in order
        .iter_mut()
        .zip(minimum_degree(inner, inner + outside.len(), edges))
    {
        *place = names[vertex as usize];
    }
}
