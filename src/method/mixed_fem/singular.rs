//! Configurations that make system (15) singular, found before anything is factorized.
//!
//! A boundary row of (15) with a lumped mass holds only unknowns `u` of the first inner ring. Two boundary vertices whose
//! only free neighbour is the same vertex give two equations for one unknown (Proposition 2; its print says `I_1`, meant
//! are the boundary vertices `I_0`). More generally the boundary rows must match distinct vertices of that ring: what a
//! maximum matching leaves over bounds the nullity from below.

use super::domain::{Domain, Place};

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Singular {
    /// Boundary vertices whose only free neighbour is that of an earlier one: `(earlier, later, neighbour)`.
    pub pairs: Vec<(u32, u32, u32)>,
    /// Boundary vertices, each with a row, and their free neighbours.
    pub rows: usize,
    pub ring: usize,
    /// Rows that no matching reaches, rows without any unknown included.
    pub unmatched: usize,
}

/// Looks through the boundary of a domain.
pub fn find(domain: &Domain<'_>) -> Singular {
    let vertices = domain.places.len();
    let free = |vertex: u32| domain.places[vertex as usize] == Place::Interior;
    let boundary: Vec<u32> = (0..vertices as u32)
        .filter(|&vertex| domain.places[vertex as usize] == Place::Boundary)
        .collect();
    let mut found = Singular::default();
    let mut sole: Vec<Option<u32>> = vec![None; vertices];
    let mut reached = vec![false; vertices];
    let mut partner: Vec<Option<u32>> = vec![None; vertices];
    let mut matched = 0;
    let mut visited = vec![u32::MAX; vertices];
    for &vertex in &boundary {
        let inner: Vec<u32> = domain
            .graph
            .neighbours(vertex)
            .iter()
            .copied()
            .filter(|&v| free(v))
            .collect();
        found.rows += 1;
        for &other in &inner {
            reached[other as usize] = true;
        }
        if let [only] = inner[..] {
            match sole[only as usize] {
                Some(earlier) => found.pairs.push((earlier, vertex, only)),
                None => sole[only as usize] = Some(vertex),
            }
        }
        matched += usize::from(augment(domain, vertex, vertex, &mut partner, &mut visited));
    }
    found.ring = reached.iter().filter(|&&reached| reached).count();
    found.unmatched = boundary.len() - matched;
    found
}

/// Matches `start` along an alternating path, with an explicit stack: boundaries are long.
fn augment(domain: &Domain<'_>, start: u32, round: u32, partner: &mut [Option<u32>], visited: &mut [u32]) -> bool {
    // (boundary vertex, next neighbour to try); the ring vertex taken below each entry.
    let mut stack: Vec<(u32, usize)> = vec![(start, 0)];
    let mut taken: Vec<u32> = Vec::new();
    while let Some(&(vertex, next)) = stack.last() {
        let neighbours = domain.graph.neighbours(vertex);
        let Some(&other) = neighbours.get(next) else {
            stack.pop();
            taken.pop();
            continue;
        };
        if let Some(top) = stack.last_mut() {
            top.1 += 1;
        }
        if domain.places[other as usize] != Place::Interior || visited[other as usize] == round {
            continue;
        }
        visited[other as usize] = round;
        taken.push(other);
        match partner[other as usize] {
            Some(owner) => stack.push((owner, 0)),
            None => {
                for ((vertex, _), &ring) in stack.iter().zip(&taken) {
                    partner[ring as usize] = Some(*vertex);
                }
                return true;
            }
        }
    }
    false
}
