//! Connectivity against brute force on small meshes, known topologies, and splitting.

use std::collections::{BTreeMap, BTreeSet};
use vargeo::mesh::connectivity::*;
use vargeo::mesh::generate::lattice::{body_centred, kuhn};
use vargeo::mesh::split::{boundary_cells, boundary_chords, boundary_faces, separate_boundary, split};
use vargeo::mesh::{TetrahedralMesh, TriangleMesh, determinant};

/// The facets of every cell by their sorted vertices.
fn by_facet<const N: usize>(cells: &[[u32; N]]) -> BTreeMap<Vec<u32>, Vec<(u32, usize)>> {
    let mut found: BTreeMap<Vec<u32>, Vec<(u32, usize)>> = BTreeMap::new();
    for (index, cell) in cells.iter().enumerate() {
        for local in 0..N {
            let mut key: Vec<u32> = (0..N).filter(|&i| i != local).map(|i| cell[i]).collect();
            key.sort();
            found.entry(key).or_default().push((index as u32, local));
        }
    }
    found
}

fn agrees_with_brute_force<const N: usize>(cells: &[[u32; N]], vertices: usize) {
    let found = facets(cells, vertices);
    let expected = by_facet(cells);
    for sharers in expected.values() {
        for &(cell, local) in sharers {
            let other = match sharers.as_slice() {
                [_] => NONE,
                [a, b] => {
                    if a.0 == cell {
                        b.0
                    } else {
                        a.0
                    }
                }
                _ => CROWDED,
            };
            assert_eq!(found.neighbours[cell as usize][local], other);
        }
    }
    assert_eq!(
        found.crowded,
        expected.values().filter(|sharers| sharers.len() > 2).count()
    );

    let pairs: BTreeSet<[u32; 2]> = cells
        .iter()
        .flat_map(|cell| {
            cell.iter()
                .flat_map(|&a| cell.iter().filter(move |&&b| a < b).map(move |&b| [a, b]))
        })
        .collect();
    let edges = edges(cells, vertices);
    assert!(edges.iter().eq(pairs.iter()));
    let neighbours = vertex_neighbours(&edges, vertices);
    let around = incidence(cells, vertices);
    for vertex in 0..vertices as u32 {
        let expected: BTreeSet<u32> = pairs
            .iter()
            .filter(|pair| pair.contains(&vertex))
            .map(|pair| pair[0] + pair[1] - vertex)
            .collect();
        assert!(neighbours.row(vertex as usize).iter().eq(expected.iter()));
        let cells = (0..cells.len() as u32).filter(|&cell| cells[cell as usize].contains(&vertex));
        assert!(around.row(vertex as usize).iter().copied().eq(cells));
    }
}

