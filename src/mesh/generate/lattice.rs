//! Grids of the unit cube that the generators bend into shape: the body-centred cubic lattice and the Kuhn grid.

use super::super::{TetrahedralMesh, determinant};

/// The boxes of a body-centred grid: how many along each axis.
pub type Counts = [usize; 3];

/// Tetrahedra of [`body_centred`] for these counts.
pub fn tetrahedra(counts: Counts) -> usize {
    12 * counts.iter().product::<usize>()
}

/// Counts (two or more along each axis) whose lattice on a box of the given extents has about `wanted` tetrahedra.
///
/// Among the counts within 3 % of the wanted number those with the most cube-like cells are chosen; failing that those
/// within 6 %; failing that the nearest number. At 1000 tetrahedra and more a cube is within 5 %.
pub fn counts_for(wanted: usize, extents: [f64; 3]) -> Counts {
    let boxes = (wanted as f64 / 12.0).max(8.0);
    let mean = (boxes / extents.iter().product::<f64>()).cbrt();
    let range = |axis: usize| {
        let ideal = extents[axis] * mean;
        let low = ((ideal * 0.7).floor() as usize).max(2);
        low..=((ideal * 1.4).ceil() as usize).max(low)
    };
    let mut best = ([2, 2, 2], (u8::MAX, f64::INFINITY, f64::INFINITY));
    for x in range(0) {
        for y in range(1) {
            // The third count follows from the first two, up to rounding.
            let z = boxes / (x * y) as f64;
            for z in [z.floor(), z.ceil()].map(|z| (z as usize).max(2)) {
                let counts = [x, y, z];
                let error = ((12 * x * y * z) as f64 / wanted as f64 - 1.0).abs();
                let sizes: [f64; 3] = std::array::from_fn(|axis| extents[axis] / counts[axis] as f64);
                let largest = sizes.iter().fold(0.0, |a: f64, &b| a.max(b));
                let smallest = sizes.iter().fold(f64::INFINITY, |a: f64, &b| a.min(b));
                let (class, first, second) = match error {
                    error if error <= 0.03 => (0, largest / smallest, error),
                    error if error <= 0.06 => (1, largest / smallest, error),
                    error => (2, error, largest / smallest),
                };
                if (class, first, second) < best.1 {
                    best = (counts, (class, first, second));
                }
            }
        }
    }
    best.0
}

/// The body-centred cubic lattice of the unit cube: a vertex at every corner and centre of the boxes, four tetrahedra
/// around the segment between the centres of neighbouring boxes, two on every outer square.
///
/// Every tetrahedron has the centre of a box as a vertex, and every edge through the interior ends at one: with two or
/// more boxes along each axis no interior edge joins two boundary vertices and no tetrahedron has all its vertices on
/// the boundary. The diagonals of the outer squares point away from the middle of their side, so that none cuts off a
/// corner of the cube. All tetrahedra have the same volume.
pub fn body_centred(counts: Counts) -> TetrahedralMesh {
    let [nx, ny, nz] = counts;
    let corners = (nx + 1) * (ny + 1) * (nz + 1);
    let corner = |[i, j, k]: [usize; 3]| (i + (nx + 1) * (j + (ny + 1) * k)) as u32;
    let centre = |[i, j, k]: [usize; 3]| (corners + i + nx * (j + ny * k)) as u32;
    let mut mesh = TetrahedralMesh::default();
    for (shift, extra) in [(0.0, 1), (0.5, 0)] {
        for k in 0..nz + extra {
            for j in 0..ny + extra {
                for i in 0..nx + extra {
                    mesh.points.push([
                        (i as f64 + shift) / nx as f64,
                        (j as f64 + shift) / ny as f64,
                        (k as f64 + shift) / nz as f64,
                    ]);
                }
            }
        }
    }
    mesh.cells.reserve_exact(tetrahedra(counts));
    for axis in 0..3 {
        let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut limits = counts;
        limits[axis] += 1;
        for k in 0..limits[2] {
            for j in 0..limits[1] {
                for i in 0..limits[0] {
                    let place = [i, j, k];
                    let ring = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| {
                        let mut at = place;
                        at[first] += a;
                        at[second] += b;
                        corner(at)
                    });
                    let below = (place[axis] > 0).then(|| {
                        let mut at = place;
                        at[axis] -= 1;
                        centre(at)
                    });
                    let above = (place[axis] < counts[axis]).then(|| centre(place));
                    match (below, above) {
                        (Some(below), Some(above)) => {
                            for side in 0..4 {
                                mesh.cells.push([below, above, ring[side], ring[(side + 1) % 4]]);
                            }
                        }
                        (Some(apex), None) | (None, Some(apex)) => {
                            let outward = |along: usize| 2 * place[along] + 1 > counts[along];
                            let halves = if outward(first) == outward(second) {
                                [[0, 1, 2], [0, 2, 3]]
                            } else {
                                [[0, 1, 3], [1, 2, 3]]
                            };
                            for [a, b, c] in halves {
                                mesh.cells.push([apex, ring[a], ring[b], ring[c]]);
                            }
                        }
                        (None, None) => {}
                    }
                }
            }
        }
    }
    orient(&mut mesh);
    mesh
}

/// The Kuhn grid of the unit cube with `divisions` boxes along each axis, six tetrahedra to a box around the diagonal
/// from its lowest to its highest corner.
pub fn kuhn(divisions: usize) -> TetrahedralMesh {
    // Corners are numbered x + 2 y + 4 z.
    const BOX: [[usize; 4]; 6] = [
        [0, 1, 3, 7],
        [0, 1, 7, 5],
        [0, 5, 7, 4],
        [0, 3, 2, 7],
        [0, 2, 6, 7],
        [0, 6, 4, 7],
    ];
    let row = divisions + 1;
    let mut mesh = TetrahedralMesh::default();
    let at = |index: usize| index as f64 / divisions as f64;
    for k in 0..row {
        for j in 0..row {
            for i in 0..row {
                mesh.points.push([at(i), at(j), at(k)]);
            }
        }
    }
    for k in 0..divisions {
        for j in 0..divisions {
            for i in 0..divisions {
                let corners: [u32; 8] = std::array::from_fn(|corner| {
                    ((i + (corner & 1)) + row * ((j + (corner >> 1 & 1)) + row * (k + (corner >> 2)))) as u32
                });
                mesh.cells.extend(BOX.map(|cell| cell.map(|corner| corners[corner])));
            }
        }
    }
    for cell in &mut mesh.cells {
        if determinant(cell.map(|vertex| mesh.points[vertex as usize])) < 0.0 {
            cell.swap(1, 2);
        }
    }
    mesh
}

/// Makes every tetrahedron positive by exchanging its last two vertices.
fn orient(mesh: &mut TetrahedralMesh) {
    for cell in &mut mesh.cells {
        if determinant(cell.map(|vertex| mesh.points[vertex as usize])) < 0.0 {
            cell.swap(2, 3);
        }
    }
}
