//! One test binary; a file a property.

mod floors;
mod formats;
