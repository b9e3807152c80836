//! The figures of a centroidal Voronoi tessellation.

use crate::metric::{Better, Metric};

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

/// Every metric of a tessellation.
pub const ALL: &[Metric] = &[
    metric(
        "energy",
        "F",
        Some(0.0),
        Better::Lower,
        "Integral over the surface of the squared distance to the nearest site.",
    ),
    metric(
        "quantization",
        "F N / A^2",
        None,
        Better::Lower,
        "The energy times the number of sites over the squared area; regular hexagons in the plane have 5/(18 sqrt 3) = \
         0.160375, the least there is in the plane.",
    ),
    metric(
        "centroid_distance",
        "|y - g|",
        Some(0.0),
        Better::Lower,
        "Root mean square distance of the sites to the centroids of their cells, weighted by area, over the spacing.",
    ),
    metric(
        "area_deviation",
        "sd A_i / A",
        Some(0.0),
        Better::Lower,
        "Standard deviation of the cells' areas over their mean.",
    ),
    metric(
        "empty_cells",
        "N_0",
        Some(0.0),
        Better::Lower,
        "Number of sites whose cell does not meet the surface.",
    ),
    metric("area", "A", None, Better::Neither, "Area of the surface."),
    metric(
        "triangles",
        "N_t",
        None,
        Better::Neither,
        "Number of triangles of the surface.",
    ),
    metric(
        "pieces",
        "N_p",
        None,
        Better::Neither,
        "Number of parts that the cells cut the triangles into.",
    ),
];
