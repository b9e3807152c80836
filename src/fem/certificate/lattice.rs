//! The lattice of Bernstein coefficients of a line, triangle or tetrahedron: who is whose neighbour.

use std::collections::BTreeMap;

/// Most corners of a simplex here.
const CORNERS: usize = 4;

/// A point of the lattice of one degree less: its neighbours upwards, one a corner, and their weights there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Below {
    pub(super) up: [usize; CORNERS],
    pub(super) weights: [f64; CORNERS],
}

/// The lattice of a simplex. A point stands for whole numbers a, one a corner, that add up to the degree.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    pub(super) corners: usize,
    /// In the order of the conversions to Bernstein coefficients: second number slowest.
    pub(super) points: usize,
    pub(super) below: Vec<Below>,
    /// For each edge (r, s) the rows of points parallel to it, each from the side of r to that of s.
    pub(super) edges: Vec<([usize; 2], Vec<Vec<usize>>)>,
    /// The points at the corners.
    pub(super) tips: Vec<usize>,
}

/// All `(a_1, ..)` with a sum of at most the degree, the first slowest; `a_0` is what is left.
fn numbers(corners: usize, degree: usize) -> Vec<[usize; CORNERS]> {
    let mut list = vec![[degree, 0, 0, 0]];
    for corner in 1..corners {
        list = list
            .into_iter()
            .flat_map(|numbers| {
                (0..=numbers[0]).map(move |moved| {
                    let mut next = numbers;
                    next[0] -= moved;
                    next[corner] = moved;
                    next
                })
            })
            .collect();
    }
    list
}

impl Lattice {
    /// Of degree 1 at least.
    pub(super) fn new(corners: usize, degree: usize) -> Lattice {
        let list = numbers(corners, degree);
        let places: BTreeMap<[usize; CORNERS], usize> = list
            .iter()
            .enumerate()
            .map(|(place, &numbers)| (numbers, place))
            .collect();
        let at = |numbers: [usize; CORNERS]| places[&numbers];
        let below = numbers(corners, degree - 1)
            .into_iter()
            .map(|numbers| Below {
                up: std::array::from_fn(|corner| {
                    let mut next = numbers;
                    next[corner.min(corners - 1)] += 1;
                    at(next)
                }),
                weights: numbers.map(|number| (number + 1) as f64),
            })
            .collect();
        let mut edges = Vec::new();
        for r in 0..corners {
            for s in r + 1..corners {
                let starts = list.iter().filter(|numbers| numbers[s] == 0 && numbers[r] > 0);
                let rows = starts.map(|&start| {
                    let mut row = Vec::new();
                    for step in 0..=start[r] {
                        let mut next = start;
                        next[r] -= step;
                        next[s] += step;
                        row.push(at(next));
                    }
                    row
                });
                edges.push(([r, s], rows.collect()));
            }
        }
        let tips = (0..corners).map(|corner| {
            let mut tip = [0; CORNERS];
            tip[corner] = degree;
            at(tip)
        });
        Lattice {
            corners,
            points: list.len(),
            below,
            edges,
            tips: tips.collect(),
        }
    }
}
