//! Legendre polynomials and their derivatives by their recurrences.

/// `[P_n, P_n', P_n'']` at `s`.
pub fn legendre(n: usize, s: f64) -> [f64; 3] {
    let mut before = [0.0; 3];
    let mut here = [1.0, 0.0, 0.0];
    for k in 0..n {
        let (k, odd) = (k as f64, (2 * k + 1) as f64);
        let next = [
            (odd * s * here[0] - k * before[0]) / (k + 1.0),
            before[1] + odd * here[0],
            before[2] + odd * here[1],
        ];
        before = here;
        here = next;
    }
    here
}
