//! Constrained Delaunay triangulation of points in the plane, refined to a smallest angle where asked.
//!
//! Triangulation and refinement (Ruppert 1995) are the crate spade's. Constraints may be cut by further points; their
//! pieces stay edges.

use super::orient;
use crate::mesh::TriangleMesh;
use spade::{AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation};

/// Triangulates the convex hull of the points so that the constraints are edges.
///
/// # Errors
/// When points coincide, constraints cross, or the refinement does not come to an end.
pub(super) fn triangulate(
    points: Vec<[f64; 2]>,
    constraints: &[[usize; 2]],
    minimum_angle: Option<f64>,
) -> Result<TriangleMesh, String> {
    let count = points.len();
    let places = points.into_iter().map(|[x, y]| Point2::new(x, y)).collect();
    let mut crossing = None;
    let mut triangulation: ConstrainedDelaunayTriangulation<Point2<f64>> =
        ConstrainedDelaunayTriangulation::try_bulk_load_cdt(places, constraints.to_vec(), |edge| crossing = Some(edge))
            .map_err(|error| format!("the points cannot be triangulated: {error}"))?;
    if triangulation.num_vertices() != count {
        return Err(format!(
            "{} of {count} points coincide with others",
            count - triangulation.num_vertices()
        ));
    }
    if let Some([a, b]) = crossing {
        return Err(format!("the boundary edge from point {a} to point {b} crosses another"));
    }
    if let Some(angle) = minimum_angle {
        let parameters = RefinementParameters::new()
            .with_angle_limit(AngleLimit::from_deg(angle))
            .with_max_additional_vertices(20 * count);
        if !triangulation.refine(parameters).refinement_complete {
            return Err(format!(
                "refinement to angles of {angle} degrees does not come to an end; take another seed"
            ));
        }
    }
    let points = triangulation
        .vertices()
        .map(|vertex| {
            let place = vertex.position();
            [place.x, place.y, 0.0]
        })
        .collect();
    let cells = triangulation
        .inner_faces()
        .map(|face| face.vertices().map(|vertex| vertex.index() as u32))
        .collect();
    let mut mesh = TriangleMesh { points, cells };
    orient(&mut mesh);
    Ok(mesh)
}
