//! The problem that a model poses: a target surface and a template in common units.
//!
//! The solver works in units in which the diagonal of the target's box is 1 and its centre the origin, so that weights do
//! not depend on the units of the files.

use super::model::VOXELS;
use super::{cloud, voxels};
use crate::mesh::format;
use crate::mesh::generate::shape::generate_shape;
use crate::mesh::generate::template::generate_template;
use crate::mesh::surface::Surface;
use crate::mesh::{self, TriangleMesh};
use crate::method::Failure;
use crate::method::model::{LoadedModel, Part};

/// See the module.
#[derive(Clone, Debug)]
pub struct Problem {
    /// In the solver's units. Without triangles where a file has points alone.
    pub target: TriangleMesh,
    /// In the solver's units: the points that are fitted where the target's surface is not to be used.
    pub cloud: Option<Vec<[f64; 3]>>,
    /// In the solver's units.
    pub template: Surface,
    /// The template was made within a cube of the target.
    pub near: bool,
    /// Centre and diagonal of the target's box in the units of its file.
    pub centre: [f64; 3],
    pub diagonal: f64,
    pub notices: Vec<String>,
}

/// Centre and diagonal of the target's box.
#[derive(Clone, Copy, Debug)]
struct Units {
    centre: [f64; 3],
    diagonal: f64,
}

impl Units {
    /// # Errors
    /// A target without points or without size.
    fn of(target: &TriangleMesh) -> Result<Units, Failure> {
        let Some([low, high]) = mesh::bounding_box(&target.points) else {
            return Err(Failure::invalid("target: there are no points"));
        };
        let extents: [f64; 3] = std::array::from_fn(|axis| high[axis] - low[axis]);
        let longest = extents.into_iter().fold(0.0, f64::max);
        // In units of the longest extent, whose square may underflow.
        let diagonal = longest * extents.iter().map(|x| (x / longest).powi(2)).sum::<f64>().sqrt();
        if !(diagonal > 0.0 && diagonal.is_finite()) {
            return Err(Failure::invalid(format!(
                "target: {} points in a box with the diagonal {}; give points that lie apart and within range",
                target.points.len(),
                if longest > 0.0 { diagonal } else { 0.0 }
            )));
        }
        Ok(Units {
            centre: std::array::from_fn(|axis| 0.5 * low[axis] + 0.5 * high[axis]),
            diagonal,
        })
    }

    fn scale(self, points: &mut [[f64; 3]]) {
        for point in points {
            *point = std::array::from_fn(|axis| (point[axis] - self.centre[axis]) / self.diagonal);
        }
    }

    fn scaled(self, mut target: TriangleMesh) -> TriangleMesh {
        self.scale(&mut target.points);
        target
    }
}

impl Problem {
    /// Reads or generates the model.
    ///
    /// # Errors
    /// `invalid-input` for a surface that cannot be used.
    pub fn new(model: &LoadedModel) -> Result<Problem, Failure> {
        let part = |role: &str| {
            model
                .parts
                .get(role)
                .ok_or_else(|| Failure::invalid(format!("the model has no `{role}`; give it a file or a generator")))
        };
        let mut notices = Vec::new();
        let mut only_points = false;
        let target = match part("target")? {
            Part::Generated { generator, parameters } => {
                let mut parameters = parameters.clone();
                let cloud = parameters.as_object_mut().and_then(|table| table.remove("cloud"));
                only_points = cloud.and_then(|cloud| cloud.as_bool()).unwrap_or(false);
                generate_shape(generator, &parameters)
                    .map_err(|message| Failure::invalid(format!("target: {message}")))?
            }
            Part::File { name, bytes, .. } => match points(name, bytes, &mut notices)? {
                Some(points) => TriangleMesh {
                    points,
                    cells: Vec::new(),
                },
                None => read(name, bytes, "target", &mut notices)?.triangulated(),
            },
        };
        let units = Units::of(&target)?;
        let target = units.scaled(target);
        // A template is made on the scaled target, whose size no rounding and no underflow can spoil.
        let Some([low, high]) = mesh::bounding_box(&target.points) else {
            return Err(Failure::invalid("target: there are no points"));
        };
        let mut near = false;
        let template = match part("template")? {
            Part::Generated { generator, parameters } if generator == VOXELS => {
                near = true;
                let quads = parameters.get("quads").and_then(|quads| quads.as_u64()).unwrap_or(384);
                let made = voxels::template(&target, quads as usize)
                    .map_err(|message| Failure::invalid(format!("template: {message}")))?;
                if made.faces().abs_diff(quads as usize) > quads as usize / 10 {
                    notices.push(format!(
                        "template: {} quadrilaterals where {quads} were asked for; grids come in steps",
                        made.faces()
                    ));
                }
                made
            }
            Part::Generated { generator, parameters } => generate_template(generator, parameters, [low, high])
                .map_err(|message| Failure::invalid(format!("template: {message}")))?,
            Part::File {
                name,
                bytes,
                parameters,
            } => {
                let mut template = read(name, bytes, "template", &mut notices)?;
                units.scale(&mut template.points);
                if parameters.get("place").and_then(|place| place.as_str()) == Some("box") {
                    stretch(&mut template, [low, high])?;
                } else {
                    notices.extend(mesh::far_off(&template.points));
                }
                template
            }
        };
        let mut problem = Problem::of_scaled(target, template, units, notices)?;
        problem.near = near;
        if only_points {
            problem.use_points_alone();
        }
        Ok(problem)
    }

