//! Cells whose functions are polynomials: Bernstein coefficients of the position, cut in two again and again.
//!
//! A cell is a product of simplices: lines, or a line and a triangle, or a tetrahedron. Its position on a part has
//! Bernstein coefficients b; those of the derivative along an edge of a simplex of degree p are differences of b, raised
//! to degree p again so that all three derivatives together make control matrices. Where the proof fails the part is cut
//! in the middle of the longest edge of the simplex along which the control matrices differ most, by de Casteljau's
//! algorithm: averages only, so a rounding error stays what it is but for half a unit in the last place a step. Against
//! derivatives by the part's own coordinates, which halve with every cut, it grows; a part of a hexahedron where it
//! matters is computed anew.

use super::lattice::Lattice;
use super::{Certifier, MARGIN, NEGATIVE, UNIT, Verdict, determinant, frobenius, is_positive, rough};
use crate::fem::space::Kind;
use crate::linalg::lanes::{Lanes, Vector, WIDTH};
use crate::linalg::processor::{Kernel, Processor};
use crate::linalg::vector3::{Columns, add, cofactor, dot, subtract, times};
use crate::mesh::mixed::Shape;

/// Cuts of a part at most.
const MOST_CUTS: i32 = 60;

/// Parts allowed against those of cells that are cut into eight: two halves are a third of the way there.
const HALVES: usize = 4;

/// Rounding that does not matter for the proof: a share of the control matrices.
const PRECISE: f64 = 0.01;

/// A factor of a cell with its place among the indices of the coefficients.
struct Factor<'a> {
    lattice: &'a Lattice,
    outer: usize,
    inner: usize,
    /// The cell's direction of its first coordinate.
    direction: usize,
}

/// A part of a cell.
struct Part {
    /// Three rows of coefficients, one a component.
    positions: Vec<f64>,
    /// The canonical coordinates of the corners of every factor, each 0 in the directions of other factors.
    corners: [[[f64; 3]; 4]; 3],
    cuts: i32,
    /// Cuts when the coefficients were computed, and a bound of their error then.
    since: i32,
    error: f64,
}

/// The cell with what its parts share.
struct Cell<'a> {
    factors: Vec<Factor<'a>>,
    points: usize,
    /// `points` rounded up to whole lanes: the length of a row of control matrices.
    stride: usize,
    degree: usize,
    /// Bounds the coefficients.
    size: f64,
    processor: Processor,
    /// Entry (row, column) of the control matrices in row `3 column + row`.
    control: Vec<f64>,
    /// The symmetric parts of `J J0^-1`: (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2).
    symmetric: Vec<f64>,
    /// Two rows of coefficients for a cut.
    first: Vec<f64>,
    second: Vec<f64>,
    unused: Vec<Vec<f64>>,
}

