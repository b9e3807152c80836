//! The problem that a model poses: a checked surface of quadrilaterals with a normal at every vertex, and the surface on
//! which the vertices lie, where it is known.

use super::creases::{self, CornerNormals, Creases, Sources};
use super::frame::Frame;
use super::model::{DUAL_CONTOURING, RAYS};
use super::sampled::Sampled;
use super::settings::{Settings, VertexNormals};
use super::vertex_normals;
use crate::linalg::vector3::dot;
use crate::mesh::check::{self, Severity};
use crate::mesh::crease;
use crate::mesh::format;
use crate::mesh::generate::surface::{self, Creased, analytic::Analytic};
use crate::mesh::quadrilateral::{self, Connectivity, QuadrilateralMesh, Triangles};
use crate::mesh::{TriangleMesh, length};
use crate::method::Failure;
use crate::method::model::{LoadedModel, Part};
use crate::optimize::Observer;
use serde_json::Value;

/// The surface on which the vertices lie.
#[derive(Clone, Debug)]
pub enum Truth {
    Analytic(Analytic),
    /// Smooth pieces that meet in creases.
    Pieces(Creased),
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
    /// Where the mesh was cut open along creases.
    pub creases: Option<Creases>,
    /// The coordinates that mesh and sampled surface are in.
    pub frame: Frame,
    pub notices: Vec<String>,
}

/// Degrees between planes from which on an edge that stays smooth is worth a notice.
const SHARP: f64 = 60.0;

/// A mesh as the model gives it, and what comes with it.
struct Given {
    mesh: QuadrilateralMesh,
    truth: Option<Truth>,
    sources: Sources,
    /// Whether the mesh was made on the sampled surface, in its frame.
    on_sampled: bool,
}

impl Problem {
    /// Reads or generates the model, checks it, cuts it along its creases and finds the normals.
    ///
    /// # Errors
    /// `invalid-input` for a mesh or normals that cannot be used.
    pub fn new(model: &LoadedModel, settings: &Settings, observer: &dyn Observer) -> Result<Problem, Failure> {
        let mut notices = Vec::new();
        let mut frame = Frame::default();
        let sampled = match model.parts.get("surface") {
            Some(part) => {
                let mut surface = read_surface(part, &mut notices)?;
                frame = Frame::of(&surface.points);
                frame.enter(&mut surface.points);
                Some(Sampled::new(surface))
            }
            None => None,
        };
        let Given {
            mut mesh,
            truth,
            mut sources,
            on_sampled,
        } = given(model, settings, sampled.as_ref(), observer, &mut notices)?;
        if truth.is_some() {
            // A formula stands in its own coordinates, near the origin.
            frame = Frame::default();
        } else if !on_sampled {
            if sampled.is_none() {
                frame = Frame::of(&mesh.points);
            }
            frame.enter(&mut mesh.points);
        }
        if let Some(part) = model.parts.get("creases") {
            sources.listed.extend(read_creases(part, &mesh, &sources)?);
        }
        for problem in quadrilateral::check(&mut mesh) {
            match problem.severity {
                Severity::Error => return Err(Failure::invalid(format!("mesh: {}", problem.message))),
                Severity::Warning | Severity::Repaired => notices.push(format!("mesh: {}", problem.message)),
            }
        }
        let mut connectivity = Connectivity::of(&mesh.quads, mesh.points.len()).map_err(|defects| {
            Failure::invalid(format!(
                "mesh: the quadrilaterals form no oriented surface: {defects:?}"
            ))
        })?;
        let truth = truth.or(sampled.map(Truth::Sampled));
        let given =
            mesh.normals.is_some() && matches!(settings.vertex_normals, VertexNormals::Auto | VertexNormals::Given);
        let mut creases = None;
        if settings.keeps_creases() {
            let sharp = creases::sharp(&mesh, &connectivity, &sources, settings).map_err(Failure::invalid)?;
            if sharp.contains(&true) {
                creases = creases::cut(&mut mesh, &mut connectivity, sharp, &mut notices);
            } else if truth.is_none() && settings.crease_angle.is_none() {
                let count = crease::by_angle(&mesh, &connectivity, SHARP)
                    .into_iter()
                    .filter(|&sharp| sharp)
                    .count();
                if count > 0 {
                    notices.push(format!(
                        "{count} edges are sharper than {SHARP} degrees and are rounded off; crease_angle = {SHARP} keeps them \
                         sharp"
                    ));
                }
            }
        }
        let mut normals = normals(&mut mesh, &connectivity, truth.as_ref(), settings, &mut notices)?;
        if let Some(creases) = &creases {
            let corners = sources.corners.as_ref();
            let estimated =
                creases::normals_by_side(creases, &mesh, &connectivity, truth.as_ref(), corners, &mut normals)
                    .map_err(|reason| Failure::invalid(format!("mesh: {reason}")))?;
            if given && estimated > 0 {
                notices.push(format!(
                    "the normals given at {estimated} vertices on creases belong to no side: replaced there by those estimated \
                     from the quadrilaterals of each side"
                ));
            }
        }
        Ok(Problem {
            mesh,
            connectivity,
            normals,
            truth,
            creases,
            frame,
            notices,
        })
    }

