//! What is reported of a fit: its metrics, and the volume cut into linear cells with fields to colour it by.

use super::target::Target;
use crate::fem::batches::{Batches, unit_reference};
use crate::fem::boundary::Boundary;
use crate::fem::certificate::{Certifier, Verdict};
use crate::fem::quadrature::{CellQuadrature, Line, Rule, Scattered};
use crate::fem::space::Space;
use crate::geometry::closest_point::ClosestPoint;
use crate::linalg::processor::Processor;
use crate::linalg::vector3::{Columns, apply, cofactor, dot};
use crate::mesh::format::{Cells, vtu};
use crate::mesh::mixed::{MixedMesh, Shape, Topology};
use crate::mesh::{self, TriangleMesh};
use crate::method::Failure;
use crate::metric::distance;
use crate::optimize::Observer;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Points a direction at which elements are judged: a thousand an element.
const SAMPLES: usize = 10;
/// Intervals along an edge when distances are measured.
const FINE: usize = 12;
/// Cells of the file at most, where elements may be cut coarser.
const MOST_CELLS: usize = 60_000;

fn invalid(reason: String) -> Failure {
    Failure {
        kind: "invalid-input".to_string(),
        reason,
    }
}

/// Figures of every element.
#[derive(Clone, Debug, Default)]
pub struct Quality {
    pub scaled_jacobian_mean: Vec<f64>,
    pub scaled_jacobian_min: Vec<f64>,
    pub least_determinant: Vec<f64>,
    pub largest_determinant: Vec<f64>,
    /// Standard deviation of the logarithm of positive determinants over all points.
    pub spread: f64,
}

/// A thousand points that are random along each direction, with the ends among them.
fn random_points(shape: Shape) -> CellQuadrature {
    // Van der Corput numbers in coprime bases: as good as random, and the same on every machine.
    let radical = |mut index: usize, base: usize| {
        let (mut value, mut share) = (0.0, 1.0);
        while index > 0 {
            share /= base as f64;
            value += share * (index % base) as f64;
            index /= base;
        }
        value
    };
    let mut line: Vec<f64> = (1..SAMPLES - 1).map(|k| radical(k, 2)).collect();
    line.push(0.0);
    line.push(1.0);
    let even = |count: usize| vec![1.0 / count as f64; count];
    let fold = |mut u: f64, mut v: f64| {
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        [u, v]
    };
    match shape {
        Shape::Hexahedron => CellQuadrature::Hexahedron(Line {
            weights: even(line.len()),
            points: line,
        }),
        Shape::Prism => {
            let mut points = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
            points.extend((1..98).map(|k| fold(radical(k, 2), radical(k, 3))));
            CellQuadrature::Prism(
                Scattered {
                    weights: even(points.len()),
                    points,
                },
                Line {
                    weights: even(line.len()),
                    points: line,
                },
            )
        }
        Shape::Tetrahedron => {
            let mut points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let mut index = 1;
            while points.len() < SAMPLES.pow(3) {
                let point = [radical(index, 2), radical(index, 3), radical(index, 5)];
                index += 1;
                if point.iter().sum::<f64>() <= 1.0 {
                    points.push(point);
                }
            }
            CellQuadrature::Tetrahedron(Scattered {
                weights: even(points.len()),
                points,
            })
        }
    }
}

/// For each corner of the ideal element its three unit edges; equal ones once.
fn corner_frames(shape: Shape) -> Vec<Columns<f64>> {
    let reference = unit_reference(shape);
    let canonical = shape.canonical();
    let mut frames: Vec<Columns<f64>> = Vec::new();
    for (corner, ends) in shape.corner_frames().iter().enumerate() {
        let frame = ends.map(|end| {
            let edge = mesh::subtract(canonical[end], canonical[corner]);
            apply(&reference, edge)
        });
        // Frames that differ by signs alone give the same figure.
        let same =
            |other: &Columns<f64>| (0..3).all(|i| (0..3).any(|j| (dot(frame[i], other[j]).abs() - 1.0).abs() < 1e-12));
        if !frames.iter().any(same) {
            frames.push(frame);
        }
    }
    frames
}

