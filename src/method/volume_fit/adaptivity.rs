//! Where to raise the order: where the boundary is farthest from the target, or where the energy promises to fall.
//!
//! By distance, the default: an element counts as far as the farthest of its boundary's samples is from the target, or
//! the farthest of the target's vertices whose nearest point lies on it. Those beyond a share of the largest are
//! raised. By energy: all orders are raised by one without moving anything; then `eta_e = 1/2 sum |g_i|^2 / d_i` over
//! the new functions of an element, with the gradient g of the whole energy and the diagonal d of the model Hessian,
//! predicts how much the energy would fall. A function shared by several elements counts in equal parts. The energy is
//! a mean over the surface, so that this indicator leaves small places with a large distance alone.

use super::distances::fine_intervals;
use super::fit::Fit;
use super::quality;
use super::settings::{Adaptive, Indicator};
use crate::fem::boundary::Boundary;
use crate::fem::space::Space;
use crate::geometry::closest_point::{ClosestPoint, Nearest};
use crate::mesh::TriangleMesh;
use crate::method::Failure;
use crate::method::volume_fit::preconditioner::{Model, diagonal};
use rayon::prelude::*;

/// Orders with those raised that the indicator chooses; nothing when no order can be raised.
/// `history` is what the steps before had to show.
pub(super) fn raised(
    fit: &Fit<'_>,
    adaptive: &Adaptive,
    history: &mut Vec<f64>,
) -> Result<Option<Vec<usize>>, Failure> {
    match adaptive.indicator {
        Indicator::Distance => Ok(raised_by_distance(fit, adaptive, history)),
        Indicator::Energy => raised_by_energy(fit, adaptive),
    }
}

/// Raising is in vain when the largest distance is not below this share of what it was so many steps before.
const WORTHWHILE: f64 = 0.97;
const PATIENCE: usize = 3;

fn raised_by_distance(fit: &Fit<'_>, adaptive: &Adaptive, history: &mut Vec<f64>) -> Option<Vec<usize>> {
    let orders = &fit.space.orders;
    let intervals = fine_intervals(fit.space.highest_order());
    let boundary = Boundary::new(&fit.volume, &fit.topology, &fit.space, intervals);
    let mut samples = Vec::new();
    boundary.positions(&fit.x, &mut samples);
    let owners: Vec<usize> = fit
        .topology
        .boundary()
        .map(|(_, face)| face.cells[0] as usize)
        .collect();
    let mut far = vec![0.0_f64; orders.len()];
    let mut count = |triangle: u32, square: f64| {
        let cell = owners[boundary.patch_of[triangle as usize] as usize];
        far[cell] = far[cell].max(square.sqrt());
    };
    let nearest = |points: &[[f64; 3]], surface: &ClosestPoint| -> Vec<Nearest> {
        points.par_iter().map(|&point| surface.nearest(point, None)).collect()
    };
    let target = &fit.target.surface;
    if !target.cells.is_empty() {
        let found = nearest(&samples, &ClosestPoint::new(target));
        for (triangle, corners) in boundary.triangles.iter().enumerate() {
            for &corner in corners {
                count(triangle as u32, found[corner as usize].squared_distance);
            }
        }
    }
    let fitted = TriangleMesh {
        points: samples,
        cells: boundary.triangles.clone(),
    };
    let points = if target.cells.is_empty() {
        &fit.target.sites
    } else {
        &target.points
    };
    for found in nearest(points, &ClosestPoint::new(&fitted)) {
        count(found.triangle, found.squared_distance);
    }
    let most = orders
        .iter()
        .zip(&far)
        .filter(|(order, _)| **order < adaptive.most)
        .fold(0.0_f64, |most, (_, &far)| most.max(far));
    // What the volume energy holds back no order brings nearer.
    let before = history.len().checked_sub(PATIENCE).map(|place| history[place]);
    history.push(far.iter().copied().fold(0.0, f64::max));
    if let (Some(before), Some(&now)) = (before, history.last())
        && now > WORTHWHILE * before
    {
        return None;
    }
    let chosen = |(&order, &far): (&usize, &f64)| {
        if order < adaptive.most && far > 0.0 && far >= (1.0 - adaptive.share) * most {
            order + 1
        } else {
            order
        }
    };
    let mut result: Vec<usize> = orders.iter().zip(&far).map(chosen).collect();
    smooth(fit, &mut result);
    (result != *orders).then_some(result)
}

