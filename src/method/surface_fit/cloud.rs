//! Targets that are clouds of points: reading them, and the distance from every point to the fit.
//!
//! A cloud has no surface to integrate over. Its term is the sum over the points of their squared distances to the
//! fit, each point with the same weight; the foot on the nearest triangle is differentiated with the triangle, which
//! is exact where the nearest triangle is the only one.

use crate::geometry::closest_point::{ClosestPoint, Nearest};
use crate::mesh::{TriangleMesh, area_vector, cross, dot, length, subtract};

/// Most bytes of a file that are read as points.
const LARGEST: usize = 2 << 30;

/// The points of a text with three or more numbers a line, the first three being coordinates. `None` where the name
/// does not say that it is one (`.xyz`, `.pts`).
///
/// # Errors
/// A line that is not a point, with its number, and a file beyond the size limit.
pub fn read(name: &str, bytes: &[u8]) -> Result<Option<Vec<[f64; 3]>>, String> {
    if !(name.ends_with(".xyz") || name.ends_with(".pts")) {
        return Ok(None);
    }
    if bytes.len() > LARGEST {
        return Err(format!(
            "{name}: {} bytes are more than the {LARGEST} that are read; thin the cloud out",
            bytes.len()
        ));
    }
    let text = std::str::from_utf8(bytes).map_err(|error| {
        format!(
            "{name}: byte {} is not text; give three numbers a line",
            error.valid_up_to()
        )
    })?;
    let mut points = Vec::new();
    let mut announced = None;
    for (line, row) in text.lines().enumerate() {
        let row = row.trim();
        if row.is_empty() || row.starts_with('#') {
            continue;
        }
        if points.is_empty()
            && announced.is_none()
            && let Ok(count) = row.parse::<usize>()
        {
            // The first line may be a count.
            announced = Some(count);
            continue;
        }
        let mut words = row.split_whitespace();
        let mut number = || {
            words
                .next()
                .and_then(|word| word.parse::<f64>().ok())
                .filter(|x| x.is_finite())
        };
        match [number(), number(), number()] {
            [Some(x), Some(y), Some(z)] => points.push([x, y, z]),
            _ => {
                let shown: String = row.chars().take(40).collect();
                return Err(format!(
                    "{name}:{}: a point needs three finite numbers, here is `{shown}`",
                    line + 1
                ));
            }
        }
    }
    if let Some(count) = announced.filter(|&count| count != points.len()) {
        return Err(format!(
            "{name}: the first line announces {count} points and {} follow; complete the file or mend the count",
            points.len()
        ));
    }
    Ok(Some(points))
}

/// Where a point meets a triangle: its shares of the triangle's corners.
pub fn shares([a, b, c]: [[f64; 3]; 3], x: [f64; 3]) -> [f64; 3] {
    let whole = area_vector([a, b, c]);
    let square = dot(whole, whole);
    if square > 0.0 {
        let second = dot(cross(subtract(x, a), subtract(c, a)), whole) / square;
        let third = dot(cross(subtract(b, a), subtract(x, a)), whole) / square;
        return [1.0 - second - third, second, third];
    }
    // Without area: along the longest edge.
    let ends = [(0, 1), (1, 2), (2, 0)];
    let corners = [a, b, c];
    let edge = |&(i, j): &(usize, usize)| length(subtract(corners[j], corners[i]));
    let longest = ends
        .iter()
        .fold(ends[0], |best, end| if edge(end) > edge(&best) { *end } else { best });
    let along = subtract(corners[longest.1], corners[longest.0]);
    let square = dot(along, along);
    let t = if square > 0.0 {
        (dot(subtract(x, corners[longest.0]), along) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let mut shares = [0.0; 3];
    shares[longest.0] = 1.0 - t;
    shares[longest.1] += t;
    shares
}

/// `weight` times the sum of the points' squared distances to a surface. `visit` gets, for every point, the triangle's
/// corners, the shares of the foot and the vector from the point to the foot.
pub fn distance(
    points: &[[f64; 3]],
    surface: &TriangleMesh,
    weight: f64,
    mut visit: impl FnMut([u32; 3], [f64; 3], [f64; 3]),
) -> f64 {
    let tree = ClosestPoint::new(surface);
    let mut found = vec![
        Nearest {
            squared_distance: f64::INFINITY,
            triangle: 0
        };
        points.len()
    ];
    tree.nearest_each(points, None, &mut found);
    let mut sum = 0.0;
    for (&point, nearest) in points.iter().zip(&found) {
        let foot = tree.foot(nearest.triangle, point);
        let cell = surface.cells[nearest.triangle as usize];
        let offset = subtract(foot, point);
        sum += dot(offset, offset);
        visit(cell, shares(surface.corners(cell), foot), offset);
    }
    weight * sum
}
