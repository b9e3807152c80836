//! The Hessian of an isotropic density in the frame of its singular vectors, and its projection to a positive matrix.
//!
//! With `J = U diag(s) V^T` the nine eigenmatrices are known (Smith, de Goes, Kim 2019, Analytic eigensystems for
//! isotropic distortion energies): three scalings `U diag(q) V^T`, where q is an eigenvector of the 3x3 matrix of second
//! derivatives by s; three flips `U (e_i e_j^T + e_j e_i^T) V^T / sqrt 2` with eigenvalue
//! `(Psi_i - Psi_j) / (s_i - s_j)`; three twists `U (e_i e_j^T - e_j e_i^T) V^T / sqrt 2` with eigenvalue
//! `(Psi_i + Psi_j) / (s_i + s_j)`. All densities share flips and twists. So terms are summed first and projected once,
//! which removes less than projecting each term.

use crate::linalg::eigen3::symmetric_eigen;
use crate::linalg::jet::SYMMETRIC;
use crate::linalg::lanes::{Lanes, Vector, load, store};
use crate::linalg::scalar::{Real, Scalar};
use crate::linalg::vector3::{Columns, add, apply, apply_transposed, cofactor, cross, subtract, times};

/// Value and first derivatives by the energy's variables.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Slopes<S> {
    pub value: S,
    pub partials: [S; 3],
}

/// Value, first derivatives by the energy's variables, and the Hessian's parts.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Spectrum<S> {
    pub value: S,
    /// First derivatives by the energy's variables: invariants or singular values.
    pub partials: [S; 3],
    /// Second derivatives by singular values: 00, 01, 02, 11, 12, 22.
    pub scaling: [S; 6],
    /// Eigenvalue of the flip of the pair without index k: (1,2), (0,2), (0,1).
    pub flip: [S; 3],
    /// Eigenvalue of the twist of the pair without index k.
    pub twist: [S; 3],
}

/// The pair of indices without k.
pub const PAIRS: [(usize, usize); 3] = [(1, 2), (0, 2), (0, 1)];
/// Place of entry (i, j) among the six of a symmetric matrix.
const PLACE: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// `value` where it is not negative, else `negative value`.
#[inline(always)]
fn filter<R: Real>(value: R, negative: f64) -> R {
    value.where_negative(value.scale(negative), value)
}

impl<S: Scalar> Spectrum<S> {
    /// The sum with `factor` times another spectrum in the same frame; `partials` stay, for theirs differ in meaning.
    #[inline(always)]
    pub fn plus(&self, other: &Spectrum<S>, factor: f64) -> Spectrum<S> {
        let mut sum = *self;
        sum.value = self.value + other.value.scale(factor);
        for i in 0..3 {
            sum.flip[i] = self.flip[i] + other.flip[i].scale(factor);
            sum.twist[i] = self.twist[i] + other.twist[i].scale(factor);
        }
        for i in 0..6 {
            sum.scaling[i] = self.scaling[i] + other.scaling[i].scale(factor);
        }
        sum
    }

    /// The spectrum times a weight.
    #[inline(always)]
    pub fn weighted(&self, weight: S) -> Spectrum<S> {
        let mut result = *self;
        result.value = weight * self.value;
        for i in 0..3 {
            result.partials[i] = weight * self.partials[i];
            result.flip[i] = weight * self.flip[i];
            result.twist[i] = weight * self.twist[i];
        }
        for i in 0..6 {
            result.scaling[i] = weight * self.scaling[i];
        }
        result
    }

    /// For the pair without k: the Hessian's entries `(ij, ij)`, half the sum of flip and twist, and `(ij, ji)`, half
    /// their difference.
    #[inline(always)]
    pub fn pairs(&self) -> ([S; 3], [S; 3]) {
        let (mut direct, mut crossed) = (self.flip, self.twist);
        for k in 0..3 {
            direct[k] = (self.flip[k] + self.twist[k]).scale(0.5);
            crossed[k] = (self.flip[k] - self.twist[k]).scale(0.5);
        }
        (direct, crossed)
    }

    #[inline(always)]
    pub fn scaling_entry(&self, i: usize, j: usize) -> S {
        self.scaling[PLACE[i][j]]
    }
}

