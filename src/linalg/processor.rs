//! Runs a vector kernel with the widest registers of the processor at hand.
//!
//! A kernel is a [`Kernel`] with an `#[inline(always)]` body, generic over the vector. All instruction sets give the same
//! bits: only IEEE additions, products, quotients and square roots are used, never fused.

use super::lanes::{Lanes, Vector};

/// An instruction set to run kernels with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processor {
    /// What the compiler's target guarantees.
    Baseline,
}

/// A computation over [`Lanes`] that is compiled once for every instruction set.
pub trait Kernel {
    /// Must be `#[inline(always)]`, together with everything it calls.
    fn run<V: Vector>(self);
}

impl Processor {
    /// The best instruction set that this machine has.
    pub fn detect() -> Processor {
        Processor::Baseline
    }

    /// Every instruction set that this machine has.
    pub fn available() -> Vec<Processor> {
        vec![Processor::Baseline]
    }

    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) {
        match self {
            Processor::Baseline => kernel.run::<Lanes>(),
        }
    }
}
