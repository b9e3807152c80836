//! The restricted cells within one triangle, as the lower envelope of affine functions.
//!
//! On the triangle's plane the squared distance to a site differs from that to a reference site by an affine function, the
//! site's *height function* `W_i`. The cell of site `i` is where `W_i` is smallest: a convex polygon, cut from the triangle
//! by the lines `W_i = W_j`. A constant added to a squared distance (a power diagram) changes nothing in this.

use super::frame::Frame;

/// What lies across an edge of a polygon: an edge of the triangle (`-1 - k` for the edge from corner `k` to `k + 1`) or a
/// candidate.
pub(crate) type Mark = i32;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    pub(crate) u: f64,
    pub(crate) v: f64,
    /// Mark of the edge that leaves the vertex.
    pub(crate) mark: Mark,
}

/// A site that may own a part of the triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) site: u32,
    /// The height function `height[0] u + height[1] v + height[2]`.
    pub(crate) height: [f64; 3],
    /// The site in the triangle's frame, relative to its origin.
    pub(crate) local: [f64; 3],
    /// What is added to the squared distance.
    pub(crate) offset: f64,
}

/// Working memory for one triangle at a time.
#[derive(Debug, Default)]
pub(crate) struct Clipper {
    pub(crate) candidates: Vec<Candidate>,
    polygon: Vec<Corner>,
    other: Vec<Corner>,
    signs: Vec<f64>,
}

impl Clipper {
    /// The polygon of candidate `i`, counter-clockwise; empty when it owns nothing.
    pub(crate) fn cell(&mut self, frame: &Frame, i: usize) -> &[Corner] {
        self.polygon.clear();
        for (k, &[u, v]) in frame.corners.iter().enumerate() {
            self.polygon.push(Corner {
                u,
                v,
                mark: -1 - k as i32,
            });
        }
        let own = self.candidates[i];
        for j in 0..self.candidates.len() {
            if j == i {
                continue;
            }
            let other = &self.candidates[j];
            let [a, b, c] = std::array::from_fn(|k| own.height[k] - other.height[k]);
            self.signs.clear();
            self.signs
                .extend(self.polygon.iter().map(|corner| a * corner.u + b * corner.v + c));
            // Ties go to the smaller index, so that two sites with the same height function do not share a cell.
            let outside = |sign: f64| sign > 0.0 || (sign == 0.0 && other.site < own.site);
            let count = self.signs.iter().filter(|&&sign| outside(sign)).count();
            if count == 0 {
                continue;
            }
            if count == self.signs.len() {
                self.polygon.clear();
                break;
            }
            self.other.clear();
            let size = self.polygon.len();
            for k in 0..size {
                let next = if k + 1 == size { 0 } else { k + 1 };
                let (from, to) = (self.polygon[k], self.polygon[next]);
                let (start, end) = (self.signs[k], self.signs[next]);
                let out = outside(start);
                if !out {
                    self.other.push(from);
                }
                if out != outside(end) {
                    let t = start / (start - end);
                    let t = if t >= 0.0 { t.min(1.0) } else { 0.0 };
                    self.other.push(Corner {
                        u: from.u + t * (to.u - from.u),
                        v: from.v + t * (to.v - from.v),
                        // Leaving the cell: the bisector follows. Entering it: the old edge goes on.
                        mark: if out { from.mark } else { j as i32 },
                    });
                }
            }
            std::mem::swap(&mut self.polygon, &mut self.other);
        }
        &self.polygon
    }
}
