//! G1 surfaces: biquartic patches with common tangent planes over any mesh of quadrilaterals with normals.
//!
//! The stages: [`problem`] reads the model, [`network`] spans natural cubics over the edges, [`enclosure`] moves their
//! tangents until surfaces of class C2 can meet at every vertex, [`edge_normals`] finds a cubic normal along every curve,
//! [`patch`] fits the patches, [`outcome`] measures them. Source: Xue, Demkowicz, Bajaj 2004, Reconstruction of G1 surfaces
//! with biquartic patches for hp finite element simulations.
//!
//! Guaranteed with the default settings, where the enclosure condition could be met (a metric tells): normals of
//! neighbouring patches agree along their whole edge to rounding, at vertices of every valence; patches share their curves
//! exactly; the same input gives the same bits with any number of threads. Not guaranteed: that the surface is free of
//! folds or does not meet itself.

pub mod balance;
pub mod continuity;
pub mod edge_normals;
pub mod enclosure;
pub mod hermite;
pub mod hexahedra;
pub mod laplace_beltrami;
pub mod least_squares;
pub mod metrics;
pub mod model;
pub mod network;
pub mod outcome;
pub mod patch;
pub mod problem;
pub mod sampled;
pub mod settings;
pub mod surface;
pub mod vertex_normals;

use super::model::ModelKind;
use super::setting::Field;
use super::{Failure, Inputs, Method, Outcome};
use crate::linalg::vector3::{dot, subtract};
use crate::mesh::length;
use crate::metric::Metric;
use crate::optimize::Observer;
use network::Network;
use patch::Fitted;
use problem::{Problem, Truth};
use rayon::prelude::*;
use serde_json::Value;
use settings::{EdgeNormals, Geometry, Settings, Tangents};
use std::collections::BTreeMap;

/// The method `g1-surface`.
pub struct G1Surface;

impl Method for G1Surface {
    fn name(&self) -> &'static str {
        "g1-surface"
    }

    fn version(&self) -> u32 {
        1
    }

    fn summary(&self) -> &'static str {
        "spans biquartic patches with common tangent planes over a quadrilateral mesh with normals"
    }

    fn source(&self) -> &'static str {
        "Reconstruction of G1 surfaces with biquartic patches for hp FE simulations, 13th International Meshing Roundtable, 2004"
    }

    fn model(&self) -> &'static ModelKind {
        model::kind()
    }

    fn settings(&self) -> &'static [Field] {
        settings::FIELDS
    }

    fn check(&self, settings: &Value) -> Vec<(String, String)> {
        settings::check(settings)
    }

    fn canonical(&self, settings: Value) -> Value {
        match Settings::resolve(&settings) {
            Ok(resolved) => resolved.canonical(),
            // Left as it is: running it will say what is wrong.
            Err(_) => settings,
        }
    }

    fn metrics(&self) -> &'static [Metric] {
        metrics::ALL
    }

    fn counters(&self) -> &'static [(&'static str, &'static str)] {
        COUNTERS
    }

    fn run(&self, inputs: Inputs<'_>, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
        let settings = Settings::resolve(inputs.settings)?;
        observer.phase("prepare");
        let problem = Problem::new(&inputs.model, &settings)?;
        run(&problem, &settings, observer)
    }
}

/// Names and meanings of the counters.
pub const COUNTERS: &[(&str, &str)] = &[
    (
        "iterations",
        "Newton steps on the tangents towards the enclosure condition",
    ),
    ("factorizations", "factorizations of their system"),
    (
        "repairs",
        "times that tangents were found anew around patches that fold",
    ),
];

/// The patches of a problem, their network and what was found on the way.
pub struct Built {
    pub network: Network,
    pub patches: Vec<patch::Patch>,
    pub metrics: outcome::Metrics,
    pub counters: BTreeMap<String, u64>,
    pub notices: Vec<String>,
    /// Whether everything came out as it should, and a sentence.
    pub stop: String,
    pub reason: String,
}

/// Violations of the conditions above this show in the patches.
const MET: f64 = 1e-10;

