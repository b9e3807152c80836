//! A computation from start to end: domain, conditions, system, solution, measurement.

use super::domain::{Domain, Place};
use super::factorization::Accuracy;
use super::function::{self, Function};
use super::metrics;
use super::model::Model;
use super::planar_data::{self, Derivatives};
use super::scheme::{Data, Discretization, Scheme};
use super::settings::{Condition, DataKind, Fill, ONE_FIELD, Settings, Solver};
use super::singular;
use super::surface_study;
use super::system::{System, mixed_nullity};
use crate::fem::surface::{SurfaceOperators, mean_edge_length};
use crate::mesh::format::{Cells, vtu};
use crate::mesh::{TriangleMesh, cross, dot, length, subtract};
use crate::method::{Failure, Outcome};
use crate::optimize::Observer;
use std::collections::BTreeMap;

/// Ends a computation that is to stop.
pub(super) fn go_on(observer: &dyn Observer) -> Result<(), Failure> {
    match observer.stop() {
        None => Ok(()),
        Some(stop) => Err(Failure {
            kind: match serde_json::to_value(stop) {
                Ok(serde_json::Value::String(word)) => word,
                _ => "cancelled".to_string(),
            },
            reason: "stopped from outside before the system was solved; nothing was measured".to_string(),
        }),
    }
}

/// Runs a computation.
///
/// # Errors
/// For input that cannot be used, singular systems, and when the observer asks to stop.
pub fn run(model: Model, settings: &Settings, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
    let function = function::find(&settings.function)
        .ok_or_else(|| Failure::invalid(format!("unknown function \"{}\"", settings.function)))?;
    let plain = settings.handles.is_none() && settings.fill == Fill::None;
    match settings.data {
        DataKind::Function => function_study(model, function, settings, observer),
        DataKind::Auto if plain && model.is_planar() => function_study(model, function, settings, observer),
        _ => surface_study::run(model, settings, observer),
    }
}

/// Vertices off the boundary of the domain.
fn interior(mesh: &TriangleMesh, inside: &[bool]) -> Vec<bool> {
    let facets = crate::mesh::connectivity::facets(&mesh.cells, mesh.points.len());
    let mut free = vec![false; mesh.points.len()];
    for (cell, _) in mesh.cells.iter().zip(inside).filter(|(_, inside)| **inside) {
        cell.iter().for_each(|&vertex| free[vertex as usize] = true);
    }
    for (index, (cell, neighbours)) in mesh.cells.iter().zip(&facets.neighbours).enumerate() {
        for (corner, &neighbour) in neighbours.iter().enumerate() {
            let beyond = inside.get(neighbour as usize).copied().unwrap_or(false);
            if !inside[index] || !beyond {
                free[cell[(corner + 1) % 3] as usize] = false;
                free[cell[(corner + 2) % 3] as usize] = false;
            }
        }
        if !inside[index] {
            cell.iter().for_each(|&vertex| free[vertex as usize] = false);
        }
    }
    free
}

/// Smallest angle of a triangle in degrees.
fn minimum_angle(mesh: &TriangleMesh) -> f64 {
    mesh.cells
        .iter()
        .flat_map(|&cell| {
            let corners = mesh.corners(cell);
            (0..3).map(move |i| {
                let (a, b) = (
                    subtract(corners[(i + 1) % 3], corners[i]),
                    subtract(corners[(i + 2) % 3], corners[i]),
                );
                length(cross(a, b)).atan2(dot(a, b)).to_degrees()
            })
        })
        .fold(f64::INFINITY, f64::min)
}

/// Solves for a function of the plane and measures the errors.
fn function_study(
    model: Model,
    function: &'static Function,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<Outcome, Failure> {
    if !model.is_planar() {
        return Err(Failure::invalid(
            "data = \"function\" needs a mesh in the plane, whose points have one and the same third coordinate; use \
             data = \"position\" or \"displacement\" on a surface"
                .to_string(),
        ));
    }
    let mesh = &model.mesh;
    let order = settings.order();
    let inside = match (&model.inside, settings.condition) {
        (Some(inside), _) => inside.clone(),
        (None, _) => vec![true; mesh.cells.len()],
    };
    let mut free = interior(mesh, &inside);
    if model.inside.is_none() && settings.condition == Condition::Region {
        // A file: its outermost rings are the fixed region.
        shrink(mesh, &mut free, order - 1);
    }
    let inside: Vec<bool> = match settings.condition {
        Condition::Curve => inside,
        Condition::Region if model.inside.is_some() => inside,
        Condition::Region => touching(mesh, &free),
    };
    let domain = Domain::new(mesh, inside, &free)?;
    let derivatives = Derivatives::of(function);
    let data = planar_data::sample(&domain, function, &derivatives, order);
    let mut report = Report::new(&model, &domain);
    report.singular(&domain, settings)?;
    go_on(observer)?;
    let values = match solve(&domain, &data, settings, &mut report, observer) {
        // Asked to go on, a job without a solution still tells the nullity.
        Err(failure) if failure.kind == "singular" && settings.goes_on_singular() => {
            return Ok(Outcome {
                stop: failure.kind,
                reason: failure.reason,
                mesh: None,
                ..report.outcome(Vec::new())
            });
        }
        solved => solved?,
    };
    observer.phase("measure");
    let errors = planar_data::errors(&domain, function, &values);
    report.set("l2_error", errors.l2);
    report.set("h1_error", errors.h1);
    report.set("max_error", errors.max);
    let lifted: Vec<[f64; 3]> = mesh
        .points
        .iter()
        .zip(&values)
        .map(|(point, &value)| [point[0], point[1], value])
        .collect();
    let over = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let mean = |cell: &[u32; 3]| cell.iter().map(|&vertex| of(vertex as usize)).sum::<f64>() / 3.0;
        mesh.cells.iter().map(mean).collect()
    };
    let difference = over(&|vertex| {
        let point = mesh.points[vertex];
        values[vertex] - function.value([point[0], point[1]])
    });
    let solution = over(&|vertex| values[vertex]);
    let inside: Vec<f64> = domain
        .inside
        .iter()
        .map(|&inside| f64::from(u8::from(inside)))
        .collect();
    let picture = vtu::write(
        &lifted,
        Cells {
            triangles: &mesh.cells,
            ..Cells::default()
        },
        &[("solution", 1, &values)],
        &[
            ("error", 1, &difference),
            ("solution", 1, &solution),
            ("domain", 1, &inside),
        ],
    );
    Ok(report.outcome(picture))
}

