//! Biquartic patches over the curve network that have the network's normals along their sides.
//!
//! A patch is `X = sum C_ab psi_a(u) psi_b(v)`, a and b from 1 to 5. Positions and slopes of the curves give 12 of the
//! coefficients; the four twists `c` and one coefficient `e` for every side follow from `X_n . N = 0` along the sides;
//! the middle node from least bending. Corners are numbered (0,0), (1,0), (1,1), (0,1); side `k` runs from corner `k`
//! to `k + 1`. Source: Xue, Demkowicz, Bajaj 2004, section 2.2.
//!
//! Along a side, `X_n . N` is a polynomial of degree 7 that vanishes at the ends. The paper collocates it at six
//! points: 24 equations with 24 unknowns, of which the slope at every corner appears twice, so that the rank is at
//! most 20. Here the slopes at the corners fix the normal parts of the twists, and 16 equations are left for 20
//! unknowns, solved nearest to a reference by a pivoted QR factorization. [`Solve::Collocation`] is the paper's system
//! with its tolerance.
//!
//! Guaranteed: patches share the network's curves to the last bit of their coefficients. With slopes that meet the twist
//! condition the sides have the network's normal to rounding. Not guaranteed: that a patch does not fold between its
//! sides.

use super::continuity::larger;
use super::edge_normals::{self, Slopes};
use super::hermite;
use super::network::{Network, in_plane};
use crate::linalg::vector3::{add, cross, dot, subtract, times};
use crate::mesh::length;
use nalgebra::{DMatrix, DVector};
use std::sync::LazyLock;

/// Coefficients of a patch: entry `5 a + b` belongs to `psi_{a+1}(u) psi_{b+1}(v)`.
pub type Patch = [[f64; 3]; 25];

/// The twist that is nearest to among all that fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// The mixed derivatives of the bilinearly blended Coons patch (Adini).
    Adini,
    Zero,
}

/// The operator whose square is least over the middle node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// `X_uu + X_vv`.
    Laplacian,
    /// `X_uu + X_uv + X_vv`, as printed in the paper; it depends on the corner from which the patch is numbered.
    Printed,
}

/// How twists and side coefficients are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solve {
    /// 16 equations after the corners, nearest to the reference.
    Exact,
    /// The paper's 24 equations in the sense of least squares, singular values below this share of the largest left out.
    Collocation { tolerance: f64 },
}

/// A patch and what was found on the way.
#[derive(Clone, Copy, Debug)]
pub struct Fitted {
    pub patch: Patch,
    /// Rank of the 24 equations.
    pub rank: usize,
    /// Largest `|X_n . N|` at the paper's collocation points, relative to the longest side.
    pub residual: f64,
    /// Longest change from the reference, relative to the longest side.
    pub change: f64,
    /// Integral of the square of the operator without and with the middle node.
    pub energy: [f64; 2],
}

/// Where the 12 given coefficients stand: for each side, its two corners' positions and its slopes at them.
const SIDES: [Side; 4] = [
    Side::new(
        [0, 1],
        [[0, 0], [1, 0]],
        [[2, 0], [3, 0]],
        [[0, 2], [1, 2]],
        [[2, 2], [3, 2]],
        [4, 2],
    ),
    Side::new(
        [1, 2],
        [[1, 0], [1, 1]],
        [[1, 2], [1, 3]],
        [[3, 0], [3, 1]],
        [[3, 2], [3, 3]],
        [3, 4],
    ),
    Side::new(
        [3, 2],
        [[0, 1], [1, 1]],
        [[2, 1], [3, 1]],
        [[0, 3], [1, 3]],
        [[2, 3], [3, 3]],
        [4, 3],
    ),
    Side::new(
        [0, 3],
        [[0, 0], [0, 1]],
        [[0, 2], [0, 3]],
        [[2, 0], [2, 1]],
        [[2, 2], [2, 3]],
        [2, 4],
    ),
];

