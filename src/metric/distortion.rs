//! Distortion of a map of a tetrahedral mesh: of angles, of volumes, and what is inverted.
//!
//! The map is linear on every tetrahedron, with Jacobian J from the source to the image, signed singular values
//! s1 >= s2 >= |s3| and determinant D = s1 s2 s3. Averages weigh by source volume. Definitions of D_aa, D_ma, D_av and
//! D_mv: Jin, Huang, Tong 2015, Stretch-minimizing volumetric parameterization. The least value of all four is 2.
//!
//! Angle distortions do not change when source or image are scaled. Volume distortions do: as given they are at least
//! r + 1/r on average for a map with volume ratio r (Jensen), rescaled by r^(-1/3) they are at least 2.
//!
//! Guaranteed: the same bits with any number of threads. Where a tetrahedron is not positively oriented, volume
//! distortions are not-a-number, and angle distortions use |s3|.

use super::{Better, Metric};
use crate::linalg::svd3::signed_svd;
use crate::linalg::vector3::{Columns, cofactor, dot};
use crate::mesh::{TetrahedralMesh, length, subtract};
use rayon::prelude::*;

/// A determinant at most this times the product of edge lengths, image over source, is zero to rounding.
const FLAT: f64 = 1e-14;
/// Tetrahedra measured by one thread at a time.
const CHUNK: usize = 1024;

const fn metric(
    name: &'static str,
    symbol: &'static str,
    floor: Option<f64>,
    better: Better,
    definition: &'static str,
) -> Metric {
    Metric {
        name,
        symbol,
        unit: "",
        floor,
        better,
        definition,
    }
}

/// The metrics of a map that [`Distortion`] holds, in the order of reports.
pub const METRICS: &[Metric] = &[
    metric(
        "d_aa",
        "D_aa",
        Some(2.0),
        Better::Lower,
        "Average angle distortion: mean over the source volume of s1/s3 + s3/s1, s1 and s3 the largest and smallest \
         singular value of the Jacobian. Does not change with scale.",
    ),
    metric(
        "d_ma",
        "D_ma",
        Some(2.0),
        Better::Lower,
        "Maximum angle distortion: largest s1/s3 + s3/s1 of a tetrahedron. Does not change with scale.",
    ),
    metric(
        "d_av",
        "D_av",
        Some(2.0),
        Better::Lower,
        "Average volume distortion: mean over the source volume of det J + 1/det J, in the units of the files. At least \
         r + 1/r for a volume ratio r. Undefined where a tetrahedron is inverted.",
    ),
    metric(
        "d_mv",
        "D_mv",
        Some(2.0),
        Better::Lower,
        "Maximum volume distortion: largest det J + 1/det J of a tetrahedron, in the units of the files. Undefined where \
         a tetrahedron is inverted.",
    ),
    metric(
        "d_av_rescaled",
        "D_av'",
        Some(2.0),
        Better::Lower,
        "Average volume distortion after the source is scaled to the volume of the target.",
    ),
    metric(
        "d_mv_rescaled",
        "D_mv'",
        Some(2.0),
        Better::Lower,
        "Maximum volume distortion after the source is scaled to the volume of the target.",
    ),
    metric(
        "inverted",
        "N_inv",
        Some(0.0),
        Better::Lower,
        "Number of tetrahedra whose determinant is not positive.",
    ),
    metric(
        "degenerate",
        "N_flat",
        Some(0.0),
        Better::Lower,
        "Number of tetrahedra whose determinant is zero to rounding: at most 1e-14 times the product of the image's three \
         edge lengths at a vertex over that of the source, in absolute value.",
    ),
    metric(
        "min_determinant",
        "min det",
        None,
        Better::Higher,
        "Smallest determinant of the Jacobian, the source scaled to the volume of the target.",
    ),
    metric(
        "mean_determinant_error",
        "|mean det - r|/r",
        Some(0.0),
        Better::Lower,
        "Relative deviation of the mean determinant from the ratio of the volume within the image's boundary to the \
         source volume. Zero up to rounding for any map: a check of the computation.",
    ),
];

/// What is measured of a map. Fields over the tetrahedra are in the units of source and image as given.
#[derive(Clone, Debug, PartialEq)]
pub struct Distortion {
    /// Share of each tetrahedron in the source volume.
    pub weights: Vec<f64>,
    /// Signed singular values s1 >= s2 >= |s3|.
    pub singular_values: Vec<[f64; 3]>,
    pub determinant: Vec<f64>,
    /// s1/|s3| + |s3|/s1; infinite for a flat image.
    pub angle_distortion: Vec<f64>,
    /// D + 1/D, also where D is negative.
    pub volume_distortion: Vec<f64>,
    pub d_aa: f64,
    pub d_ma: f64,
    pub d_av: f64,
    pub d_mv: f64,
    /// With the source scaled so that the volume ratio is 1.
    pub d_av_rescaled: f64,
    pub d_mv_rescaled: f64,
    /// Tetrahedra whose determinant is negative.
    pub inverted: usize,
    /// Tetrahedra whose determinant is zero to rounding.
    pub degenerate: usize,
    /// With the source scaled so that the volume ratio is 1.
    pub min_determinant: f64,
    /// Mean over the source volume. For any map it equals the volume within the image's boundary over the source volume.
    pub mean_determinant: f64,
}

