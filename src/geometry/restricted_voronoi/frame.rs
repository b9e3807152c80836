//! A triangle in its own plane.

use crate::linalg::vector3::{cross, dot, times};
use crate::mesh::{length, subtract};

/// A triangle with an orthonormal frame: `x = origin + u tangents[0] + v tangents[1]` for points `x` of its plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    /// The first vertex.
    pub(crate) origin: [f64; 3],
    pub(crate) tangents: [[f64; 3]; 2],
    /// Unit normal, by the right-hand rule.
    pub(crate) normal: [f64; 3],
    /// The vertices in the plane's coordinates `(u, v)`, counter-clockwise.
    pub(crate) corners: [[f64; 2]; 3],
    pub(crate) area: f64,
    /// Length of the longest edge.
    pub(crate) diameter: f64,
}

impl Frame {
    /// `None` for a triangle without area or without finite coordinates.
    #[inline(always)]
    pub(crate) fn new([a, b, c]: [[f64; 3]; 3]) -> Option<Frame> {
        let edges = [subtract(b, a), subtract(c, b), subtract(a, c)];
        let squares = [
            dot(edges[0], edges[0]),
            dot(edges[1], edges[1]),
            dot(edges[2], edges[2]),
        ];
        // The longest edge is the first axis. Found without branches: none could be foreseen.
        let not_first = (squares[0] < squares[1]) | (squares[0] < squares[2]);
        let longest = usize::from(not_first) * (1 + usize::from(squares[1] < squares[2]));
        let diameter = squares[longest].sqrt();
        let inverse = 1.0 / diameter;
        // Unit lengths before the product, so that no triangle is too small for it.
        let first = times(edges[longest], inverse);
        let side = times(edges[[1, 2, 0][longest]], inverse);
        let across = cross(first, side);
        let height = length(across);
        // A triangle without extent has no plane.
        if !(height > 0.0 && height.is_finite() && diameter * diameter * height > 0.0) {
            return None;
        }
        let normal = times(across, 1.0 / height);
        let tangents = [first, cross(normal, first)];
        let (p, q) = (edges[0], times(edges[2], -1.0));
        let corners = [
            [0.0; 2],
            [dot(p, tangents[0]), dot(p, tangents[1])],
            [dot(q, tangents[0]), dot(q, tangents[1])],
        ];
        let area = 0.5 * (corners[1][0] * corners[2][1] - corners[1][1] * corners[2][0]);
        (area > 0.0).then_some(Frame {
            origin: a,
            tangents,
            normal,
            corners,
            area,
            diameter,
        })
    }

    /// Coordinates `(u, v, w)` of a vector of space in the frame, `w` along the normal.
    #[inline(always)]
    pub(crate) fn local(&self, x: [f64; 3]) -> [f64; 3] {
        [dot(x, self.tangents[0]), dot(x, self.tangents[1]), dot(x, self.normal)]
    }

    /// The vector of space with coordinates `x` in the frame.
    #[inline(always)]
    pub(crate) fn space(&self, x: [f64; 3]) -> [f64; 3] {
        let [u, v] = self.tangents;
        [
            x[0] * u[0] + x[1] * v[0] + x[2] * self.normal[0],
            x[0] * u[1] + x[1] * v[1] + x[2] * self.normal[1],
            x[0] * u[2] + x[1] * v[2] + x[2] * self.normal[2],
        ]
    }

    /// Gradients of the three barycentric coordinates in the plane.
    pub(crate) fn barycentric_gradients(&self) -> [[f64; 2]; 3] {
        let scale = 0.5 / self.area;
        std::array::from_fn(|k| {
            let (from, to) = (self.corners[(k + 1) % 3], self.corners[(k + 2) % 3]);
            [-(to[1] - from[1]) * scale, (to[0] - from[0]) * scale]
        })
    }
}