/// One side of a patch in the direction of its parameter.
struct Side {
    /// Corners at the start and the end.
    corners: [usize; 2],
    points: [usize; 2],
    along: [usize; 2],
    /// Slopes across the side at its ends.
    across: [usize; 2],
    twists: [usize; 2],
    middle: usize,
}

impl Side {
    const fn new(
        corners: [usize; 2],
        points: [[usize; 2]; 2],
        along: [[usize; 2]; 2],
        across: [[usize; 2]; 2],
        twists: [[usize; 2]; 2],
        middle: [usize; 2],
    ) -> Self {
        const fn place(pair: [usize; 2]) -> usize {
            5 * pair[0] + pair[1]
        }
        const fn places(pairs: [[usize; 2]; 2]) -> [usize; 2] {
            [place(pairs[0]), place(pairs[1])]
        }
        Self {
            corners,
            points: places(points),
            along: places(along),
            across: places(across),
            twists: places(twists),
            middle: place(middle),
        }
    }
}

/// Coefficients of the twists at corners 0 to 3.
const TWISTS: [usize; 4] = [12, 17, 18, 13];
/// Coefficients of the sides 0 to 3.
const MIDDLES: [usize; 4] = [22, 19, 23, 14];
/// The middle node.
pub const CENTRE: usize = 24;

/// The curve of side `k` in the direction of the patch, and its normal.
fn side_data(network: &Network, quad: usize, side: usize) -> (usize, bool) {
    let edge = network.connectivity.quad_edges[quad][side] as usize;
    // Sides 2 and 3 of the quad run against the parameters of the patch.
    (edge, network.runs_along(quad, side) == (side < 2))
}

/// A cubic over the four Hermite functions run through the other way.
fn reversed([a, b, s, t]: [[f64; 3]; 4]) -> [[f64; 3]; 4] {
    [b, a, times(t, -1.0), times(s, -1.0)]
}

/// The bicubic part that the curves determine: positions and slopes, zero twists.
pub fn boundary(network: &Network, quad: usize) -> Patch {
    let mut patch = [[0.0; 3]; 25];
    for (index, side) in SIDES.iter().enumerate() {
        let (edge, along) = side_data(network, quad, index);
        let curve = network.curve(edge);
        let curve = if along { curve } else { reversed(curve) };
        for end in 0..2 {
            patch[side.points[end]] = curve[end];
            patch[side.along[end]] = curve[2 + end];
        }
    }
    patch
}

/// The mixed derivatives of the bilinearly blended Coons patch at the four corners.
pub fn adini(patch: &Patch) -> [[f64; 3]; 4] {
    let corner = subtract(add(patch[0], patch[6]), add(patch[1], patch[5]));
    // Differences of slopes across the patch: along u at v = 0 and 1, and along v at u = 0 and 1.
    let u = [subtract(patch[11], patch[10]), subtract(patch[16], patch[15])];
    let v = [subtract(patch[7], patch[2]), subtract(patch[8], patch[3])];
    [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| subtract(add(u[i], v[j]), corner))
}

/// The patch through the curves with Adini's twists: neighbours share curves, but not tangent planes.
pub fn continuous(network: &Network, quad: usize, operator: Operator) -> Fitted {
    let mut patch = boundary(network, quad);
    for (place, twist) in TWISTS.into_iter().zip(adini(&patch)) {
        patch[place] = twist;
    }
    finish(patch, operator, 0, 0.0, 0.0)
}

/// The bilinear patch through four corners.
pub fn bilinear(corners: [[f64; 3]; 4]) -> Patch {
    let [a, b, c, d] = corners;
    let mut patch = [[0.0; 3]; 25];
    patch[0] = a;
    patch[5] = b;
    patch[6] = c;
    patch[1] = d;
    for (places, slope) in [
        ([10, 15], subtract(b, a)),
        ([11, 16], subtract(c, d)),
        ([2, 3], subtract(d, a)),
        ([7, 8], subtract(c, b)),
    ] {
        for place in places {
            patch[place] = slope;
        }
    }
    let twist = subtract(add(a, c), add(b, d));
    for place in TWISTS {
        patch[place] = twist;
    }
    patch
}

