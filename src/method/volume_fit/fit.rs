//! A fit under way: the map, what it is fitted to, and the order of its stages.

use super::objective::Parts;
use super::settings::{Settings, Stage, Terms};
use super::shell::{self, Shell};
use super::surface_energy::{Scale, SurfaceEnergy};
use super::target::{Closure, Target};
use super::template::{Template, transform};
use super::untangle::Softness;
use super::validity::Certificates;
use super::{COUNTERS, adaptivity, orientation, quality, subdivision, untangle};
use crate::energy::mapping::Density;
use crate::fem::batches::{Batches, reference_volume, references_of_volume};
use crate::fem::boundary::Boundary;
use crate::fem::quadrature::{CellQuadrature, Rule};
use crate::fem::space::{Kind, Space};
use crate::fem::volume_energy::VolumeEnergy;
use crate::linalg::vector3::Columns;
use crate::mesh::mixed::{MixedMesh, Topology};
use crate::mesh::{self, TriangleMesh, bounding_box};
use crate::method::{Failure, Outcome};
use crate::optimize::{Observer, StopReason};
use std::collections::BTreeMap;

/// A fit under way, in units in which the target's box has the diagonal 1 and its middle the origin.
pub(super) struct Fit<'a> {
    pub(super) settings: &'a Settings,
    pub(super) volume: MixedMesh,
    pub(super) topology: Topology,
    pub(super) target: Target,
    pub(super) shell: Option<Shell>,
    pub(super) references: Vec<Columns<f64>>,
    pub(super) reference_volume: f64,
    pub(super) scale: Scale,
    /// The target's units: length of 1 here, and the middle.
    pub(super) unit: f64,
    pub(super) middle: [f64; 3],
    pub(super) space: Space,
    pub(super) x: Vec<f64>,
    pub(super) notices: Vec<String>,
    pub(super) rows: Vec<[f64; 10]>,
    pub(super) counters: BTreeMap<String, u64>,
    pub(super) last: Parts,
    pub(super) lambda: f64,
    pub(super) increases: usize,
    pub(super) stages: usize,
    /// Quadrature points added a direction, after elements came out invalid between the points.
    pub(super) extra_points: usize,
    /// Orders and map of the template where the stages alone lead from there to the end.
    pub(super) start: Option<(Vec<usize>, Vec<f64>)>,
    /// Certificates of the present map, once they are known.
    pub(super) certificates: Option<Certificates>,
}

