//! What a model of a tessellation may be: a surface from a file, or the boundary of a generated body.

use crate::mesh::connectivity;
use crate::mesh::format;
use crate::mesh::generate;
use crate::mesh::{TetrahedralMesh, TriangleMesh};
use crate::method::Failure;
use crate::method::model::{Generator, LoadedModel, ModelKind, Part, Role, fields, keep};
use std::sync::LazyLock;

static KIND: LazyLock<ModelKind> = LazyLock::new(|| ModelKind {
    roles: keep(vec![Role {
        name: "surface",
        required: true,
        file: true,
        file_parameters: &[],
        generator_key: "generate",
        generators: keep(
            generate::generators()
                .iter()
                .map(|generator| Generator {
                    name: generator.name,
                    parameters: fields(generator.parameters),
                    doc: generator.doc,
                })
                .collect(),
        ),
        doc: "The surface that is tessellated: the triangles and quadrilaterals of a file, the boundary of its tetrahedra if \
              it has none, or the boundary of a generated body.",
    }]),
});

/// The declaration.
pub fn kind() -> &'static ModelKind {
    &KIND
}

/// The surface of a model. Quadrilaterals are cut in two.
///
/// # Errors
/// `invalid-input` when there is none.
pub fn surface(model: &LoadedModel, notices: &mut Vec<String>) -> Result<TriangleMesh, Failure> {
    let part = model
        .parts
        .get("surface")
        .ok_or_else(|| Failure::invalid("the model has no `surface`; give it a file or a generator"))?;
    let surface = match part {
        Part::Generated { generator, parameters } => {
            let generated = generate::generate(generator, parameters)
                .map_err(|reason| Failure::invalid(format!("generator \"{generator}\" of the surface: {reason}")))?;
            boundary(generated.mesh)
        }
        Part::File { name, bytes, .. } => {
            let content = format::read(name, bytes).map_err(|error| Failure::invalid(error.to_string()))?;
            notices.extend(content.notices.iter().map(|notice| format!("{name}: {notice}")));
            let mut cells = content.triangles;
            for &[a, b, c, d] in &content.quads {
                cells.extend([[a, b, c], [a, c, d]]);
            }
            let points = content.points;
            if cells.is_empty() && !content.tetrahedra.is_empty() {
                notices.push(format!("{name}: the boundary of the tetrahedra is the surface"));
                let cells = content.tetrahedra;
                boundary(TetrahedralMesh { points, cells })
            } else if cells.is_empty() {
                return Err(Failure::invalid(format!(
                    "{name}: there are no triangles, quadrilaterals or tetrahedra; a tessellation needs a surface"
                )));
            } else {
                TriangleMesh { points, cells }
            }
        }
    };
    let limit = crate::geometry::point_tree::LARGEST;
    if let Some(vertex) = surface.points.iter().position(|x| !x.iter().all(|x| x.abs() < limit)) {
        return Err(Failure::invalid(format!(
            "surface: vertex {vertex} (counted from 0) has a coordinate that is not a number below {limit:e}; mend the file"
        )));
    }
    Ok(surface)
}

/// The boundary of a body, without the vertices inside.
fn boundary(mesh: TetrahedralMesh) -> TriangleMesh {
    let boundary = connectivity::boundary(&mesh.cells, mesh.points.len());
    let places = boundary.places();
    TriangleMesh {
        points: boundary
            .vertices
            .iter()
            .map(|&vertex| mesh.points[vertex as usize])
            .collect(),
        cells: boundary
            .triangles
            .iter()
            .map(|cell| cell.map(|vertex| places[vertex as usize]))
            .collect(),
    }
}
