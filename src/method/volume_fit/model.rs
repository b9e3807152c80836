//! What a model of a volume fit may be: a template with the recipe that shapes it, and the surface it is fitted to.

use super::shell::SIDES;
use crate::mesh::generate;
use crate::method::model::{Generator, ModelKind, Role, fields, keep};
use crate::method::setting::{Default, Field, Kind};
use std::sync::LazyLock;

static COORDINATE: Kind = Kind::Number { min: -1e9, max: 1e9 };

static POINT: Kind = Kind::List(&COORDINATE);
static PATH: Kind = Kind::List(&POINT);

/// One operation of a recipe. What an operation has no use for has no default, so that records hold what was given.
static OPERATION: &[Field] = &[
    Field {
        name: "op",
        // First the one that needs no box.
        kind: Kind::Choice(&[
            (
                "pillow",
                "put a layer of cells around the whole boundary, inside the old one",
            ),
            ("carve", "remove the cells whose centroid lies in the box"),
            (
                "extrude",
                "put layers of cells on the boundary faces whose centroid lies in the box; as a recipe's first operation also on the \
                 faces of a surface file",
            ),
            (
                "collapse",
                "collapse the edges along an axis whose middle lies in the box",
            ),
        ]),
        default: Default::Required,
        doc: "What is done. Coordinates are the template's own: the first cube of a grid is the unit cube.",
    },
    Field {
        name: "from",
        kind: Kind::List(&COORDINATE),
        default: Default::Absent,
        doc: "Lower corner of the box, [x, y, z]; everything when absent.",
    },
    Field {
        name: "to",
        kind: Kind::List(&COORDINATE),
        default: Default::Absent,
        doc: "Upper corner of the box.",
    },
    Field {
        name: "distance",
        kind: Kind::Number { min: -1e9, max: 1e9 },
        default: Default::Absent,
        doc: "Height of an extrusion, all layers together, below 0 inward; 1 when absent.",
    },
    Field {
        name: "layers",
        kind: Kind::Integer { min: 1, max: 1000 },
        default: Default::Absent,
        doc: "Layers of an extrusion; 1 when absent.",
    },
    Field {
        name: "thickness",
        kind: Kind::Number { min: 0.01, max: 0.99 },
        default: Default::Absent,
        doc: "How far a pillow moves the old boundary towards its cells' middles, as a share; 0.4 when absent.",
    },
    Field {
        name: "axis",
        kind: Kind::Choice(&[("x", "edges along x"), ("y", "edges along y"), ("z", "edges along z")]),
        default: Default::Absent,
        doc: "Direction of the edges that are collapsed; x when absent.",
    },
];

static OPERATIONS: Kind = Kind::Table(OPERATION);

static RECIPE: Field = Field {
    name: "recipe",
    kind: Kind::List(&OPERATIONS),
    default: Default::Absent,
    doc: "Operations on the template, one after the other: `{ op = \"carve\", from = [1, 1, 0], to = [2, 2, 3] }` removes cells in \
          a box, `{ op = \"extrude\", from, to, distance = 1.0, layers = 1 }` grows layers on boundary faces there, or on a \
          surface file's when it comes first, \
          `{ op = \"pillow\", thickness = 0.4 }` puts a layer of cells inside the whole boundary, `{ op = \"collapse\", axis = \"x\", \
          from, to }` collapses edges, which turns hexahedra into prisms and prisms into tetrahedra. Boxes are in the template's \
          own coordinates, where a grid's cells are unit cubes.",
};

static PLACE: Field = Field {
    name: "place",
    kind: Kind::Choice(&[
        ("box", "stretched axis by axis so that its box is the target's"),
        (
            "scale",
            "scaled alike along all axes to the target's diagonal, and centred",
        ),
        ("none", "left where it is"),
    ]),
    default: Default::Absent,
    doc: "How the finished template is laid into the target. Default: box for generated templates, none for files.",
};

fn count(name: &'static str, doc: &'static str) -> Field {
    Field {
        name,
        kind: Kind::Integer { min: 1, max: 200 },
        default: Default::Integer(4),
        doc,
    }
}

