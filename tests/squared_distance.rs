//! Voronoi squared distance terms: stored reference values, derivatives and their order, invariance, one result for any
//! number of threads.

use crate::connectivity::torus;
use crate::sample::{Noise, with_threads};
use serde_json::Value;
use vargeo::geometry::point_tree::PointTree;
use vargeo::geometry::restricted_voronoi::Compatibility;
use vargeo::geometry::squared_distance::{Anisotropy, Derivative, Options, SquaredDistance, Wanted};

fn vectors(value: &Value) -> Vec<[f64; 3]> {
    serde_json::from_value(value.clone()).expect("an array of points")
}

fn cells(value: &Value) -> Vec<[u32; 3]> {
    serde_json::from_value(value.clone()).expect("an array of triangles")
}

fn norm(x: &[[f64; 3]]) -> f64 {
    x.iter().flatten().map(|x| x * x).sum::<f64>().sqrt()
}

fn difference(x: &[[f64; 3]], y: &[[f64; 3]]) -> f64 {
    x.iter()
        .flatten()
        .zip(y.iter().flatten())
        .map(|(x, y)| (x - y) * (x - y))
        .sum::<f64>()
        .sqrt()
}

fn unit(x: [f64; 3]) -> [f64; 3] {
    let length = x.iter().map(|x| x * x).sum::<f64>().sqrt();
    x.map(|x| x / length)
}

/// Two noisy spheres, the template and the target, with samples of the target and their normals.
struct Sample {
    template: (Vec<[f64; 3]>, Vec<[u32; 3]>),
    target: (Vec<[f64; 3]>, Vec<[u32; 3]>),
    samples: Vec<[f64; 3]>,
    normals: Vec<[f64; 3]>,
    results: Value,
}

fn sample() -> Sample {
    let file: Value = serde_json::from_str(include_str!("golden/voronoi_squared_distance.json")).expect("valid JSON");
    Sample {
        template: (vectors(&file["S_V"]), cells(&file["S_F"])),
        target: (vectors(&file["T_V"]), cells(&file["T_F"])),
        samples: vectors(&file["Y"]),
        normals: vectors(&file["N_unnormalised"]).into_iter().map(unit).collect(),
        results: file["results"].clone(),
    }
}

/// Values and gradients of an independent program.
#[test]
fn reference_values() {
    let sample = sample();
    let mut to_target = SquaredDistance::new(&sample.template.0, &sample.template.1).expect("a valid surface");
    let mut to_template = SquaredDistance::new(&sample.target.0, &sample.target.1).expect("a valid surface");
    let samples = PointTree::new(&sample.samples);
    let vertices = PointTree::new(&sample.template.0);
    let mut gradient = vec![[0.0; 3]; sample.template.0.len()];
    for (name, s) in [("1.0", 1.0), ("5.0", 5.0), ("50.0", 50.0)] {
        let expected = &sample.results[name];
        let check = |what: &str, value: f64, gradient: &[[f64; 3]]| {
            let reference = expected[format!("F_{what}")].as_f64().expect("a number");
            assert!(
                (value - reference).abs() < 1e-11 * reference,
                "{what}, s = {s}: {value} and {reference}"
            );
            let reference = vectors(&expected[format!("grad_{what}")]);
            let error = difference(gradient, &reference) / norm(&reference);
            assert!(error < 1e-10, "{what}, s = {s}: gradient off by {error:.1e}");
        };
        let options = Options {
            anisotropy: Anisotropy::Sites(s, &sample.normals),
            ..Options::default()
        };
        let wanted = Wanted {
            surface: Some(&mut gradient),
            ..Wanted::default()
        };
        let value = to_target.evaluate(&sample.template.0, &samples, &options, wanted);
        check("S_to_T", value, &gradient);
        let options = Options {
            anisotropy: Anisotropy::Facets(s),
            ..Options::default()
        };
        let wanted = Wanted {
            sites: Some(&mut gradient),
            ..Wanted::default()
        };
        let value = to_template.evaluate(&sample.target.0, &vertices, &options, wanted);
        check("T_to_S", value, &gradient);
    }
}

