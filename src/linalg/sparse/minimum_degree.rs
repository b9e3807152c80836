//! Order of elimination of a few vertices by exact minimum degree on bit rows.

/// Orders the vertices `0..inner` of a small graph: always one of least degree comes next.
///
/// `rows` are the vertices' neighbours, inner ones below `inner`, others above: the others count for the degrees but are
/// not eliminated (Pellegrini, Roman and Amestoy 2000).
pub(super) fn minimum_degree(inner: usize, total: usize, edges: impl Iterator<Item = (u32, u32)>) -> Vec<u32> {
    let words = total.div_ceil(64);
    let mut rows = vec![0u64; inner * words];
    for (from, to) in edges {
        rows[from as usize * words + to as usize / 64] |= 1 << (to % 64);
        if (to as usize) < inner {
            rows[to as usize * words + from as usize / 64] |= 1 << (from % 64);
        }
    }
    let count = |row: &[u64]| row.iter().map(|word| word.count_ones()).sum::<u32>();
    let mut degree: Vec<u32> = rows.chunks(words.max(1)).map(count).collect();
    degree.resize(inner, 0);
    let mut left: Vec<u32> = (0..inner as u32).collect();
    let mut order = Vec::with_capacity(inner);
    let mut pivot_row = vec![0u64; words];
    while let Some(place) = (0..left.len()).min_by_key(|&place| (degree[left[place] as usize], left[place])) {
        let pivot = left.swap_remove(place) as usize;
        order.push(pivot as u32);
        pivot_row.copy_from_slice(&rows[pivot * words..(pivot + 1) * words]);
        for (word, &bits) in pivot_row.iter().enumerate().take(inner.div_ceil(64)) {
            let mut bits = bits;
            while bits != 0 {
                let vertex = 64 * word + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                if vertex >= inner {
                    break;
                }
                let row = &mut rows[vertex * words..(vertex + 1) * words];
                for (row, &pivot) in row.iter_mut().zip(&pivot_row) {
                    *row |= pivot;
                }
                row[vertex / 64] &= !(1 << (vertex % 64));
                row[pivot / 64] &= !(1 << (pivot % 64));
                degree[vertex] = count(row);
            }
        }
    }
    order
}
