//! The properties that vargeo promises, a file each.

mod runner;
mod store;