/// Builds the patches of a problem.
///
/// # Errors
/// `invalid-input` for normals that do not fit the mesh.
pub fn build(problem: &Problem, settings: &Settings, observer: &mut dyn Observer) -> Result<Built, Failure> {
    observer.phase("curves");
    let mut metrics: outcome::Metrics = metrics::ALL
        .iter()
        .map(|metric| (metric.name.to_string(), f64::NAN))
        .collect();
    let mut set = |name: &str, value: f64| {
        metrics.insert(name.to_string(), value);
    };
    let mut notices = problem.notices.clone();
    let (mut network, found) =
        Network::natural(&problem.mesh, problem.connectivity.clone(), &problem.normals).map_err(problem::invalid)?;
    notices.extend(found);
    let mut counters: BTreeMap<String, u64> = COUNTERS.iter().map(|(name, _)| (name.to_string(), 0)).collect();
    let (mut stop, mut reason) = ("converged".to_string(), "the patches are built".to_string());
    count(&network, &mut set);
    let violation = |network: &Network| {
        let values = enclosure::violations(network);
        values.into_iter().fold(0.0, |worst: f64, value| worst.max(value.abs()))
    };
    let natural = network.tangents.clone();
    set("natural_energy", network.bending_energy());
    set("enclosure_natural", violation(&network));
    let mut tangent_change = 0.0;
    let mut balanced = None;
    if settings.geometry == Geometry::G1 && settings.tangents != Tangents::Natural {
        let (iterations, factorizations, residual);
        if settings.tangents == Tangents::Balanced {
            let found =
                balance::balance(&mut network, settings.tangent_stiffness, None, observer).map_err(problem::invalid)?;
            (iterations, factorizations, residual) = (found.iterations, found.factorizations, found.residual);
            tangent_change = found.largest_change;
            balanced = Some(found.slopes);
        } else {
            let found = enclosure::enclose(&mut network, observer).map_err(problem::invalid)?;
            (iterations, factorizations, residual) = (found.iterations, found.factorizations, found.residual);
            tangent_change = found.largest_change;
        }
        counters.insert("iterations".to_string(), iterations);
        counters.insert("factorizations".to_string(), factorizations);
        if let Some(why) = observer.stop() {
            stop = match serde_json::to_value(why) {
                Ok(Value::String(word)) => word,
                _ => "cancelled".to_string(),
            };
            reason = "stopped from outside before tangents and normals met their conditions".to_string();
        } else if !(residual < MET) {
            stop = "stalled".to_string();
            reason = format!(
                "tangents and normals meet their conditions only to {residual:.1e}: normals of neighbouring patches differ by \
                 about as much; smoother normals or fewer extreme corners would help"
            );
        }
    }
    set("tangent_change", tangent_change);
    set("curve_energy", network.bending_energy());
    set("enclosure", violation(&network));

    let fitted: Vec<Fitted> = match settings.geometry {
        Geometry::Facets => problem
            .mesh
            .quads
            .iter()
            .map(|&quad| Fitted {
                patch: patch::bilinear(problem.mesh.corners(quad)),
                rank: 0,
                residual: f64::NAN,
                change: f64::NAN,
                energy: [f64::NAN; 2],
            })
            .collect(),
        Geometry::C0 => {
            observer.phase("patches");
            let operator = settings.operator();
            (0..network.quads.len())
                .into_par_iter()
                .map(|quad| patch::continuous(&network, quad, operator))
                .collect()
        }
        Geometry::G1 => {
            observer.phase("normals");
            let mut rank = None;
            let slopes = match settings.edge_normals {
                _ if balanced.is_some() => balanced.take().unwrap_or_default(),
                EdgeNormals::LeastSquares => {
                    let solved = least_squares::solve(&network, settings.rank_tolerance).map_err(problem::invalid)?;
                    rank = solved.rank;
                    solved.slopes
                }
                exact => edge_normals::exact(&network, exact == EdgeNormals::Shortest).map_err(problem::invalid)?,
            };
            set("normal_rank", rank.map_or(f64::NAN, |rank| rank as f64));
            observer.phase("patches");
            let (solve, reference, operator) = (settings.solve(), settings.reference(), settings.operator());
            let fit = |network: &Network, slopes: &edge_normals::Slopes| -> Vec<Fitted> {
                (0..network.quads.len())
                    .into_par_iter()
                    .map(|quad| patch::fit(network, slopes, quad, solve, reference, operator))
                    .collect()
            };
            let mut fitted = fit(&network, &slopes);
            let mut slopes = slopes;
            let mut repairs = 0;
            while settings.repair && repairs < REPAIRS && observer.stop().is_none() {
                let folded: Vec<bool> = fitted
                    .par_iter()
                    .zip(&network.quads)
                    .map(|(fitted, quad)| {
                        outcome::folds(&fitted.patch, quad.map(|vertex| network.normals[vertex as usize]))
                    })
                    .collect();
                if !folded.contains(&true) {
                    break;
                }
                observer.phase("repair");
                repairs += 1;
                let start = balance::Start {
                    slopes: &slopes,
                    active: around(&network, folded, repairs),
                    natural: natural.clone(),
                };
                let mut changed = network.clone();
                let balanced = balance::balance(&mut changed, settings.tangent_stiffness, Some(start), observer);
                let found = match balanced {
                    Ok(found) => found,
                    Err(error) => {
                        notices.push(format!(
                            "folded patches are left as they are, their repair failed: {error}"
                        ));
                        break;
                    }
                };
                if !(found.residual < MET) {
                    continue;
                }
                let tried = fit(&changed, &found.slopes);
                (network, slopes, fitted) = (changed, found.slopes, tried);
                tangent_change = tangent_change.max(found.largest_change);
            }
            counters.insert("repairs".to_string(), repairs as u64);
            set("tangent_change", tangent_change);
            set("curve_energy", network.bending_energy());
            set("enclosure", violation(&network));
            let residuals = edge_normals::residuals(&network, &slopes);
            set("normal_residual", residuals.perpendicular);
            set("twist_residual", residuals.twist);
            set("normal_slope", residuals.largest);
            let most = |value: fn(&Fitted) -> f64| fitted.iter().map(value).fold(0.0, f64::max);
            set("patch_residual", most(|patch| patch.residual));
            set("patch_change", most(|patch| patch.change));
            set("patch_rank_max", most(|patch| patch.rank as f64));
            let least = fitted.iter().map(|patch| patch.rank).min().unwrap_or(0);
            set("patch_rank_min", least as f64);
            fitted
        }
    };
    set("node_energy_before", fitted.iter().map(|patch| patch.energy[0]).sum());
    set("node_energy", fitted.iter().map(|patch| patch.energy[1]).sum());
    set(
        "node_change",
        fitted.iter().map(|patch| patch.energy[1] - patch.energy[0]).sum(),
    );
    set("chord_distance", chord_distance(&network));
    Ok(Built {
        network,
        patches: fitted.into_iter().map(|fitted| fitted.patch).collect(),
        metrics,
        counters,
        notices,
        stop,
        reason,
    })
}

