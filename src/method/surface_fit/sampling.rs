//! The points of the target that the fit's distance is measured to, with the target's normals there.

use super::settings::{Sampling, Settings};
use crate::geometry::closest_point::{ClosestPoint, Nearest};
use crate::geometry::point_tree::PointTree;
use crate::geometry::squared_distance::{Options, SquaredDistance, Wanted};
use crate::mesh::{TriangleMesh, area_vector, length, subtract};
use crate::method::Failure;
use crate::optimize::Observer;

/// Facets serve as samples when none has an edge beyond this share of the diagonal,
const EVEN: f64 = 0.05;
/// and there are at least as many as vertices, and at most this many times that: more cost time and gain nothing.
const PLENTY: usize = 16;

/// See the module.
#[derive(Clone, Debug)]
pub struct Samples {
    pub points: Vec<[f64; 3]>,
    /// Unit vectors.
    pub normals: Vec<[f64; 3]>,
    pub sampling: Sampling,
}

/// Samples the target, whose diagonal is 1, for a fitted mesh with `vertices`.
///
/// # Errors
/// A target with an index out of range, which reading would have found.
pub fn sample(
    target: &TriangleMesh,
    vertices: usize,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<Samples, Failure> {
    let even = || {
        let longest = target.cells.iter().map(|&cell| {
            let [a, b, c] = target.corners(cell);
            length(subtract(b, a))
                .max(length(subtract(c, b)))
                .max(length(subtract(a, c)))
        });
        (vertices..=PLENTY * vertices).contains(&target.cells.len()) && longest.fold(0.0, f64::max) <= EVEN
    };
    let facets = match settings.sampling {
        Sampling::Facets => true,
        Sampling::Tessellation => false,
        Sampling::Auto => even(),
    };
    if facets {
        let mut samples = Samples {
            points: Vec::with_capacity(target.cells.len()),
            normals: Vec::with_capacity(target.cells.len()),
            sampling: Sampling::Facets,
        };
        for &cell in &target.cells {
            let corners = target.corners(cell);
            if let Some(normal) = unit(area_vector(corners)) {
                let [a, b, c] = corners;
                samples
                    .points
                    .push(std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0));
                samples.normals.push(normal);
            }
        }
        return Ok(samples);
    }
    let count = if settings.samples > 0 {
        settings.samples
    } else {
        vertices
    };
    let mut points = spread(target, count.max(4), settings.seed);
    let mut term = SquaredDistance::new(&target.points, &target.cells).map_err(|error| Failure {
        kind: "invalid-input".to_string(),
        reason: format!("target: {error}"),
    })?;
    let (mut areas, mut moments) = (vec![0.0; points.len()], vec![[0.0; 3]; points.len()]);
    let mut tree = PointTree::new(&points);
    for _ in 0..settings.sampling_iterations {
        if observer.stop().is_some() {
            break;
        }
        tree.set(&points);
        let wanted = Wanted {
            areas: Some(&mut areas),
            moments: Some(&mut moments),
            ..Wanted::default()
        };
        term.evaluate(&target.points, &tree, &Options::default(), wanted);
        // Every site to the centroid of its cell (Lloyd 1982); sites without a cell stay.
        for ((point, &area), moment) in points.iter_mut().zip(&areas).zip(&moments) {
            if area > 0.0 {
                *point = moment.map(|x| x / area);
            }
        }
    }
    // Centroids of curved cells lie beside the surface.
    let solid = TriangleMesh {
        points: target.points.clone(),
        cells: target
            .cells
            .iter()
            .copied()
            .filter(|&cell| unit(area_vector(target.corners(cell))).is_some())
            .collect(),
    };
    let surface = ClosestPoint::new(&solid);
    let mut found = vec![
        Nearest {
            squared_distance: f64::INFINITY,
            triangle: 0,
        };
        points.len()
    ];
    surface.nearest_each(&points, None, &mut found);
    let mut normals = Vec::with_capacity(points.len());
    for (point, nearest) in points.iter_mut().zip(&found) {
        *point = surface.foot(nearest.triangle, *point);
        let corners = solid.corners(solid.cells[nearest.triangle as usize]);
        normals.push(unit(area_vector(corners)).unwrap_or([0.0; 3]));
    }
    Ok(Samples {
        points,
        normals,
        sampling: Sampling::Tessellation,
    })
}

/// The direction of a vector; `None` where it has none.
fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let norm = length(vector);
    (norm > 0.0 && norm.is_finite()).then(|| vector.map(|x| x / norm))
}

/// Points spread over a surface in proportion to area: one in each of equal shares, within the triangle by the additive
/// recurrence of the plastic number (Roberts 2018).
fn spread(target: &TriangleMesh, count: usize, seed: u64) -> Vec<[f64; 3]> {
    const FIRST: f64 = 0.754_877_666_246_692_8;
    const SECOND: f64 = 0.569_840_290_998_053_3;
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let areas = target.areas();
    let total: f64 = areas.iter().sum();
    let shift = (seed % 1_000_003) as f64 * GOLDEN;
    let mut points = Vec::with_capacity(count);
    let mut below = 0.0;
    for (&cell, area) in target.cells.iter().zip(areas) {
        let [a, b, c] = target.corners(cell);
        let above = below + area;
        while points.len() < count && (points.len() as f64 + 0.5) * total < above * count as f64 {
            let index = points.len() as f64;
            let (mut v, mut w) = ((shift + index * FIRST).fract(), (shift + index * SECOND).fract());
            if v + w > 1.0 {
                (v, w) = (1.0 - v, 1.0 - w);
            }
            points.push(std::array::from_fn(|axis| {
                a[axis] + v * (b[axis] - a[axis]) + w * (c[axis] - a[axis])
            }));
        }
        below = above;
    }
    points
}
