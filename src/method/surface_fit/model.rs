//! What a model of a surface fit may be: a target and the template that is fitted to it.

use crate::mesh::generate::shape::shapes;
use crate::mesh::generate::template::templates;
use crate::method::model::{Generator, ModelKind, Role, fields, keep};
use crate::method::setting::{Default, Field, Kind};
use std::sync::LazyLock;

static TEMPLATE_FILE: &[Field] = &[Field {
    name: "place",
    kind: Kind::Choice(&[
        ("as-is", "where the file has it"),
        ("box", "stretched onto the target's box"),
    ]),
    default: Default::Text("as-is"),
    doc: "Where a template from a file goes.",
}];

static KIND: LazyLock<ModelKind> = LazyLock::new(|| ModelKind {
    roles: keep(vec![
        Role {
            name: "target",
            required: true,
            file: true,
            file_parameters: &[],
            generator_key: "shape",
            generators: keep(
                shapes()
                    .iter()
                    .map(|shape| Generator {
                        name: shape.name,
                        parameters: fields(keep(shape.parameters())),
                        doc: shape.doc,
                    })
                    .collect(),
            ),
            doc: "The surface that is approximated: triangles or quadrilaterals, connected or not.",
        },
        Role {
            name: "template",
            required: true,
            file: true,
            file_parameters: TEMPLATE_FILE,
            generator_key: "generate",
            generators: keep(
                templates()
                    .iter()
                    .map(|template| Generator {
                        name: template.name,
                        parameters: fields(template.parameters),
                        doc: template.doc,
                    })
                    .collect(),
            ),
            doc: "The mesh that is fitted, a control mesh where it is subdivided: its connectivity stays.",
        },
    ]),
});

/// The declaration.
pub fn kind() -> &'static ModelKind {
    &KIND
}
