//! What is drawn of a result mesh: points, simplices and a value of each field on each simplex.
//!
//! Cells of other kinds are split into tetrahedra or triangles, the same way from both sides of a shared face.

use crate::mesh::format::{CellKind, Content};

/// A mesh to draw.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    pub points: Vec<[f64; 3]>,
    /// The points before the map, where the mesh is an image.
    pub source: Option<Vec<[f64; 3]>>,
    pub tetrahedra: Vec<[u32; 4]>,
    /// Cells of a surface; empty where there are tetrahedra.
    pub triangles: Vec<[u32; 3]>,
    pub fields: Vec<Field>,
    /// Whether the cell is inverted, one for each simplex.
    pub inverted: Vec<bool>,
    /// Edges of simplices that are diagonals of quadrilateral faces and no edges of cells: corners ascending, sorted.
    pub diagonals: Vec<[u32; 2]>,
}

/// One value for each simplex.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    pub name: String,
    pub values: Vec<f64>,
}

/// The name of the field that marks inverted cells with 1.
const INVERTED: &str = "inverted";
/// The name of the point field with the coordinates before the map.
const SOURCE: &str = "source";

impl Solid {
    /// Takes the volume cells of a file, or its surface cells where it has no volume.
    pub fn from_content(content: &Content) -> Solid {
        let mut solid = Solid {
            points: content.points.clone(),
            ..Solid::default()
        };
        if let Some(source) = content
            .point_data
            .iter()
            .find(|field| field.name == SOURCE && field.components == 3)
        {
            solid.source = Some(
                source
                    .values
                    .chunks_exact(3)
                    .map(|point| [point[0], point[1], point[2]])
                    .collect(),
            );
        }
        let cells = content.cells();
        let count = |kind| cells.count_of(kind);
        let volume = [
            CellKind::Tetrahedron,
            CellKind::Hexahedron,
            CellKind::Prism,
            CellKind::Pyramid,
        ];
        let surface = count(CellKind::Triangle) + count(CellKind::Quad);
        let mut owners: Vec<usize> = Vec::new();
        if volume.iter().any(|kind| count(*kind) > 0) {
            let all = (content.tetrahedra.iter().map(|cell| (&cell[..], TETRAHEDRON)))
                .chain(content.hexahedra.iter().map(|cell| (&cell[..], HEXAHEDRON)))
                .chain(content.prisms.iter().map(|cell| (&cell[..], PRISM)))
                .chain(content.pyramids.iter().map(|cell| (&cell[..], PYRAMID)));
            for (index, (cell, faces)) in all.enumerate() {
                if cell.len() == 4 {
                    solid.tetrahedra.push([cell[0], cell[1], cell[2], cell[3]]);
                } else {
                    split(cell, faces, &mut solid.tetrahedra);
                    let quads = faces.iter().filter(|face| face.len() == 4);
                    let corners = quads.map(|face| [0, 1, 2, 3].map(|corner| cell[face[corner]]));
                    solid.diagonals.extend(corners.map(diagonal));
                }
                owners.resize(solid.tetrahedra.len(), surface + index);
            }
        } else {
            for (index, cell) in content.triangles.iter().enumerate() {
                solid.triangles.push(*cell);
                owners.push(index);
            }
            for (index, cell) in content.quads.iter().enumerate() {
                solid.triangles.extend(halves(*cell));
                solid.diagonals.push(diagonal(*cell));
                owners.resize(solid.triangles.len(), content.triangles.len() + index);
            }
        }
        solid.diagonals.sort_unstable();
        solid.diagonals.dedup();
        for field in content.cell_data.iter().filter(|field| field.components == 1) {
            let value = |&owner: &usize| field.values.get(owner).copied().unwrap_or(f64::NAN);
            let values: Vec<f64> = owners.iter().map(value).collect();
            if field.name == INVERTED {
                solid.inverted = values.iter().map(|value| *value == 1.0).collect();
            } else {
                solid.fields.push(Field {
                    name: field.name.clone(),
                    values,
                });
            }
        }
        solid.inverted.resize(owners.len(), false);
        solid
    }

    /// Whether two corners of a simplex are joined by an edge of a cell.
    pub fn is_edge(&self, from: u32, to: u32) -> bool {
        self.diagonals.binary_search(&[from.min(to), from.max(to)]).is_err()
    }

    pub fn is_volume(&self) -> bool {
        !self.tetrahedra.is_empty()
    }

    /// The number of simplices.
    pub fn count(&self) -> usize {
        if self.is_volume() {
            self.tetrahedra.len()
        } else {
            self.triangles.len()
        }
    }
}

type Faces = &'static [&'static [usize]];

const TETRAHEDRON: Faces = &[];
const HEXAHEDRON: Faces = &[
    &[0, 1, 5, 4],
    &[1, 2, 6, 5],
    &[2, 3, 7, 6],
    &[3, 0, 4, 7],
    &[0, 3, 2, 1],
    &[4, 5, 6, 7],
];
const PRISM: Faces = &[&[0, 1, 2], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];
const PYRAMID: Faces = &[&[0, 1, 2, 3], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];

/// Splits a quad at the diagonal through its lowest number, which both neighbours find alike.
fn halves(quad: [u32; 4]) -> [[u32; 3]; 2] {
    let lowest = (0..4).min_by_key(|&corner| quad[corner]).unwrap_or(0);
    let at = |offset: usize| quad[(lowest + offset) % 4];
    [[at(0), at(1), at(2)], [at(0), at(2), at(3)]]
}

/// The diagonal at which [`halves`] splits, corners ascending.
fn diagonal(quad: [u32; 4]) -> [u32; 2] {
    let [[from, _, to], _] = halves(quad);
    [from.min(to), from.max(to)]
}

/// Joins the lowest corner of a cell with every triangle of the faces that do not touch it.
fn split(cell: &[u32], faces: Faces, tetrahedra: &mut Vec<[u32; 4]>) {
    let apex = cell.iter().copied().min().unwrap_or(0);
    for face in faces {
        let corners: Vec<u32> = face.iter().map(|&corner| cell[corner]).collect();
        if corners.contains(&apex) {
            continue;
        }
        match *corners.as_slice() {
            [a, b, c] => tetrahedra.push([a, b, c, apex]),
            [a, b, c, d] => tetrahedra.extend(halves([a, b, c, d]).map(|[a, b, c]| [a, b, c, apex])),
            _ => {}
        }
    }
}
