//! The figures that every volumetric map is described by: their definitions.

use crate::energy;
use crate::metric::{Better, Metric};
use std::sync::LazyLock;

const fn metric(
    name: &'static str,
    symbol: &'static str,
    floor: Option<f64>,
    better: Better,
    definition: &'static str,
) -> Metric {
    Metric {
        name,
        symbol,
        unit: "",
        floor,
        better,
        definition,
    }
}

const FIXED: &[Metric] = &[
    metric(
        "energy",
        "E",
        None,
        Better::Lower,
        "Mean of the chosen energy density over the source with the chosen weighting, without barrier and constraints.",
    ),
    metric(
        "energy_integral",
        "E V",
        None,
        Better::Lower,
        "Sum over the tetrahedra of source volume, as given in the file, times the chosen energy density.",
    ),
    metric(
        "d_aa",
        "D_aa",
        Some(2.0),
        Better::Lower,
        "Average angle distortion: mean over the source volume of s1/s3 + s3/s1, s1 and s3 the largest and smallest \
         singular value of the Jacobian.",
    ),
    metric(
        "d_ma",
        "D_ma",
        Some(2.0),
        Better::Lower,
        "Maximum angle distortion: largest s1/s3 + s3/s1 of a tetrahedron.",
    ),
    metric(
        "d_av",
        "D_av",
        Some(2.0),
        Better::Lower,
        "Average volume distortion: mean over the source volume of det J + 1/det J, in the units of the files. At least \
         r + 1/r for a volume ratio r. Undefined where a tetrahedron is inverted.",
    ),
    metric(
        "d_mv",
        "D_mv",
        Some(2.0),
        Better::Lower,
        "Maximum volume distortion: largest det J + 1/det J of a tetrahedron, in the units of the files. Undefined where \
         a tetrahedron is inverted.",
    ),
    metric(
        "d_av_rescaled",
        "D_av'",
        Some(2.0),
        Better::Lower,
        "Average volume distortion after the source is scaled to the volume of the target.",
    ),
    metric(
        "d_mv_rescaled",
        "D_mv'",
        Some(2.0),
        Better::Lower,
        "Maximum volume distortion after the source is scaled to the volume of the target.",
    ),
    metric(
        "inverted",
        "N_inv",
        Some(0.0),
        Better::Lower,
        "Number of tetrahedra with a negative determinant.",
    ),
    metric(
        "degenerate",
        "N_flat",
        Some(0.0),
        Better::Lower,
        "Number of tetrahedra whose determinant is zero to rounding: at most 1e-14 times the product of the image's three \
         edge lengths at a vertex over that of the source, in absolute value.",
    ),
    metric(
        "inverted_lower_bound",
        "N_min",
        Some(0.0),
        Better::Lower,
        "Number of tetrahedra that the boundary alone forces to be inverted or flat in every map.",
    ),
    metric(
        "min_determinant",
        "min det",
        None,
        Better::Higher,
        "Smallest determinant of the Jacobian, the source scaled to the volume of the target.",
    ),
    metric(
        "scaled_jacobian_min",
        "min SJ",
        None,
        Better::Higher,
        "Smallest scaled Jacobian of an image tetrahedron: sqrt(2) det / product of the three edge lengths at a corner, \
         least over the corners; 1 for the regular tetrahedron.",
    ),
    metric(
        "scaled_jacobian_mean",
        "mean SJ",
        None,
        Better::Higher,
        "Mean over the image tetrahedra of their scaled Jacobians.",
    ),
    metric(
        "constraint_residual",
        "|Cu-p|^2",
        Some(0.0),
        Better::Lower,
        "Sum over the boundary vertices of squared distances to their targets, over the target's volume to the power 2/3.",
    ),
    metric(
        "constraint_distance",
        "max |Cu-p|",
        Some(0.0),
        Better::Lower,
        "Largest distance of a boundary vertex to its target, over the diagonal of the target's box.",
    ),
    metric(
        "mean_determinant_error",
        "|mean det - r|/r",
        Some(0.0),
        Better::Lower,
        "Relative deviation of the mean determinant from the ratio of the volume within the image's boundary to the \
         source volume. Zero up to rounding for any map: a check of the computation.",
    ),
    metric(
        "volume_ratio",
        "r",
        None,
        Better::Neither,
        "Volume within the target boundary over the volume of the source, in the units of the files.",
    ),
    metric(
        "vertices",
        "N_v",
        None,
        Better::Neither,
        "Number of vertices, after splits.",
    ),
    metric(
        "tetrahedra",
        "N_t",
        None,
        Better::Neither,
        "Number of tetrahedra, after splits.",
    ),
    metric(
        "boundary_vertices",
        "N_b",
        None,
        Better::Neither,
        "Number of vertices on the boundary.",
    ),
];

/// The metrics above, and the mean of every energy density on the map, so that maps of different energies compare.
static ALL: LazyLock<Vec<Metric>> = LazyLock::new(|| {
    let mut all = FIXED.to_vec();
    for energy in energy::energies() {
        // Once in the life of the program: names of metrics live as long as it does.
        let name: &'static str = Box::leak(energy_metric(energy.name()).into_boxed_str());
        let symbol: &'static str = Box::leak(format!("E {}", energy.name()).into_boxed_str());
        let definition: &'static str = Box::leak(
            format!(
                "Mean over the source volume of the density \"{}\", the source scaled to the volume of the target. \
                 Infinite where the density is.",
                energy.name()
            )
            .into_boxed_str(),
        );
        all.push(metric(name, symbol, None, Better::Lower, definition));
    }
    all
});

/// Every metric of a volumetric map.
pub fn all() -> &'static [Metric] {
    &ALL
}

/// The name of the metric that holds the mean of an energy: `energy_symmetric_dirichlet`.
pub fn energy_metric(energy: &str) -> String {
    format!("energy_{}", energy.replace('-', "_"))
}
