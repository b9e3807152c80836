//! Patches that fold, and tangents found anew around them.
//!
//! A patch folds where curves meet their conditions only with long slopes of their normals: then the slopes across its
//! sides turn over. Around such patches tangents and slopes are [balanced](super::balance) together, everything
//! farther away stays as it is; each try takes one ring of patches more, and the last one the whole surface, from the
//! natural cubics. A try is kept when fewer patches fold than before.

use super::balance;
use super::construction::MET;
use super::edge_normals::Slopes;
use super::evaluation::Evaluated;
use super::network::Network;
use super::outcome::Folding;
use super::patch::Fitted;
use crate::optimize::Observer;
use rayon::prelude::*;

/// What [`repair`] did.
#[derive(Clone, Debug, Default)]
pub struct Repaired {
    /// Times that tangents were found anew.
    pub tries: u64,
    /// Longest change of a tangent from the natural cubic, relative to its length.
    pub change: f64,
    /// Whether a try was kept; then all conditions on tangents and normals are met.
    pub kept: bool,
    pub notice: Option<String>,
}

/// Times that tangents are found anew around folds, each within a wider neighbourhood, before the whole surface is
/// balanced.
const LOCAL: u64 = 4;

/// Repairs the patches that fold. `fit` makes patches from a network and slopes.
pub fn repair(
    network: &mut Network,
    slopes: &mut Slopes,
    fitted: &mut Vec<Fitted>,
    natural: &[[[f64; 3]; 2]],
    stiffness: f64,
    fit: &dyn Fn(&Network, &Slopes) -> Vec<Fitted>,
    observer: &mut dyn Observer,
) -> Repaired {
    let mut done = Repaired::default();
    let mut folded = folded_patches(network, fitted);
    while folded.contains(&true) && done.tries <= LOCAL && observer.stop().is_none() {
        observer.phase("repair");
        done.tries += 1;
        let count = |folded: &[bool]| folded.iter().filter(|&&folded| folded).count();
        let before = count(&folded);
        let mut changed = network.clone();
        let start = if done.tries <= LOCAL {
            Some(balance::Start {
                slopes,
                active: around(network, folded.clone(), done.tries),
                natural: natural.to_vec(),
            })
        } else {
            changed.tangents = natural.to_vec();
            None
        };
        let found = match balance::balance(&mut changed, stiffness, start, observer) {
            Ok(found) => found,
            Err(error) => {
                done.notice = Some(format!("repair {} failed: {error}", done.tries));
                continue;
            }
        };
        if !(found.residual < MET) {
            continue;
        }
        let tried = fit(&changed, &found.slopes);
        let still = folded_patches(&changed, &tried);
        if count(&still) < before {
            (*network, *slopes, *fitted, folded) = (changed, found.slopes, tried, still);
            done.change = done.change.max(found.largest_change);
            done.kept = true;
        }
    }
    if let Some(first) = folded.iter().position(|&folded| folded) {
        let count = folded.iter().filter(|&&folded| folded).count();
        let failure = done.notice.map_or(String::new(), |failure| format!("; {failure}"));
        done.notice = Some(format!(
            "{count} patches still fold after {} repairs, the first is patch {first} (from 0){failure}",
            done.tries
        ));
    }
    done
}

fn folded_patches(network: &Network, fitted: &[Fitted]) -> Vec<bool> {
    let folding = Folding::default();
    fitted
        .par_iter()
        .zip(&network.quads)
        .map_init(Evaluated::default, |evaluated, (fitted, quad)| {
            let corners = quad.map(|vertex| network.normals[vertex as usize]);
            folding.folds(&fitted.patch, corners, evaluated)
        })
        .collect()
}

/// The edges of the marked patches and of those within so many rings of them.
fn around(network: &Network, mut marked: Vec<bool>, rings: u64) -> Vec<bool> {
    for _ in 0..rings {
        let mut at = vec![false; network.points.len()];
        for (quad, _) in network.quads.iter().zip(&marked).filter(|(_, marked)| **marked) {
            for &vertex in quad {
                at[vertex as usize] = true;
            }
        }
        for (quad, mark) in network.quads.iter().zip(&mut marked) {
            *mark |= quad.iter().any(|&vertex| at[vertex as usize]);
        }
    }
    let mut edges = vec![false; network.tangents.len()];
    let sides = network.connectivity.quad_edges.iter().zip(&marked);
    for (sides, _) in sides.filter(|(_, marked)| **marked) {
        for &edge in sides {
            edges[edge as usize] = true;
        }
    }
    edges
}