/// The paper's gradient by the sites is the derivative without anisotropy, and far from it with.
#[test]
fn printed_gradient() {
    let sample = sample();
    let mut term = SquaredDistance::new(&sample.target.0, &sample.target.1).expect("a valid surface");
    let vertices = PointTree::new(&sample.template.0);
    let mut off = |s: f64| {
        let [complete, paper] = [Derivative::Complete, Derivative::Paper].map(|derivative| {
            let options = Options {
                anisotropy: Anisotropy::Facets(s),
                derivative,
                ..Options::default()
            };
            let mut gradient = vec![[0.0; 3]; sample.template.0.len()];
            let wanted = Wanted {
                sites: Some(&mut gradient),
                ..Wanted::default()
            };
            term.evaluate(&sample.target.0, &vertices, &options, wanted);
            gradient
        });
        difference(&complete, &paper) / norm(&complete)
    };
    assert!(off(1.0) < 1e-14, "off by {:.1e} without anisotropy", off(1.0));
    for s in [5.0, 50.0] {
        assert!((0.1..1.0).contains(&off(s)), "s = {s}: off by {}", off(s));
    }
}

/// Every derivative, with every option, against central differences of the value.
#[test]
fn derivatives() {
    let sample = sample();
    let (points, cells) = &sample.template;
    let mut term = SquaredDistance::new(points, cells).expect("a valid surface");
    let sites = &sample.samples;
    let normals: Vec<[f64; 3]> = Noise(5)
        .points(sites.len())
        .iter()
        .zip(&sample.normals)
        .map(|(noise, normal)| unit(std::array::from_fn(|k| normal[k] + 0.3 * noise[k])))
        .collect();
    let moves = [
        Noise(1).points(points.len()),
        Noise(2).points(sites.len()),
        Noise(3).points(sites.len()),
    ];
    let shifted = |x: &[[f64; 3]], direction: &[[f64; 3]], t: f64| -> Vec<[f64; 3]> {
        x.iter()
            .zip(direction)
            .map(|(x, d)| std::array::from_fn(|k| x[k] + t * d[k]))
            .collect()
    };
    for s in [1.0, 5.0, 50.0] {
        for weight in [0.0, 0.2] {
            for facets in [false, true] {
                let mut evaluate = |points: &[[f64; 3]], sites: &[[f64; 3]], normals: &[[f64; 3]], wanted: Wanted| {
                    let options = Options {
                        anisotropy: if facets {
                            Anisotropy::Facets(s)
                        } else {
                            Anisotropy::Sites(s, normals)
                        },
                        compatibility: (weight > 0.0).then_some(Compatibility { weight, normals }),
                        derivative: Derivative::Complete,
                    };
                    term.evaluate(points, &PointTree::new(sites), &options, wanted)
                };
                let mut gradients = [
                    vec![[0.0; 3]; points.len()],
                    vec![[0.0; 3]; sites.len()],
                    vec![[0.0; 3]; sites.len()],
                ];
                let [by_points, by_sites, by_normals] = &mut gradients;
                let wanted = Wanted {
                    surface: Some(by_points),
                    sites: Some(by_sites),
                    normals: Some(by_normals),
                    ..Wanted::default()
                };
                evaluate(points, sites, &normals, wanted);
                for (which, gradient) in gradients.iter().enumerate() {
                    let slope: f64 = gradient
                        .iter()
                        .flatten()
                        .zip(moves[which].iter().flatten())
                        .map(|(a, b)| a * b)
                        .sum();
                    let mut at = |t: f64| match which {
                        0 => evaluate(&shifted(points, &moves[0], t), sites, &normals, Wanted::default()),
                        1 => evaluate(points, &shifted(sites, &moves[1], t), &normals, Wanted::default()),
                        _ => evaluate(points, sites, &shifted(&normals, &moves[2], t), Wanted::default()),
                    };
                    let step = 1e-5;
                    let measured = (at(step) - at(-step)) / (2.0 * step);
                    let error = (slope - measured).abs() / norm(gradient).max(1e-3);
                    assert!(
                        error < 1e-6,
                        "s = {s}, compatibility {weight}, facets {facets}, gradient {which}: {slope} and {measured}"
                    );
                    // What Taylor's first two terms leave falls as the square of the step.
                    let start = at(0.0);
                    let [long, short] = [2e-4, 2e-4 / 16.0].map(|t| (at(t) - start - t * slope).abs());
                    let rounding = 1e-14 * start.abs();
                    let order = (long / short).log(16.0);
                    assert!(
                        long < 16.0 * rounding || (order - 2.0).abs() < 0.15,
                        "s = {s}, compatibility {weight}, facets {facets}, gradient {which}: order {order}"
                    );
                }
            }
        }
    }
}

