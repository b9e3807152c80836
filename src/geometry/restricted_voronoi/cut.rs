//! One triangle among its sites: which of them may own a part of it, and the parts.
//!
//! There are three ways to the parts, each for what the one before leaves. All cells are walked at once along their edges
//! ([`super::envelope`]), two or three in closed form ([`super::few`]). Where rounding breaks the walk, cells are cut one
//! by one ([`super::clip`]). Where they then overlap or leave gaps, which their areas betray, they are cut by exact
//! decisions ([`super::exact`]). Triangles with many candidates are not walked, and subdivided before they are cut
//! ([`super::subdivide`]).

use super::clip::{Candidate, Clipper, Corner, Heights, Polygons};
use super::envelope::Envelope;
use super::exact::{self, ExactClipper};
use super::few::{divide_among_three, halve};
use super::frame::Frame;
use super::reach::Reach;
use super::subdivide::Subdivision;
use super::{Compatibility, Visitor, Way, Ways};
use crate::geometry::point_tree::{PointTree, SomePoints};
use crate::linalg::lanes::Vector;
use crate::linalg::vector3::{add, dot, subtract};

/// Triangles with more candidates are subdivided first.
const MANY: usize = 48;
/// Among no more contenders than this those that own nothing do no harm.
const FEW: usize = 16;
/// What is rounding in a difference of height functions, as a share of its terms.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// One triangle with the sites that may own a part of it.
pub(crate) struct Cut<'a> {
    pub(crate) triangle: u32,
    pub(crate) frame: &'a Frame,
    pub(crate) candidates: &'a [Candidate],
    /// The candidate that owns `polygon`.
    pub(crate) owner: usize,
    pub(crate) polygon: &'a [Corner],
}

/// Memory for cutting one triangle at a time.
#[derive(Debug, Default)]
pub(super) struct Cutter {
    found: Vec<u32>,
    candidates: Vec<Candidate>,
    heights: Heights,
    some_heights: Heights,
    rivals: Vec<u32>,
    polygons: Polygons,
    clipper: Clipper,
    envelope: Envelope,
    exact: ExactClipper,
    duals: Vec<[f64; 3]>,
    subdivision: Subdivision,
    /// How often each way was gone.
    pub(super) ways: Ways,
}

impl Cutter {
    /// Cuts one triangle, whose sites are `at_hand` if any are. `first` is the first way to try.
    #[inline(always)]
    pub(super) fn cut<V: Vector>(
        &mut self,
        reach: &Reach,
        at_hand: Option<&SomePoints>,
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
        first: Way,
        visitor: &mut impl Visitor,
    ) {
        let Some(frame) = Frame::new(reach.corners) else { return };
        let tolerance = self.find_candidates::<V>(reach, &frame, at_hand, sites, compatibility);
        self.polygons.clear();
        if self.candidates.len() == 1 {
            self.polygons.push(0, &Clipper::triangle(&frame));
            self.ways.whole += 1;
        } else {
            self.divide::<V>(&frame, tolerance, first);
        }
        for &(owner, start, end) in &self.polygons.parts {
            visitor.piece(&Cut {
                triangle: reach.triangle,
                frame: &frame,
                candidates: &self.candidates,
                owner: owner as usize,
                polygon: &self.polygons.corners[start as usize..end as usize],
            });
        }
    }

    /// Writes the candidates, the reference first. Returns what is rounding in differences of their height functions.
    #[inline(always)]
    fn find_candidates<V: Vector>(
        &mut self,
        reach: &Reach,
        frame: &Frame,
        at_hand: Option<&SomePoints>,
        sites: &PointTree,
        compatibility: Option<Compatibility<'_>>,
    ) -> f64 {
        let corners = reach.corners;
        let Cutter { found, candidates, .. } = self;
        let positions = sites.points();
        let offset = |site: u32| {
            compatibility.map_or(0.0, |compatibility| {
                let normal = compatibility.normals[site as usize];
                compatibility.weight * (1.0 - dot(normal, frame.normal)).max(0.0)
            })
        };
        let compatible;
        let reach = match compatibility {
            None => reach,
            Some(_) => {
                compatible = Reach::new(reach.triangle, corners, reach.near, positions, offset);
                &compatible
            }
        };
        let reference = reach.reference;
        found.clear();
        if compatibility.is_some() || !reach.is_whole() {
            match at_hand {
                Some(some) => some.contenders::<V>(&corners, reach.rows(), found),
                None => sites.contenders::<V>(&corners, reach.rows(), found),
            }
            if compatibility.is_some() {
                if !found.contains(&reference) {
                    found.push(reference);
                }
                // Sites in one place differ by their offsets alone, so that the smallest one wins everywhere.
                for site in found.iter_mut() {
                    let mut twin = *site;
                    while let Some(next) = sites.twin(twin) {
                        twin = next;
                        if offset(twin) < offset(*site) {
                            *site = twin;
                        }
                    }
                }
            }
        }
        let origin = positions[reference as usize];
        let reference_offset = offset(reference);
        let reference = Reference {
            site: reference,
            origin,
            to_origin: subtract(origin, frame.origin),
            offset: reference_offset,
        };
        let (own, mut scale) = reference.candidate(frame, reference.site, origin, reference_offset);
        candidates.clear();
        candidates.push(own);
        // Sites as far from a corner as the reference is, but for rounding, are contenders. Around the axis of a fan all
        // are, in every triangle; farther from the rest of it they own nothing.
        let crowded = found.len() > FEW;
        for &site in found.iter() {
            if site != reference.site {
                let (candidate, size) = reference.candidate(frame, site, positions[site as usize], offset(site));
                if crowded {
                    let slack = ROUNDING * size;
                    let [a, b, c] = candidate.height;
                    let values = frame.corners.map(|[u, v]| a * u + b * v + c);
                    if values.iter().all(|&value| value >= -slack) && values.iter().any(|&value| value > slack) {
                        continue;
                    }
                }
                candidates.push(candidate);
                scale = scale.max(size);
            }
        }
        ROUNDING * scale
    }

