//! A quadrature rule on triangles that is exact for polynomials of degree 4 (Strang and Fix 1973; Dunavant 1985).

/// Weights that sum to 1 with barycentric coordinates: the integral over a triangle is its area times the weighted sum.
pub const DEGREE_4: [(f64, [f64; 3]); 6] = {
    const NEAR: f64 = 0.445_948_490_915_965;
    const FAR: f64 = 0.091_576_213_509_771;
    const NEAR_WEIGHT: f64 = 0.223_381_589_678_011;
    const FAR_WEIGHT: f64 = 0.109_951_743_655_322;
    [
        (NEAR_WEIGHT, [1.0 - 2.0 * NEAR, NEAR, NEAR]),
        (NEAR_WEIGHT, [NEAR, 1.0 - 2.0 * NEAR, NEAR]),
        (NEAR_WEIGHT, [NEAR, NEAR, 1.0 - 2.0 * NEAR]),
        (FAR_WEIGHT, [1.0 - 2.0 * FAR, FAR, FAR]),
        (FAR_WEIGHT, [FAR, 1.0 - 2.0 * FAR, FAR]),
        (FAR_WEIGHT, [FAR, FAR, 1.0 - 2.0 * FAR]),
    ]
};
