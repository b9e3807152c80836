//! Degrees of freedom of a mixed mesh: which function of which cell belongs to which node.
//!
//! Every cell has an order of its own. A shared edge or face takes the least order of its cells (minimum rule), higher
//! functions of the cells are absent on it: so the map is continuous without constraints. Nodes are numbered vertices
//! first (as in the mesh), then edges, faces and cells.

use super::basis::Basis;
use super::functions::{TRIANGLE_EDGES, tetrahedron_inside, triangle_inside};
use crate::mesh::mixed::{MixedMesh, NONE, Shape, Topology};

/// The highest order of a cell.
pub const HIGHEST_ORDER: usize = 16;

/// A local function's node, and whether it enters with opposite sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot(u32);

impl Slot {
    /// A function that is absent.
    pub const ABSENT: Slot = Slot(NONE);

    pub(super) fn of(node: usize, negative: bool) -> Slot {
        Slot::new(node, negative)
    }

    fn new(node: usize, negative: bool) -> Slot {
        Slot((node as u32) << 1 | u32::from(negative))
    }

    /// Node and sign; nothing where the function is absent.
    pub fn node(self) -> Option<(usize, f64)> {
        (self.0 != NONE).then_some(((self.0 >> 1) as usize, if self.0 & 1 == 1 { -1.0 } else { 1.0 }))
    }
}

/// What tells apart cells whose functions differ: tables are shared among equal ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Kind {
    pub shape: Shape,
    pub order: usize,
    /// For a prism, the corner `c` of its bottom and its top triangle's inner functions; else 0.
    pub last: [usize; 2],
}

impl Kind {
    /// Number of local functions.
    pub fn functions(self) -> usize {
        let n = self.order + 1;
        match self.shape {
            Shape::Hexahedron => n * n * n,
            Shape::Prism => n * n * (n + 1) / 2,
            Shape::Tetrahedron => n * (n + 1) * (n + 2) / 6,
        }
    }
}

/// The functions of one cell.
#[derive(Clone, Debug, PartialEq)]
pub struct CellSlots {
    pub kind: Kind,
    /// For each corner of the functions' frame, the local corner of the mesh: ascending vertices for a tetrahedron, the
    /// identity for others.
    pub corners: [u8; 8],
    /// By local function. Hexahedron: `(i, j, k)` at `(i n + j) n + k` over line functions. Prism: triangle functions
    /// fastest, then line functions. Tetrahedron: as tabulated.
    pub slots: Vec<Slot>,
}

/// Degrees of freedom over a mesh.
#[derive(Clone)]
pub struct Space {
    pub basis: &'static dyn Basis,
    /// Order of every cell.
    pub orders: Vec<usize>,
    pub cells: Vec<CellSlots>,
    /// Number of vertices, the first nodes.
    pub vertices: usize,
    /// Number of nodes, each a vector of three.
    pub nodes: usize,
    /// First node of every edge and face, and their orders.
    edge_starts: Vec<usize>,
    edge_orders: Vec<usize>,
    face_starts: Vec<usize>,
    face_orders: Vec<usize>,
    cell_starts: Vec<usize>,
}

/// Corners of a quad in its own frame: the smallest first, then its smaller neighbour, the opposite one, the other
/// neighbour.
pub fn quad_frame(corners: [u32; 4]) -> [u32; 4] {
    let start = (0..4).min_by_key(|&place| corners[place]).unwrap_or(0);
    let at = |step: usize| corners[(start + step) % 4];
    if at(1) < at(3) {
        [at(0), at(1), at(2), at(3)]
    } else {
        [at(0), at(3), at(2), at(1)]
    }
}

/// Number of nodes inside a face.
fn face_nodes(order: usize, corners: usize) -> usize {
    if corners == 4 {
        (order - 1) * (order - 1)
    } else {
        triangle_inside(order).len()
    }
}

impl Space {
    /// The highest of its cells' orders.
    pub fn highest_order(&self) -> usize {
        self.orders.iter().copied().max().unwrap_or(1)
    }

