//! Certificates of single cells: against stored verdicts, against dense sampling, and at high orders.

use serde_json::Value;
use vargeo::fem::basis;
use vargeo::fem::batches::{Batches, unit_reference};
use vargeo::fem::certificate::{Certifier, Verdict};
use vargeo::fem::quadrature::{CellQuadrature, Line, Rule, Scattered};
use vargeo::fem::space::Space;
use vargeo::linalg::processor::Processor;
use vargeo::linalg::vector3::{Columns, cofactor, dot};
use vargeo::mesh::mixed::{MixedMesh, Shape};
use vargeo::mesh::template::grid;

#[test]
fn certificates_agree_with_stored_verdicts() {
    let records: Vec<Value> = serde_json::from_str(include_str!("golden/certificates.json")).unwrap();
    let mut seen = [0, 0];
    for record in &records {
        let mut mesh = MixedMesh {
            points: Shape::Hexahedron.canonical().to_vec(),
            ..MixedMesh::default()
        };
        mesh.push(Shape::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]);
        let topology = mesh.topology().unwrap();
        let name = if record["family"] == "fourier" {
            "integrated-fourier"
        } else {
            "integrated-legendre"
        };
        let basis = basis::find(name).unwrap();
        let order = 4;
        let space = Space::new(&mesh, &topology, basis, &[order]).unwrap();
        // Stored nodes come by vertices, edges, faces and cell in the element's own order.
        let mut nodes: Vec<usize> = (0..8).collect();
        for &edge in &topology.cell_edges[0] {
            nodes.extend((0..order - 1).map(|j| space.edge(edge as usize).0 + j));
        }
        for &face in &topology.cell_faces[0] {
            nodes.extend((0..(order - 1) * (order - 1)).map(|jk| space.face(face as usize).0 + jk));
        }
        nodes.extend((0..(order - 1).pow(3)).map(|ijk| space.inside(0) + ijk));
        let mut x = vec![0.0; 3 * space.nodes];
        for (node, values) in nodes.iter().zip(record["nodes"].as_array().unwrap()) {
            for axis in 0..3 {
                x[3 * node + axis] = values[axis].as_f64().unwrap();
            }
        }
        let certifier = Certifier::new(basis, space.cells.iter().map(|cell| cell.kind), 20_000);
        match certifier.judge(&space, 0, &unit_reference(Shape::Hexahedron), &x) {
            Verdict::Positive(bound) => {
                assert_eq!(record["verdict"], "positive");
                assert!(bound > 0.0);
                seen[0] += 1;
            }
            Verdict::Negative(_, value) => {
                assert_eq!(record["verdict"], "negative");
                assert!(value <= 0.0);
                seen[1] += 1;
            }
            Verdict::Undecided(_) => panic!("undecided, stored: {}", record["verdict"]),
        }
    }
    assert!(seen[0] > 2 && seen[1] > 1, "{seen:?}");
}

#[test]
fn certificates_of_prisms_and_tetrahedra_hold_and_find_failures() {
    // Two numberings of the vertices: they turn a tetrahedron's functions into their mirror images.
    let cells = Shape::ALL
        .into_iter()
        .flat_map(|shape| [[0, 1], [1, 0]].map(|first| (shape, first)));
    for basis in basis::bases() {
        for (shape, first) in cells.clone() {
            let mut corners: Vec<u32> = (0..shape.corners() as u32).collect();
            corners[..2].copy_from_slice(&first);
            let mut mesh = MixedMesh {
                points: corners
                    .iter()
                    .map(|&corner| shape.canonical()[corner as usize])
                    .collect(),
                ..MixedMesh::default()
            };
            mesh.push(shape, &corners);
            let topology = mesh.topology().unwrap();
            let space = Space::new(&mesh, &topology, *basis, &[4]).unwrap();
            let certifier = Certifier::new(*basis, space.cells.iter().map(|cell| cell.kind), 20_000);
            let reference = unit_reference(shape);
            let lattice = Rule::Trapezoid.cell(shape, 12);
            let bent = |size: f64| {
                let mut x = space.linear(&mesh.points);
                for (place, value) in x.iter_mut().enumerate().skip(3 * space.vertices) {
                    *value = size * (1.3 * place as f64).sin() / (1.0 + (place as f64 / 12.0));
                }
                let determinants = determinants(&space, &reference, &x, lattice.clone());
                (x, determinants.into_iter().fold(f64::INFINITY, f64::min))
            };
            // The least sample just above zero and just below.
            let [mut valid, mut failing] = [0.05, 4.0];
            while failing - valid > 1e-6 {
                let middle = 0.5 * (valid + failing);
                if bent(middle).1 > 0.0 {
                    valid = middle;
                } else {
                    failing = middle;
                }
            }
            for size in [0.0, 0.02, 0.05, valid, failing, 4.0] {
                let (x, least) = bent(size);
                let name = format!("{} {shape:?} {first:?} {size}", basis.name());
                match certifier.judge(&space, 0, &reference, &x) {
                    Verdict::Positive(bound) => {
                        assert!(bound > 0.0 && bound <= least + 1e-9, "{name}: {bound} {least}");
                        if size == 0.0 {
                            assert!((bound - least).abs() < 1e-3, "{name}: {bound} {least}");
                        }
                    }
                    Verdict::Negative(point, value) => {
                        let there = determinant_at(&space, &reference, &x, point);
                        assert!((there - value).abs() < 1e-9 && there <= 0.0, "{name}: {there} {value}");
                        assert!(size > 0.05, "{name}");
                    }
                    Verdict::Undecided(bound) => assert!(size == valid, "{name}: undecided, {bound} {least}"),
                }
                if size >= failing {
                    assert!(least < 0.0, "{name}");
                }
            }
        }
    }
}

