//! What is reported of a surface: its metrics and a tessellation with fields to colour it by.

use super::continuity::{self, Continuity};
use super::patch::{GAUSS_5, Patch};
use super::problem::{Problem, Truth};
use super::settings::Settings;
use super::surface::{self, Place};
use crate::linalg::vector3::{add, dot, subtract, times};
use crate::mesh::format::{Cells, vtu};
use crate::mesh::quadrilateral::Connectivity;
use crate::mesh::{diagonal, length};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Metrics of the patches by name.
pub type Metrics = BTreeMap<String, f64>;

/// Whether a patch with these normals at its corners has a normal, among 9 by 9, that points against them.
pub fn folds(patch: &Patch, corners: [[f64; 3]; 4]) -> bool {
    let place = |index: usize| index as f64 / (SAMPLES - 1) as f64;
    (0..SAMPLES).any(|i| {
        let u = Place::new(place(i));
        (0..SAMPLES).any(|j| {
            let v = Place::new(place(j));
            let (s, t) = (place(i), place(j));
            let low = add(times(corners[0], 1.0 - s), times(corners[1], s));
            let high = add(times(corners[3], 1.0 - s), times(corners[2], s));
            let expected = add(times(low, 1.0 - t), times(high, t));
            !(dot(surface::first_derivatives(patch, &u, &v).area_vector(), expected) > 0.0)
        })
    })
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

/// Samples along each parameter of a patch.
const SAMPLES: usize = 9;

/// Measures patches over a problem's mesh: continuity, distance, folds, area, curvature.
pub fn measure(problem: &Problem, normals: &[[f64; 3]], patches: &[Patch], metrics: &mut Metrics) -> Continuity {
    let places: [Place; SAMPLES] = std::array::from_fn(|index| Place::new(index as f64 / (SAMPLES - 1) as f64));
    let gauss = GAUSS_5.map(|(x, weight)| (Place::new(x), weight));
    let measured: Vec<Measured> = patches
        .par_iter()
        .zip(&problem.mesh.quads)
        .enumerate()
        .map(|(index, (patch, quad))| {
            let mut found = Measured::default();
            for (u, weight_u) in &gauss {
                for (v, weight_v) in &gauss {
                    let jet = surface::evaluate(patch, u, v);
                    let area = length(jet.area_vector()) * weight_u * weight_v;
                    let [sum, product] = jet.curvatures();
                    found.area += area;
                    found.curvature += area * (sum * sum - 2.0 * product);
                }
            }
            found.folded = folds(patch, quad.map(|vertex| normals[vertex as usize]));
            if let Some(truth) = &problem.truth {
                for u in &places {
                    for v in &places {
                        let distance = truth.distance(index, surface::position(patch, u, v));
                        found.distance_max = found.distance_max.max(distance);
                        found.distance_squares += distance * distance;
                    }
                }
            }
            found
        })
        .collect();
    let continuity = continuity::measure(patches, &problem.connectivity);
    let mut set = |name: &str, value: f64| {
        metrics.insert(name.to_string(), value);
    };
    let sum = |value: fn(&Measured) -> f64| measured.iter().map(value).sum::<f64>();
    set("area", sum(|patch| patch.area));
    set("curvature_energy", sum(|patch| patch.curvature));
    set("folded", sum(|patch| f64::from(u8::from(patch.folded))));
    if problem.truth.is_some() {
        let count = (patches.len() * SAMPLES * SAMPLES) as f64;
        set(
            "distance_max",
            measured.iter().map(|patch| patch.distance_max).fold(0.0, f64::max),
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
        set("crease_angle", angle);
    }
    continuity
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

/// A tessellation of the patches as a VTU file: every patch in `pieces` by `pieces` quads that share points with their
/// neighbours, and on every quad the patch's number, its largest angle to a neighbour, curvatures, isophote stripes.
pub fn tessellate(
    patches: &[Patch],
    connectivity: &Connectivity,
    quads: &[[u32; 4]],
    continuity: &Continuity,
    pieces: usize,
    stripes: f64,
) -> Vec<u8> {
    let inner = pieces - 1;
    let vertices = connectivity.stars.len();
    let first_inner = vertices + connectivity.edges.len() * inner;
    let mut points = vec![[0.0; 3]; first_inner + patches.len() * inner * inner];
    let mut normals = points.clone();
    let mut cells = Vec::with_capacity(patches.len() * pieces * pieces);
    let mut fields: [Vec<f64>; 5] = Default::default();
    let corners: Vec<Place> = (0..=pieces)
        .map(|index| Place::new(index as f64 / pieces as f64))
        .collect();
    let centres: Vec<Place> = (0..pieces)
        .map(|index| Place::new((index as f64 + 0.5) / pieces as f64))
        .collect();
    // Light from the front left, above; isophotes are lines of one angle to it.
    let light = [-0.36, -0.8, 0.48];
    for (index, (patch, quad)) in patches.iter().zip(quads).enumerate() {
        let edges = connectivity.quad_edges[index];
        // The number of the point (i, j) of this patch.
        let name = |i: usize, j: usize| -> usize {
            let on_edge = |side: usize, step: usize| {
                let along = quad[side] < quad[(side + 1) % 4];
                let step = if along { step } else { pieces - step };
                vertices + edges[side] as usize * inner + step - 1
            };
            match (i, j) {
                (0, 0) => quad[0] as usize,
                (i, 0) if i == pieces => quad[1] as usize,
                (0, j) if j == pieces => quad[3] as usize,
                (i, j) if i == pieces && j == pieces => quad[2] as usize,
                (i, 0) => on_edge(0, i),
                (i, j) if i == pieces => on_edge(1, j),
                (i, j) if j == pieces => on_edge(2, pieces - i),
                (0, j) => on_edge(3, pieces - j),
                (i, j) => first_inner + (index * inner + j - 1) * inner + i - 1,
            }
        };
        for j in 0..=pieces {
            for i in 0..=pieces {
                let jet = surface::first_derivatives(patch, &corners[i], &corners[j]);
                let place = name(i, j);
                points[place] = jet.position;
                let area = jet.area_vector();
                normals[place] = add(normals[place], times(area, 1.0 / length(area).max(f64::MIN_POSITIVE)));
            }
        }
        let defect = edges
            .iter()
            .map(|&edge| continuity.of_edge[edge as usize])
            .fold(0.0, f64::max);
        for j in 0..pieces {
            for i in 0..pieces {
                cells.push([(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| name(i, j) as u32));
                let jet = surface::evaluate(patch, &centres[i], &centres[j]);
                let area = jet.area_vector();
                let [sum, product] = jet.curvatures();
                let phase = stripes * dot(area, light) / length(area);
                let values = [
                    index as f64,
                    defect,
                    f64::from(u8::from(phase.rem_euclid(1.0) < 0.5)),
                    sum / 2.0,
                    product,
                ];
                for (field, value) in fields.iter_mut().zip(values) {
                    field.push(if value.is_finite() { value } else { 0.0 });
                }
            }
        }
    }
    for normal in &mut normals {
        *normal = times(*normal, 1.0 / length(*normal).max(f64::MIN_POSITIVE));
    }
    let [number, defect, isophotes, mean, gauss] = &fields;
    vtu::write(
        &points,
        Cells {
            quads: &cells,
            ..Cells::default()
        },
        &[("normals", 3, normals.as_flattened())],
        &[
            ("isophotes", 1, isophotes),
            ("angle_to_neighbour", 1, defect),
            ("mean_curvature", 1, mean),
            ("gauss_curvature", 1, gauss),
            ("patch", 1, number),
        ],
    )
}

/// The control nets of all patches as a VTU file: 25 points a patch, `5 i + j` for `B_i(u) B_j(v)` of degree 4, and 16 quads.
pub fn control_nets(patches: &[Patch]) -> Vec<u8> {
    let points: Vec<[f64; 3]> = patches.iter().flat_map(surface::control_points).collect();
    let mut cells = Vec::with_capacity(16 * patches.len());
    let mut numbers = Vec::with_capacity(16 * patches.len());
    for index in 0..patches.len() {
        for i in 0..4 {
            for j in 0..4 {
                let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                cells.push(corners.map(|(i, j)| (25 * index + 5 * i + j) as u32));
                numbers.push(index as f64);
            }
        }
    }
    vtu::write(
        &points,
        Cells {
            quads: &cells,
            ..Cells::default()
        },
        &[],
        &[("patch", 1, &numbers)],
    )
}

/// The mean length of the chords of the edges.
pub fn mean_edge(problem: &Problem) -> f64 {
    let (mesh, connectivity) = problem.whole();
    let edges = &connectivity.edges;
    let chord = |&[a, b]: &[u32; 2]| length(subtract(mesh.points[b as usize], mesh.points[a as usize]));
    edges.iter().map(chord).sum::<f64>() / edges.len().max(1) as f64
}
