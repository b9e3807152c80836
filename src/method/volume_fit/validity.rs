//! Certificates of all elements: proofs that determinants are positive everywhere, not only at samples.

use crate::fem::certificate::{Certifier, Verdict};
use crate::fem::space::Space;
use crate::linalg::vector3::Columns;
use crate::optimize::Observer;
use rayon::prelude::*;

/// What is known of an element's validity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    Certified,
    Fails,
    Undecided,
}

/// Certificates of all elements.
#[derive(Clone, Debug)]
pub struct Certificates {
    pub verdicts: Vec<Judged>,
    /// Least proven bound of the determinant over the certified elements.
    pub bound: f64,
    pub notices: Vec<String>,
}

/// Parts that an element is cut into at most.
const MOST_PARTS: usize = 4000;

/// Elements judged before the observer is asked again.
const CHUNK: usize = 16;

/// Proves that determinants are positive everywhere, element by element.
pub fn certify(space: &Space, references: &[Columns<f64>], x: &[f64], observer: &dyn Observer) -> Certificates {
    let cells = space.cells.len();
    let kinds = space.cells.iter().map(|cell| cell.kind);
    let certifier = Certifier::new(space.basis, kinds, MOST_PARTS);
    let mut result = Certificates {
        verdicts: Vec::with_capacity(cells),
        bound: f64::NAN,
        notices: Vec::new(),
    };
    let mut first: Option<(usize, [f64; 3], f64)> = None;
    let mut open: Option<f64> = None;
    while result.verdicts.len() < cells {
        if observer.stop().is_some() {
            result.verdicts.resize(cells, Judged::Undecided);
            result
                .notices
                .push("stopped from outside before every element was judged".to_string());
            break;
        }
        let start = result.verdicts.len();
        let verdicts: Vec<Verdict> = (start..(start + CHUNK).min(cells))
            .into_par_iter()
            .map(|cell| certifier.judge(space, cell, &references[cell], x))
            .collect();
        for (offset, verdict) in verdicts.into_iter().enumerate() {
            result.verdicts.push(match verdict {
                Verdict::Positive(bound) => {
                    result.bound = result.bound.min(bound);
                    Judged::Certified
                }
                Verdict::Negative(point, value) => {
                    first.get_or_insert((start + offset, point, value));
                    Judged::Fails
                }
                Verdict::Undecided(bound) => {
                    open = Some(open.map_or(bound, |other: f64| other.min(bound)));
                    Judged::Undecided
                }
            });
        }
    }
    if let Some(bound) = open {
        result.notices.push(format!(
            "elements stay undecided after as many cuts as they may take: no point of theirs with a determinant below 0 was \
             found, and a proof only that it is at least {bound:.3e}"
        ));
    }
    if let Some((cell, point, value)) = first {
        let count = result
            .verdicts
            .iter()
            .filter(|verdict| **verdict == Judged::Fails)
            .count();
        result.notices.push(format!(
            "{count} elements are not valid everywhere; the first is element {cell}, whose determinant is {value:.3e} at \
             {point:.4?} in its canonical coordinates"
        ));
    }
    result
}
