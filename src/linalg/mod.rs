//! Small dense helpers in vector lanes, and sparse symmetric factorizations.
//!
//! Everything here is deterministic: the same input gives the same bits with any number of threads. The dense kernels
//! use no fused multiply-add and no library function, so they give the same bits on every processor as well.

pub mod scalar;
pub mod elementary;
pub mod jet;
pub mod lanes;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
pub mod processor;
pub mod vector3;
pub mod svd3;
pub mod eigen3;
mod fresh_memory;
pub mod sparse;
