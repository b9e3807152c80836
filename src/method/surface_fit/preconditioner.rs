//! A positive definite model of the Hessian of the fit's energy, factorized: what L-BFGS starts its own model from.
//!
//! With the cells held still both terms are quadratic in the fitted points: a piece of area `a` pulls a point with
//! `a (I + (s^2 - 1) n n^T)`. These blocks `B`, one a fitted point, and the regularizers give
//! `2 M^T (B + lambda L^2 + mu L P L) M` over the control points, with the projections `P` along the fit. Normal and
//! tangential stiffness differ by `s^2`, 2500 by default, which no step of plain L-BFGS copes with. The blocks follow
//! the fit: they are made anew every few evaluations.

use super::objective::Tangent;
use crate::linalg::sparse::{BlockCholesky, BlockPattern};
use crate::mesh::linear_map::LinearMap;

/// Most couplings that are added up.
const MOST: usize = 100_000_000;

/// A symmetric 3x3 block: xx, xy, xz, yy, yz, zz.
pub type Block = [f64; 6];

/// See the module.
pub struct Preconditioner {
    cholesky: BlockCholesky<3>,
    /// Control points that are coupled, smaller first.
    pairs: Vec<[u32; 2]>,
    /// For every fitted point and every two of its control points `a <= b` the place of their block: the control points'
    /// own first, then those of `pairs`.
    places: Vec<u32>,
    /// Entries of `M^T L^2 M` at these places.
    laplacian: Vec<f64>,
    /// `L M`, and for every two entries of a row the place of their block.
    bent: LinearMap,
    bent_places: Vec<u32>,
    sums: Vec<Block>,
    parts: Vec<f64>,
    values: Vec<f64>,
}

