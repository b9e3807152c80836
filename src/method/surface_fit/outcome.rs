//! What is reported of a fit: its metrics, and both surfaces side by side with fields to colour them by.

use super::objective::Parts;
use super::problem::Problem;
use super::sampling::Samples;
use super::settings::{Settings, Stage};
use crate::geometry::closest_point::ClosestPoint;
use crate::geometry::point_tree::PointTree;
use crate::geometry::squared_distance::{Options, SquaredDistance, Wanted};
use crate::mesh::format::{Cells, vtu};
use crate::mesh::surface::Surface;
use crate::mesh::{self, TriangleMesh};
use crate::method::Failure;
use crate::metric::crease::crease_distance;
use crate::metric::distance::{self, Distance, Hausdorff};
use std::collections::BTreeMap;

/// Points of a cloud farther than this share of the diagonal are missed.
const FAR: f64 = 0.02;
/// A fit that is worse than this share of the diagonal is called poor.
const POOR: f64 = 0.03;

/// See the module.
pub struct Measured {
    pub metrics: BTreeMap<String, f64>,
    pub mesh: Vec<u8>,
    pub notices: Vec<String>,
}

/// Measures a fitted mesh in the solver's units, unless `stop` says to give up.
pub fn measure(
    problem: &Problem,
    settings: &Settings,
    samples: &Samples,
    fitted: &Surface,
    parts: Parts,
    stage: Stage,
    stop: &dyn Fn() -> bool,
) -> Result<Measured, Failure> {
    let failure = |message: String| Failure {
        kind: "not-finite".to_string(),
        reason: message,
    };
    let target = &problem.target;
    let triangulated = fitted.triangulated();
    let no_surface = target.cells.is_empty();
    let hausdorff = if no_surface {
        to_points(&triangulated, &target.points)
    } else {
        distance::hausdorff(&triangulated, target, stop).map_err(failure)?
    };
    let mut metrics = BTreeMap::new();
    let mut set = |name: &str, value: f64| {
        metrics.insert(name.to_string(), value);
    };
    let Hausdorff { forward, backward, .. } = &hausdorff;
    set("hausdorff", hausdorff.percent(hausdorff.max()));
    set("hausdorff_fit_to_target", hausdorff.percent(forward.max));
    set("hausdorff_target_to_fit", hausdorff.percent(backward.max));
    set("distance_mean", hausdorff.percent(forward.mean.max(backward.mean)));
    set("distance_rms", hausdorff.percent(forward.rms.max(backward.rms)));
    set("spurious_area", 100.0 * forward.far);
    set("missed_area", 100.0 * backward.far);
    let crease = crease_distance(target, &triangulated, settings.feature_angle);
    let crease = crease.map_or([f64::NAN; 2], |crease| [crease.max, crease.mean]);
    set("crease_distance", hausdorff.percent(crease[0]));
    set("crease_distance_mean", hausdorff.percent(crease[1]));

    let jacobians = fitted.scaled_jacobians();
    set(
        "scaled_jacobian_min",
        jacobians.iter().copied().fold(f64::INFINITY, f64::min),
    );
    let folded = jacobians.iter().filter(|&&jacobian| !(jacobian > 0.0)).count();
    set("folded_faces", folded as f64);
    set(
        "scaled_jacobian_mean",
        jacobians.iter().sum::<f64>() / jacobians.len() as f64,
    );
    let unless = |there: bool, value: f64| if there { value } else { f64::NAN };
    set("target_to_fit", unless(settings.terms.from_target(), parts.from_target));
    set("fit_to_target", unless(settings.terms.to_target(), parts.to_target));
    set("regularizer", parts.regularizer);
    set("unevenness", parts.unevenness);
    set(
        "energy",
        parts.from_target
            + parts.to_target
            + stage.regularization * parts.regularizer
            + stage.evenness * parts.unevenness
            + stage.unfolding * parts.folding,
    );
    let area = triangulated.area();
    set(
        "approximation_error",
        if problem.cloud.is_some() {
            f64::NAN
        } else {
            isotropic(&triangulated, samples)? / area - forward.rms.powi(2)
        },
    );
    set(
        "sample_spacing",
        if no_surface {
            f64::NAN
        } else {
            (target.area() / samples.points.len() as f64).sqrt() / hausdorff.diagonal
        },
    );
    set("samples", samples.points.len() as f64);
    set("vertices", fitted.points.len() as f64);
    set("faces", fitted.faces() as f64);
    set("target_triangles", target.cells.len() as f64);
    let as_surface = Surface {
        points: target.points.clone(),
        triangles: target.cells.clone(),
        quads: Vec::new(),
    };
    let (target_euler, closed) = euler(&as_surface);
    let (template_euler, _) = euler(&problem.template);
    set("target_euler", if no_surface { f64::NAN } else { target_euler as f64 });
    set("template_euler", template_euler as f64);

    let mut notices = Vec::new();
    if let Some(first) = jacobians.iter().position(|&jacobian| !(jacobian > 0.0)) {
        let [x, y, z] = problem.to_given_units(&[fitted.centre(first)])[0];
        notices.push(format!(
            "{folded} of {} faces are folded (scaled Jacobian 0 or less), the first at ({x:.4}, {y:.4}, {z:.4}); a larger \
             `unfolding` or `evenness` may unfold them at some cost of distance, or more faces or another template",
            jacobians.len()
        ));
    }
    if problem.near && !closed {
        notices.push("the target is open: voxels wrap it as if it were closed, and the fit cuts its rim".to_string());
    }
    if closed && !no_surface && target_euler != template_euler {
        notices.push(format!(
            "the closed target has the Euler characteristic {target_euler}, the template {template_euler}: no template of \
             this connectivity can match it everywhere{}",
            if problem.near {
                "; larger `quads` of the voxels resolve more of its holes"
            } else {
                ""
            }
        ));
    }
    // Between the points of a cloud a fit is as far from them as they are from each other.
    let worst = if no_surface { backward.max } else { hausdorff.max() };
    if worst > POOR * hausdorff.diagonal {
        let (way, farther) = if forward.max >= backward.max && !no_surface {
            ("a point of the fit is this far from the target", forward)
        } else {
            ("a point of the target is this far from the fit", backward)
        };
        let [x, y, z] = problem.to_given_units(&[farther.place])[0];
        notices.push(format!(
            "a poor fit: {way}: {:.2} % of the diagonal, at ({x:.4}, {y:.4}, {z:.4})",
            hausdorff.percent(farther.max)
        ));
    }
    Ok(Measured {
        mesh: side_by_side(problem, fitted, &jacobians, &hausdorff),
        metrics,
        notices,
    })
}