/// A source tetrahedron without positive volume: its Jacobian is undefined or has the wrong sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InvalidSource {
    pub cell: usize,
}

impl std::fmt::Display for InvalidSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "tetrahedron {} of the source has no positive volume: repair the mesh or its orientation",
            self.cell
        )
    }
}

impl std::error::Error for InvalidSource {}

/// Figures of one tetrahedron.
#[derive(Clone, Copy, Default)]
struct Cell {
    volume: f64,
    singular_values: [f64; 3],
    determinant: f64,
    flat: bool,
}

/// Measures the map that takes each point of `source` to the point of `image` with the same index. `ratio` is the volume
/// that the map should fill over the volume of the source.
///
/// # Panics
/// If `image` has another length than the source's points.
pub fn distortion(source: &TetrahedralMesh, image: &[[f64; 3]], ratio: f64) -> Result<Distortion, InvalidSource> {
    assert_eq!(source.points.len(), image.len(), "one image a point");
    let mut cells = vec![Cell::default(); source.cells.len()];
    cells
        .par_chunks_mut(CHUNK)
        .zip(source.cells.par_chunks(CHUNK))
        .for_each(|(results, cells)| {
            for (result, &cell) in results.iter_mut().zip(cells) {
                *result = measure(source.corners(cell), cell.map(|vertex| image[vertex as usize]));
            }
        });
    // A comparison with not-a-number is false: such volumes are invalid too.
    if let Some(cell) = cells.iter().position(|cell| !(cell.volume > 0.0)) {
        return Err(InvalidSource { cell });
    }
    let total: f64 = cells.iter().map(|cell| cell.volume).sum();
    let weights: Vec<f64> = cells.iter().map(|cell| cell.volume / total).collect();
    let average = |values: &[f64]| -> f64 { weights.iter().zip(values).map(|(weight, value)| weight * value).sum() };
    let determinant: Vec<f64> = cells.iter().map(|cell| cell.determinant).collect();
    let angle_distortion: Vec<f64> = cells
        .iter()
        .map(|cell| {
            let quotient = cell.singular_values[0] / cell.singular_values[2].abs();
            quotient + 1.0 / quotient
        })
        .collect();
    let sum_with_inverse = |factor: f64| -> Vec<f64> {
        let scaled = determinant.iter().map(|&determinant| factor * determinant);
        scaled.map(|determinant| determinant + 1.0 / determinant).collect()
    };
    let (volume_distortion, rescaled) = (sum_with_inverse(1.0), sum_with_inverse(1.0 / ratio));
    let upright = determinant.iter().all(|&determinant| determinant > 0.0);
    let defined = |value: f64| if upright { value } else { f64::NAN };
    Ok(Distortion {
        d_aa: average(&angle_distortion),
        d_ma: largest(&angle_distortion),
        d_av: defined(average(&volume_distortion)),
        d_mv: defined(largest(&volume_distortion)),
        d_av_rescaled: defined(average(&rescaled)),
        d_mv_rescaled: defined(largest(&rescaled)),
        // Not-a-number counts too.
        inverted: determinant.iter().filter(|&&determinant| !(determinant > 0.0)).count(),
        degenerate: cells.iter().filter(|cell| cell.flat).count(),
        min_determinant: -largest(
            &determinant
                .iter()
                .map(|&determinant| -determinant / ratio)
                .collect::<Vec<_>>(),
        ),
        mean_determinant: average(&determinant),
        singular_values: cells.iter().map(|cell| cell.singular_values).collect(),
        weights,
        determinant,
        angle_distortion,
        volume_distortion,
    })
}

fn measure(before: [[f64; 3]; 4], after: [[f64; 3]; 4]) -> Cell {
    let edges = |[a, b, c, d]: [[f64; 3]; 4]| [b, c, d].map(|point| subtract(point, a));
    let lengths = |edges: &Columns<f64>| edges.iter().map(|&edge| length(edge)).product::<f64>();
    let (source, image) = (edges(before), edges(after));
    let source_cofactor = cofactor(&source);
    let source_determinant = dot(source[0], source_cofactor[0]);
    let determinant = dot(image[0], cofactor(&image)[0]) / source_determinant;
    // J = (image edges) (source edges)^-1, column by column.
    let jacobian: Columns<f64> = std::array::from_fn(|column| {
        std::array::from_fn(|row| {
            (0..3)
                .map(|edge| image[edge][row] * source_cofactor[edge][column])
                .sum::<f64>()
                / source_determinant
        })
    });
    Cell {
        volume: source_determinant / 6.0,
        singular_values: signed_svd(&jacobian).s,
        determinant,
        flat: determinant.abs() <= FLAT * lengths(&image) / lengths(&source),
    }
}

/// The largest value; not-a-number as soon as one is.
fn largest(values: &[f64]) -> f64 {
    values.iter().fold(f64::NEG_INFINITY, |largest, &value| {
        if value.is_nan() {
            value
        } else if largest.is_nan() {
            largest
        } else {
            largest.max(value)
        }
    })
}