/// Judges every element at many points.
pub fn quality(space: &Space, references: &[Columns<f64>], x: &[f64]) -> Result<Quality, Failure> {
    let batches = Batches::new(space, references, &|kind| random_points(kind.shape)).map_err(invalid)?;
    let frames = Shape::ALL.map(corner_frames);
    let processor = Processor::detect();
    let cells = space.cells.len();
    let parts: Vec<BTreeMap<usize, [f64; 7]>> = batches
        .list()
        .into_par_iter()
        .map(|place| {
            let mut sums: BTreeMap<usize, [f64; 7]> = BTreeMap::new();
            batches.visit(processor, place, x, |cell, _, jacobian| {
                let frames = &frames[space.cells[cell].kind.shape as usize];
                let determinant = dot(jacobian[0], cofactor(&jacobian)[0]);
                let mut least = f64::INFINITY;
                for frame in frames {
                    let image = frame.map(|edge| apply(&jacobian, edge));
                    let product: f64 = image.iter().map(|edge| mesh::length(*edge)).product();
                    // The images' determinant over that of the frame is the map's own.
                    least = least.min(determinant / product.max(f64::MIN_POSITIVE));
                }
                let entry =
                    sums.entry(cell)
                        .or_insert([0.0, 0.0, f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0]);
                entry[0] += 1.0;
                entry[1] += least;
                entry[2] = entry[2].min(least);
                entry[3] = entry[3].min(determinant);
                entry[4] = entry[4].max(determinant);
                if determinant > 0.0 {
                    let logarithm = determinant.ln();
                    entry[5] += logarithm;
                    entry[6] += logarithm * logarithm;
                }
            });
            sums
        })
        .collect();
    let mut result = Quality {
        scaled_jacobian_mean: vec![f64::NAN; cells],
        scaled_jacobian_min: vec![f64::NAN; cells],
        least_determinant: vec![f64::NAN; cells],
        largest_determinant: vec![f64::NAN; cells],
        spread: 0.0,
    };
    let mut sums = [0.0; 3];
    for (cell, entry) in parts.into_iter().flatten() {
        result.scaled_jacobian_mean[cell] = entry[1] / entry[0];
        result.scaled_jacobian_min[cell] = entry[2];
        result.least_determinant[cell] = entry[3];
        result.largest_determinant[cell] = entry[4];
        for (sum, value) in sums.iter_mut().zip([entry[0], entry[5], entry[6]]) {
            *sum += value;
        }
    }
    let mean = sums[1] / sums[0];
    result.spread = (sums[2] / sums[0] - mean * mean).max(0.0).sqrt();
    Ok(result)
}

/// Distances and uniformity of the boundary.
pub fn measure_boundary(
    volume: &MixedMesh,
    topology: &Topology,
    space: &Space,
    x: &[f64],
    target: &Target,
    metrics: &mut BTreeMap<String, f64>,
) -> Result<(), Failure> {
    let highest = space.orders.iter().copied().max().unwrap_or(1);
    let boundary = Boundary::new(volume, topology, space, FINE.max(2 * highest));
    let mut samples = Vec::new();
    boundary.positions(x, &mut samples);
    let fitted = TriangleMesh {
        points: samples.clone(),
        cells: boundary.triangles.clone(),
    };
    let clean = &target.clean;
    let mut set = |name: &str, value: f64| {
        metrics.insert(name.to_string(), value);
    };
    if clean.cells.is_empty() {
        let diagonal = mesh::diagonal(&clean.points);
        let distances = distance::of_points(&clean.points, &ClosestPoint::new(&fitted));
        let percent = |value: f64| 100.0 * value / diagonal;
        let most = percent(distances.iter().copied().fold(0.0, f64::max));
        let square = distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64;
        set("hausdorff", most);
        set("hausdorff_from_target", most);
        set("hausdorff_to_target", f64::NAN);
        set("distance_rms", percent(square.sqrt()));
    } else {
        let measured = distance::hausdorff(&fitted, clean).map_err(invalid)?;
        set("hausdorff", measured.percent(measured.max()));
        set("hausdorff_to_target", measured.percent(measured.forward.max));
        set("hausdorff_from_target", measured.percent(measured.backward.max));
        set("distance_rms", measured.percent(measured.backward.rms));
    }
    let creases = crease_points(clean);
    let (mut mean, mut most) = (f64::NAN, f64::NAN);
    if !creases.is_empty() {
        let distances = distance::of_points(&creases, &ClosestPoint::new(&fitted));
        let scale = 100.0 / mesh::diagonal(&clean.points);
        mean = scale * distances.iter().sum::<f64>() / distances.len() as f64;
        most = scale * distances.iter().copied().fold(0.0, f64::max);
    }
    set("crease_distance", mean);
    set("crease_distance_max", most);
    let mut sum = 0.0;
    for line in &boundary.edges {
        let speeds: Vec<f64> = line
            .windows(2)
            .map(|pair| mesh::length(mesh::subtract(samples[pair[1] as usize], samples[pair[0] as usize])))
            .collect();
        let mean = speeds.iter().sum::<f64>() / speeds.len() as f64;
        let square = speeds.iter().map(|speed| (speed - mean).powi(2)).sum::<f64>() / speeds.len() as f64;
        sum += square.sqrt() / mean.max(f64::MIN_POSITIVE);
    }
    set("edge_uniformity", sum / boundary.edges.len() as f64);
    Ok(())
}