impl Preconditioner {
    /// The structure over control points, which are near `control`; `edges` and `degrees` are those of the fitted mesh.
    ///
    /// # Errors
    /// When the structure cannot be made.
    pub fn new(
        map: &LinearMap,
        edges: &[[u32; 2]],
        degrees: &[f64],
        control: &[[f64; 3]],
    ) -> Result<Preconditioner, String> {
        let count = map.columns();
        // L M, row by row.
        let mut rows: Vec<Vec<(u32, f64)>> = (0..map.rows())
            .map(|row| map.row(row).iter().map(|&(c, w)| (c, degrees[row] * w)).collect())
            .collect();
        for &[a, b] in edges {
            rows[a as usize].extend(map.row(b as usize).iter().map(|&(c, w)| (c, -w)));
            rows[b as usize].extend(map.row(a as usize).iter().map(|&(c, w)| (c, -w)));
        }
        let bent = LinearMap::from_rows(count, rows.into_iter());
        // A vertex with many neighbours couples them all.
        let pairs: usize = (0..map.rows())
            .map(|row| bent.row(row).len().pow(2) / 2 + map.row(row).len().pow(2) / 2)
            .sum();
        if pairs > MOST {
            return Err(format!(
                "{pairs} couplings of control points are more than the {MOST} it may have"
            ));
        }
        let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); count];
        let mut couple = |row: &[(u32, f64)]| {
            for (index, &(a, _)) in row.iter().enumerate() {
                neighbours[a as usize].extend(row[index + 1..].iter().map(|&(b, _)| b));
            }
        };
        for row in 0..map.rows() {
            couple(bent.row(row));
            couple(map.row(row));
        }
        // A control point that nothing is coupled to is tied to another by an empty block.
        let mut coupled = vec![false; count];
        for (a, list) in neighbours.iter_mut().enumerate() {
            list.sort_unstable();
            list.dedup();
            for &b in &*list {
                coupled[a] = true;
                coupled[b as usize] = true;
            }
        }
        if count < 2 {
            return Err("fewer than two control points".to_string());
        }
        for a in 0..count {
            if !coupled[a] {
                let b = if a == 0 { 1 } else { 0 };
                let list = &mut neighbours[a.min(b)];
                list.push(a.max(b) as u32);
                list.sort_unstable();
            }
        }
        let mut starts = vec![0; count + 1];
        let mut pairs = Vec::new();
        for (a, list) in neighbours.iter().enumerate() {
            pairs.extend(list.iter().map(|&b| [a as u32, b]));
            starts[a + 1] = pairs.len();
        }
        let place = |a: u32, b: u32| -> usize {
            if a == b {
                return a as usize;
            }
            // All pairs of a row were coupled above.
            let found = neighbours[a as usize].binary_search(&b).unwrap_or(0);
            count + starts[a as usize] + found
        };
        let mut laplacian = vec![0.0; count + pairs.len()];
        let mut places = Vec::new();
        let mut bent_places = Vec::new();
        for row in 0..map.rows() {
            for (index, &(a, w)) in bent.row(row).iter().enumerate() {
                for &(b, v) in &bent.row(row)[index..] {
                    laplacian[place(a, b)] += w * v;
                    bent_places.push(place(a, b) as u32);
                }
            }
            for (index, &(a, _)) in map.row(row).iter().enumerate() {
                places.extend(map.row(row)[index..].iter().map(|&(b, _)| place(a, b) as u32));
            }
        }
        let pattern = BlockPattern::<3>::new(control, &pairs, &vec![true; count]).map_err(|error| error.to_string())?;
        Ok(Preconditioner {
            values: vec![0.0; pattern.values_len()],
            parts: vec![0.0; pattern.parts_len()],
            sums: vec![[0.0; 6]; laplacian.len()],
            cholesky: BlockCholesky::new(pattern),
            pairs,
            places,
            laplacian,
            bent,
            bent_places,
        })
    }

    /// Factorizes the model with a block for every fitted point, and the factors `lambda` and `mu` of the regularizer
    /// and of its part along the fit.
    ///
    /// # Errors
    /// When it cannot be factorized.
    pub fn refresh(
        &mut self,
        map: &LinearMap,
        blocks: &[Block],
        lambda: f64,
        mu: f64,
        tangents: &[Tangent],
    ) -> Result<(), String> {
        for (sum, entry) in self.sums.iter_mut().zip(&self.laplacian) {
            let entry = lambda * entry;
            *sum = [entry, 0.0, 0.0, entry, 0.0, entry];
        }
        let sums = &mut self.sums;
        let mut add = |row: &[(u32, f64)], places: &mut std::slice::Iter<'_, u32>, block: &Block| {
            for (index, &(_, w)) in row.iter().enumerate() {
                for (&(_, v), &place) in row[index..].iter().zip(&mut *places) {
                    for (sum, entry) in sums[place as usize].iter_mut().zip(block) {
                        *sum += w * v * entry;
                    }
                }
            }
        };
        let mut places = self.places.iter();
        for (row, block) in blocks.iter().enumerate() {
            add(map.row(row), &mut places, block);
        }
        if mu > 0.0 {
            let mut places = self.bent_places.iter();
            for (row, tangent) in tangents.iter().enumerate() {
                let block = tangent.map_or([0.0; 6], |[x, y, z]| {
                    [1.0 - x * x, -x * y, -x * z, 1.0 - y * y, -y * z, 1.0 - z * z].map(|entry| mu * entry)
                });
                add(self.bent.row(row), &mut places, &block);
            }
        }
        let count = map.columns();
        // The energy has twice the forms.
        let full = |[a, b, c, d, e, f]: Block| [a, b, c, b, d, e, c, e, f].map(|x| 2.0 * x);
        let mut placed = vec![false; count];
        let mut own = |control: u32| {
            let first = !std::mem::replace(&mut placed[control as usize], true);
            full(if first { self.sums[control as usize] } else { [0.0; 6] })
        };
        for (index, (&[a, b], parts)) in self.pairs.iter().zip(self.parts.chunks_exact_mut(27)).enumerate() {
            parts[..9].copy_from_slice(&own(a));
            parts[9..18].copy_from_slice(&full(self.sums[count + index]));
            parts[18..].copy_from_slice(&own(b));
        }
        let pattern = self.cholesky.pattern();
        pattern.assemble(&self.parts, &mut self.values);
        let mean = pattern.diagonal(&self.values).iter().sum::<f64>() / (3 * count) as f64;
        // Points far from everything cost nothing to move.
        let mut shift = 1e-7 * mean;
        while let Err(error) = self.cholesky.factorize(&self.values, shift) {
            shift *= 100.0;
            if !(shift < mean) {
                return Err(error.to_string());
            }
        }
        Ok(())
    }

    /// Multiplies by the inverse.
    pub fn apply(&self, vector: &mut [f64]) {
        self.cholesky.solve_in_place(vector);
    }
}
