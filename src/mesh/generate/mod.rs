//! Generators of tetrahedral meshes, sized by the number of tetrahedra asked for: no file is needed to run an experiment.
//!
//! All of them bend a grid of the unit cube into shape, so each vertex has a natural position in the unit cube; for the
//! boundary vertices this is a bijective map onto the cube's surface, face by face, which [`super::target`] starts from.
//! Every result has positive tetrahedra only; the same parameters give the same bits.

pub mod lattice;
pub mod ball;
pub mod bar;
pub mod bumpy;
pub mod cube;
pub mod ellipsoid;
pub mod shape;
pub mod star;
pub mod surface;
pub mod template;
pub mod twisted_grid;

use super::connectivity;
use super::quality::scaled_jacobian;
use super::{TetrahedralMesh, length, subtract};
use serde_json::Value;
use std::collections::BTreeMap;

/// A generated mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Generated {
    pub mesh: TetrahedralMesh,
    /// A position in the unit cube for every vertex. A boundary vertex lies on the faces of the cube on which it has a
    /// coordinate of exactly 0 or 1; every boundary triangle lies in one face, with positive area seen from outside.
    pub natural: Option<Vec<[f64; 3]>>,
}

/// A parameter of a generator or target shape: always a number.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    pub name: &'static str,
    /// Whether only whole numbers are allowed.
    pub whole: bool,
    pub default: f64,
    pub min: f64,
    pub max: f64,
    /// Meaning and unit.
    pub doc: &'static str,
}

/// A kind of shape, as named in `generate = "ball"`.
#[derive(Debug)]
pub struct Generator {
    pub name: &'static str,
    pub doc: &'static str,
    pub parameters: &'static [Parameter],
    build: fn(&Arguments) -> Result<Generated, String>,
}

/// Every generator, in the order of the documentation.
pub fn generators() -> &'static [Generator] {
    const ALL: &[Generator] = &[
        ball::GENERATOR,
        cube::GENERATOR,
        bar::GENERATOR,
        ellipsoid::GENERATOR,
        bumpy::GENERATOR,
        star::GENERATOR,
        twisted_grid::GENERATOR,
    ];
    ALL
}

/// Values for all parameters of a generator or shape, checked against their limits.
#[derive(Clone, Debug, PartialEq)]
pub struct Arguments(BTreeMap<&'static str, f64>);

impl Arguments {
    /// Reads a table of numbers; absent ones get their defaults. `kind` and `name` say in messages whose they are.
    ///
    /// # Errors
    /// Names the parameter that is unknown, no number, not whole, or outside its limits.
    pub(super) fn read(kind: &str, name: &str, parameters: &[Parameter], table: &Value) -> Result<Self, String> {
        let empty = serde_json::Map::new();
        let given = match table {
            Value::Null => &empty,
            Value::Object(given) => given,
            _ => return Err(format!("the parameters of {kind} `{name}` are not a table")),
        };
        if let Some(unknown) = given
            .keys()
            .find(|key| parameters.iter().all(|known| known.name != **key))
        {
            let known: Vec<&str> = parameters.iter().map(|known| known.name).collect();
            let known = known.join("`, `");
            return Err(format!(
                "{kind} `{name}` has no parameter `{unknown}`; it has `{known}`"
            ));
        }
        let mut values = BTreeMap::new();
        for parameter in parameters {
            let Parameter { name, min, max, .. } = *parameter;
            let value = match given.get(name) {
                None => parameter.default,
                Some(value) => value
                    .as_f64()
                    .ok_or_else(|| format!("parameter `{name}` is not a number"))?,
            };
            if parameter.whole && value.fract() != 0.0 {
                return Err(format!("parameter `{name}` is {value}, but must be a whole number"));
            }
            if !(min..=max).contains(&value) {
                return Err(format!(
                    "parameter `{name}` is {value}, but must be within {min} and {max}"
                ));
            }
            values.insert(name, value);
        }
        Ok(Self(values))
    }

    /// The value of a declared parameter.
    pub(super) fn number(&self, name: &str) -> f64 {
        *self.0.get(name).expect("every declared parameter has a value")
    }

    /// The three parameters that all lattice generators share.
    fn grid(&self) -> Grid {
        Grid {
            tetrahedra: self.number("tetrahedra") as usize,
            jitter: self.number("jitter"),
            seed: self.number("seed") as u64,
        }
    }
}

/// Runs the generator of this name with parameters from a table of numbers.
///
/// # Errors
/// For an unknown name, a bad parameter, or a shape too wild for the number of tetrahedra; each with the mend.
pub fn generate(name: &str, parameters: &Value) -> Result<Generated, String> {
    let generator = generators()
        .iter()
        .find(|generator| generator.name == name)
        .ok_or_else(|| {
            let known: Vec<&str> = generators().iter().map(|generator| generator.name).collect();
            format!("unknown generator `{name}`; there are `{}`", known.join("`, `"))
        })?;
    (generator.build)(&Arguments::read("generator", name, generator.parameters, parameters)?)
}

/// How fine and how regular a generated mesh is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Number of tetrahedra wanted; the result is within 6 % of it from 1000 on, and the nearest possible below.
    pub tetrahedra: usize,
    /// Random displacement of the interior vertices, as a fraction of the shortest edge at each.
    pub jitter: f64,
    pub seed: u64,
}

