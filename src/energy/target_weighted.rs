//! Any energy weighted by the volume of the image: `det J Psi(J)`.
//!
//! Averaged over the source it is the mean of `Psi` over the image, up to the factor of the volumes. With the stretch
//! energy it is the Dirichlet energy of the inverse map. The factor weakens barriers: with the Hencky energy, the
//! condition number and the mean ratio the product stays bounded as one singular value falls to 0, and only the explicit
//! test of the determinant is left.

use super::spectrum::{PAIRS, Slopes, Spectrum};
use super::{Description, Energy, Variables};
use crate::linalg::jet::SYMMETRIC;
use crate::linalg::lanes::{Lanes, Vector, load};
use crate::linalg::processor::{Kernel, Processor};
use crate::linalg::scalar::Scalar;

/// `det J` times the energy within; only where the determinant is positive if that is a barrier.
pub struct TargetWeighted(pub &'static dyn Energy);

/// Derivative of `s0 s1 s2`.
#[inline(always)]
fn cofactors<S: Scalar>(s: [S; 3]) -> [S; 3] {
    [s[1] * s[2], s[0] * s[2], s[0] * s[1]]
}

/// The determinant and its derivative by the variables.
#[inline(always)]
fn determinant<S: Scalar>(kind: Variables, variables: [S; 3]) -> (S, [S; 3]) {
    let zero = S::constant(0.0);
    match kind {
        Variables::Invariants => (variables[2], [zero, zero, S::constant(1.0)]),
        Variables::SingularValues => {
            let slopes = cofactors(variables);
            (variables[2] * slopes[2], slopes)
        }
    }
}

/// `d Psi / d s_i` from the partials by the variables.
#[inline(always)]
fn by_singular_values<S: Scalar>(kind: Variables, s: [S; 3], partials: [S; 3]) -> [S; 3] {
    if kind == Variables::SingularValues {
        return partials;
    }
    let cof = cofactors(s);
    let mut slopes = partials;
    for (k, &(i, j)) in PAIRS.iter().enumerate() {
        let others = s[i].square() + s[j].square();
        slopes[k] = (s[k] + s[k]) * (partials[0] + partials[1] * others) + cof[k] * partials[2];
    }
    slopes
}

#[inline(always)]
fn weigh_slopes<S: Scalar>(kind: Variables, variables: [S; 3], inner: Slopes<S>) -> Slopes<S> {
    let (d, d_slopes) = determinant(kind, variables);
    let mut result = inner;
    result.value = d * inner.value;
    for i in 0..3 {
        result.partials[i] = d * inner.partials[i] + inner.value * d_slopes[i];
    }
    result
}

/// The product rule in the frame of the singular vectors, which `det J` shares: its flips are `-s_k`, its twists
/// `s_k`, its second derivatives by `s_i` and `s_j` are `s_k`.
#[inline(always)]
fn weigh_spectrum<S: Scalar>(kind: Variables, s: [S; 3], invariants: [S; 3], inner: Spectrum<S>) -> Spectrum<S> {
    let variables = match kind {
        Variables::Invariants => invariants,
        Variables::SingularValues => s,
    };
    let (d, _) = determinant(kind, variables);
    let slopes = weigh_slopes(
        kind,
        variables,
        Slopes {
            value: inner.value,
            partials: inner.partials,
        },
    );
    let (d_i, psi_i) = (cofactors(s), by_singular_values(kind, s, inner.partials));
    let mut result = inner;
    result.value = slopes.value;
    result.partials = slopes.partials;
    for k in 0..3 {
        let turn = inner.value * s[k];
        result.flip[k] = d * inner.flip[k] - turn;
        result.twist[k] = d * inner.twist[k] + turn;
    }
    for (n, &(i, j)) in SYMMETRIC.iter().enumerate() {
        let sum = d * inner.scaling[n] + (d_i[i] * psi_i[j] + psi_i[i] * d_i[j]);
        result.scaling[n] = if i == j { sum } else { sum + inner.value * s[3 - i - j] };
    }
    result
}

struct Values<'a> {
    kind: Variables,
    variables: &'a [[Lanes; 3]],
    values: &'a mut [Lanes],
}

impl Kernel for Values<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (variables, value) in self.variables.iter().zip(self.values) {
            let (d, _) = determinant::<V>(self.kind, load(variables));
            (d * V::load(value)).store(value);
        }
    }
}

struct AllSlopes<'a> {
    kind: Variables,
    variables: &'a [[Lanes; 3]],
    slopes: &'a mut [Slopes<Lanes>],
}

impl Kernel for AllSlopes<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (variables, slopes) in self.variables.iter().zip(self.slopes) {
            weigh_slopes::<V>(self.kind, load(variables), Slopes::load(slopes)).store(slopes);
        }
    }
}

struct Spectra<'a> {
    kind: Variables,
    singular_values: &'a [[Lanes; 3]],
    invariants: &'a [[Lanes; 3]],
    spectra: &'a mut [Spectrum<Lanes>],
}

impl Kernel for Spectra<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for ((s, invariants), spectrum) in self.singular_values.iter().zip(self.invariants).zip(self.spectra) {
            weigh_spectrum::<V>(self.kind, load(s), load(invariants), Spectrum::load(spectrum)).store(spectrum);
        }
    }
}

impl Energy for TargetWeighted {
    fn description(&self) -> Description {
        self.0.description()
    }

    fn variables(&self) -> Variables {
        self.0.variables()
    }

    fn values_in_lanes(&self, processor: Processor, variables: &[[Lanes; 3]], values: &mut [Lanes]) {
        self.0.values_in_lanes(processor, variables, values);
        processor.run(Values {
            kind: self.variables(),
            variables,
            values,
        });
    }

    fn slopes_in_lanes(&self, processor: Processor, variables: &[[Lanes; 3]], slopes: &mut [Slopes<Lanes>]) {
        self.0.slopes_in_lanes(processor, variables, slopes);
        processor.run(AllSlopes {
            kind: self.variables(),
            variables,
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
        self.0.spectra_in_lanes(processor, singular_values, invariants, spectra);
        processor.run(Spectra {
            kind: self.variables(),
            singular_values,
            invariants,
            spectra,
        });
    }

    fn slopes(&self, variables: [f64; 3]) -> Slopes<f64> {
        weigh_slopes(self.variables(), variables, self.0.slopes(variables))
    }

    fn spectrum(&self, singular_values: [f64; 3], invariants: [f64; 3]) -> Spectrum<f64> {
        weigh_spectrum(
            self.variables(),
            singular_values,
            invariants,
            self.0.spectrum(singular_values, invariants),
        )
    }
}
