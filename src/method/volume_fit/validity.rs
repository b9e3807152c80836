//! Certificates of all elements: proofs that determinants are positive everywhere, not only at samples.

use crate::fem::certificate::{Certifier, Verdict};
use crate::fem::space::Space;
use crate::linalg::vector3::Columns;
use crate::optimize::Observer;
use rayon::prelude::*;

/// Certificates of all elements.
#[derive(Clone, Debug)]
pub struct Certificates {
    /// Nothing where the observer asked to stop before the element was judged.
    pub verdicts: Vec<Option<Verdict>>,
}

/// Parts that an element is cut into at most.
const MOST_PARTS: usize = 4000;

/// Elements judged before the observer is asked again.
const CHUNK: usize = 16;

impl Certificates {
    /// Proves that determinants are positive everywhere, element by element.
    pub fn of_all(space: &Space, references: &[Columns<f64>], x: &[f64], observer: &dyn Observer) -> Certificates {
        let cells: Vec<usize> = (0..space.cells.len()).collect();
        let mut result = Certificates {
            verdicts: vec![None; cells.len()],
        };
        result.renew(&cells, space, references, x, observer);
        result
    }

    /// Judges some elements again, whose nodes have moved.
    pub fn renew(
        &mut self,
        cells: &[usize],
        space: &Space,
        references: &[Columns<f64>],
        x: &[f64],
        observer: &dyn Observer,
    ) {
        for &cell in cells {
            self.verdicts[cell] = None;
        }
        let kinds = cells.iter().map(|&cell| space.cells[cell].kind);
        let certifier = Certifier::new(space.basis, kinds, MOST_PARTS);
        for chunk in cells.chunks(CHUNK) {
            if observer.stop().is_some() {
                return;
            }
            let verdicts: Vec<Verdict> = chunk
                .par_iter()
                .map(|&cell| certifier.judge(space, cell, &references[cell], x))
                .collect();
            for (&cell, verdict) in chunk.iter().zip(verdicts) {
                self.verdicts[cell] = Some(verdict);
            }
        }
    }

    /// Whether a point with a determinant that is not positive is known in an element.
    pub fn fails(&self, cell: usize) -> bool {
        matches!(self.verdicts[cell], Some(Verdict::Negative(..)))
    }

    /// Those elements.
    pub fn failing(&self) -> Vec<usize> {
        (0..self.verdicts.len()).filter(|&cell| self.fails(cell)).collect()
    }

    /// Numbers of elements that are certified, that fail, and that are neither.
    pub fn counts(&self) -> [usize; 3] {
        let mut counts = [0; 3];
        for verdict in &self.verdicts {
            counts[match verdict {
                Some(Verdict::Positive(_)) => 0,
                Some(Verdict::Negative(..)) => 1,
                Some(Verdict::Undecided(_)) | None => 2,
            }] += 1;
        }
        counts
    }

    /// Least proven bound of the determinant over the certified elements; not-a-number without any.
    pub fn bound(&self) -> f64 {
        let proven = self.verdicts.iter().filter_map(|verdict| match verdict {
            Some(Verdict::Positive(bound)) => Some(*bound),
            _ => None,
        });
        proven.fold(f64::NAN, f64::min)
    }

    /// What is to be told of elements that are not certified.
    pub fn notices(&self) -> Vec<String> {
        let mut notices = Vec::new();
        if self.verdicts.contains(&None) {
            notices.push("stopped from outside before every element was judged".to_string());
        }
        let open = self.verdicts.iter().filter_map(|verdict| match verdict {
            Some(Verdict::Undecided(bound)) => Some(*bound),
            _ => None,
        });
        if let Some(bound) = open.reduce(f64::min) {
            notices.push(format!(
                "elements stay undecided after as many cuts as they may take: no point of theirs with a determinant below \
                 rounding was found, and a proof only that it is at least {bound:.3e}"
            ));
        }
        let first = self
            .verdicts
            .iter()
            .enumerate()
            .find_map(|(cell, verdict)| match verdict {
                Some(Verdict::Negative(point, value)) => Some((cell, point, value)),
                _ => None,
            });
        if let Some((cell, point, value)) = first {
            notices.push(format!(
                "{} elements are not valid everywhere; the first is element {cell}, whose determinant is {value:.3e} at \
                 {point:.4?} in its canonical coordinates",
                self.counts()[1]
            ));
        }
        notices
    }
}
