//! One test binary; a file a property.

mod experiment_files;
mod floors;
mod tiny_method;
