//! Points as fixed combinations of other points: sparse rows of weights.

/// A map from control points to points, the same for all three coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearMap {
    columns: usize,
    offsets: Vec<usize>,
    entries: Vec<(u32, f64)>,
}

impl LinearMap {
    /// The map that leaves points as they are.
    pub fn identity(points: usize) -> LinearMap {
        LinearMap::from_rows(points, (0..points as u32).map(|point| vec![(point, 1.0)]))
    }

    /// From rows of (control point, weight); repeated control points are summed.
    ///
    /// # Panics
    /// When a control point is out of range.
    pub fn from_rows(columns: usize, rows: impl Iterator<Item = Vec<(u32, f64)>>) -> LinearMap {
        let mut map = LinearMap {
            columns,
            offsets: vec![0],
            entries: Vec::new(),
        };
        for mut row in rows {
            row.sort_by_key(|&(column, _)| column);
            let start = map.entries.len();
            for (column, weight) in row {
                assert!((column as usize) < columns, "a control point within the mesh");
                match map.entries[start..].last_mut() {
                    Some(last) if last.0 == column => last.1 += weight,
                    _ => map.entries.push((column, weight)),
                }
            }
            map.offsets.push(map.entries.len());
        }
        map
    }

    /// Number of points.
    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Number of control points.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The control points of a point with their weights, ascending.
    pub fn row(&self, row: usize) -> &[(u32, f64)] {
        &self.entries[self.offsets[row]..self.offsets[row + 1]]
    }

    /// `self` after `first`.
    ///
    /// # Panics
    /// When `first` does not give as many points as this takes.
    pub fn after(&self, first: &LinearMap) -> LinearMap {
        assert_eq!(self.columns, first.rows(), "maps that fit together");
        let rows = (0..self.rows()).map(|row| {
            let terms = self.row(row).iter().flat_map(|&(middle, weight)| {
                let inner = first.row(middle as usize).iter();
                inner.map(move |&(column, inner)| (column, weight * inner))
            });
            terms.collect()
        });
        LinearMap::from_rows(first.columns, rows)
    }

    /// The points of control points.
    pub fn apply(&self, control: &[[f64; 3]], points: &mut [[f64; 3]]) {
        assert!(
            control.len() == self.columns && points.len() == self.rows(),
            "points of the map's size"
        );
        for (row, point) in points.iter_mut().enumerate() {
            *point = [0.0; 3];
            for &(column, weight) in self.row(row) {
                for axis in 0..3 {
                    point[axis] += weight * control[column as usize][axis];
                }
            }
        }
    }

    /// The transposed map, which takes gradients by the points to gradients by the control points.
    pub fn apply_transposed(&self, points: &[[f64; 3]], control: &mut [[f64; 3]]) {
        assert!(
            control.len() == self.columns && points.len() == self.rows(),
            "points of the map's size"
        );
        control.fill([0.0; 3]);
        for (row, point) in points.iter().enumerate() {
            for &(column, weight) in self.row(row) {
                for axis in 0..3 {
                    control[column as usize][axis] += weight * point[axis];
                }
            }
        }
    }
}
