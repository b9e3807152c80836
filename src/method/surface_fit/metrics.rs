//! The figures that every surface fit is described by: their definitions.

use crate::metric::{Better, Metric, distance, metric};
use std::sync::LazyLock;

/// Those that only this method has.
const OWN: &[Metric] = &[
    metric(
        "crease_distance",
        "d_crease",
        "%",
        Some(0.0),
        Better::Lower,
        "Largest distance of the target's crease lines to the fit, in per cent of the diagonal of the target's box: how far \
         sharp edges are rounded off. Not-a-number for a target without creases.",
    ),
    metric(
        "crease_distance_mean",
        "mean d_crease",
        "%",
        Some(0.0),
        Better::Lower,
        "Mean over the length of the target's crease lines of the distance to the fit, in per cent of the diagonal of the \
         target's box.",
    ),
    metric(
        "spurious_area",
        "A_spur",
        "%",
        Some(0.0),
        Better::Lower,
        "Share of the fit's area whose distance to the target exceeds 2 % of the diagonal of the target's box; not-a-number for a \
         cloud.",
    ),
    metric(
        "missed_area",
        "A_miss",
        "%",
        Some(0.0),
        Better::Lower,
        "Share of the target's area, or of a cloud's points, whose distance to the fit exceeds 2 % of the diagonal of the \
         target's box.",
    ),
    metric(
        "scaled_jacobian_min",
        "min SJ",
        "",
        None,
        Better::Higher,
        "Smallest scaled Jacobian of a face of the fit: over its corners the least of n . (a x b) / (|a| |b|), for \
         triangles 2/sqrt(3) times that; 1 for a rectangle and a regular triangle, negative where a quadrilateral folds over. \
         A triangle or a whole face turned over is not seen.",
    ),
    metric(
        "scaled_jacobian_mean",
        "mean SJ",
        "",
        None,
        Better::Higher,
        "Mean over the faces of the fit of their scaled Jacobians.",
    ),
    metric(
        "unevenness",
        "R_P",
        "",
        Some(0.0),
        Better::Lower,
        "|P L X|^2, the part of |L X|^2 along the fit, by the normals at the start of the last stage; the target scaled to \
         diagonal 1.",
    ),
    metric(
        "folded_faces",
        "n_fold",
        "",
        Some(0.0),
        Better::Lower,
        "Number of faces of the fit with a scaled Jacobian of 0 or less.",
    ),
    metric(
        "energy",
        "F",
        "",
        Some(0.0),
        Better::Lower,
        "What the last stage minimizes, the target scaled to diagonal 1: both terms, the regularizers and \
         what unfolds, with their factors.",
    ),
    metric(
        "target_to_fit",
        "F T->S",
        "",
        Some(0.0),
        Better::Lower,
        "The term from the target to the fit's vertices with the last stage's anisotropy, the target scaled to diagonal 1; \
         not-a-number where `terms` leave it out. Of a cloud: from its points to the fit, which together weigh as much as \
         the template's area.",
    ),
    metric(
        "fit_to_target",
        "F S->T",
        "",
        Some(0.0),
        Better::Lower,
        "The term from the fit to the target's samples with the last stage's anisotropy, the target scaled to diagonal 1; \
         not-a-number where `terms` leave it out.",
    ),
    metric(
        "regularizer",
        "R",
        "",
        Some(0.0),
        Better::Lower,
        "|L X|^2 with the graph Laplacian L of the fitted mesh X, the target scaled to diagonal 1.",
    ),
    metric(
        "approximation_error",
        "F~ - F",
        "",
        None,
        Better::Lower,
        "Isotropic term from the fit to the target's samples less the integral of the squared distance to the target itself \
         over the fit, per area, the target scaled to diagonal 1.",
    ),
    metric(
        "sample_spacing",
        "eps",
        "",
        None,
        Better::Neither,
        "Square root of the target's area over the number of its samples, over the diagonal of its box.",
    ),
    metric(
        "samples",
        "m",
        "",
        None,
        Better::Neither,
        "Number of samples of the target.",
    ),
    metric(
        "control_vertices",
        "n_P",
        "",
        None,
        Better::Neither,
        "Number of control points, the unknowns, after refinements.",
    ),
    metric(
        "vertices",
        "n",
        "",
        None,
        Better::Neither,
        "Number of vertices of the fitted mesh.",
    ),
    metric(
        "faces",
        "n_F",
        "",
        None,
        Better::Neither,
        "Number of faces of the fitted mesh.",
    ),
    metric(
        "target_triangles",
        "n_T",
        "",
        None,
        Better::Neither,
        "Number of triangles of the target.",
    ),
    metric(
        "target_euler",
        "chi_T",
        "",
        None,
        Better::Neither,
        "Vertices less edges plus faces of the target.",
    ),
    metric(
        "template_euler",
        "chi_S",
        "",
        None,
        Better::Neither,
        "Vertices less edges plus faces of the template.",
    ),
];

static ALL: LazyLock<Vec<Metric>> = LazyLock::new(|| [distance::METRICS, OWN].concat());

/// Every metric of a surface fit.
pub fn all() -> &'static [Metric] {
    &ALL
}