    /// The mesh before it was cut along creases, quads in the same order.
    pub fn whole(&self) -> (&QuadrilateralMesh, &Connectivity) {
        match &self.creases {
            Some(creases) => (&creases.whole, &creases.whole_connectivity),
            None => (&self.mesh, &self.connectivity),
        }
    }
}

/// Reads or generates the mesh.
fn given(
    model: &LoadedModel,
    settings: &Settings,
    sampled: Option<&Sampled>,
    observer: &dyn Observer,
    notices: &mut Vec<String>,
) -> Result<Given, Failure> {
    let part = model
        .parts
        .get("mesh")
        .ok_or_else(|| Failure::invalid("the model has no `mesh`; give it a file or a generator"))?;
    if let (Part::Generated { .. }, Some(field)) = (part, &settings.crease_field) {
        return Err(Failure::invalid(format!(
            "crease_field = \"{field}\" names a field of a file, but the mesh is generated; leave it out"
        )));
    }
    if matches!(part, Part::Generated { .. }) && settings.crease_normals {
        return Err(Failure::invalid(
            "crease_normals reads the normals of a file's corners, but the mesh is generated; leave it out",
        ));
    }
    match part {
        Part::Generated { generator, parameters } if generator == RAYS || generator == DUAL_CONTOURING => {
            let Some(sampled) = sampled else {
                return Err(Failure::invalid(format!(
                    "the generator \"{generator}\" needs the model's `surface`, and the model has none; add surface = \
                     \"FILE\" with a closed triangulated surface"
                )));
            };
            let number = |name: &str| parameters.get(name).and_then(Value::as_u64).unwrap_or(0) as usize;
            let (cells, smoothing) = (number("cells"), number("smoothing"));
            let mesh = if generator == RAYS {
                sampled.by_rays(cells, smoothing, observer)
            } else {
                sampled.by_dual_contouring(cells, smoothing, observer)
            };
            Ok(Given {
                mesh: mesh
                    .map_err(|reason| Failure::invalid(format!("generator \"{generator}\" of the mesh: {reason}")))?,
                truth: None,
                sources: Sources::default(),
                on_sampled: true,
            })
        }
        Part::Generated { generator, parameters } => {
            let generated = surface::generate_surface(generator, parameters)
                .map_err(|reason| Failure::invalid(format!("generator \"{generator}\" of the mesh: {reason}")))?;
            let listed = generated.creased.as_ref().map(|creased| creased.sharp.clone());
            let pieces = generated.creased.map(Truth::Pieces);
            Ok(Given {
                mesh: generated.mesh,
                truth: generated.exact.map(Truth::Analytic).or(pieces),
                sources: Sources {
                    listed: listed.unwrap_or_default(),
                    ..Sources::default()
                },
                on_sampled: false,
            })
        }
        Part::File {
            name,
            bytes,
            parameters,
        } => read_quads(name, bytes, parameters, settings, notices),
    }
}

