//! Numbers of the points that a regular subdivision of all patches has, shared by neighbours: first the vertices, then
//! those within edges, then those within patches. No coordinates are compared.

use crate::mesh::quadrilateral::Connectivity;

/// More points than this are not made.
const MOST: usize = 100_000_000;

/// See the module.
#[derive(Clone, Copy)]
pub struct Numbering<'a> {
    quads: &'a [[u32; 4]],
    connectivity: &'a Connectivity,
    pieces: usize,
}

impl<'a> Numbering<'a> {
    /// Every patch in `pieces` by `pieces`, at least 1.
    ///
    /// # Errors
    /// When there would be too many points.
    pub fn new(quads: &'a [[u32; 4]], connectivity: &'a Connectivity, pieces: usize) -> Result<Self, String> {
        let numbering = Self {
            quads,
            connectivity,
            pieces: pieces.max(1),
        };
        let count = numbering.len();
        if count > MOST {
            return Err(format!(
                "{} patches in {pieces} by {pieces} pieces have {count} points, more than the {MOST} that are made; use fewer \
                 pieces (tessellation)",
                quads.len()
            ));
        }
        Ok(numbering)
    }

    fn first_within(&self) -> usize {
        self.connectivity.stars.len() + self.connectivity.edges.len() * (self.pieces - 1)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.first_within() + self.quads.len() * (self.pieces - 1) * (self.pieces - 1)
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number of point `(i, j)` of a patch: `i` steps from corner 0 towards corner 1, `j` towards corner 3.
    pub fn point(&self, patch: usize, i: usize, j: usize) -> usize {
        let (pieces, inner) = (self.pieces, self.pieces - 1);
        let quad = self.quads[patch];
        let on_edge = |side: usize, step: usize| {
            let along = quad[side] < quad[(side + 1) % 4];
            let step = if along { step } else { pieces - step };
            let edge = self.connectivity.quad_edges[patch][side] as usize;
            self.connectivity.stars.len() + edge * inner + step - 1
        };
        match (i, j) {
            (0, 0) => quad[0] as usize,
            (i, 0) if i == pieces => quad[1] as usize,
            (0, j) if j == pieces => quad[3] as usize,
            (i, j) if i == pieces && j == pieces => quad[2] as usize,
            (i, 0) => on_edge(0, i),
            (i, j) if i == pieces => on_edge(1, j),
            (i, j) if j == pieces => on_edge(2, pieces - i),
            (0, j) => on_edge(3, pieces - j),
            (i, j) => self.first_within() + (patch * inner + j - 1) * inner + i - 1,
        }
    }
}
