//! The target: a surface read from a file or generated, damaged on request, or a cloud of points.

use super::{shapes, shell};
use crate::mesh::format::{self, Content};
use crate::mesh::mixed::MixedMesh;
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
            (shapes::generate(generator, parameters, wanted), parameters)
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
                    let content = format::read(name, bytes).map_err(|error| Failure::invalid(error.to_string()))?;
                    notices.extend(content.notices.iter().map(|notice| format!("target: {notice}")));
                    let surface = triangles(&content);
                    let solids = content.tetrahedra.len() + content.hexahedra.len() + content.prisms.len();
                    if surface.cells.is_empty() && solids > 0 {
                        let (volume, found) = MixedMesh::from_content(&content).map_err(Failure::invalid)?;
                        notices.extend(found.into_iter().map(|notice| format!("target: {notice}")));
                        let topology = volume.topology().map_err(Failure::invalid)?;
                        topology.boundary_triangles(&volume.points)
                    } else {
                        surface
                    }
                }
            };
            for point in &mut surface.points {
                *point = point.map(|coordinate| coordinate * scale);
            }
            if !surface.cells.is_empty() {
                // A stray point far away would make the box, and with it the unit of length, meaningless.
                surface = shell::used(&surface);
            }
            (surface, parameters)
        }
    };
    if clean.points.is_empty() {
        return Err(Failure::invalid("the target has neither triangles nor points"));
    }
    if let Some(place) = clean
        .points
        .iter()
        .position(|point| !point.iter().all(|coordinate| coordinate.is_finite()))
    {
        return Err(Failure::invalid(format!(
            "vertex {place} of the target is at {:?}; coordinates must be finite numbers",
            clean.points[place]
        )));
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
        notices: vec!["no target is given: the template's own boundary, as it is, is the target".to_string()],
        ..Target::default()
    }
}

/// Points of a text file with three or six numbers a line, where it is one.
fn cloud(name: &str, bytes: &[u8]) -> Result<Option<Vec<[f64; 3]>>, Failure> {
    if !(name.ends_with(".xyz") || name.ends_with(".pts")) {
        return Ok(None);
    }
    let text = std::str::from_utf8(bytes).map_err(|_| Failure::invalid(format!("{name}: not a text of points")))?;
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
                return Err(Failure::invalid(format!(
                    "{name}:{}: a point needs three finite numbers, here is {row:?}",
                    line + 1
                )));
            }
        }
    }
    Ok(Some(points))
}

/// Whether a surface encloses a volume, and what of it does not.
#[derive(Clone, Debug)]
pub struct Closure {
    /// The triangles over vertices that are one where they are at one place; those with a vertex twice are left out.
    pub joined: TriangleMesh,
    /// For each of them its number in the surface.
    pub kept: Vec<usize>,
    pub edges: usize,
    /// Edges with one triangle.
    pub open: usize,
    /// Edges with more that do not run through them as often one way as the other.
    pub turned: usize,
}

impl Closure {
    /// Looks at every edge; a soup of triangles may well be closed.
    pub fn of(surface: &TriangleMesh) -> Closure {
        let mut named: BTreeMap<[u64; 3], u32> = BTreeMap::new();
        let names: Vec<u32> = surface
            .points
            .iter()
            .map(|point| {
                let count = named.len() as u32;
                // Adding 0 makes -0 the same as 0.
                *named
                    .entry(point.map(|coordinate| (coordinate + 0.0).to_bits()))
                    .or_insert(count)
            })
            .collect();
        let cells = surface
            .cells
            .iter()
            .map(|cell| cell.map(|corner| names[corner as usize]));
        let (kept, cells) = cells
            .enumerate()
            .filter(|(_, [a, b, c])| a != b && b != c && c != a)
            .unzip();
        let joined = TriangleMesh {
            points: Vec::new(),
            cells,
        };
        let mut sides = BTreeMap::<[u32; 2], [usize; 2]>::new();
        for cell in &joined.cells {
            for place in 0..3 {
                let (a, b) = (cell[place], cell[(place + 1) % 3]);
                sides.entry([a.min(b), a.max(b)]).or_default()[usize::from(a > b)] += 1;
            }
        }
        let count = |wanted: &dyn Fn(&[usize; 2]) -> bool| sides.values().filter(|sides| wanted(sides)).count();
        Closure {
            edges: sides.len(),
            open: count(&|sides| sides[0] + sides[1] == 1),
            turned: count(&|sides| sides[0] + sides[1] > 1 && sides[0] != sides[1]),
            joined,
            kept,
        }
    }

