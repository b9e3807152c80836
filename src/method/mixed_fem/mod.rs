//! Mixed finite elements: biharmonic and triharmonic problems with linear elements, for convergence studies in the plane
//! and for modelling surfaces.
//!
//! The stages: [`model`] reads or generates a mesh, [`handles`] says which vertices are fixed, [`domain`] finds the sets
//! that the systems speak of, [`scheme`] discretizes, [`system`] factorizes and solves, [`planar_data`] measures errors
//! against a function and [`seam`] how smoothly a surface joins what is kept.
//! Source: Jacobson, Tosun, Sorkine, Zorin 2010, Mixed finite elements for variational surface modeling.
//!
//! Guaranteed: the relative residual of every reported solution is below 1e-9; the same input gives the same bits with
//! any number of threads. Not guaranteed: convergence of the paper's triharmonic systems on irregular meshes.

mod block_factor;
pub mod domain;
pub mod factorization;
pub mod fields;
pub mod function;
pub mod handles;
pub mod hole;
mod lblt;
mod lu;
pub mod metrics;
pub mod mixed_system;
pub mod model;
pub mod one_field;
pub mod planar_data;
pub mod scheme;
pub mod seam;
pub mod settings;
pub mod signed_system;
pub mod singular;
pub mod study;
pub mod surface_data;
pub mod surface_study;
pub mod system;

use super::model::ModelKind;
use super::setting::Field;
use super::{Failure, Inputs, Method, Outcome};
use crate::metric::Metric;
use crate::optimize::Observer;
use serde_json::Value;
use settings::Settings;

/// The method `mixed-fem`.
pub struct MixedFem;

impl Method for MixedFem {
    fn name(&self) -> &'static str {
        "mixed-fem"
    }

    fn version(&self) -> u32 {
        4
    }

    fn summary(&self) -> &'static str {
        "solves biharmonic and triharmonic problems with mixed linear elements, in the plane and on surfaces"
    }

    fn source(&self) -> &'static str {
        "Mixed finite elements for variational surface modeling, Computer Graphics Forum 29(5), 2010"
    }

    fn model(&self) -> &'static ModelKind {
        model::kind()
    }

    fn settings(&self) -> &'static [Field] {
        fields::FIELDS
    }

    fn check(&self, settings: &Value) -> Vec<(String, String)> {
        settings::check(settings)
    }

    fn canonical(&self, settings: Value) -> Value {
        match Settings::resolve(&settings) {
            Ok(resolved) => resolved.canonical(),
            // Left as it is: running it will say what is wrong.
            Err(_) => settings,
        }
    }

    fn metrics(&self) -> &'static [Metric] {
        metrics::ALL
    }

    fn counters(&self) -> &'static [(&'static str, &'static str)] {
        metrics::COUNTERS
    }

    fn run(&self, inputs: Inputs<'_>, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let settings = Settings::resolve(inputs.settings)?;
        observer.phase("prepare");
        let model = model::load(&inputs.model)?;
        study::run(model, &settings, observer)
    }
}