/// A torus of `m` by `n` quadrangles, two triangles each.
pub(crate) fn torus(m: u32, n: u32) -> Vec<[u32; 3]> {
    let at = |i: u32, j: u32| (i % m) * n + j % n;
    (0..m)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

#[test]
fn tables_agree_with_brute_force() {
    let mesh = kuhn(3);
    agrees_with_brute_force(&mesh.cells, mesh.points.len());
    let mesh = body_centred([2, 3, 2]);
    agrees_with_brute_force(&mesh.cells, mesh.points.len());
    // With a vertex of no cell, holes, and a face of three tetrahedra.
    let mut cells: Vec<[u32; 4]> = mesh.cells.iter().step_by(3).copied().collect();
    let [a, b, c, _] = cells[0];
    cells.extend([
        [a, b, c, mesh.points.len() as u32],
        [b, a, c, mesh.points.len() as u32 + 1],
    ]);
    agrees_with_brute_force(&cells, mesh.points.len() + 3);
    agrees_with_brute_force(&torus(4, 5), 20);
}

#[test]
fn boundaries_are_closed_and_face_outward() {
    for mesh in [kuhn(3), body_centred([3, 2, 4])] {
        let found = boundary(&mesh.cells, mesh.points.len());
        let surface = TriangleMesh {
            points: mesh.points.clone(),
            cells: found.triangles.clone(),
        };
        assert!((surface.enclosed_volume() - 1.0).abs() < 1e-12);
        assert!((surface.area() - 6.0).abs() < 1e-12);
        let outer = |p: &[f64; 3]| p.iter().any(|&c| c == 0.0 || c == 1.0);
        assert!(mesh.points.iter().map(outer).eq(found.mask.iter().copied()));
        for (triangle, &cell) in found.triangles.iter().zip(&found.cells) {
            assert!(triangle.iter().all(|vertex| mesh.cells[cell as usize].contains(vertex)));
        }
    }
}

#[test]
fn topologies_are_recognised() {
    let genus = |triangles: &[[u32; 3]], vertices: usize| {
        surface_topology(triangles, vertices)
            .components
            .iter()
            .map(|part| (part.genus, part.loops))
            .collect::<Vec<_>>()
    };
    assert_eq!(genus(&torus(5, 7), 35), [(Some(1), 0)]);
    // Without two triangles that share no vertex: a torus with two holes. Without its first row: an annulus.
    let mut holed = torus(5, 7);
    holed.remove(40);
    holed.remove(0);
    assert_eq!(genus(&holed, 35), [(Some(1), 2)]);
    assert_eq!(genus(&torus(5, 7)[14..], 35), [(Some(0), 2)]);
    // Two tetrahedra's surfaces that touch in a vertex; then apart.
    let shell = |v: [u32; 4]| TETRAHEDRON_FACETS.map(|facet| facet.map(|corner| v[corner]));
    let touching = surface_topology(&[shell([0, 1, 2, 3]), shell([0, 4, 5, 6])].concat(), 7);
    assert_eq!((touching.components.len(), touching.pinched), (1, vec![0]));
    assert_eq!(touching.components[0].genus, None);
    assert_eq!(
        genus(&[shell([0, 1, 2, 3]), shell([7, 4, 5, 6])].concat(), 8),
        [(Some(0), 0), (Some(0), 0)]
    );
    // A Moebius band of five triangles is a manifold without orientation.
    let band: Vec<[u32; 3]> = (0..5).map(|i| [i, (i + 1) % 5, (i + 2) % 5]).collect();
    let band = surface_topology(&band, 5);
    assert_eq!(
        (
            band.components[0].genus,
            band.components[0].loops,
            band.components[0].euler()
        ),
        (None, 1, 0)
    );
    assert!(!band.disoriented.is_empty());
}

#[test]
fn splitting_keeps_volume_boundary_and_conformity() {
    let mesh = kuhn(3);
    let surface = boundary(&mesh.cells, mesh.points.len());
    let chords = boundary_chords(&mesh, &surface);
    assert!(!chords.is_empty() && !boundary_cells(&mesh, &surface).is_empty());
    let refined = separate_boundary(&mesh);
    let fine = &refined.mesh;
    let after = boundary(&fine.cells, fine.points.len());
    assert_eq!(boundary_chords(fine, &after), [] as [[u32; 2]; 0]);
    assert_eq!(boundary_faces(fine, &after), [] as [[u32; 3]; 0]);
    assert_eq!(boundary_cells(fine, &after), [] as [u32; 0]);
    assert_eq!(after.vertices, surface.vertices);
    let sorted = |triangles: &[[u32; 3]]| {
        let mut all: Vec<[u32; 3]> = triangles.to_vec();
        all.iter_mut().for_each(|triangle| triangle.sort());
        all.sort();
        all
    };
    assert_eq!(sorted(&after.triangles), sorted(&surface.triangles));
    assert!(fine.volumes().iter().all(|&volume| volume > 0.0));
    assert!((fine.volume() - 1.0).abs() < 1e-12);
    // The pieces of every tetrahedron fill it.
    let mut pieces = vec![0.0; mesh.cells.len()];
    for (volume, &origin) in fine.volumes().iter().zip(&refined.origin) {
        pieces[origin as usize] += volume;
    }
    assert!(
        pieces
            .iter()
            .zip(mesh.volumes())
            .all(|(sum, whole)| (sum - whole).abs() < 1e-14)
    );
    // Carried data follow the points.
    let mut carried: Vec<[f64; 3]> = mesh.points.iter().map(|p| p.map(|c| 2.0 * c + 1.0)).collect();
    refined.carry(&mut carried);
    let error = carried
        .iter()
        .flatten()
        .zip(fine.points.iter().flatten())
        .map(|(a, b)| (a - 2.0 * b - 1.0).abs());
    assert!(error.fold(0.0, f64::max) < 1e-14);
}

#[test]
fn each_kind_of_simplex_splits_as_it_should() {
    let points = vec![
        [0.0; 3],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
    ];
    let mesh = TetrahedralMesh {
        points,
        cells: vec![[0, 1, 2, 3], [1, 4, 2, 3]],
    };
    assert!(mesh.volumes().iter().all(|&volume| volume > 0.0));
    let face = split(&mesh, &[[3, 1, 2]]);
    assert_eq!(
        (face.mesh.cells.len(), face.parents.clone()),
        (6, vec![[3, 1, 2, NONE]])
    );
    let third = 1.0 / 3.0;
    assert_eq!(face.mesh.points[5], [third; 3]);
    // The common edge given twice, and one that is not there.
    let edge = split(&mesh, &[[2, 1], [0, 4], [1, 2]]);
    assert_eq!((edge.mesh.cells.len(), edge.mesh.points.len()), (4, 6));
    let cell = split(&mesh, &[[0, 1, 2, 3]]);
    assert_eq!((cell.mesh.cells.len(), cell.origin.clone()), (5, vec![0, 0, 0, 0, 1]));
    for refined in [face, edge, cell] {
        let volumes = refined
            .mesh
            .cells
            .iter()
            .map(|&cell| determinant(refined.mesh.corners(cell)));
        assert!(volumes.clone().all(|volume| volume > 0.0));
        assert!((volumes.sum::<f64>() - 3.0).abs() < 1e-14);
        assert_eq!(facets(&refined.mesh.cells, refined.mesh.points.len()).crowded, 0);
    }
}