impl Certifier {
    pub(super) fn polynomial_cell(&self, kind: Kind, coefficients: &[[f64; 3]], inverse: &Columns<f64>) -> Verdict {
        let mut own = self.centred(kind, coefficients);
        if determinant(inverse) < 0.0 {
            // A tetrahedron's functions may be framed the other way round: its mirror image has a positive determinant.
            own.iter_mut().for_each(|c| c[0] = -c[0]);
        }
        let (positions, error) = self.positions(kind, &own, [(0, 0); 3]);
        let order = kind.order;
        let points = positions.len() / 3;
        let factor = |corners: usize, outer: usize, direction: usize| {
            let lattice = &self.lattices[&(corners, order)];
            Factor {
                lattice,
                outer,
                inner: points / outer / lattice.points,
                direction,
            }
        };
        let n = order + 1;
        let factors = match kind.shape {
            Shape::Hexahedron => vec![factor(2, 1, 0), factor(2, n, 1), factor(2, n * n, 2)],
            Shape::Prism => vec![factor(2, 1, 2), factor(3, n, 0)],
            Shape::Tetrahedron => vec![factor(4, 1, 0)],
        };
        let mut corners = [[[0.0; 3]; 4]; 3];
        for (factor, corners) in factors.iter().zip(&mut corners) {
            for corner in 1..factor.lattice.corners {
                corners[corner][factor.direction + corner - 1] = 1.0;
            }
        }
        let stride = points.next_multiple_of(WIDTH);
        let mut cell = Cell {
            points,
            stride,
            degree: order,
            size: positions.iter().fold(0.0, |most, value| value.abs().max(most)),
            processor: Processor::detect(),
            control: vec![0.0; 9 * stride],
            symmetric: vec![0.0; 6 * stride],
            first: Vec::new(),
            second: Vec::new(),
            unused: Vec::new(),
            factors,
        };
        let whole = Part {
            positions,
            corners,
            cuts: 0,
            since: 0,
            error,
        };
        let most = HALVES * self.most(kind);
        let whole_scale = determinant(inverse).abs();
        let mut stack = vec![whole];
        let (mut parts, mut bound) = (0, f64::INFINITY);
        while let Some(mut part) = stack.pop() {
            parts += 1;
            // The determinant on a part against that on the cell.
            let scale = 2.0_f64.powi(part.cuts) * whole_scale;
            let mut proved = cell.prove(&part);
            if proved.is_err_and(|delta| delta > PRECISE) && part.cuts > part.since && kind.shape == Shape::Hexahedron {
                (part.positions, part.error) = self.positions(kind, &own, intervals(&part));
                part.since = part.cuts;
                proved = cell.prove(&part);
            }
            if let Ok(least) = proved {
                bound = bound.min(scale * least);
                cell.unused.push(part.positions);
                continue;
            }
            if let Some(point) = cell.suspect(&part, scale) {
                let value = self.determinant_at(kind, coefficients, inverse, point);
                if !(value > NEGATIVE) {
                    return Verdict::Negative(point, value);
                }
            }
            if parts + stack.len() >= most || part.cuts >= MOST_CUTS {
                stack.push(part);
                let roughs = stack.iter().map(|part| {
                    cell.differentiate(part);
                    2.0_f64.powi(part.cuts) * whole_scale * cell.rough(part)
                });
                return Verdict::Undecided(roughs.fold(f64::INFINITY, f64::min));
            }
            stack.extend(cell.cut(part));
        }
        Verdict::Positive(bound)
    }
}

/// Level and number of the intervals whose product a hexahedron's part is.
fn intervals(part: &Part) -> [(u32, u32); 3] {
    std::array::from_fn(|axis| {
        let [low, high] = [0, 1].map(|end| part.corners[axis][end][axis]);
        // Powers of two: exact.
        let share = 1.0 / (high - low);
        (share.log2().round() as u32, (low * share) as u32)
    })
}

