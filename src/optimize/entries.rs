//! Vectors entry by entry. Long ones are cut into runs that threads share.
//!
//! Guaranteed: the same bits with any number of threads, for runs are the same and their sums are added in order.

use rayon::prelude::*;

/// From this number of entries on, threads share the work.
const MANY: usize = 1 << 15;
/// Entries for one thread at a time.
const RUN: usize = 1 << 13;
/// Sums that grow side by side.
const LANES: usize = 16;

/// Inner product. Short vectors are summed in order, long ones run by run.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    if a.len().min(b.len()) < MANY {
        return a.iter().zip(b).map(|(a, b)| a * b).sum();
    }
    let mut sums = Vec::new();
    (a.par_chunks(RUN).zip(b.par_chunks(RUN)))
        .map(|(a, b)| dot_of_run(a, b))
        .collect_into_vec(&mut sums);
    sums.into_iter().sum()
}

/// One addition waits for the one before only within its lane.
fn dot_of_run(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let (a, rest_of_a) = a.as_chunks::<LANES>();
    let (b, rest_of_b) = b.as_chunks::<LANES>();
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            lanes[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = rest_of_a.iter().zip(rest_of_b).map(|(a, b)| a * b).sum();
    lanes.into_iter().sum::<f64>() + rest
}

/// Euclidean norm.
pub fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Writes `write(a, b)` for every two entries.
fn write(result: &mut [f64], a: &[f64], b: &[f64], write: impl Fn(&mut f64, f64, f64) + Sync) {
    let run = |(result, (a, b)): (&mut [f64], (&[f64], &[f64]))| {
        for (result, (&a, &b)) in result.iter_mut().zip(a.iter().zip(b)) {
            write(result, a, b);
        }
    };
    if result.len() < MANY {
        return run((result, (a, b)));
    }
    let parts = a.par_chunks(RUN).zip(b.par_chunks(RUN));
    result.par_chunks_mut(RUN).zip(parts).for_each(run);
}

/// `difference = a - b`.
pub fn subtract(a: &[f64], b: &[f64], difference: &mut [f64]) {
    write(difference, a, b, |difference, a, b| *difference = a - b);
}

/// `result = x + factor y`.
pub fn combine(x: &[f64], factor: f64, y: &[f64], result: &mut [f64]) {
    write(result, x, y, |result, x, y| *result = x + factor * y);
}

/// `sum += factor x`.
pub fn add_scaled(sum: &mut [f64], factor: f64, x: &[f64]) {
    let run = |(sum, x): (&mut [f64], &[f64])| {
        for (sum, x) in sum.iter_mut().zip(x) {
            *sum += factor * x;
        }
    };
    if sum.len() < MANY {
        return run((sum, x));
    }
    sum.par_chunks_mut(RUN).zip(x.par_chunks(RUN)).for_each(run);
}

/// `result = factor x`.
pub fn scale(x: &[f64], factor: f64, result: &mut [f64]) {
    let run = |(result, x): (&mut [f64], &[f64])| {
        for (result, x) in result.iter_mut().zip(x) {
            *result = factor * x;
        }
    };
    if result.len() < MANY {
        return run((result, x));
    }
    result.par_chunks_mut(RUN).zip(x.par_chunks(RUN)).for_each(run);
}

/// `x *= factor`.
pub fn multiply(x: &mut [f64], factor: f64) {
    let run = |x: &mut [f64]| x.iter_mut().for_each(|x| *x *= factor);
    if x.len() < MANY {
        return run(x);
    }
    x.par_chunks_mut(RUN).for_each(run);
}
