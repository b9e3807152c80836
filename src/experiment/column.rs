//! The numbers of a record that a file may name: metrics, counters, measurements and traces.

use super::record::MEASUREMENTS;
use crate::method::Method;
use crate::metric::{Better, Metric};

/// Every column of a method's records, in the order metrics, counters, measurements.
pub fn columns(method: &dyn Method) -> Vec<Metric> {
    let counters = method.counters().iter().map(|&(name, definition)| Metric {
        name,
        symbol: name,
        unit: "",
        floor: Some(0.0),
        better: Better::Lower,
        definition,
    });
    method
        .metrics()
        .iter()
        .copied()
        .chain(counters)
        .chain(MEASUREMENTS.iter().copied())
        .collect()
}

/// The column of this name.
pub fn find(method: &dyn Method, name: &str) -> Option<Metric> {
    columns(method).into_iter().find(|column| column.name == name)
}
