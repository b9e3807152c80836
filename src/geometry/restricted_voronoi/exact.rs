//! The restricted cells within one triangle with exact decisions, for triangles that rounding would spoil: triangles
//! in or near a bisector, sites far away, crowded vertices.
//!
//! The three values of a height function at the triangle's corners are taken as given numbers, which makes it a point of
//! dual space. Whether one function is lower than another at a corner is then a comparison; where two functions meet
//! on an edge, an orientation of three points in the plane; where three functions meet, an orientation of four points
//! in space. All are decided exactly (Shewchuk 1997, crate `robust`). Equal values are told apart by the functions'
//! order, so that equal functions do not share a cell. Only the places of the vertices are rounded.

use super::clip::{Corner, Mark};
use super::frame::Frame;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// Memory for cutting one polygon.
#[derive(Debug, Default)]
pub(super) struct ExactClipper {
    /// Every vertex with the marks of the edges that enter and leave it.
    polygon: Vec<(Corner, Mark)>,
    other: Vec<(Corner, Mark)>,
    outside: Vec<bool>,
    result: Vec<Corner>,
}

/// The values of a height function at the triangle's corners.
pub(super) fn dual(frame: &Frame, height: [f64; 3]) -> [f64; 3] {
    frame.corners.map(|[u, v]| height[0] * u + height[1] * v + height[2])
}

fn space(x: [f64; 3]) -> Coord3D<f64> {
    Coord3D {
        x: x[0],
        y: x[1],
        z: x[2],
    }
}

/// Positive where `x` is lower than `own` at the vertex between the edges with the given marks.
fn sign(own: [f64; 3], x: [f64; 3], entering: Mark, leaving: Mark, duals: &dyn Fn(Mark) -> [f64; 3]) -> f64 {
    match (entering < 0, leaving < 0) {
        (true, true) => {
            // The corner where edge `leaving` starts.
            let k = (-1 - leaving) as usize;
            own[k] - x[k]
        }
        (false, false) => {
            // The differences to the two rivals turn counter-clockwise, as the edges do, so that the denominator of the
            // vertex is positive.
            -orient3d(space(duals(entering)), space(duals(leaving)), space(x), space(own))
        }
        (on_edge, _) => {
            // On edge k the parameter runs from corner k to k + 1. Leaving along the edge, the cell lies ahead.
            let (edge, rival) = if on_edge {
                (entering, leaving)
            } else {
                (leaving, entering)
            };
            let a = (-1 - edge) as usize;
            let b = (a + 1) % 3;
            let plane = |p: [f64; 3]| Coord { x: p[a], y: p[b] };
            let turn = orient2d(plane(duals(rival)), plane(x), plane(own));
            // Entering along the edge, corner `a` is on the owner's side of the rival; leaving, corner `b`.
            if on_edge { -turn } else { turn }
        }
    }
}

impl ExactClipper {
    /// The polygon of function `i` of `duals`, counter-clockwise; empty when it owns nothing. Of equal functions the
    /// first one owns. `rivals` are the functions that cut.
    pub(super) fn cell(&mut self, frame: &Frame, duals: &[[f64; 3]], i: usize, rivals: &[u32]) -> &[Corner] {
        self.result.clear();
        self.polygon.clear();
        for (k, &[u, v]) in frame.corners.iter().enumerate() {
            let corner = Corner {
                u,
                v,
                mark: -1 - k as i32,
                rival: -1,
            };
            self.polygon.push((corner, -1 - ((k as i32 + 2) % 3)));
        }
        let own = duals[i];
        for &j in rivals {
            let j = j as usize;
            if j == i {
                continue;
            }
            let other = duals[j];
            self.outside.clear();
            let (mut above, mut below) = (false, false);
            for &(corner, entering) in &self.polygon {
                let sign = sign(own, other, entering, corner.mark, &|mark| duals[mark as usize]);
                above |= sign > 0.0;
                below |= sign < 0.0;
                // A vertex on the bisector stays, so that every new vertex lies on two lines that cross.
                self.outside.push(sign > 0.0);
            }
            if !below && (above || j < i) {
                // Touched at most, or equal to an earlier function.
                return &self.result;
            }
            if !above {
                continue;
            }
            self.other.clear();
            let size = self.polygon.len();
            for k in 0..size {
                let next = if k + 1 == size { 0 } else { k + 1 };
                let ((from, entering), (to, _)) = (self.polygon[k], self.polygon[next]);
                let outside = self.outside[k];
                if !outside {
                    self.other.push((from, entering));
                }
                if outside != self.outside[next] {
                    let height = |x: Corner| {
                        // Barycentric interpolation of the difference of the two functions.
                        let [p, q, r] = frame.corners;
                        let double = 2.0 * frame.area;
                        let first = ((q[0] - x.u) * (r[1] - x.v) - (q[1] - x.v) * (r[0] - x.u)) / double;
                        let second = ((r[0] - x.u) * (p[1] - x.v) - (r[1] - x.v) * (p[0] - x.u)) / double;
                        first * (own[0] - other[0])
                            + second * (own[1] - other[1])
                            + (1.0 - first - second) * (own[2] - other[2])
                    };
                    let (start, end) = (height(from), height(to));
                    let t = start / (start - end);
                    // The exact crossing lies on the edge.
                    let t = if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.5 };
                    let corner = Corner {
                        u: from.u + t * (to.u - from.u),
                        v: from.v + t * (to.v - from.v),
                        mark: if outside { from.mark } else { j as i32 },
                        rival: -1,
                    };
                    self.other.push((corner, if outside { j as i32 } else { from.mark }));
                }
            }
            std::mem::swap(&mut self.polygon, &mut self.other);
        }
        self.result.extend(self.polygon.iter().map(|&(corner, _)| corner));
        &self.result
    }
}
