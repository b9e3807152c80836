//! The settings of a volume fit as data: names, kinds, defaults, meanings.

use super::files::FILES;
use crate::energy;
use crate::fem::basis;
use crate::fem::quadrature::RULES;
use crate::fem::space::HIGHEST_ORDER;
use crate::method::setting::{Default, Field, Kind};

fn energy_names() -> Vec<(&'static str, String)> {
    let barriers = energy::energies().iter().filter(|energy| energy.is_barrier());
    barriers
        .map(|energy| (energy.name(), energy.formula().to_string()))
        .collect()
}

fn basis_names() -> Vec<(&'static str, String)> {
    let bases = basis::bases().iter();
    bases.map(|basis| (basis.name(), basis.summary().to_string())).collect()
}

fn rule_names() -> Vec<(&'static str, String)> {
    RULES
        .iter()
        .map(|&(name, _, meaning)| (name, meaning.to_string()))
        .collect()
}

const ORDER: Kind = Kind::Integer {
    min: 1,
    max: HIGHEST_ORDER as i64,
};

/// A file of the result.
static FILE: Kind = Kind::Choice(FILES);

/// A stage of the schedule.
static STAGE: &[Field] = &[
    Field {
        name: "lambda",
        kind: Kind::Number { min: 1e-9, max: 1e9 },
        default: Default::Required,
        doc: "Weight of the volume energy beside the surface energy.",
    },
    Field {
        name: "order",
        kind: ORDER,
        default: Default::Required,
        doc: "Order of the elements; never lower than in the stage before.",
    },
    Field {
        name: "iterations",
        kind: Kind::Integer { min: 0, max: 1_000_000 },
        default: Default::Absent,
        doc: "Most iterations of this stage; `iteration_limit` when absent.",
    },
];

