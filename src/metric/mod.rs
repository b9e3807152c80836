//! What is measured of a result: each metric has a name, a unit, a floor, a better direction and a definition.

pub mod crease;
pub mod distance;
pub mod distortion;
pub mod scaled_jacobian;

/// Which way a metric improves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    Lower,
    Higher,
    /// Descriptive only, such as a count of vertices.
    Neither,
}

/// Definition of a metric, as printed by `vargeo list metrics` and written over table columns.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// The name in tables, `expect` and `jobs.csv`: `d_ma`.
    pub name: &'static str,
    /// Typeset name for headings: `D_ma`.
    pub symbol: &'static str,
    /// `""` for a pure number.
    pub unit: &'static str,
    /// The best value that any result can have, if there is one.
    pub floor: Option<f64>,
    pub better: Better,
    /// One or two sentences with the formula and its source.
    pub definition: &'static str,
}

/// A metric in one line, for lists of them.
pub(crate) const fn metric(
    name: &'static str,
    symbol: &'static str,
    unit: &'static str,
    floor: Option<f64>,
    better: Better,
    definition: &'static str,
) -> Metric {
    Metric {
        name,
        symbol,
        unit,
        floor,
        better,
        definition,
    }
}

/// Every family of metrics of this floor; methods name those that they report and add their own.
pub fn families() -> [(&'static str, &'static [Metric]); 3] {
    [
        ("distortion", distortion::METRICS),
        ("scaled-jacobian", scaled_jacobian::METRICS),
        ("distance", distance::METRICS),
    ]
}