/// The patch of a quad with the network's normals along its sides.
pub fn fit(
    network: &Network,
    slopes: &Slopes,
    quad: usize,
    solve: Solve,
    reference: Reference,
    operator: Operator,
) -> Fitted {
    let mut patch = boundary(network, quad);
    let twists = match reference {
        Reference::Adini => adini(&patch),
        Reference::Zero => [[0.0; 3]; 4],
    };
    let normals: [[[f64; 3]; 4]; 4] = std::array::from_fn(|side| {
        let (edge, along) = side_data(network, quad, side);
        let normals = edge_normals::coefficients(network, slopes, edge);
        if along { normals } else { reversed(normals) }
    });
    let (found, rank) = match solve {
        Solve::Exact => nearest(&patch, &normals, &twists),
        Solve::Collocation { tolerance } => collocate(&patch, &normals, &twists, tolerance),
    };
    let size = (0..4)
        .map(|side| length(patch[SIDES[side].along[0]]))
        .fold(f64::MIN_POSITIVE, f64::max);
    let mut change = 0.0f64;
    for index in 0..4 {
        patch[TWISTS[index]] = found[index];
        patch[MIDDLES[index]] = found[4 + index];
        change = change
            .max(length(subtract(found[index], twists[index])))
            .max(length(found[4 + index]));
    }
    let residual = residual(&patch, &normals);
    finish(patch, operator, rank, residual / size, change / size)
}

/// The slope across a side at `x`.
fn across(patch: &Patch, side: &Side, x: f64) -> [f64; 3] {
    let values = hermite::values(x);
    let cubic = [
        patch[side.across[0]],
        patch[side.across[1]],
        patch[side.twists[0]],
        patch[side.twists[1]],
    ];
    add(hermite::combine(&values, &cubic), times(patch[side.middle], values[4]))
}

fn residual(patch: &Patch, normals: &[[[f64; 3]; 4]; 4]) -> f64 {
    let mut worst = 0.0f64;
    for (side, normals) in SIDES.iter().zip(normals) {
        for sample in 1..7 {
            let x = f64::from(sample) / 7.0;
            let normal = hermite::combine(&hermite::values(x), normals);
            worst = larger(worst, dot(across(patch, side, x), normal).abs());
        }
    }
    worst
}

/// Unknowns of the reduced system: two tangential parts of each twist, then the sides' coefficients.
const UNKNOWNS: usize = 20;
const EQUATIONS: usize = 16;
/// Pivots below this share of the first one mark an equation that follows from the others.
const PIVOT: f64 = 1e-12;

/// Twists and side coefficients nearest to the reference that give the sides their normals.
fn nearest(patch: &Patch, normals: &[[[f64; 3]; 4]; 4], reference: &[[f64; 3]; 4]) -> ([[f64; 3]; 8], usize) {
    // Normal and tangent directions at the corners, and the parts of the twists that the corners fix.
    let mut frames = [[[0.0; 3]; 2]; 4];
    let mut twists = *reference;
    for corner in 0..4 {
        let mut wanted = 0.0;
        let mut unit = [0.0; 3];
        for (side, normals) in SIDES.iter().zip(normals) {
            for end in 0..2 {
                if side.corners[end] == corner {
                    unit = normals[end];
                    // X_uv . N = -X_u . N_v on the one side and -X_v . N_u on the other.
                    wanted -= 0.5 * dot(patch[side.across[end]], normals[2 + end]);
                }
            }
        }
        let axis = if unit[0].abs() < 0.7 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 1.0, 0.0]
        };
        let first = cross(unit, axis);
        let first = times(first, 1.0 / length(first));
        frames[corner] = [first, cross(unit, first)];
        twists[corner] = add(in_plane(twists[corner], unit), times(unit, wanted));
    }
    // Columns are equations: X_n . N / psi_5 at four points of every side.
    let mut columns = [[0.0; UNKNOWNS]; EQUATIONS];
    let mut rhs = [0.0; EQUATIONS];
    for (index, (side, normals)) in SIDES.iter().zip(normals).enumerate() {
        for sample in 0..4 {
            let x = (sample + 1) as f64 / 5.0;
            let values = hermite::values(x);
            let normal = times(hermite::combine(&values, normals), 1.0 / values[4]);
            let column = &mut columns[4 * index + sample];
            let mut known = [patch[side.across[0]], patch[side.across[1]], [0.0; 3], [0.0; 3]];
            for end in 0..2 {
                let corner = side.corners[end];
                known[2 + end] = twists[corner];
                for part in 0..2 {
                    column[2 * corner + part] = values[2 + end] * dot(frames[corner][part], normal);
                }
            }
            for axis in 0..3 {
                column[8 + 3 * index + axis] = values[4] * normal[axis];
            }
            rhs[4 * index + sample] = -dot(hermite::combine(&values, &known), normal);
        }
    }
    let (solution, rank) = shortest(&mut columns, &rhs);
    let mut found = [[0.0; 3]; 8];
    for corner in 0..4 {
        let [first, second] = frames[corner];
        found[corner] = add(
            twists[corner],
            add(
                times(first, solution[2 * corner]),
                times(second, solution[2 * corner + 1]),
            ),
        );
    }
    for side in 0..4 {
        found[4 + side] = std::array::from_fn(|axis| solution[8 + 3 * side + axis]);
    }
    (found, 4 + rank)
}

