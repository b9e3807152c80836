//! Hexahedra swept along paths: rods, rings, knots and what they join to.
//!
//! A square is carried along a path without turning about it, by double reflection (Wang, Jüttler, Zheng, Liu 2008); along
//! a closed path what is left to a quarter turn is spread evenly, so that the ends meet. Sections that coincide become
//! one, which closes rings and joins a path that starts on the side of another's cell.
//!
//! Every cell's corners are checked to be right-handed. Cells of paths that cross each other are not looked for.

use super::{MOST_CELLS, check_count};
use crate::linalg::vector3::{add, cross, dot, subtract, times};
use crate::mesh::length;
use crate::mesh::mixed::MixedMesh;
use std::collections::HashMap;

/// How paths become cells.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    /// Side of the square.
    pub width: f64,
    /// Wanted length of a cell along the path.
    pub step: f64,
    /// Radius of the arcs that replace corners. Zero: the path's points are the sections.
    pub bend: f64,
}

/// Shortest cell along a path, in widths. Well above what is welded.
const SHORTEST: f64 = 1e-3;
/// Farthest place from the origin, in widths: what is welded stays well above rounding.
const FARTHEST: f64 = 1e9;
/// A bend of less than half a step is one section where it also turns by less than this angle.
const SLIGHT: f64 = 0.1;

/// A place on a path with its unit tangent.
type Station = ([f64; 3], [f64; 3]);

/// Sweeps every path. Points on a straight part of a path are sections too.
///
/// # Errors
/// No path, a path of fewer than two points or with points too near each other or too far from the origin for the width, a
/// step too small for it, an arc that does not fit between its neighbours, a cell that is turned over, or too many cells.
pub fn sweep(paths: &[Vec<[f64; 3]>], sweep: Sweep) -> Result<MixedMesh, String> {
    if paths.is_empty() {
        return Err("no path is given; `paths` needs a list of lists of points".to_string());
    }
    let least = SHORTEST * sweep.width;
    if sweep.bend > 0.0 && sweep.step < least {
        return Err(format!(
            "a step of {} is too short for a width of {}; give {least} or more",
            sweep.step, sweep.width
        ));
    }
    let mut mesh = MixedMesh::default();
    for (index, path) in paths.iter().enumerate() {
        let at = |reason: String| format!("path {index}: {reason}");
        let closed = path.len() > 3 && length(subtract(path[0], path[path.len() - 1])) <= 1e-9 * sweep.width;
        let stations = stations(path, closed, sweep).map_err(at)?;
        check_count(mesh.hexahedra.len() + stations.len(), COARSER).map_err(at)?;
        let frames = frames(&stations, closed);
        let first = mesh.points.len() as u32;
        for (&(place, tangent), &side) in stations.iter().zip(&frames) {
            let up = cross(tangent, side);
            for [a, b] in [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]] {
                let offset = times(add(times(side, a), times(up, b)), sweep.width);
                mesh.points.push(add(place, offset));
            }
        }
        for section in 0..stations.len() as u32 - 1 {
            let cell: [u32; 8] = std::array::from_fn(|corner| first + 4 * section + corner as u32);
            let [from, to] = [section, section + 1].map(|section| stations[section as usize].0);
            let least = SHORTEST * sweep.width * sweep.width * length(subtract(to, from));
            if !right_handed(&mesh.points, cell, least) {
                return Err(at(format!(
                    "the cell between section {section} and the next is turned over: the path bends too sharply for a width \
                     of {}; raise `bend` or lower `width`",
                    sweep.width
                )));
            }
            mesh.hexahedra.push(cell);
        }
    }
    weld(&mut mesh, 1e-6 * sweep.width);
    Ok(mesh)
}

/// What lowers the count of cells.
const COARSER: &str = "raise `step`";

fn blend(from: [f64; 3], to: [f64; 3], share: f64) -> [f64; 3] {
    add(from, times(subtract(to, from), share))
}

fn unit(vector: [f64; 3]) -> [f64; 3] {
    times(vector, 1.0 / length(vector))
}

