//! Meshes in flat arrays: triangle and quadrilateral surfaces, tetrahedral and mixed volumes, their connectivity,
//! generators, readers and writers.
//!
//! Nothing here opens a file: readers take bytes, writers take `std::io::Write`.

pub mod connectivity;
pub mod quality;
pub mod split;
pub mod check;
pub mod quadrilateral;
pub mod crease;
pub mod mixed;
pub mod curved;
pub mod summary;
pub mod linear_map;
pub mod surface;
pub mod catmull_clark;
pub mod multilinear_averaging;
pub mod generate;
pub mod planar;
pub mod band;
pub mod target;
pub mod template;
pub mod format;

/// A mesh of cells with `N` vertices each: `points` in model units, `cells` as indices into `points`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh<const N: usize> {
    pub points: Vec<[f64; 3]>,
    pub cells: Vec<[u32; N]>,
}

/// Triangles; a positive orientation is counter-clockwise seen from outside.
pub type TriangleMesh = Mesh<3>;
/// Tetrahedra (0,1,2,3), positively oriented when `det[x1-x0, x2-x0, x3-x0] > 0`.
pub type TetrahedralMesh = Mesh<4>;

/// `a - b`.
#[inline(always)]
pub(crate) fn subtract(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The scalar product.
#[inline(always)]
pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product.
#[inline(always)]
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// `a + factor b`.
pub(crate) fn add_scaled(a: [f64; 3], b: [f64; 3], factor: f64) -> [f64; 3] {
    [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]]
}

/// The Euclidean length.
#[inline(always)]
pub(crate) fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// Smallest axis-aligned box around the points, as lower and upper corner; `None` without points.
pub fn bounding_box(points: &[[f64; 3]]) -> Option<[[f64; 3]; 2]> {
    let first = *points.first()?;
    Some(points.iter().fold([first, first], |[low, high], point| {
        [
            std::array::from_fn(|axis| low[axis].min(point[axis])),
            std::array::from_fn(|axis| high[axis].max(point[axis])),
        ]
    }))
}

/// What to say of a template that lies elsewhere than its target or is of another size, in units in which the target's
/// box has the diagonal 1 and its centre at the origin.
pub fn far_off(template: &[[f64; 3]]) -> Option<String> {
    let [low, high] = bounding_box(template)?;
    let centre: [f64; 3] = std::array::from_fn(|axis| 0.5 * low[axis] + 0.5 * high[axis]);
    let (size, away) = (length(subtract(high, low)), length(centre));
    (!(0.25..=4.0).contains(&size) || away > 1.0).then(|| {
        format!(
            "template: its box is {size:.3e} times as large as the target's, its centre {away:.3e} of the target's diagonals \
             away; `place = \"box\"` puts it there"
        )
    })
}

/// Length of the diagonal of the bounding box; zero without points.
pub fn diagonal(points: &[[f64; 3]]) -> f64 {
    bounding_box(points).map_or(0.0, |[low, high]| length(subtract(high, low)))
}

impl<const N: usize> Mesh<N> {
    /// The points of one cell.
    pub fn corners(&self, cell: [u32; N]) -> [[f64; 3]; N] {
        cell.map(|vertex| self.points[vertex as usize])
    }
}

/// Six times the signed volume, `det[x1-x0, x2-x0, x3-x0]`.
pub fn determinant([a, b, c, d]: [[f64; 3]; 4]) -> f64 {
    dot(subtract(b, a), cross(subtract(c, a), subtract(d, a)))
}

/// Twice the oriented area: `(x1-x0) x (x2-x0)`.
pub fn area_vector([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    cross(subtract(b, a), subtract(c, a))
}

impl TetrahedralMesh {
    /// Signed volume of every tetrahedron.
    pub fn volumes(&self) -> Vec<f64> {
        self.cells
            .iter()
            .map(|&cell| determinant(self.corners(cell)) / 6.0)
            .collect()
    }

    /// Sum of the signed volumes.
    pub fn volume(&self) -> f64 {
        self.cells
            .iter()
            .map(|&cell| determinant(self.corners(cell)) / 6.0)
            .sum()
    }
}

impl TriangleMesh {
    /// Area of every triangle.
    pub fn areas(&self) -> Vec<f64> {
        self.cells
            .iter()
            .map(|&cell| length(area_vector(self.corners(cell))) / 2.0)
            .collect()
    }

    /// Sum of the areas.
    pub fn area(&self) -> f64 {
        self.cells
            .iter()
            .map(|&cell| length(area_vector(self.corners(cell))) / 2.0)
            .sum()
    }

    /// Volume enclosed by a closed surface, by the divergence theorem; positive for outward normals. Meaningless for an
    /// open surface.
    pub fn enclosed_volume(&self) -> f64 {
        // Measured from the first point, so that a distant origin costs no digits.
        let Some(&origin) = self.points.first() else { return 0.0 };
        self.cells
            .iter()
            .map(|&cell| {
                let [a, b, c] = self.corners(cell).map(|point| subtract(point, origin));
                dot(a, cross(b, c)) / 6.0
            })
            .sum()
    }
}
