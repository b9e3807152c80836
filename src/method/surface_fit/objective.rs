//! What is minimized over the control points: both squared distance terms and the regularizer, with exact derivatives
//! (equations 2 and 3 of the paper; `G(P) = F(M P)` of its algorithm 2).

use super::cloud;
use super::preconditioner::{Block, Preconditioner};
use super::sampling::Samples;
use super::settings::{Gradient, Preconditioning, Settings, Stage, Terms};
use crate::geometry::point_tree::PointTree;
use crate::geometry::restricted_voronoi::Compatibility;
use crate::geometry::squared_distance::{Anisotropy, Derivative, Options, SquaredDistance, Wanted};
use crate::mesh::linear_map::LinearMap;
use crate::mesh::surface::Surface;
use crate::mesh::{TriangleMesh, area_vector, cross, dot, length, subtract};
use crate::method::Failure;
use crate::optimize::Objective;
use std::cell::Cell;
use std::rc::Rc;

/// The parts of the energy at one point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// From the target to the fit's vertices.
    pub from_target: f64,
    /// From the fit to the target's samples.
    pub to_target: f64,
    /// `|L X|^2`, without its factor.
    pub regularizer: f64,
    /// `|P L X|^2`, without its factor.
    pub unevenness: f64,
    /// What the corners of faces lack in area to be turned like the fit, squared, without its factor.
    pub folding: f64,
}

/// What the second term runs over.
#[derive(Clone, Copy)]
pub enum Target<'a> {
    Surface(&'a TriangleMesh),
    /// The samples are all there is.
    Cloud,
}

/// See the module.
pub struct FitObjective<'a> {
    target: &'a TriangleMesh,
    /// Of a cloud: the weight of a point, and the fitted mesh in triangles.
    cloud: Option<(f64, TriangleMesh)>,
    samples: &'a Samples,
    sample_tree: PointTree,
    site_tree: PointTree,
    map: &'a LinearMap,
    cells: Vec<[u32; 3]>,
    edges: Vec<[u32; 2]>,
    degrees: Vec<f64>,
    to_target: SquaredDistance,
    from_target: SquaredDistance,
    terms: Terms,
    derivative: Derivative,
    compatibility: f64,
    stage: Stage,
    latest: Rc<Cell<Parts>>,
    points: Vec<[f64; 3]>,
    gradient: Vec<[f64; 3]>,
    term: Vec<[f64; 3]>,
    laplacian: Vec<[f64; 3]>,
    normals: Vec<[f64; 3]>,
    areas: Vec<[f64; 3]>,
    turns: Vec<[f64; 3]>,
    /// Of the fit at the start of the stage; once it is known.
    tangents: Option<Vec<Tangent>>,
    /// The corners of the faces: a point, the next and the one before; in stages that unfold.
    corners: Vec<[u32; 3]>,
    /// The unit normals of the fit at the start of a stage that unfolds, and the area that a corner should span.
    upright: Option<(Vec<[f64; 3]>, f64)>,
    boundary: Vec<bool>,
    control: Vec<[f64; 3]>,
    preconditioner: Option<Preconditioner>,
    /// Why there is no preconditioner though one was asked for.
    without: Option<String>,
    blocks: Vec<Block>,
    /// Unit normals of the target's triangles, zero where there is none.
    target_normals: Vec<[f64; 3]>,
    /// Evaluations since the preconditioner was made.
    age: usize,
}

/// The projection along the fit at one of its points, by the unit normal there: none without a normal.
pub type Tangent = Option<[f64; 3]>;

/// Share of the mean area at a corner that every corner should span at least.
const SPAN: f64 = 0.05;

/// Evaluations after which the preconditioner is made anew.
const AGE: usize = 5;