    /// The space over a mesh with an order a cell.
    ///
    /// # Errors
    /// When an order is not within 1 and [`HIGHEST_ORDER`], or there are too many nodes to number.
    pub fn new(
        mesh: &MixedMesh,
        topology: &Topology,
        basis: &'static dyn Basis,
        orders: &[usize],
    ) -> Result<Space, String> {
        assert_eq!(orders.len(), mesh.cells(), "one order a cell");
        if let Some(cell) = orders.iter().position(|order| !(1..=HIGHEST_ORDER).contains(order)) {
            return Err(format!(
                "cell {cell} has order {}; orders are from 1 to {HIGHEST_ORDER}",
                orders[cell]
            ));
        }
        let mut space = Space::without_slots(mesh, topology, basis, orders)?;
        for (cell, (shape, corners)) in mesh.iter().enumerate() {
            let slots = match shape {
                Shape::Hexahedron => space.hexahedron(topology, cell, corners),
                Shape::Prism => space.prism(topology, cell, corners),
                Shape::Tetrahedron => space.tetrahedron(topology, cell, corners),
            };
            space.cells.push(slots);
        }
        Ok(space)
    }

    /// Number of nodes of the space over a mesh with these orders, each within its range, at the cost of the topology.
    ///
    /// # Errors
    /// When there are too many nodes to number.
    pub fn count(
        mesh: &MixedMesh,
        topology: &Topology,
        basis: &'static dyn Basis,
        orders: &[usize],
    ) -> Result<usize, String> {
        Ok(Space::without_slots(mesh, topology, basis, orders)?.nodes)
    }

    /// All nodes numbered, the cells' slots still empty.
    fn without_slots(
        mesh: &MixedMesh,
        topology: &Topology,
        basis: &'static dyn Basis,
        orders: &[usize],
    ) -> Result<Space, String> {
        let mut edge_orders = vec![HIGHEST_ORDER; topology.edges.len()];
        let mut face_orders = vec![HIGHEST_ORDER; topology.faces.len()];
        for (cell, &order) in orders.iter().enumerate() {
            for &edge in &topology.cell_edges[cell] {
                edge_orders[edge as usize] = edge_orders[edge as usize].min(order);
            }
            for &face in &topology.cell_faces[cell] {
                face_orders[face as usize] = face_orders[face as usize].min(order);
            }
        }
        let vertices = mesh.points.len();
        let mut nodes = vertices;
        let mut claim = |count: usize| {
            nodes += count;
            nodes - count
        };
        let edge_starts: Vec<usize> = edge_orders.iter().map(|order| claim(order - 1)).collect();
        let face_starts: Vec<usize> = topology
            .faces
            .iter()
            .zip(&face_orders)
            .map(|(face, &order)| claim(face_nodes(order, face.corners().len())))
            .collect();
        let cell_starts: Vec<usize> = mesh
            .iter()
            .zip(orders)
            .map(|((shape, _), &order)| {
                claim(match shape {
                    Shape::Hexahedron => (order - 1).pow(3),
                    Shape::Prism => triangle_inside(order).len() * (order - 1),
                    Shape::Tetrahedron => tetrahedron_inside(order).len(),
                })
            })
            .collect();
        if nodes > (u32::MAX / 2 - 1) as usize {
            return Err(format!(
                "{nodes} nodes are too many; lower the order or use fewer cells"
            ));
        }
        Ok(Space {
            basis,
            orders: orders.to_vec(),
            cells: Vec::with_capacity(orders.len()),
            vertices,
            nodes,
            edge_starts,
            edge_orders,
            face_starts,
            face_orders,
            cell_starts,
        })
    }

    /// Node numbers of an edge, and its order.
    pub fn edge(&self, edge: usize) -> (usize, usize) {
        (self.edge_starts[edge], self.edge_orders[edge])
    }

    /// Node numbers inside a face, and its order.
    pub fn face(&self, face: usize) -> (usize, usize) {
        (self.face_starts[face], self.face_orders[face])
    }

    /// The nodes that belong to a cell's inside.
    pub fn inside(&self, cell: usize) -> usize {
        self.cell_starts[cell]
    }

