//! Fits of small volumes: what is promised of them, templates by recipes and from files, input that is refused.

use crate::sample::{self, file, generated, metric_bits, model, with_threads};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use vargeo::fem::basis;
use vargeo::fem::boundary::Boundary;
use vargeo::fem::coefficient_file;
use vargeo::fem::space::Space;
use vargeo::mesh::TriangleMesh;
use vargeo::mesh::format::Content;
use vargeo::mesh::mixed::MixedMesh;
use vargeo::mesh::template::sweep::{Sweep, sweep};
use vargeo::mesh::template::{carve, collapse, extrude, grid, pillow, voxels};
use vargeo::method::model::Part;
use vargeo::method::volume_fit::settings::Terms;
use vargeo::method::volume_fit::surface_energy::{Scale, SurfaceEnergy};
use vargeo::method::volume_fit::{VolumeFit, orientation, target, template};
use vargeo::method::{Failure, Method, Outcome};

fn fit(template: Value, target: Option<Value>, settings: Value) -> Result<Outcome, Failure> {
    let part = |mut table: Value, key: &str| {
        let name = table.as_object_mut().unwrap().remove(key).unwrap();
        generated(name.as_str().unwrap(), table)
    };
    let target = target.map(|target| ("target", part(target, "shape")));
    let parts = [("template", part(template, "generate"))].into_iter().chain(target);
    sample::run(&VolumeFit, model(parts), settings)
}

#[test]
fn a_fit_is_valid_falls_in_every_stage_and_is_the_same_with_any_number_of_threads() {
    let run = |threads: usize| {
        with_threads(threads, || {
            fit(
                json!({ "generate": "grid", "x": 1, "y": 1, "z": 1, "recipe": [{ "op": "pillow" }] }),
                Some(json!({ "shape": "ellipsoid", "triangles": 400 })),
                json!({ "order": 2, "iteration_limit": 25, "lambda_far": 50.0 }),
            )
            .unwrap()
        })
    };
    let outcome = run(1);
    let metric = |name: &str| outcome.metrics[name];
    assert_eq!(metric("elements"), 7.0);
    assert_eq!(metric("inverted"), 0.0);
    assert_eq!(metric("certified"), 7.0);
    assert_eq!(metric("increases"), 0.0);
    assert!(metric("least_determinant_ever") > 0.0);
    assert!(metric("certified_determinant") > 0.0);
    assert!(metric("certified_determinant") <= metric("min_determinant"));
    assert!(metric("hausdorff") < 6.0, "{}", metric("hausdorff"));
    assert!(
        metric("scaled_jacobian_mean") > 0.85,
        "{}",
        metric("scaled_jacobian_mean")
    );
    let other = run(2);
    assert_eq!(outcome.mesh, other.mesh);
    assert_eq!(metric_bits(&outcome), metric_bits(&other));
}

/// A sphere within one that is larger by a share e: the terms come to `e^2 A` and `e^2 (1 + e)^2 A`, and `L = V / A` is a
/// third of the radius, so `E = 9 e^2 (1 + (1 + e)^2)` whatever the anisotropy.
#[test]
fn the_surface_energy_of_concentric_spheres_and_its_gradient() {
    let sphere = json!({ "a": 1.0, "b": 1.0, "c": 1.0, "triangles": 20_000 });
    let mut target = target::read(&generated("ellipsoid", sphere)).unwrap();
    target.place_sites(1000);
    let e = 0.05;
    let larger = target.surface.points.iter().map(|point| point.map(|x| (1.0 + e) * x));
    let samples: Vec<[f64; 3]> = larger.collect();
    let scale = Scale::of(&target, true, &target.surface, 1.0);
    let both = Terms {
        to_target: true,
        from_target: true,
    };
    let triangles = target.surface.cells.clone();
    let energy = |s: f64| SurfaceEnergy::new(&samples, &triangles, &target, both, s, scale).unwrap();
    for s in [1.0, 50.0] {
        let mut energy = energy(s);
        let mut gradient = vec![[0.0; 3]; samples.len()];
        let value = energy.gradient(&samples, &mut gradient);
        // Without normals what lies between the sites counts too.
        let margin = if s == 1.0 { 0.2 } else { 0.01 };
        let exact = 9.0 * e * e * (1.0 + (1.0 + e).powi(2));
        assert!((value / exact - 1.0).abs() < margin, "{s}: {value} {exact}");
        let direction = |index: usize| ((index * 7) as f64 * 0.37).sin();
        let slope: f64 = gradient
            .as_flattened()
            .iter()
            .enumerate()
            .map(|(k, g)| g * direction(k))
            .sum();
        let mut at = |t: f64| {
            let mut moved = samples.clone();
            for (index, x) in moved.as_flattened_mut().iter_mut().enumerate() {
                *x += t * direction(index);
            }
            energy.gradient(&moved, &mut vec![[0.0; 3]; moved.len()])
        };
        let step = 1e-6;
        let difference = (at(step) - at(-step)) / (2.0 * step);
        assert!((slope / difference - 1.0).abs() < 1e-4, "{s}: {slope} {difference}");
    }
}

