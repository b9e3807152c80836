//! Where to raise the order: the energy's slope by functions that are not there yet.
//!
//! All orders are raised by one without moving anything; then `eta_e = 1/2 sum |g_i|^2 / d_i` over the new functions of an
//! element, with the gradient g of the whole energy and the diagonal d of the model Hessian, predicts how much the energy
//! would fall. A function shared by several elements counts in equal parts.

use super::fit::Fit;
use super::settings::Adaptive;
use super::surface_energy::SurfaceEnergy;
use super::{invalid, quality};
use crate::fem::boundary::Boundary;
use crate::fem::space::Space;
use crate::method::Failure;
use crate::method::volume_fit::preconditioner::{Model, diagonal};

/// Orders with those raised whose elements promise the given share of the fall; nothing when no order can be raised.
pub(super) fn raised(fit: &Fit<'_>, adaptive: &Adaptive) -> Result<Option<Vec<usize>>, Failure> {
    let settings = fit.settings;
    let orders = &fit.space.orders;
    let up: Vec<usize> = orders.iter().map(|&order| (order + 1).min(adaptive.most)).collect();
    if up == *orders {
        return Ok(None);
    }
    let space = Space::new(&fit.volume, &fit.topology, settings.basis, &up).map_err(invalid)?;
    let x = fit.space.transfer(&fit.x, &space);
    let mut old = vec![false; space.nodes];
    for node in fit.space.counterparts(&space).into_iter().flatten() {
        old[node as usize] = true;
    }
    let highest = up.iter().copied().max().unwrap_or(1);
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
    let boundary = Boundary::new(&fit.volume, &fit.topology, &space, fit.intervals(highest));
    let mut samples = Vec::new();
    boundary.positions(&x, &mut samples);
    let mut factor = 0.0;
    if settings.terms.to_target || settings.terms.from_target {
        let mut surface = SurfaceEnergy::new(
            &samples,
            &boundary.triangles,
            &fit.target,
            settings.terms,
            settings.anisotropy,
            fit.scale,
        )
        .map_err(invalid)?;
        let mut forces = vec![[0.0; 3]; samples.len()];
        surface.gradient(&samples, &mut forces);
        boundary.add_gradient(&forces, &mut gradient);
        factor = surface.factor();
    }
    let diagonal = diagonal(&Model {
        mesh: &fit.volume,
        topology: &fit.topology,
        space: &space,
        boundary: &boundary,
        samples: &samples,
        lambda: fit.lambda,
        size: fit.size,
        volume: fit.reference_volume,
        surface: factor,
        anisotropy: settings.anisotropy,
    });
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
    let energy = fit.last.surface + fit.lambda * fit.last.volume;
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
