//! What is reported of a surface: its metrics and a tessellation with fields to colour it by.

use super::continuity::{self, Continuity, larger};
use super::evaluation::{Derivatives, Evaluated, Places, evaluate};
use super::frame::Frame;
use super::numbering::Numbering;
use super::patch::{GAUSS_5, Patch};
use super::problem::{Problem, Truth};
use super::settings::Settings;
use crate::linalg::processor::Processor;
use crate::linalg::vector3::{add, cross, dot, subtract, times};
use crate::mesh::format::{self, Cells, Content, Field, Format, vtu};
use crate::mesh::quadrilateral::Connectivity;
use crate::mesh::{diagonal, length};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Metrics of the patches by name.
pub type Metrics = BTreeMap<String, f64>;

/// Points along each parameter at which a patch is looked at.
const SAMPLES: usize = 9;

/// Looks for folds at 9 by 9 points of patches.
pub struct Folding {
    places: Places,
    /// Weights of the corners' normals at every point.
    weights: Vec<[f64; 4]>,
    processor: Processor,
}

impl Default for Folding {
    fn default() -> Self {
        let line: [f64; SAMPLES] = std::array::from_fn(|index| index as f64 / (SAMPLES - 1) as f64);
        let weights = line
            .iter()
            .flat_map(|&t| line.map(|s| [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]));
        Self {
            places: Places::grid(&line, &line),
            weights: weights.collect(),
            processor: Processor::detect(),
        }
    }
}

impl Folding {
    /// Whether a patch with these normals at its corners has a normal that points against them. The patch's positions and
    /// first derivatives are left in `evaluated`.
    pub fn folds(&self, patch: &Patch, corners: [[f64; 3]; 4], evaluated: &mut Evaluated) -> bool {
        evaluate(self.processor, patch, &self.places, Derivatives::First, evaluated);
        self.weights.iter().enumerate().any(|(point, weights)| {
            let [_, u, v] = evaluated.first(point);
            let mut expected = [0.0; 3];
            for (&weight, corner) in weights.iter().zip(corners) {
                expected = add(expected, times(corner, weight));
            }
            !(dot(cross(u, v), expected) > 0.0)
        })
    }
}

/// What one patch adds to the metrics.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    area: f64,
    curvature: f64,
    folded: bool,
    distance_max: f64,
    distance_squares: f64,
}

/// What [`measure`] found beside the metrics.
pub struct Shape {
    pub continuity: Continuity,
    /// Number of patches that fold, and the first of them.
    pub folded: usize,
    pub first_folded: Option<usize>,
}

/// Measures patches over a problem's mesh: continuity, distance, folds, area, curvature.
pub fn measure(problem: &Problem, normals: &[[f64; 3]], patches: &[Patch], metrics: &mut Metrics) -> Shape {
    let folding = Folding::default();
    let line = GAUSS_5.map(|(x, _)| x);
    let gauss = Places::grid(&line, &line);
    let weights: Vec<f64> = GAUSS_5.iter().flat_map(|(_, v)| GAUSS_5.map(|(_, u)| u * v)).collect();
    let measured: Vec<Measured> = patches
        .par_iter()
        .zip(&problem.mesh.quads)
        .enumerate()
        .map_init(Evaluated::default, |evaluated, (index, (patch, quad))| {
            let mut found = Measured::default();
            evaluate(folding.processor, patch, &gauss, Derivatives::Second, evaluated);
            for (jet, weight) in evaluated.jets().zip(&weights) {
                let area = length(jet.area_vector()) * weight;
                let [sum, product] = jet.curvatures();
                found.area += area;
                found.curvature += area * (sum * sum - 2.0 * product);
            }
            let corners = quad.map(|vertex| normals[vertex as usize]);
            found.folded = folding.folds(patch, corners, evaluated);
            if let Some(truth) = &problem.truth {
                for point in 0..evaluated.len() {
                    let [position, _, _] = evaluated.first(point);
                    let distance = truth.distance(index, position);
                    found.distance_max = larger(found.distance_max, distance);
                    found.distance_squares += distance * distance;
                }
            }
            found
        })
        .collect();
    let continuity = continuity::measure(patches, &problem.connectivity);
    let folded = measured.iter().filter(|patch| patch.folded).count();
    let mut set = |name: &str, value: f64| {
        metrics.insert(name.to_string(), value);
    };
    let sum = |value: fn(&Measured) -> f64| measured.iter().map(value).sum::<f64>();
    set("area", sum(|patch| patch.area));
    set("curvature_energy", sum(|patch| patch.curvature));
    set("folded", folded as f64);
    if problem.truth.is_some() {
        let count = (patches.len() * SAMPLES * SAMPLES) as f64;
        set(
            "distance_max",
            measured.iter().map(|patch| patch.distance_max).fold(0.0, larger),
        );
        set("distance_rms", (sum(|patch| patch.distance_squares) / count).sqrt());
    }
    set("angle_max", continuity.largest);
    set("angle_rms", continuity.mean_square);
    let size = diagonal(&problem.mesh.points);
    set("gap", continuity.gap / size);
    if let Some(creases) = &problem.creases {
        let [gap, angle] = continuity::measure_creases(patches, &problem.connectivity, &creases.pairs);
        set("crease_gap", gap / size);
        set("crease_turn", angle);
    }
    Shape {
        continuity,
        folded,
        first_folded: measured.iter().position(|patch| patch.folded),
    }
}

