//! One test binary; a file a property.

mod floors;
mod gate;
mod page;
mod rates;
mod reports;
mod sample;
