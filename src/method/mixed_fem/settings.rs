//! The settings of a mixed finite element computation: declared as data, and in the typed form that it reads.

use super::function::FUNCTIONS;
use super::scheme::{Mass, Scheme};
use crate::method::Failure;
use crate::method::setting::{Default, Field, Kind, fill};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Everything that `[settings]` may hold.
pub static FIELDS: &[Field] = &[
    Field {
        name: "equation",
        kind: Kind::Choice(&[
            (
                "biharmonic",
                "order 2: the Laplacian energy, surfaces that join with common tangents",
            ),
            (
                "triharmonic",
                "order 3: the Laplacian gradient energy, surfaces that join with common curvatures",
            ),
        ]),
        default: Default::Text("biharmonic"),
        doc: "The power of the Laplacian that is solved for.",
    },
    Field {
        name: "condition",
        kind: Kind::Choice(&[
            (
                "region",
                "fixed rings of vertices around the domain, or isolated fixed points",
            ),
            (
                "curve",
                "values and conormal derivatives on the curve that bounds the domain",
            ),
        ]),
        default: Default::Text("region"),
        doc: "What is prescribed, and where.",
    },
    Field {
        name: "curve",
        kind: Kind::Choice(&[
            (
                "stabilised",
                "system (15) with relaxed boundary rows: converges as h^2 on every family tried",
            ),
            (
                "first-order-ring",
                "the paper's: the first inner ring from the conormal derivatives",
            ),
            ("second-order-ring", "the same with second derivatives on the boundary"),
            (
                "unstabilised",
                "system (15) as it stands, mostly singular (Proposition 2)",
            ),
        ]),
        default: Default::Text("stabilised"),
        doc: "How the triharmonic equation takes curve conditions.",
    },
    Field {
        name: "stabilisation",
        kind: Kind::Number { min: 1e-12, max: 1e12 },
        default: Default::Number(1.0),
        doc: "Factor c of the relaxation c h^2 D of the boundary rows; 1 to 3 is its plateau.",
    },
    Field {
        name: "mass",
        kind: Kind::Choice(&[
            (
                "hybrid",
                "lumped: Voronoi areas in triangles without an obtuse angle (Meyer et al. 2003)",
            ),
            ("barycentric", "lumped: a third of every triangle"),
            ("full", "not lumped; curve conditions only"),
        ]),
        default: Default::Text("hybrid"),
        doc: "The mass matrix.",
    },
    Field {
        name: "system",
        kind: Kind::Choice(&[
            (
                "auto",
                "one-field where the mass is lumped and the system is not singular by design",
            ),
            (
                "one-field",
                "the other fields are eliminated: positive definite, fewer unknowns, less sparse",
            ),
            ("mixed", "all fields at once: symmetric and indefinite"),
        ]),
        default: Default::Text("auto"),
        doc: "Which system is factorized; the solution is the same.",
    },
    Field {
        name: "solver",
        kind: Kind::Choice(&[
            (
                "auto",
                "cholesky for one-field systems, lblt for mixed ones and lu where that breaks down",
            ),
            ("cholesky", "multifrontal, nested dissection; one-field systems only"),
            (
                "lblt",
                "Bunch-Kaufman pivots within supernodes, nested dissection; mixed systems only",
            ),
            (
                "lu",
                "partial pivoting, column order by minimum degree; mixed systems only",
            ),
        ]),
        default: Default::Text("auto"),
        doc: "The factorization.",
    },
    Field {
        name: "data",
        kind: Kind::Choice(&[
            (
                "auto",
                "function on a planar mesh without handles, position on other meshes",
            ),
            (
                "function",
                "a function of x and y, with its powers of the Laplacian on the right",
            ),
            (
                "position",
                "the coordinates of the fixed vertices: a smooth surface through them",
            ),
            (
                "displacement",
                "the handles' motion, added to the surface: keeps details",
            ),
        ]),
        default: Default::Text("auto"),
        doc: "What the unknown stands for and where its conditions come from.",
    },
    Field {
        name: "function",
        kind: Kind::Named(function_names),
        default: Default::Text("waves-and-exponential"),
        doc: "The solution that conditions and right-hand side are sampled from, and that errors are measured against.",
    },
    Field {
        name: "handles",
        kind: Kind::List(&Kind::Table(HANDLE)),
        default: Default::Absent,
        doc: "Which vertices are fixed, moved or free; a later handle wins. Vertices that no handle selects are free. \
              Without handles a generated mesh brings its own, and a file is fixed at its boundary.",
    },
    Field {
        name: "tangents",
        kind: Kind::Table(&[
            Field {
                name: "angle",
                kind: Kind::Number {
                    min: -180.0,
                    max: 180.0,
                },
                default: Default::Number(0.0),
                doc: "Turns the tangents about the curve, in degrees, from those of the surface beyond it towards its \
                      normal.",
            },
            Field {
                name: "scale",
                kind: Kind::Number {
                    min: -100.0,
                    max: 100.0,
                },
                default: Default::Number(1.0),
                doc: "Factor for the length of the conormal derivative; 1 keeps the surface's speed.",
            },
        ]),
        default: Default::Fields,
        doc: "Curve conditions on a surface: the conormal derivative, taken from the triangles beyond the curve or, where \
              there are none, from those of the domain.",
    },
    Field {
        name: "curvature",
        kind: Kind::Table(&[
            Field {
                name: "scale",
                kind: Kind::Number {
                    min: -100.0,
                    max: 100.0,
                },
                default: Default::Number(1.0),
                doc: "Factor for the curvature of the surface beyond the curve.",
            },
            Field {
                name: "offset",
                kind: Kind::Number { min: -1e9, max: 1e9 },
                default: Default::Number(0.0),
                doc: "Added normal curvature across the curve, in one over length, positive towards the normal.",
            },
        ]),
        default: Default::Fields,
        doc: "Triharmonic curve conditions on a surface: the second derivative on the boundary.",
    },
    Field {
        name: "fill",
        kind: Kind::Choice(&[
            ("none", "holes stay"),
            ("largest", "the longest boundary loop gets a patch, which is then free"),
            ("all", "every boundary loop gets one"),
        ]),
        default: Default::Text("none"),
        doc: "Fills holes with flat patches of about the mesh's edge length, which are then solved for.",
    },
    Field {
        name: "frames",
        kind: Kind::Integer { min: 1, max: 100_000 },
        default: Default::Integer(1),
        doc: "Steps in which moved handles reach their place, as when a user drags them; all share one factorization.",
    },
    Field {
        name: "on_singular",
        kind: Kind::Choice(&[
            ("refuse", "the job fails and names the vertices"),
            ("continue", "the job tries to solve all the same"),
        ]),
        default: Default::Text("refuse"),
        doc: "What to do when the boundary makes system (15) singular.",
    },
    Field {
        name: "compare",
        kind: Kind::Boolean,
        default: Default::Boolean(false),
        doc: "Whether the other system (one-field or mixed) is solved too, to report the difference.",
    },
];

