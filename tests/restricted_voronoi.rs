//! The restricted Voronoi diagram against brute force, on random and on adversarial inputs.

use crate::sample::Noise;
use vargeo::geometry::point_tree::PointTree;
use vargeo::geometry::restricted_voronoi::{Compatibility, Error, Label, RestrictedVoronoi, Way};
use vargeo::linalg::vector3::{cross, subtract};

type Point = [f64; 3];

fn square(a: Point) -> f64 {
    a.iter().map(|x| x * x).sum()
}

fn area(polygon: &[Point]) -> f64 {
    let mut sum = [0.0; 3];
    for k in 2..polygon.len() {
        let part = cross(subtract(polygon[k - 1], polygon[0]), subtract(polygon[k], polygon[0]));
        sum = std::array::from_fn(|axis| sum[axis] + part[axis]);
    }
    0.5 * square(sum).sqrt()
}

/// Triangles that share no vertex.
fn soup(corners: Vec<Point>) -> (Vec<Point>, Vec<[u32; 3]>) {
    let cells = (0..corners.len() as u32 / 3)
        .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
        .collect();
    (corners, cells)
}

/// A piece by definition: the triangle cut by the bisector with every other site in turn. `offsets` are added to the
/// squared distances.
fn brute_force(triangle: [Point; 3], sites: &[Point], offsets: &[f64], i: usize) -> Vec<Point> {
    let mut polygon = triangle.to_vec();
    for (j, &other) in sites.iter().enumerate() {
        if j == i {
            continue;
        }
        let side = |x: Point| square(subtract(x, sites[i])) + offsets[i] - square(subtract(x, other)) - offsets[j];
        let old = std::mem::take(&mut polygon);
        for k in 0..old.len() {
            let (a, b) = (old[k], old[(k + 1) % old.len()]);
            let (s, t) = (side(a), side(b));
            if s <= 0.0 {
                polygon.push(a);
            }
            if (s <= 0.0) != (t <= 0.0) {
                polygon.push(std::array::from_fn(|axis| a[axis] + s / (s - t) * (b[axis] - a[axis])));
            }
        }
    }
    polygon
}

/// Checks what holds for every input: areas sum to the triangles', every piece's points are nearest to its site, edges
/// lie where their labels say. Returns the number of pieces.
fn check(name: &str, points: &[Point], cells: &[[u32; 3]], sites: &[Point]) -> usize {
    let mut diagram = RestrictedVoronoi::new(points, cells).expect("a valid surface");
    let mut areas = vec![0.0; cells.len()];
    let mut owners = std::collections::BTreeSet::new();
    let extent = points
        .iter()
        .chain(sites)
        .map(|x| square(*x))
        .fold(0.0, f64::max)
        .max(1e-300);
    let near = |x: Point| {
        sites
            .iter()
            .map(|site| square(subtract(x, *site)))
            .fold(f64::INFINITY, f64::min)
    };
    diagram.pieces(points, &PointTree::new(sites), None, |piece| {
        let owner = sites[piece.site as usize];
        assert!(
            owners.insert((piece.triangle, piece.site)),
            "{name}: site {} owns two pieces of triangle {}",
            piece.site,
            piece.triangle
        );
        areas[piece.triangle as usize] += piece.area;
        let count = piece.polygon.len();
        for k in 0..count {
            let (from, to) = (piece.polygon[k], piece.polygon[(k + 1) % count]);
            let middle: Point = std::array::from_fn(|axis| 0.5 * (from[axis] + to[axis]));
            for x in [from, middle] {
                let excess = square(subtract(x, owner)) - near(x);
                assert!(
                    excess <= 1e-12 * extent,
                    "{name}: {excess:.1e} farther than the nearest site"
                );
            }
            match piece.labels[k] {
                Label::Site(other) => {
                    let other = square(subtract(middle, sites[other as usize]));
                    let off = (other - square(subtract(middle, owner))).abs();
                    assert!(
                        off <= 1e-11 * extent,
                        "{name}: an edge is off its bisector by {off:.1e}"
                    );
                }
                Label::Edge(k) => {
                    let cell = cells[piece.triangle as usize].map(|v| points[v as usize]);
                    let (a, b) = (cell[k as usize], cell[(k as usize + 1) % 3]);
                    let off = area(&[a, b, middle]);
                    assert!(
                        off <= 1e-12 * extent,
                        "{name}: an edge is off the triangle's by {off:.1e}"
                    );
                }
            }
        }
    });
    for (cell, sum) in cells.iter().zip(&areas) {
        let corners = cell.map(|v| points[v as usize]);
        let whole = area(&corners);
        let longest = (0..3)
            .map(|k| square(subtract(corners[k], corners[(k + 1) % 3])))
            .fold(0.0, f64::max);
        assert!(
            (sum - whole).abs() <= 1e-9 * whole + 1e-13 * longest,
            "{name}: pieces of area {sum:e} in a triangle of area {whole:e}"
        );
    }
    owners.len()
}

