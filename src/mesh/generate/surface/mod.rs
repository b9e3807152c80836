//! Generators of quadrilateral surfaces whose vertices and normals lie on a surface given by a formula, or on several
//! that meet in creases.

pub mod analytic;
pub mod creased;
pub mod cubed_sphere;
pub mod icosahedron;
pub mod poles;
pub mod saddle;
pub mod strip;
pub mod torus;

use super::{Arguments, Parameter, SplitMix};
use crate::mesh::quadrilateral::QuadrilateralMesh;
use analytic::Analytic;
use serde_json::Value;

/// A generated surface.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneratedSurface {
    /// With a unit normal for every point.
    pub mesh: QuadrilateralMesh,
    /// The surface on which the points lie, where there is one formula for it.
    pub exact: Option<Analytic>,
    /// What is known of its creases, where it has some.
    pub creased: Option<Creased>,
}

/// Creases of a generated surface and the smooth pieces between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Creased {
    /// Edges between pieces, smaller vertex first.
    pub sharp: Vec<[u32; 2]>,
    pub pieces: Vec<Analytic>,
    /// The piece of every quad.
    pub piece_of: Vec<u32>,
}

/// A kind of surface, as named in `generate = "torus"`.
#[derive(Debug)]
pub struct SurfaceGenerator {
    pub name: &'static str,
    pub doc: &'static str,
    pub parameters: &'static [Parameter],
    build: fn(&Arguments) -> Result<GeneratedSurface, String>,
}

/// Every generator of surfaces, in the order of the documentation.
pub fn surfaces() -> &'static [SurfaceGenerator] {
    const ALL: &[SurfaceGenerator] = &[
        cubed_sphere::SPHERE,
        cubed_sphere::ELLIPSOID,
        cubed_sphere::HEAD,
        torus::GENERATOR,
        icosahedron::GENERATOR,
        poles::GENERATOR,
        saddle::GENERATOR,
        strip::GENERATOR,
        creased::CYLINDER,
        creased::CUBE,
        creased::RIDGE,
    ];
    ALL
}

/// Runs the generator of this name with parameters from a table of numbers.
///
/// # Errors
/// For an unknown name or a bad parameter, with the mend.
pub fn generate_surface(name: &str, parameters: &Value) -> Result<GeneratedSurface, String> {
    let generator = surfaces()
        .iter()
        .find(|generator| generator.name == name)
        .ok_or_else(|| {
            let known: Vec<&str> = surfaces().iter().map(|generator| generator.name).collect();
            format!("unknown generator `{name}`; there are `{}`", known.join("`, `"))
        })?;
    (generator.build)(&Arguments::read("generator", name, generator.parameters, parameters)?)
}

/// The half axes of an ellipsoid.
const AXES: [Parameter; 3] = [axis("a", "x"), axis("b", "y"), axis("c", "z")];

const fn axis(name: &'static str, along: &'static str) -> Parameter {
    Parameter {
        name,
        whole: false,
        default: match along.as_bytes()[0] {
            b'x' => 1.0,
            b'y' => 0.8,
            _ => 0.6,
        },
        min: 1e-3,
        max: 1e3,
        doc: match along.as_bytes()[0] {
            b'x' => "half axis along x",
            b'y' => "half axis along y",
            _ => "half axis along z",
        },
    }
}

const JITTER: Parameter = Parameter {
    name: "jitter",
    whole: false,
    default: 0.0,
    min: 0.0,
    max: 0.3,
    doc: "random displacement of the vertices along the surface, as a fraction of a cell",
};
const SEED: Parameter = Parameter {
    name: "seed",
    whole: true,
    default: 0.0,
    min: 0.0,
    max: 9_007_199_254_740_991.0,
    doc: "start of the random numbers behind `jitter`; no effect without it",
};

impl Arguments {
    fn axes(&self) -> [f64; 3] {
        ["a", "b", "c"].map(|name| self.number(name))
    }
}

/// The mesh with the normals of the surface on which its points lie.
fn on(exact: Analytic, points: Vec<[f64; 3]>, quads: Vec<[u32; 4]>) -> GeneratedSurface {
    let normals = points.iter().map(|&point| exact.normal(point)).collect();
    GeneratedSurface {
        mesh: QuadrilateralMesh {
            points,
            quads,
            normals: Some(normals),
        },
        exact: Some(exact),
        creased: None,
    }
}

/// Moves unit vectors at random within a disc of radius `reach` and back onto the sphere.
fn shake_directions(directions: &mut [[f64; 3]], reach: f64, seed: u64) {
    let mut random = SplitMix(seed);
    for direction in directions {
        let moved: [f64; 3] = direction.map(|component| component + reach * (2.0 * random.unit() - 1.0));
        if reach > 0.0 {
            *direction = normalized(moved);
        }
    }
}

fn normalized(vector: [f64; 3]) -> [f64; 3] {
    let size = crate::mesh::length(vector);
    vector.map(|component| component / size)
}

/// Divides every quad of a coarse surface into `cells` by `cells` quads by bilinear interpolation of its corners. Points
/// on shared edges are shared; `coarse` must be oriented consistently.
fn refine(points: &[[f64; 3]], coarse: &[[u32; 4]], cells: usize) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    use std::collections::BTreeMap;
    let mut all = points.to_vec();
    let mut edges: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut quads = Vec::with_capacity(coarse.len() * cells * cells);
    let width = cells + 1;
    let mix = |corners: [[f64; 3]; 4], i: usize, j: usize| -> [f64; 3] {
        let (u, v) = (i as f64 / cells as f64, j as f64 / cells as f64);
        std::array::from_fn(|axis| {
            (1.0 - v) * ((1.0 - u) * corners[0][axis] + u * corners[1][axis])
                + v * ((1.0 - u) * corners[3][axis] + u * corners[2][axis])
        })
    };
    for quad in coarse {
        let corners = quad.map(|vertex| points[vertex as usize]);
        let mut names = vec![u32::MAX; width * width];
        let place = |i: usize, j: usize| j * width + i;
        // Corner numbers along each side, in the direction of the quad.
        let sides: [[usize; 4]; 4] = [[0, 0, 1, 0], [cells, 0, 0, 1], [cells, cells, 2, 0], [0, cells, 0, 2]];
        for side in 0..4 {
            let (a, b) = (quad[side], quad[(side + 1) % 4]);
            let key = [a.min(b), a.max(b)];
            let first = *edges.entry(key).or_insert_with(|| {
                let first = all.len() as u32;
                let [p, q] = key.map(|vertex| points[vertex as usize]);
                for step in 1..cells {
                    let t = step as f64 / cells as f64;
                    all.push(std::array::from_fn(|axis| (1.0 - t) * p[axis] + t * q[axis]));
                }
                first
            });
            let [i, j, along_i, along_j] = sides[side];
            let advance = |start: usize, along: usize, step: usize| match along {
                0 => start,
                1 => start + step,
                _ => start - step,
            };
            for step in 0..=cells {
                let name = if step == 0 {
                    a
                } else if step == cells {
                    b
                } else if a < b {
                    first + step as u32 - 1
                } else {
                    first + (cells - step) as u32 - 1
                };
                names[place(advance(i, along_i, step), advance(j, along_j, step))] = name;
            }
        }
        for j in 1..cells {
            for i in 1..cells {
                names[place(i, j)] = all.len() as u32;
                all.push(mix(corners, i, j));
            }
        }
        for j in 0..cells {
            for i in 0..cells {
                quads.push([(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| names[place(i, j)]));
            }
        }
    }
    (all, quads)
}
