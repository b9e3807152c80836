//! Energies written as one formula in the invariants `A = |J|^2, B = |cof J|^2, D = det J`.

use super::spectrum::{Slopes, Spectrum, spectrum_by_invariants};
use super::{Description, Energy, Variables};
use crate::linalg::jet::Jet;
use crate::linalg::lanes::{Lanes, Vector, load};
use crate::linalg::processor::{Kernel, Processor};
use crate::linalg::scalar::Scalar;

/// A density by its formula in the invariants; everything else of [`Energy`] follows from it.
pub trait Isotropic: Send + Sync {
    fn description(&self) -> Description;
    /// The density at `[A, B, D]`. Must be `#[inline(always)]`, for it is compiled into vector kernels.
    fn evaluate<S: Scalar>(&self, invariants: [S; 3]) -> S;
}

#[inline(always)]
fn jet<F: Isotropic, S: Scalar>(formula: &F, at: [S; 3]) -> Jet<S> {
    formula.evaluate([
        Jet::variable(at[0], 0),
        Jet::variable(at[1], 1),
        Jet::variable(at[2], 2),
    ])
}

#[inline(always)]
fn slopes<F: Isotropic, S: Scalar>(formula: &F, invariants: [S; 3]) -> Slopes<S> {
    let jet = jet(formula, invariants);
    Slopes {
        value: formula.evaluate(invariants),
        partials: jet.gradient,
    }
}

#[inline(always)]
fn spectrum<F: Isotropic, S: Scalar>(formula: &F, s: [S; 3], invariants: [S; 3]) -> Spectrum<S> {
    let jet = jet(formula, invariants);
    spectrum_by_invariants(s, formula.evaluate(invariants), jet.gradient, jet.hessian)
}

struct Values<'a, F> {
    formula: &'a F,
    invariants: &'a [[Lanes; 3]],
    values: &'a mut [Lanes],
}

impl<F: Isotropic> Kernel for Values<'_, F> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (invariants, value) in self.invariants.iter().zip(self.values) {
            self.formula.evaluate::<V>(load(invariants)).store(value);
        }
    }
}

struct AllSlopes<'a, F> {
    formula: &'a F,
    invariants: &'a [[Lanes; 3]],
    slopes: &'a mut [Slopes<Lanes>],
}

impl<F: Isotropic> Kernel for AllSlopes<'_, F> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (invariants, out) in self.invariants.iter().zip(self.slopes) {
            slopes::<F, V>(self.formula, load(invariants)).store(out);
        }
    }
}

struct Spectra<'a, F> {
    formula: &'a F,
    singular_values: &'a [[Lanes; 3]],
    invariants: &'a [[Lanes; 3]],
    spectra: &'a mut [Spectrum<Lanes>],
}

impl<F: Isotropic> Kernel for Spectra<'_, F> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for ((s, invariants), out) in self.singular_values.iter().zip(self.invariants).zip(self.spectra) {
            spectrum::<F, V>(self.formula, load(s), load(invariants)).store(out);
        }
    }
}

impl<F: Isotropic> Energy for F {
    fn description(&self) -> Description {
        Isotropic::description(self)
    }

    fn variables(&self) -> Variables {
        Variables::Invariants
    }

    fn values_in_lanes(&self, processor: Processor, variables: &[[Lanes; 3]], values: &mut [Lanes]) {
        processor.run(Values {
            formula: self,
            invariants: variables,
            values,
        });
    }

    fn slopes_in_lanes(&self, processor: Processor, variables: &[[Lanes; 3]], slopes: &mut [Slopes<Lanes>]) {
        processor.run(AllSlopes {
            formula: self,
            invariants: variables,
            slopes,
        });
    }

    fn spectra_in_lanes(
        &self,
        processor: Processor,
        singular_values: &[[Lanes; 3]],
        invariants: &[[Lanes; 3]],
        spectra: &mut [Spectrum<Lanes>],
    ) {
        processor.run(Spectra {
            formula: self,
            singular_values,
            invariants,
            spectra,
        });
    }

    fn slopes(&self, variables: [f64; 3]) -> Slopes<f64> {
        slopes(self, variables)
    }

    fn spectrum(&self, singular_values: [f64; 3], invariants: [f64; 3]) -> Spectrum<f64> {
        spectrum(self, singular_values, invariants)
    }
}
