//! Runs a vector kernel with the widest registers of the processor at hand.
//!
//! A kernel is a [`Kernel`] with an `#[inline(always)]` body, generic over the vector. All instruction sets give the same
//! bits: only IEEE additions, products, quotients and square roots are used, never fused.

use super::lanes::{Lanes, Vector};
#[cfg(target_arch = "x86_64")]
use super::{avx2, avx512};

/// An instruction set to run kernels with. Made by [`Processor::detect`] or [`Processor::available`] only, so that it is
/// one that this machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Processor(Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    /// What the compiler's target guarantees.
    Baseline,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

/// A computation over [`Lanes`] that is compiled once for every instruction set.
pub trait Kernel {
    /// Must be `#[inline(always)]`, together with everything it calls.
    fn run<V: Vector>(self);
}

impl Processor {
    /// The best instruction set that this machine has.
    pub fn detect() -> Processor {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                return Processor(Set::Avx512);
            }
            if is_x86_feature_detected!("avx2") {
                return Processor(Set::Avx2);
            }
        }
        Processor(Set::Baseline)
    }

    /// Every instruction set that this machine has, the best one last.
    pub fn available() -> Vec<Processor> {
        let best = Processor::detect();
        let mut all = vec![Processor(Set::Baseline)];
        #[cfg(target_arch = "x86_64")]
        if best.0 == Set::Avx512 && is_x86_feature_detected!("avx2") {
            all.push(Processor(Set::Avx2));
        }
        if best != all[0] {
            all.push(best);
        }
        all
    }

    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) {
        match self.0 {
            Set::Baseline => kernel.run::<Lanes>(),
            // Safe, because this variant is only made where the features were detected.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => unsafe { with_avx2(kernel) },
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { with_avx512(kernel) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<K: Kernel>(kernel: K) {
    kernel.run::<avx2::Registers>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq")]
fn with_avx512<K: Kernel>(kernel: K) {
    kernel.run::<avx512::Register>();
}
