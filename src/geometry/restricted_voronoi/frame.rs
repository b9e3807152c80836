//! A triangle in its own plane.

use crate::mesh::{cross, dot, length, subtract};

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
    pub(crate) fn new([a, b, c]: [[f64; 3]; 3]) -> Option<Frame> {
        let edges = [subtract(b, a), subtract(c, b), subtract(a, c)];
        let lengths = edges.map(length);
        let longest = (1..3).fold(0, |best, k| if lengths[k] > lengths[best] { k } else { best });
        let diameter = lengths[longest];
        let first = edges[longest].map(|x| x / diameter);
        // Unit lengths before the product, so that no triangle is too small for it.
        let side = edges[(longest + 1) % 3].map(|x| x / diameter);
        let across = cross(first, side);
        let height = length(across);
        // A triangle thinner than the rounding of its coordinates has no plane.
        if !(height > 0.0 && height.is_finite() && diameter * diameter * height > 0.0) {
            return None;
        }
        let normal = across.map(|x| x / height);
        let tangents = [first, cross(normal, first)];
        let plane = |x: [f64; 3]| [dot(x, tangents[0]), dot(x, tangents[1])];
        let corners = [[0.0; 2], plane(subtract(b, a)), plane(subtract(c, a))];
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
        std::array::from_fn(|k| x[0] * self.tangents[0][k] + x[1] * self.tangents[1][k] + x[2] * self.normal[k])
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
