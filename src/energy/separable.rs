//! Energies written as a sum `g(s0) + g(s1) + g(s2)` over the signed singular values.

use super::spectrum::{PAIRS, Slopes, Spectrum};
use super::{Description, Energy, Variables};
use crate::linalg::jet::Jet;
use crate::linalg::lanes::{Lanes, Vector, load};
use crate::linalg::processor::{Kernel, Processor};
use crate::linalg::scalar::{Real, Scalar};

/// A density by its term `g`; everything else of [`Energy`] follows through [`BySingularValues`].
///
/// All methods must be `#[inline(always)]`, for they are compiled into vector kernels.
pub trait Separable: Send + Sync {
    fn description(&self) -> Description;
    /// The term `g(s)`.
    fn term<S: Scalar>(&self, s: S) -> S;
    /// `(g'(a) - g'(b)) / (a - b)`, and `g''(a)` where they are equal, without cancellation.
    fn slope_difference<R: Real>(&self, a: R, b: R) -> R;
}

/// The energy of a [`Separable`] term.
#[derive(Clone, Copy, Debug)]
pub struct BySingularValues<F>(pub F);

/// Below this the sum of two singular values counts as zero, where a twist's eigenvalue has a pole.
const LEAST_SUM: f64 = 1e-9;

#[inline(always)]
fn jet<F: Separable, R: Real>(formula: &F, s: R) -> Jet<R> {
    formula.term(Jet::variable(s, 0))
}

#[inline(always)]
fn value<F: Separable, S: Scalar>(formula: &F, s: [S; 3]) -> S {
    formula.term(s[0]) + formula.term(s[1]) + formula.term(s[2])
}

#[inline(always)]
fn slopes<F: Separable, R: Real>(formula: &F, s: [R; 3]) -> Slopes<R> {
    let mut partials = s;
    for i in 0..3 {
        partials[i] = jet(formula, s[i]).gradient[0];
    }
    Slopes {
        value: value(formula, s),
        partials,
    }
}

#[inline(always)]
fn spectrum<F: Separable, R: Real>(formula: &F, s: [R; 3]) -> Spectrum<R> {
    let zero = R::constant(0.0);
    let jets = [jet(formula, s[0]), jet(formula, s[1]), jet(formula, s[2])];
    let first = [jets[0].gradient[0], jets[1].gradient[0], jets[2].gradient[0]];
    let mut result = Spectrum {
        value: value(formula, s),
        partials: first,
        scaling: [
            jets[0].hessian[0],
            zero,
            zero,
            jets[1].hessian[0],
            zero,
            jets[2].hessian[0],
        ],
        flip: [zero; 3],
        twist: [zero; 3],
    };
    for (k, &(i, j)) in PAIRS.iter().enumerate() {
        result.flip[k] = formula.slope_difference(s[i], s[j]);
        result.twist[k] = (first[i] + first[j]) / (s[i] + s[j]).max(R::constant(LEAST_SUM));
    }
    result
}

struct Values<'a, F> {
    formula: &'a F,
    singular_values: &'a [[Lanes; 3]],
    values: &'a mut [Lanes],
}

impl<F: Separable> Kernel for Values<'_, F> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (s, out) in self.singular_values.iter().zip(self.values) {
            value::<F, V>(self.formula, load(s)).store(out);
        }
    }
}

struct AllSlopes<'a, F> {
    formula: &'a F,
    singular_values: &'a [[Lanes; 3]],
    slopes: &'a mut [Slopes<Lanes>],
}

impl<F: Separable> Kernel for AllSlopes<'_, F> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (s, out) in self.singular_values.iter().zip(self.slopes) {
            slopes::<F, V>(self.formula, load(s)).store(out);
        }
    }
}

struct Spectra<'a, F> {
    formula: &'a F,
    singular_values: &'a [[Lanes; 3]],
    spectra: &'a mut [Spectrum<Lanes>],
}

impl<F: Separable> Kernel for Spectra<'_, F> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (s, out) in self.singular_values.iter().zip(self.spectra) {
            spectrum::<F, V>(self.formula, load(s)).store(out);
        }
    }
}

impl<F: Separable> Energy for BySingularValues<F> {
    fn description(&self) -> Description {
        self.0.description()
    }

    fn variables(&self) -> Variables {
        Variables::SingularValues
    }

    fn values_in_lanes(&self, processor: Processor, variables: &[[Lanes; 3]], values: &mut [Lanes]) {
        processor.run(Values {
            formula: &self.0,
            singular_values: variables,
            values,
        });
    }

    fn slopes_in_lanes(&self, processor: Processor, variables: &[[Lanes; 3]], slopes: &mut [Slopes<Lanes>]) {
        processor.run(AllSlopes {
            formula: &self.0,
            singular_values: variables,
            slopes,
        });
    }

    fn spectra_in_lanes(
        &self,
        processor: Processor,
        singular_values: &[[Lanes; 3]],
        _invariants: &[[Lanes; 3]],
        spectra: &mut [Spectrum<Lanes>],
    ) {
        processor.run(Spectra {
            formula: &self.0,
            singular_values,
            spectra,
        });
    }

    fn slopes(&self, variables: [f64; 3]) -> Slopes<f64> {
        slopes(&self.0, variables)
    }

    fn spectrum(&self, singular_values: [f64; 3], _invariants: [f64; 3]) -> Spectrum<f64> {
        spectrum(&self.0, singular_values)
    }
}
