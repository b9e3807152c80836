//! Shell meshes: layers of prisms on one or both sides of a surface at a prescribed distance (Jin et al. 2013, section
//! 4.4).
//!
//! A thin shell is grown along the vertices' normals; then every prism strives, by the volume energy, for the thickness
//! `distance / layers` over the very shape of the triangle it stands on, while the surface itself stays where it is.
//! Not guaranteed: that distant parts of the shell do not meet where the surface folds back within the distance.

use super::chart::Chart;
use super::fit::Fit;
use super::settings::Stage;
use crate::geometry::closest_point::ClosestPoint;
use crate::linalg::vector3::Columns;
use crate::mesh::mixed::{MixedMesh, Shape};
use crate::mesh::{self, TriangleMesh, add_scaled, area_vector, cross, dot, length, subtract};
use crate::method::Failure;
use crate::metric::distance;
use crate::optimize::{Observer, StopReason};
use std::collections::BTreeMap;

/// On which sides of the surface layers are grown, by the word for it.
pub static SIDES: &[(&str, &str)] = &[
    ("both", "along the normals and against them"),
    ("outside", "along the normals"),
    ("inside", "against the normals"),
];

/// What a shell strives for.
#[derive(Clone, Debug)]
pub struct Shell {
    /// The reference of every prism.
    pub references: Vec<Columns<f64>>,
    /// The distance of the outermost layer.
    pub distance: f64,
    /// Vertices of the surface, the first of the mesh.
    pub base: usize,
    /// Vertices of the outermost layers.
    pub outer: Vec<u32>,
    pub surface: TriangleMesh,
}

/// Thickness of the shell that is grown first, as a share of the shortest edge at a vertex.
const THIN: f64 = 0.1;

/// Grows a thin shell on a surface; `distance` in the surface's units.
///
/// # Errors
/// When the surface has no triangles, one without area, or a vertex that no direction leaves on one side of all its
/// triangles.
pub fn grow(surface: &TriangleMesh, distance: f64, layers: usize, side: &str) -> Result<(MixedMesh, Shell), String> {
    if surface.cells.is_empty() {
        return Err("a shell needs triangles to grow on".to_string());
    }
    let surface = used(surface);
    let (normals, lengths) = directions(&surface)?;
    let signs: &[f64] = match side {
        "outside" => &[1.0],
        "inside" => &[-1.0],
        _ => &[1.0, -1.0],
    };
    let vertices = surface.points.len();
    let mut share = THIN;
    loop {
        let mut mesh = MixedMesh {
            points: surface.points.clone(),
            ..MixedMesh::default()
        };
        let mut references = Vec::new();
        let mut outer = Vec::new();
        for &sign in signs {
            let first = mesh.points.len();
            for layer in 1..=layers {
                for vertex in 0..vertices {
                    let height = sign * share * lengths[vertex] * layer as f64 / layers as f64;
                    mesh.points
                        .push(add_scaled(surface.points[vertex], normals[vertex], height));
                }
            }
            let name = |vertex: u32, layer: usize| match layer {
                0 => vertex,
                _ => (first + (layer - 1) * vertices) as u32 + vertex,
            };
            for layer in 1..=layers {
                for &cell in &surface.cells {
                    let (below, above) = if sign > 0.0 {
                        (layer - 1, layer)
                    } else {
                        (layer, layer - 1)
                    };
                    let [a, b, c] = cell;
                    let corners = [
                        name(a, below),
                        name(b, below),
                        name(c, below),
                        name(a, above),
                        name(b, above),
                        name(c, above),
                    ];
                    mesh.push(Shape::Prism, &corners);
                    references.push(reference(surface.corners(cell), distance / layers as f64));
                }
            }
            outer.extend((0..vertices as u32).map(|vertex| name(vertex, layers)));
        }
        if inverted(&mesh) == 0 {
            let shell = Shell {
                references,
                distance,
                base: vertices,
                outer,
                surface,
            };
            return Ok((mesh, shell));
        }
        share *= 0.5;
        if share < 1e-9 {
            return Err(format!(
                "{} prisms of even the thinnest shell are inverted; smooth the surface's sharpest folds",
                inverted(&mesh)
            ));
        }
    }
}

/// The surface without points that no triangle uses.
pub(super) fn used(surface: &TriangleMesh) -> TriangleMesh {
    let mut names = vec![u32::MAX; surface.points.len()];
    let mut result = TriangleMesh::default();
    for cell in &surface.cells {
        result.cells.push(cell.map(|corner| {
            if names[corner as usize] == u32::MAX {
                names[corner as usize] = result.points.len() as u32;
                result.points.push(surface.points[corner as usize]);
            }
            names[corner as usize]
        }));
    }
    result
}

