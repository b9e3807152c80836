//! The target: a surface read from a file or generated, damaged on request, or a cloud of points.

use crate::mesh::format::{self, Content};
use crate::mesh::mixed::MixedMesh;
use crate::mesh::template::grid::selected;
use crate::mesh::{self, TriangleMesh};
use crate::method::Failure;
use crate::method::model::Part;
use serde_json::Value;
use std::collections::BTreeMap;

/// What the boundary is fitted to, in the units of its file.
#[derive(Clone, Debug, Default)]
pub struct Target {
    /// Triangles; none for a cloud.
    pub surface: TriangleMesh,
    /// The surface before it was damaged, to measure against.
    pub clean: TriangleMesh,
    /// Sites of the term from the template's surface: barycentres of the triangles, or the cloud.
    pub sites: Vec<[f64; 3]>,
    /// Unit normals of the sites; zero where unknown.
    pub normals: Vec<[f64; 3]>,
    pub notices: Vec<String>,
}

fn invalid(reason: String) -> Failure {
    Failure {
        kind: "invalid-input".to_string(),
        reason,
    }
}

/// Triangles of a file's content, quads as two.
fn triangles(content: &Content) -> TriangleMesh {
    let mut cells = content.triangles.clone();
    for &[a, b, c, d] in &content.quads {
        cells.push([a, b, c]);
        cells.push([a, c, d]);
    }
    TriangleMesh {
        points: content.points.clone(),
        cells,
    }
}

/// Reads or generates the target.
///
/// # Errors
/// `invalid-input` for what is neither a surface nor a cloud of points.
pub fn read(part: &Part) -> Result<Target, Failure> {
    let mut notices = Vec::new();
    let (clean, parameters) = match part {
        Part::Generated { generator, parameters } => {
            let wanted = parameters.get("triangles").and_then(Value::as_u64).unwrap_or(6000) as usize;
            (generate(generator, parameters, wanted), parameters)
        }
        Part::File {
            name,
            bytes,
            parameters,
        } => {
            let scale = parameters.get("scale").and_then(Value::as_f64).unwrap_or(1.0);
            let mut surface = match cloud(name, bytes)? {
                Some(points) => TriangleMesh {
                    points,
                    cells: Vec::new(),
                },
                None => {
                    let content = format::read(name, bytes).map_err(|error| invalid(error.to_string()))?;
                    notices.extend(content.notices.iter().map(|notice| format!("target: {notice}")));
                    let surface = triangles(&content);
                    if surface.cells.is_empty() && !(content.tetrahedra.is_empty() && content.hexahedra.is_empty()) {
                        let (volume, _) = MixedMesh::from_content(&content).map_err(invalid)?;
                        let topology = volume.topology().map_err(invalid)?;
                        topology.boundary_triangles(&volume.points)
                    } else {
                        surface
                    }
                }
            };
            for point in &mut surface.points {
                *point = point.map(|coordinate| coordinate * scale);
            }
            (surface, parameters)
        }
    };
    if clean.points.is_empty() {
        return Err(invalid("the target has neither triangles nor points".to_string()));
    }
    let mut target = Target {
        surface: damaged(&clean, parameters),
        clean,
        notices,
        ..Target::default()
    };
    if parameters.get("cloud").and_then(Value::as_bool).unwrap_or(false) {
        target.sites = centroids(&target.surface);
        target.surface = TriangleMesh::default();
    }
    Ok(target)
}

/// The target that the boundary of a volume is, for optimizing a mesh over its own boundary.
pub fn of_boundary(surface: TriangleMesh) -> Target {
    Target {
        surface: surface.clone(),
        clean: surface,
        notices: vec!["no target is given: the template's own boundary is".to_string()],
        ..Target::default()
    }
}

/// Points of a text file with three or six numbers a line, where it is one.
fn cloud(name: &str, bytes: &[u8]) -> Result<Option<Vec<[f64; 3]>>, Failure> {
    if !(name.ends_with(".xyz") || name.ends_with(".pts")) {
        return Ok(None);
    }
    let text = std::str::from_utf8(bytes).map_err(|_| invalid(format!("{name}: not a text of points")))?;
    let mut points = Vec::new();
    for (line, row) in text.lines().enumerate() {
        let row = row.trim();
        if row.is_empty() || row.starts_with('#') {
            continue;
        }
        let numbers: Result<Vec<f64>, _> = row.split_whitespace().map(str::parse).collect();
        match numbers {
            Ok(numbers) if numbers.len() >= 3 && numbers[..3].iter().all(|number| number.is_finite()) => {
                points.push([numbers[0], numbers[1], numbers[2]]);
            }
            // The first line may be a count.
            Ok(numbers) if numbers.len() == 1 && points.is_empty() => {}
            _ => {
                return Err(invalid(format!(
                    "{name}:{}: a point needs three finite numbers, here is {row:?}",
                    line + 1
                )));
            }
        }
    }
    Ok(Some(points))
}

