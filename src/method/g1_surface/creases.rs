//! Creases of a model: edges at which the surface is continuous but its normal is not.
//!
//! The mesh is cut open along them, so that each side has normals of its own and its patches know nothing of the other
//! side; the curve along a crease is perpendicular to the normals of both sides and shared by both (see
//! [`network`](super::network)). Where a single crease ends within the surface its end has one normal, and the surface
//! is smooth around that vertex.
//!
//! Edges are creases when the generator says so, the model's list names them, their quads carry different labels in the
//! file or name different normals at their corners, or their planes meet at more than an angle.

use super::orientation;
use super::problem::Truth;
use super::settings::Settings;
use super::vertex_normals;
use crate::linalg::vector3::{add, dot, times};
use crate::mesh::crease;
use crate::mesh::format::Content;
use crate::mesh::quadrilateral::{Connectivity, QuadrilateralMesh};

/// What the cut remembers of the mesh before it.
#[derive(Clone, Debug)]
pub struct Creases {
    pub whole: QuadrilateralMesh,
    pub whole_connectivity: Connectivity,
    /// For every vertex its number before the cut.
    pub original: Vec<u32>,
    /// The two boundary edges that every crease edge has become.
    pub pairs: Vec<[u32; 2]>,
    /// Vertices at which three or more crease edges meet.
    pub corners: usize,
    /// Inner vertices at which one crease edge ends.
    pub darts: usize,
}

/// Where the model's creases come from.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    /// Edges known to the generator, or listed by the model; vertices from 0.
    pub listed: Vec<[u32; 2]>,
    /// A label for every quad.
    pub labels: Option<Vec<f64>>,
    /// The quads as they were read, and the normals that their corners name.
    pub corners: Option<CornerNormals>,
    /// Whether edges may have been halved by a split of the file's triangles since they were listed.
    pub halved: bool,
    /// Number of vertices in the file, to which listed edges refer.
    pub vertices: Option<usize>,
}

/// Normals at the corners of quads.
#[derive(Clone, Debug, Default)]
pub struct CornerNormals {
    pub quads: Vec<[u32; 4]>,
    pub normals: Vec<[[f64; 3]; 4]>,
}

/// Pairs of vertices, one a line, counted from 0; empty lines and what follows a `#` are passed over.
///
/// # Errors
/// Names the line of a malformed pair.
pub fn parse(text: &str, vertices: usize) -> Result<Vec<[u32; 2]>, String> {
    let mut pairs = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let content = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> = content.split_whitespace().collect();
        let &[first, second] = words.as_slice() else {
            if words.is_empty() {
                continue;
            }
            return Err(format!(
                "line {number}: {} words where two vertex numbers were expected; write one edge a line",
                words.len()
            ));
        };
        let mut pair = [0; 2];
        for (vertex, word) in pair.iter_mut().zip([first, second]) {
            *vertex = word
                .parse::<u32>()
                .ok()
                .filter(|&vertex| (vertex as usize) < vertices)
                .ok_or_else(|| {
                    format!(
                        "line {number}: `{word}` is no vertex; the mesh has {vertices} vertices, numbered from 0 to {}",
                        vertices.saturating_sub(1)
                    )
                })?;
        }
        pairs.push(pair);
    }
    Ok(pairs)
}

/// The labels of a file's quads, in the order of the quads that its mesh is made of.
///
/// # Errors
/// When there is no such field; the message lists those there are.
pub fn labels(content: &Content, field: &str) -> Result<Vec<f64>, String> {
    let found = content
        .cell_data
        .iter()
        .find(|candidate| candidate.name == field && candidate.components == 1);
    let Some(found) = found else {
        let known: Vec<&str> = content
            .cell_data
            .iter()
            .filter(|field| field.components == 1)
            .map(|field| field.name.as_str())
            .collect();
        return Err(if known.is_empty() {
            format!(
                "the cells have no field `{field}`, nor any other; add labels of the quadrilaterals, or leave out crease_field"
            )
        } else {
            format!(
                "the cells have no field `{field}` of one component; there are `{}`",
                known.join("`, `")
            )
        });
    };
    let (triangles, rest) = found.values.split_at(content.triangles.len());
    let quads = &rest[..content.quads.len()];
    if triangles.is_empty() {
        return Ok(quads.to_vec());
    }
    // A split makes four quads of each, then three of every triangle.
    let four = quads.iter().flat_map(|&label| [label; 4]);
    Ok(four.chain(triangles.iter().flat_map(|&label| [label; 3])).collect())
}

