//! Patches evaluated at many points, eight side by side in vector registers, with derivatives to second order.
//!
//! [`Places`] hold the five functions and their derivatives at the points, to be shared among patches; [`evaluate`]
//! runs a patch over them. The same bits as [`surface::evaluate`](super::surface::evaluate) on every processor:
//! products and sums in the same order, never fused.

use super::patch::Patch;
use super::surface::{Jet, Place};
use crate::linalg::lanes::{Lanes, Vector, WIDTH, load, store};
use crate::linalg::processor::{Kernel, Processor};

/// The functions at eight points: values, slopes and second derivatives of five functions, by `u` and by `v`.
#[derive(Clone, Debug)]
struct Block {
    u: [Lanes; 15],
    v: [Lanes; 15],
}

/// Points of the unit square at which patches are evaluated.
#[derive(Clone, Debug)]
pub struct Places {
    blocks: Vec<Block>,
    count: usize,
}

impl Places {
    /// The points `(u, v)`.
    pub fn new(points: &[[f64; 2]]) -> Self {
        let functions = |x: f64| {
            let Place {
                values,
                slopes,
                seconds,
            } = Place::new(x);
            let mut all = [0.0; 15];
            for (index, value) in values.into_iter().chain(slopes).chain(seconds).enumerate() {
                all[index] = value;
            }
            all
        };
        let blocks = points.chunks(WIDTH).map(|points| {
            let mut block = Block {
                u: [Lanes::ZERO; 15],
                v: [Lanes::ZERO; 15],
            };
            for lane in 0..WIDTH {
                // Lanes beyond the last point repeat it.
                let [u, v] = points[lane.min(points.len() - 1)];
                let (f, g) = (functions(u), functions(v));
                for index in 0..15 {
                    block.u[index].0[lane] = f[index];
                    block.v[index].0[lane] = g[index];
                }
            }
            block
        });
        Self {
            blocks: blocks.collect(),
            count: points.len(),
        }
    }

    /// All pairs of these numbers: point `i + us.len() j` is `(us[i], vs[j])`.
    pub fn grid(us: &[f64], vs: &[f64]) -> Self {
        let points: Vec<[f64; 2]> = vs.iter().flat_map(|&v| us.iter().map(move |&u| [u, v])).collect();
        Self::new(&points)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.count
    }

    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

/// Positions and derivatives of a patch at eight points: position, `X_u`, `X_v`, `X_uu`, `X_uv`, `X_vv`.
#[derive(Clone, Copy, Debug)]
struct Jets([[Lanes; 3]; 6]);

/// What [`evaluate`] found, kept from patch to patch to save memory traffic.
#[derive(Clone, Debug, Default)]
pub struct Evaluated {
    blocks: Vec<Jets>,
    count: usize,
}

impl Evaluated {
    /// What holds at a point; second derivatives are only there where they were asked for.
    pub fn jet(&self, point: usize) -> Jet {
        let Jets(parts) = &self.blocks[point / WIDTH];
        let lane = point % WIDTH;
        let [position, u, v, uu, uv, vv] = parts.map(|part| part.map(|component| component.0[lane]));
        Jet {
            position,
            u,
            v,
            uu,
            uv,
            vv,
        }
    }

    /// Position, `X_u` and `X_v` at a point.
    pub fn first(&self, point: usize) -> [[f64; 3]; 3] {
        let Jets(parts) = &self.blocks[point / WIDTH];
        let lane = point % WIDTH;
        [0, 1, 2].map(|part: usize| parts[part].map(|component| component.0[lane]))
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.count
    }

    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// What holds at all points, in their order.
    pub fn jets(&self) -> impl Iterator<Item = Jet> {
        (0..self.count).map(|point| self.jet(point))
    }
}

/// How far derivatives are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Derivatives {
    First,
    Second,
}

/// Evaluates a patch at all places.
pub fn evaluate(processor: Processor, patch: &Patch, places: &Places, derivatives: Derivatives, into: &mut Evaluated) {
    into.count = places.count;
    into.blocks.resize(places.blocks.len(), Jets([[Lanes::ZERO; 3]; 6]));
    let (blocks, jets) = (&places.blocks, &mut into.blocks[..]);
    match derivatives {
        Derivatives::First => processor.run(Run::<false> { patch, blocks, jets }),
        Derivatives::Second => processor.run(Run::<true> { patch, blocks, jets }),
    }
}

struct Run<'a, const SECOND: bool> {
    patch: &'a Patch,
    blocks: &'a [Block],
    jets: &'a mut [Jets],
}

/// `sum_b C_ab g_b` for one component of a row of coefficients.
#[inline(always)]
fn row<V: Vector>(coefficients: &[V; 5], g: &[V; 15], first: usize) -> V {
    g[first] * coefficients[0]
        + g[first + 1] * coefficients[1]
        + g[first + 2] * coefficients[2]
        + g[first + 3] * coefficients[3]
        + g[first + 4] * coefficients[4]
}

impl<const SECOND: bool> Kernel for Run<'_, SECOND> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for index in 0..self.blocks.len() {
            let f: [V; 15] = load(&self.blocks[index].u);
            let g: [V; 15] = load(&self.blocks[index].v);
            let mut sums = [[V::constant(0.0); 3]; 6];
            for axis in 0..3 {
                for a in 0..5 {
                    let mut coefficients = [V::constant(0.0); 5];
                    for b in 0..5 {
                        coefficients[b] = V::constant(self.patch[5 * a + b][axis]);
                    }
                    let value = row(&coefficients, &g, 0);
                    let slope = row(&coefficients, &g, 5);
                    sums[0][axis] = sums[0][axis] + f[a] * value;
                    sums[1][axis] = sums[1][axis] + f[5 + a] * value;
                    sums[2][axis] = sums[2][axis] + f[a] * slope;
                    if SECOND {
                        let second = row(&coefficients, &g, 10);
                        sums[3][axis] = sums[3][axis] + f[10 + a] * value;
                        sums[4][axis] = sums[4][axis] + f[5 + a] * slope;
                        sums[5][axis] = sums[5][axis] + f[a] * second;
                    }
                }
            }
            let parts = if SECOND { 6 } else { 3 };
            for part in 0..parts {
                store(sums[part], &mut self.jets[index].0[part]);
            }
        }
    }
}