/// Distances to and from a cloud: of the fit's vertices to the nearest point, of every point to the fit.
fn to_points(fit: &TriangleMesh, points: &[[f64; 3]]) -> Hausdorff {
    let diagonal = mesh::diagonal(points);
    let summary = |distances: &[f64], places: &[[f64; 3]], cells: Vec<f64>| {
        let count = distances.len().max(1) as f64;
        let (mut max, mut place) = (0.0, places.first().copied().unwrap_or_default());
        for (&distance, &at) in distances.iter().zip(places) {
            if distance > max {
                (max, place) = (distance, at);
            }
        }
        Distance {
            max,
            bound: max,
            place,
            mean: distances.iter().sum::<f64>() / count,
            rms: (distances.iter().map(|x| x * x).sum::<f64>() / count).sqrt(),
            far: distances.iter().filter(|&&x| x > FAR * diagonal).count() as f64 / count,
            cells,
            samples: distances.len() as u64,
        }
    };
    let tree = PointTree::new(points);
    let near = |&x: &[f64; 3]| tree.nearest(x, None).map_or(f64::INFINITY, |(_, square)| square.sqrt());
    let vertices: Vec<f64> = fit.points.iter().map(near).collect();
    let corners = |cell: &[u32; 3]| cell.iter().fold(0.0, |most: f64, &v| most.max(vertices[v as usize]));
    let cells = fit.cells.iter().map(corners).collect();
    let each = distance::of_points(points, &ClosestPoint::new(fit));
    Hausdorff {
        forward: Distance {
            far: f64::NAN,
            ..summary(&vertices, &fit.points, cells)
        },
        backward: summary(&each, points, each.clone()),
        diagonal,
    }
}