#[test]
fn kernels_are_smooth_in_the_middle() {
    for basis in basis::bases() {
        for j in 1..8 {
            let middle = basis.kernel(j, 0.0);
            for s in [1e-300, 1e-17, 1e-16, 2e-16, 1e-15, 1e-12] {
                for s in [s, -s] {
                    let there = basis.kernel(j, s);
                    for part in 0..2 {
                        let difference = (there[part] - middle[part]).abs();
                        assert!(difference < 1e-9, "{} {j} {s:e}: {there:?} {middle:?}", basis.name());
                    }
                }
            }
        }
    }
}

#[test]
fn gently_bent_prisms_and_tetrahedra_with_sines_are_certified() {
    for basis in basis::bases().iter().filter(|basis| !basis.is_polynomial()) {
        for shape in [Shape::Prism, Shape::Tetrahedron] {
            for order in [2, 3, 4, 5, 6, 9] {
                let mut mesh = MixedMesh {
                    points: shape.canonical().to_vec(),
                    ..MixedMesh::default()
                };
                mesh.push(shape, &(0..shape.corners() as u32).collect::<Vec<_>>());
                let topology = mesh.topology().unwrap();
                let space = Space::new(&mesh, &topology, *basis, &[order]).unwrap();
                let certifier = Certifier::new(*basis, space.cells.iter().map(|cell| cell.kind), 2000);
                let reference = unit_reference(shape);
                let lattice = Rule::Trapezoid.cell(shape, 12);
                // What cannot be decided is cut as often as allowed, which takes long at high orders.
                let sizes = if order > 6 { &[0.02][..] } else { &[0.02, 1.0, 4.0] };
                for &size in sizes {
                    let mut x = space.linear(&mesh.points);
                    for (place, value) in x.iter_mut().enumerate().skip(3 * space.vertices) {
                        *value = size * (1.3 * place as f64).sin() / (1.0 + (place as f64 / 12.0));
                    }
                    let determinants = determinants(&space, &reference, &x, lattice.clone());
                    let least = determinants.into_iter().fold(f64::INFINITY, f64::min);
                    let verdict = certifier.judge(&space, 0, &reference, &x);
                    let name = format!("{} {shape:?} {order} {size}: {verdict:?} {least}", basis.name());
                    match verdict {
                        Verdict::Positive(bound) => assert!(bound > 0.0 && bound <= least + 1e-9, "{name}"),
                        Verdict::Negative(_, value) => assert!(size > 0.02 && value <= 0.0, "{name}"),
                        Verdict::Undecided(bound) => assert!(size > 0.02 && bound <= least, "{name}"),
                    }
                    assert!(size < 4.0 || least < 0.0, "{name}");
                }
            }
        }
    }
}

