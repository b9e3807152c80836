//! The page holds everything, loads nothing, lets nothing through as markup, and is the same for the same records.

use crate::sample::{self, Noise};
use serde_json::json;
use std::path::{Path, PathBuf};
use vargeo::experiment::file::Experiment;
use vargeo::experiment::record::Status;
use vargeo::mesh::TetrahedralMesh;
use vargeo::mesh::format::{Cells, vtu};
use vargeo::mesh::generate::lattice::kuhn;
use vargeo::report::{self, Row};

fn written(experiment: &Experiment, rows: &[Row]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let written = report::write(experiment, rows, rows.len(), folder.path()).unwrap();
    std::fs::read_to_string(written.page).unwrap()
}

/// Bytes in a file of their own, as a store holds them.
fn stored(bytes: &[u8]) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("stored");
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(vargeo::experiment::job::sha256(bytes));
    let mut file = tempfile::NamedTempFile::new_in(&folder).expect("a file");
    std::io::Write::write_all(&mut file, bytes).expect("room for it");
    file.persist(&path).expect("a file");
    path
}

/// A grid of six tetrahedra a cell mapped onto a bulging, twisted one, as a VTU file with the fields of a map.
fn mesh(size: usize, twist: f64) -> Vec<u8> {
    let mut noise = Noise(12_345);
    let TetrahedralMesh {
        points: mut source,
        cells,
    } = kuhn(size);
    let mut image = Vec::new();
    for point in &mut source {
        let place = point.map(|part| 2.0 * part - 1.0);
        let inner = place.iter().all(|part| part.abs() < 1.0);
        let shake = if inner { 0.25 / size as f64 } else { 0.0 };
        *point = place.map(|part| part + shake * noise.number());
        let [x, y, z] = *point;
        // The cube onto the ball, then twisted about the third axis.
        let ball = [
            x * (1.0 - y * y / 2.0 - z * z / 2.0 + y * y * z * z / 3.0).sqrt(),
            y * (1.0 - z * z / 2.0 - x * x / 2.0 + z * z * x * x / 3.0).sqrt(),
            z * (1.0 - x * x / 2.0 - y * y / 2.0 + x * x * y * y / 3.0).sqrt(),
        ];
        let (sine, cosine) = (twist * ball[2]).sin_cos();
        image.push([
            cosine * ball[0] - sine * ball[1],
            sine * ball[0] + cosine * ball[1],
            ball[2],
        ]);
    }
    let determinant =
        |points: &[[f64; 3]], cell: &[u32; 4]| vargeo::mesh::determinant(cell.map(|corner| points[corner as usize]));
    let determinants: Vec<f64> = cells
        .iter()
        .map(|cell| determinant(&image, cell) / determinant(&source, cell))
        .collect();
    let edges = |points: &[[f64; 3]], cell: &[u32; 4]| {
        let mut sum = 0.0;
        for i in 0..4 {
            for j in 0..i {
                sum += (0..3)
                    .map(|axis| (points[cell[i] as usize][axis] - points[cell[j] as usize][axis]).powi(2))
                    .sum::<f64>();
            }
        }
        sum
    };
    let angle: Vec<f64> = cells
        .iter()
        .zip(&determinants)
        .map(|(cell, det)| edges(&image, cell) / edges(&source, cell) / det.abs().max(1e-9).powf(2.0 / 3.0))
        .collect();
    let volume: Vec<f64> = determinants
        .iter()
        .map(|det| det.abs().max(1e-12).max(1.0 / det.abs().max(1e-12)))
        .collect();
    let density: Vec<f64> = angle
        .iter()
        .zip(&volume)
        .map(|(angle, volume)| angle * angle + volume)
        .collect();
    let jacobian: Vec<f64> = determinants
        .iter()
        .zip(&angle)
        .map(|(det, angle)| det.signum() / angle)
        .collect();
    let inverted: Vec<f64> = determinants
        .iter()
        .enumerate()
        .map(|(index, det)| f64::from(u8::from(*det <= 0.0 || index % 977 == 5)))
        .collect();
    vtu::write(
        &image,
        Cells {
            tetrahedra: &cells,
            ..Cells::default()
        },
        &[("source", 3, source.as_flattened())],
        &[
            ("angle_distortion", 1, &angle),
            ("volume_distortion", 1, &volume),
            ("determinant", 1, &determinants),
            ("energy_density", 1, &density),
            ("scaled_jacobian", 1, &jacobian),
            ("inverted", 1, &inverted),
        ],
    )
}