/// The largest distance of a curve from its chord, over the length of the chord.
fn chord_distance(network: &Network) -> f64 {
    let places: Vec<[f64; 5]> = (0..=64).map(|index| hermite::values(f64::from(index) / 64.0)).collect();
    let of_edge = |edge: usize| {
        let curve = network.curve(edge);
        let chord = subtract(curve[1], curve[0]);
        let square = dot(chord, chord);
        let away = places.iter().map(|place| {
            let from_start = subtract(hermite::combine(place, &curve), curve[0]);
            let share = (dot(from_start, chord) / square).clamp(0.0, 1.0);
            length(subtract(from_start, chord.map(|component| share * component)))
        });
        away.fold(0.0, f64::max) / square.sqrt()
    };
    (0..network.tangents.len()).map(of_edge).fold(0.0, f64::max)
}

/// Times that tangents are found anew around folds, each within a wider neighbourhood.
const REPAIRS: usize = 4;

/// The edges of the marked patches and of those within so many rings of them.
fn around(network: &Network, mut marked: Vec<bool>, rings: usize) -> Vec<bool> {
    for _ in 0..rings {
        let mut at = vec![false; network.points.len()];
        for (quad, _) in network.quads.iter().zip(&marked).filter(|(_, marked)| **marked) {
            for &vertex in quad {
                at[vertex as usize] = true;
            }
        }
        for (quad, mark) in network.quads.iter().zip(&mut marked) {
            *mark |= quad.iter().any(|&vertex| at[vertex as usize]);
        }
    }
    let mut edges = vec![false; network.tangents.len()];
    for (sides, _) in network
        .connectivity
        .quad_edges
        .iter()
        .zip(&marked)
        .filter(|(_, marked)| **marked)
    {
        for &edge in sides {
            edges[edge as usize] = true;
        }
    }
    edges
}