/// The isotropic term from a surface to the samples.
fn isotropic(surface: &TriangleMesh, samples: &Samples) -> Result<f64, Failure> {
    let mut term = SquaredDistance::new(&surface.points, &surface.cells)
        .map_err(|error| Failure::invalid(format!("fit: {error}")))?;
    let tree = PointTree::new(&samples.points);
    Ok(term.evaluate(&surface.points, &tree, &Options::default(), Wanted::default()))
}

/// Vertices less edges plus faces over the vertices in use, and whether every edge has two faces.
fn euler(surface: &Surface) -> (i64, bool) {
    let edges = surface.edges();
    let closed = edges.iter().all(|edge| edge.faces.len() == 2);
    let mut used = surface.clone();
    used.drop_unused();
    (
        used.points.len() as i64 - edges.len() as i64 + surface.faces() as i64,
        closed,
    )
}

/// The way in which the target is moved, in the plane of x and y: across the picture as seen from the front right.
const ASIDE: [f64; 2] = [0.78, 0.625_779_514_526_485_2];

/// Both surfaces in one file: the fit where it is, the target moved aside.
fn side_by_side(problem: &Problem, fitted: &Surface, jacobians: &[f64], hausdorff: &Hausdorff) -> Vec<u8> {
    let target = &problem.target;
    let mut points = problem.to_given_units(&fitted.points);
    let first = points.len() as u32;
    let moved = problem.to_given_units(&target.points);
    let along = |point: &[f64; 3]| point[0] * ASIDE[0] + point[1] * ASIDE[1];
    let end = points.iter().map(along).fold(f64::NEG_INFINITY, f64::max);
    let start = moved.iter().map(along).fold(f64::INFINITY, f64::min);
    let shift = end - start + 0.05 * problem.diagonal;
    points.extend(
        moved
            .into_iter()
            .map(|[x, y, z]| [x + shift * ASIDE[0], y + shift * ASIDE[1], z]),
    );
    // Triangles come first in the file, of the fit and then of the target; then the fit's quadrilaterals.
    let own = fitted.triangles.len();
    let mut triangles = fitted.triangles.clone();
    triangles.extend(target.cells.iter().map(|cell| cell.map(|vertex| first + vertex)));
    let cut = &hausdorff.forward.cells;
    let mut distance: Vec<f64> = cut[..own].to_vec();
    if !target.cells.is_empty() {
        distance.extend(&hausdorff.backward.cells);
    }
    distance.extend(
        cut[own..]
            .chunks(2)
            .map(|halves| halves.iter().copied().fold(0.0, f64::max)),
    );
    for value in &mut distance {
        *value = hausdorff.percent(*value);
    }
    let others = target.cells.len();
    let column = |of_fit: &dyn Fn(usize) -> f64, of_target: f64| -> Vec<f64> {
        let quads = own..own + fitted.quads.len();
        (0..own)
            .map(of_fit)
            .chain(std::iter::repeat_n(of_target, others))
            .chain(quads.map(of_fit))
            .collect()
    };
    let quality = column(&|face| jacobians[face], 1.0);
    let part = column(&|_| 0.0, 1.0);
    vtu::write(
        &points,
        Cells {
            triangles: &triangles,
            quads: &fitted.quads,
            ..Cells::default()
        },
        &[],
        &[
            ("distance_percent", 1, &distance),
            ("scaled_jacobian", 1, &quality),
            ("target", 1, &part),
        ],
    )
}