impl Truth {
    /// The distance of a point near the surface; of a point over this quad, where every quad lies on a piece.
    pub fn distance(&self, quad: usize, point: [f64; 3]) -> f64 {
        match self {
            Truth::Pieces(creased) => creased.pieces[creased.piece_of[quad] as usize].distance(point),
            Truth::Analytic(exact) => exact.distance(point),
            Truth::Sampled(surface) => surface.distance(point),
        }
    }
}

/// Quads that the page draws without trouble.
const DRAWN: usize = 120_000;

/// Pieces along a side: what the settings say, or as many as can be drawn, at most twelve.
pub fn pieces(settings: &Settings, patches: usize) -> usize {
    let affordable = ((DRAWN / patches.max(1)) as f64).sqrt() as usize;
    settings
        .tessellation
        .map_or(affordable.clamp(1, 12), |pieces| pieces as usize)
}

/// A tessellation of the patches.
pub struct Tessellation {
    pub points: Vec<[f64; 3]>,
    /// One a point: the mean of those of the patches that share it.
    pub normals: Vec<[f64; 3]>,
    pub quads: Vec<[u32; 4]>,
    /// On every quad, see [`FIELDS`].
    pub fields: [Vec<f64>; FIELDS.len()],
}

/// Names of a tessellation's fields.
pub const FIELDS: [&str; 6] = [
    "isophotes",
    "reflection_lines",
    "angle_to_neighbour",
    "mean_curvature",
    "gauss_curvature",
    "patch",
];

/// Light from the front left, above, and the viewer there: isophotes are lines of one angle to it.
const LIGHT: [f64; 3] = [-0.36, -0.8, 0.48];
/// Perpendicular to it: the direction of the tubes of light.
const ALONG: [f64; 3] = [0.911_921_505_175_171_6, -0.410_364_677_328_827_2, 0.0];

/// A stripe of width one half around every whole number, with soft edges.
fn stripe(phase: f64) -> f64 {
    (0.5 + (std::f64::consts::TAU * phase).cos()).clamp(0.0, 1.0)
}

/// Isophote stripe and reflection-line stripe for a unit normal, with so many stripes between a normal towards the
/// light and one away from it.
///
/// Reflection lines are what a far viewer sees of long parallel tubes of light at equal angles on a cylinder around the
/// surface (Klass 1980, Correction of local surface irregularities using reflection lines).
fn stripes_of(normal: [f64; 3], stripes: f64) -> [f64; 2] {
    let cosine = dot(normal, LIGHT);
    let reflected = subtract(times(normal, 2.0 * cosine), LIGHT);
    let angle = dot(reflected, cross(LIGHT, ALONG)).atan2(dot(reflected, LIGHT));
    [
        stripe(0.5 * stripes * cosine),
        stripe(0.5 * stripes * angle / std::f64::consts::PI),
    ]
}