impl<'a> Fit<'a> {
    pub(super) fn new(
        template: Template,
        mut target: Target,
        settings: &'a Settings,
        mut notices: Vec<String>,
    ) -> Result<Fit<'a>, Failure> {
        notices.append(&mut target.notices);
        let Template {
            mesh: mut volume,
            mut map,
            mut shell,
        } = template;
        let points = if target.surface.points.is_empty() {
            &target.sites
        } else {
            &target.surface.points
        };
        let [low, high] = bounding_box(points).ok_or_else(|| Failure::invalid("the target has no points"))?;
        let unit = mesh::diagonal(points);
        if !(unit > 0.0 && unit.is_finite()) {
            return Err(Failure::invalid(format!(
                "the target's box has the diagonal {unit}; it needs an extent"
            )));
        }
        let middle: [f64; 3] = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        let lists = [&mut target.surface.points, &mut target.clean.points, &mut target.sites];
        for list in lists {
            for point in list {
                *point = std::array::from_fn(|axis| (point[axis] - middle[axis]) / unit);
            }
        }
        transform(
            &mut volume,
            &mut map,
            [1.0 / unit; 3],
            middle.map(|coordinate| -coordinate / unit),
        );
        notices.extend(mesh::far_off(&volume.points));
        if let Some(shell) = &mut shell {
            shell.distance /= unit;
            for column in shell.references.iter_mut().flatten() {
                *column = column.map(|coordinate| coordinate / unit);
            }
            shell.surface.points.copy_from_slice(&volume.points[..shell.base]);
        }
        // A shell turns its surface itself when it is grown.
        let turned = if shell.is_none() {
            orientation::orient(&mut target.surface)
        } else {
            0
        };
        if turned > 0 {
            notices.push(format!(
                "triangles of the target face opposite ways: {turned} of {} are turned over, so that all enclose a volume",
                target.surface.cells.len()
            ));
        }
        let topology = volume.topology().map_err(Failure::invalid)?;
        let order = settings.stages.iter().map(|stage| stage.order).max().unwrap_or(1);
        let samples = induced_intervals(order).max(FEWEST_INTERVALS).pow(2);
        target.place_sites(2 * samples * topology.boundary().count());
        let template_surface = topology.boundary_triangles(&volume.points);
        let own_volume = volume.volume();
        if !(own_volume > 0.0) {
            return Err(Failure::invalid(format!(
                "the template has the volume {own_volume:e}; its elements are inside out or flat"
            )));
        }
        let closed = check_target(&target, &template_surface, own_volume, shell.is_some(), &mut notices)?;
        let scale = Scale::of(&target, closed, &template_surface, own_volume);
        let (references, whole) = match &shell {
            None => {
                let shapes = volume.iter().map(|cell| cell.0);
                (references_of_volume(shapes, scale.volume), scale.volume)
            }
            Some(shell) => {
                let volumes = volume.iter().zip(&shell.references);
                let sum = volumes
                    .map(|((shape, _), reference)| reference_volume(shape, reference))
                    .sum();
                (shell.references.clone(), sum)
            }
        };
        if settings.levels > 0 && (map.is_some() || shell.is_some()) {
            return Err(Failure::invalid(
                "a subdivision volume starts from straight hexahedra, not from a coefficient file or a shell; remove \
                 `subdivision_levels`"
                    .to_string(),
            ));
        }
        if let Some(highest) = map.as_ref().and_then(|map| map.orders.iter().max())
            && *highest > settings.order
        {
            notices.push(format!(
                "the template's elements have orders up to {highest}, above the order {} of the job: they keep them",
                settings.order
            ));
        }
        let held = settings
            .samples
            .filter(|_| settings.terms.to_target || settings.terms.from_target);
        if let Some(samples) = held.filter(|&samples| samples < settings.order && settings.levels == 0) {
            notices.push(format!(
                "the boundary is sampled at {samples} intervals a side: functions of the orders {} to {} are held by nothing \
                 between the samples and may fold there; set surface_samples = {} or more",
                samples + 1,
                settings.order,
                settings.order
            ));
        }
        let first = settings.stages[0].order;
        let (space, x) = match map {
            None => {
                let orders = vec![first; volume.cells()];
                let space = Space::new(&volume, &topology, settings.basis, &orders).map_err(Failure::invalid)?;
                let x = space.linear(&volume.points);
                (space, x)
            }
            Some(map) if map.basis.name() == settings.basis.name() => {
                let space = Space::new(&volume, &topology, settings.basis, &map.orders).map_err(Failure::invalid)?;
                (space, map.x)
            }
            Some(map) => {
                return Err(Failure::invalid(format!(
                    "the template's coefficients belong to the basis {}, the job's is {}; set basis = \"{}\"",
                    map.basis.name(),
                    settings.basis.name(),
                    map.basis.name()
                )));
            }
        };
        Ok(Fit {
            settings,
            reference_volume: whole,
            shell,
            volume,
            topology,
            target,
            references,
            scale,
            unit,
            middle,
            space,
            x,
            notices,
            rows: Vec::new(),
            counters: COUNTERS.iter().map(|(name, _)| (name.to_string(), 0)).collect(),
            last: Parts::default(),
            lambda: settings.stages[0].lambda,
            increases: 0,
            stages: 0,
            extra_points: 0,
            start: None,
            certificates: None,
        })
    }

    pub(super) fn count(&mut self, name: &str, amount: u64) {
        *self.counters.entry(name.to_string()).or_default() += amount;
    }

    pub(super) fn volume_energy(&self, space: &Space) -> Result<VolumeEnergy, Failure> {
        self.volume_energy_of(space, Density::new(self.settings.energy))
    }

    pub(super) fn volume_energy_of(&self, space: &Space, density: Density) -> Result<VolumeEnergy, Failure> {
        let quadrature = |kind: Kind| self.quadrature(kind);
        let batches = Batches::new(space, &self.references, &quadrature).map_err(Failure::invalid)?;
        VolumeEnergy::new(batches, density).map_err(Failure::invalid)
    }

    /// The points of a cell: those of the settings, in repairs more, with some on corners and edges, where elements fail
    /// first.
    pub(super) fn quadrature(&self, kind: Kind) -> CellQuadrature {
        let settings = self.settings;
        let points = settings.quadrature_points(kind.order);
        if self.extra_points == 0 {
            return settings.rule.cell(kind.shape, points);
        }
        let usual = settings.usual_points(Rule::Lobatto, kind.order);
        Rule::Lobatto.cell(kind.shape, points.max(usual) + self.extra_points)
    }

    /// The boundary of the map in this space, sampled as densely as its orders ask for.
    pub(super) fn boundary(&self, space: &Space) -> Boundary {
        Boundary::new(
            &self.volume,
            &self.topology,
            space,
            self.intervals(space.highest_order()),
        )
    }

    /// The surface energy about these samples of the boundary; none for shells and where no distance is wanted.
    pub(super) fn surface_energy(
        &self,
        boundary: &Boundary,
        samples: &[[f64; 3]],
    ) -> Result<Option<SurfaceEnergy>, Failure> {
        if self.surface_factor() == 0.0 {
            return Ok(None);
        }
        let settings = self.settings;
        let energy = SurfaceEnergy::new(
            samples,
            &boundary.triangles,
            &self.target,
            settings.terms,
            settings.anisotropy,
            self.scale,
        );
        Ok(Some(energy.map_err(Failure::invalid)?))
    }

    /// Intervals between samples along an edge of the boundary.
    pub(super) fn intervals(&self, order: usize) -> usize {
        self.settings.samples.unwrap_or_else(|| {
            let faces = self.topology.boundary().count().max(1);
            let even = (0.5 * self.target.sites.len() as f64 / faces as f64).sqrt().ceil() as usize;
            induced_intervals(order).max(even.clamp(FEWEST_INTERVALS, 16))
        })
    }

    /// What squared distances are multiplied by in the surface energy, 0 without one.
    pub(super) fn surface_factor(&self) -> f64 {
        let Terms { to_target, from_target } = self.settings.terms;
        if self.shell.is_none() && (to_target || from_target) {
            self.scale.factor()
        } else {
            0.0
        }
    }

    pub(super) fn raise(&mut self, orders: &[usize]) -> Result<(), Failure> {
        if orders == self.space.orders {
            return Ok(());
        }
        let next = Space::new(&self.volume, &self.topology, self.settings.basis, orders).map_err(Failure::invalid)?;
        self.x = self.space.transfer(&self.x, &next);
        self.space = next;
        Ok(())
    }

    pub(super) fn run(&mut self, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let start = self.volume_energy(&self.space)?;
        let evaluation = start.value(&self.x);
        let quality = quality::quality(&self.space, &self.references, &self.x)?;
        let inverted_at_start = quality.least_determinant.iter().filter(|det| !(**det > 0.0)).count();
        drop(start);
        let mut stop = StopReason::Converged;
        let mut reason = String::new();
        // Nothing but the layers holds a shell's surface in its place.
        if !evaluation.value.is_finite() && self.settings.untangle && self.shell.is_none() {
            if let Some(interrupted) = untangle::untangle(self, Softness::Full, observer)? {
                return self.finish(
                    interrupted,
                    "stopped from outside while the template was untangled".to_string(),
                    inverted_at_start,
                    observer,
                );
            }
        } else if !evaluation.value.is_finite() {
            return Err(Failure {
                kind: "invalid-start".to_string(),
                reason: format!(
                    "{inverted_at_start} elements of the template are inverted or flat (least determinant {:.3e}), where the \
                     energy is infinite; repair the template, or change its recipe",
                    evaluation.least_determinant
                ),
            });
        }
        if let Some(shell) = self.shell.clone() {
            (stop, reason) = shell::run(self, &shell, observer)?;
            return self.finish(stop, reason, inverted_at_start, observer);
        }
        if self.settings.levels > 0 {
            (stop, reason) = subdivision::run(self, self.settings.levels, observer)?;
            return self.finish(stop, reason, inverted_at_start, observer);
        }
        if self.settings.adaptive.is_none() && self.settings.repairs > 0 {
            self.start = Some((self.space.orders.clone(), self.x.clone()));
        }
        let stages = self.settings.stages.clone();
        for stage in stages {
            let orders: Vec<usize> = self.space.orders.iter().map(|&order| order.max(stage.order)).collect();
            self.raise(&orders)?;
            (stop, reason) = self.stage(&stage, observer)?;
            if interrupted(stop) {
                break;
            }
        }
        if let Some(adaptive) = self.settings.adaptive
            && !interrupted(stop)
        {
            let last = self.settings.stages[self.settings.stages.len() - 1];
            let mut history = Vec::new();
            for _ in 0..adaptive.steps {
                let Some(orders) = adaptivity::raised(self, &adaptive, &mut history)? else {
                    break;
                };
                self.raise(&orders)?;
                let stage = Stage {
                    order: orders.iter().copied().max().unwrap_or(1),
                    tolerance: self.settings.coarse_tolerance,
                    ..last
                };
                (stop, reason) = self.stage(&stage, observer)?;
                if interrupted(stop) {
                    break;
                }
            }
            if !interrupted(stop) {
                let order = self.space.highest_order();
                (stop, reason) = self.stage(&Stage { order, ..last }, observer)?;
            }
        }
        if !interrupted(stop)
            && let Some(interrupted) = self.repair(observer)?
        {
            (stop, reason) = (interrupted, "stopped from outside during a repair".to_string());
        }
        self.finish(stop, reason, inverted_at_start, observer)
    }
}

