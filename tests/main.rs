//! One test binary; a file a property.

mod damaged_files;
mod floors;
mod formats;
