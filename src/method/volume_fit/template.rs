//! The template: read or generated, shaped by its recipe, laid into the target.

use super::shell::{self, Shell};
use super::target::{Closure, Target};
use crate::fem::basis::Basis;
use crate::fem::boundary::Boundary;
use crate::fem::coefficient_file;
use crate::fem::space::Space;
use crate::mesh::TriangleMesh;
use crate::mesh::format::{self, Content};
use crate::mesh::mixed::{MixedMesh, Topology};
use crate::mesh::template::{carve, check_count, collapse, extrude, grid, pillow, sweep, voxels};
use crate::mesh::{bounding_box, diagonal, generate};
use crate::method::Failure;
use crate::method::model::Part;
use serde_json::Value;

fn invalid(reason: String) -> Failure {
    Failure::invalid(format!("template: {reason}"))
}

/// Reads or generates the template and follows its recipe.
///
/// # Errors
/// `invalid-input` for a file that holds no volume, a recipe that cannot be followed, or a mesh that is not valid.
pub fn read(part: &Part, target: Option<&Target>, notices: &mut Vec<String>) -> Result<Template, Failure> {
    let mut map = None;
    let mut shell = None;
    // Operations that making the mesh has used up.
    let mut taken = 0;
    let (mut mesh, parameters, generated) = match part {
        Part::Generated { generator, parameters } => {
            let count =
                |name: &str, default: u64| parameters.get(name).and_then(Value::as_u64).unwrap_or(default) as usize;
            let mesh = match generator.as_str() {
                "grid" => {
                    let counts = [count("x", 4), count("y", 4), count("z", 4)];
                    check_count(counts.iter().product(), "lower `x`, `y` or `z`").map_err(invalid)?;
                    grid::grid(counts)
                }
                "voxels" => {
                    let Some(target) = target.filter(|target| !target.surface.cells.is_empty()) else {
                        return Err(invalid(
                            "voxels need a target surface, with triangles, not a cloud; give one, or generate a grid"
                                .to_string(),
                        ));
                    };
                    voxels::matching(&target.surface, count("along", 8)).map_err(invalid)?.0
                }
                "sweep" => swept(parameters).map_err(invalid)?,
                "shell" => {
                    let Some(target) = target else {
                        return Err(invalid("a shell needs a target surface to grow on".to_string()));
                    };
                    let percent = parameters.get("distance").and_then(Value::as_f64).unwrap_or(2.0);
                    let side = parameters.get("side").and_then(Value::as_str).unwrap_or("both");
                    let distance = 0.01 * percent * diagonal(&target.surface.points);
                    let mut surface = target.surface.clone();
                    if Closure::of(&surface).is_closed() && surface.enclosed_volume() < 0.0 {
                        notices.push(
                            "the target is inside out and has been turned, as outside is along normals".to_string(),
                        );
                        for cell in &mut surface.cells {
                            cell.swap(1, 2);
                        }
                    }
                    let (mesh, grown) = shell::grow(&surface, distance, count("layers", 2), side).map_err(invalid)?;
                    shell = Some(grown);
                    mesh
                }
                name => {
                    let mut table = parameters.clone();
                    if let Some(table) = table.as_object_mut() {
                        table.remove("recipe");
                        table.remove("place");
                    }
                    let generated = generate::generate(name, &table).map_err(invalid)?;
                    MixedMesh {
                        points: generated.mesh.points,
                        tetrahedra: generated.mesh.cells,
                        ..MixedMesh::default()
                    }
                }
            };
            (mesh, parameters, generator != "voxels" && generator != "shell")
        }
        Part::File {
            name,
            bytes,
            parameters,
        } => {
            let scale = parameters.get("scale").and_then(Value::as_f64).unwrap_or(1.0);
            let mut mesh = if coefficient_file::sniff(bytes) {
                let volume = coefficient_file::read(bytes).map_err(|reason| invalid(format!("{name}: {reason}")))?;
                if parameters.get("recipe").is_some() {
                    return Err(invalid(format!(
                        "{name}: a recipe shapes straight cells, not the curved ones of a coefficient file; remove `recipe`"
                    )));
                }
                map = Some(Map {
                    basis: volume.basis,
                    orders: volume.orders,
                    x: volume.x,
                });
                volume.mesh
            } else {
                let mut content = format::read(name, bytes).map_err(|error| invalid(error.to_string()))?;
                notices.extend(content.notices.iter().map(|notice| format!("template: {notice}")));
                // Before a recipe, whose distances are those of the scaled mesh.
                content
                    .points
                    .iter_mut()
                    .flatten()
                    .for_each(|coordinate| *coordinate *= scale);
                let (mesh, found) = if is_surface(&content) {
                    taken = 1;
                    thickened(&content, parameters).map_err(invalid)?
                } else {
                    MixedMesh::from_content(&content).map_err(invalid)?
                };
                notices.extend(found.into_iter().map(|notice| format!("template: {notice}")));
                mesh
            };
            if map.is_some() {
                transform(&mut mesh, &mut map, [scale; 3], [0.0; 3]);
            }
            (mesh, parameters, false)
        }
    };
    let recipe = parameters.get("recipe").and_then(Value::as_array);
    for (step, operation) in recipe.into_iter().flatten().enumerate().skip(taken) {
        mesh = apply(&mesh, operation).map_err(|reason| invalid(format!("step {step} of the recipe: {reason}")))?;
    }
    let [by_faces, by_vertices] = mesh.topology().map_err(invalid)?.bodies();
    if by_vertices > 1 && shell.is_none() {
        notices.push(format!(
            "the template is {by_vertices} bodies that nothing joins; cells are neighbours where all corners of a face are shared"
        ));
    }
    if by_faces > by_vertices {
        notices.push(format!(
            "the template is {by_faces} bodies joined by faces, of which some touch in an edge or a vertex only"
        ));
    }
    let place = parameters.get("place").and_then(Value::as_str);
    if let Some(target) = target {
        lay(
            &mut mesh,
            &mut map,
            target,
            place.unwrap_or(if generated { "box" } else { "none" }),
        )
        .map_err(invalid)?;
    }
    Ok(Template { mesh, map, shell })
}