/// An entry of `handles`.
static HANDLE: &[Field] = &[
    Field {
        name: "select",
        kind: Kind::Choice(&[
            ("all", "every vertex"),
            ("box", "vertices between `min` and `max`"),
            ("sphere", "vertices within `radius` of `center`"),
            (
                "plane",
                "vertices on the side of the plane through `center` that `normal` points to",
            ),
            ("nearest", "the vertex nearest to `center`"),
            (
                "boundary",
                "vertices of the mesh's boundary and of the `rings` next to it",
            ),
            (
                "loop",
                "vertices of one boundary loop, `loop`, and of the `rings` next to it",
            ),
            ("file", "vertices whose number in the model's `selection` is `value`"),
        ]),
        default: Default::Required,
        doc: "Which vertices.",
    },
    Field {
        name: "role",
        kind: Kind::Choice(&[
            ("free", "solved for"),
            ("fixed", "kept where they are"),
            ("moved", "kept at `translate`, `turn` and `stretch`"),
        ]),
        default: Default::Text("fixed"),
        doc: "What becomes of them.",
    },
    Field {
        name: "min",
        kind: POINT,
        default: Default::Absent,
        doc: "Lower corner of a box, as shares of the mesh's box from 0 to 1 if `relative`.",
    },
    Field {
        name: "max",
        kind: POINT,
        default: Default::Absent,
        doc: "Upper corner of a box.",
    },
    Field {
        name: "center",
        kind: POINT,
        default: Default::Absent,
        doc: "Centre of a sphere, a point of a plane, or the place that `nearest` looks from.",
    },
    Field {
        name: "radius",
        kind: Kind::Number { min: 0.0, max: 1e12 },
        default: Default::Absent,
        doc: "Radius of a sphere, in units of the mesh's diagonal if `relative`.",
    },
    Field {
        name: "normal",
        kind: POINT,
        default: Default::Absent,
        doc: "Normal of a plane.",
    },
    Field {
        name: "relative",
        kind: Kind::Boolean,
        default: Default::Boolean(false),
        doc: "Whether places are shares of the mesh's box and lengths shares of its diagonal.",
    },
    Field {
        name: "loop",
        kind: Kind::Integer { min: 0, max: 1_000_000 },
        default: Default::Integer(0),
        doc: "Which boundary loop, the longest first, from 0.",
    },
    Field {
        name: "rings",
        kind: Kind::Integer { min: 0, max: 100_000 },
        default: Default::Integer(0),
        doc: "How many further rings of neighbours are selected.",
    },
    Field {
        name: "value",
        kind: Kind::Integer {
            min: i64::MIN,
            max: i64::MAX,
        },
        default: Default::Integer(1),
        doc: "The number that selects a vertex in the model's `selection`.",
    },
    Field {
        name: "translate",
        kind: POINT,
        default: Default::Absent,
        doc: "Motion of moved vertices, in units of the mesh's diagonal if `relative`.",
    },
    Field {
        name: "turn",
        kind: POINT,
        default: Default::Absent,
        doc: "Axis times angle in degrees of a rotation of moved vertices about their centroid.",
    },
    Field {
        name: "stretch",
        kind: Kind::Number { min: 1e-6, max: 1e6 },
        default: Default::Number(1.0),
        doc: "Factor by which moved vertices recede from their centroid.",
    },
];

