//! Rivals of every candidate in a triangle that many sites share.
//!
//! The triangle is divided into four again and again, until few functions can be lowest on a part: a function that is
//! nowhere lower than another at the part's corners is not lowest on it. Two functions whose cells share an edge meet
//! in a part where both remain, so the functions that remain together anywhere are all that need to be cut with each
//! other. A function that remains without being lowest anywhere is told by its polygon's middle, where another one is
//! lower.

use super::clip::Heights;
use super::frame::Frame;
use std::ops::Range;

/// Parts with no more functions than this are not divided.
const FEW: usize = 16;
/// Parts of this depth are not divided: what remains meets in a point, up to rounding.
const DEPTH: u32 = 24;
/// Functions that meet along a line, or are one but for rounding, remain together in every part there, however small.
/// After so many divisions that left most functions in two children a part is not divided; one with four children
/// counts twice.
const VAIN: f64 = 4.0;

#[derive(Debug, Default)]
pub(super) struct Subdivision {
    /// Functions of the undivided parts, one part after the other, and where each ends.
    members: Vec<u32>,
    ends: Vec<u32>,
    /// Functions of the parts being divided.
    stack: Vec<u32>,
    /// The parts of every function.
    starts: Vec<u32>,
    parts: Vec<u32>,
    seen: Vec<u32>,
}

impl Subdivision {
    /// Divides the triangle.
    pub(super) fn divide(&mut self, frame: &Frame, heights: &Heights, tolerance: f64) {
        self.members.clear();
        self.ends.clear();
        self.stack.clear();
        self.stack.extend(0..heights.len() as u32);
        let all = self.keep(frame.corners, 0..heights.len(), heights, tolerance);
        self.part(frame.corners, all, heights, tolerance, 0, 0.0);
        // Which parts is a function in: a counting sort.
        self.starts.clear();
        self.starts.resize(heights.len() + 2, 0);
        for &member in &self.members {
            self.starts[member as usize + 2] += 1;
        }
        for index in 2..self.starts.len() {
            self.starts[index] += self.starts[index - 1];
        }
        self.parts.clear();
        self.parts.resize(self.members.len(), 0);
        let mut start = 0;
        for (part, &end) in self.ends.iter().enumerate() {
            for &member in &self.members[start..end as usize] {
                let place = &mut self.starts[member as usize + 1];
                self.parts[*place as usize] = part as u32;
                *place += 1;
            }
            start = end as usize;
        }
        self.seen.clear();
        self.seen.resize(heights.len(), u32::MAX);
    }

    /// Divides the part with these corners, on which the functions in `self.stack[range]` remain. `vain` counts the
    /// divisions before that left most of them in two children at least: one for two children, two for four.
    fn part(
        &mut self,
        corners: [[f64; 2]; 3],
        range: Range<usize>,
        heights: &Heights,
        tolerance: f64,
        depth: u32,
        vain: f64,
    ) {
        if range.len() <= FEW || depth >= DEPTH || vain >= VAIN {
            self.members.extend_from_slice(&self.stack[range]);
            self.ends.push(self.members.len() as u32);
            return;
        }
        let middle = |a: usize, b: usize| {
            [
                0.5 * (corners[a][0] + corners[b][0]),
                0.5 * (corners[a][1] + corners[b][1]),
            ]
        };
        let (p, q, r) = (middle(0, 1), middle(1, 2), middle(2, 0));
        let children = [[corners[0], p, r], [p, corners[1], q], [r, q, corners[2]], [q, r, p]];
        let end = self.stack.len();
        let ranges = children.map(|child| self.keep(child, range.clone(), heights, tolerance));
        let full = ranges.iter().filter(|child| 8 * child.len() >= 7 * range.len()).count();
        let vain = vain + (full.max(1) as f64).log2();
        for (child, range) in children.into_iter().zip(ranges) {
            self.part(child, range, heights, tolerance, depth + 1, vain);
        }
        self.stack.truncate(end);
    }

    /// Appends to `self.stack` those of the functions in its `range` that remain on a part. Returns where they are.
    fn keep(&mut self, corners: [[f64; 2]; 3], range: Range<usize>, heights: &Heights, tolerance: f64) -> Range<usize> {
        let at = |function: u32, [u, v]: [f64; 2]| {
            let [a, b, c] = heights.get(function as usize);
            a * u + b * v + c
        };
        let centre = [
            (corners[0][0] + corners[1][0] + corners[2][0]) / 3.0,
            (corners[0][1] + corners[1][1] + corners[2][1]) / 3.0,
        ];
        // Of the functions lowest at the corners and the centre, each beats many others.
        let mut best = [(f64::INFINITY, u32::MAX); 4];
        for &function in &self.stack[range.clone()] {
            for (place, best) in [corners[0], corners[1], corners[2], centre].into_iter().zip(&mut best) {
                let value = at(function, place);
                if value < best.0 {
                    *best = (value, function);
                }
            }
        }
        let bounds = best.map(|(_, function)| corners.map(|corner| at(function, corner) + tolerance));
        let end = self.stack.len();
        for index in range {
            let function = self.stack[index];
            let values = corners.map(|corner| at(function, corner));
            if bounds.iter().all(|bound| (0..3).any(|k| values[k] <= bound[k])) {
                self.stack.push(function);
            }
        }
        end..self.stack.len()
    }

    /// Writes the functions that function `i` meets, itself first, in a fixed order; none when it is nowhere lowest.
    pub(super) fn rivals(&mut self, i: usize, rivals: &mut Vec<u32>) {
        rivals.clear();
        let parts = self.starts[i] as usize..self.starts[i + 1] as usize;
        if parts.is_empty() {
            return;
        }
        rivals.push(i as u32);
        self.seen[i] = i as u32;
        for &part in &self.parts[parts] {
            let start = if part == 0 { 0 } else { self.ends[part as usize - 1] };
            for &member in &self.members[start as usize..self.ends[part as usize] as usize] {
                if self.seen[member as usize] != i as u32 {
                    self.seen[member as usize] = i as u32;
                    rivals.push(member);
                }
            }
        }
    }
}
