//! What a model of a mixed finite element computation may be: a triangle mesh, and numbers that select vertices.

use crate::mesh::TriangleMesh;
use crate::mesh::band::{self, Joint, Section};
use crate::mesh::format::{self, Content};
use crate::mesh::planar::{self, DOMAINS, FAMILIES};
use crate::method::Failure;
use crate::method::model::{Generator, LoadedModel, ModelKind, Part, Role, keep};
use crate::method::setting::{Default, Field, Kind};
use serde_json::Value;
use std::sync::LazyLock;

/// A model once read or generated.
#[derive(Clone, Debug, Default)]
pub struct Model {
    pub mesh: TriangleMesh,
    /// The triangles of the inner domain, where the generator knows them.
    pub inside: Option<Vec<bool>>,
    /// The vertices solved for, where the generator knows them.
    pub free: Option<Vec<bool>>,
    /// Where fixed vertices go, if not where they are.
    pub targets: Option<Vec<[f64; 3]>>,
    /// The number of every vertex in the selection file.
    pub selection: Option<Vec<i64>>,
    pub notices: Vec<String>,
}

impl Model {
    /// Whether all points have the same third coordinate.
    pub fn is_planar(&self) -> bool {
        let level = self.mesh.points.first().map_or(0.0, |point| point[2]);
        self.mesh.points.iter().all(|point| point[2] == level)
    }
}

static FILE: &[Field] = &[Field {
    name: "scale",
    kind: Kind::Number { min: 1e-12, max: 1e12 },
    default: Default::Number(1.0),
    doc: "Factor for the coordinates in the file.",
}];

/// A number among a generator's parameters.
const fn number(name: &'static str, default: f64, min: f64, max: f64, doc: &'static str) -> Field {
    Field {
        name,
        kind: Kind::Number { min, max },
        default: Default::Number(default),
        doc,
    }
}

/// A count among a generator's parameters.
const fn count(name: &'static str, default: i64, min: i64, max: i64, doc: &'static str) -> Field {
    Field {
        name,
        kind: Kind::Integer { min, max },
        default: Default::Integer(default),
        doc,
    }
}

const SECTIONS: Kind = Kind::Choice(&[
    ("circle", "a circle of the given radius"),
    ("square", "a square of twice the given size"),
]);

/// Surfaces in space.
static SURFACES: &[Generator] = &[
    Generator {
        name: "joint",
        parameters: &[
            Field {
                name: "lower",
                kind: SECTIONS,
                default: Default::Text("circle"),
                doc: "Cross-section of the lower tube.",
            },
            Field {
                name: "upper",
                kind: SECTIONS,
                default: Default::Text("circle"),
                doc: "Cross-section of the upper tube.",
            },
            number(
                "lower_size",
                1.0,
                1e-6,
                1e6,
                "Radius or half the side of the lower tube.",
            ),
            number(
                "upper_size",
                0.5,
                1e-6,
                1e6,
                "Radius or half the side of the upper tube.",
            ),
            number("gap", 1.0, 1e-6, 1e6, "Height of the free band between the tubes."),
            number("height", 0.6, 1e-6, 1e6, "Height of each tube."),
            count("around", 64, 8, 4096, "Points around."),
        ],
        doc: "two tubes that are kept and a free band that joins them",
    },
    Generator {
        name: "strip",
        parameters: &[
            count("around", 64, 8, 4096, "Points around."),
            count("waves", 3, 0, 64, "Waves of the upper curve."),
            number(
                "height",
                1.5,
                0.01,
                100.0,
                "Height of the upper curve over the lower one, a circle of radius 1.",
            ),
        ],
        doc: "a free strip between two closed curves, over a straight tube as its domain",
    },
    Generator {
        name: "cap",
        parameters: &[
            count("rings", 16, 2, 2048, "Rings of triangles, an even number."),
            number(
                "angle",
                90.0,
                5.0,
                170.0,
                "Angle from the pole to the rim, in degrees; 90 is a half sphere.",
            ),
        ],
        doc: "a part of the unit sphere around its pole, with one hole",
    },
];

static FAMILY_NAMES: LazyLock<Vec<(&'static str, &'static str)>> =
    LazyLock::new(|| FAMILIES.iter().map(|&(_, name, doc)| (name, doc)).collect());