#[test]
fn an_inverted_mesh_is_repaired_over_its_own_boundary() {
    // Pillowed beyond the middle: the cells inside are turned inside out.
    let outcome = fit(
        json!({ "generate": "grid", "x": 2, "y": 2, "z": 1, "recipe": [{ "op": "pillow", "thickness": 1.3 }] }),
        None,
        json!({ "schedule": [{ "lambda": 0.05, "order": 1 }], "iteration_limit": 40, "distance": "symmetric" }),
    )
    .unwrap();
    assert!(outcome.metrics["inverted_at_start"] > 0.0);
    assert_eq!(outcome.metrics["inverted"], 0.0);
    assert!(outcome.metrics["hausdorff"] < 5.0, "{}", outcome.metrics["hausdorff"]);
}

/// The boundary of a bent bar as it is, two triangles a face: with one site on each, samples were drawn to their middles.
#[test]
fn a_bar_keeps_its_flat_faces() {
    let paths = json!([[[0, 0], [2, 0], [2, 2]]]);
    let settings = json!({ "order": 3, "lambda_far": 0.0 });
    let outcome = fit(
        json!({ "generate": "sweep", "paths": paths, "bend": 1.0 }),
        None,
        settings,
    )
    .unwrap();
    let metric = |name: &str| outcome.metrics[name];
    assert_eq!((metric("elements"), metric("certified")), (4.0, 4.0));
    assert!(metric("hausdorff") < 0.3, "{}", metric("hausdorff"));
    assert!(metric("energy_surface") < 1e-3, "{}", metric("energy_surface"));
    assert!(metric("scaled_jacobian_min") > 0.7, "{}", metric("scaled_jacobian_min"));
}

#[test]
fn sites_are_as_even_as_wanted() {
    // Two triangles of a square and a sliver of no area.
    let mut target = target::of_boundary(TriangleMesh {
        points: vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [2.0, 0.0, 0.0],
        ],
        cells: vec![[0, 1, 2], [0, 2, 3], [0, 1, 4]],
    });
    target.place_sites(1000);
    let sites = target.sites.len();
    assert!((400..4000).contains(&sites), "{sites}");
    // Every place of the square has a site near it, in its plane.
    for step in 0..400 {
        let place = [(step % 20) as f64 / 19.0, (step / 20) as f64 / 19.0];
        let near = target
            .sites
            .iter()
            .map(|site| (site[0] - place[0]).hypot(site[1] - place[1]));
        assert!(near.fold(f64::INFINITY, f64::min) < 0.07);
    }
    assert!(target.normals.iter().all(|normal| *normal == [0.0, 0.0, 1.0]));
    // As few as there are triangles where no more are wanted.
    let mut coarse = target::of_boundary(target.surface.clone());
    coarse.place_sites(2);
    assert_eq!(coarse.sites.len(), 2);
}

#[test]
fn elements_that_fail_between_quadrature_points_are_mended() {
    // Too few points: a few elements of many fail, or nearly all of a few.
    for (cells, points, lambda, far) in [(2, 5, 0.05, 0.0), (1, 3, 0.05, 50.0)] {
        let run = |repairs: usize| {
            fit(
                json!({ "generate": "grid", "x": cells, "y": cells, "z": cells, "recipe": [{ "op": "pillow" }] }),
                Some(json!({ "shape": "pebble", "triangles": 400 })),
                json!({
                    "order": 4, "quadrature": "gauss", "quadrature_points": points, "lambda": lambda,
                    "lambda_far": far, "far_steps": 3, "iteration_limit": 40, "repairs": repairs,
                }),
            )
            .unwrap()
        };
        let [broken, mended] = [run(0), with_threads(1, || run(3))];
        assert_eq!(metric_bits(&mended), metric_bits(&with_threads(2, || run(3))));
        let [before, after] = [&broken, &mended].map(|outcome| &outcome.metrics);
        assert_eq!(
            before["inverted"] * 5.0 <= before["elements"],
            cells == 2,
            "{}",
            before["inverted"]
        );
        assert!(before["inverted"] > 0.0);
        assert_eq!(after["inverted"], 0.0, "{:?}", mended.notices);
        assert_eq!(after["certified"], after["elements"]);
        // The boundary gives way a little.
        let name = "distance_rms";
        assert!(after[name] < 1.5 * before[name], "{} {}", before[name], after[name]);
        assert!(
            mended.notices.iter().any(|notice| notice.ends_with(" 0 are left")),
            "{:?}",
            mended.notices
        );
    }
}