/// A square whose corner is drawn in until the determinant there is just above or just below zero, as a slab.
#[test]
fn determinants_near_zero_are_told_apart() {
    for basis in basis::bases() {
        for order in [1, 3, 8] {
            for decided in [1e-4, -1e-4, 1e-2, -1e-2] {
                let mut mesh = grid::grid([1, 1, 1]);
                // At the corner (a, a) the determinant is 2 a - 1, and larger elsewhere.
                for point in mesh.points.iter_mut().filter(|point| point[0] + point[1] == 2.0) {
                    (point[0], point[1]) = (0.5 * (1.0 + decided), 0.5 * (1.0 + decided));
                }
                let topology = mesh.topology().unwrap();
                let space = Space::new(&mesh, &topology, *basis, &[order]).unwrap();
                let certifier = Certifier::new(*basis, space.cells.iter().map(|cell| cell.kind), 4000);
                let x = space.linear(&mesh.points);
                let verdict = certifier.judge(&space, 0, &unit_reference(Shape::Hexahedron), &x);
                let name = format!("{} order {order} determinant {decided}: {verdict:?}", basis.name());
                match verdict {
                    Verdict::Positive(bound) => assert!(bound > 0.0 && bound <= decided * (1.0 + 1e-9), "{name}"),
                    Verdict::Negative(point, value) => {
                        let there = determinant_at(&space, &unit_reference(Shape::Hexahedron), &x, point);
                        assert!(decided < 0.0 && value <= 0.0 && (there - value).abs() < 1e-12, "{name}");
                    }
                    Verdict::Undecided(_) => panic!("{name}"),
                }
            }
        }
    }
}

/// Determinants of the only cell of a space at the points of a quadrature.
fn determinants(space: &Space, reference: &Columns<f64>, x: &[f64], quadrature: CellQuadrature) -> Vec<f64> {
    let batches = Batches::new(space, &[*reference], &|_| quadrature.clone()).unwrap();
    let mut result = Vec::new();
    batches.visit(Processor::detect(), (0, 0), x, |_, _, jacobian| {
        result.push(dot(jacobian[0], cofactor(&jacobian)[0]));
    });
    result
}

/// The determinant of the only cell of a space at one point.
fn determinant_at(space: &Space, reference: &Columns<f64>, x: &[f64], [u, v, w]: [f64; 3]) -> f64 {
    let line = |points: &[f64]| Line {
        points: points.to_vec(),
        weights: vec![1.0; points.len()],
    };
    let (quadrature, place) = match space.cells[0].kind.shape {
        // Of the 27 points the one with the coordinates in their order.
        Shape::Hexahedron => (CellQuadrature::Hexahedron(line(&[u, v, w])), 5),
        Shape::Prism => {
            let triangle = Scattered {
                points: vec![[u, v]],
                weights: vec![1.0],
            };
            (CellQuadrature::Prism(triangle, line(&[w])), 0)
        }
        Shape::Tetrahedron => {
            // The cell's own coordinates, in the frame of its functions.
            let weights = [1.0 - u - v - w, u, v, w];
            let corners = space.cells[0].corners;
            let point = Scattered {
                points: vec![[1, 2, 3].map(|place| weights[corners[place] as usize])],
                weights: vec![1.0],
            };
            (CellQuadrature::Tetrahedron(point), 0)
        }
    };
    determinants(space, reference, x, quadrature)[place]
}

#[test]
fn rounding_at_high_orders_stays_within_the_margin() {
    let shapes = [Shape::Hexahedron, Shape::Prism, Shape::Tetrahedron];
    // Sines are interpolated, which costs more of the margin than rounding.
    let kinds = [("integrated-legendre", 1e-3), ("integrated-fourier", 2e-2)];
    for ((name, margin), shape) in kinds.into_iter().flat_map(|kind| shapes.map(|shape| (kind, shape))) {
        let basis = basis::find(name).unwrap();
        let order = 16;
        let mut mesh = MixedMesh {
            points: shape.canonical().to_vec(),
            ..MixedMesh::default()
        };
        mesh.push(shape, &(0..shape.corners() as u32).collect::<Vec<_>>());
        let topology = mesh.topology().unwrap();
        let space = Space::new(&mesh, &topology, basis, &[order]).unwrap();
        let certifier = Certifier::new(basis, space.cells.iter().map(|cell| cell.kind), 64);
        let reference = unit_reference(shape);
        let x = space.linear(&mesh.points);
        let exact = determinant_at(&space, &reference, &x, [0.25; 3]);
        match certifier.judge(&space, 0, &reference, &x) {
            Verdict::Positive(bound) => {
                assert!(
                    bound <= exact * (1.0 + 1e-12) && bound > exact * (1.0 - margin),
                    "{name} {shape:?}: {bound} {exact}"
                );
            }
            other => panic!("{name} {shape:?}: {other:?}"),
        }
    }
}