    fn hexahedron(&self, topology: &Topology, cell: usize, corners: &[u32]) -> CellSlots {
        let order = self.orders[cell];
        let n = order + 1;
        let shape = Shape::Hexahedron;
        let canonical = shape.canonical();
        let place = |index: [usize; 3]| (index[0] * n + index[1]) * n + index[2];
        let ends = |corner: usize| canonical[corner].map(|coordinate| coordinate as usize);
        // The axis along which two corners differ, and whether it runs backwards from the first to the second.
        let axis = |a: usize, b: usize| {
            let (from, to) = (ends(a), ends(b));
            let axis = (0..3).find(|&axis| from[axis] != to[axis]).unwrap_or(0);
            (axis, to[axis] == 0)
        };
        let mut slots = vec![Slot::ABSENT; n * n * n];
        for (corner, &vertex) in corners.iter().enumerate() {
            slots[place(ends(corner))] = Slot::new(vertex as usize, false);
        }
        for (edge, &[a, b]) in shape.edges().iter().enumerate() {
            let (a, b) = if corners[a] < corners[b] { (a, b) } else { (b, a) };
            let (start, edge_order) = self.edge(topology.cell_edges[cell][edge] as usize);
            let (axis, back) = axis(a, b);
            for j in 1..edge_order {
                let mut index = ends(a);
                index[axis] = 1 + j;
                slots[place(index)] = Slot::new(start + j - 1, back && j % 2 == 0);
            }
        }
        for (face, local) in shape.faces().iter().enumerate() {
            let (start, face_order) = self.face(topology.cell_faces[cell][face] as usize);
            let [a, b, d] = local_frame(corners, local);
            let ((first, first_back), (second, second_back)) = (axis(a, b), axis(a, d));
            for j in 1..face_order {
                for k in 1..face_order {
                    let mut index = ends(a);
                    index[first] = 1 + j;
                    index[second] = 1 + k;
                    let negative = (first_back && j % 2 == 0) ^ (second_back && k % 2 == 0);
                    slots[place(index)] = Slot::new(start + (j - 1) * (face_order - 1) + k - 1, negative);
                }
            }
        }
        let mut node = self.inside(cell);
        for i in 2..n {
            for j in 2..n {
                for k in 2..n {
                    slots[place([i, j, k])] = Slot::new(node, false);
                    node += 1;
                }
            }
        }
        CellSlots {
            kind: Kind {
                shape,
                order,
                last: [0; 2],
            },
            corners: [0, 1, 2, 3, 4, 5, 6, 7],
            slots,
        }
    }

    fn prism(&self, topology: &Topology, cell: usize, corners: &[u32]) -> CellSlots {
        let order = self.orders[cell];
        let shape = Shape::Prism;
        let inside = triangle_inside(order);
        let per_level = 3 + 3 * (order - 1) + inside.len();
        let place = |triangle: usize, line: usize| line * per_level + triangle;
        // The function of a triangle's edge from corner a to b (modulo 3), and whether it runs backwards.
        let edge_function = |a: usize, b: usize, j: usize| {
            let (a, b) = (a % 3, b % 3);
            let edge = TRIANGLE_EDGES
                .iter()
                .position(|&edge| edge == [a, b] || edge == [b, a])
                .unwrap_or(0);
            (3 + edge * (order - 1) + j - 1, TRIANGLE_EDGES[edge] != [a, b])
        };
        let mut slots = vec![Slot::ABSENT; per_level * (order + 1)];
        for (corner, &vertex) in corners.iter().enumerate() {
            slots[place(corner % 3, corner / 3)] = Slot::new(vertex as usize, false);
        }
        for (edge, &[a, b]) in shape.edges().iter().enumerate() {
            let (a, b) = if corners[a] < corners[b] { (a, b) } else { (b, a) };
            let (start, edge_order) = self.edge(topology.cell_edges[cell][edge] as usize);
            for j in 1..edge_order {
                let slot = if a / 3 == b / 3 {
                    let (function, back) = edge_function(a, b, j);
                    (place(function, a / 3), back)
                } else {
                    (place(a % 3, 1 + j), a > b)
                };
                slots[slot.0] = Slot::new(start + j - 1, slot.1 && j % 2 == 0);
            }
        }
        let mut last = [0; 2];
        for level in 0..2 {
            let (start, face_order) = self.face(topology.cell_faces[cell][level] as usize);
            let mut sorted = [0, 1, 2];
            sorted.sort_unstable_by_key(|&corner| corners[3 * level + corner]);
            last[level] = sorted[2];
            for (number, jk) in triangle_inside(face_order).into_iter().enumerate() {
                let Some(function) = inside.iter().position(|own| *own == jk) else {
                    continue;
                };
                let slot = place(3 + 3 * (order - 1) + function, level);
                slots[slot] = Slot::new(start + number, sorted[0] > sorted[1] && jk[0] % 2 == 0);
            }
        }
        for (face, local) in shape.faces().iter().enumerate().skip(2) {
            let (start, face_order) = self.face(topology.cell_faces[cell][face] as usize);
            let [a, b, d] = local_frame(corners, local);
            for j in 1..face_order {
                for k in 1..face_order {
                    let number = start + (j - 1) * (face_order - 1) + k - 1;
                    // One of the two directions is vertical.
                    let ((low, high, vertical), (from, to, level)) = if a / 3 != b / 3 {
                        ((a, b, j), (a, d, k))
                    } else {
                        ((a, d, k), (a, b, j))
                    };
                    let (function, back) = edge_function(from, to, level);
                    let negative = (low > high && vertical % 2 == 0) ^ (back && level % 2 == 0);
                    slots[place(function, 1 + vertical)] = Slot::new(number, negative);
                }
            }
        }
        let mut node = self.inside(cell);
        for function in 0..inside.len() {
            for line in 2..=order {
                slots[place(3 + 3 * (order - 1) + function, line)] = Slot::new(node, false);
                node += 1;
            }
        }
        CellSlots {
            kind: Kind { shape, order, last },
            corners: [0, 1, 2, 3, 4, 5, 6, 7],
            slots,
        }
    }