fn centroids(surface: &TriangleMesh) -> Vec<[f64; 3]> {
    surface
        .cells
        .iter()
        .map(|&cell| {
            let [a, b, c] = surface.corners(cell);
            std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0)
        })
        .collect()
}

impl Target {
    /// Chooses the sites. Triangles without area have none.
    pub fn place_sites(&mut self) {
        if self.surface.cells.is_empty() {
            if self.sites.is_empty() {
                self.sites = self.surface.points.clone();
            }
            self.normals = vec![[0.0; 3]; self.sites.len()];
            return;
        }
        let diagonal = mesh::diagonal(&self.surface.points);
        let mut seen = std::collections::BTreeSet::new();
        let centroids = centroids(&self.surface);
        for (&cell, centroid) in self.surface.cells.iter().zip(centroids) {
            let normal = mesh::area_vector(self.surface.corners(cell));
            let size = mesh::length(normal);
            // Two sites at one place share a cell of no use.
            if size > 1e-14 * diagonal * diagonal && seen.insert(centroid.map(f64::to_bits)) {
                self.sites.push(centroid);
                self.normals.push(normal.map(|coordinate| coordinate / size));
            }
        }
    }
}

/// Numbers in [0, 1) from a seed (a linear congruential generator and a mix).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let mixed = (self.0 ^ (self.0 >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        ((mixed ^ (mixed >> 33)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn damaged(surface: &TriangleMesh, parameters: &Value) -> TriangleMesh {
    let number = |name: &str| parameters.get(name).and_then(Value::as_f64).unwrap_or(0.0);
    let seed = parameters.get("seed").and_then(Value::as_u64).unwrap_or(0);
    let mut random = Random(seed ^ 0x9e37_79b9_7f4a_7c15);
    let mut result = surface.clone();
    let (noise, flipped, degenerate) = (number("noise"), number("flipped"), number("degenerate"));
    if noise > 0.0 && !surface.cells.is_empty() {
        let edges = surface.cells.iter().map(|&cell| {
            let [a, b, _] = surface.corners(cell);
            mesh::length(mesh::subtract(b, a))
        });
        let mean = edges.sum::<f64>() / surface.cells.len() as f64;
        for point in &mut result.points {
            for coordinate in point {
                *coordinate += noise * mean * (2.0 * random.next() - 1.0);
            }
        }
    }
    if degenerate > 0.0 {
        for cell in surface.cells.clone() {
            if random.next() < degenerate {
                result.cells.push([cell[0], cell[1], cell[1]]);
            }
        }
    }
    for cell in &mut result.cells {
        if random.next() < flipped {
            cell.swap(1, 2);
        }
    }
    if parameters.get("soup").and_then(Value::as_bool).unwrap_or(false) {
        let points = result
            .cells
            .iter()
            .flatten()
            .map(|&corner| result.points[corner as usize]);
        result.points = points.collect();
        for (index, cell) in result.cells.iter_mut().enumerate() {
            *cell = std::array::from_fn(|corner| (3 * index + corner) as u32);
        }
    }
    result
}

/// A generated surface.
fn generate(name: &str, parameters: &Value, wanted: usize) -> TriangleMesh {
    let number = |name: &str, default: f64| parameters.get(name).and_then(Value::as_f64).unwrap_or(default);
    let cube = |points: &mut Vec<[f64; 3]>| {
        // The tangent spreads the points of a cube's faces evenly over the sphere.
        for point in points {
            let bent = point.map(|c| ((c / 0.5 - 1.0) * std::f64::consts::FRAC_PI_4).tan());
            let size = mesh::length(bent);
            *point = bent.map(|c| c / size);
        }
    };
    match name {
        "ellipsoid" | "pebble" => {
            let mut surface = quads_to_triangles(subdivided([1, 1, 1], |_| true, wanted, false));
            cube(&mut surface.points);
            if name == "ellipsoid" {
                let axes = [number("a", 1.0), number("b", 0.8), number("c", 0.6)];
                for point in &mut surface.points {
                    *point = std::array::from_fn(|axis| point[axis] * axes[axis]);
                }
            } else {
                let amplitude = number("amplitude", 0.15);
                for point in &mut surface.points {
                    let [x, y, z] = *point;
                    let bumps = (3.0 * x + 0.5).sin() * (2.6 * y - 0.3).cos() + 0.6 * (4.1 * z + 1.0 + x).sin();
                    *point = point.map(|c| c * (1.0 + amplitude * bumps));
                }
            }
            surface
        }
        "block" => {
            let mut surface = quads_to_triangles(subdivided([3, 2, 2], |[i, _, k]| !(i > 0 && k == 1), wanted, false));
            stretch(&mut surface, [1.0, 1.0, 0.7]);
            surface
        }
        "joint" => {
            let part = |[i, j, k]: [usize; 3]| {
                let hole = (1..3).contains(&i) && (1..3).contains(&j);
                if k == 0 { !hole } else { i >= 4 }
            };
            let mut surface = quads_to_triangles(subdivided([6, 4, 3], part, wanted, false));
            stretch(&mut surface, [1.0, 1.0, 0.9]);
            surface
        }
        "double-torus" => {
            let mut surface = quads_to_triangles(subdivided(
                [5, 3, 1],
                |[i, j, _]| !((i == 1 || i == 3) && j == 1),
                wanted,
                true,
            ));
            stretch(&mut surface, [1.0, 1.0, 0.9]);
            surface
        }
        "bone" => {
            let part = |[i, j, k]: [usize; 3]| !(2..7).contains(&i) || (j == 1 && k == 1);
            let mut surface = quads_to_triangles(subdivided([9, 3, 3], part, wanted, true));
            for point in &mut surface.points {
                let [x, y, z] = *point;
                *point = [x, y + 0.02 * (x - 4.5) * (x - 4.5), z];
            }
            surface
        }
        _ => {
            let part = |[i, j, k]: [usize; 3]| k < 3 || (i != 1 && j != 1);
            quads_to_triangles(subdivided([3, 3, 4], part, wanted, true))
        }
    }
}

