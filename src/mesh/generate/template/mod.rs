//! Templates: simple quadrilateral surfaces that are fitted to a target, placed in the target's box.
//!
//! Sizes are asked for in quadrilaterals; the result has about as many. Faces are oriented outward.

use super::{Arguments, Parameter};
use crate::mesh::surface::Surface;
use serde_json::Value;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// A kind of template, as named in `generate = "box"`.
#[derive(Debug)]
pub struct Template {
    pub name: &'static str,
    pub doc: &'static str,
    pub parameters: &'static [Parameter],
    build: fn(&Arguments, [[f64; 3]; 2]) -> Surface,
}

/// Every template, in the order of the documentation.
pub fn templates() -> &'static [Template] {
    const ALL: &[Template] = &[
        Template {
            name: "box",
            doc: "The target's box as a grid of nearly square cells; for targets without handles.",
            parameters: &[QUADS, MARGIN, SPIKE],
            build: cuboid,
        },
        Template {
            name: "sphere",
            doc: "An ellipsoid in the target's box: a cube's grid bent onto it.",
            parameters: &[QUADS, MARGIN],
            build: sphere,
        },
        Template {
            name: "torus",
            doc: "A ring in the target's box around one of its axes; for targets with one handle.",
            parameters: &[QUADS, MARGIN, TUBE, AXIS],
            build: torus,
        },
    ];
    ALL
}

/// Runs the template of this name for a target with this box.
///
/// # Errors
/// For an unknown name or a bad parameter, with the mend.
pub fn generate_template(name: &str, parameters: &Value, target: [[f64; 3]; 2]) -> Result<Surface, String> {
    let template = templates()
        .iter()
        .find(|template| template.name == name)
        .ok_or_else(|| {
            let known: Vec<&str> = templates().iter().map(|template| template.name).collect();
            format!("unknown template `{name}`; there are `{}`", known.join("`, `"))
        })?;
    let arguments = Arguments::read("template", name, template.parameters, parameters)?;
    let margin = arguments.number("margin");
    let [low, high] = target;
    let diagonal = crate::mesh::length(crate::mesh::subtract(high, low));
    // A flat target still gets a template with room inside.
    let half: [f64; 3] =
        std::array::from_fn(|axis| (0.5 * (1.0 + margin) * (high[axis] - low[axis])).max(0.01 * diagonal));
    let centre: [f64; 3] = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
    let around = [
        std::array::from_fn(|axis| centre[axis] - half[axis]),
        std::array::from_fn(|axis| centre[axis] + half[axis]),
    ];
    Ok((template.build)(&arguments, around))
}

const QUADS: Parameter = Parameter {
    name: "quads",
    whole: true,
    default: 384.0,
    min: 6.0,
    max: 4_000_000.0,
    doc: "number of quadrilaterals wanted; the result is as near as the grid allows",
};
const MARGIN: Parameter = Parameter {
    name: "margin",
    whole: false,
    default: 0.0,
    min: -0.9,
    max: 10.0,
    doc: "by how much the template is larger than the target's box, as a fraction of it",
};
const SPIKE: Parameter = Parameter {
    name: "spike",
    whole: false,
    default: 0.0,
    min: 0.0,
    max: 10.0,
    doc: "length of a spike pulled out of the upper side, in diagonals of the box: a spurious part to be got rid of",
};
const TUBE: Parameter = Parameter {
    name: "tube",
    whole: false,
    default: 0.3,
    min: 0.01,
    max: 0.95,
    doc: "radius of the tube over the radius of the ring's circle",
};
const AXIS: Parameter = Parameter {
    name: "axis",
    whole: true,
    default: 2.0,
    min: 0.0,
    max: 2.0,
    doc: "the axis that the ring goes around: 0 for x, 1 for y, 2 for z",
};

/// The surface of a grid of `counts` boxes over the unit cube.
fn grid(counts: [usize; 3]) -> Surface {
    let mut surface = Surface::default();
    let mut index: BTreeMap<[usize; 3], u32> = BTreeMap::new();
    for axis in 0..3 {
        let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0, counts[axis]] {
            for i in 0..counts[first] {
                for j in 0..counts[second] {
                    let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[di, dj]| {
                        let mut place = [0; 3];
                        place[axis] = side;
                        place[first] = i + di;
                        place[second] = j + dj;
                        *index.entry(place).or_insert_with(|| {
                            let point = std::array::from_fn(|axis| place[axis] as f64 / counts[axis] as f64);
                            surface.points.push(point);
                            surface.points.len() as u32 - 1
                        })
                    });
                    if side == 0 {
                        quad.reverse();
                    }
                    surface.quads.push(quad);
                }
            }
        }
    }
    surface
}

/// Counts of a grid over a box of these extents with about as many quadrilaterals on its surface.
fn counts(wanted: f64, extents: [f64; 3]) -> [usize; 3] {
    let [x, y, z] = extents;
    let size = (2.0 * (x * y + y * z + z * x) / wanted).sqrt();
    extents.map(|extent| ((extent / size).round() as usize).max(1))
}

fn cuboid(arguments: &Arguments, [low, high]: [[f64; 3]; 2]) -> Surface {
    let extents: [f64; 3] = std::array::from_fn(|axis| high[axis] - low[axis]);
    let mut surface = grid(counts(arguments.number("quads"), extents));
    let spike = arguments.number("spike") * crate::mesh::length(extents);
    for point in &mut surface.points {
        let unit = *point;
        *point = std::array::from_fn(|axis| low[axis] + unit[axis] * extents[axis]);
        if unit[2] == 1.0 {
            // A hat over the middle fifth of the upper side.
            let away = ((unit[0] - 0.5).abs()).max((unit[1] - 0.5).abs());
            point[2] += spike * (1.0 - away / 0.2).max(0.0);
        }
    }
    surface
}

fn sphere(arguments: &Arguments, [low, high]: [[f64; 3]; 2]) -> Surface {
    let side = ((arguments.number("quads") / 6.0).sqrt().round() as usize).max(1);
    let mut surface = grid([side; 3]);
    for point in &mut surface.points {
        // Equal angles along the cube's sides keep the cells alike.
        let cube = point.map(|x| (std::f64::consts::FRAC_PI_4 * (2.0 * x - 1.0)).tan());
        let length = crate::mesh::length(cube);
        *point = std::array::from_fn(|axis| {
            0.5 * (low[axis] + high[axis]) + 0.5 * (high[axis] - low[axis]) * cube[axis] / length
        });
    }
    surface
}

fn torus(arguments: &Arguments, [low, high]: [[f64; 3]; 2]) -> Surface {
    let tube = arguments.number("tube");
    let axis = arguments.number("axis") as usize;
    // Square cells on average: ring over tube as the lengths of their circles.
    let around = ((arguments.number("quads") / tube).sqrt().round() as usize).max(3);
    let across = ((arguments.number("quads") / around as f64).round() as usize).max(3);
    let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut surface = Surface::default();
    for i in 0..around {
        for j in 0..across {
            let (u, v) = (TAU * i as f64 / around as f64, TAU * j as f64 / across as f64);
            let ring = (1.0 + tube * v.cos()) / (1.0 + tube);
            let mut unit = [0.0; 3];
            unit[first] = ring * u.cos();
            unit[second] = ring * u.sin();
            unit[axis] = v.sin();
            surface.points.push(std::array::from_fn(|axis| {
                0.5 * (low[axis] + high[axis]) + 0.5 * (high[axis] - low[axis]) * unit[axis]
            }));
            let at = |i: usize, j: usize| (i % around * across + j % across) as u32;
            surface
                .quads
                .push([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    surface
}
