//! Curvilinear hexahedra between a surface and a sphere, by transfinite interpolation.
//!
//! The sphere carries a copy of the surface's mesh, every vertex moved along its ray from the centre, with G1 patches
//! of its own; hexahedra span between patches of the same number. Each is the transfinite interpolation of its six
//! faces (Gordon and Hall 1973); as the faces across are ruled, layers share their faces exactly. The surface must be
//! star-shaped about the centre for the hexahedra to be valid, and the certificate tells. Source: Xue, Demkowicz,
//! Bajaj 2004, section 3.

use super::edge_normals;
use super::enclosure;
use super::frame::Frame;
use super::network::Network;
use super::numbering::Numbering;
use super::outcome::Metrics;
use super::patch::{self, Operator, Patch, Reference, Solve};
use super::problem::Problem;
use super::surface;
use crate::fem::bernstein_hexahedron::{self as bernstein, ControlPoints, Verdict};
use crate::linalg::vector3::{add, dot, subtract, times};
use crate::mesh::format::{Cells, vtu};
use crate::mesh::length;
use crate::mesh::quadrilateral::Connectivity;
use crate::optimize::Observer;
use rayon::prelude::*;

/// Where the hexahedra lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shell {
    /// Between the surface and a sphere inside it: `ratio` times the distance from the centre to the nearest vertex.
    Inward { ratio: f64 },
    /// Between the surface and a sphere around it: `ratio` times the distance to the farthest vertex.
    Outward { ratio: f64 },
}

/// Hexahedra and what is known of their Jacobians.
pub struct Hexahedra {
    /// Layer by layer from inside, in the order of the patches.
    pub cells: Vec<ControlPoints>,
    /// Least determinant over the product of the columns' lengths, at 6 by 6 by 6 points of each.
    pub scaled: Vec<f64>,
    pub positive: usize,
    pub not_positive: usize,
    pub undecided: usize,
    /// Least certified bound of a determinant, over the mean determinant of its hexahedron.
    pub bound: f64,
    pub volume: f64,
}

impl Hexahedra {
    /// Adds what is known to the metrics.
    pub fn tell(&self, metrics: &mut Metrics) {
        let least = self.scaled.iter().copied().fold(f64::INFINITY, f64::min);
        for (name, value) in [
            ("hexahedra_count", self.cells.len() as f64),
            ("jacobian_min", least),
            ("jacobian_certified", self.positive as f64),
            ("jacobian_not_positive", self.not_positive as f64),
            ("jacobian_undecided", self.undecided as f64),
            ("jacobian_bound", self.bound),
            ("hexahedra_volume", self.volume),
        ] {
            metrics.insert(name.to_string(), value);
        }
    }

    /// Carries the hexahedra to the coordinates of the file.
    pub fn leave(&mut self, frame: &Frame) {
        frame.leave(self.cells.as_flattened_mut());
    }

    /// The hexahedra as a VTU file of Bezier hexahedra of order 4.
    pub fn bezier(&self) -> Vec<u8> {
        let numbers: Vec<f64> = (0..self.cells.len()).map(|index| index as f64).collect();
        vtu::write_bezier_hexahedra(
            self.cells.as_flattened(),
            4,
            &[("hexahedron", 1, &numbers), ("scaled_jacobian", 1, &self.scaled)],
        )
    }
}

/// Parts into which the certificate may cut a hexahedron.
const PARTS: usize = 512;
/// Hexahedra judged between two questions whether to stop.
const CHUNK: usize = 1024;