/// Tessellates every patch in `pieces` by `pieces` quads that share points with their neighbours.
///
/// # Errors
/// When there would be too many points.
pub fn tessellate(
    patches: &[Patch],
    connectivity: &Connectivity,
    quads: &[[u32; 4]],
    angles: &[f64],
    pieces: usize,
    stripes: f64,
) -> Result<Tessellation, String> {
    let numbering = Numbering::new(quads, connectivity, pieces)?;
    let mut points = vec![[0.0; 3]; numbering.len()];
    let mut normals = points.clone();
    let mut cells = Vec::with_capacity(patches.len() * pieces * pieces);
    let mut fields: [Vec<f64>; FIELDS.len()] = Default::default();
    let line = |count: usize, shift: f64| -> Vec<f64> {
        (0..count).map(|index| (index as f64 + shift) / pieces as f64).collect()
    };
    let (corners, centres) = (line(pieces + 1, 0.0), line(pieces, 0.5));
    let (corners, centres) = (Places::grid(&corners, &corners), Places::grid(&centres, &centres));
    let processor = Processor::detect();
    let mut evaluated = Evaluated::default();
    for (index, patch) in patches.iter().enumerate() {
        let name = |i: usize, j: usize| numbering.point(index, i, j);
        evaluate(processor, patch, &corners, Derivatives::First, &mut evaluated);
        for j in 0..=pieces {
            for i in 0..=pieces {
                let [position, u, v] = evaluated.first(i + (pieces + 1) * j);
                let place = name(i, j);
                points[place] = position;
                let area = cross(u, v);
                normals[place] = add(normals[place], times(area, 1.0 / length(area).max(f64::MIN_POSITIVE)));
            }
        }
        evaluate(processor, patch, &centres, Derivatives::Second, &mut evaluated);
        for j in 0..pieces {
            for i in 0..pieces {
                cells.push([(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| name(i, j) as u32));
                let jet = evaluated.jet(i + pieces * j);
                let area = jet.area_vector();
                let [sum, product] = jet.curvatures();
                let [isophote, reflection] = stripes_of(times(area, 1.0 / length(area)), stripes);
                let values = [isophote, reflection, angles[index], sum / 2.0, product, index as f64];
                for (field, value) in fields.iter_mut().zip(values) {
                    field.push(if value.is_finite() { value } else { 0.0 });
                }
            }
        }
    }
    for normal in &mut normals {
        *normal = times(*normal, 1.0 / length(*normal).max(f64::MIN_POSITIVE));
    }
    Ok(Tessellation {
        points,
        normals,
        quads: cells,
        fields,
    })
}

impl Tessellation {
    /// Carries everything to the coordinates of the file.
    pub fn leave(&mut self, frame: &Frame) {
        frame.leave(&mut self.points);
        for (name, values) in FIELDS.iter().zip(&mut self.fields) {
            match *name {
                "mean_curvature" => frame.leave_curvatures(values, 1),
                "gauss_curvature" => frame.leave_curvatures(values, 2),
                _ => {}
            }
        }
    }

    /// As a VTU file with all fields.
    pub fn vtu(&self) -> Vec<u8> {
        let fields: Vec<vtu::FieldView<'_>> = FIELDS
            .into_iter()
            .zip(&self.fields)
            .map(|(name, values)| (name, 1, &values[..]))
            .collect();
        vtu::write(
            &self.points,
            Cells {
                quads: &self.quads,
                ..Cells::default()
            },
            &[("normals", 3, self.normals.as_flattened())],
            &fields,
        )
    }

    /// As an OBJ file with normals.
    ///
    /// # Errors
    /// When the writer refuses.
    pub fn obj(&self) -> Result<Vec<u8>, String> {
        let content = Content {
            points: self.points.clone(),
            quads: self.quads.clone(),
            point_data: vec![Field {
                name: "normals".to_string(),
                components: 3,
                values: self.normals.as_flattened().to_vec(),
            }],
            ..Content::default()
        };
        Ok(format::write(Format::Obj, &content)?.bytes)
    }
}

/// For every patch the largest angle to a neighbour over its smooth edges, in degrees.
pub fn angles_to_neighbours(connectivity: &Connectivity, continuity: &Continuity) -> Vec<f64> {
    let largest = |edges: &[u32; 4]| {
        let angles = edges.iter().map(|&edge| continuity.of_edge[edge as usize]);
        angles.fold(0.0, larger)
    };
    connectivity.quad_edges.iter().map(largest).collect()
}

/// The mean length of the chords of the edges.
pub fn mean_edge(problem: &Problem) -> f64 {
    let (mesh, connectivity) = problem.whole();
    let edges = &connectivity.edges;
    let chord = |&[a, b]: &[u32; 2]| length(subtract(mesh.points[b as usize], mesh.points[a as usize]));
    edges.iter().map(chord).sum::<f64>() / edges.len().max(1) as f64
}
