//! The problem that a model poses: a source mesh, the places of its boundary vertices, and their units.
//!
//! The solvers work in units in which the volume within the target is 1, so that tolerances and weights do not depend on
//! the units of the files. The source is measured in the same units, or scaled to volume 1 as well.

use super::feasibility::{self, Obstacles, Splits};
use super::settings::{Settings, Split, Weighting};
use crate::mesh::check::{self, Severity};
use crate::mesh::connectivity::{self, Boundary};
use crate::mesh::format::{self, Format};
use crate::mesh::generate;
use crate::mesh::split;
use crate::mesh::target::{self, Target};
use crate::mesh::{self, TetrahedralMesh, TriangleMesh};
use crate::method::Failure;
use crate::method::model::{LoadedModel, Part};
use serde_json::Value;

/// See the module.
#[derive(Clone, Debug)]
pub struct Problem {
    /// In the solver's units; all tetrahedra are positive.
    pub source: TetrahedralMesh,
    pub boundary: Boundary,
    /// In the solver's units: a point for every vertex, of which only those of boundary vertices mean anything.
    pub targets: Vec<[f64; 3]>,
    /// The places of all vertices, where the target has them, in the solver's units.
    pub interior: Option<Vec<[f64; 3]>>,
    /// The source's points in the units of the file.
    pub given: Vec<[f64; 3]>,
    /// The targets in the units of their file.
    pub given_targets: Vec<[f64; 3]>,
    /// Units of the target's file in one of the solver's.
    pub unit: f64,
    /// Volume within the target over volume of the source, in the units of the files.
    pub ratio: f64,
    pub obstacles: Obstacles,
    pub splits: Splits,
    pub notices: Vec<String>,
}

impl Problem {
    /// Reads or generates the model, checks it, splits what the settings ask for, and chooses the units.
    ///
    /// # Errors
    /// `invalid-input` for a mesh or target that cannot be used.
    pub fn new(model: &LoadedModel, settings: &Settings) -> Result<Problem, Failure> {
        let part = |role: &str| {
            model
                .parts
                .get(role)
                .ok_or_else(|| Failure::invalid(format!("the model has no `{role}`; give it a file or a generator")))
        };
        let mut notices = Vec::new();
        let (mut source, natural) = read_source(part("mesh")?, &mut notices)?;
        let found: Vec<check::Problem> = check::tetrahedra(&mut source);
        for problem in found {
            match problem.severity {
                Severity::Error => return Err(Failure::invalid(format!("mesh: {}", problem.message))),
                Severity::Warning | Severity::Repaired => notices.push(format!("mesh: {}", problem.message)),
            }
        }
        let boundary = connectivity::boundary(&source.cells, source.points.len());
        let target = read_target(part("target")?, &source, &boundary, natural.as_deref(), &mut notices)?;
        Problem::from_parts(source, target, settings, notices)
    }

    /// The problem of a checked mesh with positive tetrahedra and a target for its boundary.
    ///
    /// # Errors
    /// `invalid-input` when the target does not enclose a positive volume.
    pub fn from_parts(
        source: TetrahedralMesh,
        target: Target,
        settings: &Settings,
        mut notices: Vec<String>,
    ) -> Result<Problem, Failure> {
        let mut boundary = connectivity::boundary(&source.cells, source.points.len());
        let mut positions = vec![[0.0; 3]; source.points.len()];
        for (&vertex, &position) in boundary.vertices.iter().zip(&target.positions) {
            positions[vertex as usize] = position;
        }
        let mut interior = target.interior;
        let enclosed = TriangleMesh {
            points: positions.clone(),
            cells: boundary.triangles.clone(),
        }
        .enclosed_volume();
        let volume = source.volume();
        let size = mesh::diagonal(&target.positions);
        if !(enclosed.abs() > 1e-12 * size.powi(3)) {
            return Err(Failure::invalid(format!(
                "the target encloses the volume {enclosed:e} in a box of diagonal {size:e}; it must be the image of a \
                 closed surface around a volume"
            )));
        }
        if enclosed < 0.0 {
            return Err(Failure::invalid(format!(
                "the target turns the boundary inside out: it encloses the volume {enclosed:e}; mirror it, for instance \
                 by negating one coordinate"
            )));
        }

        let mut splits = Splits::default();
        let source = match settings.split {
            Split::None => source,
            Split::Needed => {
                let (refined, done) = feasibility::split_needed(&source, &mut positions, |refinement| {
                    if let Some(interior) = &mut interior {
                        refinement.carry(interior);
                    }
                });
                splits = done;
                refined
            }
            Split::All => {
                let before = source.points.len();
                splits.edges = split::boundary_chords(&source, &boundary).len();
                let refinement = split::separate_boundary(&source);
                splits.tetrahedra = refinement.mesh.points.len() - before - splits.edges;
                refinement.carry(&mut positions);
                if let Some(interior) = &mut interior {
                    refinement.carry(interior);
                }
                refinement.mesh
            }
        };
        if splits != Splits::default() {
            boundary = connectivity::boundary(&source.cells, source.points.len());
            notices.push(format!(
                "split {} interior edges, {} interior faces and {} tetrahedra that would have forced inversions; the \
                 result has {} vertices and {} tetrahedra",
                splits.edges,
                splits.faces,
                splits.tetrahedra,
                source.points.len(),
                source.cells.len()
            ));
        }
        let obstacles = feasibility::check(&source, &boundary, &positions);

        let unit = enclosed.cbrt();
        let scale = if settings.rescale {
            volume.cbrt().recip()
        } else {
            unit.recip()
        };
        let scaled = |points: &[[f64; 3]], factor: f64| -> Vec<[f64; 3]> {
            points
                .iter()
                .map(|point| point.map(|coordinate| coordinate * factor))
                .collect()
        };
        Ok(Problem {
            targets: scaled(&positions, unit.recip()),
            interior: interior.map(|points| scaled(&points, unit.recip())),
            given: source.points.clone(),
            given_targets: positions,
            source: TetrahedralMesh {
                points: scaled(&source.points, scale),
                cells: source.cells,
            },
            boundary,
            unit,
            ratio: enclosed / volume,
            obstacles,
            splits,
            notices,
        })
    }