impl<R: Real> Spectrum<R> {
    /// The spectrum with negative eigenvalues multiplied by `negative`: 0 projects, 1 changes nothing, -1 takes absolute
    /// values.
    #[inline(always)]
    pub fn filtered(&self, negative: f64) -> Spectrum<R> {
        let mut result = *self;
        if negative == 1.0 {
            return result;
        }
        for k in 0..3 {
            result.flip[k] = filter(self.flip[k], negative);
            result.twist[k] = filter(self.twist[k], negative);
        }
        let indefinite = self.scaling_indefinite();
        if !R::any(indefinite) {
            return result;
        }
        // Only what is negative is taken out, so a positive matrix keeps its bits.
        let eigen = symmetric_eigen(&self.scaling);
        for n in 0..3 {
            let value = eigen.values[n];
            let zero = R::constant(0.0);
            let change = value.where_negative(value.scale(negative - 1.0), zero);
            let change = R::select(indefinite, change, zero);
            let q = eigen.vectors[n];
            for (entry, &(i, j)) in result.scaling.iter_mut().zip(&SYMMETRIC) {
                *entry = *entry + change * q[i] * q[j];
            }
        }
        result
    }

    /// Where the scaling matrix is not found positive definite by its Cholesky pivots.
    #[inline(always)]
    fn scaling_indefinite(&self) -> R::Mask {
        let [a, b, c, d, e, f] = self.scaling;
        let zero = R::constant(0.0);
        // Pivots a, d - b^2/a, ...; multiplied out, so that a zero matrix needs no division.
        let minor = a * d - b * b;
        let third = minor * (a * f - c * c) - (a * e - b * c).square();
        let positive = zero.less(a) & zero.less(minor) & zero.less(third);
        let one = R::constant(1.0);
        R::select(positive, one, -one).less(zero)
    }
}

impl<V: Vector> Slopes<V> {
    #[inline(always)]
    pub fn load(lanes: &Slopes<Lanes>) -> Slopes<V> {
        Slopes {
            value: V::load(&lanes.value),
            partials: load(&lanes.partials),
        }
    }

    #[inline(always)]
    pub fn store(self, out: &mut Slopes<Lanes>) {
        self.value.store(&mut out.value);
        store(self.partials, &mut out.partials);
    }
}

impl<V: Vector> Spectrum<V> {
    #[inline(always)]
    pub fn load(lanes: &Spectrum<Lanes>) -> Spectrum<V> {
        Spectrum {
            value: V::load(&lanes.value),
            partials: load(&lanes.partials),
            scaling: load(&lanes.scaling),
            flip: load(&lanes.flip),
            twist: load(&lanes.twist),
        }
    }

    #[inline(always)]
    pub fn store(self, out: &mut Spectrum<Lanes>) {
        self.value.store(&mut out.value);
        store(self.partials, &mut out.partials);
        store(self.scaling, &mut out.scaling);
        store(self.flip, &mut out.flip);
        store(self.twist, &mut out.twist);
    }
}

/// The spectrum of a function of the invariants `A = |J|^2, B = |cof J|^2, D = det J` with this value, these first and
/// these second derivatives (00, 01, 02, 11, 12, 22) by A, B, D.
///
/// No division by differences of singular values: for the pair i, j without k,
/// `flip = 2 Psi_A + 2 Psi_B (s_k^2 - s_i s_j) - Psi_D s_k` and `twist = 2 Psi_A + 2 Psi_B (s_k^2 + s_i s_j) + Psi_D
/// s_k`.
#[inline(always)]
pub fn spectrum_by_invariants<S: Scalar>(s: [S; 3], value: S, g: [S; 3], h: [S; 6]) -> Spectrum<S> {
    let zero = S::constant(0.0);
    let squares = [s[0] * s[0], s[1] * s[1], s[2] * s[2]];
    let products = [s[1] * s[2], s[0] * s[2], s[0] * s[1]];
    let twice = [g[0] + g[0], g[1] + g[1]];
    // Rows: the derivatives of A, B, D by s_i.
    let mut t = [[zero; 3]; 3];
    let mut others = [zero; 3];
    for (k, &(i, j)) in PAIRS.iter().enumerate() {
        others[k] = squares[i] + squares[j];
        t[0][k] = s[k] + s[k];
        t[1][k] = (s[k] + s[k]) * others[k];
        t[2][k] = products[k];
    }
    let mut result = Spectrum {
        value,
        partials: g,
        scaling: [zero; 6],
        flip: [zero; 3],
        twist: [zero; 3],
    };
    let mut ht = [[zero; 3]; 3];
    for p in 0..3 {
        for i in 0..3 {
            ht[p][i] = h[PLACE[p][0]] * t[0][i] + h[PLACE[p][1]] * t[1][i] + h[PLACE[p][2]] * t[2][i];
        }
    }
    for (n, &(i, j)) in SYMMETRIC.iter().enumerate() {
        let outer = t[0][i] * ht[0][j] + t[1][i] * ht[1][j] + t[2][i] * ht[2][j];
        result.scaling[n] = if i == j {
            outer + (twice[0] + twice[1] * others[i])
        } else {
            let k = 3 - i - j;
            outer + ((twice[1] + twice[1]) * products[k] + g[2] * s[k])
        };
    }
    for k in 0..3 {
        let turn = g[2] * s[k];
        result.flip[k] = twice[0] + twice[1] * (squares[k] - products[k]) - turn;
        result.twist[k] = twice[0] + twice[1] * (squares[k] + products[k]) + turn;
    }
    result
}