/// The sections' places and tangents.
fn stations(path: &[[f64; 3]], closed: bool, sweep: Sweep) -> Result<Vec<Station>, String> {
    if path.len() < 2 {
        return Err("it has fewer than two points".to_string());
    }
    let far = |point: &[f64; 3]| !(length(*point) <= FARTHEST * sweep.width);
    if let Some(point) = path.iter().position(far) {
        return Err(format!(
            "point {point} is so far from the origin that a width of {} is lost in rounding; move the paths nearer",
            sweep.width
        ));
    }
    let least = SHORTEST * sweep.width;
    let mut directions = Vec::with_capacity(path.len());
    for (index, pair) in path.windows(2).enumerate() {
        let along = subtract(pair[1], pair[0]);
        if length(along) < least {
            return Err(format!(
                "points {index} and {} are {} apart, too near each other for a width of {}",
                index + 1,
                length(along),
                sweep.width
            ));
        }
        directions.push(unit(along));
    }
    let last = path.len() - 1;
    // The directions before and after each point.
    let around = |point: usize| match point {
        0 if closed => [directions[last - 1], directions[0]],
        0 => [directions[0]; 2],
        _ if point == last && closed => [directions[last - 1], directions[0]],
        _ if point == last => [directions[last - 1]; 2],
        _ => [directions[point - 1], directions[point]],
    };
    if sweep.bend == 0.0 {
        return (0..=last)
            .map(|point| {
                let [before, after] = around(point);
                let sum = add(before, after);
                if length(sum) < 1e-6 {
                    return Err(format!("it turns back on itself at point {point}"));
                }
                Ok((path[point], unit(sum)))
            })
            .collect();
    }
    // How far each point's arc turns and reaches into the segments beside it; a slight bend has none.
    let mut reaches = Vec::with_capacity(path.len());
    for point in 0..=last {
        let [before, after] = around(point);
        let turn = length(cross(before, after)).atan2(dot(before, after));
        if turn > 3.1 {
            return Err(format!("it turns back on itself at point {point}"));
        }
        let slight = turn < SLIGHT && sweep.bend * turn < 0.5 * sweep.step;
        reaches.push(if slight {
            (0.0, 0.0)
        } else {
            (turn, sweep.bend * (0.5 * turn).tan())
        });
    }
    let pieces = |size: f64| (size / sweep.step).round().clamp(1.0, MOST_CELLS as f64) as usize;
    let mut result: Vec<Station> = Vec::new();
    if closed && reaches[0].0 > 0.0 {
        return Err("it is closed and starts at a corner; start it on a straight part".to_string());
    }
    let mean = |point: usize| {
        let [before, after] = around(point);
        unit(add(before, after))
    };
    result.push((path[0], mean(0)));
    for segment in 0..last {
        let (from, to, along) = (path[segment], path[segment + 1], directions[segment]);
        let whole = length(subtract(to, from));
        let straight = whole - reaches[segment].1 - reaches[segment + 1].1;
        if straight < -1e-9 * sweep.width {
            return Err(format!(
                "arcs of radius {} do not fit between points {segment} and {}, {whole} apart; lower `bend`",
                sweep.bend,
                segment + 1
            ));
        }
        let (turn, reach) = reaches[segment + 1];
        // Arcs that meet leave no straight part.
        if straight > 1e-9 * sweep.width {
            if straight < least {
                return Err(format!(
                    "arcs of radius {} leave a straight part of {straight} between points {segment} and {}, too short for a \
                     width of {}; change `bend` or move a point",
                    sweep.bend,
                    segment + 1,
                    sweep.width
                ));
            }
            let count = pieces(straight);
            for piece in 1..count {
                let at = reaches[segment].1 + straight * piece as f64 / count as f64;
                result.push((blend(from, to, at / whole), along));
            }
            result.push(match turn > 0.0 {
                true => (blend(to, from, reach / whole), along),
                false => (to, mean(segment + 1)),
            });
        }
        if turn > 0.0 {
            let after = directions[segment + 1];
            let start = blend(to, from, reach / whole);
            // The unit vector from the start of the arc to its centre.
            let inward = unit(subtract(after, times(along, turn.cos())));
            let count = pieces(sweep.bend * turn);
            for piece in 1..=count {
                let angle = turn * piece as f64 / count as f64;
                let (sine, cosine) = angle.sin_cos();
                let chord = add(times(along, sine), times(inward, 1.0 - cosine));
                let tangent = add(times(along, cosine), times(inward, sine));
                result.push((add(start, times(chord, sweep.bend)), tangent));
            }
        }
        check_count(result.len(), COARSER)?;
    }
    Ok(result)
}