    pub fn is_closed(&self) -> bool {
        self.edges > 0 && self.open + self.turned == 0
    }
}

fn centroids(surface: &TriangleMesh) -> Vec<[f64; 3]> {
    surface
        .cells
        .iter()
        .map(|&cell| centroid(surface.corners(cell)))
        .collect()
}

fn centroid([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0)
}

impl Target {
    /// Leaves out triangles without area and chooses the sites: the centroids of the triangles, or of pieces of those that
    /// are large beside `wanted` even ones. A flat face of two triangles would pull every sample near it towards two points.
    /// Wanted are never more than there are triangles or [`ENOUGH_SITES`].
    pub fn place_sites(&mut self, wanted: usize) {
        if self.surface.cells.is_empty() {
            if self.sites.is_empty() {
                self.sites = self.surface.points.clone();
            }
            self.normals = vec![[0.0; 3]; self.sites.len()];
            return;
        }
        let diagonal = mesh::diagonal(&self.surface.points);
        let mut cells = std::mem::take(&mut self.surface.cells);
        cells.retain(|&cell| mesh::length(mesh::area_vector(self.surface.corners(cell))) > 1e-14 * diagonal * diagonal);
        self.surface.cells = cells;
        let count = self.surface.cells.len();
        let wanted = wanted.clamp(1, count.max(ENOUGH_SITES));
        let even = (4.0 / 3f64.sqrt() * self.surface.area() / wanted as f64).sqrt();
        let most = count + MORE_SITES * wanted;
        let mut seen = std::collections::BTreeSet::new();
        let mut pieces = Vec::new();
        for &cell in &self.surface.cells {
            let corners = self.surface.corners(cell);
            let normal = mesh::area_vector(corners);
            let size = mesh::length(normal);
            let normal = normal.map(|coordinate| coordinate / size);
            pieces.push(corners);
            while let Some(piece) = pieces.pop() {
                let (place, longest) = longest_edge(piece);
                if longest > LARGE * even && self.sites.len() + pieces.len() < most {
                    pieces.extend(halved(piece, place));
                    continue;
                }
                let centroid = centroid(piece);
                // Two sites at one place share a cell of no use.
                if seen.insert(centroid.map(f64::to_bits)) {
                    self.sites.push(centroid);
                    self.normals.push(normal);
                }
            }
        }
    }
}

/// Edges so many times longer than those of an even triangulation are halved.
const LARGE: f64 = 2.0;

/// Sites that are enough for a target of fewer triangles, however many samples there are.
const ENOUGH_SITES: usize = 3_000;

/// Sites that may be added for every one wanted: slivers have many.
const MORE_SITES: usize = 4;

/// The edge after which corner is the longest, and its length.
fn longest_edge(corners: [[f64; 3]; 3]) -> (usize, f64) {
    let edge = |place: usize| mesh::length(mesh::subtract(corners[(place + 1) % 3], corners[place]));
    (0..3)
        .map(|place| (place, edge(place)))
        .fold((0, 0.0), |best, next| if next.1 > best.1 { next } else { best })
}

/// Both halves of a triangle, cut from the middle of the edge after a corner.
fn halved(corners: [[f64; 3]; 3], place: usize) -> [[[f64; 3]; 3]; 2] {
    let [a, b, c] = [0, 1, 2].map(|step| corners[(place + step) % 3]);
    let middle = std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]));
    [[a, middle, c], [middle, b, c]]
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