pub(super) fn interrupted(stop: StopReason) -> bool {
    matches!(
        stop,
        StopReason::TimeLimit | StopReason::Cancelled | StopReason::NotFinite
    )
}

/// Names what is wrong with a target surface, and says whether it encloses a volume. An inside-out one does.
fn check_target(
    target: &Target,
    template: &TriangleMesh,
    template_volume: f64,
    is_shell: bool,
    notices: &mut Vec<String>,
) -> Result<bool, Failure> {
    if target.sites.is_empty() {
        return Err(Failure::invalid("every triangle of the target has no area"));
    }
    if target.surface.cells.is_empty() {
        notices.push(format!(
            "the target is a cloud of {} points without normals: only the term from the template to the points is there",
            target.sites.len()
        ));
        return Ok(false);
    }
    let closure = Closure::of(&target.surface);
    let volume = target.surface.enclosed_volume();
    if !closure.is_closed() {
        notices.push(format!(
            "the target does not enclose a volume: of its {} edges {} have one triangle and {} have triangles of opposite \
             orientations; the length scale is from the template's volume {template_volume:.4}, not {volume:.4} (in units of \
             the box's diagonal)",
            closure.edges, closure.open, closure.turned
        ));
        return Ok(false);
    }
    // A shell has two surfaces, and is turned when it is grown.
    if is_shell {
        return Ok(true);
    }
    if volume < 0.0 {
        notices.push("the target is inside out; distances do not depend on it".to_string());
    }
    let [wanted, given] = [&closure.joined, template].map(euler_characteristic);
    if wanted != given {
        notices.push(format!(
            "the template's boundary has the Euler characteristic {given}, the target {wanted}: as they differ in holes or \
             pieces, no fit is one-to-one; carve the template accordingly"
        ));
    }
    Ok(true)
}

/// Fewest intervals between samples along an edge, where none are given.
const FEWEST_INTERVALS: usize = 2;

/// Intervals between samples along an edge that a quadrature of the order induces.
fn induced_intervals(order: usize) -> usize {
    if order == 1 { 1 } else { 2 * order - 2 }
}

/// Vertices less edges plus triangles, without points that no triangle uses.
fn euler_characteristic(surface: &TriangleMesh) -> i64 {
    let mut vertices: Vec<u32> = surface.cells.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let sides = surface.cells.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let mut edges: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    edges.sort_unstable();
    edges.dedup();
    vertices.len() as i64 - edges.len() as i64 + surface.cells.len() as i64
}
