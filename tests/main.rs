//! One test binary; a file a property.

mod commands;
mod connectivity;
mod damaged_files;
mod distortion;
mod energies;
mod experiment_files;
mod floors;
mod formats;
mod gate;
mod generators;
mod kernels;
mod keys;
mod mapping;
mod mesh_checks;
mod optimizers;
mod page;
mod plan;
mod rates;
mod reports;
mod runner;
mod sample;
mod sparse;
mod store;
mod tiny_method;
mod volume_map;
mod volume_map_feasibility;
