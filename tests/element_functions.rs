//! Shape functions against stored values, conformity between cells in every orientation, quadrature exactness, gradients.

use crate::sample::Noise;
use serde_json::Value;
use std::collections::BTreeMap;
use vargeo::energy;
use vargeo::energy::mapping::Density;
use vargeo::fem::basis::{Basis, bases, find};
use vargeo::fem::batches::{Batches, references_of_volume, unit_reference};
use vargeo::fem::functions::{line_table, tetrahedron_table, triangle_inside, triangle_table};
use vargeo::fem::quadrature::{RULES, Rule};
use vargeo::fem::space::{CellSlots, Space};
use vargeo::fem::volume_energy::VolumeEnergy;
use vargeo::linalg::vector3::apply;
use vargeo::mesh::mixed::{MixedMesh, Shape};
use vargeo::mesh::template::grid;
use vargeo::method::volume_fit::quality;

/// Numbers in [0, 1) and what is drawn by them.
struct Random(Noise);

impl Random {
    fn next(&mut self) -> f64 {
        0.5 * (1.0 + self.0.number())
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() * count as f64) as usize
    }

    fn shuffle(&mut self, list: &mut [u32]) {
        for i in (1..list.len()).rev() {
            list.swap(i, self.below(i + 1));
        }
    }
}

