//! vargeo runs batches of geometry experiments described in TOML and turns them into tables, plots, pictures and a page.
//!
//! The modules below are the floors of the house, bottom first. A file names only its own floor and those beneath it;
//! `tests/floors.rs` reads the sources and proves it.

pub mod linalg;
pub mod mesh;
pub mod energy;
pub mod optimize;
pub mod geometry;
pub mod fem;
pub mod metric;
pub mod method;
pub mod experiment;
pub mod run;
pub mod report;
pub mod cli;
