//! Facets onto pixels: parallel projection, depth buffer, light from the eye's side, faint cell edges.

use super::colour::{self, Scale};
use super::cut::Facet;
use super::solid::Solid;

type Vector = [f64; 3];

fn dot(left: Vector, right: Vector) -> f64 {
    left[0] * right[0] + left[1] * right[1] + left[2] * right[2]
}

fn cross(left: Vector, right: Vector) -> Vector {
    [
        left[1] * right[2] - left[2] * right[1],
        left[2] * right[0] - left[0] * right[2],
        left[0] * right[1] - left[1] * right[0],
    ]
}

fn minus(left: Vector, right: Vector) -> Vector {
    [left[0] - right[0], left[1] - right[1], left[2] - right[2]]
}

fn unit(vector: Vector) -> Vector {
    let length = dot(vector, vector).sqrt();
    if length > 0.0 {
        vector.map(|part| part / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

/// Area in pixels of the facet in the middle by size, below which no edges are drawn.
const SMALLEST_OUTLINED: f64 = 30.0;

/// A picture in red, green, blue, opacity; the mesh fills it but for a margin. `eye` points from the mesh to the eye, the
/// third axis upwards.
pub fn render(
    facets: &[Facet],
    solid: &Solid,
    field: Option<usize>,
    scale: Scale,
    eye: Vector,
    (width, height): (usize, usize),
) -> Vec<u8> {
    let eye = unit(eye);
    let right = unit(cross([0.0, 0.0, 1.0], eye));
    let up = cross(eye, right);
    let project = |point: Vector| [dot(point, right), dot(point, up), dot(point, eye)];

    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for point in &solid.points {
        let place = project(*point);
        for axis in 0..3 {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        }
    }
    let margin = 0.94;
    let span = |axis: usize| (high[axis] - low[axis]).max(f64::MIN_POSITIVE);
    let zoom = margin * (width as f64 / span(0)).min(height as f64 / span(1));
    let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
    let screen = |point: Vector| {
        let place = project(point);
        [
            0.5 * width as f64 + zoom * (place[0] - middle[0]),
            0.5 * height as f64 - zoom * (place[1] - middle[1]),
            zoom * place[2],
        ]
    };

    let mut picture = Picture {
        width,
        height,
        pixels: vec![0; 4 * width * height],
        depth: vec![f64::NEG_INFINITY; width * height],
    };
    let light = unit([
        eye[0] + 0.25 * up[0] - 0.3 * right[0],
        eye[1] + 0.25 * up[1] - 0.3 * right[1],
        eye[2] + 0.25 * up[2],
    ]);
    for facet in facets {
        let corners: Vec<Vector> = facet.corners.iter().map(|corner| screen(*corner)).collect();
        let normal = normal(&facet.corners);
        let shade = if facet.section {
            1.0
        } else {
            0.42 + 0.5 * dot(normal, light).abs()
        };
        let inverted = solid.inverted[facet.cell as usize];
        let colour = match field {
            _ if inverted => colour::INVERTED,
            Some(field) => scale.colour(solid.fields[field].values[facet.cell as usize]),
            None => [120, 150, 190],
        };
        let colour = colour.map(|part| (f64::from(part) * shade).round() as u8);
        for index in 2..corners.len() {
            picture.triangle([corners[0], corners[index - 1], corners[index]], colour, inverted);
        }
    }
    // Where cells are no larger than a few pixels, their edges would only blacken them.
    let areas = facets.iter().map(|facet| {
        let corners: Vec<Vector> = facet.corners.iter().map(|corner| screen(*corner)).collect();
        let shares = (2..corners.len()).map(|index| {
            let (a, b, c) = (corners[0], corners[index - 1], corners[index]);
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs()
        });
        shares.sum::<f64>()
    });
    let mut areas: Vec<f64> = areas.collect();
    areas.sort_by(f64::total_cmp);
    if areas
        .get(areas.len() / 2)
        .is_some_and(|&median| median < SMALLEST_OUTLINED)
    {
        return picture.pixels;
    }
    for facet in facets {
        let corners: Vec<Vector> = facet.corners.iter().map(|corner| screen(*corner)).collect();
        for (index, corner) in corners.iter().enumerate() {
            if facet.sides[index] {
                picture.edge(*corner, corners[(index + 1) % corners.len()]);
            }
        }
    }
    picture.pixels
}

/// Newell's normal, which also serves polygons with nearly coinciding corners.
fn normal(corners: &[Vector]) -> Vector {
    let mut sum = [0.0; 3];
    for (index, &corner) in corners.iter().enumerate() {
        let next = corners[(index + 1) % corners.len()];
        let part = cross(minus(corner, corners[0]), minus(next, corners[0]));
        for axis in 0..3 {
            sum[axis] += part[axis];
        }
    }
    unit(sum)
}

struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
    depth: Vec<f64>,
}

impl Picture {
    fn triangle(&mut self, corners: [Vector; 3], colour: [u8; 3], striped: bool) {
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let bounds = |axis: usize, size: usize| {
            let low = a[axis].min(b[axis]).min(c[axis]).floor().max(0.0) as usize;
            let high = a[axis].max(b[axis]).max(c[axis]).ceil().clamp(0.0, size as f64) as usize;
            (low, high)
        };
        let (left, right) = bounds(0, self.width);
        let (top, bottom) = bounds(1, self.height);
        for row in top..bottom {
            let y = row as f64 + 0.5;
            for column in left..right {
                let x = column as f64 + 0.5;
                let second = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area;
                let third = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area;
                if second < 0.0 || third < 0.0 || second + third > 1.0 {
                    continue;
                }
                let depth = a[2] + second * (b[2] - a[2]) + third * (c[2] - a[2]);
                let index = row * self.width + column;
                if depth <= self.depth[index] {
                    continue;
                }
                self.depth[index] = depth;
                // Stripes tell inverted cells without colour.
                let dark = striped && (row + column) % 24 < 7;
                let paint = if dark { colour.map(|part| part / 2) } else { colour };
                self.pixels[4 * index..4 * index + 3].copy_from_slice(&paint);
                self.pixels[4 * index + 3] = 255;
            }
        }
    }

    /// Darkens what lies on the line and not before it.
    fn edge(&mut self, from: Vector, to: Vector) {
        let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs()).ceil();
        if !steps.is_finite() || steps > 1e5 {
            return;
        }
        for step in 0..=steps as usize {
            let share = if steps > 0.0 { step as f64 / steps } else { 0.0 };
            let place = [0, 1, 2].map(|axis| from[axis] + share * (to[axis] - from[axis]));
            if place[0] < 0.0 || place[1] < 0.0 || place[0] >= self.width as f64 || place[1] >= self.height as f64 {
                continue;
            }
            let index = place[1] as usize * self.width + place[0] as usize;
            if place[2] + 2.0 >= self.depth[index] && self.pixels[4 * index + 3] == 255 {
                for part in &mut self.pixels[4 * index..4 * index + 3] {
                    *part = (u16::from(*part) * 5 / 8) as u8;
                }
                // Once only, although neighbours share the edge: what is darkened moves before its neighbours' edges.
                self.depth[index] = self.depth[index].max(place[2] + 2.5);
            }
        }
    }
}