/// Value and gradient of every node's function at a point of a cell.
pub(crate) fn at_point(basis: &dyn Basis, cell: &CellSlots, point: [f64; 3]) -> BTreeMap<usize, [f64; 4]> {
    let order = cell.kind.order;
    let [u, v, w] = point;
    let mut local = Vec::new();
    match cell.kind.shape {
        Shape::Hexahedron => {
            let lines = point.map(|x| line_table(basis, order, &[x]));
            for i in 0..=order {
                for j in 0..=order {
                    for k in 0..=order {
                        let value = |d: usize, n: usize| lines[d].values[n];
                        let slope = |d: usize, n: usize| lines[d].derivatives[0][n];
                        local.push([
                            value(0, i) * value(1, j) * value(2, k),
                            slope(0, i) * value(1, j) * value(2, k),
                            value(0, i) * slope(1, j) * value(2, k),
                            value(0, i) * value(1, j) * slope(2, k),
                        ]);
                    }
                }
            }
        }
        Shape::Prism => {
            let line = line_table(basis, order, &[w]);
            for level in 0..=order {
                let last = if level < 2 { cell.kind.last[level] } else { 2 };
                let triangle = triangle_table(basis, order, last, &[[u, v]]);
                let (value, slope) = (line.values[level], line.derivatives[0][level]);
                for t in 0..triangle.functions {
                    local.push([
                        triangle.values[t] * value,
                        triangle.derivatives[0][t] * value,
                        triangle.derivatives[1][t] * value,
                        triangle.values[t] * slope,
                    ]);
                }
            }
        }
        Shape::Tetrahedron => {
            // The functions' corners are the cell's in ascending order: barycentric coordinates follow them.
            let given = [1.0 - u - v - w, u, v, w];
            let own: [f64; 4] = std::array::from_fn(|place| given[cell.corners[place] as usize]);
            let table = tetrahedron_table(basis, order, &[[own[1], own[2], own[3]]]);
            let gradients = [[-1.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            for f in 0..table.functions {
                let mut entry = [table.values[f], 0.0, 0.0, 0.0];
                for d in 0..3 {
                    for axis in 0..3 {
                        entry[1 + axis] += table.derivatives[d][f] * gradients[cell.corners[d + 1] as usize][axis];
                    }
                }
                local.push(entry);
            }
        }
    }
    let mut result = BTreeMap::new();
    for (slot, function) in cell.slots.iter().zip(local) {
        if let Some((node, sign)) = slot.node() {
            let before = result.insert(node, function.map(|value| sign * value));
            assert!(before.is_none(), "a node has one function a cell");
        }
    }
    result
}

#[test]
fn functions_agree_with_stored_values() {
    let records: Vec<Value> = serde_json::from_str(include_str!("golden/shape_functions.json")).unwrap();
    assert_eq!(records.len(), 12);
    for record in &records {
        let numbers = |key: &str| -> Vec<f64> {
            let list = record[key].as_array().unwrap();
            list.iter().map(|value| value.as_f64().unwrap()).collect()
        };
        let shape = match record["kind"].as_str().unwrap() {
            "hex" => Shape::Hexahedron,
            "prism" => Shape::Prism,
            _ => Shape::Tetrahedron,
        };
        let family = if record["family"] == "fourier" {
            "integrated-fourier"
        } else {
            "integrated-legendre"
        };
        let basis = find(family).unwrap();
        let order = record["p"].as_u64().unwrap() as usize;
        let corners: Vec<u32> = numbers("gid").iter().map(|&id| id as u32).collect();
        let mut mesh = MixedMesh {
            points: vec![[0.0; 3]; 8],
            ..MixedMesh::default()
        };
        mesh.push(shape, &corners);
        let topology = mesh.topology().unwrap();
        let space = Space::new(&mesh, &topology, basis, &[order]).unwrap();
        let point: [f64; 3] = numbers("point").try_into().unwrap();
        let ours = at_point(basis, &space.cells[0], point);
        let values = numbers("values");
        assert_eq!(ours.len(), values.len());
        let mut inside = space.inside(0);
        for (place, entity) in record["entity"].as_array().unwrap().iter().enumerate() {
            let index = |n: usize| entity[n].as_u64().unwrap() as usize;
            let node = match entity[0].as_str().unwrap() {
                "v" => corners[index(1)] as usize,
                "e" => space.edge(topology.cell_edges[0][index(1)] as usize).0 + index(2) - 1,
                "q" => {
                    // The stored quads of a prism are counted apart from its triangles.
                    let face = index(1) + if shape == Shape::Prism { 2 } else { 0 };
                    let start = space.face(topology.cell_faces[0][face] as usize).0;
                    start + (index(2) - 1) * (order - 1) + index(3) - 1
                }
                "t" => {
                    let start = space.face(topology.cell_faces[0][index(1)] as usize).0;
                    let jk = [index(2), index(3)];
                    start + triangle_inside(order).iter().position(|own| *own == jk).unwrap()
                }
                _ => {
                    inside += 1;
                    inside - 1
                }
            };
            let [value, gradient @ ..] = ours[&node];
            assert!((value - values[place]).abs() < 1e-13, "{shape:?} {family} {entity}");
            for axis in 0..3 {
                let wanted = record["grads"][place][axis].as_f64().unwrap();
                assert!(
                    (gradient[axis] - wanted).abs() < 1e-11,
                    "{shape:?} {family} {entity} {axis}"
                );
            }
        }
    }
}

/// A cell whose face `face` has the global vertices `ring` in this order, all others being fresh.
fn cell_on(shape: Shape, face: usize, ring: &[u32], fresh: &mut impl FnMut() -> u32) -> Vec<u32> {
    let mut corners = vec![u32::MAX; shape.corners()];
    for (&local, &vertex) in shape.faces()[face].iter().zip(ring) {
        corners[local] = vertex;
    }
    for corner in &mut corners {
        if *corner == u32::MAX {
            *corner = fresh();
        }
    }
    corners
}

#[test]
fn neighbours_agree_on_their_face_in_every_orientation() {
    let mut random = Random(Noise(7));
    for basis in bases() {
        for corners in [3, 4] {
            let sides: Vec<(Shape, usize)> = Shape::ALL
                .into_iter()
                .flat_map(|shape| (0..shape.faces().len()).map(move |face| (shape, face)))
                .filter(|&(shape, face)| shape.faces()[face].len() == corners)
                .collect();
            for &(first, a) in &sides {
                for &(second, b) in &sides {
                    let mut ids: Vec<u32> = (0..16).collect();
                    random.shuffle(&mut ids);
                    let ring: Vec<u32> = ids.drain(..corners).collect();
                    // The second cell sees the ring backwards, from any of its corners.
                    let turn = random.below(corners);
                    let back: Vec<u32> = (0..corners).map(|k| ring[(turn + corners - k) % corners]).collect();
                    let mut fresh = || ids.pop().unwrap();
                    let mut mesh = MixedMesh {
                        points: vec![[0.0; 3]; 16],
                        ..MixedMesh::default()
                    };
                    let cells = [
                        (first, cell_on(first, a, &ring, &mut fresh)),
                        (second, cell_on(second, b, &back, &mut fresh)),
                    ];
                    for (shape, corners) in &cells {
                        mesh.push(*shape, corners);
                    }
                    let number = |wanted: &(Shape, Vec<u32>)| {
                        mesh.iter().position(|(s, c)| s == wanted.0 && c == wanted.1).unwrap()
                    };
                    let numbers = [number(&cells[0]), number(&cells[1])];
                    let topology = mesh.topology().unwrap();
                    // Different orders: the face takes the lower one.
                    let mut orders = [5, 5];
                    orders[random.below(2)] = 4 + random.below(2);
                    let space = Space::new(&mesh, &topology, *basis, &orders).unwrap();
                    let weights: Vec<f64> = (0..corners).map(|_| random.next() + 0.1).collect();
                    let sum: f64 = weights.iter().sum();
                    let (s, t) = (random.next(), random.next());
                    let bilinear = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
                    let traces = [0, 1].map(|side| {
                        let (shape, own) = &cells[side];
                        let mut point = [0.0; 3];
                        for (place, vertex) in ring.iter().enumerate() {
                            let local = own.iter().position(|corner| corner == vertex).unwrap();
                            let weight = if corners == 4 {
                                bilinear[place]
                            } else {
                                weights[place] / sum
                            };
                            for axis in 0..3 {
                                point[axis] += weight * shape.canonical()[local][axis];
                            }
                        }
                        at_point(*basis, &space.cells[numbers[side]], point)
                    });
                    let mut shared = 0;
                    for (one, other) in [(0, 1), (1, 0)] {
                        for (node, value) in &traces[one] {
                            match traces[other].get(node) {
                                Some(there) => {
                                    shared += 1;
                                    assert!((value[0] - there[0]).abs() < 1e-13, "{first:?} {second:?} node {node}");
                                }
                                None => assert!(value[0].abs() < 1e-13, "{first:?} leaks node {node}"),
                            }
                        }
                    }
                    let least = orders[0].min(orders[1]);
                    let most = if corners == 4 {
                        (least + 1) * (least + 1)
                    } else {
                        (least + 1) * (least + 2) / 2
                    };
                    assert_eq!(shared / 2, most, "{first:?} {second:?} share all functions of the face");
                }
            }
        }
    }
}

/// Four cubes around an edge, one of a lower order: the edge takes it, though two of its faces keep the higher one, and
/// all four cells agree along it.
#[test]
fn an_edge_may_have_a_lower_order_than_the_faces_beside_it() {
    let mesh = grid::grid([2, 2, 1]);
    let topology = mesh.topology().unwrap();
    let at = |place: [f64; 3]| mesh.points.iter().position(|point| *point == place).unwrap() as u32;
    let mut ends = [at([1.0, 1.0, 0.0]), at([1.0, 1.0, 1.0])];
    ends.sort_unstable();
    let edge = topology.edges.iter().position(|edge| *edge == ends).unwrap();
    for basis in bases() {
        let space = Space::new(&mesh, &topology, *basis, &[2, 5, 5, 5]).unwrap();
        let orders = |faces: &[u32]| {
            let mut orders: Vec<usize> = faces.iter().map(|&face| space.face(face as usize).1).collect();
            orders.sort_unstable();
            orders
        };
        let around: Vec<u32> = (0..topology.faces.len() as u32)
            .filter(|&face| {
                ends.iter()
                    .all(|end| topology.faces[face as usize].corners().contains(end))
            })
            .collect();
        assert_eq!((space.edge(edge).1, orders(&around)), (2, vec![2, 2, 5, 5]));
        for height in [0.1, 0.37, 0.8] {
            let traces: Vec<BTreeMap<usize, [f64; 4]>> = (0..4)
                .map(|cell| {
                    let [x, y] = [[1.0, 1.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0]][cell];
                    at_point(*basis, &space.cells[cell], [x, y, height])
                })
                .collect();
            for (cell, trace) in traces.iter().enumerate() {
                let own = trace.iter().filter(|(_, value)| value[0].abs() > 1e-13);
                let nodes: Vec<usize> = own.clone().map(|(node, _)| *node).collect();
                assert_eq!(nodes.len(), 3, "{} cell {cell}: {nodes:?}", basis.name());
                for (node, value) in own {
                    assert!(
                        (traces[0][node][0] - value[0]).abs() < 1e-13,
                        "{} cell {cell}",
                        basis.name()
                    );
                }
            }
        }
    }
}

/// The shape at which a scaled Jacobian is 1, straight but with functions of high order, moved and turned.
#[test]
fn ideal_cells_have_the_scaled_jacobian_one_at_every_order() {
    for basis in bases() {
        for shape in Shape::ALL {
            for order in [1, 4, 9] {
                let reference = unit_reference(shape);
                let turn = |[x, y, z]: [f64; 3]| [0.6 * x - 0.8 * y + 3.0, 0.8 * x + 0.6 * y, z - 1.0];
                let place = |corner: &[f64; 3]| turn(apply(&reference, *corner).map(|x| 2.5 * x));
                let mut mesh = MixedMesh {
                    points: shape.canonical().iter().map(place).collect(),
                    ..MixedMesh::default()
                };
                mesh.push(shape, &(0..shape.corners() as u32).collect::<Vec<_>>());
                let topology = mesh.topology().unwrap();
                let space = Space::new(&mesh, &topology, *basis, &[order]).unwrap();
                let x = space.linear(&mesh.points);
                let quality = quality::quality(&space, &[reference], &x).unwrap();
                let [mean, least] = [quality.scaled_jacobian_mean[0], quality.scaled_jacobian_min[0]];
                assert!(
                    (mean - 1.0).abs() < 1e-12 && (least - 1.0).abs() < 1e-12,
                    "{shape:?} {order}: {mean} {least}"
                );
                assert!(
                    (quality.least_determinant[0] / 2.5_f64.powi(3) - 1.0).abs() < 1e-12,
                    "{shape:?} {order}"
                );
            }
        }
    }
}

#[test]
fn quadrature_is_exact_as_stated() {
    let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
    for &(name, rule, _) in RULES {
        for n in [2, 3, 6] {
            let degree = match rule {
                Rule::Gauss => 2 * n - 1,
                Rule::Lobatto => 2 * n - 3,
                Rule::Trapezoid => 1,
            };
            // Degree within triangles and tetrahedra.
            let simplices = if rule == Rule::Gauss { degree } else { 1 };
            for shape in Shape::ALL {
                let nodes = rule.cell(shape, n).nodes();
                for a in 0..=degree {
                    for b in 0..=degree {
                        for c in 0..=degree {
                            let (exact, total) = match shape {
                                Shape::Hexahedron => (1.0 / ((a + 1) * (b + 1) * (c + 1)) as f64, a.max(b).max(c)),
                                Shape::Prism => (
                                    factorial(a) * factorial(b) / factorial(a + b + 2) / (c + 1) as f64,
                                    (a + b).max(c),
                                ),
                                Shape::Tetrahedron => (
                                    factorial(a) * factorial(b) * factorial(c) / factorial(a + b + c + 3),
                                    a + b + c,
                                ),
                            };
                            let within = match shape {
                                Shape::Hexahedron => 0,
                                Shape::Prism => a + b,
                                Shape::Tetrahedron => a + b + c,
                            };
                            if total > degree || within > simplices {
                                continue;
                            }
                            let sum: f64 = nodes
                                .iter()
                                .map(|([u, v, w], weight)| {
                                    weight * u.powi(a as i32) * v.powi(b as i32) * w.powi(c as i32)
                                })
                                .sum();
                            assert!((sum - exact).abs() < 1e-14, "{name} {shape:?} n={n} u^{a} v^{b} w^{c}");
                        }
                    }
                }
            }
        }
    }
}

/// Two hexahedra, a prism on the side of one and a tetrahedron on the prism, in general position.
fn mixed(random: &mut Random) -> MixedMesh {
    let mut mesh = MixedMesh::default();
    for k in 0..2 {
        for j in 0..2 {
            for i in 0..3 {
                mesh.points.push([f64::from(i), f64::from(j), f64::from(k)]);
            }
        }
    }
    let at = |i: u32, j: u32, k: u32| i + 3 * j + 6 * k;
    for i in 0..2 {
        mesh.hexahedra.push([
            at(i, 0, 0),
            at(i + 1, 0, 0),
            at(i + 1, 1, 0),
            at(i, 1, 0),
            at(i, 0, 1),
            at(i + 1, 0, 1),
            at(i + 1, 1, 1),
            at(i, 1, 1),
        ]);
    }
    mesh.points.push([2.9, 0.5, 0.0]);
    mesh.points.push([2.9, 0.5, 1.0]);
    mesh.prisms
        .push([at(2, 0, 0), 12, at(2, 1, 0), at(2, 0, 1), 13, at(2, 1, 1)]);
    mesh.points.push([2.3, 0.5, 1.8]);
    mesh.tetrahedra.push([at(2, 0, 1), 13, at(2, 1, 1), 14]);
    for point in &mut mesh.points {
        for coordinate in point {
            *coordinate += 0.1 * (random.next() - 0.5);
        }
    }
    mesh
}

#[test]
fn gradients_of_the_energy_have_second_order_remainders() {
    let mut random = Random(Noise(3));
    let mesh = mixed(&mut random);
    let topology = mesh.topology().unwrap();
    for basis in bases() {
        for name in ["hencky", "symmetric-dirichlet"] {
            let space = Space::new(&mesh, &topology, *basis, &[3, 2, 4, 3]).unwrap();
            let references = references_of_volume(mesh.iter().map(|cell| cell.0), mesh.volume());
            let batches = Batches::new(&space, &references, &|kind| {
                Rule::Gauss.cell(kind.shape, kind.order + 2)
            })
            .unwrap();
            let energy = VolumeEnergy::new(batches, Density::new(energy::find(name).unwrap())).unwrap();
            let mut x = space.linear(&mesh.points);
            for value in &mut x[3 * space.vertices..] {
                *value = 0.02 * (random.next() - 0.5);
            }
            let direction: Vec<f64> = x.iter().map(|_| random.next() - 0.5).collect();
            let mut gradient = vec![0.0; x.len()];
            let start = energy.add_gradient(&x, 1.0, &mut gradient);
            assert_eq!(start, energy.value(&x));
            let slope: f64 = gradient.iter().zip(&direction).map(|(a, b)| a * b).sum();
            let remainder = |t: f64| {
                let moved: Vec<f64> = x.iter().zip(&direction).map(|(x, d)| x + t * d).collect();
                (energy.value(&moved).value - start.value - t * slope).abs()
            };
            let order = (remainder(2e-3) / remainder(1e-3)).log2();
            assert!((1.9..2.1).contains(&order), "{name} {}: {order}", basis.name());
        }
    }
}

#[test]
fn an_affine_image_of_the_references_has_constant_energy_and_rotations_none() {
    // The ideal cell of every shape, turned: no energy. Functions of higher order do not disturb it.
    let turn = nalgebra::Rotation3::from_euler_angles(0.4, -1.1, 2.0);
    let mut random = Random(Noise(11));
    for shape in Shape::ALL {
        for _ in 0..4 {
            let mut names: Vec<u32> = (0..shape.corners() as u32).collect();
            random.shuffle(&mut names);
            let reference = references_of_volume([shape].into_iter(), 2.5)[0];
            let mut mesh = MixedMesh {
                points: vec![[0.0; 3]; shape.corners()],
                ..MixedMesh::default()
            };
            for (corner, canonical) in shape.canonical().iter().enumerate() {
                let point = nalgebra::Vector3::from_fn(|row, _| {
                    (0..3).map(|column| reference[column][row] * canonical[column]).sum()
                });
                mesh.points[names[corner] as usize] = (turn * point).into();
            }
            mesh.push(shape, &names);
            let topology = mesh.topology().unwrap();
            let basis = bases()[random.below(3)];
            let space = Space::new(&mesh, &topology, basis, &[3]).unwrap();
            let batches = Batches::new(&space, &[reference], &|kind| Rule::Gauss.cell(kind.shape, 5)).unwrap();
            let energy = VolumeEnergy::new(batches, Density::new(energy::find("hencky").unwrap())).unwrap();
            let evaluation = energy.value(&space.linear(&mesh.points));
            assert!(evaluation.value.abs() < 1e-28, "{shape:?}: {}", evaluation.value);
            assert!((evaluation.least_determinant - 1.0).abs() < 1e-13);
        }
    }
}