#[test]
fn brute_force_on_random_soups() {
    let mut random = Noise(1);
    for (triangles, sites, size) in [
        (40, 1, 1.0),
        (30, 12, 1.0),
        (30, 60, 0.5),
        (200, 30, 0.05),
        (4, 150, 2.0),
    ] {
        let mut corners = Vec::new();
        for _ in 0..triangles {
            let centre = random.point();
            for corner in random.points(3) {
                corners.push(std::array::from_fn(|k| centre[k] + size * corner[k]));
            }
        }
        let (points, cells) = soup(corners);
        let sites = random.points(sites);
        check("random", &points, &cells, &sites);
        let mut found = std::collections::BTreeMap::new();
        let mut diagram = RestrictedVoronoi::new(&points, &cells).expect("a valid surface");
        diagram.pieces(&points, &PointTree::new(&sites), None, |piece| {
            assert!((area(piece.polygon) - piece.area).abs() < 1e-12);
            found.insert((piece.triangle as usize, piece.site as usize), piece.area);
        });
        for (triangle, cell) in cells.iter().enumerate() {
            let corners = cell.map(|v| points[v as usize]);
            for i in 0..sites.len() {
                let expected = area(&brute_force(corners, &sites, &vec![0.0; sites.len()], i));
                let area = found.get(&(triangle, i)).copied().unwrap_or(0.0);
                assert!(
                    (area - expected).abs() < 1e-12 * size * size,
                    "triangle {triangle}, site {i}: area {area} and {expected}"
                );
            }
        }
    }
}

/// A grid of points with the given spacing, `n` by `n` and at most four layers.
fn grid(n: usize, spacing: f64) -> Vec<Point> {
    (0..n * n * n.min(4))
        .map(|k| [k % n, k / n % n, k / (n * n)].map(|c| c as f64 * spacing))
        .collect()
}

