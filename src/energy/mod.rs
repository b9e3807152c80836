//! Distortion energies: densities over the 3x3 Jacobian of a map, one file each, one list.
//!
//! A map takes source points X to target points u; its Jacobian is `J = du/dX`. Its signed singular values are
//! `s0 >= s1 >= |s2|`, with `J = U diag(s) V^T` for rotations U and V. All densities here are isotropic: they depend on s
//! alone. One formula per energy is enough, see [`isotropic`] and [`separable`]; derivatives and the projection of the
//! Hessian to a positive matrix are written once, in [`spectrum`]. [`mapping`] sums a density over a mesh.
//!
//! A barrier energy is plus infinity unless `det J > 0`. That is an explicit test, because several formulas become
//! finite again for negative determinants and a line search would tunnel through.

pub mod spectrum;
pub mod isotropic;
pub mod separable;

pub mod dirichlet;
pub mod arap;
pub mod stretch;
pub mod lscm;
pub mod lpm;
pub mod hencky;
pub mod symmetric_dirichlet;
pub mod condition_number;
pub mod condition_number_squared;
pub mod mips;
pub mod amips;
pub mod mean_ratio;

pub mod lim_barrier;
pub mod untangling;
pub mod target_weighted;
pub mod mapping;

use crate::linalg::lanes::Lanes;
use crate::linalg::processor::Processor;
use crate::linalg::svd3::{SignedSvd, signed_svd};
use crate::linalg::vector3::{Columns, cofactor, dot, inner};
use nalgebra::{Matrix3, SMatrix};
use spectrum::{Slopes, Spectrum, stress_by_invariants, stress_by_singular_values};

/// A 9x9 matrix over `vec(J)`, the entries of J column by column.
pub type Matrix9 = SMatrix<f64, 9, 9>;

/// What an energy says about itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Description {
    /// Kebab-case, as in experiment files.
    pub name: &'static str,
    /// In s_i, or `A = |J|^2`, `B = |cof J|^2` (Frobenius norms) and `D = det J`.
    pub formula: &'static str,
    pub source: &'static str,
    /// Plus infinity unless `det J > 0`, and unbounded as the determinant falls to 0.
    pub is_barrier: bool,
    /// Least at a particular size of the target, so that the source should be scaled to the target's volume first.
    pub needs_rest_scale: bool,
}

/// Value and derivatives of a density at one Jacobian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivatives {
    pub value: f64,
    /// `dPsi/dJ`.
    pub stress: Matrix3<f64>,
    /// `d2Psi/dvec(J)2`, J column by column.
    pub hessian: Matrix9,
}

/// The variables in which an energy's formula is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variables {
    /// `[|J|^2, |cof J|^2, det J]`.
    Invariants,
    /// `[s0, s1, s2]`.
    SingularValues,
}

/// A density over a 3x3 Jacobian.
///
/// Implement [`isotropic::Isotropic`] or [`separable::Separable`] rather than this. The methods over slices serve
/// [`mapping`] in vector lanes; they do not test the domain, their results are unspecified where `det J <= 0` for a
/// barrier energy.
pub trait Energy: Send + Sync {
    fn description(&self) -> Description;
    fn variables(&self) -> Variables;
    /// Value by variables.
    fn values_in_lanes(&self, processor: Processor, variables: &[[Lanes; 3]], values: &mut [Lanes]);
    /// Value and first derivatives by variables.
    fn slopes_in_lanes(&self, processor: Processor, variables: &[[Lanes; 3]], slopes: &mut [Slopes<Lanes>]);
    /// Value and second derivatives in the frame of the singular vectors, from singular values and invariants.
    fn spectra_in_lanes(
        &self,
        processor: Processor,
        singular_values: &[[Lanes; 3]],
        invariants: &[[Lanes; 3]],
        spectra: &mut [Spectrum<Lanes>],
    );
    /// As [`Energy::slopes_in_lanes`], for one Jacobian.
    fn slopes(&self, variables: [f64; 3]) -> Slopes<f64>;
    /// As [`Energy::spectra_in_lanes`], for one Jacobian.
    fn spectrum(&self, singular_values: [f64; 3], invariants: [f64; 3]) -> Spectrum<f64>;

