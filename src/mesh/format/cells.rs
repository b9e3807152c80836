//! Cells of several kinds: their names and sizes, a borrowed view of them, and sorting a file's cells by kind.

use super::{Content, Fault, Field};
use std::collections::BTreeMap;

/// A kind of cell, in the order in which [`Content`] lists them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CellKind {
    Triangle,
    Quad,
    Tetrahedron,
    Hexahedron,
    Prism,
    Pyramid,
}

impl CellKind {
    /// All kinds, in the order of [`Content`].
    pub const ALL: [CellKind; 6] = [
        CellKind::Triangle,
        CellKind::Quad,
        CellKind::Tetrahedron,
        CellKind::Hexahedron,
        CellKind::Prism,
        CellKind::Pyramid,
    ];
    /// The kinds that a surface is made of.
    pub const SURFACE: [CellKind; 2] = [CellKind::Triangle, CellKind::Quad];

    /// The number of corners.
    pub fn corners(self) -> usize {
        match self {
            CellKind::Triangle => 3,
            CellKind::Quad | CellKind::Tetrahedron => 4,
            CellKind::Pyramid => 5,
            CellKind::Prism => 6,
            CellKind::Hexahedron => 8,
        }
    }

    /// The name of one such cell.
    pub fn name(self) -> &'static str {
        match self {
            CellKind::Triangle => "triangle",
            CellKind::Quad => "quad",
            CellKind::Tetrahedron => "tetrahedron",
            CellKind::Hexahedron => "hexahedron",
            CellKind::Prism => "prism",
            CellKind::Pyramid => "pyramid",
        }
    }

    /// The name of several such cells.
    pub fn plural(self) -> &'static str {
        match self {
            CellKind::Triangle => "triangles",
            CellKind::Quad => "quads",
            CellKind::Tetrahedron => "tetrahedra",
            CellKind::Hexahedron => "hexahedra",
            CellKind::Prism => "prisms",
            CellKind::Pyramid => "pyramids",
        }
    }
}

/// Cells of all kinds, borrowed: `Cells { tetrahedra: &mesh.cells, ..Cells::default() }`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cells<'a> {
    pub triangles: &'a [[u32; 3]],
    pub quads: &'a [[u32; 4]],
    pub tetrahedra: &'a [[u32; 4]],
    pub hexahedra: &'a [[u32; 8]],
    pub prisms: &'a [[u32; 6]],
    pub pyramids: &'a [[u32; 5]],
}

impl<'a> Cells<'a> {
    /// The number of cells of all kinds.
    pub fn count(&self) -> usize {
        CellKind::ALL.iter().map(|&kind| self.count_of(kind)).sum()
    }

    /// The number of cells of one kind.
    pub fn count_of(&self, kind: CellKind) -> usize {
        self.corners_of(kind).len() / kind.corners()
    }

    /// The corners of all cells of one kind, one cell after the other.
    pub fn corners_of(&self, kind: CellKind) -> &'a [u32] {
        match kind {
            CellKind::Triangle => self.triangles.as_flattened(),
            CellKind::Quad => self.quads.as_flattened(),
            CellKind::Tetrahedron => self.tetrahedra.as_flattened(),
            CellKind::Hexahedron => self.hexahedra.as_flattened(),
            CellKind::Prism => self.prisms.as_flattened(),
            CellKind::Pyramid => self.pyramids.as_flattened(),
        }
    }

    /// All cells with their kinds, in the order of [`Content`].
    pub fn iter(&self) -> impl Iterator<Item = (CellKind, &'a [u32])> + use<'a> {
        let cells = *self;
        CellKind::ALL.into_iter().flat_map(move |kind| {
            cells
                .corners_of(kind)
                .chunks_exact(kind.corners())
                .map(move |corners| (kind, corners))
        })
    }

    /// Whether every corner is one of `points` points.
    ///
    /// # Errors
    /// Names the first cell for which it is not so.
    pub fn check(&self, points: usize) -> Result<(), String> {
        for kind in CellKind::ALL {
            let corners = self.corners_of(kind);
            if let Some(bad) = corners.iter().position(|&corner| corner as usize >= points) {
                return Err(format!(
                    "{} {} names point {}, but there are {points} points (from 0)",
                    kind.name(),
                    bad / kind.corners(),
                    corners[bad]
                ));
            }
        }
        Ok(())
    }
}

/// The most by which splitting polygons may multiply the data of cells.
const MOST_REPEATED: usize = 64;

/// Sorts cells by kind as a file lists them, and their data with them.
#[derive(Default)]
pub(super) struct Sorter {
    content: Content,
    /// For each kind, the row of the file's cell data that belongs to each of its cells.
    rows: [Vec<u32>; 6],
    row: u32,
    left_out: BTreeMap<&'static str, usize>,
    split: usize,
}

