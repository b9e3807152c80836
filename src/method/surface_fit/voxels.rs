//! A template that follows its target: the boundary of the cubes of a grid whose centres lie within the target. It has
//! the handles that the grid resolves, which no box has.

use crate::mesh::TriangleMesh;
use crate::mesh::mixed::MixedMesh;
use crate::mesh::surface::Surface;
use crate::mesh::template::voxels::{matching, voxels};

/// Most cubes along the target's longest side.
const MOST: usize = 160;

/// Grids that are one or two cubes along the longest side finer or coarser are tried where holes or pieces differ,
const NEIGHBOURS: usize = 2;
/// when their numbers of quadrilaterals differ by less than this share.
const NEARLY: f64 = 0.1;

/// The boundary with as near as can be to `quads` quadrilaterals, oriented outward, in the target's units. Of a closed
/// target's holes and pieces it has as many as the target where a grid nearly as fine as asked for does.
///
/// # Errors
/// When no cube's centre lies within the target, as in one that is open or thinner than the cubes.
pub fn template(target: &TriangleMesh, quads: usize) -> Result<Surface, String> {
    let mut best: Option<(usize, usize)> = None;
    let mut last = String::new();
    let (mut low, mut high) = (1, MOST + 1);
    // The number of faces grows with the number of cubes along a side, all but always.
    while high - low > 1 {
        let along = (low + high) / 2;
        match voxels(target, along).and_then(|cubes| boundary(&cubes)) {
            Ok(surface) => {
                let off = surface.faces().abs_diff(quads);
                if surface.faces() < quads {
                    low = along;
                } else {
                    high = along;
                }
                if best.as_ref().is_none_or(|(least, _)| off < *least) {
                    best = Some((off, along));
                }
            }
            Err(message) => {
                // Cubes too large to find anything within.
                low = along;
                last = message;
            }
        }
    }
    let (_, along) = best.ok_or(last)?;
    let (cubes, mut least) = matching(target, along)?;
    let mut surface = boundary(&cubes)?;
    let wanted = surface.faces();
    for step in 1..=NEIGHBOURS {
        for next in [along.saturating_sub(step), along + step] {
            if least == 0 || next == 0 || next > MOST {
                continue;
            }
            // Grids that are too coarse to hold anything are none to choose.
            let Ok((cubes, difference)) = matching(target, next) else {
                continue;
            };
            let candidate = boundary(&cubes)?;
            let is_near = candidate.faces().abs_diff(wanted) as f64 <= NEARLY * wanted as f64;
            if difference < least && is_near {
                (surface, least) = (candidate, difference);
            }
        }
    }
    Ok(surface)
}

fn boundary(cubes: &MixedMesh) -> Result<Surface, String> {
    let topology = cubes.topology()?;
    let mut surface = Surface {
        quads: topology.boundary().map(|(_, face)| face.corners).collect(),
        triangles: Vec::new(),
        points: cubes.points.clone(),
    };
    surface.drop_unused();
    if surface.triangulated().enclosed_volume() < 0.0 {
        for quad in &mut surface.quads {
            quad.reverse();
        }
    }
    Ok(surface)
}