    /// The problem of a target and a template in the same units.
    ///
    /// # Errors
    /// `invalid-input` when the target has no area, or the template no faces.
    pub fn from_parts(target: TriangleMesh, mut template: Surface, notices: Vec<String>) -> Result<Problem, Failure> {
        let units = Units::of(&target)?;
        units.scale(&mut template.points);
        Problem::of_scaled(units.scaled(target), template, units, notices)
    }

    fn of_scaled(
        target: TriangleMesh,
        template: Surface,
        units: Units,
        mut notices: Vec<String>,
    ) -> Result<Problem, Failure> {
        let area = target.area();
        let Units { centre, diagonal } = units;
        if target.cells.is_empty() {
            if target.points.len() < 4 {
                return Err(Failure::invalid(format!(
                    "target: {} points without faces are no cloud to fit; give more points, or a file with faces",
                    target.points.len()
                )));
            }
            notices.push(format!(
                "target: a cloud of {} points without normals; anisotropy and compatibility have no effect",
                target.points.len()
            ));
        } else if !(area > 1e-14) {
            return Err(Failure::invalid(format!(
                "target: {} triangles have {area:e} of the squared diagonal as their area; give a surface with area",
                target.cells.len()
            )));
        }
        if template.faces() == 0 {
            return Err(Failure::invalid("template: there are no faces; give a surface"));
        }
        let flat = target.areas().iter().filter(|&&area| !(area > 0.0)).count();
        if flat > 0 {
            notices.push(format!(
                "target: {flat} of {} triangles have no area; they take no part in the fit and count in the distances",
                target.cells.len()
            ));
        }
        let cloud = target.cells.is_empty().then(|| target.points.clone());
        Ok(Problem {
            cloud,
            target,
            template,
            near: false,
            centre,
            diagonal,
            notices,
        })
    }

    /// Leaves the fit the centres of the target's triangles and nothing else; distances are still measured to the
    /// surface.
    fn use_points_alone(&mut self) {
        let centres = self.target.cells.iter().map(|&cell| {
            let [a, b, c] = self.target.corners(cell);
            std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0)
        });
        let points: Vec<[f64; 3]> = centres.collect();
        self.notices.push(format!(
            "target: fitted as a cloud of {} points without normals; anisotropy and compatibility have no effect",
            points.len()
        ));
        self.cloud = Some(points);
    }

    /// Points in the units of the target's file.
    pub fn to_given_units(&self, points: &[[f64; 3]]) -> Vec<[f64; 3]> {
        points
            .iter()
            .map(|point| std::array::from_fn(|axis| self.centre[axis] + self.diagonal * point[axis]))
            .collect()
    }
}

/// The points of a file that holds nothing else.
fn points(name: &str, bytes: &[u8], notices: &mut Vec<String>) -> Result<Option<Vec<[f64; 3]>>, Failure> {
    if let Some(points) = cloud::read(name, bytes).map_err(|message| Failure::invalid(format!("target: {message}")))? {
        return Ok(Some(points));
    }
    let content = format::read(name, bytes).map_err(|error| Failure::invalid(format!("target: {error}")))?;
    let cells = content.cells();
    if content.points.is_empty() || cells.count() > 0 {
        return Ok(None);
    }
    if let Some(index) = content
        .points
        .iter()
        .position(|point| point.iter().any(|x| !x.is_finite()))
    {
        return Err(Failure::invalid(format!(
            "target: {name}: point {index} (counted from 0) has a coordinate that is not finite"
        )));
    }
    notices.extend(content.notices.iter().map(|notice| format!("target: {notice}")));
    Ok(Some(content.points))
}

fn read(name: &str, bytes: &[u8], role: &str, notices: &mut Vec<String>) -> Result<Surface, Failure> {
    let content = format::read(name, bytes).map_err(|error| Failure::invalid(format!("{role}: {error}")))?;
    notices.extend(content.notices.iter().map(|notice| format!("{role}: {notice}")));
    Surface::from_content(&content).map_err(|message| Failure::invalid(format!("{role}: {name}: {message}")))
}

/// Stretches a template onto a box, axis by axis.
fn stretch(template: &mut Surface, [low, high]: [[f64; 3]; 2]) -> Result<(), Failure> {
    let Some([from, to]) = mesh::bounding_box(&template.points) else {
        return Err(Failure::invalid("template: there are no points"));
    };
    for point in &mut template.points {
        *point = std::array::from_fn(|axis| {
            let extent = to[axis] - from[axis];
            let share = if extent > 0.0 {
                (point[axis] - from[axis]) / extent
            } else {
                0.5
            };
            low[axis] + share * (high[axis] - low[axis])
        });
    }
    Ok(())
}
