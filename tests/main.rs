//! One test binary; a file a property.

mod floors;
mod energies;
mod kernels;
mod mapping;
mod runner;
mod sparse;
mod formats;
mod store;
