//! One test binary; a file a property.

mod floors;
mod energies;
mod kernels;
mod mapping;
mod sparse;
mod volume_map;
mod volume_map_feasibility;
