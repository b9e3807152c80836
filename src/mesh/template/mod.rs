//! Templates for volumes: grids, voxels and squares swept along paths, and the operations that turn them into something
//! close to a shape.
//!
//! The operations are those that Jin et al. 2013 made their templates with by hand (section 4.1): carving, extrusion,
//! pillowing and edge collapse. Every one leaves a mesh that [`MixedMesh::topology`](super::mixed::MixedMesh::topology)
//! accepts, or says why it cannot.

pub mod grid;
pub mod voxels;
pub mod carve;
pub mod collapse;
pub mod extrude;
pub mod pillow;
pub mod sweep;

/// Most cells of a template.
pub const MOST_CELLS: usize = 4_000_000;

/// Before memory is taken: whether a template may have so many cells.
///
/// # Errors
/// With more than [`MOST_CELLS`]; `mend` tells what lowers them.
pub fn check_count(cells: usize, mend: &str) -> Result<(), String> {
    if cells > MOST_CELLS {
        return Err(format!("that makes {cells} cells, more than {MOST_CELLS}; {mend}"));
    }
    Ok(())
}

/// Whether a point lies in a box with faces included.
fn within(point: [f64; 3], [low, high]: [[f64; 3]; 2]) -> bool {
    (0..3).all(|axis| low[axis] <= point[axis] && point[axis] <= high[axis])
}

/// The mean of some points.
fn centroid(points: &[[f64; 3]], corners: &[u32]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for &corner in corners {
        for axis in 0..3 {
            sum[axis] += points[corner as usize][axis];
        }
    }
    sum.map(|coordinate| coordinate / corners.len() as f64)
}