impl Sorter {
    /// The next cell of the file.
    pub(super) fn cell(&mut self, kind: CellKind, corners: &[u32]) {
        self.push(kind, corners);
        self.row += 1;
    }

    /// The next cell of the file, a polygon; one with more than four corners becomes a fan about its first one.
    ///
    /// # Errors
    /// When it has fewer than three corners; `at` is where it stands.
    pub(super) fn polygon(&mut self, corners: &[u32]) -> Result<(), String> {
        match corners.len() {
            0..=2 => {
                return Err(format!(
                    "a polygon has {} corners; it needs three or more",
                    corners.len()
                ));
            }
            3 => self.push(CellKind::Triangle, corners),
            4 => self.push(CellKind::Quad, corners),
            _ => {
                for pair in corners[1..].windows(2) {
                    self.push(CellKind::Triangle, &[corners[0], pair[0], pair[1]]);
                }
                self.split += 1;
            }
        }
        self.row += 1;
        Ok(())
    }

    /// The next cell of the file, of a kind that is not kept; `name` is its plural.
    pub(super) fn leave_out(&mut self, name: &'static str) {
        *self.left_out.entry(name).or_default() += 1;
        self.row += 1;
    }

    /// How many cells of the file have been seen.
    pub(super) fn seen(&self) -> usize {
        self.row as usize
    }

    /// Whether a cell names a point beyond the first `points` ones.
    pub(super) fn names_beyond(&self, points: usize) -> bool {
        self.content.cells().check(points).is_err()
    }

    fn push(&mut self, kind: CellKind, corners: &[u32]) {
        let content = &mut self.content;
        let known = match kind {
            CellKind::Triangle => corners.try_into().map(|cell| content.triangles.push(cell)),
            CellKind::Quad => corners.try_into().map(|cell| content.quads.push(cell)),
            CellKind::Tetrahedron => corners.try_into().map(|cell| content.tetrahedra.push(cell)),
            CellKind::Hexahedron => corners.try_into().map(|cell| content.hexahedra.push(cell)),
            CellKind::Prism => corners.try_into().map(|cell| content.prisms.push(cell)),
            CellKind::Pyramid => corners.try_into().map(|cell| content.pyramids.push(cell)),
        };
        debug_assert!(known.is_ok(), "a reader passes as many corners as the kind has");
        if known.is_ok() {
            self.rows[kind as usize].push(self.row);
        }
    }

    /// The cells beside `points`, the data of cells (one row a cell of the file) in their new order, and notices.
    ///
    /// # Errors
    /// When a corner is none of the points, or a field has not as many rows as the file has cells. Readers check the
    /// former themselves where they can name the line.
    pub(super) fn finish(
        self,
        points: Vec<[f64; 3]>,
        point_data: Vec<Field>,
        cell_data: Vec<Field>,
    ) -> Result<Content, Fault> {
        let mut content = self.content;
        content.points = points;
        content.cells().check(content.points.len()).map_err(Fault::whole)?;
        for field in &point_data {
            if field.values.len() != content.points.len() * field.components {
                return Err(Fault::whole(format!(
                    "the point field {:?} holds {} numbers; {} points with {} each need more or fewer",
                    field.name,
                    field.values.len(),
                    content.points.len(),
                    field.components
                )));
            }
        }
        content.point_data = point_data;
        // A fan repeats the row of its polygon; a hostile file could ask for far more than it holds.
        let given: usize = cell_data.iter().map(|field| field.values.len()).sum();
        let wanted: usize = cell_data
            .iter()
            .map(|field| field.components.saturating_mul(content.cells().count()))
            .sum();
        if wanted > MOST_REPEATED * (given + content.cells().count() + 1024) {
            return Err(Fault::whole(
                "the data of polygons would be repeated too often when they are split; split them in the program that wrote the file",
            ));
        }
        for mut field in cell_data {
            if field.values.len() != self.row as usize * field.components {
                return Err(Fault::whole(format!(
                    "the cell field {:?} holds {} numbers; {} cells with {} each need more or fewer",
                    field.name,
                    field.values.len(),
                    self.row,
                    field.components
                )));
            }
            let in_order = |rows: &[Vec<u32>; 6]| rows.iter().flatten().copied().eq(0..self.row);
            if !in_order(&self.rows) {
                let mut sorted = Vec::with_capacity(field.values.len());
                for &row in self.rows.iter().flatten() {
                    let start = row as usize * field.components;
                    sorted.extend_from_slice(&field.values[start..start + field.components]);
                }
                field.values = sorted;
            }
            content.cell_data.push(field);
        }
        for (name, count) in self.left_out {
            content.notices.push(format!("{name} left out: {count}"));
        }
        if self.split > 0 {
            content.notices.push(format!(
                "{} polygons with more than four corners split into triangles about their first corner",
                self.split
            ));
        }
        Ok(content)
    }
}