#[test]
fn adversarial_inputs() {
    let square_at = |z: f64| {
        soup(vec![
            [0.1, 0.2, z],
            [2.7, 0.1, z],
            [2.9, 2.8, z],
            [0.1, 0.2, z],
            [2.9, 2.8, z],
            [0.3, 2.6, z],
        ])
    };
    // In the middle between two layers of a grid every piece has two equally near sites; so it is at any height that
    // rounding moves off the middle.
    for spacing in [1.0, 0.1, 0.3] {
        let sites = grid((3.0 / spacing) as usize + 1, spacing);
        for height in [
            0.5 * spacing,
            0.5 * spacing * (1.0 + 1e-16),
            0.5 * spacing * (1.0 + 1e-13),
            spacing,
        ] {
            let (points, cells) = square_at(height);
            check("between the layers of a grid", &points, &cells, &sites);
        }
    }
    // Triangles along the cells' own faces and through their corners.
    let (points, cells) = soup(vec![
        [0.5, 0.5, 0.5],
        [1.5, 0.5, 0.5],
        [1.5, 1.5, 1.5],
        [0.5, 0.0, 0.0],
        [0.5, 2.0, 0.0],
        [0.5, 2.0, 2.0],
    ]);
    check("on the faces of cells", &points, &cells, &grid(3, 1.0));
    // Sites in one place, alone and among others, and as the vertices of the surface.
    let (points, cells) = square_at(0.3);
    let mut sites = grid(4, 1.0);
    sites.extend(grid(4, 1.0));
    let pieces = check("twins", &points, &cells, &sites);
    assert_eq!(pieces, check("without twins", &points, &cells, &grid(4, 1.0)));
    check("one place", &points, &cells, &[[1.0, 1.0, 1.0]; 20]);
    check("vertices as sites", &points, &cells, &points);
    // All sites as near to one point of the triangle.
    let circle: Vec<Point> = (0..40)
        .map(|k| (k as f64 / 40.0 * std::f64::consts::TAU).sin_cos())
        .map(|(s, c)| [1.5 + c, 1.5 + s, 0.3])
        .collect();
    check("on a circle", &points, &cells, &circle);
    let sphere: Vec<Point> = circle
        .iter()
        .map(|x| [x[0], 1.5, 0.3 + x[1] - 1.5])
        .chain(circle.iter().copied())
        .collect();
    check("on a sphere", &points, &cells, &sphere);
    // Bisectors parallel to the triangle.
    let column: Vec<Point> = (0..30).map(|k| [1.0, 1.0, k as f64 * 0.1]).collect();
    check("above each other", &points, &cells, &column);
    // Many sites in one triangle, in a grid in its plane and at random, and far from it.
    let mut random = Noise(3);
    let plane: Vec<Point> = (0..1600)
        .map(|k| [(k % 40) as f64 * 0.07, (k / 40) as f64 * 0.07, 0.3])
        .collect();
    check("grid in the plane", &points, &cells, &plane);
    let cloud: Vec<Point> = random
        .points(1500)
        .iter()
        .map(|x| [1.5 + x[0], 1.5 + x[1], 0.3 + 0.01 * x[2]])
        .collect();
    check("cloud in the plane", &points, &cells, &cloud);
    // Functions that come close to being lowest but are not.
    for seed in 0..6 {
        let mut random = Noise(100 + seed);
        let points = random.points(6);
        let near: Vec<Point> = random
            .points(400)
            .iter()
            .map(|x| {
                let corners = &points[if x[2] > 0.0 { 0..3 } else { 3..6 }];
                let (s, t) = (0.5 + 0.5 * x[0], 0.5 + 0.5 * x[1]);
                let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                std::array::from_fn(|k| {
                    corners[0][k]
                        + s * (corners[1][k] - corners[0][k])
                        + t * (corners[2][k] - corners[0][k])
                        + 0.1 * x[2]
                })
            })
            .collect();
        let (points, cells) = soup(points);
        check("near the triangles", &points, &cells, &near);
    }
    let (points, cells) = square_at(0.3);
    for distance in [10.0, 1e3] {
        let far: Vec<Point> = random
            .points(300)
            .iter()
            .map(|x| [1.5 + x[0], 1.5 + x[1], distance])
            .collect();
        assert!(check("far away", &points, &cells, &far) > 1);
        let far: Vec<Point> = (0..100)
            .map(|k| [(k % 10) as f64 * 0.3, (k / 10) as f64 * 0.3, distance])
            .collect();
        assert!(check("grid far away", &points, &cells, &far) > 100);
    }
    // Needles, caps and triangles without area.
    let (points, cells) = soup(vec![
        [0.0, 0.0, 0.1],
        [3.0, 0.0, 0.1],
        [3.0, 1e-9, 0.1],
        [0.0, 0.0, 0.2],
        [3.0, 0.0, 0.2],
        [1.5, 1e-12, 0.2],
        [0.0, 1.0, 0.1],
        [3.0, 1.0, 0.1],
        [1.0, 1.0, 0.1],
        [1.0, 1.0, 1.0],
        [1.0, 1.0, 1.0],
        [1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0],
        [1e-9, 0.0, 0.0],
        [0.0, 1e-9, 0.0],
    ]);
    check("thin triangles", &points, &cells, &grid(4, 1.0));
    check("thin triangles", &points, &cells, &grid(21, 0.15));
    // Large and small units.
    let (points, sites) = (random.points(6), random.points(30));
    let (points, cells) = soup(points);
    let pieces = check("unit", &points, &cells, &sites);
    for unit in [1e-40, 1e-8, 1e8, 1e40] {
        let scale = |x: &[Point]| -> Vec<Point> { x.iter().map(|x| x.map(|x| x * unit)).collect() };
        assert_eq!(check("unit", &scale(&points), &cells, &scale(&sites)), pieces);
    }
}

/// Two sheets with opposite normals in one place are told apart by the compatibility, and the plain diagram when it
/// weighs nothing.
#[test]
fn normal_compatibility() {
    let (points, cells) = soup(vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
    ]);
    let sites = vec![[0.2, 0.2, 0.0], [0.2, 0.2, 0.0], [0.6, 0.2, 0.0], [0.6, 0.2, 0.0]];
    let normals = [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let mut diagram = RestrictedVoronoi::new(&points, &cells).expect("a valid surface");
    let mut owners = |weight: f64| {
        let mut owners = Vec::new();
        let compatibility = Some(Compatibility {
            weight,
            normals: &normals,
        });
        diagram.pieces(&points, &PointTree::new(&sites), compatibility, |piece| {
            owners.push((piece.triangle, piece.site));
        });
        owners.sort_unstable();
        owners
    };
    assert_eq!(owners(0.1), [(0, 1), (0, 2), (1, 0), (1, 3)]);
    assert_eq!(owners(0.0), [(0, 0), (0, 2), (1, 0), (1, 2)]);
}