#[test]
fn bad_input_is_named() {
    let reason = |outcome: Result<Outcome, Failure>| outcome.err().map(|failure| failure.reason).unwrap_or_default();
    let empty = fit(
        json!({ "generate": "grid", "x": 1, "y": 1, "z": 1, "recipe": [{ "op": "carve", "from": [0, 0, 0], "to": [1, 1, 1] }] }),
        Some(json!({ "shape": "ellipsoid" })),
        json!({}),
    );
    assert!(reason(empty).contains("removes all 1 cells"));
    let falling = json!({ "schedule": [{ "lambda": 1.0, "order": 3 }, { "lambda": 1.0, "order": 2 }] });
    let falling = fit(
        json!({ "generate": "grid" }),
        Some(json!({ "shape": "block" })),
        falling,
    );
    assert!(reason(falling).contains("orders only rise"));
    let voxels = fit(json!({ "generate": "voxels" }), None, json!({}));
    assert!(reason(voxels).contains("need a target surface"));

    // Files, which nothing has looked at before.
    let files = |template: &str, target: &str| {
        let target = (!target.is_empty()).then(|| ("target", file("target.obj", target)));
        let parts = [("template", file("template.mesh", template))]
            .into_iter()
            .chain(target);
        sample::run(&VolumeFit, model(parts), json!({ "order": 1, "iteration_limit": 3 }))
    };
    let cube = "MeshVersionFormatted 2\nDimension 3\nVertices\n8\n0 0 0 0\n1 0 0 0\n1 1 0 0\n0 1 0 0\n0 0 1 0\n1 0 1 0\n1 1 1 0\n0 1 1 0\n";
    let crack = cube.replace("Vertices\n8", "Vertices\n9").to_string()
        + "2 0.5 0.5 0\nHexahedra\n1\n1 2 3 4 5 6 7 8 0\nTetrahedra\n2\n2 3 7 9 0\n2 7 6 9 0\nEnd\n";
    let found = reason(files(&crack, ""));
    assert!(found.contains("lies on the quad"), "{found}");
    let whole = format!("{cube}Hexahedra\n1\n1 2 3 4 5 6 7 8 0\nEnd\n");
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    let notices = |target: &str| files(&whole, target).unwrap().notices.join("; ");
    let closed = format!("{corners}f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
    assert!(!notices(&closed).contains("does not enclose"));
    let turned = format!("{corners}f 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n");
    assert!(notices(&turned).contains("inside out"), "{}", notices(&turned));
    let open = format!("{corners}f 1 3 2\nf 1 2 4\nf 2 3 4\n");
    assert!(notices(&open).contains("3 have one triangle"), "{}", notices(&open));
    let flipped = format!("{corners}f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 4 1\n");
    assert!(
        notices(&flipped).contains("1 of 4 are turned over"),
        "{}",
        notices(&flipped)
    );
    // A Möbius strip closed by a disk has no inside: the projective plane of six vertices.
    let plane = [
        [1, 2, 3],
        [1, 3, 4],
        [1, 4, 5],
        [1, 5, 6],
        [1, 6, 2],
        [2, 3, 5],
        [3, 4, 6],
        [4, 5, 2],
        [5, 6, 3],
        [6, 2, 4],
    ];
    let corners = format!("{corners}v 1 1 0\nv 0 1 1\n");
    let faces = plane.map(|[a, b, c]| format!("f {a} {b} {c}\n")).concat();
    let one_sided = notices(&format!("{corners}{faces}"));
    assert!(one_sided.contains("have triangles of opposite"), "{one_sided}");
}

#[test]
fn triangles_that_face_opposite_ways_are_turned_to_enclose_what_lies_between() {
    // A cube with a cavity: the boundary of a template has both the right way round.
    let block = grid::selected([3, 3, 3], |cell| cell != [1, 1, 1]);
    let topology = block.topology().unwrap();
    let right = topology.boundary_triangles(&block.points);
    assert_eq!(right.enclosed_volume(), 26.0);
    let mut surface = right.clone();
    assert_eq!(orientation::orient(&mut surface), 0);
    for (index, cell) in surface.cells.iter_mut().enumerate() {
        if index * index % 5 == 1 {
            cell.swap(0, 1);
        }
    }
    let turned = (0..surface.cells.len()).filter(|index| index * index % 5 == 1).count();
    assert_eq!(orientation::orient(&mut surface), turned);
    assert!((surface.enclosed_volume() - 26.0).abs() < 1e-12);
    // Open: left alone.
    surface.cells.pop();
    surface.cells[0].swap(0, 1);
    assert_eq!(orientation::orient(&mut surface), 0);
}

/// Euler characteristic of the boundary and volume.
fn figures(mesh: &MixedMesh) -> (i64, f64) {
    let topology = mesh.topology().unwrap();
    let triangles = topology.boundary_triangles(&mesh.points);
    let mut vertices: Vec<u32> = triangles.cells.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let faces = triangles.cells.len() as i64;
    (vertices.len() as i64 - 3 * faces / 2 + faces, mesh.volume())
}

#[test]
fn recipes_keep_meshes_valid() {
    let block = grid::grid([3, 3, 2]);
    assert_eq!(figures(&block), (2, 18.0));
    let ring = carve::carve(&block, [[1.0, 1.0, 0.0], [2.0, 2.0, 2.0]]).unwrap();
    assert_eq!(figures(&ring), (0, 16.0));
    assert!(carve::carve(&block, [[9.0; 3], [10.0; 3]]).is_err());

    let pillowed = pillow::pillow(&ring, 0.4).unwrap();
    // Eight faces below and above, 12 x 2 outside, 4 x 2 inside.
    assert_eq!(pillowed.cells(), 16 + 8 + 8 + 24 + 8);
    assert_eq!(figures(&pillowed).0, 0);
    assert!((figures(&pillowed).1 - 16.0).abs() < 1e-12);

    let taller = extrude::extrude(&block, [[0.0, 0.0, 2.0], [1.0, 3.0, 2.0]], 1.5, 3).unwrap();
    assert_eq!(taller.cells(), 18 + 9);
    assert!((figures(&taller).1 - 22.5).abs() < 1e-12);
    assert_eq!(figures(&taller).0, 2);

    // Hexahedra become prisms, then one of these a tetrahedron.
    let wedge = collapse::collapse(&grid::grid([1, 1, 1]), 0, [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]).unwrap();
    assert_eq!((wedge.hexahedra.len(), wedge.prisms.len()), (0, 1));
    assert!((figures(&wedge).1 - 0.5).abs() < 1e-12);
    let simplex = collapse::collapse(&wedge, 2, [[0.0, 1.0, 0.0], [1.0, 1.0, 1.0]]).unwrap();
    assert_eq!((simplex.prisms.len(), simplex.tetrahedra.len()), (0, 1));
    assert!((figures(&simplex).1 - 1.0 / 6.0).abs() < 1e-12);
    assert!(collapse::collapse(&grid::grid([1, 1, 1]), 0, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5]]).is_err());

    // Two cubes that share an edge only: the voxels between are added, and the result is a manifold.
    let touching = grid::selected([2, 2, 1], |[i, j, _]| i == j);
    let mut surface = TriangleMesh::default();
    for (shape, corners) in touching.iter() {
        for face in shape.faces() {
            let at = |place: usize| corners[face[place]];
            surface.cells.extend([[at(0), at(1), at(2)], [at(0), at(2), at(3)]]);
        }
    }
    surface.points = touching.points.clone();
    let cubes = voxels::voxels(&surface, 2).unwrap();
    assert!(cubes.cells() > 2);
    assert_eq!(figures(&cubes).0, 2);
}