/// Builds the hexahedra of a surface.
///
/// # Errors
/// When the surface is open, or its mesh cannot be carried to the sphere.
pub fn build(
    problem: &Problem,
    patches: &[Patch],
    shell: Shell,
    layers: usize,
    observer: &mut dyn Observer,
) -> Result<Hexahedra, String> {
    let open = problem.whole().1.boundary_edges();
    if open > 0 {
        return Err(format!(
            "hexahedra need a closed surface; this one has {open} boundary edges"
        ));
    }
    let sphere = sphere(problem, shell, observer)?;
    let cells: Vec<ControlPoints> = (0..layers)
        .flat_map(|layer| (0..patches.len()).map(move |patch| (layer, patch)))
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(layer, index)| {
            let (surface, sphere) = (
                surface::control_points(&patches[index]),
                surface::control_points(&sphere[index]),
            );
            let (low, high) = match shell {
                Shell::Inward { .. } => (sphere, surface),
                Shell::Outward { .. } => (surface, sphere),
            };
            let at = |level: usize| -> Patch {
                let share = level as f64 / layers as f64;
                std::array::from_fn(|point| add(times(low[point], 1.0 - share), times(high[point], share)))
            };
            bernstein::transfinite(&faces(&at(layer), &at(layer + 1)))
        })
        .collect();
    let judge = |points: &ControlPoints| {
        let mut least = f64::INFINITY;
        let place = |index: usize| index as f64 / 5.0;
        for i in 0..6 {
            for j in 0..6 {
                for k in 0..6 {
                    let (value, size) = bernstein::jacobian(points, [place(i), place(j), place(k)]);
                    least = least.min(value / size.max(f64::MIN_POSITIVE));
                }
            }
        }
        // The mean of Bernstein coefficients is the integral.
        let values = bernstein::determinant(points);
        let volume = values.iter().sum::<f64>() / values.len() as f64;
        (bernstein::certify(points, PARTS), least, volume)
    };
    let mut judged: Vec<(Verdict, f64, f64)> = Vec::with_capacity(cells.len());
    for chunk in cells.chunks(CHUNK) {
        if observer.stop().is_some() {
            return Err("stopped from outside before all hexahedra were judged".to_string());
        }
        judged.par_extend(chunk.par_iter().map(judge));
    }
    let mut found = Hexahedra {
        scaled: judged.iter().map(|(_, least, _)| *least).collect(),
        cells,
        positive: 0,
        not_positive: 0,
        undecided: 0,
        bound: f64::INFINITY,
        volume: judged.iter().map(|(_, _, volume)| volume).sum(),
    };
    for (verdict, _, volume) in &judged {
        match verdict {
            Verdict::Positive { bound, .. } => {
                found.positive += 1;
                found.bound = found.bound.min(bound / volume);
            }
            Verdict::NotPositive { .. } => found.not_positive += 1,
            Verdict::Undecided { .. } => found.undecided += 1,
        }
    }
    Ok(found)
}

/// The patches of the sphere.
fn sphere(problem: &Problem, shell: Shell, observer: &mut dyn Observer) -> Result<Vec<Patch>, String> {
    // Creases are no matter to the sphere.
    let (mesh, connectivity) = problem.whole();
    let points = &mesh.points;
    let mut low = points[0];
    let mut high = points[0];
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let centre = times(add(low, high), 0.5);
    let distances = points.iter().map(|&point| length(subtract(point, centre)));
    let radius = match shell {
        Shell::Inward { ratio } => ratio * distances.fold(f64::INFINITY, f64::min),
        Shell::Outward { ratio } => ratio * distances.fold(0.0, f64::max),
    };
    if !(radius > 0.0) {
        return Err("a vertex lies at the centre of the surface's box; no sphere fits inside".to_string());
    }
    let mut mesh = mesh.clone();
    let mut normals = Vec::with_capacity(points.len());
    for point in &mut mesh.points {
        let away = subtract(*point, centre);
        let normal = times(away, 1.0 / length(away));
        *point = add(centre, times(normal, radius));
        normals.push(normal);
    }
    let outside = mesh.quads.iter().all(|&quad| {
        let corners = mesh.corners(quad);
        let face = crate::mesh::cross(subtract(corners[2], corners[0]), subtract(corners[3], corners[1]));
        dot(face, subtract(corners[0], centre)) > 0.0
    });
    if !outside {
        return Err(
            "seen from the centre of its box the surface turns away or folds over; hexahedra by rays need a star-shaped surface"
                .to_string(),
        );
    }
    let (mut network, _) = Network::natural(&mesh, connectivity.clone(), &normals)?;
    enclosure::enclose(&mut network, observer)?;
    let slopes = edge_normals::exact(&network, true)?;
    let fit = |quad| {
        patch::fit(
            &network,
            &slopes,
            quad,
            Solve::Exact,
            Reference::Adini,
            Operator::Laplacian,
        )
        .patch
    };
    Ok((0..mesh.quads.len()).into_par_iter().map(fit).collect())
}