static KIND: LazyLock<ModelKind> = LazyLock::new(|| {
    let planar = DOMAINS.iter().map(|&(_, name, doc)| Generator {
        name,
        parameters: keep(vec![
            Field {
                name: "family",
                kind: Kind::Choice(keep(FAMILY_NAMES.clone())),
                default: Default::Text("regular"),
                doc: "How the triangles are laid out.",
            },
            Field {
                name: "cells",
                kind: Kind::Integer { min: 2, max: 2048 },
                default: Default::Integer(32),
                doc: "Cells per unit length, an even number (a multiple of 4 on an annulus).",
            },
            Field {
                name: "seed",
                kind: Kind::Integer { min: 0, max: i64::MAX },
                default: Default::Integer(1),
                doc: "Start of the random numbers of the families with random points.",
            },
        ]),
        doc,
    });
    ModelKind {
        roles: keep(vec![
            Role {
                name: "mesh",
                required: true,
                file: true,
                file_parameters: FILE,
                generator_key: "generate",
                generators: keep(planar.chain(SURFACES.iter().map(again)).collect()),
                doc: "The triangle mesh: a plane domain around an inner one, or a surface in space.",
            },
            Role {
                name: "selection",
                required: false,
                file: true,
                file_parameters: &[],
                generator_key: "generate",
                generators: &[],
                doc: "A text file with a whole number for every vertex of the mesh, one a line, for handles with select = \
                      \"file\"; a first line with their count, as in .dmat files, is skipped.",
            },
        ]),
    }
});

fn again(generator: &Generator) -> Generator {
    Generator {
        name: generator.name,
        parameters: generator.parameters,
        doc: generator.doc,
    }
}

/// The declaration.
pub fn kind() -> &'static ModelKind {
    &KIND
}

/// Reads or generates a model.
///
/// # Errors
/// `invalid-input` for a mesh or a selection that cannot be used.
pub fn load(model: &LoadedModel) -> Result<Model, Failure> {
    let part = model
        .parts
        .get("mesh")
        .ok_or_else(|| Failure::invalid("the model has no `mesh`; give it a file or a generator"))?;
    let mut loaded = match part {
        Part::File {
            name,
            bytes,
            parameters,
        } => read(
            name,
            bytes,
            parameters.get("scale").and_then(Value::as_f64).unwrap_or(1.0),
        )?,
        Part::Generated { generator, parameters } => generate(generator, parameters)?,
    };
    if let Some(Part::File { name, bytes, .. }) = model.parts.get("selection") {
        loaded.selection = Some(read_selection(name, bytes, loaded.mesh.points.len())?);
    }
    Ok(loaded)
}

fn generate(generator: &str, parameters: &Value) -> Result<Model, Failure> {
    let word = |name: &str, default: &'static str| parameters.get(name).and_then(Value::as_str).unwrap_or(default);
    let number = |name: &str, default: u64| parameters.get(name).and_then(Value::as_u64).unwrap_or(default);
    let size = |name: &str, default: f64| parameters.get(name).and_then(Value::as_f64).unwrap_or(default);
    let section = |name: &str| match word(name, "circle") {
        "square" => Section::Square,
        _ => Section::Circle,
    };
    match generator {
        "joint" => {
            let around = number("around", 64) as usize;
            let joint = Joint {
                lower: section("lower"),
                upper: section("upper"),
                lower_size: size("lower_size", 1.0),
                upper_size: size("upper_size", 0.5),
                gap: size("gap", 1.0),
                height: size("height", 0.6),
                around: if around.is_multiple_of(8) {
                    around
                } else {
                    around + 8 - around % 8
                },
            };
            let made = band::joint(&joint).map_err(|reason| Failure::invalid(format!("mesh \"joint\": {reason}")))?;
            return Ok(Model {
                mesh: made.mesh,
                inside: Some(made.inside),
                free: Some(made.free),
                ..Model::default()
            });
        }
        "strip" => {
            let (made, targets) = band::strip(
                number("around", 64) as usize,
                number("waves", 3) as usize,
                size("height", 1.5),
            );
            return Ok(Model {
                mesh: made.mesh,
                inside: Some(made.inside),
                free: Some(made.free),
                targets: Some(targets),
                ..Model::default()
            });
        }
        "cap" => {
            let mesh = band::cap(number("rings", 16) as usize, size("angle", 90.0).to_radians())
                .map_err(|reason| Failure::invalid(format!("mesh \"cap\": {reason}")))?;
            return Ok(Model {
                mesh,
                ..Model::default()
            });
        }
        _ => {}
    }
    let family = FAMILIES
        .iter()
        .find(|family| family.1 == word("family", "regular"))
        .ok_or_else(|| Failure::invalid(format!("unknown family \"{}\"", word("family", "regular"))))?;
    let domain = DOMAINS
        .iter()
        .find(|domain| domain.1 == generator)
        .ok_or_else(|| Failure::invalid(format!("unknown generator \"{generator}\"")))?;
    let planar = planar::generate(domain.0, family.0, number("cells", 32) as usize, number("seed", 1))
        .map_err(|reason| Failure::invalid(format!("mesh \"{generator}\": {reason}")))?;
    Ok(Model {
        mesh: planar.mesh,
        inside: Some(planar.inside),
        ..Model::default()
    })
}