/// `dPsi/dJ = 2 Psi_A J + Psi_B d|cof J|^2/dJ + Psi_D cof J`, as columns.
///
/// The column of `d|cof J|^2/dJ` at `j0` is `2 (j1 x c2 - j2 x c1)` with the cofactor's columns c, and cyclically; the
/// textbook form `2 (A J - J J^T J)` cancels.
#[inline(always)]
pub fn stress_by_invariants<S: Scalar>(jacobian: &Columns<S>, g: [S; 3]) -> Columns<S> {
    let cof = cofactor(jacobian);
    let mut stress = *jacobian;
    for k in 0..3 {
        let (l, m) = ((k + 1) % 3, (k + 2) % 3);
        let second = subtract(cross(jacobian[l], cof[m]), cross(jacobian[m], cof[l]));
        let linear = add(times(jacobian[k], g[0] + g[0]), times(second, g[1] + g[1]));
        stress[k] = add(linear, times(cof[k], g[2]));
    }
    stress
}

/// `dPsi/dJ = U diag(dPsi/ds) V^T`, as columns.
#[inline(always)]
pub fn stress_by_singular_values<S: Scalar>(u: &Columns<S>, v: &Columns<S>, slopes: [S; 3]) -> Columns<S> {
    let mut stress = *u;
    for (column, entry) in stress.iter_mut().enumerate() {
        let row = [
            slopes[0] * v[0][column],
            slopes[1] * v[1][column],
            slopes[2] * v[2][column],
        ];
        *entry = apply(u, row);
    }
    stress
}

/// The Hessian block `H_ab` with `d2Psi = sum_ab du_a^T H_ab du_b` for `dJ = sum_a du_a G_a^T`, from
/// `a = V^T G_a` and `b = V^T G_b`, as columns: `U K U^T` with
/// `K_ii = S_ii a_i b_i + sum_j direct_ij a_j b_j` and `K_ij = S_ij a_i b_j + crossed_ij a_j b_i`.
#[inline(always)]
pub fn block<S: Scalar>(
    u: &Columns<S>,
    spectrum: &Spectrum<S>,
    pairs: &([S; 3], [S; 3]),
    a: [S; 3],
    b: [S; 3],
) -> Columns<S> {
    let (direct, crossed) = pairs;
    let products = [a[0] * b[0], a[1] * b[1], a[2] * b[2]];
    let mut inner = [a; 3];
    for (i, &(j, k)) in PAIRS.iter().enumerate() {
        // Pair (i, j) lacks k, pair (i, k) lacks j.
        inner[i][i] = spectrum.scaling_entry(i, i) * products[i] + (direct[k] * products[j] + direct[j] * products[k]);
        // The entry (row, column) = (j, k) and its mirror.
        let scaling = spectrum.scaling_entry(j, k);
        inner[k][j] = scaling * (a[j] * b[k]) + crossed[i] * (a[k] * b[j]);
        inner[j][k] = scaling * (a[k] * b[j]) + crossed[i] * (a[j] * b[k]);
    }
    // Rows of U in `row`, so that (U K U^T) e_c = U (K (U^T e_c)).
    let mut result = inner;
    for (c, column) in result.iter_mut().enumerate() {
        let row = [u[0][c], u[1][c], u[2][c]];
        *column = apply(u, apply(&inner, row));
    }
    result
}

/// `V^T G`.
#[inline(always)]
pub fn in_frame<S: Scalar>(v: &Columns<S>, gradient: [S; 3]) -> [S; 3] {
    apply_transposed(v, gradient)
}
