//! Subdivision volumes: the control points of multi-linear averaging are the unknowns, the mesh of the next level
//! carries the energy (Jin et al. 2013, section 4.3).
//!
//! Level by level: the control mesh is subdivided once, its points are optimized through that map, and the subdivided
//! mesh becomes the control mesh of the next level. Creases and corners of the template stay creases and corners.

use super::chart::Chart;
use super::fit::{Fit, interrupted};
use super::settings::Stage;
use crate::fem::batches::references_of_volume;
use crate::fem::space::Space;
use crate::mesh::multilinear_averaging::{features, subdivide};
use crate::method::Failure;
use crate::optimize::{Observer, StopReason};

/// Hexahedra of the last level at most.
const MOST_CELLS: usize = 2_000_000;

/// Fits all levels; ends with the volume of the last one.
pub(super) fn run(
    fit: &mut Fit<'_>,
    levels: usize,
    observer: &mut dyn Observer,
) -> Result<(StopReason, String), Failure> {
    let mut tagged = features(&fit.volume, &fit.topology, fit.settings.crease_angle);
    fit.notices.push(format!(
        "the template has {} creases and {} corners, which the subdivision keeps",
        tagged.creases.len(),
        tagged.corners.len()
    ));
    let cells = fit.volume.iter().map(|(shape, _)| shape.corners()).sum::<usize>() << (3 * (levels - 1));
    if cells > MOST_CELLS {
        return Err(Failure::invalid(format!(
            "{levels} levels of this template have {cells} hexahedra, more than {MOST_CELLS}; lower subdivision_levels"
        )));
    }
    // Where the template was untangled, as that left it.
    place_vertices(fit);
    let mut outcome = (StopReason::Converged, String::new());
    for level in 0..levels {
        let subdivided = subdivide(&fit.volume, &tagged).map_err(Failure::invalid)?;
        let mut control = fit.volume.points.as_flattened().to_vec();
        fit.volume = subdivided.mesh;
        fit.topology = fit.volume.topology().map_err(Failure::invalid)?;
        fit.references = references_of_volume(fit.volume.iter().map(|cell| cell.0), fit.reference_volume);
        let orders = vec![1; fit.volume.cells()];
        fit.space = Space::new(&fit.volume, &fit.topology, fit.settings.basis, &orders).map_err(Failure::invalid)?;
        fit.x = fit.space.linear(&fit.volume.points);
        tagged = subdivided.features;
        let chart = Chart::linear(subdivided.map);
        // The far phase is for the first level.
        let stages: Vec<Stage> = match fit.settings.stages.last() {
            Some(&last) if level > 0 => vec![last],
            _ => fit.settings.stages.clone(),
        };
        for stage in stages {
            outcome = fit.stage_over(&stage, Some((&chart, &mut control)), observer)?;
            if interrupted(outcome.0) {
                return Ok(outcome);
            }
        }
        place_vertices(fit);
    }
    Ok(outcome)
}

/// Moves the mesh's vertices to their nodes.
fn place_vertices(fit: &mut Fit<'_>) {
    for (point, place) in fit.volume.points.iter_mut().zip(fit.x.as_chunks::<3>().0) {
        *point = *place;
    }
}