/// Raises those that together promise the given share of the fall.
fn raised_by_energy(fit: &Fit<'_>, adaptive: &Adaptive) -> Result<Option<Vec<usize>>, Failure> {
    let settings = fit.settings;
    let orders = &fit.space.orders;
    let up: Vec<usize> = orders.iter().map(|&order| (order + 1).min(adaptive.most)).collect();
    if up == *orders {
        return Ok(None);
    }
    let space = Space::new(&fit.volume, &fit.topology, settings.basis, &up).map_err(Failure::invalid)?;
    let x = fit.space.transfer(&fit.x, &space);
    let mut old = vec![false; space.nodes];
    for node in fit.space.counterparts(&space).into_iter().flatten() {
        old[node as usize] = true;
    }
    let volume = fit.volume_energy(&space)?;
    let mut gradient = vec![0.0; x.len()];
    if !volume.add_gradient(&x, fit.lambda, &mut gradient).value.is_finite() {
        // The finer quadrature found an inversion between the points of the coarser one: those elements need their new
        // functions most, and the next stage untangles them with these.
        let quality = quality::quality(&space, &fit.references, &x)?;
        let failing = |cell: usize| !(quality.least_determinant[cell] > 0.0);
        let any = (0..orders.len()).any(failing);
        let raised = (0..orders.len()).map(|cell| if failing(cell) || !any { up[cell] } else { orders[cell] });
        let mut result: Vec<usize> = raised.collect();
        smooth(fit, &mut result);
        return Ok((result != *orders).then_some(result));
    }
    let boundary = fit.boundary(&space);
    let mut samples = Vec::new();
    boundary.positions(&x, &mut samples);
    if let Some(mut surface) = fit.surface_energy(&boundary, &samples)? {
        let mut forces = vec![[0.0; 3]; samples.len()];
        surface.gradient(&samples, &mut forces);
        boundary.add_gradient(&forces, &mut gradient);
    }
    let diagonal = diagonal(&Model {
        mesh: &fit.volume,
        topology: &fit.topology,
        space: &space,
        boundary: &boundary,
        samples: &samples,
        lambda: fit.lambda,
        x: &x,
        references: &fit.references,
        volume: fit.reference_volume,
        surface: fit.surface_factor(),
        anisotropy: settings.anisotropy,
    })
    .map_err(Failure::invalid)?;
    let mut sharers = vec![0.0; space.nodes];
    for cell in &space.cells {
        for (node, _) in cell.slots.iter().filter_map(|slot| slot.node()) {
            sharers[node] += 1.0;
        }
    }
    let mut indicators: Vec<(f64, usize)> = space
        .cells
        .iter()
        .enumerate()
        .map(|(cell, slots)| {
            let nodes = slots.slots.iter().filter_map(|slot| slot.node()).map(|(node, _)| node);
            let sum: f64 = nodes
                .filter(|&node| !old[node])
                .map(|node| {
                    let square: f64 = gradient[3 * node..3 * node + 3].iter().map(|g| g * g).sum();
                    0.5 * square / diagonal[node] / sharers[node]
                })
                .sum();
            (sum, cell)
        })
        .collect();
    let total: f64 = indicators.iter().map(|entry| entry.0).sum();
    let energy = fit.last.total(fit.lambda);
    if !(total > 1e-6 * energy) {
        return Ok(None);
    }
    indicators.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut result = orders.clone();
    let mut sum = 0.0;
    for (indicator, cell) in indicators {
        if sum >= adaptive.share * total {
            break;
        }
        sum += indicator;
        result[cell] = up[cell];
    }
    smooth(fit, &mut result);
    Ok((result != *orders).then_some(result))
}

/// Raises orders until no two neighbours differ by more than two: more would waste functions on their shared face.
fn smooth(fit: &Fit<'_>, result: &mut [usize]) {
    loop {
        let mut changed = false;
        for face in &fit.topology.faces {
            if !face.on_boundary() {
                let [a, b] = face.cells.map(|cell| cell as usize);
                for (low, high) in [(a, b), (b, a)] {
                    if result[low] + 2 < result[high] {
                        result[low] = result[high] - 2;
                        changed = true;
                    }
                }
            }
        }
        if !changed {
            break;
        }
    }
}
