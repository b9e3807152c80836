//! The settings of a centroidal Voronoi tessellation.

use crate::geometry::centroidal_voronoi;
use crate::method::Failure;
use crate::method::setting::{Default, Field, Kind};
use serde::Deserialize;
use serde_json::Value;

/// Everything that `[settings]` may hold.
pub static FIELDS: &[Field] = &[
    Field {
        name: "sites",
        kind: Kind::Integer {
            min: 1,
            max: 100_000_000,
        },
        default: Default::Integer(1000),
        doc: "Number of sites.",
    },
    Field {
        name: "seed",
        kind: Kind::Integer { min: 0, max: i64::MAX },
        default: Default::Integer(1),
        doc: "Seed of the scattered start.",
    },
    Field {
        name: "solver",
        kind: Kind::Choice(&[
            ("l-bfgs", "limited-memory quasi-Newton (Liu et al. 2009)"),
            ("lloyd", "every site goes to the centroid of its cell"),
        ]),
        default: Default::Text("l-bfgs"),
        doc: "The minimizer.",
    },
    Field {
        name: "iteration_limit",
        kind: Kind::Integer { min: 0, max: 1_000_000 },
        default: Default::Integer(100),
        doc: "The largest number of iterations.",
    },
    Field {
        name: "gradient_tolerance",
        kind: Kind::Number { min: 0.0, max: 1.0 },
        default: Default::Number(1e-3),
        doc: "Converged when the root mean square distance of sites to centroids is below this share of the spacing, the \
              square root of the mean area of the cells.",
    },
];

/// The minimizer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    #[serde(rename = "l-bfgs")]
    Lbfgs,
    Lloyd,
}

impl From<Solver> for centroidal_voronoi::Method {
    fn from(solver: Solver) -> Self {
        match solver {
            Solver::Lbfgs => Self::Lbfgs,
            Solver::Lloyd => Self::Lloyd,
        }
    }
}

/// The settings in types.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Settings {
    pub sites: u64,
    pub seed: u64,
    pub solver: Solver,
    pub iteration_limit: u64,
    pub gradient_tolerance: f64,
}

impl Settings {
    /// The settings of validated values with every default filled in.
    ///
    /// # Errors
    /// `invalid-input` when a value is missing or of another type.
    pub fn resolve(settings: &Value) -> Result<Settings, Failure> {
        serde_json::from_value(settings.clone())
            .map_err(|error| Failure::invalid(format!("settings of centroidal-voronoi: {error}")))
    }
}
