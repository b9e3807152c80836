//! A block of unit cubes.

use crate::mesh::mixed::MixedMesh;

/// `counts` cubes along the axes, the first at the origin, x fastest.
pub fn grid(counts: [usize; 3]) -> MixedMesh {
    selected(counts, |_| true)
}

/// The cubes of a grid that are wanted, by their index along each axis; vertices without a cube are left out.
pub fn selected(counts: [usize; 3], wanted: impl Fn([usize; 3]) -> bool) -> MixedMesh {
    let side = counts.map(|count| count + 1);
    let mut names = vec![u32::MAX; side.iter().product()];
    let mut mesh = MixedMesh::default();
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                if !wanted([i, j, k]) {
                    continue;
                }
                let mut corner = |di: usize, dj: usize, dk: usize| {
                    let place = [i + di, j + dj, k + dk];
                    let name = &mut names[place[0] + side[0] * (place[1] + side[1] * place[2])];
                    if *name == u32::MAX {
                        *name = mesh.points.len() as u32;
                        mesh.points.push(place.map(|index| index as f64));
                    }
                    *name
                };
                let cell = [
                    corner(0, 0, 0),
                    corner(1, 0, 0),
                    corner(1, 1, 0),
                    corner(0, 1, 0),
                    corner(0, 0, 1),
                    corner(1, 0, 1),
                    corner(1, 1, 1),
                    corner(0, 1, 1),
                ];
                mesh.hexahedra.push(cell);
            }
        }
    }
    mesh
}