    /// Volume of the source in the solver's units.
    pub fn source_volume(&self) -> f64 {
        self.source.volume()
    }

    /// The diagonal of the source's box in the solver's units.
    pub fn source_diagonal(&self) -> f64 {
        mesh::diagonal(&self.source.points)
    }

    /// The mean determinant of every map onto the target, in the solver's units.
    pub fn mean_determinant(&self) -> f64 {
        self.source_volume().recip()
    }

    /// A weight for each tetrahedron, summing to 1: its share of the source's volume.
    pub fn volume_weights(&self) -> Vec<f64> {
        let volumes = self.source.volumes();
        let total: f64 = volumes.iter().sum();
        volumes.into_iter().map(|volume| volume / total).collect()
    }

    /// The weights of a setting, a factor for each tetrahedron. By target volume the density brings `det J` along, and
    /// the weights divide by its mean.
    pub fn weights(&self, weighting: Weighting) -> Vec<f64> {
        match weighting {
            Weighting::Volume => self.volume_weights(),
            Weighting::Target => {
                let mean = self.mean_determinant();
                self.volume_weights().into_iter().map(|weight| weight / mean).collect()
            }
            Weighting::Uniform => vec![1.0 / self.source.cells.len() as f64; self.source.cells.len()],
        }
    }

    /// Positions in the units of the target's file; boundary vertices on their targets stand there to the last bit.
    pub fn to_given_units(&self, positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut given: Vec<[f64; 3]> = positions
            .iter()
            .map(|point| point.map(|coordinate| coordinate * self.unit))
            .collect();
        for &vertex in &self.boundary.vertices {
            if positions[vertex as usize] == self.targets[vertex as usize] {
                given[vertex as usize] = self.given_targets[vertex as usize];
            }
        }
        given
    }
}

fn scale_of(parameters: &Value) -> f64 {
    parameters.get("scale").and_then(Value::as_f64).unwrap_or(1.0)
}

/// The source mesh, and positions on the cube where a generator has them.
fn read_source(part: &Part, notices: &mut Vec<String>) -> Result<(TetrahedralMesh, Option<Vec<[f64; 3]>>), Failure> {
    match part {
        Part::Generated { generator, parameters } => {
            let generated = generate::generate(generator, parameters)
                .map_err(|reason| Failure::invalid(format!("generator \"{generator}\" of the mesh: {reason}")))?;
            Ok((generated.mesh, generated.natural))
        }
        Part::File {
            name,
            bytes,
            parameters,
        } => {
            let mut mesh = read_tetrahedra(name, bytes, notices)?;
            let scale = scale_of(parameters);
            for point in &mut mesh.points {
                *point = point.map(|coordinate| coordinate * scale);
            }
            Ok((mesh, None))
        }
    }
}

/// The tetrahedra of a mesh file; other cells are told in a notice.
fn read_tetrahedra(name: &str, bytes: &[u8], notices: &mut Vec<String>) -> Result<TetrahedralMesh, Failure> {
    let content = format::read(name, bytes).map_err(|error| Failure::invalid(error.to_string()))?;
    notices.extend(content.notices.iter().map(|notice| format!("{name}: {notice}")));
    let volumes = content.hexahedra.len() + content.prisms.len() + content.pyramids.len();
    if volumes > 0 {
        return Err(Failure::invalid(format!(
            "{name}: the mesh has {volumes} hexahedra, prisms or pyramids; a map needs tetrahedra only, split them first"
        )));
    }
    if content.tetrahedra.is_empty() {
        return Err(Failure::invalid(format!(
            "{name}: the mesh has no tetrahedra; a map needs a volume mesh"
        )));
    }
    Ok(TetrahedralMesh {
        points: content.points,
        cells: content.tetrahedra,
    })
}

fn read_target(
    part: &Part,
    source: &TetrahedralMesh,
    boundary: &Boundary,
    natural: Option<&[[f64; 3]]>,
    notices: &mut Vec<String>,
) -> Result<Target, Failure> {
    match part {
        Part::Generated { generator, parameters } => target::shape(generator, parameters, source, boundary, natural)
            .map_err(|reason| Failure::invalid(format!("shape \"{generator}\" of the target: {reason}"))),
        Part::File {
            name,
            bytes,
            parameters,
        } => {
            let scale = scale_of(parameters);
            if Format::of_content(bytes).or(Format::of_name(name)).is_none() {
                let text = std::str::from_utf8(bytes).map_err(|error| {
                    Failure::invalid(format!(
                        "{name}: neither a mesh nor text (byte {} is no UTF-8); a list of targets has a line `index x y z` \
                         for every boundary vertex",
                        error.valid_up_to()
                    ))
                })?;
                return target::list::parse(text, boundary, scale)
                    .map_err(|reason| Failure::invalid(format!("{name}: {reason}")));
            }
            let mut mesh = read_tetrahedra(name, bytes, notices)?;
            for point in &mut mesh.points {
                *point = point.map(|coordinate| coordinate * scale);
            }
            target::from_mesh(source, boundary, &mesh).map_err(|reason| Failure::invalid(format!("{name}: {reason}")))
        }
    }
}