fn stretch(surface: &mut TriangleMesh, factors: [f64; 3]) {
    for point in &mut surface.points {
        *point = std::array::from_fn(|axis| point[axis] * factors[axis]);
    }
}

fn quads_to_triangles((points, quads): (Vec<[f64; 3]>, Vec<[u32; 4]>)) -> TriangleMesh {
    let cells = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriangleMesh { points, cells }
}

/// The boundary of some cubes of a grid, cut into quads until there are `wanted` triangles; smoothed in the first rounds
/// by averaging, which tends to a bicubic spline.
fn subdivided(
    counts: [usize; 3],
    part: impl Fn([usize; 3]) -> bool,
    wanted: usize,
    smooth: bool,
) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let volume = selected(counts, part);
    let faces = volume.topology().map(|topology| {
        let corners = topology.boundary().map(|(_, face)| face.corners);
        corners.collect::<Vec<[u32; 4]>>()
    });
    let mut quads = faces.unwrap_or_default();
    let mut points = volume.points;
    while 2 * quads.len() * 2 <= wanted {
        (points, quads) = split(&points, &quads);
        if smooth {
            average(&mut points, &quads);
        }
    }
    // Points inside the volume belong to no quad.
    let mut names = vec![u32::MAX; points.len()];
    let mut kept = Vec::new();
    for corner in quads.iter_mut().flatten() {
        if names[*corner as usize] == u32::MAX {
            names[*corner as usize] = kept.len() as u32;
            kept.push(points[*corner as usize]);
        }
        *corner = names[*corner as usize];
    }
    (kept, quads)
}

/// Every quad cut into four.
fn split(points: &[[f64; 3]], quads: &[[u32; 4]]) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let mut points = points.to_vec();
    let mut middles = BTreeMap::new();
    let mut result = Vec::with_capacity(4 * quads.len());
    for &[a, b, c, d] in quads {
        let mut middle = |corners: &[u32]| {
            let mut key = corners.to_vec();
            key.sort_unstable();
            *middles.entry(key).or_insert_with(|| {
                let point = std::array::from_fn(|axis| {
                    corners.iter().map(|&corner| points[corner as usize][axis]).sum::<f64>() / corners.len() as f64
                });
                points.push(point);
                points.len() as u32 - 1
            })
        };
        let [ab, bc, cd, da, centre] = [
            middle(&[a, b]),
            middle(&[b, c]),
            middle(&[c, d]),
            middle(&[d, a]),
            middle(&[a, b, c, d]),
        ];
        result.extend([
            [a, ab, centre, da],
            [ab, b, bc, centre],
            [centre, bc, c, cd],
            [da, centre, cd, d],
        ]);
    }
    (points, result)
}

/// Every vertex to the mean of its quads' centroids.
fn average(points: &mut [[f64; 3]], quads: &[[u32; 4]]) {
    let mut sums = vec![([0.0; 3], 0.0); points.len()];
    for quad in quads {
        for &corner in quad {
            let (sum, count) = &mut sums[corner as usize];
            *count += 1.0;
            for axis in 0..3 {
                sum[axis] += quad.iter().map(|&corner| points[corner as usize][axis]).sum::<f64>() / 4.0;
            }
        }
    }
    for (point, (sum, count)) in points.iter_mut().zip(sums) {
        if count > 0.0 {
            *point = sum.map(|coordinate| coordinate / count);
        }
    }
}
