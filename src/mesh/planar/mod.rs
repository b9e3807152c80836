//! Triangle meshes of planar domains, each with an inner domain whose boundary runs along edges.
//!
//! A study of boundary value problems solves in the inner domain and takes the data from the band around it. Sizes are
//! given as cells per unit length, so a sequence of meshes of one family is one parameter. Points have `z = 0`; triangles
//! run counter-clockwise. The same arguments give the same bits.
//!
//! Not guaranteed: that the edges of the inner boundary lie on a curved boundary; disks and annuli are polygons.

mod delaunay;
mod lattice;
mod polar;

use super::{TriangleMesh, area_vector};

/// A planar mesh with the triangles of its inner domain.
#[derive(Clone, Debug, PartialEq)]
pub struct Planar {
    pub mesh: TriangleMesh,
    /// Whether a triangle belongs to the inner domain.
    pub inside: Vec<bool>,
}

/// The outer and the inner domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Domain {
    Square,
    LShape,
    Disk,
    Annulus,
}

/// Name and geometry of every domain.
pub const DOMAINS: &[(Domain, &str, &str)] = &[
    (Domain::Square, "square", "[-1, 1]^2 around [-1/2, 1/2]^2"),
    (
        Domain::LShape,
        "l-shape",
        "[-1, 1]^2 around [-1/2, 1/2]^2 without its upper right quarter",
    ),
    (
        Domain::Disk,
        "disk",
        "the disk of radius 1 around the concentric disk of radius 1/2",
    ),
    (
        Domain::Annulus,
        "annulus",
        "the ring of radii 1/4 and 5/4 around the ring of radii 1/2 and 1",
    ),
];

/// How the triangles of a mesh are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    Regular,
    Equi,
    UnionJack,
    CrissCross,
    CentroidSplit,
    Perturbed,
    MinimumAngle30,
    MinimumAngle1,
}

/// Name and layout of every family.
pub const FAMILIES: &[(Family, &str, &str)] = &[
    (
        Family::Regular,
        "regular",
        "a grid of cells, each cut along the same diagonal; concentric rings on a disk",
    ),
    (
        Family::Equi,
        "equi",
        "rows of points, every second one shifted by half a cell: triangles close to equilateral",
    ),
    (
        Family::UnionJack,
        "union-jack",
        "a grid of cells with alternating diagonals; its vertices have 4 or 8 edges (the 4-8 mesh)",
    ),
    (
        Family::CrissCross,
        "criss-cross",
        "a grid of cells, each cut along both diagonals",
    ),
    (
        Family::CentroidSplit,
        "centroid-split",
        "the regular mesh with every triangle split at its centroid: vertices have 3 or 12 edges",
    ),
    (
        Family::Perturbed,
        "perturbed",
        "the grid's points moved at random by at most a fifth of a cell, Delaunay triangulation",
    ),
    (
        Family::MinimumAngle30,
        "minimum-angle-30",
        "points moved at random by at most 0.45 of a cell, Delaunay refinement to angles of 30 degrees at least",
    ),
    (
        Family::MinimumAngle1,
        "minimum-angle-1",
        "points moved at random by at most 0.45 of a cell, Delaunay refinement to angles of 1 degree at least",
    ),
];

impl Family {
    /// Whether a seed makes a difference.
    pub fn is_random(self) -> bool {
        matches!(self, Self::Perturbed | Self::MinimumAngle30 | Self::MinimumAngle1)
    }

    /// Largest displacement of a point, in cells.
    fn amplitude(self) -> f64 {
        match self {
            Self::Perturbed => 0.2,
            _ => 0.45,
        }
    }

    /// The angle in degrees that refinement reaches.
    fn minimum_angle(self) -> Option<f64> {
        match self {
            Self::MinimumAngle30 => Some(30.0),
            Self::MinimumAngle1 => Some(1.0),
            _ => None,
        }
    }
}

