//! One test binary; a file a property.

mod floors;
mod runner;
mod store;
