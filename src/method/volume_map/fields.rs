//! The settings of a volumetric map as data: names, kinds, defaults, meanings.

use crate::energy;
use crate::method::setting::{Default, Field, Kind};

/// Everything that `[settings]` may hold.
pub static FIELDS: &[Field] = &[
    Field {
        name: "preset",
        kind: Kind::Choice(&[
            ("best", "hard constraints, harmonic start, untangling, projected Newton"),
            (
                "paper",
                "soft constraints, similarity start, relaxation-enhanced Newton, source not rescaled",
            ),
        ]),
        default: Default::Text("best"),
        doc: "Chooses every setting that the file leaves open. A setting in the file wins over the preset.",
    },
    Field {
        name: "energy",
        kind: Kind::Named(energy_names),
        default: Default::Text("stretch"),
        doc: "The distortion density whose volume mean is minimized.",
    },
    Field {
        name: "weighting",
        kind: Kind::Choice(&[
            (
                "volume",
                "each tetrahedron by its source volume; an affine boundary then gives an affine map",
            ),
            (
                "uniform",
                "each tetrahedron alike, as equation 8 of the paper is printed",
            ),
            ("target", "each tetrahedron by its volume in the image"),
        ]),
        default: Default::Text("volume"),
        doc: "How the density is averaged over the tetrahedra.",
    },
    Field {
        name: "barrier",
        kind: Kind::Choice(&[
            (
                "auto",
                "the locally injective barrier for energies that do not blow up at zero volume",
            ),
            (
                "none",
                "the energy alone; without a barrier of its own it may fold tetrahedra over",
            ),
            (
                "locally-injective",
                "the barrier of Schueller et al. 2013 added to any energy",
            ),
        ]),
        default: Default::Text("auto"),
        doc: "An additional term against inverted tetrahedra.",
    },
    Field {
        name: "barrier_weight",
        kind: Kind::Number { min: 1e-12, max: 1e12 },
        default: Default::Number(0.01),
        doc: "Factor of the barrier, a mean over the tetrahedra that is not weighted by volume.",
    },
    Field {
        name: "barrier_width",
        kind: Kind::OneOf(&[
            Kind::Choice(&[("auto", "the ratio of target volume to source volume")]),
            Kind::Number { min: 1e-12, max: 1e12 },
        ]),
        default: Default::Text("auto"),
        doc: "The determinant above which the barrier vanishes; `auto` is the mean determinant of any map.",
    },
    Field {
        name: "rescale",
        kind: Kind::Boolean,
        default: Default::Absent,
        doc: "Whether the source is scaled to the volume of the target first. Energies with a rest scale (ARAP, LPM, \
              Hencky, symmetric Dirichlet, AMIPS) otherwise measure the volume ratio. Preset best: true, paper: false.",
    },
    Field {
        name: "solver",
        kind: Kind::Choice(&[
            (
                "projected-newton",
                "hard constraints, Newton with a positive Hessian and flip-free steps",
            ),
            (
                "relaxed-newton",
                "the paper's: soft constraints, energy-and-gradient line search, relaxation",
            ),
            (
                "locally-injective",
                "Schueller et al. 2013: soft constraints that advance in substeps, barrier",
            ),
            (
                "l-bfgs",
                "hard constraints, limited-memory quasi-Newton with flip-free steps",
            ),
        ]),
        default: Default::Absent,
        doc: "The minimizer. Preset best: projected-newton, paper: relaxed-newton.",
    },
    Field {
        name: "start",
        kind: Kind::Choice(&[
            (
                "auto",
                "harmonic for the solvers with hard constraints, similarity for those with soft ones",
            ),
            ("harmonic", "the minimizer of the Dirichlet energy"),
            ("rest", "the source as it is"),
            (
                "similarity",
                "the source turned, scaled and moved onto the target's boundary",
            ),
            ("target-mesh", "the positions of the target's mesh, interior included"),
            ("random-interior", "interior vertices at random in the target's box"),
        ]),
        default: Default::Absent,
        doc: "The first map. Preset best: auto, paper: similarity. Hard constraints put the boundary on the target \
              in every start.",
    },
    Field {
        name: "similarity",
        kind: Kind::Choice(&[
            (
                "closed-form",
                "least squares over rotation, scale and translation (Umeyama 1991)",
            ),
            (
                "thirteen-variables",
                "the paper's fit of a matrix, a translation and a scale, then the nearest rotation",
            ),
        ]),
        default: Default::Absent,
        doc: "How the similarity start is fitted. Preset best: closed-form, paper: thirteen-variables.",
    },
    Field {
        name: "seed",
        kind: Kind::Integer { min: 0, max: i64::MAX },
        default: Default::Integer(1),
        doc: "Seed of the random start.",
    },
    Field {
        name: "split",
        kind: Kind::Choice(&[
            ("none", "the mesh as it is"),
            (
                "needed",
                "interior edges within one planar target face, and tetrahedra that the boundary inverts",
            ),
            (
                "all",
                "every interior edge between boundary vertices, then every tetrahedron with four of them",
            ),
        ]),
        default: Default::Absent,
        doc: "What to split where the connectivity leaves no room for a map without inversions. Preset best: needed, \
              paper: none.",
    },
    Field {
        name: "on_infeasible",
        kind: Kind::Choice(&[
            ("refuse", "the job fails and names the obstacles"),
            ("continue", "the job goes on; some tetrahedra must stay inverted"),
        ]),
        default: Default::Text("refuse"),
        doc: "What to do when the boundary alone forces inverted tetrahedra.",
    },
    Field {
        name: "untangle",
        kind: Kind::Boolean,
        default: Default::Absent,
        doc: "Whether a start with inverted tetrahedra is untangled before an energy with a barrier is minimized. \
              Preset best: true, paper: false.",
    },
    Field {
        name: "iteration_limit",
        kind: Kind::Integer { min: 0, max: 1_000_000 },
        default: Default::Integer(500),
        doc: "The largest number of iterations of the minimization.",
    },
    Field {
        name: "gradient_tolerance",
        kind: Kind::Number { min: 0.0, max: 1e6 },
        default: Default::Number(1e-8),
        doc: "Converged when the norm of the gradient over the free unknowns is below it, lengths in units of the cube \
              root of the target's volume. With soft constraints the slopes at the boundary are divided by the \
              constraints' weight where that exceeds 1.",
    },
    Field {
        name: "energy_tolerance",
        kind: Kind::Number { min: 0.0, max: 1.0 },
        default: Default::Number(1e-15),
        doc: "Solvers with hard constraints: converged when the predicted decrease of a step, divided by the energy, is \
              below it.",
    },
    Field {
        name: "change_tolerance",
        kind: Kind::Number { min: 0.0, max: 1.0 },
        default: Default::Number(0.0),
        doc: "Solvers with hard constraints: converged when a step lowers the energy by less than this share of it. The \
              default 0 switches the criterion off.",
    },
    Field {
        name: "projected-newton",
        kind: Kind::Table(&[Field {
            name: "hessian",
            kind: Kind::Choice(HESSIANS),
            default: Default::Text("on-demand"),
            doc: "Which Hessian gives the direction.",
        }]),
        default: Default::Fields,
        doc: "Options of that solver.",
    },
    Field {
        name: "relaxed-newton",
        kind: Kind::Table(&[
            Field {
                name: "relaxation",
                kind: Kind::Boolean,
                default: Default::Boolean(true),
                doc: "When no step is accepted, minimize for a few steps with the boundary held where it is.",
            },
            Field {
                name: "relaxation_steps",
                kind: Kind::Integer { min: 1, max: 1000 },
                default: Default::Integer(5),
                doc: "Largest number of steps in one relaxation.",
            },
            Field {
                name: "gradient_criterion",
                kind: Kind::Boolean,
                default: Default::Boolean(true),
                doc: "A step must not raise the norm of the gradient.",
            },
            Field {
                name: "weight",
                kind: Kind::Number { min: 1e-6, max: 1e16 },
                default: Default::Number(1e8),
                doc: "Weight of the squared distances of the boundary to its target.",
            },
            Field {
                name: "continuation",
                kind: Kind::Choice(&[
                    ("off", "the weight is fixed"),
                    (
                        "on",
                        "the weight starts small and is raised whenever the solver converges off the target",
                    ),
                    (
                        "auto",
                        "first a fixed weight; continuation from the start again if that misses the target",
                    ),
                ]),
                default: Default::Text("auto"),
                doc: "Raising the weight step by step, for acute constraints.",
            },
            Field {
                name: "continuation_weight",
                kind: Kind::Number { min: 1e-6, max: 1e16 },
                default: Default::Number(100.0),
                doc: "First weight of the continuation.",
            },
            Field {
                name: "continuation_factor",
                kind: Kind::Number { min: 1.0, max: 1e6 },
                default: Default::Number(25.0),
                doc: "Factor between two weights of the continuation.",
            },
            Field {
                name: "continuation_rounds",
                kind: Kind::Integer { min: 0, max: 100 },
                default: Default::Integer(5),
                doc: "How often the weight is raised at most.",
            },
            Field {
                name: "constraint_tolerance",
                kind: Kind::Number { min: 0.0, max: 1e6 },
                default: Default::Number(1e-5),
                doc: "The constraints are met when the sum of squared distances is below it, in units of the target's \
                      volume to the power 2/3.",
            },
            Field {
                name: "energy_tolerance",
                kind: Kind::Number { min: 0.0, max: 1.0 },
                default: Default::Number(1e-6),
                doc: "Converged when a step changes the energy by less than this times the diagonal of the source's box.",
            },
            Field {
                name: "hessian",
                kind: Kind::Choice(HESSIANS),
                default: Default::Text("projected"),
                doc: "Which Hessian gives the direction.",
            },
        ]),
        default: Default::Fields,
        doc: "Options of that solver; every part of the paper's method can be switched off.",
    },
    Field {
        name: "locally-injective",
        kind: Kind::Table(&[
            Field {
                name: "weight",
                kind: Kind::Number { min: 1e-6, max: 1e16 },
                default: Default::Number(1e8),
                doc: "Smallest weight of the squared distances of the boundary to its target.",
            },
            Field {
                name: "weight_ratio",
                kind: Kind::Number { min: 0.0, max: 1e12 },
                default: Default::Number(1e3),
                doc: "The weight is raised to this times the energy divided by the sum of squared distances.",
            },
            Field {
                name: "substepping",
                kind: Kind::Boolean,
                default: Default::Boolean(true),
                doc: "Targets advance by less the more the Hessian had to be shifted.",
            },
            Field {
                name: "constraint_tolerance",
                kind: Kind::Number { min: 0.0, max: 1e6 },
                default: Default::Number(1e-5),
                doc: "The constraints are met when the sum of squared distances is below it, in units of the target's \
                      volume to the power 2/3.",
            },
        ]),
        default: Default::Fields,
        doc: "Options of that solver.",
    },
    Field {
        name: "l-bfgs",
        kind: Kind::Table(&[Field {
            name: "memory",
            kind: Kind::Integer { min: 1, max: 1000 },
            default: Default::Integer(10),
            doc: "Number of past steps that shape the direction.",
        }]),
        default: Default::Fields,
        doc: "Options of that solver.",
    },
    Field {
        name: "untangling",
        kind: Kind::Table(&[
            Field {
                name: "rest_shape",
                kind: Kind::Choice(&[
                    (
                        "locally-scaled",
                        "each source tetrahedron scaled as the boundary near it is stretched",
                    ),
                    ("uniform", "the source scaled as a whole"),
                ]),
                default: Default::Text("locally-scaled"),
                doc: "The shape that the untangling energy compares with.",
            },
            Field {
                name: "determinant_weight",
                kind: Kind::Number { min: 0.0, max: 1e6 },
                default: Default::Number(1.0),
                doc: "Weight of the volume term against the shape term.",
            },
            Field {
                name: "decrease",
                kind: Kind::Number { min: 0.01, max: 0.99 },
                default: Default::Number(0.25),
                doc: "Smallest relative decrease of the regularization in a step.",
            },
            Field {
                name: "steps",
                kind: Kind::Integer { min: 1, max: 10_000 },
                default: Default::Integer(100),
                doc: "Largest number of values of the regularization.",
            },
            Field {
                name: "iterations",
                kind: Kind::Integer { min: 1, max: 10_000 },
                default: Default::Integer(50),
                doc: "Largest number of Newton iterations for each of them.",
            },
        ]),
        default: Default::Fields,
        doc: "Options of the untangling (Garanzha et al. 2021).",
    },
];

const HESSIANS: &[(&str, &str)] = &[
    (
        "projected",
        "negative eigenvalues of each tetrahedron's Hessian are set to zero",
    ),
    (
        "on-demand",
        "as much of the negative curvature is kept as leaves the whole positive definite",
    ),
];

fn energy_names() -> Vec<(&'static str, String)> {
    energy::energies()
        .iter()
        .map(|energy| (energy.name(), energy.formula().to_string()))
        .collect()
}
