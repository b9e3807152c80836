//! The metrics of a mixed finite element computation.

use crate::metric::{Better, Metric};

const fn metric(
    name: &'static str,
    symbol: &'static str,
    unit: &'static str,
    floor: Option<f64>,
    better: Better,
    definition: &'static str,
) -> Metric {
    Metric {
        name,
        symbol,
        unit,
        floor,
        better,
        definition,
    }
}

/// Every metric; those that a job's data give no meaning are not-a-number.
pub static ALL: &[Metric] = &[
    metric(
        "l2_error",
        "|u_h - u|",
        "",
        Some(0.0),
        Better::Lower,
        "Root of the integral over the domain of the squared difference to the function, by a rule of degree 4. The error of \
         interpolation is part of it.",
    ),
    metric(
        "h1_error",
        "|grad u_h - grad u|",
        "",
        Some(0.0),
        Better::Lower,
        "Root of the integral over the domain of the squared difference of the gradients, by a rule of degree 4.",
    ),
    metric(
        "max_error",
        "max |u_h - u|",
        "",
        Some(0.0),
        Better::Lower,
        "Largest difference to the function at a vertex of the domain.",
    ),
    metric(
        "h",
        "h",
        "",
        None,
        Better::Neither,
        "Mean edge length: the mean over the triangles of the mean of their three edges.",
    ),
    metric(
        "minimum_angle",
        "min angle",
        "degree",
        None,
        Better::Neither,
        "Smallest angle of a triangle of the mesh.",
    ),
    metric(
        "residual",
        "|b - A x|",
        "",
        Some(0.0),
        Better::Lower,
        "Largest entry of b - A x over |A| |x| + |b|, of the system that was factorized, after iterative refinement.",
    ),
    metric(
        "difference",
        "|u - u'|",
        "",
        Some(0.0),
        Better::Lower,
        "Largest difference between the solutions of the one-field and the mixed system, over the largest value.",
    ),
    metric(
        "unknowns",
        "n",
        "",
        None,
        Better::Neither,
        "Unknowns of the factorized system.",
    ),
    metric(
        "matrix_entries",
        "nnz(A)",
        "",
        None,
        Better::Lower,
        "Numbers stored for the lower triangle of the matrix.",
    ),
    metric(
        "factor_entries",
        "nnz(L)",
        "",
        None,
        Better::Lower,
        "Numbers stored for the factor; not-a-number for LU, which does not tell.",
    ),
    metric(
        "vertices",
        "N_v",
        "",
        None,
        Better::Neither,
        "Vertices of the mesh, patches included.",
    ),
    metric(
        "triangles",
        "N_t",
        "",
        None,
        Better::Neither,
        "Triangles of the mesh, patches included.",
    ),
    metric(
        "free_vertices",
        "N_free",
        "",
        None,
        Better::Neither,
        "Vertices that are solved for.",
    ),
    metric(
        "boundary_vertices",
        "N_0",
        "",
        None,
        Better::Neither,
        "Fixed vertices of triangles of the domain.",
    ),
    metric(
        "singular_pairs",
        "N_2",
        "",
        Some(0.0),
        Better::Lower,
        "Boundary vertices whose only free neighbour is that of another boundary vertex (Proposition 2).",
    ),
    metric(
        "nullity_bound",
        "dim ker >=",
        "",
        Some(0.0),
        Better::Lower,
        "Boundary rows of system (15) that cannot be matched with distinct vertices of the first inner ring: a lower bound \
         of the nullity of the lumped system.",
    ),
    metric(
        "nullity",
        "dim ker",
        "",
        Some(0.0),
        Better::Lower,
        "Singular values of the unstabilised system (15) below 1e-10 of the largest; up to 600 unknowns.",
    ),
    metric(
        "tangent_jump_max",
        "max C1 jump",
        "degree",
        Some(0.0),
        Better::Lower,
        "Largest angle between the surface normals at a seam vertex that quadratic fits to the two sides give.",
    ),
    metric(
        "tangent_jump_mean",
        "mean C1 jump",
        "degree",
        Some(0.0),
        Better::Lower,
        "Mean angle between the two sides' normals over the seam.",
    ),
    metric(
        "curvature_jump_max",
        "max C2 jump",
        "",
        Some(0.0),
        Better::Lower,
        "Largest difference of the two sides' normal curvatures across the seam, times the diagonal of the mesh's box.",
    ),
    metric(
        "curvature_jump_mean",
        "mean C2 jump",
        "",
        Some(0.0),
        Better::Lower,
        "Mean difference of the two sides' normal curvatures across the seam, times the diagonal of the mesh's box.",
    ),
    metric(
        "tangent_jump_before",
        "C1 jump before",
        "degree",
        None,
        Better::Neither,
        "Mean angle between the two sides' normals over the seam of the surface as it was, for region conditions: what its \
         own roughness makes of it.",
    ),
    metric(
        "displacement_max",
        "max |u - x|",
        "",
        None,
        Better::Neither,
        "Largest distance between a vertex's place before and after, in units of the mesh.",
    ),
];

/// Names and meanings of the counters.
pub const COUNTERS: &[(&str, &str)] = &[
    ("factorizations", "factorizations, those that broke down included"),
    ("solutions", "right-hand sides solved for, each with refinement"),
    (
        "fallbacks",
        "factorizations repeated by LU because the first one broke down",
    ),
];