/// Power diagrams against brute force: every triangle has offsets of its own.
#[test]
fn normal_compatibility_on_random_soups() {
    let mut random = Noise(5);
    let (points, cells) = soup(random.points(90));
    let sites = random.points(70);
    let normals: Vec<Point> = random
        .points(70)
        .iter()
        .map(|n| n.map(|x| x / square(*n).sqrt()))
        .collect();
    for weight in [0.01, 0.1, 1.0] {
        let compatibility = Some(Compatibility {
            weight,
            normals: &normals,
        });
        let mut found = std::collections::BTreeMap::new();
        let mut diagram = RestrictedVoronoi::new(&points, &cells).expect("a valid surface");
        diagram.pieces(&points, &PointTree::new(&sites), compatibility, |piece| {
            found.insert((piece.triangle as usize, piece.site as usize), piece.area);
        });
        for (triangle, cell) in cells.iter().enumerate() {
            let [a, b, c] = cell.map(|v| points[v as usize]);
            let across = cross(subtract(b, a), subtract(c, a));
            let facing = |n: &Point| n.iter().zip(across).map(|(n, x)| n * x).sum::<f64>() / square(across).sqrt();
            let offsets: Vec<f64> = normals.iter().map(|n| weight * (1.0 - facing(n))).collect();
            for i in 0..sites.len() {
                let expected = area(&brute_force([a, b, c], &sites, &offsets, i));
                let area = found.get(&(triangle, i)).copied().unwrap_or(0.0);
                assert!(
                    (area - expected).abs() < 1e-12,
                    "weight {weight}, triangle {triangle}, site {i}: area {area} and {expected}"
                );
            }
        }
    }
}

/// The slower ways, when forced, give the same pieces as the quick one.
#[test]
fn every_way_of_cutting() {
    let mut random = Noise(8);
    let (points, cells) = soup(random.points(600));
    // Parallel bisectors: a cell between two others, or beside them along one edge of a triangle only.
    let in_a_row = (0..3)
        .map(|k| [0.2 * f64::from(k), 0.1 - 0.2 * f64::from(k), 0.3])
        .collect();
    let mut families: Vec<Vec<Point>> = [2, 3, 3, 4, 5, 30, 400].map(|count| random.points(count)).into();
    families.push(in_a_row);
    for sites in families {
        let count = sites.len();
        let tree = PointTree::new(&sites);
        let by_way = |way: Way| {
            let mut diagram = RestrictedVoronoi::new(&points, &cells).expect("a valid surface");
            diagram.begin_with(way);
            let mut pieces = std::collections::BTreeMap::new();
            let ways = diagram.pieces(&points, &tree, None, |piece| {
                let mut labels: Vec<String> = piece.labels.iter().map(|label| format!("{label:?}")).collect();
                labels.sort();
                pieces.insert((piece.triangle, piece.site), (piece.area, labels));
            });
            (pieces, ways)
        };
        let (expected, ways) = by_way(Way::Walk);
        // Triangles with many sites are not walked.
        let quick = if count < 100 { ways.walked } else { ways.clipped };
        assert!(quick > 0 && ways.exact == 0, "{count} sites: {ways:?}");
        for way in [Way::Clip, Way::Exact] {
            let (pieces, ways) = by_way(way);
            assert_eq!(ways.walked, 0);
            assert!(if way == Way::Clip {
                ways.clipped > 0
            } else {
                ways.clipped == 0 && ways.exact > 0
            });
            assert_eq!(ways.gaps, 0);
            for key in expected.keys().chain(pieces.keys()) {
                let [one, other] = [&expected, &pieces].map(|pieces| pieces.get(key));
                let area = |piece: Option<&(f64, Vec<String>)>| piece.map_or(0.0, |(area, _)| *area);
                assert!(
                    (area(one) - area(other)).abs() < 1e-12,
                    "{count} sites, {way:?}, {key:?}: {one:?} and {other:?}"
                );
                // Slivers may have lost an edge to rounding.
                if let (Some((area, one)), Some((_, other))) = (one, other)
                    && *area > 1e-8
                {
                    assert_eq!(one, other, "{count} sites, {way:?}, {key:?}");
                }
            }
        }
    }
}

