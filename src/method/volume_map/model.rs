//! What a model of a volumetric map may be: a source mesh and where its boundary goes.

use crate::mesh::generate;
use crate::mesh::target;
use crate::method::model::{Generator, ModelKind, Role, fields, keep};
use crate::method::setting::{Default, Field, Kind};
use std::sync::LazyLock;

/// Parameters of a target file.
static TARGET_FILE: &[Field] = &[Field {
    name: "scale",
    kind: Kind::Number { min: 1e-12, max: 1e12 },
    default: Default::Number(1.0),
    doc: "Factor for the coordinates in the file.",
}];

/// Parameters of a source file.
static MESH_FILE: &[Field] = &[Field {
    name: "scale",
    kind: Kind::Number { min: 1e-12, max: 1e12 },
    default: Default::Number(1.0),
    doc: "Factor for the coordinates in the file.",
}];

static KIND: LazyLock<ModelKind> = LazyLock::new(|| {
    let meshes = generate::generators()
        .iter()
        .map(|generator| Generator {
            name: generator.name,
            parameters: fields(generator.parameters),
            doc: generator.doc,
        })
        .collect();
    let shapes = target::shapes()
        .iter()
        .map(|shape| Generator {
            name: shape.name,
            parameters: fields(shape.parameters),
            doc: shape.doc,
        })
        .collect();
    ModelKind {
        roles: keep(vec![
            Role {
                name: "mesh",
                required: true,
                file: true,
                file_parameters: MESH_FILE,
                generator_key: "generate",
                generators: keep(meshes),
                doc: "The tetrahedral mesh that is mapped.",
            },
            Role {
                name: "target",
                required: true,
                file: true,
                file_parameters: TARGET_FILE,
                generator_key: "shape",
                generators: keep(shapes),
                doc: "Where the boundary goes: a mesh of the same connectivity, a text file with a line `index x y z` for \
                      every boundary vertex (index from 0), or a shape.",
            },
        ]),
    }
});

/// The declaration.
pub fn kind() -> &'static ModelKind {
    &KIND
}