/// Hexahedra swept along the paths that are given.
fn swept(parameters: &Value) -> Result<MixedMesh, String> {
    let number = |name: &str| parameters.get(name).and_then(Value::as_f64).unwrap_or(1.0);
    let mut paths = Vec::new();
    for (index, path) in parameters
        .get("paths")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .enumerate()
    {
        let mut points = Vec::new();
        for (place, point) in path.as_array().into_iter().flatten().enumerate() {
            let numbers: Vec<f64> = point
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(Value::as_f64)
                .collect();
            points.push(match numbers[..] {
                [x, y] => [x, y, 0.0],
                [x, y, z] => [x, y, z],
                _ => {
                    return Err(format!(
                        "path {index}: point {place} needs two or three numbers, [x, y] or [x, y, z]"
                    ));
                }
            });
        }
        paths.push(points);
    }
    let sweep = sweep::Sweep {
        width: number("width"),
        step: number("step"),
        bend: number("bend"),
    };
    sweep::sweep(&paths, sweep)
}

/// A template: its cells, and the map over them where they are curved.
#[derive(Clone)]
pub struct Template {
    pub mesh: MixedMesh,
    pub map: Option<Map>,
    /// What the cells strive for where they are layers on a surface.
    pub shell: Option<Shell>,
}

/// Intervals between samples along an edge of a curved template that is its own target.
const FINE: usize = 12;

impl Template {
    /// Its boundary as triangles, sampled where it is curved.
    ///
    /// # Errors
    /// As [`Space::new`].
    pub fn boundary(&self, topology: &Topology) -> Result<TriangleMesh, String> {
        let Some(map) = &self.map else {
            return Ok(topology.boundary_triangles(&self.mesh.points));
        };
        let space = Space::new(&self.mesh, topology, map.basis, &map.orders)?;
        let highest = map.orders.iter().copied().max().unwrap_or(1);
        let intervals = if highest == 1 { 1 } else { (2 * highest).max(FINE) };
        let boundary = Boundary::new(&self.mesh, topology, &space, intervals);
        let mut points = Vec::new();
        boundary.positions(&map.x, &mut points);
        Ok(TriangleMesh {
            points,
            cells: boundary.triangles,
        })
    }
}

/// A map over a template as a coefficient file gives it.
#[derive(Clone)]
pub struct Map {
    pub basis: &'static dyn Basis,
    pub orders: Vec<usize>,
    /// Three numbers a node; those of the vertices are their places.
    pub x: Vec<f64>,
}

/// Applies `factors * point + offset`: edges, faces and cells bend by differences, which the offset leaves alone.
pub fn transform(mesh: &mut MixedMesh, map: &mut Option<Map>, factors: [f64; 3], offset: [f64; 3]) {
    for point in &mut mesh.points {
        *point = std::array::from_fn(|axis| factors[axis] * point[axis] + offset[axis]);
    }
    if let Some(map) = map {
        let (vertices, rest) = map.x.split_at_mut(3 * mesh.points.len());
        vertices.copy_from_slice(mesh.points.as_flattened());
        for (place, value) in rest.iter_mut().enumerate() {
            *value *= factors[place % 3];
        }
    }
}

/// The settings of one operation.
struct Operation<'a>(&'a Value);