fn read(name: &str, bytes: &[u8], scale: f64) -> Result<Model, Failure> {
    let content = format::read(name, bytes).map_err(|error| Failure::invalid(format!("mesh: {error}")))?;
    let Content {
        points,
        triangles,
        quads,
        mut notices,
        ..
    } = content;
    let mut cells = triangles;
    if !quads.is_empty() {
        notices.push(format!("{} quads split into triangles along a diagonal", quads.len()));
        cells.extend(quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]));
    }
    if cells.is_empty() {
        return Err(Failure::invalid(format!(
            "mesh: {name} holds no triangles; take the surface of the body"
        )));
    }
    if let Some(bad) = cells.iter().position(|[a, b, c]| a == b || b == c || a == c) {
        return Err(Failure::invalid(format!(
            "mesh: triangle {bad} (counted from 0) of {name} names a vertex twice; remove it"
        )));
    }
    let mut used = vec![false; points.len()];
    cells.iter().flatten().for_each(|&vertex| used[vertex as usize] = true);
    let unused = used.iter().filter(|&&used| !used).count();
    if unused > 0 {
        notices.push(format!("{unused} vertices belong to no triangle and keep their place"));
    }
    Ok(Model {
        mesh: TriangleMesh {
            points: points.into_iter().map(|point| point.map(|x| x * scale)).collect(),
            cells,
        },
        notices,
        ..Model::default()
    })
}

/// Reads a number a vertex.
fn read_selection(name: &str, bytes: &[u8], vertices: usize) -> Result<Vec<i64>, Failure> {
    let text =
        std::str::from_utf8(bytes).map_err(|_| Failure::invalid(format!("selection: {name} is no text file")))?;
    let mut lines = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty() && !line.trim_start().starts_with('#'))
        .peekable();
    // A .dmat file starts with the numbers of columns and rows.
    if let Some((_, first)) = lines.peek()
        && first.split_whitespace().count() == 2
    {
        let counts: Vec<&str> = first.split_whitespace().collect();
        if counts != ["1", &vertices.to_string()] {
            return Err(Failure::invalid(format!(
                "selection: {name} is for {} columns and {} rows, but the mesh has {vertices} vertices; it needs one number \
                 for each",
                counts[0], counts[1]
            )));
        }
        lines.next();
    }
    let mut numbers = Vec::new();
    for (line, word) in lines {
        let number: f64 = word
            .trim()
            .parse()
            .ok()
            .filter(|number: &f64| number.fract() == 0.0 && number.abs() < 9e15)
            .ok_or_else(|| {
                Failure::invalid(format!(
                    "selection: line {} of {name} is \"{}\", expected a whole number",
                    line + 1,
                    word.trim()
                ))
            })?;
        numbers.push(number as i64);
    }
    if numbers.len() != vertices {
        return Err(Failure::invalid(format!(
            "selection: {name} holds {} numbers, but the mesh has {vertices} vertices; give one for each",
            numbers.len()
        )));
    }
    Ok(numbers)
}
