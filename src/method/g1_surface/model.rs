//! What a model of a G1 surface may be: a mesh of quadrilaterals, and a triangulated surface that its vertices sample.

use crate::mesh::generate::Parameter;
use crate::mesh::generate::surface;
use crate::method::model::{Generator, ModelKind, Role, fields, keep};
use crate::method::setting::{Default, Field, Kind};
use std::sync::LazyLock;

static MESH_FILE: &[Field] = &[
    Field {
        name: "scale",
        kind: Kind::Number { min: 1e-12, max: 1e12 },
        default: Default::Number(1.0),
        doc: "Factor for the coordinates in the file.",
    },
    Field {
        name: "triangles",
        kind: Kind::Choice(&[
            ("refuse", "triangles among the quadrilaterals are an error"),
            (
                "split",
                "every triangle becomes three quadrilaterals about its centre, every quadrilateral four",
            ),
        ]),
        default: Default::Text("refuse"),
        doc: "What to do with triangles.",
    },
];

static SURFACE_FILE: &[Field] = &[Field {
    name: "scale",
    kind: Kind::Number { min: 1e-12, max: 1e12 },
    default: Default::Number(1.0),
    doc: "Factor for the coordinates in the file.",
}];

/// The generator that shoots rays at the model's surface.
pub const RAYS: &str = "rays";

static RAYS_PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "cells",
        whole: true,
        default: 16.0,
        min: 2.0,
        max: 512.0,
        doc: "quadrilaterals along an edge of the cube; the mesh has 6 cells^2 of them",
    },
    Parameter {
        name: "smoothing",
        whole: true,
        default: 20.0,
        min: 0.0,
        max: 1000.0,
        doc: "rounds in which every vertex moves towards the mean of its neighbours and back onto the surface",
    },
];

/// The generator that contours the signed distance of the model's surface.
pub const DUAL_CONTOURING: &str = "dual-contouring";

static DUAL_CONTOURING_PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "cells",
        whole: true,
        default: 16.0,
        min: 2.0,
        max: 512.0,
        doc: "cubes along the longest side of the surface's box",
    },
    Parameter {
        name: "smoothing",
        whole: true,
        default: 20.0,
        min: 0.0,
        max: 1000.0,
        doc: "rounds in which every vertex moves towards the mean of its neighbours and back onto the surface",
    },
];

static KIND: LazyLock<ModelKind> = LazyLock::new(|| {
    let generator = |generator: &surface::SurfaceGenerator| Generator {
        name: generator.name,
        parameters: fields(generator.parameters),
        doc: generator.doc,
    };
    let mut meshes: Vec<Generator> = surface::surfaces().iter().map(generator).collect();
    let surfaces: Vec<Generator> = surface::surfaces().iter().map(generator).collect();
    meshes.push(Generator {
        name: RAYS,
        parameters: fields(RAYS_PARAMETERS),
        doc: "the subdivided cube shot along rays from the centre onto the model's `surface`, which must be star-shaped",
    });
    meshes.push(Generator {
        name: DUAL_CONTOURING,
        parameters: fields(DUAL_CONTOURING_PARAMETERS),
        doc: "the boundary of the cubes within the model's closed `surface`, of any shape, by dual contouring of its signed \
              distance",
    });
    ModelKind {
        roles: keep(vec![
            Role {
                name: "mesh",
                required: true,
                file: true,
                file_parameters: MESH_FILE,
                generator_key: "generate",
                generators: keep(meshes),
                doc: "The quadrilaterals, with normals where the file has them.",
            },
            Role {
                name: "surface",
                required: false,
                file: true,
                file_parameters: SURFACE_FILE,
                generator_key: "generate",
                generators: keep(surfaces),
                doc: "A triangulated surface on which the vertices lie: it gives normals and distances. Quadrilaterals are \
                      halved.",
            },
            Role {
                name: "creases",
                required: false,
                file: true,
                file_parameters: &[],
                generator_key: "generate",
                generators: &[],
                doc: "A text file of sharp edges: two vertex numbers a line, counted from 0 in the order of the mesh's file.",
            },
        ]),
    }
});

/// The declaration.
pub fn kind() -> &'static ModelKind {
    &KIND
}