impl Cell<'_> {
    /// The control matrices of a part: derivatives by the part's own coordinates.
    fn differentiate(&mut self, part: &Part) {
        self.control.fill(0.0);
        for factor in &self.factors {
            for side in 1..factor.lattice.corners {
                for component in 0..3 {
                    let row = 3 * (factor.direction + side - 1) + component;
                    self.processor.run(Derivative {
                        lattice: factor.lattice,
                        side,
                        outer: factor.outer,
                        inner: factor.inner,
                        b: &part.positions[component * self.points..][..self.points],
                        out: &mut self.control[row * self.stride..][..self.points],
                    });
                }
            }
        }
        // What fills the last lanes repeats the first point.
        for row in self.control.chunks_exact_mut(self.stride) {
            let first = row[0];
            row[self.points..].fill(first);
        }
    }

    /// Bounds the error of a control matrix in the Frobenius norm, with that of its products with a matrix of norm 1.
    fn error(&self, part: &Part) -> f64 {
        let p = self.degree as f64;
        let position = part.error + f64::from(part.cuts - part.since) * p * UNIT * self.size;
        3.0 * p * (2.0 * position + 24.0 * UNIT * self.size)
    }

    fn matrix(&self, point: usize) -> Columns<f64> {
        std::array::from_fn(|column| std::array::from_fn(|row| self.control[(3 * column + row) * self.stride + point]))
    }

    fn mean(&self) -> Columns<f64> {
        let share = 1.0 / self.points as f64;
        std::array::from_fn(|column| {
            std::array::from_fn(|row| {
                let values = &self.control[(3 * column + row) * self.stride..][..self.points];
                values.iter().sum::<f64>() * share
            })
        })
    }

    /// A positive lower bound of the determinant by the part's own coordinates, from its control matrices; or else how
    /// much of the failure is due to rounding, where 1 is all.
    fn prove(&mut self, part: &Part) -> Result<f64, f64> {
        self.differentiate(part);
        let mean = self.mean();
        let cof = cofactor(&mean);
        let middle = dot(mean[0], cof[0]);
        let usable = is_positive(middle, &mean);
        // Where the mean is of no use the identity still lets the edge to cut be chosen.
        let rows = if usable {
            cof.map(|row| times(row, 1.0 / middle))
        } else {
            let size = frobenius(&mean).max(f64::MIN_POSITIVE);
            [0, 1, 2].map(|row| [0, 1, 2].map(|column| if row == column { 1.0 / size } else { 0.0 }))
        };
        let delta = frobenius(&rows) * self.error(part);
        // Turned and bent shapes, flat ones too, are near J0 from the one side, uneven parameters from the other. The
        // edge to cut is chosen by the second.
        for from_left in [true, false] {
            let mut least = f64::INFINITY;
            let mut holds = true;
            self.processor.run(Test {
                control: &self.control,
                stride: self.stride,
                rows: &rows,
                from_left,
                delta,
                symmetric: &mut self.symmetric,
                least: &mut least,
                holds: &mut holds,
            });
            if usable && delta < 0.5 && holds {
                return Ok(middle * least);
            }
        }
        Err(delta)
    }

    /// A corner of the part where the determinant may be negative; there control matrices are values.
    fn suspect(&self, part: &Part, scale: f64) -> Option<[f64; 3]> {
        let mut worst: Option<([f64; 3], f64)> = None;
        let mut tips = vec![(0, [0.0; 3])];
        for (factor, corners) in self.factors.iter().zip(&part.corners) {
            tips = tips
                .into_iter()
                .flat_map(|(place, point)| {
                    let own = factor.lattice.tips.iter().zip(corners);
                    own.map(move |(tip, corner)| (place + tip * factor.inner, add(point, *corner)))
                })
                .collect();
        }
        for (place, point) in tips {
            let matrix = self.matrix(place);
            let value = determinant(&matrix);
            // What rounding may make of it, by Hadamard's inequality.
            let margin = 3.0 * self.error(part) * frobenius(&matrix).powi(2);
            if !(scale * (value - margin) > NEGATIVE) && worst.is_none_or(|(_, other)| value < other) {
                worst = Some((point, value));
            }
        }
        worst.map(|(point, _)| point)
    }

    /// A lower bound of the determinant from the control matrices as they are.
    fn rough(&self, part: &Part) -> f64 {
        rough(
            (0..self.points).map(|point| self.matrix(point)),
            &self.mean(),
            self.error(part),
        )
    }

    /// The factor along which the symmetric parts change most, where ends and middles of rows are compared, and its
    /// longest edge: that of the greatest change would make needles, whose thickness is lost in rounding.
    fn longest(&self, part: &Part) -> (usize, usize) {
        let mut best = (0, 0, f64::NEG_INFINITY);
        for (index, (factor, corners)) in self.factors.iter().zip(&part.corners).enumerate() {
            let (inner, points) = (factor.inner, factor.lattice.points);
            let mut edge = (0, f64::NEG_INFINITY);
            for (number, ([r, s], rows)) in factor.lattice.edges.iter().enumerate() {
                let side = subtract(corners[*s], corners[*r]);
                if dot(side, side) > edge.1 {
                    edge = (number, dot(side, side));
                }
                let mut change = 0.0;
                let mut count = 0;
                for row in rows {
                    let [start, middle, end] = [row[0], row[row.len() / 2], row[row.len() - 1]];
                    count += factor.outer * inner;
                    for values in self.symmetric.chunks_exact(self.stride) {
                        for o in 0..factor.outer {
                            let at = |place: usize| &values[(o * points + place) * inner..][..inner];
                            let (start, middle, end) = (at(start), at(middle), at(end));
                            for i in 0..inner {
                                let (a, b) = (middle[i] - start[i], end[i] - middle[i]);
                                change += a * a + b * b;
                            }
                        }
                    }
                }
                let change = change / count as f64;
                if change > best.2 {
                    best = (index, 0, change);
                }
            }
            if best.0 == index {
                best.1 = edge.0;
            }
        }
        (best.0, best.1)
    }

    /// Both halves of a part.
    fn cut(&mut self, mut part: Part) -> [Part; 2] {
        let (index, edge) = self.longest(&part);
        let factor = &self.factors[index];
        let (inner, points) = (factor.inner, factor.lattice.points);
        let ([r, s], rows) = &factor.lattice.edges[edge];
        let mut positions = self.unused.pop().unwrap_or_default();
        positions.clone_from(&part.positions);
        self.processor.run(Halves {
            rows,
            blocks: 3 * factor.outer,
            points,
            inner,
            low: &mut part.positions,
            high: &mut positions,
            first: &mut self.first,
            second: &mut self.second,
        });
        let corners = &part.corners[index];
        let middle = times(add(corners[*r], corners[*s]), 0.5);
        let mut other = Part {
            positions,
            corners: part.corners,
            cuts: part.cuts + 1,
            ..part
        };
        other.corners[index][*r] = middle;
        part.corners[index][*s] = middle;
        part.cuts += 1;
        [other, part]
    }
}