/// For every vertex a unit direction on the outer side of all its triangles, and its shortest edge.
fn directions(surface: &TriangleMesh) -> Result<(Vec<[f64; 3]>, Vec<f64>), String> {
    let mut around: Vec<Vec<[f64; 3]>> = vec![Vec::new(); surface.points.len()];
    let mut lengths = vec![f64::INFINITY; surface.points.len()];
    for (index, &cell) in surface.cells.iter().enumerate() {
        let corners = surface.corners(cell);
        let vector = area_vector(corners);
        let size = length(vector);
        if !(size > 0.0) {
            return Err(format!("triangle {index} of the surface has no area; remove it"));
        }
        for place in 0..3 {
            around[cell[place] as usize].push(vector.map(|coordinate| coordinate / size));
            let edge = length(subtract(corners[(place + 1) % 3], corners[place]));
            for end in [place, (place + 1) % 3] {
                let own = &mut lengths[cell[end] as usize];
                *own = own.min(edge);
            }
        }
    }
    let normalized = |vector: [f64; 3]| {
        let size = length(vector).max(f64::MIN_POSITIVE);
        vector.map(|coordinate| coordinate / size)
    };
    let mut normals = Vec::with_capacity(around.len());
    for (vertex, own) in around.iter().enumerate() {
        let sum = own.iter().fold([0.0; 3], |sum, &normal| add_scaled(sum, normal, 1.0));
        let mut direction = normalized(sum);
        // Turned towards the triangle it leaves least, until it leaves all of them.
        let worst = |direction: [f64; 3]| {
            let steepness = own.iter().map(|&normal| (dot(direction, normal), normal));
            steepness.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((1.0, direction))
        };
        for _ in 0..200 {
            let (least, normal) = worst(direction);
            if least > 0.2 {
                break;
            }
            direction = normalized(add_scaled(direction, normal, 0.2));
        }
        if !(worst(direction).0 > 0.0) {
            let place = surface.points[vertex];
            return Err(format!(
                "no direction leaves the surface on one side at {place:.4?}; smooth it there"
            ));
        }
        normals.push(direction);
    }
    Ok((normals, lengths))
}

/// Columns of a prism of this height over the shape of a triangle.
fn reference([a, b, c]: [[f64; 3]; 3], height: f64) -> Columns<f64> {
    let (u, v) = (subtract(b, a), subtract(c, a));
    let base = length(u);
    let along = dot(u, v) / base;
    [
        [base, 0.0, 0.0],
        [along, length(cross(u, v)) / base, 0.0],
        [0.0, 0.0, height],
    ]
}

/// Prisms with a determinant at a corner that is not positive.
fn inverted(mesh: &MixedMesh) -> usize {
    let bad = mesh.iter().filter(|(shape, corners)| {
        let at = |corner: usize| mesh.points[corners[corner] as usize];
        let frames = shape.corner_frames().iter().enumerate();
        frames
            .map(|(corner, ends)| mesh::determinant([at(corner), at(ends[0]), at(ends[1]), at(ends[2])]))
            .any(|determinant| !(determinant > 0.0))
    });
    bad.count()
}

/// Lets the layers take their thickness.
pub(super) fn run(
    fit: &mut Fit<'_>,
    shell: &Shell,
    observer: &mut dyn Observer,
) -> Result<(StopReason, String), Failure> {
    let mut outcome = (StopReason::Converged, String::new());
    let stages = fit.settings.stages.clone();
    for (place, &stage) in stages.iter().enumerate() {
        // Phases that differ in lambda alone are one here.
        if stages.get(place + 1).is_some_and(|next| next.order == stage.order) {
            continue;
        }
        let orders: Vec<usize> = fit.space.orders.iter().map(|&order| order.max(stage.order)).collect();
        fit.raise(&orders)?;
        let chart = Chart::fixing(&fixed(fit, shell), &fit.x);
        let free = (0..fit.space.nodes).filter(|&node| !chart.map.row(node).is_empty());
        let mut unknowns: Vec<f64> = free.flat_map(|node| fit.x[3 * node..3 * node + 3].to_vec()).collect();
        let stage = Stage { lambda: 1.0, ..stage };
        outcome = fit.stage_over(&stage, Some((&chart, &mut unknowns)), observer)?;
        if super::fit::interrupted(outcome.0) {
            break;
        }
    }
    Ok(outcome)
}

/// Nodes on the surface: its vertices, and edges and faces between them.
fn fixed(fit: &Fit<'_>, shell: &Shell) -> Vec<bool> {
    let mut fixed = vec![false; fit.space.nodes];
    let on_base = |corner: &u32| (*corner as usize) < shell.base;
    fixed[..shell.base].fill(true);
    for (place, edge) in fit.topology.edges.iter().enumerate() {
        if edge.iter().all(on_base) {
            let (start, order) = fit.space.edge(place);
            fixed[start..start + order - 1].fill(true);
        }
    }
    for (place, face) in fit.topology.faces.iter().enumerate() {
        if face.corners().iter().all(on_base) {
            let (start, order) = fit.space.face(place);
            let nodes = crate::fem::functions::triangle_inside(order).len();
            fixed[start..start + nodes].fill(true);
        }
    }
    fixed
}

/// How far the distances of the outermost vertices from the surface are from the prescribed one.
pub fn measure(shell: &Shell, x: &[f64], metrics: &mut BTreeMap<String, f64>) {
    let places = x.as_chunks::<3>().0;
    let outer: Vec<[f64; 3]> = shell.outer.iter().map(|&vertex| places[vertex as usize]).collect();
    let distances = distance::of_points(&outer, &ClosestPoint::new(&shell.surface));
    let errors: Vec<f64> = distances
        .iter()
        .map(|found| 100.0 * (found - shell.distance).abs() / shell.distance)
        .collect();
    let count = errors.len() as f64;
    let square = errors.iter().map(|error| error * error).sum::<f64>() / count;
    metrics.insert("thickness_error_mean".to_string(), errors.iter().sum::<f64>() / count);
    metrics.insert("thickness_error_rms".to_string(), square.sqrt());
    metrics.insert(
        "thickness_error_max".to_string(),
        errors.iter().copied().fold(0.0, f64::max),
    );
}