/// Points along the edges of a surface that are bent by more than 40 degrees.
fn crease_points(surface: &TriangleMesh) -> Vec<[f64; 3]> {
    let mut sides: BTreeMap<[u32; 2], Vec<[f64; 3]>> = BTreeMap::new();
    for &cell in &surface.cells {
        let normal = mesh::area_vector(surface.corners(cell));
        let size = mesh::length(normal);
        if !(size > 0.0) {
            continue;
        }
        let normal = normal.map(|coordinate| coordinate / size);
        for place in 0..3 {
            let (a, b) = (cell[place], cell[(place + 1) % 3]);
            sides.entry([a.min(b), a.max(b)]).or_default().push(normal);
        }
    }
    let mut points = Vec::new();
    for ([a, b], normals) in sides {
        if let [first, second] = normals[..]
            && mesh::dot(first, second) < 40.0_f64.to_radians().cos()
        {
            let (a, b) = (surface.points[a as usize], surface.points[b as usize]);
            for share in [0.1, 0.5, 0.9] {
                points.push(std::array::from_fn(|axis| a[axis] + share * (b[axis] - a[axis])));
            }
        }
    }
    points
}

/// The volume as a VTU file of linear cells, every element cut evenly.
pub fn picture(
    space: &Space,
    references: &[Columns<f64>],
    x: &[f64],
    volume: &MixedMesh,
    fields: &[(&str, Vec<f64>)],
) -> Result<Vec<u8>, Failure> {
    let cells = volume.cells();
    let highest = space.orders.iter().copied().max().unwrap_or(1);
    let mut cuts = if highest == 1 { 1 } else { (2 * highest).clamp(4, 8) };
    while cuts > 1 && cells * cuts * cuts * cuts > MOST_CELLS {
        cuts -= 1;
    }
    let m = cuts;
    let batches = Batches::new(space, references, &|kind| Rule::Trapezoid.cell(kind.shape, m + 1)).map_err(invalid)?;
    let lattices = Shape::ALL.map(|shape| lattice(shape, m));
    // A point's name: its weights over the vertices, times m^3. Elements that share a point share its name.
    let mut names: BTreeMap<Vec<(u32, u32)>, u32> = BTreeMap::new();
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut numbers: Vec<Vec<u32>> = vec![Vec::new(); cells];
    let processor = Processor::detect();
    for place in batches.list() {
        batches.visit_places(processor, place, x, |cell, point, position| {
            let (shape, corners) = volume.cell(cell);
            let frame = &space.cells[cell].corners;
            let weights = &lattices[shape as usize].0[point];
            let mut name: Vec<(u32, u32)> = weights
                .iter()
                .enumerate()
                .filter(|(_, weight)| **weight > 0)
                .map(|(corner, &weight)| (corners[frame[corner] as usize], weight))
                .collect();
            name.sort_unstable();
            let number = *names.entry(name).or_insert_with(|| {
                points.push(position);
                points.len() as u32 - 1
            });
            numbers[cell].push(number);
        });
    }
    let mut hexahedra: Vec<[u32; 8]> = Vec::new();
    let mut prisms: Vec<[u32; 6]> = Vec::new();
    let mut tetrahedra: Vec<[u32; 4]> = Vec::new();
    let mut owners: [Vec<usize>; 3] = Default::default();
    for cell in 0..cells {
        let (shape, _) = volume.cell(cell);
        let own = &numbers[cell];
        // The lattice is the functions' frame, which for a tetrahedron may be a reflection of the element.
        let odd = shape == Shape::Tetrahedron && odd_permutation(&space.cells[cell].corners[..4]);
        for part in &lattices[shape as usize].1 {
            let at = |place: usize| own[part[place] as usize];
            match shape {
                Shape::Hexahedron => hexahedra.push(std::array::from_fn(at)),
                Shape::Prism => prisms.push(std::array::from_fn(at)),
                Shape::Tetrahedron if odd => tetrahedra.push([at(0), at(1), at(3), at(2)]),
                Shape::Tetrahedron => tetrahedra.push(std::array::from_fn(at)),
            }
            owners[shape as usize].push(cell);
        }
    }
    // The file lists tetrahedra, then hexahedra, then prisms.
    let order = [Shape::Tetrahedron, Shape::Hexahedron, Shape::Prism];
    let spread: Vec<(&str, Vec<f64>)> = fields
        .iter()
        .map(|(name, values)| {
            let rows = order.iter().flat_map(|&shape| &owners[shape as usize]);
            (*name, rows.map(|&cell| values[cell]).collect())
        })
        .collect();
    let views: Vec<(&str, usize, &[f64])> = spread
        .iter()
        .map(|(name, values)| (*name, 1, values.as_slice()))
        .collect();
    Ok(vtu::write(
        &points,
        Cells {
            hexahedra: &hexahedra,
            prisms: &prisms,
            tetrahedra: &tetrahedra,
            ..Cells::default()
        },
        &[],
        &views,
    ))
}