/// Differences of coefficients along an edge from the first corner to `side`, raised to the degree of the coefficients.
struct Derivative<'a> {
    lattice: &'a Lattice,
    side: usize,
    outer: usize,
    inner: usize,
    b: &'a [f64],
    /// Added to.
    out: &'a mut [f64],
}

impl Kernel for Derivative<'_> {
    // Plain loops, which the compiler fits to the registers of the processor.
    #[inline(always)]
    fn run<V: Vector>(self) {
        let (inner, points) = (self.inner, self.lattice.points);
        for o in 0..self.outer {
            let b = &self.b[o * points * inner..][..points * inner];
            let out = &mut self.out[o * points * inner..][..points * inner];
            if inner == 1 {
                for below in &self.lattice.below {
                    let difference = b[below.up[self.side]] - b[below.up[0]];
                    for corner in 0..self.lattice.corners {
                        out[below.up[corner]] += below.weights[corner] * difference;
                    }
                }
                continue;
            }
            for below in &self.lattice.below {
                let from = &b[below.up[0] * inner..][..inner];
                let to = &b[below.up[self.side] * inner..][..inner];
                for corner in 0..self.lattice.corners {
                    let weight = below.weights[corner];
                    let out = &mut out[below.up[corner] * inner..][..inner];
                    for ((out, to), from) in out.iter_mut().zip(to).zip(from) {
                        *out += weight * (to - from);
                    }
                }
            }
        }
    }
}

/// De Casteljau's algorithm along rows of a lattice: the half at their start in place, that at their end into `high`.
struct Halves<'a> {
    rows: &'a [Vec<usize>],
    blocks: usize,
    points: usize,
    inner: usize,
    low: &'a mut [f64],
    high: &'a mut [f64],
    first: &'a mut Vec<f64>,
    second: &'a mut Vec<f64>,
}

