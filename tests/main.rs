//! One test binary; a file a property.

mod damaged_files;
mod energies;
mod experiment_files;
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
mod volume_map;
mod volume_map_feasibility;
mod tiny_method;
mod connectivity;
mod generators;
mod mesh_checks;