/// Three coordinates.
const POINT: Kind = Kind::List(&Kind::Number { min: -1e12, max: 1e12 });

fn function_names() -> Vec<(&'static str, String)> {
    FUNCTIONS
        .iter()
        .map(|function| (function.name, function.formula.to_string()))
        .collect()
}

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
        serde_json::from_value(Value::Object(fill(FIELDS, settings))).map_err(|error| Failure {
            kind: "invalid-input".to_string(),
            reason: format!(
                "settings of mixed-fem: {error}; places such as \"min\" or \"center\" are lists of three numbers"
            ),
        })
    }

    /// The order of the equation: 2 or 3.
    pub fn order(&self) -> usize {
        match self.equation {
            Equation::Biharmonic => 2,
            Equation::Triharmonic => 3,
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
        self.mass != Mass::Full && self.scheme() != Scheme::Unstabilised
    }

    /// Whether the one-field system is factorized.
    pub fn one_field(&self) -> bool {
        match self.system {
            System::OneField => true,
            System::Mixed => false,
            System::Auto => self.has_one_field() && matches!(self.solver, Solver::Auto | Solver::Cholesky),
        }
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
            drop(&["stabilisation"]);
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
            "the one-field system needs a lumped mass and a system that is not singular; use system = \"mixed\"".into(),
        );
    }
    let one_field = settings.one_field();
    if one_field && matches!(settings.solver, Solver::Lblt | Solver::Lu) {
        error(
            "solver",
            "the one-field system is positive definite: use \"cholesky\" or system = \"mixed\"".into(),
        );
    }
    if !one_field && settings.solver == Solver::Cholesky {
        error(
            "solver",
            "the mixed system is indefinite: use \"lblt\" or \"lu\", or system = \"one-field\"".into(),
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
    }
    errors
}