impl<'a> FitObjective<'a> {
    /// Of a fitted mesh whose points are `map` of points near `control`.
    ///
    /// # Errors
    /// Surfaces with an index out of range, which reading would have found.
    pub fn new(
        target: Target<'a>,
        samples: &'a Samples,
        fitted: &Surface,
        map: &'a LinearMap,
        control: &[[f64; 3]],
        settings: &Settings,
        stage: Stage,
    ) -> Result<FitObjective<'a>, Failure> {
        static NO_SURFACE: TriangleMesh = TriangleMesh {
            points: Vec::new(),
            cells: Vec::new(),
        };
        let cells = fitted.cut();
        let (target, cloud) = match target {
            Target::Surface(target) => (target, None),
            Target::Cloud => {
                let surface = TriangleMesh {
                    points: fitted.points.clone(),
                    cells: cells.clone(),
                };
                // All points together weigh as much as the surface does at the start.
                let weight = surface.area() / samples.points.len().max(1) as f64;
                (&NO_SURFACE, Some((weight, surface)))
            }
        };
        let prepared = |role: &str, points: &[[f64; 3]], cells: &[[u32; 3]]| {
            SquaredDistance::new(points, cells).map_err(|error| Failure::invalid(format!("{role}: {error}")))
        };
        let count = fitted.points.len();
        let all_edges = fitted.edges();
        let mut boundary = vec![false; count];
        for edge in all_edges.iter().filter(|edge| edge.faces.len() == 1) {
            edge.ends.iter().for_each(|&end| boundary[end as usize] = true);
        }
        let edges: Vec<[u32; 2]> = all_edges.into_iter().map(|edge| edge.ends).collect();
        let mut degrees = vec![0.0; count];
        for &end in edges.as_flattened() {
            degrees[end as usize] += 1.0;
        }
        // Without one the minimization is slower and no less sound.
        let (preconditioner, without) = match settings.preconditioner {
            Preconditioning::None => (None, None),
            Preconditioning::Hessian => match Preconditioner::new(map, &edges, &degrees, control) {
                Ok(preconditioner) => (Some(preconditioner), None),
                Err(reason) => (None, Some(reason)),
            },
        };
        let target_normals = target.cells.iter().map(|&cell| {
            let area = area_vector(target.corners(cell));
            let size = length(area);
            if size > 0.0 { area.map(|x| x / size) } else { [0.0; 3] }
        });
        Ok(FitObjective {
            preconditioner,
            without,
            blocks: vec![[0.0; 6]; count],
            target_normals: target_normals.collect(),
            age: AGE,
            to_target: prepared("template", &fitted.points, &cells)?,
            from_target: prepared("target", &target.points, &target.cells)?,
            target,
            samples,
            sample_tree: PointTree::new(&samples.points),
            site_tree: PointTree::new(&fitted.points),
            map,
            cells,
            edges,
            degrees,
            terms: settings.terms,
            derivative: match settings.gradient {
                Gradient::Complete => Derivative::Complete,
                Gradient::Paper => Derivative::Paper,
            },
            // A cloud has no normals to be compatible with.
            compatibility: if cloud.is_some() { 0.0 } else { settings.compatibility },
            cloud,
            stage,
            latest: Rc::new(Cell::new(Parts::default())),
            points: vec![[0.0; 3]; count],
            gradient: vec![[0.0; 3]; count],
            term: vec![[0.0; 3]; count],
            laplacian: vec![[0.0; 3]; count],
            normals: vec![[0.0; 3]; count],
            areas: vec![[0.0; 3]; count],
            turns: vec![[0.0; 3]; count],
            tangents: None,
            corners: (0..fitted.faces())
                .flat_map(|face| corners(fitted.face(face)))
                .collect(),
            upright: None,
            boundary,
            control: vec![[0.0; 3]; map.columns()],
        })
    }

    /// The parts of the latest evaluation.
    pub fn latest(&self) -> Rc<Cell<Parts>> {
        self.latest.clone()
    }

    /// Why the minimization goes without the preconditioner that was asked for, if it does.
    pub fn without_preconditioner(&self) -> Option<&str> {
        self.without.as_deref()
    }

    pub fn set_stage(&mut self, stage: Stage) {
        self.stage = stage;
        self.tangents = None;
        self.upright = None;
        self.age = AGE;
    }

    /// Makes the preconditioner anew at the points of the latest evaluation.
    fn refresh(&mut self) {
        let Some(preconditioner) = &mut self.preconditioner else {
            return;
        };
        self.age = 0;
        self.blocks.fill([0.0; 6]);
        let stretch = self.stage.anisotropy.powi(2) - 1.0;
        let blocks = &mut self.blocks;
        let mut pull = |point: u32, area: f64, n: [f64; 3]| {
            let along = stretch * area;
            let block = &mut blocks[point as usize];
            block[0] += area + along * n[0] * n[0];
            block[1] += along * n[0] * n[1];
            block[2] += along * n[0] * n[2];
            block[3] += area + along * n[1] * n[1];
            block[4] += along * n[1] * n[2];
            block[5] += area + along * n[2] * n[2];
        };
        if self.terms.to_target() {
            let (cells, normals) = (&self.cells, &self.samples.normals);
            let diagram = self.to_target.diagram();
            diagram.pieces(&self.points, &self.sample_tree, None, |piece| {
                for vertex in cells[piece.triangle as usize] {
                    pull(vertex, piece.area / 3.0, normals[piece.site as usize]);
                }
            });
        }
        if let (true, Some((weight, surface))) = (self.terms.from_target(), &mut self.cloud) {
            surface.points.copy_from_slice(&self.points);
            let weight = *weight;
            cloud::distance(&self.samples.points, surface, weight, |cell, shares, _| {
                for (vertex, share) in cell.into_iter().zip(shares) {
                    pull(vertex, weight * share, [0.0; 3]);
                }
            });
        } else if self.terms.from_target() {
            let normals = &self.target_normals;
            let diagram = self.from_target.diagram();
            diagram.pieces(&self.target.points, &self.site_tree, None, |piece| {
                pull(piece.site, piece.area, normals[piece.triangle as usize]);
            });
        }
        let made = preconditioner.refresh(
            self.map,
            &self.blocks,
            self.stage.regularization,
            self.stage.evenness,
            self.tangents.as_deref().unwrap_or_default(),
        );
        if let Err(reason) = made {
            self.preconditioner = None;
            self.without = Some(reason);
        }
    }

    /// Value at control points; the gradient by the fitted points is left in `self.gradient`.
    fn evaluate(&mut self, control: &[f64], with_gradient: bool) -> f64 {
        let (control, _) = control.as_chunks();
        if !control.iter().flatten().all(|x| x.is_finite()) {
            return f64::INFINITY;
        }
        self.map.apply(control, &mut self.points);
        self.gradient.fill([0.0; 3]);
        let mut parts = Parts::default();
        let s = self.stage.anisotropy;
        let compatible = self.compatibility > 0.0;
        if self.terms.to_target() {
            let options = Options {
                anisotropy: Anisotropy::Sites(s, &self.samples.normals),
                compatibility: compatible.then_some(Compatibility {
                    weight: self.compatibility,
                    normals: &self.samples.normals,
                }),
                derivative: Derivative::Complete,
            };
            let wanted = Wanted {
                surface: with_gradient.then_some(&mut self.term),
                ..Wanted::default()
            };
            parts.to_target = self
                .to_target
                .evaluate(&self.points, &self.sample_tree, &options, wanted);
            if with_gradient {
                add_to(&mut self.gradient, &self.term, 1.0);
            }
        }
        if let (true, Some((weight, surface))) = (self.terms.from_target(), &mut self.cloud) {
            surface.points.copy_from_slice(&self.points);
            let gradient = &mut self.gradient;
            let weight = *weight;
            parts.from_target = cloud::distance(&self.samples.points, surface, weight, |cell, shares, offset| {
                if with_gradient {
                    for (vertex, share) in cell.into_iter().zip(shares) {
                        for axis in 0..3 {
                            gradient[vertex as usize][axis] += 2.0 * weight * share * offset[axis];
                        }
                    }
                }
            });
        } else if self.terms.from_target() {
            self.site_tree.set(&self.points);
            if compatible {
                self.find_normals();
            }
            let options = Options {
                anisotropy: Anisotropy::Facets(s),
                compatibility: compatible.then_some(Compatibility {
                    weight: self.compatibility,
                    normals: &self.normals,
                }),
                derivative: self.derivative,
            };
            let wanted = Wanted {
                sites: with_gradient.then_some(&mut self.term),
                normals: (with_gradient && compatible).then_some(&mut self.turns),
                ..Wanted::default()
            };
            parts.from_target = self
                .from_target
                .evaluate(&self.target.points, &self.site_tree, &options, wanted);
            if with_gradient {
                add_to(&mut self.gradient, &self.term, 1.0);
                if compatible {
                    self.turn_normals();
                }
            }
        }
        // |L X|^2 and its gradient 2 L L X, |P L X|^2 and its gradient 2 L P L X; L is symmetric.
        apply_laplacian(&self.edges, &self.degrees, &self.points, &mut self.laplacian);
        parts.regularizer = self.laplacian.as_flattened().iter().map(|x| x * x).sum();
        let Stage {
            regularization,
            evenness,
            ..
        } = self.stage;
        let tangents = match &self.tangents {
            Some(tangents) => tangents,
            None => {
                self.find_normals();
                let tangents = self.normals.iter().zip(&self.boundary);
                let tangents = tangents.map(|(&normal, &boundary)| (!boundary && normal != [0.0; 3]).then_some(normal));
                self.tangents.insert(tangents.collect())
            }
        };
        for (bend, tangent) in self.laplacian.iter_mut().zip(tangents) {
            let mut along = [0.0; 3];
            if let Some(n) = tangent {
                let out = dot(*bend, *n);
                along = std::array::from_fn(|axis| bend[axis] - out * n[axis]);
                parts.unevenness += dot(along, along);
            }
            *bend = std::array::from_fn(|axis| regularization * bend[axis] + evenness * along[axis]);
        }
        if with_gradient && regularization.max(evenness) > 0.0 {
            apply_laplacian(&self.edges, &self.degrees, &self.laplacian, &mut self.term);
            add_to(&mut self.gradient, &self.term, 2.0);
        }
        if self.stage.unfolding > 0.0 {
            parts.folding = self.unfold(with_gradient);
        }
        self.latest.set(parts);
        let value = parts.to_target
            + parts.from_target
            + regularization * parts.regularizer
            + evenness * parts.unevenness
            + self.stage.unfolding * parts.folding;
        if value.is_finite() { value } else { f64::INFINITY }
    }

    /// The sum over the corners of `max(0, goal - n . (a x b))^2` with the edges `a`, `b` at the corner and the normal `n`
    /// of the fit there at the start of the stage. Adds the gradient with its factor.
    fn unfold(&mut self, with_gradient: bool) -> f64 {
        if self.upright.is_none() {
            self.find_normals();
            let spans = self.corners.iter().map(|&corner| {
                let [point, next, last] = corner.map(|vertex| self.points[vertex as usize]);
                length(cross(subtract(next, point), subtract(last, point)))
            });
            let goal = SPAN * spans.sum::<f64>() / self.corners.len().max(1) as f64;
            self.upright = Some((self.normals.clone(), goal));
        }
        let Some((normals, goal)) = &self.upright else {
            return 0.0;
        };
        let mut sum = 0.0;
        for &corner in &self.corners {
            let [point, next, last] = corner.map(|vertex| self.points[vertex as usize]);
            let (ahead, back) = (subtract(next, point), subtract(last, point));
            let normal = normals[corner[0] as usize];
            let lack = goal - dot(normal, cross(ahead, back));
            // A point without a normal has nothing to be turned like.
            if !(lack > 0.0) || normal == [0.0; 3] {
                continue;
            }
            sum += lack * lack;
            if with_gradient {
                let factor = -2.0 * self.stage.unfolding * lack;
                // d n . (a x b) = (b x n) . da + (n x a) . db
                let (by_next, by_last) = (cross(back, normal), cross(normal, ahead));
                for axis in 0..3 {
                    self.gradient[corner[1] as usize][axis] += factor * by_next[axis];
                    self.gradient[corner[2] as usize][axis] += factor * by_last[axis];
                    self.gradient[corner[0] as usize][axis] -= factor * (by_next[axis] + by_last[axis]);
                }
            }
        }
        sum
    }

    /// Unit normals of the fitted points: the directions of the sums of the area vectors around them.
    fn find_normals(&mut self) {
        self.areas.fill([0.0; 3]);
        for &cell in &self.cells {
            let area = area_vector(cell.map(|vertex| self.points[vertex as usize]));
            for vertex in cell {
                for axis in 0..3 {
                    self.areas[vertex as usize][axis] += area[axis];
                }
            }
        }
        for (normal, area) in self.normals.iter_mut().zip(&self.areas) {
            let size = length(*area);
            *normal = if size > 0.0 { area.map(|x| x / size) } else { [0.0; 3] };
        }
    }

    /// Adds what the turning of the normals does: the gradient by the normals through their definition.
    fn turn_normals(&mut self) {
        for ((turn, normal), area) in self.turns.iter_mut().zip(&self.normals).zip(&self.areas) {
            let size = length(*area);
            let along = dot(*turn, *normal);
            *turn = if size > 0.0 {
                std::array::from_fn(|axis| (turn[axis] - along * normal[axis]) / size)
            } else {
                [0.0; 3]
            };
        }
        for &cell in &self.cells {
            let [a, b, c] = cell.map(|vertex| self.points[vertex as usize]);
            let pull: [f64; 3] =
                std::array::from_fn(|axis| cell.iter().map(|&vertex| self.turns[vertex as usize][axis]).sum());
            // d ((b - a) x (c - a)) . g
            let by_b = cross(subtract(c, a), pull);
            let by_c = cross(pull, subtract(b, a));
            for axis in 0..3 {
                self.gradient[cell[1] as usize][axis] += by_b[axis];
                self.gradient[cell[2] as usize][axis] += by_c[axis];
                self.gradient[cell[0] as usize][axis] -= by_b[axis] + by_c[axis];
            }
        }
    }
}