#[test]
fn squares_swept_along_paths_join_and_close() {
    let settings = Sweep {
        width: 1.0,
        step: 1.0,
        bend: 1.0,
    };
    let flat = |path: &[[f64; 2]]| path.iter().map(|&[x, y]| [x, y, 0.0]).collect::<Vec<[f64; 3]>>();
    // A bar of five cells, a corner of two, a bar of two more.
    let hook = flat(&[[0.0, 0.0], [6.0, 0.0], [6.0, 3.0]]);
    let mesh = sweep(std::slice::from_ref(&hook), settings).unwrap();
    assert_eq!(mesh.cells(), 5 + 2 + 2);
    assert_eq!(figures(&mesh).0, 2);
    // Chords of the quarter circle enclose sin(45 degrees) of its length.
    let bend = 2.0 * (std::f64::consts::FRAC_PI_4).sin();
    assert!((figures(&mesh).1 - (7.0 + bend)).abs() < 1e-12, "{}", figures(&mesh).1);
    // A closed frame with a stem on the side of one of its cells: a ring, in one piece.
    let frame = flat(&[
        [1.5, 0.0],
        [2.5, 0.0],
        [4.0, 0.0],
        [4.0, 4.0],
        [0.0, 4.0],
        [0.0, 0.0],
        [1.5, 0.0],
    ]);
    let stem = flat(&[[2.0, -0.5], [2.0, -3.5]]);
    let joined = sweep(&[frame.clone(), stem], settings).unwrap();
    assert_eq!(figures(&joined).0, 0);
    let alone = sweep(&[frame], settings).unwrap();
    assert_eq!(joined.points.len(), alone.points.len() + 12);
    assert!((figures(&joined).1 - figures(&alone).1 - 3.0).abs() < 1e-9);
    // A trefoil knot has torsion: its ends meet all the same, and it is a ring.
    let knot: Vec<[f64; 3]> = (0..=60)
        .map(|step| {
            let t = std::f64::consts::TAU * (step % 60) as f64 / 60.0;
            let point = [
                t.sin() + 2.0 * (2.0 * t).sin(),
                t.cos() - 2.0 * (2.0 * t).cos(),
                -(3.0 * t).sin(),
            ];
            point.map(|coordinate| 3.0 * coordinate)
        })
        .collect();
    let knot = sweep(&[knot], Sweep { bend: 0.0, ..settings }).unwrap();
    assert_eq!((knot.cells(), knot.points.len()), (60, 240));
    assert_eq!(figures(&knot).0, 0);
    // A slight bend is one section, square to the mean direction: three cells, as without it, and none of them thin.
    let slight = sweep(&[flat(&[[0.0, 0.0], [1.0, 0.0], [3.0, 0.01]])], settings).unwrap();
    assert_eq!(slight.cells(), 3);
    assert!((figures(&slight).1 - 3.0).abs() < 1e-3);
    // Bodies beside each other, and two that touch in an edge.
    let bodies = |mesh: &MixedMesh| mesh.topology().unwrap().bodies();
    assert_eq!((bodies(&joined), bodies(&alone)), ([1, 1], [1, 1]));
    let across = flat(&[[0.0, 9.0], [6.0, 9.0]]);
    assert_eq!(bodies(&sweep(&[hook, across], settings).unwrap()), [2, 2]);
    let edge = [flat(&[[0.0, 0.0], [1.0, 0.0]]), flat(&[[1.0, 1.0], [2.0, 1.0]])];
    assert_eq!(bodies(&sweep(&edge, settings).unwrap()), [2, 1]);
    // What cannot be swept is named.
    let refused = |path: &[[f64; 2]], settings: Sweep| sweep(&[flat(path)], settings).unwrap_err();
    assert!(sweep(&[], settings).unwrap_err().contains("no path is given"));
    assert!(refused(&[[0.0, 0.0]], settings).contains("fewer than two points"));
    assert!(refused(&[[0.0, 0.0], [0.0, 0.0]], settings).contains("points 0 and 1 are 0 apart"));
    let far = &[[1e12, 0.0], [1e12 + 2.0, 0.0]];
    assert!(refused(far, settings).contains("point 0 is so far from the origin"));
    let nearly = &[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0001], [5.0, 2.0001]];
    assert!(refused(nearly, settings).contains("leave a straight part of"));
    assert!(refused(&[[0.0, 0.0], [2.0, 0.0], [0.0, 0.0]], settings).contains("turns back on itself at point 1"));
    assert!(refused(&[[0.0, 0.0], [0.5, 0.0], [0.5, 4.0]], settings).contains("do not fit between points 0 and 1"));
    let tight = Sweep { bend: 0.3, ..settings };
    assert!(refused(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]], tight).contains("is turned over"));
    // Bent just as much as a cell bears, its inner edges would be welded.
    let collapsed = Sweep {
        bend: 0.5 + 1e-7,
        ..settings
    };
    assert!(refused(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]], collapsed).contains("is turned over"));
    let many = Sweep { step: 1e-9, ..settings };
    assert!(refused(&[[0.0, 0.0], [4.0, 0.0]], many).contains("is too short for a width of 1"));
    assert!(refused(&[[0.0, 0.0], [1e8, 0.0]], settings).contains("more than 4000000; raise `step`"));
}

