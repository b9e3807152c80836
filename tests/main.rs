//! One test binary; a file a property.

mod energies;
mod damaged_files;
mod floors;
mod formats;
mod gate;
mod kernels;
mod mapping;
mod page;
mod rates;
mod reports;
mod runner;
mod sample;
mod sparse;
mod store;