    /// Writes the polygons of two candidates or more. Differences of height functions below `tolerance` are rounding.
    #[inline(always)]
    fn divide<V: Vector>(&mut self, frame: &Frame, tolerance: f64, first: Way) {
        // Polygons that overlap or leave gaps betray themselves by their areas.
        let allowed = 1e-10 * frame.area + 1e-14 * frame.diameter * frame.diameter;
        let fills = |polygons: &Polygons| (polygons.area - frame.area).abs() <= allowed;
        if first == Way::Walk {
            let done = match &self.candidates[..] {
                [a, b] => {
                    halve(frame, [&a.height, &b.height], &mut self.polygons);
                    true
                }
                [a, b, c] => divide_among_three(frame, [&a.height, &b.height, &c.height], &mut self.polygons),
                _ => false,
            };
            if done && fills(&self.polygons) {
                self.ways.walked += 1;
                return;
            }
            self.polygons.clear();
        }
        self.take_heights();
        if first == Way::Walk && self.candidates.len() <= MANY {
            if self.envelope.cells::<V>(frame, &self.heights, &mut self.polygons) && fills(&self.polygons) {
                self.ways.walked += 1;
                return;
            }
            self.polygons.clear();
        }
        if first != Way::Exact {
            self.clip::<V>(frame, tolerance);
            if fills(&self.polygons) {
                self.ways.clipped += 1;
                return;
            }
            self.polygons.clear();
        }
        self.decide::<V>(frame, tolerance);
        self.ways.exact += 1;
        self.ways.gaps += usize::from(!fills(&self.polygons));
    }

    #[inline(always)]
    fn take_heights(&mut self) {
        self.heights.clear();
        for candidate in &self.candidates {
            self.heights.push(candidate.height);
        }
    }

    /// Cuts the cells one by one.
    #[inline(always)]
    fn clip<V: Vector>(&mut self, frame: &Frame, tolerance: f64) {
        let Cutter {
            candidates,
            heights,
            some_heights,
            rivals,
            polygons,
            clipper,
            subdivision,
            ..
        } = self;
        if candidates.len() <= MANY {
            let start = Clipper::corners::<V>(frame, heights);
            for owner in 0..candidates.len() {
                let polygon = clipper.cell::<V>(&start, heights, owner, tolerance);
                if polygon.len() >= 3 {
                    polygons.push(owner, polygon);
                }
            }
            return;
        }
        subdivision.divide(frame, heights, tolerance);
        for owner in 0..candidates.len() {
            subdivision.rivals(owner, rivals);
            if rivals.is_empty() {
                continue;
            }
            some_heights.clear();
            for &rival in rivals.iter() {
                some_heights.push(candidates[rival as usize].height);
            }
            let start = Clipper::corners::<V>(frame, some_heights);
            let polygon = clipper.cell::<V>(&start, some_heights, 0, tolerance);
            if polygon.len() >= 3 && heights.owns::<V>(polygon, owner, tolerance) {
                polygons.push_renamed(owner, polygon, rivals);
            }
        }
    }

    /// Cuts the cells by exact decisions.
    fn decide<V: Vector>(&mut self, frame: &Frame, tolerance: f64) {
        // Of equal functions the first one owns: the one with the smallest index.
        self.candidates.sort_unstable_by_key(|candidate| candidate.site);
        self.take_heights();
        let Cutter {
            candidates,
            heights,
            rivals,
            polygons,
            exact,
            duals,
            subdivision,
            ..
        } = self;
        duals.clear();
        duals.extend(candidates.iter().map(|candidate| exact::dual(frame, candidate.height)));
        let few = candidates.len() <= MANY;
        if few {
            rivals.clear();
            rivals.extend(0..candidates.len() as u32);
        } else {
            subdivision.divide(frame, heights, tolerance);
        }
        for owner in 0..candidates.len() {
            if !few {
                subdivision.rivals(owner, rivals);
                if rivals.is_empty() {
                    continue;
                }
            }
            let polygon = exact.cell(frame, duals, owner, rivals);
            if polygon.len() >= 3 && (few || heights.owns::<V>(polygon, owner, tolerance)) {
                polygons.push(owner, polygon);
            }
        }
    }
}

/// The candidate that the others' height functions are relative to.
struct Reference {
    site: u32,
    /// Its position, in space and from the frame's origin.
    origin: [f64; 3],
    to_origin: [f64; 3],
    offset: f64,
}

impl Reference {
    /// A site as a candidate, and the size of the terms in its height function.
    #[inline(always)]
    fn candidate(&self, frame: &Frame, site: u32, position: [f64; 3], offset: f64) -> (Candidate, f64) {
        let difference = subtract(position, self.origin);
        let from_origin = subtract(position, frame.origin);
        let middle = add(from_origin, self.to_origin);
        let candidate = Candidate {
            site,
            height: [
                -2.0 * dot(difference, frame.tangents[0]),
                -2.0 * dot(difference, frame.tangents[1]),
                dot(difference, middle) + (offset - self.offset),
            ],
            local: frame.local(from_origin),
            offset,
        };
        (
            candidate,
            size(difference) * (size(middle) + 2.0 * frame.diameter) + offset + self.offset,
        )
    }
}

/// Sum of magnitudes.
#[inline(always)]
fn size(x: [f64; 3]) -> f64 {
    x[0].abs() + x[1].abs() + x[2].abs()
}
