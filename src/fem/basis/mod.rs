//! Families of functions on `[0, 1]` that vanish at both ends: what the edges, faces and cells of an element bend by.
//!
//! Every family has `b_j(1 - x) = (-1)^(j+1) b_j(x)`, so that one rule of signs serves all orientations.

pub mod legendre;
pub mod integrated_legendre;
pub mod integrated_fourier;
pub mod fourier_enriched;

/// One family. Every function returns the value and the derivative by its argument.
pub trait Basis: Send + Sync {
    /// Kebab-case, as in experiment files.
    fn name(&self) -> &'static str;
    /// Formula and source.
    fn summary(&self) -> &'static str;
    /// The bubble `b_j` on `[0, 1]`, `j = 1, 2, ...`; vanishes at 0 and 1.
    fn bubble(&self, j: usize, x: f64) -> [f64; 2];
    /// `b_j(x) / (x (1 - x))` at `s = 2x - 1` in `[-1, 1]`, and its derivative by s: extends the bubble of an edge into
    /// triangles and tetrahedra.
    fn kernel(&self, j: usize, s: f64) -> [f64; 2];
    /// The k-th function of a complete family on `[0, 1]`, `k = 0, 1, ...`.
    fn factor(&self, k: usize, x: f64) -> [f64; 2];
    /// Whether all functions are polynomials: bubble j of degree j + 1, kernel j of degree j - 1, factor k of degree k.
    fn is_polynomial(&self) -> bool;
    /// For a family with sines: the largest frequency of the bubbles up to j, so that the n-th derivative of each is at
    /// most `sqrt(2) (pi frequency)^(n-1)` for n > 5. Nothing for polynomials.
    fn frequency(&self, j: usize) -> Option<f64>;
    /// The frequency f of the k-th factor where it is `sqrt(2) cos(f pi x)`. Nothing, or 0, for polynomials.
    fn factor_frequency(&self, k: usize) -> Option<f64>;
}

/// Every basis, the default first.
pub fn bases() -> &'static [&'static dyn Basis] {
    &[
        &integrated_legendre::IntegratedLegendre,
        &integrated_fourier::IntegratedFourier,
        &fourier_enriched::FourierEnriched,
    ]
}

/// The basis of this name.
pub fn find(name: &str) -> Option<&'static dyn Basis> {
    bases().iter().copied().find(|basis| basis.name() == name)
}
