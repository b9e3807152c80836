//! Order of elimination by nested dissection with planes: faster than by the graph alone, for meshes that fill their
//! space evenly.
//!
//! The vertices are halved by their coordinate along the longest axis of their box; those of one half that have
//! neighbours in the other separate them, of the two choices the smaller. For graphs whose edges are as short as those
//! of a mesh, or of a mesh whose neighbours' neighbours are joined too, separators are about as small as straight cuts
//! can be.

use super::graph::Graph;
use super::nested_dissection::{LEAF, leaf};

/// An order of the graph's vertices for elimination: entry `k` is the vertex that is eliminated `k`-th.
///
/// `points` are the vertices' places in space. The order depends on the graph and the points alone.
pub fn geometric_dissection(graph: &Graph, points: &[[f64; 3]]) -> Vec<u32> {
    assert_eq!(graph.len(), points.len(), "one place a vertex");
    let mut order = vec![0; graph.len()];
    let mut labels = vec![0u32; graph.len()];
    let mut next_label = 1;
    // Parts still to be ordered, with the place of their first vertex in the order.
    let mut parts: Vec<(Vec<u32>, usize)> = vec![((0..graph.len() as u32).collect(), 0)];
    while let Some((mut names, start)) = parts.pop() {
        let place = start..start + names.len();
        if names.len() <= LEAF {
            names.sort_unstable();
            leaf(graph, &names, &mut order[place]);
            continue;
        }
        let axis = longest_axis(&names, points);
        let half = names.len() / 2;
        names.select_nth_unstable_by(half, |&a, &b| {
            let (x, y) = (points[a as usize][axis], points[b as usize][axis]);
            x.total_cmp(&y).then(a.cmp(&b))
        });
        let label = [next_label, next_label + 1];
        next_label += 2;
        for (index, &name) in names.iter().enumerate() {
            labels[name as usize] = label[usize::from(index >= half)];
        }
        let near = |name: u32, other: u32| {
            let mut neighbours = graph.neighbours(name).iter();
            neighbours.any(|&neighbour| labels[neighbour as usize] == other)
        };
        let (low, high) = names.split_at(half);
        let of_low: Vec<bool> = low.iter().map(|&name| near(name, label[1])).collect();
        let of_high: Vec<bool> = high.iter().map(|&name| near(name, label[0])).collect();
        let count = |marks: &[bool]| marks.iter().filter(|&&mark| mark).count();
        let take_low = count(&of_low) <= count(&of_high);
        let rest = |names: &[u32], marks: &[bool], taken: bool, wanted: bool| -> Vec<u32> {
            let marked = names.iter().zip(marks);
            marked
                .filter(|(_, mark)| (taken && **mark) == wanted)
                .map(|(&name, _)| name)
                .collect()
        };
        let mut separator = rest(low, &of_low, take_low, true);
        separator.extend(rest(high, &of_high, !take_low, true));
        let (low, high) = (
            rest(low, &of_low, take_low, false),
            rest(high, &of_high, !take_low, false),
        );
        if low.is_empty() || high.is_empty() {
            // Nothing to gain by a cut.
            names.sort_unstable();
            leaf(graph, &names, &mut order[place]);
            continue;
        }
        separator.sort_unstable();
        // Separators belong to no part, so that later cuts do not see them.
        separator.iter().for_each(|&name| labels[name as usize] = 0);
        order[place.end - separator.len()..place.end].copy_from_slice(&separator);
        let middle = start + low.len();
        parts.push((low, start));
        parts.push((high, middle));
    }
    order
}

fn longest_axis(names: &[u32], points: &[[f64; 3]]) -> usize {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for &name in names {
        for axis in 0..3 {
            low[axis] = low[axis].min(points[name as usize][axis]);
            high[axis] = high[axis].max(points[name as usize][axis]);
        }
    }
    (0..3)
        .rev()
        .max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b])))
        .unwrap_or(0)
}
