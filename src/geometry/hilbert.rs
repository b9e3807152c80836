//! The order of points along a Hilbert curve: neighbours in the order are neighbours in space.
//!
//! Positions on the curve follow Skilling, "Programming the Hilbert curve" (2004), on a grid as fine as leaves room for a
//! point's index beside its position in one 64-bit key: 2^16 cells an axis for ten thousand points, 2^14 for a million.
//! Crowded cells have curves of their own.

use crate::mesh::bounding_box;
use rayon::prelude::*;
use std::ops::Range;

/// From this number of points on, threads share the work.
const MANY: usize = 4096;
/// Positions computed together.
const WIDTH: usize = 8;
/// Most bits of a coordinate on the curve: three of them fit into a key.
const BITS: u32 = 21;
/// Points of a cell that are not worth a curve.
const FEW: usize = 32;

/// The positions on the curve of cells of the grid with `2^bits` cells an axis.
#[inline(always)]
fn positions(mut x: [[u32; WIDTH]; 3], bits: u32) -> [u64; WIDTH] {
    for bit in (1..bits).rev() {
        let low = (1 << bit) - 1;
        for axis in 0..3 {
            for lane in 0..WIDTH {
                // Reflect the low bits where this bit is set, exchange them with those of the first axis elsewhere.
                let set = 0u32.wrapping_sub((x[axis][lane] >> bit) & 1);
                let exchange = (x[0][lane] ^ x[axis][lane]) & low & !set;
                x[0][lane] ^= (low & set) | exchange;
                x[axis][lane] ^= exchange;
            }
        }
    }
    let mut result = [0; WIDTH];
    for lane in 0..WIDTH {
        let [a, b, c] = [
            x[0][lane],
            x[1][lane] ^ x[0][lane],
            x[2][lane] ^ x[1][lane] ^ x[0][lane],
        ];
        // Every bit becomes the sum of those above it: the Gray code undone.
        let mut gray = c >> 1;
        for shift in [1, 2, 4, 8, 16] {
            gray ^= gray >> shift;
        }
        result[lane] = spread(a ^ gray) << 2 | spread(b ^ gray) << 1 | spread(c ^ gray);
    }
    result
}

/// Two zeros between neighbouring bits.
#[inline(always)]
fn spread(value: u32) -> u64 {
    let mut value = u64::from(value);
    value = (value | value << 32) & 0x001f_0000_0000_ffff;
    value = (value | value << 16) & 0x001f_0000_ff00_00ff;
    value = (value | value << 8) & 0x100f_00f0_0f00_f00f;
    value = (value | value << 4) & 0x10c3_0c30_c30c_30c3;
    (value | value << 2) & 0x1249_2492_4924_9249
}

/// A key that points in one place share and others do not.
pub fn place(point: [f64; 3]) -> [u64; 3] {
    point.map(|x| if x == 0.0 { 0 } else { x.to_bits() })
}

/// Writes the indices of `points` in their order along the curve over the points' bounding cube. Points in one place are
/// neighbours, by rising index; false when there are certainly none. `keys` is memory to reuse. Points that are not
/// finite may come anywhere.
pub fn order(points: &[[f64; 3]], keys: &mut Vec<u64>, order: &mut Vec<u32>) -> bool {
    let shared_work = points.len() >= MANY && rayon::current_num_threads() > 1;
    let corners = if shared_work {
        // The box of the boxes of the parts.
        let boxes: Vec<[[f64; 3]; 2]> = points.par_chunks(MANY).filter_map(bounding_box).collect();
        bounding_box(boxes.as_flattened())
    } else {
        bounding_box(points)
    };
    let [low, high] = corners.unwrap_or([[0.0; 3]; 2]);
    let index_bits = u32::BITS - (points.len().saturating_sub(1) as u32).leading_zeros();
    let bits = BITS.min((u64::BITS - index_bits) / 3);
    let mask = (1u32 << bits) - 1;
    let side = (0..3).fold(0.0f64, |side, axis| side.max(high[axis] - low[axis]));
    let scale = if side > 0.0 && side.is_finite() {
        f64::from(mask) / side
    } else {
        0.0
    };
    let fill = |(chunk, (keys, points)): (usize, (&mut [u64], &[[f64; 3]]))| {
        let mut cells = [[0; WIDTH]; 3];
        for (lane, point) in points.iter().enumerate() {
            for axis in 0..3 {
                // The conversion saturates, and the mask keeps what is not finite within the grid.
                cells[axis][lane] = ((point[axis] - low[axis]) * scale) as u32 & mask;
            }
        }
        let places = positions(cells, bits);
        for (lane, key) in keys.iter_mut().enumerate() {
            *key = places[lane] << index_bits | (chunk * WIDTH + lane) as u64;
        }
    };
    // Keys differ by their indices, so that every way of sorting gives the same order.
    keys.clear();
    keys.resize(points.len(), 0);
    if shared_work {
        keys.par_chunks_mut(WIDTH)
            .zip(points.par_chunks(WIDTH))
            .enumerate()
            .with_min_len(MANY / WIDTH / 4)
            .for_each(fill);
        keys.par_sort_unstable();
    } else {
        keys.chunks_mut(WIDTH)
            .zip(points.chunks(WIDTH))
            .enumerate()
            .for_each(fill);
        keys.sort_unstable();
    }
    let index = |key: &u64| (key & ((1 << index_bits) - 1)) as u32;
    if shared_work {
        keys.par_iter().with_min_len(MANY).map(index).collect_into_vec(order);
        let in_one_cell = |pair: &[u64]| pair[0] >> index_bits == pair[1] >> index_bits;
        if !keys.par_windows(2).with_min_len(MANY).any(in_one_cell) {
            return false;
        }
    } else {
        order.clear();
        order.extend(keys.iter().map(index));
    }
    let mut shared = false;
    let mut start = 0;
    for end in 1..=keys.len() {
        if end < keys.len() && keys[end] >> index_bits == keys[start] >> index_bits {
            continue;
        }
        if end - start > 1 {
            shared = true;
            sort_cell(points, order, start..end);
        }
        start = end;
    }
    shared
}

/// Puts the points of one cell of the grid in order.
fn sort_cell(points: &[[f64; 3]], order: &mut [u32], range: Range<usize>) {
    let count = range.len();
    let run = &mut order[range];
    // Where the grid told nothing apart, all points are in one place, or not finite.
    if count <= FEW || count == points.len() {
        run.sort_unstable_by_key(|&index| (place(points[index as usize]), index));
        return;
    }
    // By rising index, and so are then points in one place.
    run.sort_unstable();
    let crowd: Vec<[f64; 3]> = run.iter().map(|&index| points[index as usize]).collect();
    let mut finer = Vec::new();
    self::order(&crowd, &mut Vec::new(), &mut finer);
    let before = run.to_vec();
    for (place, index) in run.iter_mut().zip(finer) {
        *place = before[index as usize];
    }
}