/// The six faces between two patches of control points; those across are ruled.
fn faces(low: &Patch, high: &Patch) -> [Patch; 6] {
    let ruled = |place: fn(usize) -> usize| -> Patch {
        std::array::from_fn(|index| {
            let (along, up) = (index / 5, (index % 5) as f64 / 4.0);
            add(times(low[place(along)], 1.0 - up), times(high[place(along)], up))
        })
    };
    [
        ruled(|j| j),
        ruled(|j| 20 + j),
        ruled(|i| 5 * i),
        ruled(|i| 5 * i + 4),
        *low,
        *high,
    ]
}

/// A tessellation as a VTU file: every hexahedron in `pieces` along the surface and one across. `quads` and
/// `connectivity` are those of the surface before it was cut along creases: hexahedra share points there too, by
/// number.
///
/// # Errors
/// When there would be too many points.
pub fn tessellate(
    found: &Hexahedra,
    quads: &[[u32; 4]],
    connectivity: &Connectivity,
    pieces: usize,
) -> Result<Vec<u8>, String> {
    let numbering = Numbering::new(quads, connectivity, pieces)?;
    let level = numbering.len();
    let layers = found.cells.len() / quads.len().max(1);
    if level * (layers + 1) > u32::MAX as usize {
        return Err(format!(
            "{} hexahedra in {pieces} by {pieces} pieces have too many points; use fewer pieces (tessellation) or layers",
            found.cells.len()
        ));
    }
    let mut points = vec![[0.0; 3]; level * (layers + 1)];
    let mut cells = Vec::with_capacity(found.cells.len() * pieces * pieces);
    let mut fields: [Vec<f64>; 3] = Default::default();
    for (index, (cell, &scaled)) in found.cells.iter().zip(&found.scaled).enumerate() {
        let (layer, patch) = (index / quads.len(), index % quads.len());
        let name = |i: usize, j: usize, k: usize| ((layer + k) * level + numbering.point(patch, i, j)) as u32;
        for k in 0..2 {
            for j in 0..=pieces {
                for i in 0..=pieces {
                    let at = [i as f64 / pieces as f64, j as f64 / pieces as f64, k as f64];
                    points[name(i, j, k) as usize] = bernstein::position(cell, at);
                }
            }
        }
        for j in 0..pieces {
            for i in 0..pieces {
                let bottom = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                let [a, b, c, d] = bottom.map(|(i, j)| name(i, j, 0));
                let [e, f, g, h] = bottom.map(|(i, j)| name(i, j, 1));
                cells.push([a, b, c, d, e, f, g, h]);
                for (field, value) in
                    fields
                        .iter_mut()
                        .zip([scaled, f64::from(u8::from(!(scaled > 0.0))), index as f64])
                {
                    field.push(value);
                }
            }
        }
    }
    Ok(vtu::write(
        &points,
        Cells {
            hexahedra: &cells,
            ..Cells::default()
        },
        &[],
        &[
            ("scaled_jacobian", 1, &fields[0]),
            ("inverted", 1, &fields[1]),
            ("hexahedron", 1, &fields[2]),
        ],
    ))
}