/// A torus with bumps.
fn bumpy_torus(n: usize, m: usize) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let mut points = Vec::new();
    let noise = Noise(9).points(n * m);
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (
                i as f64 / n as f64 * std::f64::consts::TAU,
                j as f64 / m as f64 * std::f64::consts::TAU,
            );
            let radius = 0.4 + 0.01 * noise[i * m + j][0];
            points.push([
                (1.0 + radius * b.cos()) * a.cos(),
                (1.0 + radius * b.cos()) * a.sin(),
                radius * b.sin(),
            ]);
        }
    }
    (points, torus(n as u32, m as u32))
}

#[test]
fn same_bits_for_any_number_of_threads() {
    // More sites than are summed on one thread.
    let (points, cells) = bumpy_torus(140, 70);
    let sites: Vec<[f64; 3]> = points
        .iter()
        .zip(Noise(4).points(9800))
        .map(|(x, d)| std::array::from_fn(|k| x[k] + 0.03 * d[k]))
        .collect();
    let normals: Vec<[f64; 3]> = Noise(6).points(sites.len()).into_iter().map(unit).collect();
    let run = |threads: usize| {
        with_threads(threads, || {
            let mut term = SquaredDistance::new(&points, &cells).expect("a valid surface");
            let mut surface = vec![[0.0; 3]; points.len()];
            let mut by_sites = vec![[0.0; 3]; sites.len()];
            let mut areas = vec![0.0; sites.len()];
            let options = Options {
                anisotropy: Anisotropy::Sites(7.0, &normals),
                compatibility: Some(Compatibility {
                    weight: 0.01,
                    normals: &normals,
                }),
                derivative: Derivative::Complete,
            };
            let wanted = Wanted {
                surface: Some(&mut surface),
                sites: Some(&mut by_sites),
                areas: Some(&mut areas),
                ..Wanted::default()
            };
            let value = term.evaluate(&points, &PointTree::new(&sites), &options, wanted);
            let numbers = surface
                .iter()
                .flatten()
                .chain(by_sites.iter().flatten())
                .chain(&areas)
                .chain([&value]);
            numbers.map(|x| x.to_bits()).collect::<Vec<_>>()
        })
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(4));
}

