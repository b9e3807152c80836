//! The sites nearest to the vertices of a surface.

use super::AT_HAND;
use super::reach::Around;
use crate::geometry::point_tree::{PointTree, SomePoints};
use crate::linalg::lanes::Vector;
use crate::linalg::processor::Kernel;
use crate::linalg::vector3::{dot, subtract};

/// Finds the sites nearest to a chunk of vertices.
pub(super) struct FindNearest<'a> {
    pub(super) vertices: &'a [u32],
    pub(super) block: usize,
    pub(super) points: &'a [[f64; 3]],
    pub(super) sites: &'a PointTree,
    /// Memory.
    pub(super) some: &'a mut SomePoints,
    /// Holds the sites that were nearest the last time, which are good guesses.
    pub(super) found: &'a mut [u32],
}

impl FindNearest<'_> {
    // No closure: it would not inherit the instruction set.
    #[inline(always)]
    fn nearest<V: Vector>(&self, vertex: u32, hint: Option<u32>, before: u32) -> u32 {
        let x = self.points[vertex as usize];
        let sites = self.sites.points();
        let hint = match (hint, sites.get(before as usize)) {
            (Some(hint), Some(&old)) => {
                let (here, there) = (subtract(sites[hint as usize], x), subtract(old, x));
                Some(if dot(there, there) < dot(here, here) {
                    before
                } else {
                    hint
                })
            }
            (None, Some(_)) => Some(before),
            (hint, None) => hint,
        };
        // There are sites, so there is a nearest one.
        self.sites.nearest_in::<V>(x, hint).map_or(0, |(site, _)| site)
    }
}

impl Kernel for FindNearest<'_> {
    #[inline(always)]
    fn run<V: Vector>(mut self) {
        let found = std::mem::take(&mut self.found);
        let mut hint = None;
        for (vertices, found) in self.vertices.chunks(self.block).zip(found.chunks_mut(self.block)) {
            let first = self.nearest::<V>(vertices[0], hint, found[0]);
            hint = Some(first);
            found[0] = first;
            if vertices.len() == 1 {
                continue;
            }
            // The better of the first vertex's site and the one that was nearest the last time.
            let sites = self.sites.points();
            let guess = |vertex: u32, before: u32| {
                let square = |site: u32| {
                    let difference = subtract(sites[site as usize], self.points[vertex as usize]);
                    dot(difference, difference)
                };
                let guess = (square(first), first);
                if (before as usize) < sites.len() {
                    let other = (square(before), before);
                    if other < guess { other } else { guess }
                } else {
                    guess
                }
            };
            let mut around = Around::NOTHING;
            let mut bound = 0.0f64;
            for (&vertex, &before) in vertices.iter().zip(&*found).skip(1) {
                around.add(self.points[vertex as usize]);
                bound = bound.max(guess(vertex, before).0);
            }
            if self
                .sites
                .gather::<V>(around.low, around.high, bound, AT_HAND, self.some)
            {
                for (&vertex, found) in vertices.iter().zip(found).skip(1) {
                    *found = self
                        .some
                        .nearest::<V>(self.points[vertex as usize], guess(vertex, *found))
                        .1;
                }
            } else {
                for (&vertex, found) in vertices.iter().zip(found).skip(1) {
                    *found = self.nearest::<V>(vertex, hint, *found);
                    hint = Some(*found);
                }
            }
        }
    }
}
