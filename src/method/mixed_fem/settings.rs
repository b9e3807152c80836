//! The settings of a mixed finite element computation in the typed form that it reads.

use super::fields::FIELDS;
use super::scheme::{Mass, Relaxation, Scheme, Stabilisation};
use crate::method::Failure;
use crate::method::setting::fill;
use serde::{Deserialize, Serialize};
use serde_json::Value;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Equation {
    Biharmonic,
    Triharmonic,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Condition {
    Region,
    Curve,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Curve {
    Stabilised,
    FirstOrderRing,
    SecondOrderRing,
    Unstabilised,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum System {
    Auto,
    OneField,
    Mixed,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    Auto,
    Cholesky,
    Ldlt,
    Lblt,
    Lu,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DataKind {
    Auto,
    Function,
    Position,
    Displacement,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fill {
    None,
    Largest,
    All,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OnSingular {
    Refuse,
    Continue,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Select {
    All,
    Box,
    Sphere,
    Plane,
    Nearest,
    Boundary,
    Loop,
    File,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    Free,
    Fixed,
    Moved,
}

/// An entry of `handles`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Handle {
    pub select: Select,
    pub role: Role,
    pub min: Option<[f64; 3]>,
    pub max: Option<[f64; 3]>,
    pub center: Option<[f64; 3]>,
    pub radius: Option<f64>,
    pub normal: Option<[f64; 3]>,
    pub relative: bool,
    #[serde(rename = "loop")]
    pub boundary_loop: u64,
    pub rings: u64,
    pub value: i64,
    pub translate: Option<[f64; 3]>,
    pub turn: Option<[f64; 3]>,
    pub stretch: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tangents {
    pub angle: f64,
    pub scale: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curvature {
    pub scale: f64,
    pub offset: f64,
}

/// The settings with every default filled in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    pub equation: Equation,
    pub condition: Condition,
    pub curve: Curve,
    pub relaxation: Relaxation,
    pub stabilisation: f64,
    pub mass: Mass,
    pub system: System,
    pub solver: Solver,
    pub data: DataKind,
    pub function: String,
    pub handles: Option<Vec<Handle>>,
    pub tangents: Tangents,
    pub curvature: Curvature,
    pub fill: Fill,
    pub frames: u64,
    pub on_singular: OnSingular,
    pub compare: bool,
}

impl Settings {
    /// Reads validated settings, full or canonical; absent fields take their declared values.
    ///
    /// # Errors
    /// A value that the declaration does not allow.
    pub fn resolve(settings: &Value) -> Result<Settings, Failure> {
        serde_json::from_value(Value::Object(fill(FIELDS, settings))).map_err(|error| {
            Failure::invalid(format!(
                "settings of mixed-fem: {error}; places such as \"min\" or \"center\" are lists of three numbers"
            ))
        })
    }

    /// The order of the equation: 2 or 3.
    pub fn order(&self) -> usize {
        match self.equation {
            Equation::Biharmonic => 2,
            Equation::Triharmonic => 3,
        }
    }

    pub fn stabilisation(&self) -> Stabilisation {
        Stabilisation {
            relaxation: self.relaxation,
            factor: self.stabilisation,
        }
    }

    pub fn scheme(&self) -> Scheme {
        match (self.condition, self.equation, self.curve) {
            (Condition::Region, ..) => Scheme::Region,
            (Condition::Curve, Equation::Biharmonic, _) => Scheme::Curve,
            (Condition::Curve, Equation::Triharmonic, Curve::Stabilised) => Scheme::Stabilised,
            (Condition::Curve, Equation::Triharmonic, Curve::FirstOrderRing) => Scheme::FirstOrderRing,
            (Condition::Curve, Equation::Triharmonic, Curve::SecondOrderRing) => Scheme::SecondOrderRing,
            (Condition::Curve, Equation::Triharmonic, Curve::Unstabilised) => Scheme::Unstabilised,
        }
    }

    /// Whether a one-field system exists.
    pub fn has_one_field(&self) -> bool {
        let scheme = self.scheme();
        let coupled = scheme == Scheme::Stabilised && self.relaxation == Relaxation::Tangential;
        self.mass != Mass::Full && scheme != Scheme::Unstabilised && !coupled
    }

    /// Whether the one-field system is factorized.
    pub fn one_field(&self) -> bool {
        match self.system {
            System::OneField => true,
            System::Mixed => false,
            System::Auto => self.has_one_field() && self.solver == Solver::Cholesky,
        }
    }

    /// Whether a singular system ends in a result that tells so. Only the unstabilised one is known to be singular.
    pub fn goes_on_singular(&self) -> bool {
        self.scheme() == Scheme::Unstabilised && self.on_singular == OnSingular::Continue
    }

    /// The settings as a table without those that cannot change the result.
    pub fn canonical(&self) -> Value {
        let Ok(Value::Object(mut table)) = serde_json::to_value(self) else {
            return Value::Null;
        };
        let mut drop = |names: &[&str]| {
            for name in names {
                table.remove(*name);
            }
        };
        let scheme = self.scheme();
        if !(self.condition == Condition::Curve && self.equation == Equation::Triharmonic) {
            drop(&["curve"]);
        }
        if scheme != Scheme::Stabilised {
            drop(&["relaxation", "stabilisation"]);
        }
        if scheme != Scheme::Unstabilised {
            drop(&["on_singular"]);
        }
        if self.condition == Condition::Region {
            drop(&["tangents"]);
        }
        if !(self.condition == Condition::Curve && self.equation == Equation::Triharmonic) {
            drop(&["curvature"]);
        }
        if matches!(self.data, DataKind::Position | DataKind::Displacement) {
            drop(&["function"]);
        }
        if self.data == DataKind::Function {
            drop(&["tangents", "curvature"]);
        }
        let system = if self.one_field() { "one-field" } else { "mixed" };
        table.insert("system".to_string(), Value::from(system));
        if self.one_field() {
            table.insert("solver".to_string(), Value::from("cholesky"));
        }
        table.retain(|_, value| !value.is_null());
        Value::Object(table)
    }
}

/// What a one-field system needs.
pub(super) const ONE_FIELD: &str = "a lumped mass and, with curve conditions on the triharmonic equation, any curve but \
                                    \"unstabilised\" and any relaxation but \"tangential\"";

/// Checks that go across fields: path of the offending field and message.
pub fn check(settings: &Value) -> Vec<(String, String)> {
    let settings = match Settings::resolve(settings) {
        Ok(settings) => settings,
        Err(failure) => return vec![("handles".to_string(), failure.reason)],
    };
    let mut errors = Vec::new();
    let mut error = |path: &str, message: String| errors.push((path.to_string(), message));
    if settings.mass == Mass::Full && settings.condition == Condition::Region {
        error(
            "mass",
            "region conditions need a lumped mass; use \"hybrid\" or \"barycentric\", or condition = \"curve\"".into(),
        );
    }
    if settings.system == System::OneField && !settings.has_one_field() {
        error(
            "system",
            format!("the one-field system needs {ONE_FIELD}; use system = \"mixed\""),
        );
    }
    let one_field = settings.one_field();
    if one_field && matches!(settings.solver, Solver::Ldlt | Solver::Lblt | Solver::Lu) {
        error(
            "solver",
            "the one-field system is positive definite: use \"cholesky\" or system = \"mixed\"".into(),
        );
    }
    if !one_field && settings.solver == Solver::Cholesky {
        error(
            "solver",
            if settings.has_one_field() {
                "the mixed system is indefinite: use \"ldlt\", \"lblt\" or \"lu\", or system = \"one-field\""
                    .to_string()
            } else {
                format!("it is for the one-field system, which needs {ONE_FIELD}; use \"ldlt\", \"lblt\" or \"lu\"")
            },
        );
    }
    for (index, handle) in settings.handles.iter().flatten().enumerate() {
        let mut needs = |given: bool, name: &str| {
            if !given {
                error(
                    "handles",
                    format!("handle {index} (from 0) has no \"{name}\", which its \"select\" needs"),
                );
            }
        };
        match handle.select {
            Select::Box => {
                needs(handle.min.is_some(), "min");
                needs(handle.max.is_some(), "max");
            }
            Select::Sphere => {
                needs(handle.center.is_some(), "center");
                needs(handle.radius.is_some(), "radius");
            }
            Select::Plane => {
                needs(handle.center.is_some(), "center");
                needs(handle.normal.is_some(), "normal");
            }
            Select::Nearest => needs(handle.center.is_some(), "center"),
            Select::All | Select::Boundary | Select::Loop | Select::File => {}
        }
        let motion = handle.translate.is_some() || handle.turn.is_some() || handle.stretch != 1.0;
        if motion && handle.role != Role::Moved {
            error(
                "handles",
                format!("handle {index} (from 0) has a motion but is not moved; set role = \"moved\""),
            );
        }
        if !motion && handle.role == Role::Moved {
            error(
                "handles",
                format!(
                    "handle {index} (from 0) is moved but has no motion; give \"translate\", \"turn\" or \"stretch\", or set \
                     role = \"fixed\""
                ),
            );
        }
    }
    errors
}