    fn tetrahedron(&self, topology: &Topology, cell: usize, corners: &[u32]) -> CellSlots {
        let order = self.orders[cell];
        let shape = Shape::Tetrahedron;
        let mut sorted = [0_usize, 1, 2, 3];
        sorted.sort_unstable_by_key(|&corner| corners[corner]);
        let mut slots: Vec<Slot> = sorted
            .iter()
            .map(|&corner| Slot::new(corners[corner] as usize, false))
            .collect();
        let position = |given: &[usize], wanted: &[usize]| given.iter().all(|corner| wanted.contains(corner));
        for [a, b] in [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]] {
            let wanted = [sorted[a], sorted[b]];
            let edge = shape
                .edges()
                .iter()
                .position(|edge| position(edge, &wanted))
                .unwrap_or(0);
            let (start, edge_order) = self.edge(topology.cell_edges[cell][edge] as usize);
            for j in 1..order {
                slots.push(if j < edge_order {
                    Slot::new(start + j - 1, false)
                } else {
                    Slot::ABSENT
                });
            }
        }
        let inside = triangle_inside(order);
        for [a, b, c] in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] {
            let wanted = [sorted[a], sorted[b], sorted[c]];
            let face = shape
                .faces()
                .iter()
                .position(|face| position(face, &wanted))
                .unwrap_or(0);
            let (start, face_order) = self.face(topology.cell_faces[cell][face] as usize);
            let present = triangle_inside(face_order);
            for jk in &inside {
                slots.push(match present.iter().position(|own| own == jk) {
                    Some(number) => Slot::new(start + number, false),
                    None => Slot::ABSENT,
                });
            }
        }
        let first = self.inside(cell);
        slots.extend((0..tetrahedron_inside(order).len()).map(|number| Slot::new(first + number, false)));
        let mut frame = [0, 1, 2, 3, 4, 5, 6, 7];
        for (place, &corner) in frame.iter_mut().zip(&sorted) {
            *place = corner as u8;
        }
        CellSlots {
            kind: Kind {
                shape,
                order,
                last: [0; 2],
            },
            corners: frame,
            slots,
        }
    }

    /// Node positions of the linear map onto the mesh's own points: vertices there, all other nodes zero.
    pub fn linear(&self, points: &[[f64; 3]]) -> Vec<f64> {
        let mut x = points.as_flattened().to_vec();
        x.resize(3 * self.nodes, 0.0);
        x
    }

    /// For every node, the node of another space over the same mesh with the same function, if it has one.
    pub fn counterparts(&self, other: &Space) -> Vec<Option<u32>> {
        let mut result = vec![None; self.nodes];
        for (from, to) in self.cells.iter().zip(&other.cells) {
            for (slot, local) in common_functions(from.kind.shape, from.kind.order, to.kind.order) {
                if let (Some((source, _)), Some((target, _))) = (from.slots[slot].node(), to.slots[local].node()) {
                    result[source] = Some(target as u32);
                }
            }
        }
        result
    }

    /// The same map in a space over the same mesh with other orders: functions that both have keep their nodes, others
    /// are dropped or start from zero. Exact when no order falls.
    pub fn transfer(&self, x: &[f64], onto: &Space) -> Vec<f64> {
        let mut result = vec![0.0; 3 * onto.nodes];
        for (from, to) in self.cells.iter().zip(&onto.cells) {
            let (low, high) = (from.kind.order, to.kind.order);
            for (slot, local) in common_functions(from.kind.shape, low, high) {
                let (Some((source, a)), Some((target, b))) = (from.slots[slot].node(), to.slots[local].node()) else {
                    continue;
                };
                for axis in 0..3 {
                    result[3 * target + axis] = a * b * x[3 * source + axis];
                }
            }
        }
        result
    }
}

