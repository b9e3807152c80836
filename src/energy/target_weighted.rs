//! Any energy weighted by the volume of the image: `det J Psi(J)`.
//!
//! Averaged over the source it is the mean of `Psi` over the image, up to the factor of the volumes. With the stretch
//! energy it is the Dirichlet energy of the inverse map.

use super::spectrum::{PAIRS, Slopes, Spectrum};
use super::{Description, Energy, Variables};
use crate::linalg::lanes::{Lanes, WIDTH};
use crate::linalg::processor::Processor;

/// `det J` times the energy within; only where the determinant is positive if that is a barrier.
pub struct TargetWeighted(pub &'static dyn Energy);

/// The determinant from an energy's variables.
fn determinant(kind: Variables, variables: [f64; 3]) -> f64 {
    match kind {
        Variables::Invariants => variables[2],
        Variables::SingularValues => variables[0] * variables[1] * variables[2],
    }
}

/// Derivative of the determinant by the variables.
fn determinant_slopes(kind: Variables, variables: [f64; 3]) -> [f64; 3] {
    match kind {
        Variables::Invariants => [0.0, 0.0, 1.0],
        Variables::SingularValues => cofactors(variables),
    }
}

/// Derivative of `s0 s1 s2`.
fn cofactors([s0, s1, s2]: [f64; 3]) -> [f64; 3] {
    [s1 * s2, s0 * s2, s0 * s1]
}

/// `d Psi / d s_i` from the partials by the variables.
fn by_singular_values(kind: Variables, s: [f64; 3], partials: [f64; 3]) -> [f64; 3] {
    match kind {
        Variables::SingularValues => partials,
        Variables::Invariants => {
            let a: f64 = s.iter().map(|s| s * s).sum();
            let cof = cofactors(s);
            std::array::from_fn(|i| 2.0 * s[i] * (partials[0] + partials[1] * (a - s[i] * s[i])) + cof[i] * partials[2])
        }
    }
}

fn lane<const N: usize>(lanes: &[Lanes; N], index: usize) -> [f64; N] {
    std::array::from_fn(|i| lanes[i].0[index])
}

fn set_lane<const N: usize>(lanes: &mut [Lanes; N], index: usize, values: [f64; N]) {
    for (lanes, value) in lanes.iter_mut().zip(values) {
        lanes.0[index] = value;
    }
}

impl TargetWeighted {
    fn weigh_slopes(&self, variables: [f64; 3], slopes: Slopes<f64>) -> Slopes<f64> {
        let kind = self.0.variables();
        let (d, d_slopes) = (determinant(kind, variables), determinant_slopes(kind, variables));
        Slopes {
            value: d * slopes.value,
            partials: std::array::from_fn(|i| d * slopes.partials[i] + slopes.value * d_slopes[i]),
        }
    }

    /// The product rule in the frame of the singular vectors, which `det J` shares: its flips are `-s_k`, its twists
    /// `s_k`, its second derivatives by `s_i` and `s_j` are `s_k`.
    fn weigh_spectrum(&self, s: [f64; 3], invariants: [f64; 3], inner: Spectrum<f64>) -> Spectrum<f64> {
        let kind = self.0.variables();
        let variables = match kind {
            Variables::Invariants => invariants,
            Variables::SingularValues => s,
        };
        let d = invariants[2];
        let slopes = self.weigh_slopes(
            variables,
            Slopes {
                value: inner.value,
                partials: inner.partials,
            },
        );
        let (d_i, psi_i) = (cofactors(s), by_singular_values(kind, s, inner.partials));
        let mut result = Spectrum {
            value: slopes.value,
            partials: slopes.partials,
            ..inner
        };
        for k in 0..3 {
            result.flip[k] = d * inner.flip[k] - inner.value * s[k];
            result.twist[k] = d * inner.twist[k] + inner.value * s[k];
        }
        let place = |i: usize, j: usize| match (i, j) {
            (0, j) => j,
            (1, j) => j + 2,
            _ => 5,
        };
        for i in 0..3 {
            result.scaling[place(i, i)] = d * inner.scaling[place(i, i)] + 2.0 * d_i[i] * psi_i[i];
        }
        for (k, &(i, j)) in PAIRS.iter().enumerate() {
            result.scaling[place(i, j)] =
                d * inner.scaling[place(i, j)] + inner.value * s[k] + d_i[i] * psi_i[j] + psi_i[i] * d_i[j];
        }
        result
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
        let kind = self.0.variables();
        for (variables, value) in variables.iter().zip(values) {
            for index in 0..WIDTH {
                value.0[index] *= determinant(kind, lane(variables, index));
            }
        }
    }

    fn slopes_in_lanes(&self, processor: Processor, variables: &[[Lanes; 3]], slopes: &mut [Slopes<Lanes>]) {
        self.0.slopes_in_lanes(processor, variables, slopes);
        for (variables, slopes) in variables.iter().zip(slopes) {
            for index in 0..WIDTH {
                let inner = Slopes {
                    value: slopes.value.0[index],
                    partials: lane(&slopes.partials, index),
                };
                let weighed = self.weigh_slopes(lane(variables, index), inner);
                slopes.value.0[index] = weighed.value;
                set_lane(&mut slopes.partials, index, weighed.partials);
            }
        }
    }

    fn spectra_in_lanes(
        &self,
        processor: Processor,
        singular_values: &[[Lanes; 3]],
        invariants: &[[Lanes; 3]],
        spectra: &mut [Spectrum<Lanes>],
    ) {
        self.0.spectra_in_lanes(processor, singular_values, invariants, spectra);
        for ((s, invariants), spectrum) in singular_values.iter().zip(invariants).zip(spectra) {
            for index in 0..WIDTH {
                let inner = Spectrum {
                    value: spectrum.value.0[index],
                    partials: lane(&spectrum.partials, index),
                    scaling: lane(&spectrum.scaling, index),
                    flip: lane(&spectrum.flip, index),
                    twist: lane(&spectrum.twist, index),
                };
                let weighed = self.weigh_spectrum(lane(s, index), lane(invariants, index), inner);
                spectrum.value.0[index] = weighed.value;
                set_lane(&mut spectrum.partials, index, weighed.partials);
                set_lane(&mut spectrum.scaling, index, weighed.scaling);
                set_lane(&mut spectrum.flip, index, weighed.flip);
                set_lane(&mut spectrum.twist, index, weighed.twist);
            }
        }
    }

    fn slopes(&self, variables: [f64; 3]) -> Slopes<f64> {
        self.weigh_slopes(variables, self.0.slopes(variables))
    }

    fn spectrum(&self, singular_values: [f64; 3], invariants: [f64; 3]) -> Spectrum<f64> {
        self.weigh_spectrum(
            singular_values,
            invariants,
            self.0.spectrum(singular_values, invariants),
        )
    }
}