/// The sharp edges of a mesh.
///
/// # Errors
/// When a listed pair is no edge.
pub fn sharp(
    mesh: &QuadrilateralMesh,
    connectivity: &Connectivity,
    sources: &Sources,
    settings: &Settings,
) -> Result<Vec<bool>, String> {
    let mut listed = sources.listed.clone();
    if sources.halved {
        let mut halves = Vec::with_capacity(2 * listed.len());
        for pair in listed {
            let neighbours = |vertex: u32| {
                connectivity
                    .spokes(vertex as usize)
                    .map(move |edge| connectivity.other_end(edge, vertex))
            };
            match neighbours(pair[0]).find(|&middle| neighbours(pair[1]).any(|other| other == middle)) {
                Some(middle) => halves.extend([[pair[0], middle], [middle, pair[1]]]),
                None => halves.push(pair),
            }
        }
        listed = halves;
    }
    let mut sharp = crease::by_list(connectivity, &listed).map_err(|place| {
        let [a, b] = listed[place];
        format!("creases: vertices {a} and {b} (counted from 0) are no edge of the mesh; list edges between neighbours")
    })?;
    let mut add = |more: Vec<bool>| {
        for (mark, more) in sharp.iter_mut().zip(more) {
            *mark |= more;
        }
    };
    if let Some(labels) = &sources.labels {
        add(crease::by_label(connectivity, labels));
    }
    if let Some(corners) = &sources.corners {
        add(crease::by_corner_normals(
            connectivity,
            &corners.quads,
            &corners.normals,
        ));
    }
    if let Some(degrees) = settings.crease_angle {
        add(crease::by_angle(mesh, connectivity, degrees));
    }
    Ok(sharp)
}

/// Cuts the mesh along its sharp edges. Nothing comes back when there are none.
pub fn cut(
    mesh: &mut QuadrilateralMesh,
    connectivity: &mut Connectivity,
    sharp: Vec<bool>,
    notices: &mut Vec<String>,
) -> Option<Creases> {
    let found = crease::cut(mesh, connectivity, sharp);
    if let Some([a, b]) = found.lone.first() {
        notices.push(format!(
            "{} sharp edges, the first between vertices {a} and {b} (counted from 0), touch no other: with one normal at \
             either end they have no two sides and are taken as smooth",
            found.lone.len()
        ));
    }
    if found.creases.is_empty() {
        return None;
    }
    Some(Creases {
        whole: std::mem::replace(mesh, found.mesh),
        whole_connectivity: std::mem::replace(connectivity, found.connectivity),
        original: found.original,
        pairs: found.creases,
        corners: found.corners,
        darts: found.darts,
    })
}

/// Gives the vertices on creases a normal for each side: that of the side's formula where there is one, the mean of
/// those that the side's corners name in the file, else one estimated from the side's quads. Returns the number of
/// vertices, before the cut, at which normals were estimated.
///
/// # Errors
/// When no normal can be estimated.
pub fn normals_by_side(
    creases: &Creases,
    mesh: &QuadrilateralMesh,
    connectivity: &Connectivity,
    truth: Option<&Truth>,
    corners: Option<&CornerNormals>,
    normals: &mut [[f64; 3]],
) -> Result<usize, String> {
    let mut copies = vec![0u32; creases.whole.points.len()];
    for &vertex in &creases.original {
        copies[vertex as usize] += 1;
    }
    let on_crease = |vertex: usize| copies[creases.original[vertex] as usize] > 1;
    if let Some(Truth::Pieces(pieces)) = truth {
        for (quad, &piece) in mesh.quads.iter().zip(&pieces.piece_of) {
            for vertex in quad
                .map(|vertex| vertex as usize)
                .into_iter()
                .filter(|&vertex| on_crease(vertex))
            {
                normals[vertex] = pieces.pieces[piece as usize].normal(mesh.points[vertex]);
            }
        }
        return Ok(0);
    }
    if let Some(corners) = corners {
        for vertex in (0..normals.len()).filter(|&vertex| on_crease(vertex)) {
            normals[vertex] = [0.0; 3];
        }
        for (quad, (names, given)) in mesh.quads.iter().zip(corners.quads.iter().zip(&corners.normals)) {
            for vertex in quad
                .map(|vertex| vertex as usize)
                .into_iter()
                .filter(|&vertex| on_crease(vertex))
            {
                if let Some(corner) = names.iter().position(|&name| name == creases.original[vertex]) {
                    let size = dot(given[corner], given[corner]).sqrt().max(f64::MIN_POSITIVE);
                    normals[vertex] = add(normals[vertex], times(given[corner], 1.0 / size));
                }
            }
        }
        return Ok(0);
    }
    let estimated = vertex_normals::estimate(mesh, connectivity)?;
    // The given normals of a part may all point inward, which is mended later for all of them.
    let parts = orientation::parts(connectivity, Some(creases));
    let backward = orientation::backward(&mesh.points, &mesh.quads, normals, &parts, |vertex| !on_crease(vertex));
    for vertex in (0..normals.len()).filter(|&vertex| on_crease(vertex)) {
        normals[vertex] = times(estimated[vertex], if backward[vertex] { -1.0 } else { 1.0 });
    }
    Ok(copies.iter().filter(|&&copies| copies > 1).count())
}
