//! The settings of a G1 surface: their declaration as data, and the typed form that the computation reads.

use super::hexahedra::Shell;
use super::patch::{Operator, Reference, Solve};
use crate::method::Failure;
use crate::method::setting::{Default, Field, Kind, fill};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The default of `rank_tolerance`.
pub const RANK_TOLERANCE: f64 = 1e-10;

/// Everything that `[settings]` may hold.
pub static FIELDS: &[Field] = &[
    Field {
        name: "preset",
        kind: Kind::Choice(&[
            (
                "best",
                "tangents that meet the enclosure condition, exact normals and patches",
            ),
            (
                "paper",
                "natural cubics, least squares for the normals, 24 equations a patch, operator as printed",
            ),
        ]),
        default: Default::Text("best"),
        doc: "Chooses every setting that the file leaves open. A setting in the file wins over the preset.",
    },
    Field {
        name: "geometry",
        kind: Kind::Choice(&[
            ("g1", "biquartic patches with common tangent planes"),
            (
                "c0",
                "bicubic patches over the same curves, neighbours with different tangent planes",
            ),
            ("facets", "bilinear patches"),
        ]),
        default: Default::Text("g1"),
        doc: "What is spanned between the vertices.",
    },
    Field {
        name: "vertex_normals",
        kind: Kind::Choice(&[
            (
                "auto",
                "given ones, else those of the model's surface, else estimated ones",
            ),
            ("given", "those of the file or of the generator"),
            (
                "surface",
                "those of the model's triangulated surface at the nearest point",
            ),
            (
                "estimated",
                "from the quadrilaterals around each vertex, weighted by their angles",
            ),
        ]),
        default: Default::Text("auto"),
        doc: "Where the normals at the vertices come from.",
    },
    Field {
        name: "creases",
        kind: Kind::Choice(&[
            (
                "keep",
                "patches meet continuously at creases, with a normal on either side, and with common tangent planes elsewhere",
            ),
            ("smooth", "creases are passed over: one normal a vertex"),
        ]),
        default: Default::Text("keep"),
        doc: "What to do with edges that the generator, the model's `creases`, `crease_field` or `crease_angle` call sharp.",
    },
    Field {
        name: "crease_angle",
        kind: Kind::Number { min: 0.0, max: 180.0 },
        default: Default::Absent,
        doc: "Edges are sharp where the planes of their quadrilaterals meet at more than this angle, in degrees; absent: the \
              angle decides nothing.",
    },
    Field {
        name: "crease_field",
        kind: Kind::Text,
        default: Default::Absent,
        doc: "Name of a cell field of the mesh's file, such as `reference`: edges between quadrilaterals with different values \
              are sharp.",
    },
    Field {
        name: "crease_normals",
        kind: Kind::Boolean,
        default: Default::Boolean(false),
        doc: "Edges are sharp where the quadrilaterals of an OBJ file name different normals at its ends; each side takes those \
              of its own corners.",
    },
    Field {
        name: "tangents",
        kind: Kind::Choice(&[
            (
                "balanced",
                "found together with the normals' slopes, so that neither goes far",
            ),
            (
                "enclosing",
                "the nearest ones that meet the enclosure condition at vertices of even valence",
            ),
            ("natural", "those of the natural cubics, as in the paper"),
        ]),
        default: Default::Absent,
        doc: "Slopes of the curves. Preset best: enclosing, paper: natural.",
    },
    Field {
        name: "tangent_stiffness",
        kind: Kind::Number { min: 1e-6, max: 1e6 },
        default: Default::Number(10.0),
        doc: "Weight of squared relative changes of tangents against squared slopes of normals, where both are found together.",
    },
    Field {
        name: "repair",
        kind: Kind::Boolean,
        default: Default::Absent,
        doc: "Whether tangents around patches that fold are found anew, together with the normals' slopes. Preset best: true, \
              paper: false.",
    },
    Field {
        name: "edge_normals",
        kind: Kind::Choice(&[
            (
                "shortest",
                "exact, with the least sum of squares over the whole surface",
            ),
            ("local", "exact, shortest at every vertex on its own"),
            (
                "least-squares",
                "the paper's linear system, solved as well as it can be",
            ),
        ]),
        default: Default::Absent,
        doc: "Slopes of the normals along the curves; of no effect with balanced tangents. Preset best: shortest, paper: least-squares.",
    },
    Field {
        name: "rank_tolerance",
        kind: Kind::Number { min: 0.0, max: 0.1 },
        default: Default::Number(RANK_TOLERANCE),
        doc: "Share of the largest singular value below which one counts as zero in the least squares for the normals, on at most \
              200 curves; of no effect on more.",
    },
    Field {
        name: "patches",
        kind: Kind::Choice(&[
            (
                "exact",
                "twists fixed by the corners, then 16 equations for 20 unknowns, nearest to the reference",
            ),
            ("collocation", "the paper's 24 equations in the sense of least squares"),
        ]),
        default: Default::Absent,
        doc: "How twists and side coefficients are found. Preset best: exact, paper: collocation.",
    },
    Field {
        name: "patch_tolerance",
        kind: Kind::Number { min: 0.0, max: 0.1 },
        default: Default::Number(1e-10),
        doc: "Share of the largest singular value below which one counts as zero in the 24 equations of a patch.",
    },
    Field {
        name: "reference",
        kind: Kind::Choice(&[
            ("adini", "mixed derivatives of the bilinearly blended Coons patch"),
            ("zero", "no twist"),
        ]),
        default: Default::Absent,
        doc: "The twists to be nearest to. Preset best: adini, paper: zero.",
    },
    Field {
        name: "operator",
        kind: Kind::Choice(&[
            ("laplacian", "X_uu + X_vv"),
            (
                "printed",
                "X_uu + X_uv + X_vv, as printed in equation 18; it depends on how a patch is numbered",
            ),
        ]),
        default: Default::Absent,
        doc: "The operator whose square is least over the middle node. Preset best: laplacian, paper: printed.",
    },
    Field {
        name: "result",
        kind: Kind::Choice(&[
            (
                "tessellation",
                "quadrilaterals on the patches, with angles, curvatures and isophotes as fields",
            ),
            (
                "control-points",
                "the nets of 5 by 5 Bezier control points of every patch, 25 points a patch in order; no picture of the surface",
            ),
        ]),
        default: Default::Text("tessellation"),
        doc: "What the result's mesh holds.",
    },
    Field {
        name: "export",
        kind: Kind::List(&Kind::Choice(&[
            (
                "bezier",
                "`bezier.vtu`: a Bezier quadrilateral of order 4 a patch, and `bezier-hexahedra.vtu` where there are hexahedra",
            ),
            ("obj", "`tessellation.obj`: the tessellation with normals"),
            (
                "control-points",
                "`control-points.txt`: the Bezier control points as text that reads back to the same bits",
            ),
        ])),
        default: Default::Absent,
        doc: "Further files beside the result's mesh. Patch k is face k of the mesh; its control points 0, 20, 24, 4 are the corners \
              of that face in the face's order.",
    },
    Field {
        name: "tessellation",
        kind: Kind::Integer { min: 1, max: 64 },
        default: Default::Absent,
        doc: "Pieces along a side of a patch in the result's mesh; absent: 12 for small surfaces, fewer for large ones.",
    },
    Field {
        name: "stripes",
        kind: Kind::Number { min: 1.0, max: 200.0 },
        default: Default::Number(12.0),
        doc: "Isophote stripes between a normal towards the light and one away from it.",
    },
    Field {
        name: "hexahedra",
        kind: Kind::Choice(&[
            ("none", "the surface alone"),
            (
                "inward",
                "curvilinear hexahedra between a sphere inside and the surface",
            ),
            (
                "outward",
                "curvilinear hexahedra between the surface and a sphere around it",
            ),
        ]),
        default: Default::Text("none"),
        doc: "A shell of transfinite hexahedra over the patches; its mesh takes the place of the surface in the result.",
    },
    Field {
        name: "sphere_ratio",
        kind: Kind::Number { min: 1e-3, max: 1e3 },
        default: Default::Absent,
        doc: "Radius of the sphere over the distance from the centre to the nearest vertex (inward, default 0.5) or the \
              farthest (outward, default 1.5).",
    },
    Field {
        name: "layers",
        kind: Kind::Integer { min: 1, max: 64 },
        default: Default::Integer(1),
        doc: "Hexahedra between surface and sphere.",
    },
    Field {
        name: "order",
        kind: Kind::Integer { min: 0, max: 6 },
        default: Default::Integer(0),
        doc: "Polynomial order of a test problem with known solution on the surface; 0 for none. Generated meshes only.",
    },
];

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Geometry {
    G1,
    C0,
    Facets,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VertexNormals {
    Auto,
    Given,
    Surface,
    Estimated,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tangents {
    Balanced,
    Enclosing,
    Natural,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeNormals {
    Shortest,
    Local,
    LeastSquares,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Patches {
    Exact,
    Collocation,
}

/// The settings with nothing left open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    pub geometry: Geometry,
    pub vertex_normals: VertexNormals,
    pub creases: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crease_angle: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crease_field: Option<String>,
    pub crease_normals: bool,
    pub tangents: Tangents,
    pub tangent_stiffness: f64,
    pub repair: bool,
    pub edge_normals: EdgeNormals,
    pub rank_tolerance: f64,
    pub patches: Patches,
    pub patch_tolerance: f64,
    pub reference: String,
    pub operator: String,
    pub result: String,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub export: Vec<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tessellation: Option<u64>,
    pub stripes: f64,
    pub hexahedra: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere_ratio: Option<f64>,
    pub layers: u64,
    pub order: u64,
}

/// What the presets choose: field, best, paper.
const PRESETS: &[(&str, &str, &str)] = &[
    ("tangents", "enclosing", "natural"),
    ("edge_normals", "shortest", "least-squares"),
    ("patches", "exact", "collocation"),
    ("reference", "adini", "zero"),
    ("operator", "laplacian", "printed"),
];

impl Settings {
    /// Reads validated settings, full or canonical. Fields that are absent take the preset's or the declared value.
    ///
    /// # Errors
    /// A value that the declaration does not allow, which validation would have found.
    pub fn resolve(settings: &Value) -> Result<Settings, Failure> {
        let mut table = fill(FIELDS, settings);
        let paper = table.remove("preset").is_some_and(|preset| preset == "paper");
        for (name, best, literal) in PRESETS {
            let chosen = if paper { *literal } else { *best };
            table.entry(*name).or_insert_with(|| Value::from(chosen));
        }
        table.entry("repair").or_insert(Value::from(!paper));
        let mut settings: Settings = serde_json::from_value(Value::Object(table))
            .map_err(|error| Failure::invalid(format!("settings of g1-surface: {error}")))?;
        // Their order does not matter.
        settings.export.sort();
        settings.export.dedup();
        Ok(settings)
    }

    /// Whether sharp edges stay sharp.
    pub fn keeps_creases(&self) -> bool {
        self.creases == "keep"
    }

    /// Whether a further file is asked for.
    pub fn exports(&self, name: &str) -> bool {
        self.export.iter().any(|export| export == name)
    }

    pub fn solve(&self) -> Solve {
        match self.patches {
            Patches::Exact => Solve::Exact,
            Patches::Collocation => Solve::Collocation {
                tolerance: self.patch_tolerance,
            },
        }
    }

    /// Where hexahedra are asked for.
    pub fn shell(&self) -> Option<Shell> {
        match self.hexahedra.as_str() {
            "inward" => Some(Shell::Inward {
                ratio: self.sphere_ratio.unwrap_or(0.5),
            }),
            "outward" => Some(Shell::Outward {
                ratio: self.sphere_ratio.unwrap_or(1.5),
            }),
            _ => None,
        }
    }

    pub fn reference(&self) -> Reference {
        if self.reference == "zero" {
            Reference::Zero
        } else {
            Reference::Adini
        }
    }

    pub fn operator(&self) -> Operator {
        if self.operator == "printed" {
            Operator::Printed
        } else {
            Operator::Laplacian
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
        if !self.keeps_creases() {
            drop(&["crease_angle", "crease_field", "crease_normals"]);
        }
        if self.geometry != Geometry::G1 {
            drop(&[
                "tangents",
                "tangent_stiffness",
                "repair",
                "edge_normals",
                "rank_tolerance",
                "patches",
                "patch_tolerance",
                "reference",
            ]);
        }
        if self.geometry == Geometry::Facets {
            drop(&["operator"]);
        }
        if self.shell().is_none() {
            drop(&["sphere_ratio", "layers"]);
        }
        if self.result == "control-points" && !self.exports("obj") {
            drop(&["tessellation", "stripes"]);
        }
        if self.tangents == Tangents::Balanced {
            drop(&["edge_normals", "rank_tolerance"]);
        } else if !self.repair {
            drop(&["tangent_stiffness"]);
        }
        if self.edge_normals != EdgeNormals::LeastSquares {
            drop(&["rank_tolerance"]);
        }
        if self.patches == Patches::Exact {
            drop(&["patch_tolerance"]);
        }
        Value::Object(table)
    }
}

/// Checks that go across fields: path of the offending field and message.
pub fn check(settings: &Value) -> Vec<(String, String)> {
    let Ok(settings) = Settings::resolve(settings) else {
        return Vec::new();
    };
    let mut errors = Vec::new();
    let wrong_side = match settings.shell() {
        Some(Shell::Inward { ratio }) => ratio >= 1.0,
        Some(Shell::Outward { ratio }) => ratio <= 1.0,
        None => false,
    };
    if wrong_side {
        errors.push((
            "sphere_ratio".to_string(),
            "a sphere inside needs a ratio below 1, one around the surface a ratio above 1".to_string(),
        ));
    }
    if settings.geometry == Geometry::G1
        && settings.tangents == Tangents::Natural
        && settings.edge_normals != EdgeNormals::LeastSquares
    {
        errors.push((
            "edge_normals".to_string(),
            "exact normals need tangents that meet the enclosure condition; use tangents = \"enclosing\" or \
             edge_normals = \"least-squares\""
                .to_string(),
        ));
    }
    errors
}