/// The first of the square's axes at every station.
fn frames(stations: &[Station], closed: bool) -> Vec<[f64; 3]> {
    let (_, tangent) = stations[0];
    // Flat paths have sections that stand upright on their plane.
    let upright = if tangent[2].abs() < 0.9 {
        [0.0, 0.0, 1.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let mut sides = vec![unit(cross(upright, tangent))];
    for pair in stations.windows(2) {
        let [(from, before), (to, after)] = [pair[0], pair[1]];
        let side = sides[sides.len() - 1];
        let (side, before) = (
            reflected(side, subtract(to, from)),
            reflected(before, subtract(to, from)),
        );
        let side = reflected(side, subtract(after, before));
        // Rounding must not tilt the square.
        sides.push(unit(subtract(side, times(after, dot(side, after)))));
    }
    if closed {
        let (first, last) = (sides[0], sides[sides.len() - 1]);
        let behind = dot(cross(last, first), tangent).atan2(dot(last, first));
        let quarter = std::f64::consts::FRAC_PI_2;
        let twist = behind - quarter * (behind / quarter).round();
        let count = (sides.len() - 1) as f64;
        for (place, (side, &(_, tangent))) in sides.iter_mut().zip(stations).enumerate() {
            let (sine, cosine) = (twist * place as f64 / count).sin_cos();
            *side = add(times(*side, cosine), times(cross(tangent, *side), sine));
        }
    }
    sides
}

/// The vector mirrored at the plane across `normal`; itself where that vanishes.
fn reflected(vector: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let square = dot(normal, normal);
    if square == 0.0 {
        return vector;
    }
    subtract(vector, times(normal, 2.0 * dot(normal, vector) / square))
}

/// Whether the three edges at every corner of a hexahedron span a volume of more than `least`.
fn right_handed(points: &[[f64; 3]], cell: [u32; 8], least: f64) -> bool {
    let point = |corner: usize| points[cell[corner] as usize];
    (0..8).all(|corner| {
        let (base, turn) = (corner & 4, corner & 3);
        let edge = |other: usize| subtract(point(other), point(corner));
        let [x, y, z] = [
            edge(base + (turn + 1) % 4),
            edge(base + (turn + 3) % 4),
            edge(corner ^ 4),
        ];
        let volume = dot(cross(x, y), z);
        if base == 0 { volume > least } else { volume < -least }
    })
}

/// A vertex nearer than `tolerance` to an earlier one is that one.
fn weld(mesh: &mut MixedMesh, tolerance: f64) {
    // Cells of space so large that a vertex's neighbours are in the one or two cells around it along each axis.
    let size = 64.0 * tolerance;
    let cell = |coordinate: f64| (coordinate / size).floor() as i64;
    let mut kept: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut names = Vec::with_capacity(mesh.points.len());
    let mut points: Vec<[f64; 3]> = Vec::with_capacity(mesh.points.len());
    for &point in &mesh.points {
        let [low, high] = [-tolerance, tolerance].map(|shift| point.map(|coordinate| cell(coordinate + shift)));
        let mut found = None;
        for i in low[0]..=high[0] {
            for j in low[1]..=high[1] {
                for k in low[2]..=high[2] {
                    let near = kept.get(&[i, j, k]).into_iter().flatten();
                    let near = near.filter(|&&other| length(subtract(points[other as usize], point)) <= tolerance);
                    found = near.copied().chain(found).min();
                }
            }
        }
        names.push(found.unwrap_or_else(|| {
            let name = points.len() as u32;
            points.push(point);
            kept.entry(point.map(cell)).or_default().push(name);
            name
        }));
    }
    for corner in mesh.hexahedra.iter_mut().flatten() {
        *corner = names[*corner as usize];
    }
    mesh.points = points;
}