/// Two squares and a triangle as a file: hexahedra and a prism.
#[test]
fn a_surface_file_is_extruded() {
    let surface = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nv 3 0 0\nf 1 2 3 4\nf 2 5 6 3\nf 5 7 6\n";
    let read = |parameters: Value| {
        let mut notices = Vec::new();
        let part = Part::File {
            name: "layout.obj".to_string(),
            bytes: surface.to_vec(),
            parameters,
        };
        template::read(&part, None, &mut notices)
    };
    let recipe = json!({ "recipe": [{ "op": "extrude", "distance": 2.0, "layers": 2 }, { "op": "pillow" }] });
    let mesh = read(recipe).unwrap().mesh;
    assert_eq!((mesh.hexahedra.len(), mesh.prisms.len()), (4 + 4 + 14, 2 + 2));
    assert_eq!(figures(&mesh).0, 2);
    assert!((figures(&mesh).1 - 5.0).abs() < 1e-12);
    // Downwards, and only one of the squares.
    let recipe = json!({ "recipe": [{ "op": "extrude", "distance": -1.0, "from": [1, 0, 0], "to": [2, 1, 0] }] });
    let mesh = read(recipe).unwrap().mesh;
    assert_eq!((mesh.hexahedra.len(), mesh.points.len()), (1, 8));
    assert!((figures(&mesh).1 - 1.0).abs() < 1e-12);
    let reason = |parameters: Value| read(parameters).err().unwrap().reason;
    assert!(reason(json!({})).contains("let the recipe start with"));
    for distance in [0.0, 1e-12] {
        let flat = json!({ "recipe": [{ "op": "extrude", "distance": distance }] });
        assert!(reason(flat).contains("has no volume"));
    }
    let other = json!({ "recipe": [{ "op": "extrude", "thickness": 0.5 }] });
    assert!(reason(other).contains("extrude takes from, to, distance, layers, not `thickness`"));
    let many = json!({ "op": "extrude", "distance": 1.0, "layers": 1000 });
    assert!(reason(json!({ "recipe": vec![many; 3] })).contains("more than 4000000; lower `layers`"));
    // Scaled before it is extruded: distances are those of the scaled mesh.
    let scaled = json!({ "scale": 2.0, "recipe": [{ "op": "extrude", "distance": 1.0 }] });
    assert!((figures(&read(scaled).unwrap().mesh).1 - 10.0).abs() < 1e-12);
    let mut notices = Vec::new();
    let turned = Part::File {
        name: "turned.obj".to_string(),
        bytes: b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nf 1 2 3 4\nf 3 6 5 2\n".to_vec(),
        parameters: json!({ "recipe": [{ "op": "extrude" }] }),
    };
    let refused = template::read(&turned, None, &mut notices).err().unwrap().reason;
    assert!(refused.contains("both run from vertex 1 to 2"), "{refused}");
    let empty = json!({ "recipe": [{ "op": "extrude", "from": [9, 9, 9], "to": [10, 10, 10] }] });
    assert!(reason(empty).contains("no triangle or quad has its centroid"));
}