/// The corners of a face: each with the next one and the one before.
fn corners(face: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let count = face.len();
    (0..count).map(move |place| {
        [
            face[place],
            face[(place + 1) % count],
            face[(place + count - 1) % count],
        ]
    })
}

fn add_to(sum: &mut [[f64; 3]], term: &[[f64; 3]], factor: f64) {
    for (sum, term) in sum.as_flattened_mut().iter_mut().zip(term.as_flattened()) {
        *sum += factor * term;
    }
}

/// `(D - A) x` with the degrees `D` and the adjacency `A` of a graph.
fn apply_laplacian(edges: &[[u32; 2]], degrees: &[f64], x: &[[f64; 3]], result: &mut [[f64; 3]]) {
    for ((result, x), degree) in result.iter_mut().zip(x).zip(degrees) {
        *result = x.map(|x| degree * x);
    }
    for &[a, b] in edges {
        let (a, b) = (a as usize, b as usize);
        for axis in 0..3 {
            result[a][axis] -= x[b][axis];
            result[b][axis] -= x[a][axis];
        }
    }
}

impl Objective for FitObjective<'_> {
    fn dimension(&self) -> usize {
        3 * self.map.columns()
    }

    fn value(&mut self, x: &[f64]) -> f64 {
        self.evaluate(x, false)
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let value = self.evaluate(x, true);
        if value.is_finite() {
            self.map.apply_transposed(&self.gradient, &mut self.control);
            gradient.copy_from_slice(self.control.as_flattened());
            self.age += 1;
        }
        value
    }

    fn is_preconditioned(&self) -> bool {
        self.preconditioner.is_some()
    }

    fn precondition(&mut self, vector: &mut [f64]) {
        if self.age >= AGE {
            self.refresh();
        }
        if let Some(preconditioner) = &self.preconditioner {
            preconditioner.apply(vector);
        }
    }
}
