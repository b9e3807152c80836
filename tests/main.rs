//! One test binary; a file a property.

mod energies;
mod floors;
mod gate;
mod kernels;
mod mapping;
mod runner;
mod page;
mod rates;
mod reports;
mod sample;
mod sparse;
mod formats;
mod store;