impl Kernel for Halves<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let (inner, size) = (self.inner, self.points * self.inner);
        let most = self.rows.iter().map(Vec::len).max().unwrap_or(0) * inner;
        self.first.resize(most, 0.0);
        self.second.resize(most, 0.0);
        let (mut first, mut second) = (self.first.as_mut_slice(), self.second.as_mut_slice());
        for block in 0..self.blocks {
            let low = &mut self.low[block * size..][..size];
            let high = &mut self.high[block * size..][..size];
            for row in self.rows {
                if inner == 1 {
                    for (out, &place) in first.iter_mut().zip(row) {
                        *out = low[place];
                    }
                } else {
                    for (out, &place) in first.chunks_exact_mut(inner).zip(row) {
                        out.copy_from_slice(&low[place * inner..][..inner]);
                    }
                }
                for step in 1..row.len() {
                    let count = (row.len() - step) * inner;
                    let (a, b) = (&first[..count], &first[inner..inner + count]);
                    for ((out, a), b) in second[..count].iter_mut().zip(a).zip(b) {
                        *out = 0.5 * (a + b);
                    }
                    let (start, end) = (row[step], row[row.len() - 1 - step]);
                    if inner == 1 {
                        low[start] = second[0];
                        high[end] = second[count - 1];
                    } else {
                        low[start * inner..][..inner].copy_from_slice(&second[..inner]);
                        high[end * inner..][..inner].copy_from_slice(&second[count - inner..count]);
                    }
                    std::mem::swap(&mut first, &mut second);
                }
            }
        }
    }
}

/// Whether the symmetric parts of `rows J`, or else of `J rows`, less `delta` on their diagonals, are all positive
/// definite, and the least of their determinants.
struct Test<'a> {
    control: &'a [f64],
    stride: usize,
    rows: &'a Columns<f64>,
    from_left: bool,
    delta: f64,
    symmetric: &'a mut [f64],
    least: &'a mut f64,
    holds: &'a mut bool,
}

impl Kernel for Test<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let load = |values: &[f64]| {
            let mut lanes = Lanes::ZERO;
            lanes.0.copy_from_slice(&values[..WIDTH]);
            V::load(&lanes)
        };
        let mut rows = [[V::constant(0.0); 3]; 3];
        for row in 0..3 {
            for column in 0..3 {
                rows[row][column] = V::constant(self.rows[row][column]);
            }
        }
        let (delta, margin, half) = (V::constant(self.delta), V::constant(MARGIN), V::constant(0.5));
        let zero = V::constant(0.0);
        let mut least = V::constant(f64::INFINITY);
        for place in (0..self.stride).step_by(WIDTH) {
            let mut matrix = [[V::constant(0.0); 3]; 3];
            for column in 0..3 {
                for row in 0..3 {
                    matrix[row][column] = load(&self.control[(3 * column + row) * self.stride + place..]);
                }
            }
            let [left, right] = if self.from_left { [rows, matrix] } else { [matrix, rows] };
            let mut m = [[V::constant(0.0); 3]; 3];
            for row in 0..3 {
                for column in 0..3 {
                    m[row][column] = left[row][0] * right[0][column]
                        + left[row][1] * right[1][column]
                        + left[row][2] * right[2][column];
                }
            }
            let entries = [
                m[0][0],
                half * (m[0][1] + m[1][0]),
                half * (m[0][2] + m[2][0]),
                m[1][1],
                half * (m[1][2] + m[2][1]),
                m[2][2],
            ];
            for (entry, value) in entries.iter().enumerate() {
                let mut lanes = Lanes::ZERO;
                value.store(&mut lanes);
                self.symmetric[entry * self.stride + place..][..WIDTH].copy_from_slice(&lanes.0);
            }
            let [a, b, c, d, e, f] = entries;
            let (a, d, f) = (a - delta, d - delta, f - delta);
            let minor = a * d - b * b;
            let whole = f * minor - a * e * e + (b + b) * c * e - c * c * d;
            let diagonal = margin * a * d;
            let good = zero.less(a) & diagonal.less(minor) & (diagonal * f).less(whole);
            if V::bits(good) != u8::MAX {
                *self.holds = false;
            }
            least = least.min(whole);
        }
        *self.least = if *self.holds {
            least.smallest()
        } else {
            f64::NEG_INFINITY
        };
    }
}
