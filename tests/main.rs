//! One test binary; a file a property.

mod energies;
mod experiment_files;
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
mod tiny_method;