/// The normals at the vertices, from where the settings say. Takes those of the mesh.
fn normals(
    mesh: &mut QuadrilateralMesh,
    connectivity: &Connectivity,
    truth: Option<&Truth>,
    settings: &Settings,
    notices: &mut Vec<String>,
) -> Result<Vec<[f64; 3]>, Failure> {
    let given = mesh.normals.take();
    match (settings.vertex_normals, given, truth) {
        (VertexNormals::Auto | VertexNormals::Given, Some(normals), _) => Ok(normals),
        (VertexNormals::Given, None, _) => Err(Failure::invalid(
            "the mesh has no normals; add them to the file (OBJ `vn`, VTK `NORMALS`), or use vertex_normals = \
             \"estimated\""
                .to_string(),
        )),
        (VertexNormals::Auto, None, Some(Truth::Sampled(surface)))
        | (VertexNormals::Surface, _, Some(Truth::Sampled(surface))) => {
            Ok(mesh.points.iter().map(|&point| surface.project(point).1).collect())
        }
        (VertexNormals::Surface, _, _) => Err(Failure::invalid(
            "the model has no `surface` to take normals from; add one, or use vertex_normals = \"estimated\"",
        )),
        (VertexNormals::Auto | VertexNormals::Estimated, _, _) => {
            notices.push("normals estimated from the quadrilaterals around each vertex".to_string());
            vertex_normals::estimate(mesh, connectivity).map_err(|reason| Failure::invalid(format!("mesh: {reason}")))
        }
    }
}

/// The edges that a text file lists.
fn read_creases(part: &Part, mesh: &QuadrilateralMesh, sources: &Sources) -> Result<Vec<[u32; 2]>, Failure> {
    let Part::File { name, bytes, .. } = part else {
        return Err(Failure::invalid("the model's `creases` must be a file"));
    };
    let text = std::str::from_utf8(bytes).map_err(|error| {
        Failure::invalid(format!(
            "{name}: byte {} is no text; write two vertex numbers a line",
            error.valid_up_to()
        ))
    })?;
    let vertices = sources.vertices.unwrap_or(mesh.points.len());
    creases::parse(text, vertices).map_err(|reason| Failure::invalid(format!("{name}: {reason}")))
}

fn read_quads(
    name: &str,
    bytes: &[u8],
    parameters: &Value,
    settings: &Settings,
    notices: &mut Vec<String>,
) -> Result<Given, Failure> {
    let content = format::read(name, bytes).map_err(|error| Failure::invalid(error.to_string()))?;
    notices.extend(content.notices.iter().map(|notice| format!("{name}: {notice}")));
    let split = parameters.get("triangles").and_then(Value::as_str) == Some("split");
    if !split && !content.triangles.is_empty() {
        let (triangles, quads) = (content.triangles.len(), content.quads.len());
        let what = if quads == 0 {
            format!("this is a triangle mesh, of {triangles} triangles")
        } else {
            format!("there are {triangles} triangles among {quads} quadrilaterals")
        };
        return Err(Failure::invalid(format!(
            "{name}: {what}, the first with vertices {:?} (counted from 0); remesh it with quadrilaterals, or write mesh = {{ \
             file = \"{name}\", triangles = \"split\" }} to cut every triangle into three quadrilaterals and every \
             quadrilateral into four",
            content.triangles[0]
        )));
    }
    let triangles = if split { Triangles::Split } else { Triangles::Refuse };
    let (mut mesh, found) = QuadrilateralMesh::from_content(&content, triangles)
        .map_err(|reason| Failure::invalid(format!("{name}: {reason}")))?;
    notices.extend(found.into_iter().map(|notice| format!("{name}: {notice}")));
    let scale = parameters.get("scale").and_then(Value::as_f64).unwrap_or(1.0);
    for point in &mut mesh.points {
        *point = point.map(|coordinate| coordinate * scale);
    }
    let labels = match &settings.crease_field {
        Some(field) if settings.keeps_creases() => {
            Some(creases::labels(&content, field).map_err(|reason| Failure::invalid(format!("{name}: {reason}")))?)
        }
        _ => None,
    };
    let corners = if settings.keeps_creases() && settings.crease_normals {
        let normals = format::quad_corner_normals(bytes).filter(|normals| normals.len() == mesh.quads.len());
        let normals = normals.ok_or_else(|| {
            Failure::invalid(format!(
                "{name}: crease_normals needs an OBJ file of quadrilaterals alone, each corner with a normal (`f 1//1 2//1 \
                 3//1 4//1`); leave crease_normals out, or use crease_angle"
            ))
        })?;
        Some(CornerNormals {
            quads: mesh.quads.clone(),
            normals,
        })
    } else {
        notices.extend(summed_normals(name, bytes, &mesh));
        None
    };
    Ok(Given {
        mesh,
        truth: None,
        sources: Sources {
            listed: Vec::new(),
            corners,
            labels,
            halved: !content.triangles.is_empty(),
            vertices: Some(content.points.len()),
        },
        on_sampled: false,
    })
}

