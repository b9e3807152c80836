//! The settings of a mixed finite element computation as data: names, kinds, defaults, meanings.

use super::function::FUNCTIONS;
use crate::method::setting::{Default, Field, Kind};

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
                "system (15) with relaxed boundary rows: the most accurate on every family tried",
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
        name: "relaxation",
        kind: Kind::Choice(&[
            (
                "tangential",
                "c h^3 s^2 / 100 K with the stiffness K of the boundary curves, mixed systems only: keeps its rate on every mesh",
            ),
            (
                "linear",
                "c h s / 80 D: a little more accurate on coarse meshes; falls below second order on very fine irregular ones",
            ),
            ("quadratic", "c h^2 D: levels off earlier on irregular meshes"),
        ]),
        default: Default::Text("tangential"),
        doc: "How much the boundary rows of the stabilised system give way: h is the mean edge length, s the side of a square \
              of the domain's area, D the lumped mass.",
    },
    Field {
        name: "stabilisation",
        kind: Kind::Number { min: 1e-12, max: 1e12 },
        default: Default::Number(1.0),
        doc: "Factor c of the relaxation.",
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
            ("auto", "one-field with solver = \"cholesky\", otherwise mixed"),
            (
                "one-field",
                "the other fields are eliminated: positive definite, fewer unknowns, less sparse; lumped masses only, not \
                 for relaxation = \"tangential\"",
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
                "cholesky for one-field systems; ldlt for mixed ones, lblt where that breaks down, then lu",
            ),
            ("cholesky", "multifrontal, nested dissection; one-field systems only"),
            (
                "ldlt",
                "multifrontal, pivots of known signs, nested dissection; mixed systems only, not for curve = \"unstabilised\"",
            ),
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
              Without handles a generated mesh brings its own, and a file is fixed at its boundary. To edit a surface give \
              the data \"position\", a handle that holds the boundary with two rings, and one of the role \"moved\" with \
              a center, a radius and a translation; experiments/mixed-fem/editing.toml does so.",
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