/// Meshes a domain: `cells` per unit length, an even number so that the inner boundary runs along edges.
///
/// # Errors
/// When `cells` is odd or below 2, when the family does not exist on the domain, or when the mesh would be too large.
pub fn generate(domain: Domain, family: Family, cells: usize, seed: u64) -> Result<Planar, String> {
    if cells < 2 || cells % 2 == 1 {
        return Err(format!(
            "{cells} cells a unit do not meet the inner boundary; take an even number, 4 or more"
        ));
    }
    if cells > 2048 {
        return Err(format!("{cells} cells a unit are too many; take 2048 at most"));
    }
    match domain {
        Domain::Square | Domain::LShape => {
            let mesh = lattice::mesh(domain, family, cells, seed)?;
            let inside = inside(&mesh, |x, y| {
                let square = x.abs().max(y.abs()) < 0.5;
                square && (domain == Domain::Square || !(x > 0.0 && y > 0.0))
            });
            Ok(Planar { mesh, inside })
        }
        Domain::Disk | Domain::Annulus => polar::planar(domain, family, cells, seed),
    }
}

/// Triangles whose centroid satisfies a condition.
fn inside(mesh: &TriangleMesh, within: impl Fn(f64, f64) -> bool) -> Vec<bool> {
    mesh.cells
        .iter()
        .map(|&cell| {
            let corners = mesh.corners(cell);
            let mean = |axis: usize| corners.iter().map(|corner| corner[axis]).sum::<f64>() / 3.0;
            within(mean(0), mean(1))
        })
        .collect()
}

/// Splits every triangle at its centroid.
fn split_at_centroids(planar: Planar) -> Planar {
    let Planar { mut mesh, inside } = planar;
    let mut cells = Vec::with_capacity(3 * mesh.cells.len());
    for &cell in &mesh.cells {
        let corners = mesh.corners(cell);
        let centroid = std::array::from_fn(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / 3.0);
        let middle = mesh.points.len() as u32;
        mesh.points.push(centroid);
        for side in 0..3 {
            cells.push([cell[side], cell[(side + 1) % 3], middle]);
        }
    }
    mesh.cells = cells;
    let inside = inside.iter().flat_map(|&within| [within; 3]).collect();
    Planar { mesh, inside }
}

/// Turns triangles that run clockwise.
fn orient(mesh: &mut TriangleMesh) {
    for index in 0..mesh.cells.len() {
        let cell = mesh.cells[index];
        if area_vector(mesh.corners(cell))[2] < 0.0 {
            mesh.cells[index] = [cell[0], cell[2], cell[1]];
        }
    }
}

/// Random numbers that depend on the seed alone (splitmix64, Steele et al. 2014).
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        Self(seed ^ 0x05EE_D0F7_A91A_5000)
    }

    /// Uniform within `[-1, 1)`.
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^= bits >> 31;
        (bits >> 11) as f64 * (2.0 / (1u64 << 53) as f64) - 1.0
    }
}

/// Triangulates a convex polygon, counter-clockwise, with points of a triangular grid of the given spacing within. The
/// polygon's corners come first and stay its only boundary points.
///
/// # Errors
/// When the polygon crosses itself or is too large for its spacing.
pub fn fill_polygon(polygon: &[[f64; 2]], spacing: f64) -> Result<TriangleMesh, String> {
    let reach = polygon.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
    if !(spacing > 0.0 && reach / spacing < 5000.0) {
        return Err(format!(
            "a patch of radius {reach:e} with edges of {spacing:e} would have too many triangles"
        ));
    }
    let count = polygon.len();
    let mut points = polygon.to_vec();
    let rows = (reach / (spacing * 0.75f64.sqrt())).ceil() as i64;
    for row in -rows..=rows {
        let y = row as f64 * spacing * 0.75f64.sqrt();
        let shift = if row.rem_euclid(2) == 0 { 0.0 } else { 0.5 };
        let columns = (reach / spacing).ceil() as i64 + 1;
        for column in -columns..=columns {
            let x = (column as f64 + shift) * spacing;
            // Clear of every side, whose triangles would be thin otherwise.
            let clear = (0..count).all(|side| {
                let (a, b) = (polygon[side], polygon[(side + 1) % count]);
                let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
                dx * (y - a[1]) - dy * (x - a[0]) > 0.6 * spacing * dx.hypot(dy)
            });
            if clear {
                points.push([x, y]);
            }
        }
    }
    let sides: Vec<[usize; 2]> = (0..count).map(|side| [side, (side + 1) % count]).collect();
    delaunay::triangulate(points, &sides, None)
}