fn odd_permutation(order: &[u8]) -> bool {
    let swaps = (0..order.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    swaps.filter(|&(i, j)| order[j] > order[i]).count() % 2 == 1
}

/// Weights of every lattice point over the corners times m^3, and the small cells over the points.
fn lattice(shape: Shape, m: usize) -> (Vec<Vec<u32>>, Vec<Vec<u32>>) {
    let nodes = Rule::Trapezoid.cell(shape, m + 1).nodes();
    let index: Vec<[usize; 3]> = nodes
        .iter()
        .map(|(point, _)| point.map(|coordinate| (coordinate * m as f64).round() as usize))
        .collect();
    let find: BTreeMap<[usize; 3], u32> = index.iter().enumerate().map(|(at, &key)| (key, at as u32)).collect();
    let canonical = shape.canonical();
    let weights = index
        .iter()
        .map(|&[i, j, k]| {
            let line = |index: usize, end: f64| if end == 0.0 { m - index } else { index };
            let simplex =
                |first: usize, corner: [f64; 3], axes: usize| match (0..axes).find(|&axis| corner[axis] == 1.0) {
                    None => m - first,
                    Some(axis) => [i, j, k][axis],
                };
            canonical
                .iter()
                .map(|&corner| match shape {
                    Shape::Hexahedron => (line(i, corner[0]) * line(j, corner[1]) * line(k, corner[2])) as u32,
                    Shape::Prism => (simplex(i + j, corner, 2) * line(k, corner[2]) * m) as u32,
                    Shape::Tetrahedron => (simplex(i + j + k, corner, 3) * m * m) as u32,
                })
                .collect()
        })
        .collect();
    let mut parts = Vec::new();
    let at = |i: usize, j: usize, k: usize| find.get(&[i, j, k]).copied();
    let mut push = |corners: &[[usize; 3]]| {
        let found: Option<Vec<u32>> = corners.iter().map(|&[i, j, k]| at(i, j, k)).collect();
        if let Some(found) = found {
            parts.push(found);
        }
    };
    for i in 0..m {
        for j in 0..m {
            for k in 0..m {
                let p = |a: usize, b: usize, c: usize| [i + a, j + b, k + c];
                match shape {
                    Shape::Hexahedron => push(&[
                        p(0, 0, 0),
                        p(1, 0, 0),
                        p(1, 1, 0),
                        p(0, 1, 0),
                        p(0, 0, 1),
                        p(1, 0, 1),
                        p(1, 1, 1),
                        p(0, 1, 1),
                    ]),
                    Shape::Prism => {
                        push(&[p(0, 0, 0), p(1, 0, 0), p(0, 1, 0), p(0, 0, 1), p(1, 0, 1), p(0, 1, 1)]);
                        push(&[p(1, 0, 0), p(1, 1, 0), p(0, 1, 0), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)]);
                    }
                    Shape::Tetrahedron => {
                        push(&[p(0, 0, 0), p(1, 0, 0), p(0, 1, 0), p(0, 0, 1)]);
                        // The octahedron between, about its diagonal from (1,0,0) to (0,1,1).
                        let ring = [p(0, 1, 0), p(1, 1, 0), p(1, 0, 1), p(0, 0, 1)];
                        for side in 0..4 {
                            push(&[p(1, 0, 0), ring[side], p(0, 1, 1), ring[(side + 1) % 4]]);
                        }
                        push(&[p(1, 1, 0), p(0, 1, 1), p(1, 0, 1), p(1, 1, 1)]);
                    }
                }
            }
        }
    }
    // Right-handed throughout: small tetrahedra of the other sense are turned.
    if shape == Shape::Tetrahedron {
        for part in &mut parts {
            let corners = [0, 1, 2, 3].map(|place| nodes[part[place] as usize].0);
            if mesh::determinant(corners) < 0.0 {
                part.swap(2, 3);
            }
        }
    }
    (weights, parts)
}

