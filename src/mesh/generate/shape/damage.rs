//! What scanners and careless exporters do to a surface: holes, flipped and degenerate triangles, soups, overlapping
//! scans, fins, noise.

use super::super::{Arguments, Parameter, SplitMix};
use crate::mesh::{TriangleMesh, area_vector, diagonal, length, subtract};

/// The parameters that every target shape has besides its own.
pub const PARAMETERS: [Parameter; 8] = [
    Parameter {
        name: "noise",
        whole: false,
        default: 0.0,
        min: 0.0,
        max: 0.2,
        doc: "random displacement of the vertices in any direction, as a fraction of the diagonal",
    },
    count("holes", "round holes, each of 3 % of the diagonal in radius"),
    share("flipped", "fraction of the triangles that are turned over"),
    count(
        "degenerate",
        "triangles without area or as thin as a needle that are added",
    ),
    count("fins", "triangles that stand on an edge, which then has three of them"),
    count(
        "scans",
        "overlapping patches, slightly displaced, that replace the surface",
    ),
    Parameter {
        name: "soup",
        whole: true,
        default: 0.0,
        min: 0.0,
        max: 1.0,
        doc: "1 gives every triangle its own vertices",
    },
    Parameter {
        name: "seed",
        whole: true,
        default: 0.0,
        min: 0.0,
        max: 9_007_199_254_740_991.0,
        doc: "start of the random numbers behind the damage",
    },
];

const fn count(name: &'static str, doc: &'static str) -> Parameter {
    Parameter {
        name,
        whole: true,
        default: 0.0,
        min: 0.0,
        max: 10_000.0,
        doc,
    }
}

const fn share(name: &'static str, doc: &'static str) -> Parameter {
    Parameter {
        name,
        whole: false,
        default: 0.0,
        min: 0.0,
        max: 1.0,
        doc,
    }
}

/// Does the damage that the arguments ask for. Random numbers are drawn for each kind apart, so that one kind does not
/// change another.
pub fn damage(mesh: &mut TriangleMesh, arguments: &Arguments) {
    let size = diagonal(&mesh.points);
    let seed = arguments.number("seed") as u64;
    let random = |kind: u64| SplitMix(seed.wrapping_mul(0x2545_f491_4f6c_dd1d).wrapping_add(kind));
    scan(mesh, arguments.number("scans") as usize, size, random(1));
    pierce(mesh, arguments.number("holes") as usize, 0.03 * size, random(2));
    let noise = arguments.number("noise") * size;
    if noise > 0.0 {
        let mut random = random(3);
        for x in mesh.points.as_flattened_mut() {
            *x += noise * (2.0 * random.unit() - 1.0);
        }
    }
    let flipped = arguments.number("flipped");
    if flipped > 0.0 {
        let mut random = random(4);
        for cell in &mut mesh.cells {
            if random.unit() < flipped {
                cell.swap(1, 2);
            }
        }
    }
    let mut numbers = random(5);
    for kind in 0..arguments.number("degenerate") as usize {
        let [a, b, _] = mesh.cells[pick(&mut numbers, mesh.cells.len())];
        if kind % 2 == 0 {
            mesh.cells.push([a, b, b]);
        } else {
            // On the edge but for the last digits.
            let [p, q] = [a, b].map(|vertex| mesh.points[vertex as usize]);
            let middle = std::array::from_fn(|axis| p[axis] + 0.3 * (q[axis] - p[axis]) + 1e-13 * size);
            mesh.cells.push([a, b, mesh.points.len() as u32]);
            mesh.points.push(middle);
        }
    }
    let mut numbers = random(6);
    for _ in 0..arguments.number("fins") as usize {
        let cell = mesh.cells[pick(&mut numbers, mesh.cells.len())];
        let corners = mesh.corners(cell);
        let normal = area_vector(corners);
        let area = length(normal);
        if area > 0.0 {
            let height = 0.5 * length(subtract(corners[1], corners[0])) / area;
            let tip = std::array::from_fn(|axis| 0.5 * (corners[0][axis] + corners[1][axis]) + height * normal[axis]);
            mesh.cells.push([cell[0], cell[1], mesh.points.len() as u32]);
            mesh.points.push(tip);
        }
    }
    if arguments.number("soup") > 0.0 {
        let points = mesh
            .cells
            .iter()
            .flatten()
            .map(|&vertex| mesh.points[vertex as usize])
            .collect();
        mesh.cells = (0..mesh.cells.len() as u32)
            .map(|cell| [3 * cell, 3 * cell + 1, 3 * cell + 2])
            .collect();
        mesh.points = points;
    }
}

fn pick(random: &mut SplitMix, count: usize) -> usize {
    ((random.unit() * count as f64) as usize).min(count - 1)
}

/// Takes away the triangles within `radius` of random vertices; the last triangle stays.
fn pierce(mesh: &mut TriangleMesh, holes: usize, radius: f64, mut random: SplitMix) {
    for _ in 0..holes {
        let centre = mesh.points[mesh.cells[pick(&mut random, mesh.cells.len())][0] as usize];
        let outside = |cell: &[u32; 3]| {
            cell.iter()
                .any(|&vertex| length(subtract(mesh.points[vertex as usize], centre)) > radius)
        };
        let kept: Vec<[u32; 3]> = mesh.cells.iter().copied().filter(outside).collect();
        if !kept.is_empty() {
            mesh.cells = kept;
        }
    }
}

/// Replaces a surface by patches as seen from random directions, each with vertices of its own and displaced by up to
/// 0.2 % of the diagonal. What no direction sees is missing.
fn scan(mesh: &mut TriangleMesh, scans: usize, size: f64, mut random: SplitMix) {
    if scans == 0 {
        return;
    }
    let whole = std::mem::take(mesh);
    for _ in 0..scans {
        let direction = loop {
            let candidate: [f64; 3] = std::array::from_fn(|_| 2.0 * random.unit() - 1.0);
            let norm = length(candidate);
            if norm > 0.1 && norm <= 1.0 {
                break candidate.map(|x| x / norm);
            }
        };
        let shift: [f64; 3] = std::array::from_fn(|_| 0.002 * size * (2.0 * random.unit() - 1.0));
        let first = mesh.points.len() as u32;
        mesh.points.extend(
            whole
                .points
                .iter()
                .map(|point| -> [f64; 3] { std::array::from_fn(|axis| point[axis] + shift[axis]) }),
        );
        for &cell in &whole.cells {
            let normal = area_vector(whole.corners(cell));
            // What is seen at less than 70 degrees from the front.
            if crate::mesh::dot(normal, direction) > 0.34 * length(normal) {
                mesh.cells.push(cell.map(|vertex| first + vertex));
            }
        }
    }
    if mesh.cells.is_empty() {
        *mesh = whole;
        return;
    }
    let mut surface = crate::mesh::surface::Surface {
        points: std::mem::take(&mut mesh.points),
        triangles: std::mem::take(&mut mesh.cells),
        quads: Vec::new(),
    };
    surface.drop_unused();
    mesh.points = surface.points;
    mesh.cells = surface.triangles;
}
