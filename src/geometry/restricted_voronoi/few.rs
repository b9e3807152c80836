//! The cells of two or three functions in a triangle, in closed form.
//!
//! Most triangles of a surface that is finer than its sites are cut into two or three cells. Two functions have one
//! bisector, a line. The bisectors of three meet in a point or do not meet: how often the lowest function changes along
//! the triangle's border tells which.

use super::clip::{Corner, Polygons};
use super::envelope::{allowed, counter_clockwise};
use super::frame::Frame;

/// The values of a function at the triangle's corners.
#[inline(always)]
fn at_corners(frame: &Frame, &[a, b, c]: &[f64; 3]) -> [f64; 3] {
    frame.corners.map(|[u, v]| a * u + b * v + c)
}

/// Writes the cells of two functions.
#[inline(always)]
pub(super) fn halve(frame: &Frame, [a, b]: [&[f64; 3]; 2], polygons: &mut Polygons) {
    let values = at_corners(frame, &[a[0] - b[0], a[1] - b[1], a[2] - b[2]]);
    let owners = values.map(|value| usize::from(value > 0.0));
    const MOST: usize = 4;
    let corners = polygons.room(2 * MOST);
    let mut sizes = [0; 2];
    let mut push = |cell: usize, [u, v]: [f64; 2], mark: i32| {
        corners[cell * MOST + sizes[cell]] = Corner {
            u,
            v,
            mark,
            ..Corner::EMPTY
        };
        sizes[cell] += 1;
    };
    for k in 0..3 {
        let next = if k == 2 { 0 } else { k + 1 };
        let (owner, other) = (owners[k], owners[next]);
        let from = frame.corners[k];
        let edge = -1 - k as i32;
        push(owner, from, edge);
        if owner != other {
            let t = values[k] / (values[k] - values[next]);
            let to = frame.corners[next];
            let at = [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])];
            push(owner, at, other as i32);
            push(other, at, edge);
        }
    }
    for (cell, size) in sizes.into_iter().enumerate() {
        if size >= 3 {
            polygons.close(cell, cell * MOST, cell * MOST + size);
        }
    }
}

/// Where the lowest function changes along the border.
#[derive(Clone, Copy)]
struct Crossing {
    edge: usize,
    /// From one corner of the edge to the next.
    place: f64,
    from: usize,
    to: usize,
}

/// Writes the cells of three functions. False when rounding got in the way; what was written is then void.
#[inline(always)]
pub(super) fn divide_among_three(frame: &Frame, heights: [&[f64; 3]; 3], polygons: &mut Polygons) -> bool {
    let values = heights.map(|height| at_corners(frame, height));
    let owners: [usize; 3] = std::array::from_fn(|k| {
        let best = usize::from(values[1][k] < values[0][k]);
        if values[2][k] < values[best][k] { 2 } else { best }
    });
    // Two bisectors at most cross the border twice each, and three that meet once each.
    const MOST: usize = 4;
    let mut crossings = [Crossing {
        edge: 0,
        place: 0.0,
        from: 0,
        to: 0,
    }; MOST];
    let mut count = 0;
    for k in 0..3 {
        let next = if k == 2 { 0 } else { k + 1 };
        let (from, to) = (owners[k], owners[next]);
        if from == to {
            // A function that is lowest at both ends is lowest in between.
            continue;
        }
        let meet = |i: usize, j: usize| {
            let (start, end) = (values[i][k] - values[j][k], values[i][next] - values[j][next]);
            start / (start - end)
        };
        let place = meet(from, to);
        let third = 3 - from - to;
        let between = |i: usize| values[i][k] + place * (values[i][next] - values[i][k]);
        let mut cross = |place: f64, from: usize, to: usize| {
            if count < MOST {
                crossings[count] = Crossing {
                    edge: k,
                    place,
                    from,
                    to,
                };
            }
            count += 1;
        };
        if between(third) < between(from) {
            let (first, second) = (meet(from, third), meet(third, to));
            // Not-a-number as well.
            if !(0.0 <= first && first <= second && second <= 1.0) {
                return false;
            }
            cross(first, from, third);
            cross(second, third, to);
        } else {
            cross(place, from, to);
        }
    }
    // Two cells share one edge at most.
    if count > MOST || count == 4 && crossings[0].from == crossings[2].from && crossings[1].from == crossings[3].from {
        return false;
    }
    let mut centre = [0.0; 2];
    if count == 3 {
        // From the border along the steepest of the three bisectors: rounding moves the point along that line, not across
        // it, also where the three nearly coincide.
        let difference = |i: usize, j: usize| std::array::from_fn::<f64, 3, _>(|k| heights[j][k] - heights[i][k]);
        let mut steepest = (-1.0, 0);
        for (index, crossing) in crossings[..3].iter().enumerate() {
            let p = difference(crossing.from, crossing.to);
            let steepness = p[0] * p[0] + p[1] * p[1];
            if steepness > steepest.0 {
                steepest = (steepness, index);
            }
        }
        let Crossing { edge, place, from, to } = crossings[steepest.1];
        let (p, q) = (difference(from, to), difference(from, 3 - from - to));
        let [start, end] = [frame.corners[edge], frame.corners[if edge == 2 { 0 } else { edge + 1 }]];
        let at = [0, 1].map(|axis: usize| start[axis] + place * (end[axis] - start[axis]));
        let t = (q[0] * at[0] + q[1] * at[1] + q[2]) / (p[0] * q[1] - p[1] * q[0]);
        centre = [at[0] + t * p[1], at[1] - t * p[0]];
        if !(centre[0].is_finite() && centre[1].is_finite()) {
            return false;
        }
    }
    // Corners of the triangle, crossings, and the common vertex.
    const SIZE: usize = 3 + MOST + 1;
    let corners = polygons.room(3 * SIZE);
    let mut sizes = [0; 3];
    let mut push = |cell: usize, [u, v]: [f64; 2], mark: i32| {
        corners[cell * SIZE + sizes[cell]] = Corner {
            u,
            v,
            mark,
            ..Corner::EMPTY
        };
        sizes[cell] += 1;
    };
    let mut crossings = crossings[..count].iter().peekable();
    for k in 0..3 {
        let edge = -1 - k as i32;
        let [from, to] = [frame.corners[k], frame.corners[if k == 2 { 0 } else { k + 1 }]];
        push(owners[k], from, edge);
        while let Some(crossing) = crossings.next_if(|crossing| crossing.edge == k) {
            let t = crossing.place;
            let at = [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])];
            push(crossing.from, at, crossing.to as i32);
            if count == 3 {
                push(crossing.from, centre, (3 - crossing.from - crossing.to) as i32);
            }
            push(crossing.to, at, edge);
        }
    }
    let allowed = allowed(frame);
    for (cell, size) in sizes.into_iter().enumerate() {
        let start = cell * SIZE;
        if size >= 3 {
            if !counter_clockwise(&polygons.room(3 * SIZE)[start..start + size], allowed) {
                return false;
            }
            polygons.close(cell, start, start + size);
        }
    }
    true
}