/// What is known of an element's validity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    Certified,
    Fails,
    Undecided,
}

/// Certificates of all elements.
#[derive(Clone, Debug)]
pub struct Certificates {
    pub verdicts: Vec<Judged>,
    /// Least proven bound of the determinant over the certified elements.
    pub bound: f64,
    pub notices: Vec<String>,
}

/// Parts that an element is cut into at most.
const MOST_PARTS: usize = 4000;

/// Proves that determinants are positive everywhere, element by element.
pub fn certify(space: &Space, references: &[Columns<f64>], x: &[f64], observer: &dyn Observer) -> Certificates {
    let cells = space.cells.len();
    let kinds = space.cells.iter().map(|cell| cell.kind);
    let certifier = Certifier::new(space.basis, kinds, MOST_PARTS);
    let mut result = Certificates {
        verdicts: Vec::with_capacity(cells),
        bound: f64::NAN,
        notices: Vec::new(),
    };
    let mut first: Option<(usize, [f64; 3], f64)> = None;
    while result.verdicts.len() < cells {
        if observer.stop().is_some() {
            result.verdicts.resize(cells, Judged::Undecided);
            result
                .notices
                .push("stopped from outside before every element was judged".to_string());
            break;
        }
        let start = result.verdicts.len();
        let verdicts: Vec<Verdict> = (start..(start + 64).min(cells))
            .into_par_iter()
            .map(|cell| certifier.judge(space, cell, &references[cell], x))
            .collect();
        for (offset, verdict) in verdicts.into_iter().enumerate() {
            result.verdicts.push(match verdict {
                Verdict::Positive(bound) => {
                    result.bound = result.bound.min(bound);
                    Judged::Certified
                }
                Verdict::Negative(point, value) => {
                    first.get_or_insert((start + offset, point, value));
                    Judged::Fails
                }
                Verdict::Undecided => Judged::Undecided,
            });
        }
    }
    if let Some((cell, point, value)) = first {
        let count = result
            .verdicts
            .iter()
            .filter(|verdict| **verdict == Judged::Fails)
            .count();
        result.notices.push(format!(
            "{count} elements are not valid everywhere; the first is element {cell}, whose determinant is {value:.3e} at \
             {point:.4?} in its canonical coordinates"
        ));
    }
    result
}
