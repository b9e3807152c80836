//! A template that follows its target: the boundary of the cubes of a grid whose centres lie within the target. It has
//! the handles that the grid resolves, which no box has.

use crate::mesh::TriangleMesh;
use crate::mesh::surface::Surface;
use crate::mesh::template::voxels::voxels;

/// Most cubes along the target's longest side.
const MOST: usize = 160;

/// The boundary with as near as can be to `quads` quadrilaterals, oriented outward, in the target's units.
///
/// # Errors
/// When no cube's centre lies within the target, as in one that is open or thinner than the cubes.
pub fn template(target: &TriangleMesh, quads: usize) -> Result<Surface, String> {
    let mut best: Option<(usize, Surface)> = None;
    let mut last = String::new();
    let (mut low, mut high) = (1, MOST + 1);
    // The number of faces grows with the number of cubes along a side, all but always.
    while high - low > 1 {
        let along = (low + high) / 2;
        match boundary(target, along) {
            Ok(surface) => {
                let off = surface.faces().abs_diff(quads);
                if surface.faces() < quads {
                    low = along;
                } else {
                    high = along;
                }
                if best.as_ref().is_none_or(|(least, _)| off < *least) {
                    best = Some((off, surface));
                }
            }
            Err(message) => {
                // Cubes too large to find anything within.
                low = along;
                last = message;
            }
        }
    }
    best.map(|(_, surface)| surface).ok_or(last)
}

fn boundary(target: &TriangleMesh, along: usize) -> Result<Surface, String> {
    let cubes = voxels(target, along)?;
    let topology = cubes.topology()?;
    let mut surface = Surface {
        quads: topology.boundary().map(|(_, face)| face.corners).collect(),
        triangles: Vec::new(),
        points: cubes.points,
    };
    surface.drop_unused();
    if surface.triangulated().enclosed_volume() < 0.0 {
        for quad in &mut surface.quads {
            quad.reverse();
        }
    }
    Ok(surface)
}