fn with_recipe(mut own: Vec<Field>) -> &'static [Field] {
    let copy = |field: &'static Field| Field {
        name: field.name,
        kind: match field.name {
            "recipe" => Kind::List(&OPERATIONS),
            _ => Kind::Choice(match &field.kind {
                Kind::Choice(words) => words,
                _ => &[],
            }),
        },
        default: Default::Absent,
        doc: field.doc,
    };
    own.push(copy(&RECIPE));
    own.push(copy(&PLACE));
    keep(own)
}

fn scale() -> Field {
    Field {
        name: "scale",
        kind: Kind::Number { min: 1e-12, max: 1e12 },
        default: Default::Number(1.0),
        doc: "Factor for the coordinates in the file.",
    }
}

fn damage() -> Vec<Field> {
    vec![
        Field {
            name: "noise",
            kind: Kind::Number { min: 0.0, max: 1.0 },
            default: Default::Number(0.0),
            doc: "Random displacement of the vertices, as a share of the mean edge.",
        },
        Field {
            name: "flipped",
            kind: Kind::Number { min: 0.0, max: 1.0 },
            default: Default::Number(0.0),
            doc: "Share of the triangles that are turned around, at random.",
        },
        Field {
            name: "soup",
            kind: Kind::Boolean,
            default: Default::Boolean(false),
            doc: "Give every triangle vertices of its own.",
        },
        Field {
            name: "degenerate",
            kind: Kind::Number { min: 0.0, max: 1.0 },
            default: Default::Number(0.0),
            doc: "Share of the triangles, at random, beside which one without area is added.",
        },
        Field {
            name: "cloud",
            kind: Kind::Boolean,
            default: Default::Boolean(false),
            doc: "Keep only points: the triangles' barycentres, without normals.",
        },
        Field {
            name: "seed",
            kind: Kind::Integer {
                min: 0,
                max: 9_007_199_254_740_991,
            },
            default: Default::Integer(0),
            doc: "Start of the random numbers behind these.",
        },
    ]
}

