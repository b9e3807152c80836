//! Files of curved volumes: the order of points that VTK 9.7 and Gmsh 4.15 state themselves, one point where cells
//! meet, and coefficients that come back to the last bit or not at all.

use crate::element_functions::at_point;
use crate::sample::Noise;
use proptest::prelude::*;
use std::collections::BTreeMap;
use vargeo::fem::basis;
use vargeo::fem::batches::unit_reference;
use vargeo::fem::coefficient_file;
use vargeo::fem::lagrange::lagrange;
use vargeo::fem::space::Space;
use vargeo::mesh::curved::{lattice, places};
use vargeo::mesh::format::{gmsh, vtu};
use vargeo::mesh::generate::lattice::kuhn;
use vargeo::mesh::mixed::{MixedMesh, Shape};
use vargeo::mesh::template::{collapse, grid};

#[test]
fn points_are_listed_as_vtk_and_gmsh_list_them() {
    let stored: BTreeMap<String, String> =
        serde_json::from_str(include_str!("golden/lagrange_orders.json")).expect("stored orders");
    assert_eq!(stored.len(), 12);
    for (name, listed) in stored {
        let words: Vec<&str> = name.split(' ').collect();
        let order: usize = words[2].parse().unwrap();
        let shape = match words[1] {
            "hex" => Shape::Hexahedron,
            "prism" => Shape::Prism,
            _ => Shape::Tetrahedron,
        };
        let ours = match words[0] {
            "vtk" => vtu::curved::order_of_points(shape, order),
            _ => gmsh::curved::order_of_points(shape, order),
        };
        let ours: Vec<String> = ours.iter().map(|[i, j, k]| format!("{i}{j}{k}")).collect();
        assert_eq!(ours.join(" "), listed, "{name}");
    }
    // Every order lists every point once.
    for shape in Shape::ALL {
        for order in 1..=16 {
            for listed in [
                vtu::curved::order_of_points(shape, order),
                gmsh::curved::order_of_points(shape, order),
            ] {
                let mut found = places(shape, order, &listed);
                found.sort_unstable();
                assert!(
                    found.into_iter().eq(0..lattice(shape, order).len()),
                    "{shape:?} {order}"
                );
            }
        }
    }
}

/// Hexahedra, prisms and tetrahedra side by side: a grid with a collapsed edge, and a cube of six tetrahedra elsewhere.
fn mixed() -> MixedMesh {
    let mut mesh = collapse::collapse(&grid::grid([2, 2, 1]), 0, [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]).unwrap();
    let first = mesh.points.len() as u32;
    let cube = kuhn(1);
    mesh.points
        .extend(cube.points.iter().map(|[x, y, z]| [5.0 + x, *y, *z]));
    for cell in cube.cells {
        mesh.push(Shape::Tetrahedron, &cell.map(|corner| first + corner));
    }
    mesh
}

#[test]
fn cells_that_meet_share_their_points_and_straight_ones_keep_their_lattice() {
    let mesh = mixed();
    let topology = mesh.topology().unwrap();
    for order in [1, 3, 4] {
        let orders = vec![order; mesh.cells()];
        let space = Space::new(&mesh, &topology, basis::bases()[0], &orders).unwrap();
        let references: Vec<_> = mesh.iter().map(|(shape, _)| unit_reference(shape)).collect();
        let form = lagrange(&mesh, &space, &references, &space.linear(&mesh.points), 16).unwrap();
        assert_eq!(form.approximated, 0);
        assert_eq!(
            form.mesh.points.len(),
            space.nodes,
            "as many points as nodes at order {order}"
        );
        for (cell, (shape, corners)) in form.mesh.cells.iter().zip(mesh.iter()) {
            assert_eq!(cell.shape, shape);
            for (point, &node) in lattice(shape, order).iter().zip(&cell.nodes) {
                let [u, v, w] = point.map(|coordinate| coordinate as f64 / order as f64);
                let weights: Vec<f64> = match shape {
                    Shape::Hexahedron => shape
                        .canonical()
                        .iter()
                        .map(|corner| {
                            let line = |end: f64, at: f64| if end == 0.0 { 1.0 - at } else { at };
                            line(corner[0], u) * line(corner[1], v) * line(corner[2], w)
                        })
                        .collect(),
                    Shape::Prism => {
                        let triangle = [1.0 - u - v, u, v];
                        (0..6)
                            .map(|c| triangle[c % 3] * if c < 3 { 1.0 - w } else { w })
                            .collect()
                    }
                    Shape::Tetrahedron => vec![1.0 - u - v - w, u, v, w],
                };
                for axis in 0..3 {
                    let wanted: f64 = weights
                        .iter()
                        .zip(corners)
                        .map(|(weight, &corner)| weight * mesh.points[corner as usize][axis])
                        .sum();
                    let found = form.mesh.points[node as usize][axis];
                    assert!((wanted - found).abs() < 1e-13, "{shape:?} {point:?}: {wanted} {found}");
                }
            }
        }
    }
}

