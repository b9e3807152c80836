//! Polynomial volumes fitted to surfaces: hexahedra, prisms and tetrahedra of high order whose boundary flows onto a
//! target while a barrier keeps them valid.
//!
//! [`template`] and [`target`] read the model, [`objective`] puts the surface energy and the volume energy together,
//! L-BFGS minimizes stage by stage while the order rises, [`outcome`] measures. Two relatives share the machinery:
//! volumes whose unknowns are the control points of a subdivision, and [`shell`]s that take a prescribed thickness.
//! Source: Jin et al. 2013, Mapping polynomial volumes; the surface terms: Nivoliers, Yan and Lévy 2012.
//!
//! Guaranteed: every accepted iterate has positive determinants at all quadrature points; within a stage the energy never
//! rises; the same input gives the same bits with any number of threads. Not guaranteed: that elements are valid between
//! the quadrature points, which the certificate decides at the end and after each repair, not at every order on the way; that the
//! boundary does not cut through itself.

pub mod adaptivity;
pub mod chart;
pub mod distances;
pub mod fields;
pub mod files;
mod fit;
pub mod metrics;
pub mod model;
pub mod objective;
pub mod orientation;
pub mod outcome;
pub mod picture;
pub mod preconditioner;
pub mod quality;
mod repair;
pub mod settings;
pub mod shapes;
pub mod shell;
mod stage;
mod subdivision;
pub mod surface_energy;
pub mod target;
pub mod template;
pub mod untangle;
pub mod validity;

use super::model::ModelKind;
use super::setting::Field;
use super::{Failure, Inputs, Method, Outcome};
use crate::metric::Metric;
use crate::optimize::Observer;
use fit::Fit;
use serde_json::Value;
use settings::Settings;

/// The method `volume-fit`.
pub struct VolumeFit;

impl Method for VolumeFit {
    fn name(&self) -> &'static str {
        "volume-fit"
    }

    fn version(&self) -> u32 {
        12
    }

    fn summary(&self) -> &'static str {
        "fits a volume of high-order hexahedra, prisms and tetrahedra to a surface, keeping every element valid"
    }

    fn source(&self) -> &'static str {
        "Mapping polynomial volumes, Computer Graphics Forum 32, 2013"
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
        settings::canonical(&settings)
    }

    fn metrics(&self) -> &'static [Metric] {
        metrics::ALL
    }

    fn headline(&self) -> &'static [&'static str] {
        &[
            "hausdorff",
            "distance_rms",
            "scaled_jacobian_mean",
            "scaled_jacobian_min",
            "inverted",
            "certified",
            "elements",
        ]
    }

    fn incomparable(&self, metric: &str) -> &'static [&'static str] {
        match metric {
            "energy" | "energy_volume" => &["energy", "basis", "quadrature", "quadrature_points", "lambda", "model"],
            "energy_surface" => &["anisotropy", "surface_samples", "distance", "model"],
            _ => &[],
        }
    }

    fn traces(&self) -> &'static [(&'static str, &'static str)] {
        TRACES
    }

    fn counters(&self) -> &'static [(&'static str, &'static str)] {
        COUNTERS
    }

    fn run(&self, inputs: Inputs<'_>, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let settings = Settings::resolve(inputs.settings)?;
        observer.phase("prepare");
        let mut notices = Vec::new();
        let part = |role: &str| inputs.model.parts.get(role);
        let template_part = part("template")
            .ok_or_else(|| Failure::invalid("the model has no `template`; give it a file or a generator"))?;
        let (template, target) = match part("target") {
            Some(part) => {
                let target = target::read(part)?;
                (template::read(template_part, Some(&target), &mut notices)?, target)
            }
            None => {
                let template = template::read(template_part, None, &mut notices)?;
                let topology = template.mesh.topology().map_err(Failure::invalid)?;
                let target = target::of_boundary(template.boundary(&topology).map_err(Failure::invalid)?);
                (template, target)
            }
        };
        let kinds: [(bool, &str, &[&str]); 2] = [
            (template.shell.is_some(), "a shell", fields::WITHOUT_EFFECT_ON_SHELLS),
            (
                settings.levels > 0,
                "a subdivision volume",
                fields::WITHOUT_EFFECT_ON_SUBDIVISIONS,
            ),
        ];
        for (_, kind, fields) in kinds.iter().filter(|kind| kind.0) {
            let given = settings::given(inputs.settings, fields);
            if !given.is_empty() {
                notices.push(format!("{} without effect on {kind}", given.join(", ")));
            }
        }
        let mut fit = Fit::new(template, target, &settings, notices)?;
        fit.run(observer)
    }
}

/// Names and meanings of the counters.
const COUNTERS: &[(&str, &str)] = &[
    ("iterations", "accepted steps over all stages"),
    ("evaluations", "evaluations of energy and gradient"),
    ("factorizations", "factorizations of the preconditioner"),
];

/// Names and meanings of the traces.
const TRACES: &[(&str, &str)] = &[
    (
        "iteration",
        "accepted steps before this row, counted through all stages",
    ),
    ("stage", "number of the stage, from 0"),
    ("energy", "surface energy plus lambda times volume energy"),
    ("energy_surface", "the surface energy"),
    ("energy_volume", "the volume energy, without lambda"),
    ("gradient_norm", "Euclidean norm of the gradient"),
    ("step", "length factor of the step that led here"),
    ("min_determinant", "least determinant at a quadrature point"),
    ("order", "highest order of an element"),
    ("nodes", "number of nodes"),
];