#[test]
fn the_sampled_boundary_is_closed_and_follows_the_nodes() {
    let mut mesh = collapse::collapse(&grid::grid([2, 1, 1]), 0, [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]).unwrap();
    for (index, point) in mesh.points.iter_mut().enumerate() {
        point[0] += 0.1 * (index as f64).sin();
    }
    let topology = mesh.topology().unwrap();
    for basis in basis::bases() {
        let orders = if mesh.hexahedra.is_empty() {
            vec![3; mesh.cells()]
        } else {
            vec![4, 3]
        };
        let space = Space::new(&mesh, &topology, *basis, &orders).unwrap();
        let boundary = Boundary::new(&mesh, &topology, &space, 5);
        let mut x = space.linear(&mesh.points);
        for (place, value) in x.iter_mut().enumerate().skip(3 * space.vertices) {
            *value = 0.05 * (place as f64 * 1.7).sin();
        }
        let mut samples = Vec::new();
        boundary.positions(&x, &mut samples);
        // Every side of a triangle has its reverse: closed and oriented.
        let mut sides = BTreeMap::new();
        for cell in &boundary.triangles {
            for place in 0..3 {
                *sides.entry((cell[place], cell[(place + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(
            sides
                .iter()
                .all(|(&(a, b), &count)| count == 1 && sides.contains_key(&(b, a)))
        );
        let surface = TriangleMesh {
            points: samples.clone(),
            cells: boundary.triangles.clone(),
        };
        assert!(surface.enclosed_volume() > 0.0);
        // The pull-back is the transpose of the evaluation.
        let forces: Vec<[f64; 3]> = (0..samples.len())
            .map(|k| [(k as f64).cos(), 1.0, (k as f64).sin()])
            .collect();
        let mut gradient = vec![0.0; x.len()];
        boundary.add_gradient(&forces, &mut gradient);
        let direction: Vec<f64> = (0..x.len()).map(|k| (0.3 * k as f64).sin()).collect();
        let mut moved = Vec::new();
        boundary.positions(&direction, &mut moved);
        let left: f64 = gradient.iter().zip(&direction).map(|(a, b)| a * b).sum();
        let right: f64 = forces
            .as_flattened()
            .iter()
            .zip(moved.as_flattened())
            .map(|(a, b)| a * b)
            .sum();
        assert!((left - right).abs() < 1e-10 * left.abs().max(1.0), "{left} {right}");
        // Raising orders moves nothing.
        let up = Space::new(&mesh, &topology, *basis, &vec![6; mesh.cells()]).unwrap();
        let raised = Boundary::new(&mesh, &topology, &up, 5);
        let mut again = Vec::new();
        raised.positions(&space.transfer(&x, &up), &mut again);
        for (a, b) in samples.iter().zip(&again) {
            assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-13));
        }
    }
}

#[test]
fn a_shell_takes_its_thickness_and_leaves_the_surface_where_it_is() {
    let outcome = fit(
        json!({ "generate": "shell", "distance": 4.0, "layers": 2, "side": "both" }),
        Some(json!({ "shape": "ellipsoid", "triangles": 200 })),
        // As a file's settings are, with every default.
        VolumeFit.canonical(json!({ "order": 1, "iteration_limit": 300 })),
    )
    .unwrap();
    let ignored = |outcome: &Outcome| {
        outcome
            .notices
            .iter()
            .filter(|notice| notice.contains("without effect"))
            .count()
    };
    assert_eq!(ignored(&outcome), 0, "{:?}", outcome.notices);
    let metric = |name: &str| outcome.metrics[name];
    assert_eq!(metric("prisms"), 4.0 * 192.0);
    assert_eq!(metric("inverted"), 0.0);
    assert_eq!(metric("certified"), metric("elements"));
    assert!(
        metric("thickness_error_mean") < 5.0,
        "{}",
        metric("thickness_error_mean")
    );
    assert!(
        metric("scaled_jacobian_mean") > 0.8,
        "{}",
        metric("scaled_jacobian_mean")
    );
    let volume = coefficient_file::read(&outcome.files["coefficients"]).unwrap();
    let plain = fit(
        json!({ "generate": "shell", "distance": 4.0, "layers": 2, "side": "both" }),
        Some(json!({ "shape": "ellipsoid", "triangles": 200 })),
        json!({ "order": 1, "iteration_limit": 0, "anisotropy": 7.0 }),
    )
    .unwrap();
    assert_eq!(ignored(&plain), 1);
    let start = coefficient_file::read(&plain.files["coefficients"]).unwrap();
    // 192 triangles of a closed surface have 98 vertices.
    assert_eq!(volume.mesh.points[..98], start.mesh.points[..98]);
    assert!(volume.mesh.points[98..] != start.mesh.points[98..]);
}

#[test]
fn a_coefficient_file_is_a_template() {
    let settings = json!({ "order": 3, "iteration_limit": 20 });
    let target = json!({ "shape": "ellipsoid", "triangles": 400 });
    let template = json!({ "generate": "grid", "x": 1, "y": 1, "z": 1, "recipe": [{ "op": "pillow" }] });
    let first = fit(template, Some(target), settings).unwrap();
    let again = |settings: Value, bytes: Vec<u8>| {
        let template = ("template", file("start.coefficients", bytes));
        let target = ("target", generated("ellipsoid", json!({ "triangles": 400 })));
        sample::run(&VolumeFit, model([template, target]), settings)
    };
    let bytes = first.files["coefficients"].clone();
    // Nothing moves: the same volume, with the orders of the file.
    let still = again(
        json!({ "schedule": [{ "lambda": 0.05, "order": 1, "iterations": 0 }] }),
        bytes.clone(),
    )
    .unwrap();
    assert_eq!(still.metrics["order_max"], 3.0);
    for name in ["hausdorff", "scaled_jacobian_mean", "energy_volume"] {
        let (a, b) = (first.metrics[name], still.metrics[name]);
        assert!((a - b).abs() < 1e-9 * a.abs(), "{name}: {a} {b}");
    }
    let other = again(json!({ "basis": "integrated-fourier", "order": 3 }), bytes).unwrap_err();
    assert!(
        other.reason.contains("basis = \"integrated-legendre\""),
        "{}",
        other.reason
    );
}

#[test]
fn a_subdivision_volume_comes_nearer_with_every_level() {
    let run = |levels: u64| {
        fit(
            json!({ "generate": "grid", "x": 2, "y": 2, "z": 2 }),
            Some(json!({ "shape": "ellipsoid", "triangles": 400 })),
            json!({ "order": 1, "subdivision_levels": levels, "crease_angle": 180.0, "iteration_limit": 40 }),
        )
        .unwrap()
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one.metrics["elements"], 64.0);
    assert_eq!(two.metrics["elements"], 512.0);
    for outcome in [&one, &two] {
        assert_eq!(outcome.metrics["inverted"], 0.0);
        assert_eq!(outcome.metrics["increases"], 0.0);
    }
    let rms = |outcome: &Outcome| outcome.metrics["distance_rms"];
    assert!(rms(&two) < 0.75 * rms(&one), "{} {}", rms(&one), rms(&two));
    let refused = fit(
        json!({ "generate": "grid", "x": 2, "y": 2, "z": 2 }),
        Some(json!({ "shape": "ellipsoid", "triangles": 400 })),
        json!({ "order": 2, "subdivision_levels": 1 }),
    );
    assert!(refused.unwrap_err().reason.contains("order = 1"));
}

#[test]
fn cells_numbered_inside_out_are_turned_and_folded_ones_are_not() {
    let mut mesh = grid::grid([3, 3, 3]);
    let right = mesh.clone();
    let content = |mesh: &MixedMesh| Content {
        points: mesh.points.clone(),
        hexahedra: mesh.hexahedra.clone(),
        ..Content::default()
    };
    for (place, cell) in mesh.hexahedra.iter_mut().enumerate() {
        if place % 4 == 1 {
            *cell = [cell[4], cell[5], cell[6], cell[7], cell[0], cell[1], cell[2], cell[3]];
        }
    }
    let (turned, notices) = MixedMesh::from_content(&content(&mesh)).unwrap();
    assert_eq!(turned, right);
    assert!(notices[0].starts_with("7 cells"), "{notices:?}");
    // The middle cell's first corner is moved beyond its last: a fold, which no numbering mends.
    let mut folded = right.clone();
    let corner = folded.hexahedra[13][0] as usize;
    folded.points[corner] = [4.0, 4.0, 4.0];
    let (kept, notices) = MixedMesh::from_content(&content(&folded)).unwrap();
    assert_eq!((kept, notices.len()), (folded.clone(), 0));
    folded.topology().unwrap();
}

#[test]
fn single_orders_rise_where_the_boundary_is_far() {
    let run = |settings: Value| {
        fit(
            json!({ "generate": "grid", "x": 3, "y": 2, "z": 1 }),
            Some(json!({ "shape": "pebble", "triangles": 500 })),
            settings,
        )
        .unwrap()
    };
    let linear = run(json!({ "order": 1, "iteration_limit": 30 }));
    for indicator in ["distance", "energy"] {
        let raised = run(
            json!({ "order": 3, "adaptive": true, "adaptive_indicator": indicator, "adaptive_steps": 1, "adaptive_share": 0.05, "iteration_limit": 30 }),
        );
        // Some are raised by one, not all.
        let mean = raised.metrics["order_mean"];
        assert!(mean > 1.0 && mean < 2.0, "{indicator}: {mean}");
        assert!(raised.metrics["nodes"] > linear.metrics["nodes"]);
        assert!(raised.metrics["hausdorff"] < linear.metrics["hausdorff"], "{indicator}");
        assert_eq!(raised.metrics["inverted"], 0.0);
    }
}