/// Ten results of one mesh of 13,182 tetrahedra.
fn ten() -> Vec<Row> {
    (0..10)
        .map(|index| {
            let mut row = sample::rows().swap_remove(index % 4);
            row.name = format!("ball-{index}");
            row.axes = vec![
                ("model".into(), json!("ball")),
                ("energy".into(), json!(format!("energy {index}"))),
            ];
            row.mesh = Some(stored(&mesh(13, 0.15 * index as f64)));
            row
        })
        .collect()
}

/// Every start tag has its end tag in the right order.
fn assert_well_formed(page: &str) {
    const VOID: [&str; 5] = ["meta", "img", "input", "br", "!doctype"];
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page;
    while let Some(start) = rest.find('<') {
        rest = &rest[start + 1..];
        let end = rest.find('>').expect("a tag ends");
        let tag = &rest[..end];
        rest = &rest[end + 1..];
        let name = tag.trim_start_matches('/').split([' ', '/']).next().unwrap();
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "at {}", &rest[..rest.len().min(80)]);
        } else if !tag.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
            if name == "script" || name == "style" {
                let close = rest.find(&format!("</{name}")).expect("raw text ends");
                rest = &rest[close..];
            }
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
}

#[test]
fn ten_meshes_stay_below_a_megabyte() {
    let page = written(&sample::experiment(), &ten());
    assert_well_formed(&page);
    assert!(page.len() < 1 << 20, "{} bytes", page.len());
    assert_eq!(page.matches("id=\"job-").count(), 10);
    assert_eq!(page.matches("id=\"mesh-").count(), 1, "one mesh is stored once");
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 10);
    assert!(
        !page.contains("src=\"http") && !page.contains("<link"),
        "nothing is loaded"
    );
}

#[test]
fn every_end_of_a_job_has_its_place() {
    let page = written(&sample::experiment(), &sample::rows());
    assert_well_formed(&page);
    for text in [
        "time-limit",
        "stopped after 600 s",
        "infeasible",
        "boundary triangle 17",
        "missing-model",
        "step-limit",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("NaN") && !page.contains("nan<"));
    assert!(!page.contains("<script"), "nothing to look at in three dimensions");
}

#[test]
fn undefined_and_infinite_figures_are_words() {
    let mut rows = sample::rows();
    rows[0].record.result.metrics.insert("d_ma".into(), f64::NAN);
    rows[1].record.result.metrics.insert("d_aa".into(), f64::INFINITY);
    let page = written(&sample::experiment(), &rows);
    assert!(!page.contains("NaN") && page.contains("undefined") && page.contains("infinite"));
}

#[test]
fn text_cannot_become_markup() {
    let evil = "</td><script>alert(1)</script>\"'&";
    let mut experiment = sample::experiment();
    experiment.title = evil.into();
    experiment.description = evil.into();
    experiment.tables[0].title = Some(evil.into());
    experiment.plots[0].title = Some(evil.into());
    let mut rows = sample::rows();
    for row in &mut rows {
        row.record.result.reason = evil.into();
        row.record.result.notices = vec![evil.into()];
        row.record.measurement.host = evil.into();
        row.axes[0].1 = json!(evil);
    }
    rows[0].mesh = Some(stored(&mesh(2, 0.1)));
    rows[1].mesh = Some(stored(format!("no mesh {evil}").as_bytes()));
    let page = written(&experiment, &rows);
    assert_well_formed(&page);
    assert!(!page.contains("alert(1)</script>"));
    assert!(page.contains("cannot be shown"));
}

#[test]
fn the_same_records_give_the_same_bytes() {
    let read = |folder: &Path| {
        let mut files: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        files.sort();
        files
            .iter()
            .map(|file| (file.file_name().unwrap().to_owned(), std::fs::read(file).unwrap()))
            .collect::<Vec<_>>()
    };
    let mut rows = sample::rows();
    rows[1].mesh = Some(stored(&mesh(4, 0.4)));
    let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let stored = tempfile::NamedTempFile::new().unwrap();
    rows[1].files = vec![("notes.txt".into(), stored.path().into())];
    report::write(&sample::experiment(), &rows, rows.len(), first.path()).unwrap();
    for row in &mut rows {
        row.cached = true;
    }
    report::write(&sample::experiment(), &rows, rows.len(), second.path()).unwrap();
    let files = read(first.path());
    assert!(files == read(second.path()));
    let names: Vec<_> = files.iter().map(|file| file.0.to_str().unwrap()).collect();
    insta::assert_snapshot!("files", names.join(" "));
}

