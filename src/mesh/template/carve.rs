//! Removing cells.

use super::{centroid, within};
use crate::mesh::mixed::MixedMesh;

/// Removes the cells whose centroid lies in the box.
///
/// # Errors
/// When none does, or all do.
pub fn carve(mesh: &MixedMesh, region: [[f64; 3]; 2]) -> Result<MixedMesh, String> {
    let mut kept = MixedMesh {
        points: mesh.points.clone(),
        ..MixedMesh::default()
    };
    for (shape, corners) in mesh.iter() {
        if !within(centroid(&mesh.points, corners), region) {
            kept.push(shape, corners);
        }
    }
    let removed = mesh.cells() - kept.cells();
    if removed == 0 {
        return Err(format!(
            "no cell has its centroid between {:?} and {:?}, so there is nothing to carve; the mesh spans {:?}",
            region[0],
            region[1],
            crate::mesh::bounding_box(&mesh.points).unwrap_or_default()
        ));
    }
    if kept.cells() == 0 {
        return Err(format!("carving removes all {removed} cells; make its box smaller"));
    }
    kept.drop_unused_points();
    Ok(kept)
}