/// Everything that `[settings]` may hold.
pub static FIELDS: &[Field] = &[
    Field {
        name: "preset",
        kind: Kind::Choice(&[
            (
                "best",
                "integrated Legendre, Lobatto quadrature, preconditioned L-BFGS, a gentle far phase",
            ),
            (
                "paper",
                "integrated Fourier, trapezoid rule, plain L-BFGS until the gradient norm is 1e-8",
            ),
        ]),
        default: Default::Text("best"),
        doc: "Chooses every setting that the file leaves open. A setting in the file wins over the preset.",
    },
    Field {
        name: "order",
        kind: ORDER,
        default: Default::Integer(4),
        doc: "Final order of the elements, where no `schedule` is given.",
    },
    Field {
        name: "raise",
        kind: Kind::Choice(&[
            ("double", "orders 1, 2, 4, 8, ... up to the final one"),
            ("step", "every order from 1 up to the final one"),
            ("direct", "the final order at once, in both phases"),
        ]),
        default: Default::Text("double"),
        doc: "How the order is raised, where no `schedule` is given. The far phase has order 1 unless direct.",
    },
    Field {
        name: "lambda_far",
        kind: Kind::Number { min: 0.0, max: 1e9 },
        default: Default::Absent,
        doc: "Weight of the volume energy in the far phase, which brings a template that is far away near as a whole, where the \
              close phase would crush its outer layer; 0 leaves the far phase out. Strong ones pull long thin parts \
              askew and close narrow holes. Preset best: 5, paper: 50.",
    },
    Field {
        name: "lambda",
        kind: Kind::Number { min: 1e-9, max: 1e9 },
        default: Default::Number(0.05),
        doc: "Weight of the volume energy in the close phase. It costs distance: where orders no longer bring the boundary nearer, \
              a smaller one does, or a finer target.",
    },
    Field {
        name: "far_steps",
        kind: Kind::Integer { min: 1, max: 50 },
        default: Default::Integer(1),
        doc: "Stages of the far phase: 1 keeps lambda_far; more go down to lambda in geometric steps.",
    },
    Field {
        name: "schedule",
        kind: Kind::List(&Kind::Table(STAGE)),
        default: Default::Absent,
        doc: "The stages one by one, `[{ lambda = 50, order = 1 }, { lambda = 0.05, order = 2 }]`, instead of the fields above.",
    },
    Field {
        name: "adaptive",
        kind: Kind::Boolean,
        default: Default::Boolean(false),
        doc: "Raise the order of single elements where it is needed most, instead of all alike, up to `order`.",
    },
    Field {
        name: "adaptive_indicator",
        kind: Kind::Choice(&[
            ("distance", "where an element's boundary is farthest from the target"),
            (
                "energy",
                "where the energy promises to fall most (its gradient by functions that are not there yet)",
            ),
        ]),
        default: Default::Text("distance"),
        doc: "Which elements are raised.",
    },
    Field {
        name: "adaptive_share",
        kind: Kind::Number { min: 0.01, max: 1.0 },
        default: Default::Number(0.5),
        doc: "By energy, the share of the indicator that the elements chosen in a step must have together (Doerfler); by \
              distance, those are chosen whose distance is at least the largest less this share.",
    },
    Field {
        name: "adaptive_steps",
        kind: Kind::Integer { min: 1, max: 100 },
        default: Default::Integer(8),
        doc: "Steps of raising orders.",
    },
    Field {
        name: "energy",
        kind: Kind::Named(energy_names),
        default: Default::Text("hencky"),
        doc: "The distortion density; only barriers against inversion are allowed.",
    },
    Field {
        name: "basis",
        kind: Kind::Named(basis_names),
        default: Default::Absent,
        doc: "Functions of edges, faces and cells. Preset best: integrated-legendre, paper: integrated-fourier.",
    },
    Field {
        name: "quadrature",
        kind: Kind::Named(rule_names),
        default: Default::Absent,
        doc: "Rule for the volume energy. Preset best: lobatto, whose points on corners and edges keep these valid; paper: \
              trapezoid.",
    },
    Field {
        name: "quadrature_points",
        kind: Kind::OneOf(&[
            Kind::Choice(&[(
                "auto",
                "Gauss and Lobatto: order + 2 and order + 3 for polynomials, 2 order else, 3 at least, with adaptive orders 10; \
                 trapezoid: 2 order - 1",
            )]),
            Kind::Integer { min: 2, max: 40 },
        ]),
        default: Default::Text("auto"),
        doc: "Points a direction.",
    },
    Field {
        name: "surface_samples",
        kind: Kind::OneOf(&[
            Kind::Choice(&[(
                "auto",
                "2 order - 2 or more, so that there are half as many samples as target triangles (16 at most)",
            )]),
            Kind::Integer { min: 1, max: 64 },
        ]),
        default: Default::Text("auto"),
        doc: "Intervals between samples along every edge of the boundary.",
    },
    Field {
        name: "anisotropy",
        kind: Kind::Number { min: 1.0, max: 1e4 },
        default: Default::Number(50.0),
        doc: "Weight of the distance along normals against that along the surface; 1 is the plain distance. Features are kept \
              by large ones.",
    },
    Field {
        name: "distance",
        kind: Kind::Choice(&[
            ("symmetric", "both terms"),
            (
                "to-target",
                "only from the template's surface to sites on the target (inverse fitting)",
            ),
            (
                "from-target",
                "only from the target's surface to samples of the template",
            ),
            ("none", "the volume energy alone: the boundary is free"),
        ]),
        default: Default::Text("symmetric"),
        doc: "The terms of the surface energy. A point cloud allows to-target only.",
    },
    Field {
        name: "solver",
        kind: Kind::Choice(&[
            (
                "preconditioned-l-bfgs",
                "L-BFGS from a factorized constant model of the Hessian",
            ),
            ("l-bfgs", "L-BFGS as in the paper"),
        ]),
        default: Default::Absent,
        doc: "The minimizer. Preset best: preconditioned-l-bfgs, paper: l-bfgs.",
    },
    Field {
        name: "memory",
        kind: Kind::Integer { min: 1, max: 100 },
        default: Default::Integer(10),
        doc: "Steps that L-BFGS remembers.",
    },
    Field {
        name: "refresh",
        kind: Kind::Integer { min: 1, max: 1_000_000 },
        default: Default::Integer(50),
        doc: "Iterations after which the preconditioner follows the surface's normals again.",
    },
    Field {
        name: "iteration_limit",
        kind: Kind::Integer { min: 0, max: 1_000_000 },
        default: Default::Integer(200),
        doc: "Most iterations of a stage.",
    },
    Field {
        name: "gradient_tolerance",
        kind: Kind::Number { min: 0.0, max: 1e9 },
        default: Default::Number(1e-8),
        doc: "A stage has converged when the norm of the gradient is below this; the target has a box of diagonal 1.",
    },
    Field {
        name: "change_tolerance",
        kind: Kind::Number { min: 0.0, max: 1.0 },
        default: Default::Absent,
        doc: "A stage has converged when an iteration lowers the energy by less than this share. Preset best: 1e-5, paper: 0.",
    },
    Field {
        name: "coarse_tolerance",
        kind: Kind::Number { min: 0.0, max: 1.0 },
        default: Default::Absent,
        doc: "The same for all stages but the last, where larger: 1e-3 saves most of their iterations, but leaves some \
              templates worse placed for the next order. 0 when absent.",
    },
    Field {
        name: "untangle",
        kind: Kind::Boolean,
        default: Default::Boolean(true),
        doc: "Untangle a template with inverted elements before fitting, by a regularized energy beside the surface energy. \
              Otherwise such a template is refused.",
    },
    Field {
        name: "repairs",
        kind: Kind::Integer { min: 0, max: 50 },
        default: Default::Absent,
        doc: "How often, at most, elements that are invalid between quadrature points at the end are mended, with more points \
              every time: on their own with their neighbours if at most one in five fails, otherwise, and after that, by \
              going on with the whole fit. Where more fail after the last stage, small meshes are first fitted once more from \
              the template with three times the points. The map with the fewest failing elements is kept. Preset best: 10, paper: 0.",
    },
    Field {
        name: "subdivision_levels",
        kind: Kind::Integer { min: 0, max: 6 },
        default: Default::Integer(0),
        doc: "Fit a subdivision volume: the control points of so many levels of multi-linear averaging, level by level, with \
              trilinear hexahedra; 0 fits elements. Needs order 1.",
    },
    Field {
        name: "crease_angle",
        kind: Kind::Number { min: 0.0, max: 180.0 },
        default: Default::Number(40.0),
        doc: "Edges of a subdivision's template bent by more than this, in degrees, stay creases; 180 keeps none.",
    },
    Field {
        name: "files",
        kind: Kind::List(&FILE),
        default: Default::Absent,
        doc: "Files beside the picture: lagrange, gmsh, coefficients. All when absent and there are at most 300000 nodes, else \
              the coefficients alone.",
    },
];

/// What a shell does not read: it has no surface energy and one term.
pub const WITHOUT_EFFECT_ON_SHELLS: &[&str] = &[
    "lambda",
    "lambda_far",
    "adaptive",
    "adaptive_indicator",
    "adaptive_share",
    "adaptive_steps",
    "distance",
    "anisotropy",
    "surface_samples",
    "repairs",
    "crease_angle",
    "solver",
    "refresh",
    "untangle",
];

/// What a subdivision volume does not read.
pub const WITHOUT_EFFECT_ON_SUBDIVISIONS: &[&str] = &[
    "adaptive",
    "adaptive_indicator",
    "adaptive_share",
    "adaptive_steps",
    "repairs",
    "raise",
    "solver",
    "refresh",
];