#[test]
fn no_jobs_give_a_page_all_the_same() {
    let page = written(&sample::experiment(), &[]);
    assert_well_formed(&page);
    assert!(page.contains("no job matches"));
}

/// Writes a page to look at: `cargo test --test tests page::to_look_at -- --ignored`.
#[test]
#[ignore = "for eyes"]
fn to_look_at() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("page");
    let mut experiment = sample::experiment();
    let mut rows = sample::rows();
    for (index, row) in rows.iter_mut().enumerate() {
        if row.record.result.status == Status::Done {
            row.mesh = Some(stored(&mesh(13, 0.5 * index as f64)));
        }
    }
    let (mut study, rate) = sample::study();
    let mut plot = experiment.plots[0].clone();
    plot.name = "convergence".into();
    plot.title = Some("Error against h".into());
    (plot.x, plot.y) = ("h".into(), "error".into());
    plot.series = vec!["family".into()];
    (plot.log_x, plot.log_y) = (true, true);
    plot.condition = sample::condition(&[("family", &[json!("even"), json!("random")])]);
    experiment.plots.push(plot);
    experiment.rates.push(vargeo::experiment::file::Rate {
        condition: sample::condition(&[("family", &[json!("even"), json!("random")])]),
        ..rate
    });
    rows.append(&mut study);
    experiment.tables[0].condition = sample::condition(&[("model", &[json!("ball"), json!("duck"), json!("horse")])]);
    report::write(&experiment, &rows, rows.len(), &folder).unwrap();
    println!("{}", folder.display());
}

/// A hexahedron and a quad are drawn without the diagonals at which they are split.
#[test]
fn diagonals_of_quadrilateral_faces_are_not_drawn() {
    use vargeo::mesh::format::Content;
    use vargeo::report::picture::{cut, solid::Solid};
    let corner = |index: usize| [0, 1, 2].map(|axis| ([0x66, 0xcc, 0xf0][axis] >> index & 1) as f64);
    let points: Vec<[f64; 3]> = (0..8).map(corner).collect();
    let hexahedron = Solid::from_content(&Content {
        points: points.clone(),
        hexahedra: vec![[0, 1, 2, 3, 4, 5, 6, 7]],
        ..Content::default()
    });
    let quad = Solid::from_content(&Content {
        points,
        quads: vec![[0, 1, 2, 3]],
        ..Content::default()
    });
    for (solid, faces) in [(hexahedron, 6), (quad, 1)] {
        assert_eq!(solid.diagonals.len(), faces);
        let facets = cut::facets(&solid, &solid.points, None);
        assert_eq!(facets.len(), 2 * faces);
        assert!(
            facets
                .iter()
                .all(|facet| facet.sides.iter().filter(|&&drawn| drawn).count() == 2)
        );
    }
}

/// A body is cut open towards the eye, a flat one along its plane, where the cut leaves its outline.
#[test]
fn flat_bodies_are_cut_open_along_their_plane() {
    use vargeo::report::picture::{EYE, cut};
    let corner = |size: [f64; 3], index: usize| [0, 1, 2].map(|axis| size[axis] * (index >> axis & 1) as f64);
    for (size, axis) in [
        ([1.0, 1.0, 1.0], 1),
        ([4.0, 1.0, 1.0], 1),
        ([4.0, 3.0, 1.0], 2),
        ([1.0, 3.0, 9.0], 0),
    ] {
        let points: Vec<[f64; 3]> = (0..8).map(|index| corner(size, index)).collect();
        let plane = cut::Plane::towards(EYE, &points);
        let normal = [0, 1, 2].map(|other| if other == axis { EYE[axis].signum() } else { 0.0 });
        assert_eq!(
            (plane.normal, plane.offset),
            (normal, 0.5 * normal[axis] * size[axis]),
            "{size:?}"
        );
    }
}