/// More sites than are cut at once, as near to each other along a line or all over a triangle: time and memory stay
/// bounded.
/// Sites on a circle about a line of the triangles' plane: all bisectors meet the plane in that line, or nearly so.
#[test]
fn bisectors_that_nearly_coincide() {
    let mut noise = Noise(11);
    for round in 0..300 {
        let corners: Vec<Point> = (0..3).map(|_| noise.point()).map(|[x, y, _]| [x, y, 0.0]).collect();
        let (points, cells) = soup(corners);
        let [x, y, _] = noise.point();
        let turn = std::f64::consts::PI * noise.number();
        let off = [0.0, 1e-15, 1e-13, 1e-10][round % 4];
        let sites: Vec<Point> = (0..3)
            .map(|_| {
                let angle = std::f64::consts::PI * noise.number();
                let (across, up) = (0.7 * angle.cos(), 0.7 * angle.sin());
                [
                    x - across * turn.sin() + off * noise.number(),
                    y + across * turn.cos(),
                    up,
                ]
            })
            .collect();
        check(&format!("about a line, {round}"), &points, &cells, &sites);
    }
}

#[test]
fn many_sites_as_near() {
    // On circles about an edge of one triangle and about a line through another.
    let circle: Vec<Point> = (0..100)
        .map(|k| (f64::from(k) / 100.0 * std::f64::consts::TAU).sin_cos())
        .map(|(s, c)| [c, s, 0.5])
        .collect();
    let (points, cells) = soup(vec![
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.8, 0.1, 0.4],
        [-0.5, 0.2, 0.0],
        [0.5, -0.2, 0.0],
        [0.0, 0.0, 1.0],
    ]);
    check("about a line", &points, &cells, &circle);
    // In one place but for rounding.
    let mut random = Noise(11);
    let mut sites: Vec<Point> = random.points(120).iter().map(|x| x.map(|x| 2e-16 * x + 0.3)).collect();
    sites.extend(random.points(20));
    check("in a crowd", &points, &cells, &sites);
    // In one place and with one normal.
    let sites = vec![[0.1, 0.1, 0.1]; 90];
    let normals = vec![[0.0, 0.0, 1.0]; 90];
    let compatibility = Some(Compatibility {
        weight: 0.1,
        normals: &normals,
    });
    let mut owners = Vec::new();
    let mut diagram = RestrictedVoronoi::new(&points, &cells).expect("a valid surface");
    diagram.pieces(&points, &PointTree::new(&sites), compatibility, |piece| {
        owners.push(piece.site)
    });
    assert_eq!(owners, [0, 0]);
}

/// All sites around the axis of a fan are as near to it, so that every triangle has all of them as contenders; few own
/// a part of it.
#[test]
fn fans_are_cut_among_few() {
    let count: u32 = 600;
    let circle = |turn: f64, radius: f64, z: f64| -> Vec<Point> {
        (0..count)
            .map(|k| ((f64::from(k) + turn) / f64::from(count) * std::f64::consts::TAU).sin_cos())
            .map(|(s, c)| [radius * c, radius * s, z])
            .collect()
    };
    let mut points = circle(0.0, 1.0, 0.0);
    points.push([0.0; 3]);
    let cells: Vec<[u32; 3]> = (0..count).map(|k| [count, k, (k + 1) % count]).collect();
    let sites = circle(0.3, 0.5, 0.25);
    let mut diagram = RestrictedVoronoi::new(&points, &cells).expect("a valid surface");
    let mut areas = vec![0.0; sites.len()];
    let mut pieces = 0;
    let ways = diagram.pieces(&points, &PointTree::new(&sites), None, |piece| {
        areas[piece.site as usize] += piece.area;
        pieces += 1;
    });
    assert_eq!(
        (ways.walked, ways.clipped, ways.exact),
        (count as usize, 0, 0),
        "{ways:?}"
    );
    assert!(pieces <= 3 * count, "{pieces} pieces");
    let expected = 0.5 * (std::f64::consts::TAU / f64::from(count)).sin();
    for area in areas {
        assert!((area / expected - 1.0).abs() < 1e-3, "{area} for {expected}");
    }
}

#[test]
fn impossible_inputs() {
    assert_eq!(
        RestrictedVoronoi::new(&[[0.0; 3]; 2], &[[0, 1, 2]]).err(),
        Some(Error::NoVertex {
            triangle: 0,
            vertex: 2,
            vertices: 2
        })
    );
    let (points, cells) = soup(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let mut diagram = RestrictedVoronoi::new(&points, &cells).expect("a valid surface");
    for sites in [
        vec![],
        vec![[0.0, f64::NAN, 0.0]],
        vec![[0.0; 3], [f64::INFINITY, 0.0, 0.0]],
    ] {
        diagram.pieces(&points, &PointTree::new(&sites), None, |_| {
            panic!("no piece without proper sites")
        });
    }
}