/// The shortest solution of `columns^T z = rhs` by a pivoted Householder QR factorization of the columns, which it
/// overwrites, and the rank.
fn shortest(columns: &mut [[f64; UNKNOWNS]; EQUATIONS], rhs: &[f64; EQUATIONS]) -> ([f64; UNKNOWNS], usize) {
    let mut order: [usize; EQUATIONS] = std::array::from_fn(|index| index);
    let mut scales = [0.0; EQUATIONS];
    let mut rank = 0;
    let mut first = 0.0;
    while rank < EQUATIONS {
        let rest = |column: &[f64; UNKNOWNS]| column[rank..].iter().map(|value| value * value).sum::<f64>();
        let mut pivot = rank;
        let mut largest = rest(&columns[rank]);
        for index in rank + 1..EQUATIONS {
            let size = rest(&columns[index]);
            if size > largest {
                (pivot, largest) = (index, size);
            }
        }
        let size = largest.sqrt();
        if rank == 0 {
            first = size;
        }
        if !(size > PIVOT * first) {
            break;
        }
        columns.swap(rank, pivot);
        order.swap(rank, pivot);
        // The reflection that maps the rest of the column onto the axis; its vector replaces the column below the axis.
        let (head, tail) = columns.split_at_mut(rank + 1);
        let column = &mut head[rank];
        let diagonal = if column[rank] > 0.0 { -size } else { size };
        let axis = column[rank] - diagonal;
        let square = 2.0 * size * (size + column[rank].abs());
        column[rank] = axis;
        for other in tail.iter_mut() {
            let along: f64 = (rank..UNKNOWNS).map(|row| column[row] * other[row]).sum();
            let factor = 2.0 * along / square;
            for row in rank..UNKNOWNS {
                other[row] -= factor * column[row];
            }
        }
        scales[rank] = diagonal;
        rank += 1;
    }
    // R^T y = P^T rhs, then z = Q y. The reflections' vectors stand in the columns, R above them.
    let mut solution = [0.0; UNKNOWNS];
    for row in 0..rank {
        let known: f64 = (0..row).map(|index| columns[row][index] * solution[index]).sum();
        solution[row] = (rhs[order[row]] - known) / scales[row];
    }
    for index in (0..rank).rev() {
        let column = &columns[index];
        let square: f64 = column[index..].iter().map(|value| value * value).sum();
        let along: f64 = (index..UNKNOWNS).map(|row| column[row] * solution[row]).sum();
        let factor = 2.0 * along / square;
        for row in index..UNKNOWNS {
            solution[row] -= factor * column[row];
        }
    }
    (solution, rank)
}