/// Silvester's polynomial: 1 where `t = n / order`, 0 at the multiples below.
fn silvester(n: usize, order: usize, t: f64) -> f64 {
    (0..n).map(|m| (order as f64 * t - m as f64) / (n - m) as f64).product()
}

/// Lagrange's function of a lattice point.
fn lagrange_function(shape: Shape, order: usize, [i, j, k]: [usize; 3], [u, v, w]: [f64; 3]) -> f64 {
    let r = |n: usize, t: f64| silvester(n, order, t);
    let line = |n: usize, t: f64| r(n, t) * r(order - n, 1.0 - t);
    match shape {
        Shape::Hexahedron => line(i, u) * line(j, v) * line(k, w),
        Shape::Prism => r(i, u) * r(j, v) * r(order - i - j, 1.0 - u - v) * line(k, w),
        Shape::Tetrahedron => r(i, u) * r(j, v) * r(k, w) * r(order - i - j - k, 1.0 - u - v - w),
    }
}

/// A polynomial map of any order is what its lattice points interpolate: between them as well.
#[test]
fn curved_cells_are_the_map_between_their_points_too() {
    let mesh = mixed();
    let topology = mesh.topology().unwrap();
    let mut noise = Noise(5);
    for basis in basis::bases().iter().filter(|basis| basis.is_polynomial()) {
        let orders: Vec<usize> = (0..mesh.cells()).map(|cell| [3, 5, 2, 4][cell % 4]).collect();
        let space = Space::new(&mesh, &topology, *basis, &orders).unwrap();
        let references: Vec<_> = mesh.iter().map(|(shape, _)| unit_reference(shape)).collect();
        let mut x = space.linear(&mesh.points);
        for value in &mut x[3 * mesh.points.len()..] {
            *value = 0.1 * noise.number();
        }
        let form = lagrange(&mesh, &space, &references, &x, 16).unwrap();
        assert_eq!((form.approximated, form.cut), (0, 0));
        for (cell, slots) in form.mesh.cells.iter().zip(&space.cells) {
            for _ in 0..5 {
                let mut point = noise.point().map(|t| 0.5 * (t + 1.0));
                match cell.shape {
                    Shape::Hexahedron => {}
                    Shape::Prism => point[1] *= 1.0 - point[0],
                    Shape::Tetrahedron => point = [0.3, 0.4, 0.2].map(|share| share * point[0]),
                }
                let mut wanted = [0.0; 3];
                for (node, value) in at_point(*basis, slots, point) {
                    for axis in 0..3 {
                        wanted[axis] += value[0] * x[3 * node + axis];
                    }
                }
                let mut found = [0.0; 3];
                for (place, &node) in lattice(cell.shape, cell.order).iter().zip(&cell.nodes) {
                    let weight = lagrange_function(cell.shape, cell.order, *place, point);
                    for axis in 0..3 {
                        found[axis] += weight * form.mesh.points[node as usize][axis];
                    }
                }
                for axis in 0..3 {
                    assert!(
                        (wanted[axis] - found[axis]).abs() < 1e-11,
                        "{:?} {wanted:?} {found:?}",
                        cell.shape
                    );
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn coefficients_come_back_to_the_last_bit(seed in any::<u64>(), orders in prop::collection::vec(1_usize..6, 10)) {
        let mesh = mixed();
        let topology = mesh.topology().unwrap();
        let own: Vec<usize> = (0..mesh.cells()).map(|cell| orders[cell % orders.len()]).collect();
        let space = Space::new(&mesh, &topology, basis::bases()[1], &own).unwrap();
        let mut x = space.linear(&mesh.points);
        let mut noise = Noise(seed);
        for value in &mut x[3 * mesh.points.len()..] {
            *value = 0.01 * noise.number() - 0.3;
        }
        let bytes = coefficient_file::write(&mesh, &space, &x);
        let volume = coefficient_file::read(&bytes).unwrap();
        prop_assert_eq!(volume.basis.name(), space.basis.name());
        prop_assert_eq!(&volume.orders, &own);
        prop_assert_eq!(&volume.mesh, &mesh);
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&volume.x), bits(&x));
        // A damaged file never reads, and never panics.
        let place = (seed % bytes.len() as u64) as usize;
        let mut damaged = bytes.clone();
        damaged[place] ^= 1 << (seed % 7);
        prop_assert!(coefficient_file::read(&damaged).is_err() || damaged[place].is_ascii_whitespace());
        prop_assert!(coefficient_file::read(&bytes[..place]).is_err());
    }
}

#[test]
fn a_header_that_promises_too_much_is_refused() {
    let text = "vargeo-coefficients 1\nbasis integrated-legendre\nvertices 4000000000\nhexahedra 4000000000\nprisms 0\n\
                tetrahedra 0\nnodes 4000000000\nchecksum 0\ndata\n";
    let error = coefficient_file::read(text.as_bytes()).unwrap_err();
    assert!(error.contains("bytes of data"), "{error}");
}
