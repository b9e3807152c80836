//! The order of points along a Hilbert curve: neighbours in the order are neighbours in space.
//!
//! Positions on the curve follow Skilling, "Programming the Hilbert curve" (2004), with 21 bits an axis.

use rayon::prelude::*;

/// From this number of points on, threads share the work.
const MANY: usize = 4096;
/// Bits of a coordinate on the curve.
const BITS: u32 = 21;

/// The position on the curve of a cell of the grid with `2^21` cells an axis.
fn position(mut x: [u32; 3]) -> u64 {
    let top = 1 << (BITS - 1);
    let mut bit = top;
    while bit > 1 {
        let low = bit - 1;
        for axis in 0..3 {
            // Reflect the low bits where this bit is set, exchange them with those of the first axis elsewhere.
            let set = if x[axis] & bit != 0 { u32::MAX } else { 0 };
            let exchange = (x[0] ^ x[axis]) & low & !set;
            x[0] ^= (low & set) | exchange;
            x[axis] ^= exchange;
        }
        bit >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut gray = 0;
    let mut bit = top;
    while bit > 1 {
        gray ^= if x[2] & bit != 0 { bit - 1 } else { 0 };
        bit >>= 1;
    }
    let spread = |value: u32| {
        let mut value = u64::from(value);
        value = (value | value << 32) & 0x001f_0000_0000_ffff;
        value = (value | value << 16) & 0x001f_0000_ff00_00ff;
        value = (value | value << 8) & 0x100f_00f0_0f00_f00f;
        value = (value | value << 4) & 0x10c3_0c30_c30c_30c3;
        (value | value << 2) & 0x1249_2492_4924_9249
    };
    spread(x[0] ^ gray) << 2 | spread(x[1] ^ gray) << 1 | spread(x[2] ^ gray)
}

/// Writes the indices of `points` in their order along the curve over the points' bounding cube; ties by index. `keys` is
/// memory to reuse. Points that are not finite may come anywhere.
pub fn order(points: &[[f64; 3]], keys: &mut Vec<(u64, u32)>, order: &mut Vec<u32>) {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let side = (0..3).fold(0.0f64, |side, axis| side.max(high[axis] - low[axis]));
    let scale = if side > 0.0 && side.is_finite() {
        f64::from((1u32 << BITS) - 1) / side
    } else {
        0.0
    };
    let key = |(index, point): (usize, &[f64; 3])| {
        // The conversion saturates, and the mask keeps what is not finite within the grid.
        let cell = std::array::from_fn(|axis| ((point[axis] - low[axis]) * scale) as u32 & ((1 << BITS) - 1));
        (position(cell), index as u32)
    };
    // Keys differ by their indices, so that every way of sorting gives the same order.
    if points.len() >= MANY && rayon::current_num_threads() > 1 {
        points.par_iter().enumerate().map(key).collect_into_vec(keys);
        keys.par_sort_unstable();
    } else {
        keys.clear();
        keys.extend(points.iter().enumerate().map(key));
        keys.sort_unstable();
    }
    order.clear();
    order.extend(keys.iter().map(|&(_, index)| index));
}
