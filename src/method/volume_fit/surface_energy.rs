//! The surface energy: how far the template's boundary and the target are from each other, both ways.
//!
//! `E_S = (F_(S -> T) + F_(T -> S)) / (A L^2)` with `L = V / A` from the target's area and volume (Jin et al. 2013,
//! equation 9; Nivoliers et al. 2012). Distances along normals count in full, those along the surface divided by the
//! anisotropy s: the weights are `A_s / s`, so that the energy approximates the normal distance whatever s is.

use super::settings::Terms;
use super::target::Target;
use crate::geometry::point_tree::PointTree;
use crate::geometry::squared_distance::{Anisotropy, Options, SquaredDistance, Wanted};
use crate::mesh::TriangleMesh;

/// The two terms over one sampling of the boundary.
pub struct SurfaceEnergy {
    to_target: Option<(SquaredDistance, PointTree, Vec<[f64; 3]>)>,
    from_target: Option<(SquaredDistance, Vec<[f64; 3]>, PointTree)>,
    anisotropy: f64,
    factor: f64,
    room: Vec<[f64; 3]>,
    has_normals: bool,
}

/// Area and volume that make the energy dimensionless.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    pub area: f64,
    pub volume: f64,
}

impl Scale {
    /// Of a target whose triangles enclose a volume (`closed`), or else of the template's boundary.
    pub fn of(target: &Target, closed: bool, template: &TriangleMesh, template_volume: f64) -> Scale {
        let own = Scale {
            area: template.area(),
            volume: template_volume,
        };
        if target.surface.cells.is_empty() {
            return own;
        }
        let area = target.surface.area();
        let volume = target.surface.enclosed_volume().abs();
        Scale {
            area,
            volume: if closed && volume > 0.0 { volume } else { own.volume },
        }
    }

    /// `1 / (A L^2)`, before the sum of squared distances.
    pub fn factor(&self) -> f64 {
        let length = self.volume / self.area;
        1.0 / (self.area * length * length)
    }
}

impl SurfaceEnergy {
    /// For a boundary of these triangles over samples.
    ///
    /// # Errors
    /// When the target has neither triangles nor points for a wanted term.
    pub fn new(
        samples: &[[f64; 3]],
        triangles: &[[u32; 3]],
        target: &Target,
        terms: Terms,
        anisotropy: f64,
        scale: Scale,
    ) -> Result<SurfaceEnergy, String> {
        let mut to_target = None;
        let mut from_target = None;
        if terms.to_target && !target.sites.is_empty() {
            let term = SquaredDistance::new(samples, triangles).map_err(|error| error.to_string())?;
            to_target = Some((term, PointTree::new(&target.sites), target.normals.clone()));
        }
        if terms.from_target && !target.surface.cells.is_empty() {
            let term = SquaredDistance::new(&target.surface.points, &target.surface.cells)
                .map_err(|error| error.to_string())?;
            from_target = Some((term, target.surface.points.clone(), PointTree::default()));
        }
        if to_target.is_none() && from_target.is_none() && (terms.to_target || terms.from_target) {
            return Err("a cloud of points has no surface to measure from; set distance = \"to-target\"".to_string());
        }
        Ok(SurfaceEnergy {
            to_target,
            from_target,
            anisotropy,
            factor: scale.factor(),
            room: Vec::new(),
            has_normals: target.normals.iter().any(|normal| *normal != [0.0; 3]),
        })
    }

    /// The value at these samples; the derivative is written to `gradient`.
    pub fn gradient(&mut self, samples: &[[f64; 3]], gradient: &mut [[f64; 3]]) -> f64 {
        gradient.fill([0.0; 3]);
        self.room.resize(samples.len(), [0.0; 3]);
        let s = self.anisotropy;
        let mut sum = 0.0;
        if let Some((term, sites, normals)) = &mut self.to_target {
            let with_normals = s != 1.0 && self.has_normals;
            let options = Options {
                anisotropy: if with_normals {
                    Anisotropy::Sites(s, normals)
                } else {
                    Anisotropy::None
                },
                ..Options::default()
            };
            let wanted = Wanted {
                surface: Some(&mut self.room),
                ..Wanted::default()
            };
            let value = term.evaluate(samples, sites, &options, wanted);
            let factor = self.factor / if with_normals { s * s } else { 1.0 };
            sum += factor * value;
            add(gradient, &self.room, factor);
        }
        if let Some((term, surface, tree)) = &mut self.from_target {
            let options = Options {
                anisotropy: if s != 1.0 {
                    Anisotropy::Facets(s)
                } else {
                    Anisotropy::None
                },
                ..Options::default()
            };
            tree.set(samples);
            let wanted = Wanted {
                sites: Some(&mut self.room),
                ..Wanted::default()
            };
            let value = term.evaluate(surface, tree, &options, wanted);
            let factor = self.factor / (s * s);
            sum += factor * value;
            add(gradient, &self.room, factor);
        }
        sum
    }
}

fn add(sum: &mut [[f64; 3]], values: &[[f64; 3]], factor: f64) {
    for (sum, value) in sum.iter_mut().zip(values) {
        for axis in 0..3 {
            sum[axis] += factor * value[axis];
        }
    }
}