/// Pairs of local functions that cells of two orders share.
fn common_functions(shape: Shape, from: usize, to: usize) -> Vec<(usize, usize)> {
    let least = from.min(to);
    let triangle = |order: usize, function: [usize; 3]| -> usize {
        // A function of the triangle, named by kind (0 corner, 1 edge, 2 inside) and its numbers.
        match function {
            [0, corner, _] => corner,
            [1, edge, j] => 3 + edge * (order - 1) + j - 1,
            [_, j, k] => {
                let place = triangle_inside(order).iter().position(|own| *own == [j, k]);
                3 + 3 * (order - 1) + place.unwrap_or(0)
            }
        }
    };
    let mut pairs = Vec::new();
    match shape {
        Shape::Hexahedron => {
            for i in 0..=least {
                for j in 0..=least {
                    for k in 0..=least {
                        let place = |n: usize| (i * n + j) * n + k;
                        pairs.push((place(from + 1), place(to + 1)));
                    }
                }
            }
        }
        Shape::Prism => {
            let mut names: Vec<[usize; 3]> = (0..3).map(|corner| [0, corner, 0]).collect();
            names.extend((0..3).flat_map(|edge| (1..least).map(move |j| [1, edge, j])));
            names.extend(triangle_inside(least).into_iter().map(|[j, k]| [2, j, k]));
            for name in names {
                let (a, b) = (triangle(from, name), triangle(to, name));
                let levels = |order: usize| (order + 1) * (order + 2) / 2;
                for line in 0..=least {
                    pairs.push((line * levels(from) + a, line * levels(to) + b));
                }
            }
        }
        Shape::Tetrahedron => {
            let edge = |order: usize, edge: usize, j: usize| 4 + edge * (order - 1) + j - 1;
            let face = |order: usize, face: usize, jk: [usize; 2]| {
                let inside = triangle_inside(order);
                let place = inside.iter().position(|own| *own == jk).unwrap_or(0);
                4 + 6 * (order - 1) + face * inside.len() + place
            };
            let cell = |order: usize, ijk: [usize; 3]| {
                let place = tetrahedron_inside(order).iter().position(|own| *own == ijk);
                4 + 6 * (order - 1) + 4 * triangle_inside(order).len() + place.unwrap_or(0)
            };
            pairs.extend((0..4).map(|corner| (corner, corner)));
            for number in 0..6 {
                pairs.extend((1..least).map(|j| (edge(from, number, j), edge(to, number, j))));
            }
            for number in 0..4 {
                let inside = triangle_inside(least);
                pairs.extend(
                    inside
                        .into_iter()
                        .map(|jk| (face(from, number, jk), face(to, number, jk))),
                );
            }
            pairs.extend(
                tetrahedron_inside(least)
                    .into_iter()
                    .map(|ijk| (cell(from, ijk), cell(to, ijk))),
            );
        }
    }
    pairs
}

/// Origin, first and second neighbour of a quad's own frame as local corners of a cell.
fn local_frame(corners: &[u32], local: &[usize]) -> [usize; 3] {
    let cycle = std::array::from_fn(|place| corners[local[place]]);
    let frame = quad_frame(cycle);
    let find = |vertex: u32| {
        let place = cycle.iter().position(|&own| own == vertex).unwrap_or(0);
        local[place]
    };
    [find(frame[0]), find(frame[1]), find(frame[3])]
}