/// The paper's 24 equations in the sense of least squares.
fn collocate(
    patch: &Patch,
    normals: &[[[f64; 3]; 4]; 4],
    reference: &[[f64; 3]; 4],
    tolerance: f64,
) -> ([[f64; 3]; 8], usize) {
    let mut matrix = DMatrix::<f64>::zeros(24, 24);
    let mut rhs = DVector::<f64>::zeros(24);
    for (index, (side, normals)) in SIDES.iter().zip(normals).enumerate() {
        for sample in 0..6 {
            let row = 6 * index + sample;
            let values = hermite::values((sample + 1) as f64 / 7.0);
            let normal = hermite::combine(&values, normals);
            let mut known = [patch[side.across[0]], patch[side.across[1]], [0.0; 3], [0.0; 3]];
            for axis in 0..3 {
                for end in 0..2 {
                    matrix[(row, 3 * side.corners[end] + axis)] = values[2 + end] * normal[axis];
                }
                matrix[(row, 12 + 3 * index + axis)] = values[4] * normal[axis];
            }
            for end in 0..2 {
                known[2 + end] = reference[side.corners[end]];
            }
            rhs[row] = -dot(hermite::combine(&values, &known), normal);
        }
    }
    let decomposition = matrix.svd(true, true);
    let largest = decomposition.singular_values.max();
    let cut = tolerance * largest;
    let rank = decomposition
        .singular_values
        .iter()
        .filter(|&&value| value > cut)
        .count();
    let solution = decomposition.solve(&rhs, cut).unwrap_or_else(|_| DVector::zeros(24));
    let found = std::array::from_fn(|index| {
        let base = if index < 4 { reference[index] } else { [0.0; 3] };
        std::array::from_fn(|axis| base[axis] + solution[3 * index + axis])
    });
    (found, rank)
}

/// Inner products of the operators' images of the 25 functions over the unit square, for each [`Operator`].
static PRODUCTS: LazyLock<[Vec<[f64; 25]>; 2]> =
    LazyLock::new(|| [Operator::Laplacian, Operator::Printed].map(products));

/// Gauss points and weights on the unit interval that integrate polynomials of degree 9 exactly.
pub const GAUSS_5: [(f64, f64); 5] = [
    (0.046_910_077_030_668_004, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

fn products(operator: Operator) -> Vec<[f64; 25]> {
    let mut all = vec![[0.0; 25]; 25];
    for (u, weight_u) in GAUSS_5 {
        for (v, weight_v) in GAUSS_5 {
            let (f, df, ddf) = (hermite::values(u), hermite::slopes(u), hermite::second_derivatives(u));
            let (g, dg, ddg) = (hermite::values(v), hermite::slopes(v), hermite::second_derivatives(v));
            let image: [f64; 25] = std::array::from_fn(|index| {
                let (a, b) = (index / 5, index % 5);
                let plain = ddf[a] * g[b] + f[a] * ddg[b];
                match operator {
                    Operator::Laplacian => plain,
                    Operator::Printed => plain + df[a] * dg[b],
                }
            });
            for (row, a) in all.iter_mut().zip(image) {
                for (value, b) in row.iter_mut().zip(image) {
                    *value += weight_u * weight_v * a * b;
                }
            }
        }
    }
    all
}

/// Sets the middle node to the value of least bending.
fn finish(mut patch: Patch, operator: Operator, rank: usize, residual: f64, change: f64) -> Fitted {
    let products = &PRODUCTS[usize::from(operator == Operator::Printed)];
    patch[CENTRE] = [0.0; 3];
    let mut energy = 0.0;
    for (row, coefficient) in products.iter().zip(&patch) {
        for (value, other) in row.iter().zip(&patch) {
            energy += value * dot(*coefficient, *other);
        }
    }
    let stiffness = products[CENTRE][CENTRE];
    let slope: [f64; 3] =
        std::array::from_fn(|axis| (0..24).map(|index| products[CENTRE][index] * patch[index][axis]).sum());
    patch[CENTRE] = slope.map(|component| -component / stiffness);
    let with = energy - dot(slope, slope) / stiffness;
    Fitted {
        patch,
        rank,
        residual,
        change,
        energy: [energy, with],
    }
}