impl Operation<'_> {
    fn name(&self) -> &str {
        self.0.get("op").and_then(Value::as_str).unwrap_or_default()
    }

    /// Whether it takes everything that is given.
    fn check(&self) -> Result<(), String> {
        let taken: &[&str] = match self.name() {
            "carve" => &["from", "to"],
            "extrude" => &["from", "to", "distance", "layers"],
            "pillow" => &["thickness"],
            _ => &["from", "to", "axis"],
        };
        let given = self.0.as_object().into_iter().flatten();
        for (name, value) in given.filter(|(name, _)| *name != "op") {
            if !value.is_null() && !taken.contains(&name.as_str()) {
                return Err(format!("{} takes {}, not `{name}`", self.name(), taken.join(", ")));
            }
        }
        Ok(())
    }

    fn number(&self, name: &str, default: f64) -> f64 {
        self.0.get(name).and_then(Value::as_f64).unwrap_or(default)
    }

    fn layers(&self) -> usize {
        self.0.get("layers").and_then(Value::as_u64).unwrap_or(1) as usize
    }

    fn has_box(&self) -> bool {
        self.0.get("from").is_some() || self.0.get("to").is_some()
    }

    /// The box; everything where a corner is not given.
    fn region(&self) -> Result<[[f64; 3]; 2], String> {
        let corner = |name: &str, missing: f64| -> Result<[f64; 3], String> {
            let Some(list) = self.0.get(name).and_then(Value::as_array) else {
                return Ok([missing; 3]);
            };
            let numbers: Vec<f64> = list.iter().filter_map(Value::as_f64).collect();
            <[f64; 3]>::try_from(numbers).map_err(|_| format!("`{name}` needs three numbers, [x, y, z]"))
        };
        Ok([corner("from", f64::NEG_INFINITY)?, corner("to", f64::INFINITY)?])
    }
}

/// One operation of a recipe.
fn apply(mesh: &MixedMesh, operation: &Value) -> Result<MixedMesh, String> {
    let operation = Operation(operation);
    operation.check()?;
    let region = operation.region()?;
    match operation.name() {
        "carve" if !operation.has_box() => Err("carving needs a box: give `from` and `to`".to_string()),
        "carve" => carve::carve(mesh, region),
        "extrude" => extrude::extrude(mesh, region, operation.number("distance", 1.0), operation.layers()),
        "pillow" => pillow::pillow(mesh, operation.number("thickness", 0.4)),
        "collapse" => {
            let axis = match operation.0.get("axis").and_then(Value::as_str) {
                Some("y") => 1,
                Some("z") => 2,
                _ => 0,
            };
            collapse::collapse(mesh, axis, region)
        }
        other => Err(format!("unknown operation {other:?}")),
    }
}

fn is_surface(content: &Content) -> bool {
    let cells = content.cells();
    let faces = cells.triangles.len() + cells.quads.len();
    faces > 0 && cells.tetrahedra.len() + cells.hexahedra.len() + cells.prisms.len() + cells.pyramids.len() == 0
}

/// The cells that a recipe's first operation extrudes from a surface.
fn thickened(content: &Content, parameters: &Value) -> Result<(MixedMesh, Vec<String>), String> {
    let first = parameters.get("recipe").and_then(|recipe| recipe.get(0)).map(Operation);
    let Some(operation) = first.filter(|operation| operation.name() == "extrude") else {
        return Err(
            "the file holds a surface; give a volume mesh, or let the recipe start with { op = \"extrude\", distance = ... }"
                .to_string(),
        );
    };
    let triangles = content.triangles.iter().map(|face| face.to_vec());
    let faces: Vec<Vec<u32>> = triangles
        .chain(content.quads.iter().map(|face| face.to_vec()))
        .collect();
    let at = |reason: String| format!("step 0 of the recipe: {reason}");
    operation.check().map_err(at)?;
    let region = operation.region().map_err(at)?;
    let distance = operation.number("distance", 1.0);
    let mesh = extrude::thicken(&content.points, &faces, region, distance, operation.layers()).map_err(at)?;
    MixedMesh::from_content(&Content {
        points: mesh.points,
        hexahedra: mesh.hexahedra,
        prisms: mesh.prisms,
        ..Content::default()
    })
}

/// Lays the template into the target's box.
fn lay(mesh: &mut MixedMesh, map: &mut Option<Map>, target: &Target, place: &str) -> Result<(), String> {
    let points = if target.surface.points.is_empty() {
        &target.sites
    } else {
        &target.surface.points
    };
    let (Some([low, high]), Some([from, to])) = (bounding_box(points), bounding_box(&mesh.points)) else {
        return Err("there are no points".to_string());
    };
    let factors: [f64; 3] = match place {
        "box" => std::array::from_fn(|axis| (high[axis] - low[axis]) / (to[axis] - from[axis])),
        "scale" => [diagonal(points) / diagonal(&mesh.points); 3],
        _ => return Ok(()),
    };
    if !factors.iter().all(|factor| factor.is_finite() && *factor > 0.0) {
        return Err("the target or the template is flat along an axis; use place = \"scale\" or \"none\"".to_string());
    }
    let offset =
        std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]) - factors[axis] * 0.5 * (from[axis] + to[axis]));
    transform(mesh, map, factors, offset);
    Ok(())
}
