//! Voronoi squared distance terms: stored reference values, derivatives, invariance, one result for any number of threads.

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

/// Deterministic numbers in (-1, 1).
fn noise(count: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut state = seed;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| std::array::from_fn(|_| next())).collect()
}

/// Every derivative, with every option, against central differences of the value.
#[test]
fn derivatives() {
    let sample = sample();
    let (points, cells) = &sample.template;
    let mut term = SquaredDistance::new(points, cells).expect("a valid surface");
    let sites = &sample.samples;
    let normals: Vec<[f64; 3]> = noise(sites.len(), 5)
        .iter()
        .zip(&sample.normals)
        .map(|(noise, normal)| unit(std::array::from_fn(|k| normal[k] + 0.3 * noise[k])))
        .collect();
    let moves = [noise(points.len(), 1), noise(sites.len(), 2), noise(sites.len(), 3)];
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
                }
            }
        }
    }
}
