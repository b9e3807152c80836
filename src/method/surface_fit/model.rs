//! What a model of a surface fit may be: a target and the template that is fitted to it.

use crate::mesh::generate::shape::shapes;
use crate::mesh::generate::template::templates;
use crate::method::model::{Generator, ModelKind, Role, fields, keep};
use crate::method::setting::{Default, Field, Kind};
use std::sync::LazyLock;

/// The template that is made from the target itself.
pub const VOXELS: &str = "voxels";

static VOXELS_FIELDS: &[Field] = &[Field {
    name: "quads",
    kind: Kind::Integer { min: 6, max: 200_000 },
    default: Default::Integer(384),
    doc: "number of quadrilaterals wanted; the result is as near as the grid allows",
}];

static TEMPLATE_FILE: &[Field] = &[Field {
    name: "place",
    kind: Kind::Choice(&[
        ("as-is", "where the file has it"),
        ("box", "stretched onto the target's box"),
    ]),
    default: Default::Text("as-is"),
    doc: "Where a template from a file goes.",
}];

/// The fields of a shape, and whether its points alone are to be fitted.
fn with_cloud(fields: &'static [Field]) -> &'static [Field] {
    let cloud = Field {
        name: "cloud",
        kind: Kind::Boolean,
        default: Default::Boolean(false),
        doc: "Fit the centres of the triangles, without normals, and nothing else; distances are measured to the surface.",
    };
    let copies = fields.iter().map(|field| Field {
        name: field.name,
        kind: match field.kind {
            Kind::Integer { min, max } => Kind::Integer { min, max },
            Kind::Number { min, max } => Kind::Number { min, max },
            _ => Kind::Boolean,
        },
        default: match field.default {
            Default::Integer(value) => Default::Integer(value),
            Default::Number(value) => Default::Number(value),
            _ => Default::Required,
        },
        doc: field.doc,
    });
    keep(copies.chain([cloud]).collect())
}

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
                        parameters: with_cloud(fields(keep(shape.parameters()))),
                        doc: shape.doc,
                    })
                    .collect(),
            ),
            doc: "The surface that is approximated: triangles or quadrilaterals, connected or not; or a cloud of points: a file \
                  without faces, or text with three numbers a line (.xyz, .pts).",
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
                    .chain([Generator {
                        name: VOXELS,
                        parameters: VOXELS_FIELDS,
                        doc: "The boundary of the cubes of a grid within the target; for closed targets of any shape.",
                    }])
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
