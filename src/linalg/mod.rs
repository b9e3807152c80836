//! Small dense helpers in vector lanes, and sparse symmetric factorizations.
//!
//! Everything here is deterministic: the same input gives the same bits with any number of threads.

pub mod sparse;
