//! Unknowns that stand for the nodes: control points of a subdivision, or the nodes that may move.

use crate::mesh::linear_map::LinearMap;

/// Node positions as an affine function of the unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    pub map: LinearMap,
    /// Added to every node.
    pub constant: Vec<[f64; 3]>,
}

impl Chart {
    /// Nodes as combinations of others.
    pub fn linear(map: LinearMap) -> Chart {
        Chart {
            constant: vec![[0.0; 3]; map.rows()],
            map,
        }
    }

    /// All nodes stand for themselves but those that stay where they are.
    pub fn fixing(fixed: &[bool], x: &[f64]) -> Chart {
        let places = x.as_chunks::<3>().0;
        let mut free = 0;
        let rows: Vec<Vec<(u32, f64)>> = fixed
            .iter()
            .map(|&fixed| {
                if fixed {
                    return Vec::new();
                }
                free += 1;
                vec![(free - 1, 1.0)]
            })
            .collect();
        let constant = fixed
            .iter()
            .zip(places)
            .map(|(&fixed, &place)| if fixed { place } else { [0.0; 3] })
            .collect();
        Chart {
            map: LinearMap::from_rows(free as usize, rows.into_iter()),
            constant,
        }
    }

    /// Numbers among the unknowns.
    pub fn unknowns(&self) -> usize {
        3 * self.map.columns()
    }

    /// Nodes of unknowns.
    pub fn expand(&self, unknowns: &[f64], x: &mut [f64]) {
        let points = x.as_chunks_mut::<3>().0;
        self.map.apply(unknowns.as_chunks::<3>().0, points);
        for (point, constant) in points.iter_mut().zip(&self.constant) {
            for axis in 0..3 {
                point[axis] += constant[axis];
            }
        }
    }

    /// The gradient by the unknowns from that by the nodes.
    pub fn restrict(&self, gradient: &[f64], unknowns: &mut [f64]) {
        self.map
            .apply_transposed(gradient.as_chunks::<3>().0, unknowns.as_chunks_mut::<3>().0);
    }
}
