//! One test binary; a file a property.

mod floors;
mod connectivity;
mod generators;
mod mesh_checks;
