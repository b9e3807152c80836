//! The problem that a model poses: a checked surface of quadrilaterals with a normal at every vertex, and the surface on
//! which the vertices lie, where it is known.

use super::model::RAYS;
use super::sampled::Sampled;
use super::settings::{Settings, VertexNormals};
use super::vertex_normals;
use crate::mesh::TriangleMesh;
use crate::mesh::check::{self, Severity};
use crate::mesh::format;
use crate::mesh::generate::surface::{self, analytic::Analytic};
use crate::mesh::quadrilateral::{self, Connectivity, QuadrilateralMesh, Triangles};
use crate::method::Failure;
use crate::method::model::{LoadedModel, Part};
use serde_json::Value;

/// The surface on which the vertices lie.
#[derive(Clone, Debug)]
pub enum Truth {
    Analytic(Analytic),
    Sampled(Sampled),
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Problem {
    pub mesh: QuadrilateralMesh,
    pub connectivity: Connectivity,
    /// One a vertex, of any length.
    pub normals: Vec<[f64; 3]>,
    pub truth: Option<Truth>,
    pub notices: Vec<String>,
}

pub(super) fn invalid(reason: String) -> Failure {
    Failure {
        kind: "invalid-input".to_string(),
        reason,
    }
}

impl Problem {
    /// Reads or generates the model, checks it and finds the normals.
    ///
    /// # Errors
    /// `invalid-input` for a mesh or normals that cannot be used.
    pub fn new(model: &LoadedModel, settings: &Settings) -> Result<Problem, Failure> {
        let mut notices = Vec::new();
        let part = model
            .parts
            .get("mesh")
            .ok_or_else(|| invalid("the model has no `mesh`; give it a file or a generator".to_string()))?;
        let sampled = match model.parts.get("surface") {
            Some(part) => Some(Sampled::new(read_surface(part, &mut notices)?)),
            None => None,
        };
        let (mut mesh, truth) = match part {
            Part::Generated { generator, parameters } if generator == RAYS => {
                let Some(sampled) = &sampled else {
                    return Err(invalid(
                        "the generator \"rays\" shoots at the model's `surface`, and the model has none; add surface = \
                         \"FILE\" with a closed triangulated surface"
                            .to_string(),
                    ));
                };
                let number = |name: &str| parameters.get(name).and_then(Value::as_u64).unwrap_or(0) as usize;
                let mesh = sampled
                    .quads(number("cells"), number("smoothing"))
                    .map_err(|reason| invalid(format!("generator \"rays\" of the mesh: {reason}")))?;
                (mesh, None)
            }
            Part::Generated { generator, parameters } => {
                let generated = surface::generate_surface(generator, parameters)
                    .map_err(|reason| invalid(format!("generator \"{generator}\" of the mesh: {reason}")))?;
                (generated.mesh, generated.exact.map(Truth::Analytic))
            }
            Part::File {
                name,
                bytes,
                parameters,
            } => (read_quads(name, bytes, parameters, &mut notices)?, None),
        };
        for problem in quadrilateral::check(&mut mesh) {
            match problem.severity {
                Severity::Error => return Err(invalid(format!("mesh: {}", problem.message))),
                Severity::Warning | Severity::Repaired => notices.push(format!("mesh: {}", problem.message)),
            }
        }
        let connectivity = Connectivity::of(&mesh.quads, mesh.points.len()).map_err(|defects| {
            invalid(format!(
                "mesh: the quadrilaterals form no oriented surface: {defects:?}"
            ))
        })?;
        let truth = truth.or(sampled.map(Truth::Sampled));
        let given = mesh.normals.take();
        let normals = match (settings.vertex_normals, given) {
            (VertexNormals::Auto | VertexNormals::Given, Some(normals)) => normals,
            (VertexNormals::Given, None) => {
                return Err(invalid(
                    "the mesh has no normals; add them to the file (OBJ `vn`, VTK `NORMALS`), or use vertex_normals = \
                     \"estimated\""
                        .to_string(),
                ));
            }
            (VertexNormals::Auto, None) | (VertexNormals::Surface, _) if matches!(truth, Some(Truth::Sampled(_))) => {
                match &truth {
                    Some(Truth::Sampled(surface)) => {
                        mesh.points.iter().map(|&point| surface.project(point).1).collect()
                    }
                    _ => Vec::new(),
                }
            }
            (VertexNormals::Surface, _) => {
                return Err(invalid(
                    "the model has no `surface` to take normals from; add one, or use vertex_normals = \"estimated\""
                        .to_string(),
                ));
            }
            (VertexNormals::Auto | VertexNormals::Estimated, _) => {
                notices.push("normals estimated from the quadrilaterals around each vertex".to_string());
                vertex_normals::estimate(&mesh, &connectivity).map_err(|reason| invalid(format!("mesh: {reason}")))?
            }
        };
        Ok(Problem {
            mesh,
            connectivity,
            normals,
            truth,
            notices,
        })
    }
}

fn read_quads(
    name: &str,
    bytes: &[u8],
    parameters: &Value,
    notices: &mut Vec<String>,
) -> Result<QuadrilateralMesh, Failure> {
    let content = format::read(name, bytes).map_err(|error| invalid(error.to_string()))?;
    notices.extend(content.notices.iter().map(|notice| format!("{name}: {notice}")));
    let split = parameters.get("triangles").and_then(Value::as_str) == Some("split");
    let triangles = if split { Triangles::Split } else { Triangles::Refuse };
    let (mut mesh, found) =
        QuadrilateralMesh::from_content(&content, triangles).map_err(|reason| invalid(format!("{name}: {reason}")))?;
    notices.extend(found.into_iter().map(|notice| format!("{name}: {notice}")));
    let scale = parameters.get("scale").and_then(Value::as_f64).unwrap_or(1.0);
    for point in &mut mesh.points {
        *point = point.map(|coordinate| coordinate * scale);
    }
    Ok(mesh)
}

/// A triangulated surface; quads in the file are cut in two.
fn read_surface(part: &Part, notices: &mut Vec<String>) -> Result<TriangleMesh, Failure> {
    let Part::File {
        name,
        bytes,
        parameters,
    } = part
    else {
        return Err(invalid("the model's `surface` must be a file".to_string()));
    };
    let content = format::read(name, bytes).map_err(|error| invalid(error.to_string()))?;
    notices.extend(content.notices.iter().map(|notice| format!("{name}: {notice}")));
    let scale = parameters.get("scale").and_then(Value::as_f64).unwrap_or(1.0);
    let mut cells = content.triangles;
    cells.extend(content.quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]));
    let surface = TriangleMesh {
        points: content
            .points
            .iter()
            .map(|point| point.map(|coordinate| coordinate * scale))
            .collect(),
        cells,
    };
    for problem in check::triangles(&surface) {
        // Vertices without triangles and flat triangles do no harm to nearest points.
        let harmless = matches!(
            problem.kind,
            "unreferenced-vertex" | "degenerate-cell" | "duplicate-cell"
        );
        if problem.severity == Severity::Error && !harmless {
            return Err(invalid(format!("{name}: {}", problem.message)));
        }
        notices.push(format!("{name}: {}", problem.message));
    }
    Ok(surface)
}
