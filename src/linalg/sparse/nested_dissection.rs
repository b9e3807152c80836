//! Order of elimination by nested dissection (George 1973).

use super::graph::Graph;

/// Subgraphs of at most this many vertices are not dissected further.
const LEAF: usize = 64;

/// An order of the graph's vertices for elimination: entry `k` is the vertex that is eliminated `k`-th.
///
/// `points` are the vertices' places in space, used to find separators.
pub fn nested_dissection(graph: &Graph, points: &[[f64; 3]]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..graph.len() as u32).collect();
    let mut side = vec![0u32; graph.len()];
    let mut stamp = 0;
    dissect(graph, points, &mut order, &mut side, &mut stamp);
    order
}

fn dissect(graph: &Graph, points: &[[f64; 3]], vertices: &mut [u32], side: &mut [u32], stamp: &mut u32) {
    if vertices.len() <= LEAF {
        return;
    }
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for &vertex in vertices.iter() {
        for axis in 0..3 {
            low[axis] = low[axis].min(points[vertex as usize][axis]);
            high[axis] = high[axis].max(points[vertex as usize][axis]);
        }
    }
    let axis = (0..3)
        .max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b])))
        .unwrap_or(0);
    vertices.sort_unstable_by(|&a, &b| {
        points[a as usize][axis]
            .total_cmp(&points[b as usize][axis])
            .then(a.cmp(&b))
    });
    let half = vertices.len() / 2;
    let (left, right) = (*stamp + 1, *stamp + 2);
    *stamp += 2;
    for (index, &vertex) in vertices.iter().enumerate() {
        side[vertex as usize] = if index < half { left } else { right };
    }
    let mut parts: [Vec<u32>; 3] = Default::default();
    for &vertex in vertices.iter() {
        let part = if side[vertex as usize] == right {
            1
        } else if graph
            .neighbours(vertex)
            .iter()
            .any(|&neighbour| side[neighbour as usize] == right)
        {
            2
        } else {
            0
        };
        parts[part].push(vertex);
    }
    let (first, second) = (parts[0].len(), parts[1].len());
    for (place, &vertex) in vertices.iter_mut().zip(parts.iter().flatten()) {
        *place = vertex;
    }
    let (head, tail) = vertices.split_at_mut(first);
    dissect(graph, points, head, side, stamp);
    dissect(graph, points, &mut tail[..second], side, stamp);
}
