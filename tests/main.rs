//! One test binary; a file a property.

mod experiment_files;
mod floors;
mod tiny_method;
mod energies;
mod kernels;
mod mapping;
mod sparse;
