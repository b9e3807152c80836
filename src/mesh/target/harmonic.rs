//! Discrete harmonic maps of patches into convex polygons.
//!
//! With positive weights and a convex outline no triangle turns over, and none is flat unless an edge joins two vertices
//! of one side of the outline (Tutte, "How to draw a graph", 1963; Floater, "Parametrization and smooth approximation of
//! surface triangulations", 1997).

use crate::mesh::{area_vector, dot, length, subtract};

/// Places the interior vertices of a patch (those not `fixed`) inside its convex outline by a discrete harmonic map.
pub(super) fn embed(
    patch: &[[u32; 3]],
    points: &[[f64; 3]],
    fixed: &[bool],
    outline: &[[f64; 3]],
    positions: &mut [[f64; 3]],
) -> Result<(), String> {
    // Affine coordinates (s, t) of the side: exact on its plane for sides along the axes.
    let origin = outline[0];
    let (u, v) = (
        subtract(outline[1], origin),
        subtract(outline[outline.len() - 1], origin),
    );
    let (uu, uv, vv) = (dot(u, u), dot(u, v), dot(v, v));
    let flat = |point: [f64; 3]| {
        let offset = subtract(point, origin);
        let (ou, ov) = (dot(offset, u), dot(offset, v));
        let scale = uu * vv - uv * uv;
        [(vv * ou - uv * ov) / scale, (uu * ov - uv * ou) / scale]
    };
    let mut free: Vec<u32> = patch
        .iter()
        .flatten()
        .copied()
        .filter(|&vertex| !fixed[vertex as usize])
        .collect();
    free.sort_unstable();
    free.dedup();
    let place = |vertex: u32| free.binary_search(&vertex);
    // Cotangent weights, as of the discrete Laplacian, and kept positive, which Tutte's theorem asks for. The floor is
    // the cotangent of 89 degrees: larger ones draw long triangles together, smaller ones let patches collapse.
    let mut weights: Vec<([u32; 2], f64)> = Vec::with_capacity(3 * patch.len());
    for triangle in patch {
        let corners = triangle.map(|vertex| points[vertex as usize]);
        let area = length(area_vector(corners));
        for at in 0..3 {
            let (a, b) = ((at + 1) % 3, (at + 2) % 3);
            let cotangent = dot(subtract(corners[a], corners[at]), subtract(corners[b], corners[at])) / area;
            let pair = [triangle[a].min(triangle[b]), triangle[a].max(triangle[b])];
            weights.push((pair, if cotangent.is_finite() { cotangent } else { 0.0 }));
        }
    }
    weights.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); free.len()];
    let mut diagonal = vec![0.0; free.len()];
    let mut right = vec![[0.0; 2]; free.len()];
    for same in weights.chunk_by(|a, b| a.0 == b.0) {
        let [a, b] = same[0].0;
        let weight = same.iter().map(|(_, weight)| weight).sum::<f64>().clamp(0.0175, 100.0);
        for (a, b) in [(a, b), (b, a)] {
            let Ok(row) = place(a) else { continue };
            diagonal[row] += weight;
            match place(b) {
                Ok(column) => rows[row].push((column, weight)),
                Err(_) => {
                    let [s, t] = flat(positions[b as usize]);
                    right[row][0] += weight * s;
                    right[row][1] += weight * t;
                }
            }
        }
    }
    let coordinates = solve(&rows, &diagonal, &right)?;
    for (&vertex, [s, t]) in free.iter().zip(coordinates) {
        positions[vertex as usize] = std::array::from_fn(|axis| origin[axis] + s * u[axis] + t * v[axis]);
    }
    Ok(())
}

/// Solves `diagonal x - rows x = right` for two right-hand sides by conjugate gradients with the diagonal as
/// preconditioner. The matrix is symmetric positive definite: an irreducible Laplacian with boundary values.
fn solve(rows: &[Vec<(usize, f64)>], diagonal: &[f64], right: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, String> {
    let count = rows.len();
    let mut solution = vec![[0.5f64; 2]; count];
    for side in 0..2 {
        let apply = |x: &[f64], y: &mut [f64]| {
            for (row, entries) in rows.iter().enumerate() {
                y[row] =
                    diagonal[row] * x[row] - entries.iter().map(|&(column, weight)| weight * x[column]).sum::<f64>();
            }
        };
        let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut x: Vec<f64> = solution.iter().map(|value| value[side]).collect();
        let mut product = vec![0.0; count];
        apply(&x, &mut product);
        let mut residual: Vec<f64> = (0..count).map(|row| right[row][side] - product[row]).collect();
        let scaled = |residual: &[f64]| residual.iter().zip(diagonal).map(|(r, d)| r / d).collect::<Vec<f64>>();
        let mut preconditioned = scaled(&residual);
        let mut direction = preconditioned.clone();
        let mut square = inner(&residual, &preconditioned);
        let goal = 1e-30 * diagonal.iter().sum::<f64>();
        let mut step = 0;
        while square > goal {
            if step > 20 * count + 1000 {
                return Err("the linear system of a side did not converge".to_string());
            }
            step += 1;
            apply(&direction, &mut product);
            let length = square / inner(&direction, &product);
            for row in 0..count {
                x[row] += length * direction[row];
                residual[row] -= length * product[row];
            }
            preconditioned = scaled(&residual);
            let next = inner(&residual, &preconditioned);
            for row in 0..count {
                direction[row] = preconditioned[row] + next / square * direction[row];
            }
            square = next;
        }
        for (value, x) in solution.iter_mut().zip(x) {
            value[side] = x;
        }
    }
    Ok(solution)
}