/// Counts of the mesh, and how well its curves and chords fit the tangent planes.
fn count(network: &Network, set: &mut dyn FnMut(&str, f64)) {
    let connectivity = &network.connectivity;
    let valences = connectivity.valences();
    let present = |&valence: &usize| valences[valence] > 0;
    set("quads", network.quads.len() as f64);
    set("vertices", network.points.len() as f64);
    set("edges", connectivity.edges.len() as f64);
    set("boundary_edges", connectivity.boundary_edges() as f64);
    set("even_vertices", network.even_vertices() as f64);
    set("valence_min", (0..valences.len()).find(present).unwrap_or(0) as f64);
    set("valence_max", (0..valences.len()).rfind(present).unwrap_or(0) as f64);
    set(
        "normal_rank_expected",
        6.0 * connectivity.edges.len() as f64 - network.even_vertices() as f64,
    );
    let (mut tangency, mut chords) = (0.0f64, 0.0f64);
    for (edge, ends) in connectivity.edges.iter().enumerate() {
        let [a, b] = ends.map(|vertex| network.points[vertex as usize]);
        let chord = subtract(b, a);
        for (end, &vertex) in ends.iter().enumerate() {
            let normal = network.normals[vertex as usize];
            let tangent = network.tangents[edge][end];
            tangency = tangency.max(dot(tangent, normal).abs() / length(tangent));
            chords = chords.max(dot(chord, normal).abs() / length(chord));
        }
    }
    set("curve_tangency", tangency);
    set("chord_tangency", chords);
}

/// Builds, measures and tessellates the surface of a problem.
pub fn run(problem: &Problem, settings: &Settings, observer: &mut dyn Observer) -> Result<Outcome, Failure> {
    let mut built = build(problem, settings, observer)?;
    observer.phase("measure");
    let continuity = outcome::measure(problem, &built.network.normals, &built.patches, &mut built.metrics);
    built
        .metrics
        .insert("edge_length".to_string(), outcome::mean_edge(problem));
    let metrics = &mut built.metrics;
    if settings.order > 0 {
        observer.phase("simulate");
        let Some(Truth::Analytic(exact)) = &problem.truth else {
            return Err(problem::invalid(
                "the test problem needs a surface given by a formula; use a generated mesh, or order = 0".to_string(),
            ));
        };
        let (quads, connectivity) = (&problem.mesh.quads, &problem.connectivity);
        let solved = laplace_beltrami::solve(&built.patches, quads, connectivity, exact, settings.order as usize)
            .map_err(problem::invalid)?;
        metrics.insert("l2_error".to_string(), solved.error);
        metrics.insert("gradient_error".to_string(), solved.gradient_error);
        metrics.insert("unknowns".to_string(), solved.unknowns as f64);
    }
    let mut other = (settings.result == "control-points").then(|| outcome::control_nets(&built.patches));
    if let Some(shell) = settings.shell() {
        observer.phase("hexahedra");
        let found = hexahedra::build(problem, &built.patches, shell, settings.layers as usize, observer)
            .map_err(problem::invalid)?;
        for (name, value) in [
            ("hexahedra_count", found.cells.len() as f64),
            (
                "jacobian_min",
                found.scaled.iter().copied().fold(f64::INFINITY, f64::min),
            ),
            ("jacobian_certified", found.positive as f64),
            ("jacobian_not_positive", found.not_positive as f64),
            ("jacobian_undecided", found.undecided as f64),
            ("jacobian_bound", found.bound),
            ("hexahedra_volume", found.volume),
        ] {
            metrics.insert(name.to_string(), value);
        }
        let pieces = outcome::pieces(settings, found.cells.len()).min(6);
        other = other.or_else(|| Some(hexahedra::tessellate(&found, pieces)));
    }
    let mesh = other.unwrap_or_else(|| {
        outcome::tessellate(
            &built.patches,
            &problem.connectivity,
            &problem.mesh.quads,
            &continuity,
            outcome::pieces(settings, built.patches.len()),
            settings.stripes,
        )
    });
    Ok(Outcome {
        stop: built.stop,
        reason: built.reason,
        metrics: built.metrics,
        traces: BTreeMap::new(),
        counters: built.counters,
        notices: built.notices,
        mesh: Some(mesh),
        files: Default::default(),
    })
}
