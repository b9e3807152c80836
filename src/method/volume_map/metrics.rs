//! The figures that every volumetric map is described by: their definitions.

use crate::energy;
use crate::metric::{Better, Metric, distortion, scaled_jacobian};
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

/// Those that only this method has.
const OWN: &[Metric] = &[
    metric(
        "energy",
        "E",
        None,
        Better::Lower,
        "Mean of the chosen energy density with the chosen weighting, without barrier and constraints. Means weighted by the \
         target's volume are divided by the sum of these weights.",
    ),
    metric(
        "energy_integral",
        "E V",
        None,
        Better::Lower,
        "Sum over the tetrahedra of source volume, as given in the file, times the chosen energy density.",
    ),
    metric(
        "inverted_lower_bound",
        "N_min",
        Some(0.0),
        Better::Lower,
        "Number of tetrahedra that the boundary forces to be inverted or flat in a map that meets the target.",
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
    let (energies, others) = OWN.split_at(2);
    let mut all = [energies, distortion::METRICS, scaled_jacobian::METRICS, others].concat();
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
