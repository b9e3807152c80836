//! How near a site must come to a triangle to own a part of it.

use crate::linalg::vector3::{dot, subtract};

/// The sites nearest to a triangle's vertices, and how near another one must come to own a part of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    pub(super) triangle: u32,
    pub(super) corners: [[f64; 3]; 3],
    /// The site nearest to every vertex.
    pub(super) near: [u32; 3],
    /// The one of `near` that is nearest to all three vertices together.
    pub(super) reference: u32,
    /// One row a different site of `near`: no site owns a part that is not closer to some vertex than its entry there.
    rows: [[f64; 3]; 3],
    count: usize,
}

impl Reach {
    #[inline(always)]
    pub(super) fn new(
        triangle: u32,
        corners: [[f64; 3]; 3],
        near: [u32; 3],
        positions: &[[f64; 3]],
        offset: impl Fn(u32) -> f64,
    ) -> Reach {
        let mut bounds = [[0.0; 3]; 3];
        for k in 0..3 {
            bounds[k] = if k > 0 && near[k] == near[k - 1] {
                bounds[k - 1]
            } else {
                Reach::row(&corners, near[k], positions, &offset)
            };
        }
        let sum = |k: usize| bounds[k][0] + bounds[k][1] + bounds[k][2];
        let mut best = 0;
        for k in 1..3 {
            if near[k] != near[best] && (sum(k), near[k]) < (sum(best), near[best]) {
                best = k;
            }
        }
        let reference = near[best];
        let mut rows = [bounds[best]; 3];
        let mut count = 1;
        for k in 0..3 {
            if near[k] != reference && !(k == 2 && near[1] == near[2]) {
                rows[count.min(2)] = bounds[k];
                count += 1;
            }
        }
        Reach {
            triangle,
            corners,
            near,
            reference,
            rows,
            count: count.min(3),
        }
    }

    /// A little more than the squared distances of the corners to a site, for their rounding.
    #[inline(always)]
    fn row(corners: &[[f64; 3]; 3], site: u32, positions: &[[f64; 3]], offset: &impl Fn(u32) -> f64) -> [f64; 3] {
        let position = positions[site as usize];
        let offset = offset(site);
        corners.map(|corner| {
            let difference = subtract(corner, position);
            (dot(difference, difference) + offset) * (1.0 + 1e-12)
        })
    }

    /// Of a triangle whose vertices share the nearest site, which owns it all: cells are convex. Rows are needed where
    /// normals matter only, and are then made anew.
    #[inline(always)]
    pub(super) fn whole(triangle: u32, corners: [[f64; 3]; 3], site: u32) -> Reach {
        Reach {
            triangle,
            corners,
            near: [site; 3],
            reference: site,
            rows: [[0.0; 3]; 3],
            count: 1,
        }
    }

    #[inline(always)]
    pub(super) fn rows(&self) -> &[[f64; 3]] {
        &self.rows[..self.count]
    }

    /// The whole triangle belongs to one site.
    pub(super) fn is_whole(&self) -> bool {
        self.count == 1
    }

    /// No site farther from the triangle's corners than the root of this owns a part.
    #[inline(always)]
    pub(super) fn radius(&self) -> f64 {
        self.rows().iter().fold(f64::INFINITY, |least, row| {
            least.min(row.iter().fold(0.0, |most: f64, &bound| most.max(bound)))
        })
    }
}

/// A box that grows around points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Around {
    pub(super) low: [f64; 3],
    pub(super) high: [f64; 3],
}

impl Around {
    pub(super) const NOTHING: Around = Around {
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };

    #[inline(always)]
    pub(super) fn add(&mut self, point: [f64; 3]) {
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(point[axis]);
            self.high[axis] = self.high[axis].max(point[axis]);
        }
    }
}