    fn name(&self) -> &'static str {
        self.description().name
    }
    fn formula(&self) -> &'static str {
        self.description().formula
    }
    fn source(&self) -> &'static str {
        self.description().source
    }
    fn is_barrier(&self) -> bool {
        self.description().is_barrier
    }
    fn needs_rest_scale(&self) -> bool {
        self.description().needs_rest_scale
    }

    /// The density, plus infinity outside its domain.
    fn value(&self, jacobian: &Matrix3<f64>) -> f64 {
        let point = Point::new(jacobian);
        if self.is_barrier() && !point.valid() {
            return f64::INFINITY;
        }
        self.slopes(point.variables(self.variables())).value
    }

    /// Value, stress and Hessian. Outside the domain the value is plus infinity and the derivatives are not-a-number.
    fn derivatives(&self, jacobian: &Matrix3<f64>) -> Derivatives {
        self.filtered(jacobian, 1.0)
    }

    /// Value, stress and the Hessian with its negative eigenvalues set to 0.
    fn projected(&self, jacobian: &Matrix3<f64>) -> Derivatives {
        self.filtered(jacobian, 0.0)
    }

    /// Value, stress and the Hessian with its negative eigenvalues multiplied by `negative`.
    fn filtered(&self, jacobian: &Matrix3<f64>, negative: f64) -> Derivatives {
        let point = Point::new(jacobian);
        if self.is_barrier() && !point.valid() {
            return Derivatives {
                value: f64::INFINITY,
                stress: Matrix3::from_element(f64::NAN),
                hessian: Matrix9::from_element(f64::NAN),
            };
        }
        let spectrum = self.spectrum(point.svd.s, point.invariants);
        let stress = match self.variables() {
            Variables::Invariants => stress_by_invariants(&point.jacobian, spectrum.partials),
            Variables::SingularValues => stress_by_singular_values(&point.svd.u, &point.svd.v, spectrum.partials),
        };
        Derivatives {
            value: spectrum.value,
            stress: from_columns(&stress),
            hessian: hessian_from_spectrum(&point.svd, &spectrum.filtered(negative)),
        }
    }
}

/// Invariants and decomposition of one Jacobian.
struct Point {
    jacobian: Columns<f64>,
    invariants: [f64; 3],
    svd: SignedSvd<f64>,
}

impl Point {
    fn new(jacobian: &Matrix3<f64>) -> Point {
        let jacobian = to_columns(jacobian);
        let invariants = invariants(&jacobian);
        let mut svd = signed_svd(&jacobian);
        svd.s[2] = with_sign_of(svd.s[2], invariants[2]);
        Point {
            jacobian,
            invariants,
            svd,
        }
    }

    fn valid(&self) -> bool {
        self.invariants[2] > 0.0
    }

    fn variables(&self, kind: Variables) -> [f64; 3] {
        match kind {
            Variables::Invariants => self.invariants,
            Variables::SingularValues => self.svd.s,
        }
    }
}

/// The smallest singular value with the sign of the determinant, from which rounding may separate it near 0.
#[inline(always)]
fn with_sign_of<R: crate::linalg::scalar::Real>(smallest: R, determinant: R) -> R {
    let size = smallest.abs();
    determinant.where_negative(-size, size)
}

/// `[|J|^2, |cof J|^2, det J]`; the second from the cofactor matrix, which has no cancellation.
#[inline(always)]
pub fn invariants<S: crate::linalg::scalar::Scalar>(jacobian: &Columns<S>) -> [S; 3] {
    let cof = cofactor(jacobian);
    [inner(jacobian, jacobian), inner(&cof, &cof), dot(jacobian[0], cof[0])]
}

/// The columns of a matrix.
pub fn to_columns(matrix: &Matrix3<f64>) -> Columns<f64> {
    std::array::from_fn(|column| std::array::from_fn(|row| matrix[(row, column)]))
}

/// The matrix of these columns.
pub fn from_columns(columns: &Columns<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| columns[column][row])
}

/// `sum_mn H_mn vec(Q_m) vec(Q_n)^T` over the frame's nine matrices `Q = u_i v_j^T`.
fn hessian_from_spectrum(svd: &SignedSvd<f64>, spectrum: &Spectrum<f64>) -> Matrix9 {
    let (direct, crossed) = spectrum.pairs();
    // Coordinates (i, j) of the frame at row 3j + i, as vec() has it.
    let mut frame = Matrix9::zeros();
    let mut inner = Matrix9::zeros();
    for i in 0..3 {
        for j in 0..3 {
            for row in 0..3 {
                for column in 0..3 {
                    frame[(3 * column + row, 3 * j + i)] = svd.u[i][row] * svd.v[j][column];
                }
            }
            inner[(4 * i, 4 * j)] = spectrum.scaling_entry(i, j);
            if i != j {
                let k = 3 - i - j;
                inner[(3 * j + i, 3 * j + i)] = direct[k];
                inner[(3 * j + i, 3 * i + j)] = crossed[k];
            }
        }
    }
    frame * inner * frame.transpose()
}

/// Every energy, in the order of the documentation.
pub fn energies() -> &'static [&'static dyn Energy] {
    use separable::BySingularValues as By;
    &[
        &dirichlet::Dirichlet,
        &By(arap::Arap),
        &stretch::Stretch,
        &lscm::Lscm,
        &lpm::Lpm,
        &By(hencky::Hencky),
        &symmetric_dirichlet::SymmetricDirichlet,
        &condition_number::ConditionNumber,
        &condition_number_squared::ConditionNumberSquared,
        &mips::Mips,
        &amips::Amips,
        &mean_ratio::MeanRatio,
    ]
}

/// The energy of this name.
pub fn find(name: &str) -> Option<&'static dyn Energy> {
    energies().iter().copied().find(|energy| energy.name() == name)
}