const TETRAHEDRA: Parameter = Parameter {
    name: "tetrahedra",
    whole: true,
    default: 12_600.0,
    min: 96.0,
    max: 50_000_000.0,
    doc: "number of tetrahedra wanted; the result is within 6 % of it from 1000 on, the nearest possible below",
};
const JITTER: Parameter = Parameter {
    name: "jitter",
    whole: false,
    default: 0.0,
    min: 0.0,
    max: 1.0,
    doc: "random displacement of the interior vertices, as a fraction of the shortest edge at each",
};
const SEED: Parameter = Parameter {
    name: "seed",
    whole: true,
    default: 0.0,
    min: 0.0,
    max: 9_007_199_254_740_991.0,
    doc: "start of the random numbers behind `jitter`; no effect without it",
};

/// Bends the body-centred lattice of the unit cube into shape, relaxes it where it came out poor and applies the jitter.
///
/// `extents` are the rough sizes of the shape along the cube's axes and set the numbers of boxes; `bend` takes a point
/// of the cube `[-1, 1]^3`.
fn bend_lattice(grid: &Grid, extents: [f64; 3], bend: impl Fn([f64; 3]) -> [f64; 3]) -> Result<Generated, String> {
    let mut mesh = lattice::body_centred(lattice::counts_for(grid.tetrahedra, extents));
    let natural = mesh.points.clone();
    for point in &mut mesh.points {
        *point = bend(point.map(|coordinate| 2.0 * coordinate - 1.0));
    }
    let mut interior = Interior::of(mesh);
    interior.relax();
    if grid.jitter > 0.0 {
        interior.shake(grid.jitter, grid.seed);
    }
    valid(interior.mesh, natural)
}

/// Passes a mesh on whose tetrahedra are all positive.
fn valid(mesh: TetrahedralMesh, natural: Vec<[f64; 3]>) -> Result<Generated, String> {
    let inverted = mesh
        .cells
        .iter()
        .filter(|&&cell| scaled_jacobian(mesh.corners(cell)) < 1e-6)
        .count();
    if inverted > 0 {
        let total = mesh.cells.len();
        return Err(format!(
            "{inverted} of {total} generated tetrahedra are flat or inverted; ask for more tetrahedra or a milder shape"
        ));
    }
    Ok(Generated {
        mesh,
        natural: Some(natural),
    })
}

/// A mesh whose interior vertices may move.
struct Interior {
    mesh: TetrahedralMesh,
    on_boundary: Vec<bool>,
    around: connectivity::Rows,
}

/// Tetrahedra with a smaller scaled Jacobian are worth improving.
const POOR: f64 = 0.3;

impl Interior {
    fn of(mesh: TetrahedralMesh) -> Self {
        let vertices = mesh.points.len();
        let on_boundary = connectivity::boundary(&mesh.cells, vertices).mask;
        Self {
            on_boundary,
            around: connectivity::incidence(&mesh.cells, vertices),
            mesh,
        }
    }