/// Moving the surface and the sites together changes nothing: values agree, gradients turn along.
#[test]
fn rigid_motions() {
    let (points, cells) = bumpy_torus(30, 15);
    let sites: Vec<[f64; 3]> = points.iter().step_by(4).copied().collect();
    let turn = |x: [f64; 3]| {
        let (s, c) = 0.7f64.sin_cos();
        let [x, y, z] = [c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]];
        [x, c * y - s * z, s * y + c * z]
    };
    let moved = |x: &[[f64; 3]]| -> Vec<[f64; 3]> {
        x.iter()
            .map(|&x| {
                let y = turn(x);
                [y[0] + 3.0, y[1] - 1.0, y[2] + 0.5]
            })
            .collect()
    };
    let normals: Vec<[f64; 3]> = sites
        .iter()
        .map(|&[x, y, z]| unit([z - x, x + 0.3, y * y - 1.0]))
        .collect();
    // With the normals of facets, as from a target to a fit, and with those of sites, as the other way.
    for of_sites in [false, true] {
        let evaluate = |points: &[[f64; 3]], sites: &[[f64; 3]], normals: &[[f64; 3]]| {
            let mut term = SquaredDistance::new(points, &cells).expect("a valid surface");
            let mut by_sites = vec![[0.0; 3]; sites.len()];
            let mut by_surface = vec![[0.0; 3]; points.len()];
            let mut areas = vec![0.0; sites.len()];
            let options = Options {
                anisotropy: if of_sites {
                    Anisotropy::Sites(50.0, normals)
                } else {
                    Anisotropy::Facets(50.0)
                },
                compatibility: Some(Compatibility { weight: 0.1, normals }),
                ..Options::default()
            };
            let wanted = Wanted {
                sites: Some(&mut by_sites),
                surface: Some(&mut by_surface),
                areas: Some(&mut areas),
                ..Wanted::default()
            };
            let value = term.evaluate(points, &PointTree::new(sites), &options, wanted);
            (value, [by_sites, by_surface], areas.iter().sum::<f64>())
        };
        let turned_normals: Vec<[f64; 3]> = normals.iter().map(|&x| turn(x)).collect();
        let (value, gradients, area) = evaluate(&points, &sites, &normals);
        let (other, turned, same) = evaluate(&moved(&points), &moved(&sites), &turned_normals);
        assert!((value - other).abs() < 1e-12 * value, "{value} and {other}");
        assert!((area - same).abs() < 1e-12 * area);
        for (gradient, turned) in gradients.iter().zip(&turned) {
            let expected: Vec<[f64; 3]> = gradient.iter().map(|&x| turn(x)).collect();
            assert!(difference(turned, &expected) < 1e-9 * norm(gradient));
        }
    }
}

/// Steps that leave the world behind: an infinite value, which a line search takes for too long a step.
#[test]
fn values_beyond_measure() {
    let (points, cells) = bumpy_torus(6, 5);
    let mut term = SquaredDistance::new(&points, &cells).expect("a valid surface");
    let mut value = |points: &[[f64; 3]], sites: &[[f64; 3]]| {
        term.evaluate(points, &PointTree::new(sites), &Options::default(), Wanted::default())
    };
    assert!(value(&points, &points).is_finite());
    assert_eq!(value(&points, &[]), f64::INFINITY);
    assert_eq!(value(&points, &[[f64::NAN; 3]]), f64::INFINITY);
    let mut broken = points.clone();
    broken[3][1] = f64::NEG_INFINITY;
    assert_eq!(value(&broken, &points), f64::INFINITY);
}

/// A triangle is not lost beside the distance to its site.
#[test]
fn far_sites() {
    let (points, cells) = bumpy_torus(12, 8);
    let directions = [[1.0, 0.2, 0.1], [-0.3, 1.0, 0.2], [0.1, -0.4, -1.0]];
    let mut term = SquaredDistance::new(&points, &cells).unwrap();
    let area = {
        let mut areas = vec![0.0; 1];
        let wanted = Wanted {
            areas: Some(&mut areas),
            ..Wanted::default()
        };
        term.evaluate(&points, &PointTree::new(&points[..1]), &Options::default(), wanted);
        areas[0]
    };
    for far in [1e4, 1e8, 1e12, 1e16, 1e40, 1e140] {
        // Nearly all triangles lie in one cell, where the shorter formula holds.
        let sites = directions.map(|direction| direction.map(|x| far * x));
        let mut areas = vec![0.0; sites.len()];
        let wanted = Wanted {
            areas: Some(&mut areas),
            ..Wanted::default()
        };
        let value = term.evaluate(&points, &PointTree::new(&sites), &Options::default(), wanted);
        let sum: f64 = areas.iter().sum();
        assert!((sum / area - 1.0).abs() < 1e-10, "{far}: {sum} of {area}");
        let nearest = directions.iter().map(|d| d.iter().map(|x| x * x).sum::<f64>());
        let least = nearest.fold(f64::INFINITY, f64::min) * far * far;
        assert!((value / (area * least) - 1.0).abs() < 1e-3, "{far}: {value}");
    }
}