static KIND: LazyLock<ModelKind> = LazyLock::new(|| {
    let mut templates = vec![
        Generator {
            name: "grid",
            parameters: with_recipe(vec![
                count("x", "Cubes along x."),
                count("y", "Cubes along y."),
                count("z", "Cubes along z."),
            ]),
            doc: "A block of unit cubes from the origin.",
        },
        Generator {
            name: "voxels",
            parameters: with_recipe(vec![Field {
                name: "along",
                kind: Kind::Integer { min: 1, max: 200 },
                default: Default::Integer(8),
                doc: "Cubes on the longest side of the target's box.",
            }]),
            doc: "The cubes whose centres lie within the target, made a manifold.",
        },
        Generator {
            name: "sweep",
            parameters: with_recipe(vec![
                Field {
                    name: "paths",
                    kind: Kind::List(&PATH),
                    default: Default::Required,
                    doc: "Paths of a square's centre, each a list of points, [x, y, z] or [x, y] with z = 0, such as \
                          [[[0, 0], [4, 0], [4, 4]]]. A path that ends where it starts is closed. Points on straight parts are \
                          sections; a path that starts or ends on the side of another's cell, corner on corner, is joined to \
                          it: give points there, as `bend` and `step` move the other sections.",
                },
                Field {
                    name: "width",
                    kind: Kind::Number { min: 1e-9, max: 1e9 },
                    default: Default::Number(1.0),
                    doc: "Side of the square.",
                },
                Field {
                    name: "step",
                    kind: Kind::Number { min: 1e-9, max: 1e9 },
                    default: Default::Number(1.0),
                    doc: "Wanted length of a cell along a path.",
                },
                Field {
                    name: "bend",
                    kind: Kind::Number { min: 0.0, max: 1e9 },
                    default: Default::Number(1.0),
                    doc: "Radius of the arcs that replace corners; with 0 the points are the sections, for paths given point by \
                          point.",
                },
            ]),
            doc: "Hexahedra swept along paths: rods, rings, knots and what they join to.",
        },
    ];
    templates.push(Generator {
        name: "shell",
        parameters: keep(vec![
            Field {
                name: "distance",
                kind: Kind::Number { min: 1e-3, max: 100.0 },
                default: Default::Number(2.0),
                doc: "Thickness of all layers of a side together, in per cent of the diagonal of the target's box.",
            },
            Field {
                name: "layers",
                kind: Kind::Integer { min: 1, max: 100 },
                default: Default::Integer(2),
                doc: "Layers on each side.",
            },
            Field {
                name: "side",
                kind: Kind::Choice(SIDES),
                default: Default::Text("both"),
                doc: "Where layers are grown.",
            },
        ]),
        doc: "Layers of prisms on the target's triangles, which keep their places; the rest is not fitted.",
    });
    for generator in generate::generators() {
        let mut own = Vec::new();
        for field in fields(generator.parameters) {
            own.push(Field {
                name: field.name,
                kind: match &field.kind {
                    Kind::Integer { min, max } => Kind::Integer { min: *min, max: *max },
                    Kind::Number { min, max } => Kind::Number { min: *min, max: *max },
                    _ => continue,
                },
                default: match &field.default {
                    Default::Integer(value) => Default::Integer(*value),
                    Default::Number(value) => Default::Number(*value),
                    _ => continue,
                },
                doc: field.doc,
            });
        }
        templates.push(Generator {
            name: generator.name,
            parameters: with_recipe(own),
            doc: generator.doc,
        });
    }
    let resolution = || Field {
        name: "triangles",
        kind: Kind::Integer {
            min: 100,
            max: 1_000_000,
        },
        default: Default::Integer(6000),
        doc: "Number of triangles wanted, roughly.",
    };
    let shape = |name: &'static str, mut own: Vec<Field>, doc: &'static str| {
        own.insert(0, resolution());
        own.extend(damage());
        Generator {
            name,
            parameters: keep(own),
            doc,
        }
    };
    let size = |name: &'static str, value: f64, doc: &'static str| Field {
        name,
        kind: Kind::Number { min: 1e-3, max: 1e3 },
        default: Default::Number(value),
        doc,
    };
    let targets = vec![
        shape(
            "ellipsoid",
            vec![
                size("a", 1.0, "Semi-axis along x."),
                size("b", 0.8, "Semi-axis along y."),
                size("c", 0.6, "Semi-axis along z."),
            ],
            "An ellipsoid.",
        ),
        shape(
            "pebble",
            vec![size("amplitude", 0.15, "Height of the bumps over the mean radius 1.")],
            "A sphere with smooth bumps.",
        ),
        shape(
            "block",
            vec![Field {
                name: "bend",
                kind: Kind::Number { min: -1.0, max: 1.0 },
                default: Default::Number(0.0),
                doc: "Second derivative, halved, of the bow that the block is bent to.",
            }],
            "A cuboid with a step: flat faces, sharp edges, one of them concave.",
        ),
        shape(
            "joint",
            vec![],
            "A plate with a square hole and a boss on top: a mechanical part of genus 1.",
        ),
        shape(
            "double-torus",
            vec![],
            "A rounded plate with two holes: smooth, genus 2.",
        ),
        shape("bone", vec![], "A shaft with two thick ends, smooth."),
        shape("tooth", vec![], "A rounded block with four cusps on top, smooth."),
        shape("hanger", vec![], "A flat ring with a hook: smooth, of genus 1."),
        shape("hand", vec![], "A palm with a thumb and four fingers, smooth."),
        shape("relief", vec![], "A slab with a hill and waves on top, smooth."),
        shape("figure", vec![], "A body with legs, arms and a head, smooth."),
    ];
    ModelKind {
        roles: keep(vec![
            Role {
                name: "template",
                required: true,
                file: true,
                file_parameters: with_recipe(vec![scale()]),
                generator_key: "generate",
                generators: keep(templates),
                doc: "The volume of hexahedra, prisms and tetrahedra that is fitted; a file may hold a surface if its recipe starts with \
                      `extrude`.",
            },
            Role {
                name: "target",
                required: false,
                file: true,
                file_parameters: keep({
                    let mut own = vec![scale()];
                    own.extend(damage());
                    own
                }),
                generator_key: "shape",
                generators: keep(targets),
                doc: "The surface that the volume's boundary is fitted to: triangles, quads or a point cloud. Without one, the \
                      template's own boundary.",
            },
        ]),
    }
});

/// The declaration.
pub fn kind() -> &'static ModelKind {
    &KIND
}