    /// The scaled Jacobians around a vertex.
    fn qualities(&self, vertex: usize) -> impl Iterator<Item = f64> {
        let cells = self.around.row(vertex).iter();
        cells.map(|&cell| scaled_jacobian(self.mesh.corners(self.mesh.cells[cell as usize])))
    }

    /// The smallest scaled Jacobian around a vertex.
    fn worst(&self, vertex: usize) -> f64 {
        self.qualities(vertex).fold(f64::INFINITY, f64::min)
    }

    /// The shortest edge at a vertex.
    fn shortest(&self, vertex: usize) -> f64 {
        let here = self.mesh.points[vertex];
        let others = self
            .around
            .row(vertex)
            .iter()
            .flat_map(|&cell| self.mesh.cells[cell as usize]);
        others
            .filter(|&other| other as usize != vertex)
            .map(|other| length(subtract(self.mesh.points[other as usize], here)))
            .fold(f64::INFINITY, f64::min)
    }

    /// Raises the smallest scaled Jacobian around each interior vertex where it is [`POOR`], by a search along the axes
    /// with falling steps; at most eight sweeps, each over the vertices around which something has moved.
    fn relax(&mut self) {
        let mut due: Vec<bool> = self.on_boundary.iter().map(|on| !on).collect();
        for _ in 0..8 {
            let mut moved = false;
            for vertex in 0..due.len() {
                if std::mem::take(&mut due[vertex]) && self.improve(vertex) {
                    moved = true;
                    for &cell in self.around.row(vertex) {
                        for other in self.mesh.cells[cell as usize] {
                            due[other as usize] = !self.on_boundary[other as usize];
                        }
                    }
                }
            }
            if !moved {
                break;
            }
        }
    }

    /// Moves one vertex to a better place, if it needs one and there is one near.
    fn improve(&mut self, vertex: usize) -> bool {
        let mut best = self.worst(vertex);
        if best >= POOR {
            return false;
        }
        let mut step = 0.3 * self.shortest(vertex);
        let mut moved = false;
        for _ in 0..6 {
            let mut better = false;
            for axis in 0..3 {
                for sign in [-1.0, 1.0] {
                    let here = self.mesh.points[vertex];
                    self.mesh.points[vertex][axis] += sign * step;
                    if self.qualities(vertex).all(|quality| quality > best + 1e-4) {
                        best = self.worst(vertex);
                        better = true;
                    } else {
                        self.mesh.points[vertex] = here;
                    }
                }
            }
            moved |= better;
            if !better {
                step /= 2.0;
            }
        }
        moved
    }

    /// Moves each interior vertex by a random vector inside a ball of `jitter` times its shortest edge. A move that
    /// would take a tetrahedron below both a scaled Jacobian of 0.05 and its present one is halved, and given up after
    /// six halvings.
    fn shake(&mut self, jitter: f64, seed: u64) {
        let mut random = SplitMix(seed);
        for vertex in 0..self.mesh.points.len() {
            // Numbers are drawn for every vertex, so that one refused move does not change the others.
            let direction = loop {
                let candidate: [f64; 3] = std::array::from_fn(|_| 2.0 * random.unit() - 1.0);
                if length(candidate) <= 1.0 {
                    break candidate;
                }
            };
            if self.on_boundary[vertex] {
                continue;
            }
            let here = self.mesh.points[vertex];
            let floor = self.worst(vertex).min(0.05);
            let mut step = jitter * self.shortest(vertex);
            for _ in 0..7 {
                self.mesh.points[vertex] = std::array::from_fn(|axis| here[axis] + step * direction[axis]);
                if self.worst(vertex) >= floor {
                    break;
                }
                self.mesh.points[vertex] = here;
                step /= 2.0;
            }
        }
    }
}

/// The SplitMix64 generator (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014): small, and the
/// same on every machine.
struct SplitMix(u64);

impl SplitMix {
    /// Uniform in `[0, 1)`, with 53 random bits.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ bits >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }
}