/// A notice where the corners of an OBJ file's quads name different normals at a vertex, of which the sum is used.
fn summed_normals(name: &str, bytes: &[u8], mesh: &QuadrilateralMesh) -> Option<String> {
    if !name.to_ascii_lowercase().ends_with(".obj") {
        return None;
    }
    let corners = format::quad_corner_normals(bytes).filter(|corners| corners.len() == mesh.quads.len())?;
    let mut first: Vec<Option<[f64; 3]>> = vec![None; mesh.points.len()];
    let mut differs = vec![false; mesh.points.len()];
    for (vertex, normal) in mesh.quads.as_flattened().iter().zip(corners.as_flattened()) {
        let known = *first[*vertex as usize].get_or_insert(*normal);
        let (sizes, cosine) = (length(known) * length(*normal), dot(known, *normal));
        differs[*vertex as usize] |= cosine < (1.0 - 1e-6) * sizes;
    }
    let place = differs.iter().position(|&differs| differs)?;
    let count = differs.iter().filter(|&&differs| differs).count();
    Some(format!(
        "{name}: at {count} vertices, the first is vertex {place} (from 0), the corners of faces name different normals: their sum \
         is used; crease_normals = true keeps such edges sharp"
    ))
}

/// A triangulated surface, from a file or generated; quads are cut in two.
fn read_surface(part: &Part, notices: &mut Vec<String>) -> Result<TriangleMesh, Failure> {
    let (name, bytes, parameters) = match part {
        Part::File {
            name,
            bytes,
            parameters,
        } => (name, bytes, parameters),
        Part::Generated { generator, parameters } => {
            let generated = surface::generate_surface(generator, parameters)
                .map_err(|reason| Failure::invalid(format!("generator \"{generator}\" of the surface: {reason}")))?;
            return Ok(TriangleMesh {
                points: generated.mesh.points,
                cells: halves(&generated.mesh.quads).collect(),
            });
        }
    };
    let content = format::read(name, bytes).map_err(|error| Failure::invalid(error.to_string()))?;
    notices.extend(content.notices.iter().map(|notice| format!("{name}: {notice}")));
    let scale = parameters.get("scale").and_then(Value::as_f64).unwrap_or(1.0);
    let mut cells = content.triangles;
    cells.extend(halves(&content.quads));
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
            return Err(Failure::invalid(format!("{name}: {}", problem.message)));
        }
        notices.push(format!("{name}: {}", problem.message));
    }
    Ok(surface)
}

/// Every quad as two triangles.
fn halves(quads: &[[u32; 4]]) -> impl Iterator<Item = [u32; 3]> {
    quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
}