/// Triangles with a free vertex.
pub(super) fn touching(mesh: &TriangleMesh, free: &[bool]) -> Vec<bool> {
    mesh.cells
        .iter()
        .map(|cell| cell.iter().any(|&vertex| free[vertex as usize]))
        .collect()
}

/// Takes the outermost free vertices away, ring by ring.
pub(super) fn shrink(mesh: &TriangleMesh, free: &mut [bool], rings: usize) {
    for _ in 0..rings {
        let before = free.to_vec();
        for cell in &mesh.cells {
            if cell.iter().any(|&vertex| !before[vertex as usize]) {
                cell.iter().for_each(|&vertex| free[vertex as usize] = false);
            }
        }
    }
}

/// Discretizes, factorizes and solves; `u` at every vertex.
fn solve(
    domain: &Domain<'_>,
    data: &Data<'_>,
    settings: &Settings,
    report: &mut Report,
    observer: &mut dyn Observer,
) -> Result<Vec<f64>, Failure> {
    observer.phase("assemble");
    let scheme = settings.scheme();
    let selected = if scheme.on_domain() {
        domain.inside.clone()
    } else {
        vec![true; domain.mesh.cells.len()]
    };
    let operators = SurfaceOperators::on_graph(domain.mesh, &domain.graph, &selected)
        .map_err(|error| Failure::invalid(format!("mesh: {error}")))?;
    let discretization = Discretization::new(
        domain,
        &operators,
        scheme,
        settings.order(),
        settings.mass,
        settings.stabilisation(),
        data,
    )?;
    if scheme == Scheme::Unstabilised
        && let Some(nullity) = mixed_nullity(&discretization)
    {
        report.set("nullity", nullity as f64);
    }
    let one_field = settings.one_field();
    let mut system = System::new(&discretization, one_field, settings.solver, observer)?;
    go_on(observer)?;
    let solution = system.solve(&discretization, observer)?;
    report.system(&system, solution.accuracy);
    report.count("solutions", data.components as u64);
    compare(&discretization, &solution.values, settings, report, observer)?;
    Ok(solution.values)
}

/// Solves by the other system and reports the difference, where the settings ask for it.
pub(super) fn compare(
    discretization: &Discretization<'_>,
    values: &[f64],
    settings: &Settings,
    report: &mut Report,
    observer: &mut dyn Observer,
) -> Result<(), Failure> {
    if settings.compare && !settings.has_one_field() {
        report.note(format!("no comparison: the one-field system needs {ONE_FIELD}"));
    } else if settings.compare {
        observer.phase("compare");
        let solved = System::new(
            discretization,
            !settings.one_field(),
            Solver::Auto,
            &mut Quiet(observer),
        )
        .and_then(|mut other| {
            let compared = other.solve(discretization, &mut Quiet(observer))?;
            Ok((other, compared))
        });
        let (other, compared) = match solved {
            Err(failure) if failure.kind == "singular" => {
                report.note(format!(
                    "the system to compare with has no solution: {}",
                    failure.reason
                ));
                return Ok(());
            }
            solved => solved?,
        };
        if !(compared.accuracy.forward < INACCURATE) {
            report.note(format!(
                "the system to compare with, solved by {}, is so ill-conditioned that rounding alone may change its solution \
                 by {:.0e} of its size; most of \"difference\" may be that",
                other.solver(),
                compared.accuracy.forward
            ));
        }
        report.count("factorizations", other.factorizations);
        report.count("solutions", discretization.components as u64);
        let size = values.iter().fold(0.0, |size: f64, value| size.max(value.abs()));
        let difference = values
            .iter()
            .zip(&compared.values)
            .fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()));
        report.set("difference", difference / size);
    }
    Ok(())
}

/// Passes everything on but phases.
pub(super) struct Quiet<'a>(pub &'a mut dyn Observer);

impl Observer for Quiet<'_> {
    fn phase(&mut self, _name: &str) {}
    fn iterate(&mut self, iterate: &crate::optimize::Iterate) {
        self.0.iterate(iterate);
    }
    fn stop(&self) -> Option<crate::optimize::StopReason> {
        self.0.stop()
    }
}

/// A larger share of rounding in a solution is told.
const INACCURATE: f64 = 1e-6;

/// What is reported of a computation.
pub(super) struct Report {
    metrics: BTreeMap<String, f64>,
    counters: BTreeMap<String, u64>,
    notices: Vec<String>,
    reason: String,
}

impl Report {
    pub(super) fn new(model: &Model, domain: &Domain<'_>) -> Self {
        let mut report = Self {
            metrics: metrics::ALL
                .iter()
                .map(|metric| (metric.name.to_string(), f64::NAN))
                .collect(),
            counters: metrics::COUNTERS
                .iter()
                .map(|(name, _)| (name.to_string(), 0))
                .collect(),
            notices: model.notices.clone(),
            reason: String::new(),
        };
        let mesh = domain.mesh;
        report.set("h", mean_edge_length(mesh));
        report.set("minimum_angle", minimum_angle(mesh));
        report.set("vertices", mesh.points.len() as f64);
        report.set("triangles", mesh.cells.len() as f64);
        report.set("free_vertices", domain.count(Place::Interior) as f64);
        report.set("boundary_vertices", domain.count(Place::Boundary) as f64);
        report
    }

    pub(super) fn set(&mut self, name: &str, value: f64) {
        self.metrics.insert(name.to_string(), value);
    }

    pub(super) fn note(&mut self, notice: String) {
        self.notices.push(notice);
    }

    pub(super) fn count(&mut self, name: &str, more: u64) {
        *self.counters.entry(name.to_string()).or_default() += more;
    }

    /// Looks for the configurations of Proposition 2 where curve conditions are given.
    pub(super) fn singular(&mut self, domain: &Domain<'_>, settings: &Settings) -> Result<(), Failure> {
        if settings.condition == Condition::Region || settings.order() == 2 {
            return Ok(());
        }
        let found = singular::find(domain);
        self.set("singular_pairs", found.pairs.len() as f64);
        self.set("nullity_bound", found.unmatched as f64);
        if settings.scheme() != Scheme::Unstabilised || found.unmatched == 0 {
            return Ok(());
        }
        let pairs: Vec<String> = found
            .pairs
            .iter()
            .take(5)
            .map(|(a, b, only)| format!("{a} and {b} meet no free vertex but {only}"))
            .collect();
        let named = if pairs.is_empty() {
            String::new()
        } else {
            format!(
                "; {} pairs of boundary vertices share their only free neighbour, among them {} (counted from 0)",
                found.pairs.len(),
                pairs.join(", ")
            )
        };
        let sentence = format!(
            "system (15) is singular (Proposition 2): the {} boundary rows reach {} vertices of the first inner ring, at \
             least {} rows too many{named}",
            found.rows, found.ring, found.unmatched
        );
        // Only a lumped mass keeps the unknown v out of the boundary rows.
        let certain = settings.mass != super::scheme::Mass::Full;
        if certain && !settings.goes_on_singular() {
            return Err(Failure {
                kind: "singular".to_string(),
                reason: format!("{sentence}; use curve = \"stabilised\" or \"second-order-ring\""),
            });
        }
        self.notices.push(sentence);
        Ok(())
    }

    pub(super) fn system(&mut self, system: &System, accuracy: Accuracy) {
        self.set("residual", accuracy.backward);
        self.set("rounding", accuracy.forward);
        self.set("unknowns", system.unknowns() as f64);
        self.set("matrix_entries", system.matrix_entries() as f64);
        self.set(
            "factor_entries",
            system.factor_entries().map_or(f64::NAN, |entries| entries as f64),
        );
        self.count("factorizations", system.factorizations);
        self.count("fallbacks", system.broken.len() as u64);
        if !system.broken.is_empty() {
            self.notices.push(format!(
                "{} broke down and {} took its place",
                system.broken.join(", then "),
                system.solver()
            ));
        }
        if !(accuracy.forward < INACCURATE) {
            self.notices.push(format!(
                "the system is so ill-conditioned that rounding alone may change the solution by {:.0e} of its size; look for \
                 very thin triangles",
                accuracy.forward
            ));
        }
        self.reason = format!(
            "solved by {} with backward error {:.1e}",
            system.solver(),
            accuracy.backward
        );
    }

    pub(super) fn outcome(self, mesh: Vec<u8>) -> Outcome {
        Outcome {
            stop: "converged".to_string(),
            reason: self.reason,
            metrics: self.metrics,
            counters: self.counters,
            notices: self.notices,
            mesh: Some(mesh),
            files: Default::default(),
            ..Outcome::default()
        }
    }
}
