//! The stages of a surface, one after the other: curves, their tangents, normals along them, patches, repair of folds.

use super::balance;
use super::continuity::larger;
use super::edge_normals::{self, Slopes};
use super::enclosure;
use super::hermite;
use super::least_squares;
use super::metrics;
use super::network::Network;
use super::outcome::{self, Shape};
use super::patch::{self, Fitted, Patch};
use super::problem::Problem;
use super::repair::{Repaired, repair};
use super::settings::{EdgeNormals, Geometry, Patches, RANK_TOLERANCE, Settings, Tangents};
use super::{COUNTERS, Failure};
use crate::linalg::vector3::{dot, subtract};
use crate::mesh::length;
use crate::optimize::Observer;
use rayon::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;

/// The patches of a problem, their network and what was found on the way.
pub struct Built {
    pub network: Network,
    pub patches: Vec<Patch>,
    pub metrics: outcome::Metrics,
    pub counters: BTreeMap<String, u64>,
    pub notices: Vec<String>,
    /// The word for a stop from outside.
    stopped: Option<String>,
    /// The residual of the conditions on tangents and normals, where it is too large.
    unmet: Option<f64>,
    /// Whether everything came out as it should, and a sentence; see [`Built::judge`].
    pub stop: String,
    pub reason: String,
}

/// Violations of the conditions above this show in the patches.
pub(super) const MET: f64 = 1e-10;
/// Angles between normals of neighbours, in degrees, that are no more than rounding.
const AGREEING: f64 = 1e-8;

/// Builds the patches of a problem.
///
/// # Errors
/// `invalid-input` for normals that do not fit the mesh.
pub fn build(problem: &Problem, settings: &Settings, observer: &mut dyn Observer) -> Result<Built, Failure> {
    observer.phase("curves");
    let mut building = Building::start(problem)?;
    let slopes = if settings.geometry == Geometry::G1 {
        building.adapt_tangents(settings, observer)?
    } else {
        None
    };
    building.tell_curves();
    let fitted = match settings.geometry {
        Geometry::Facets => facets(problem),
        Geometry::C0 => {
            observer.phase("patches");
            let operator = settings.operator();
            let network = &building.network;
            (0..network.quads.len())
                .into_par_iter()
                .map(|quad| patch::continuous(network, quad, operator))
                .collect()
        }
        Geometry::G1 => building.smooth(slopes, settings, observer)?,
    };
    Ok(building.finish(fitted))
}

/// A surface in the making.
struct Building {
    network: Network,
    /// Tangents of the natural cubics.
    natural: Vec<[[f64; 3]; 2]>,
    tangent_change: f64,
    metrics: outcome::Metrics,
    counters: BTreeMap<String, u64>,
    notices: Vec<String>,
    stopped: Option<String>,
    unmet: Option<f64>,
}

impl Building {
    /// The natural cubics.
    fn start(problem: &Problem) -> Result<Self, Failure> {
        let (network, found) = Network::creased(
            &problem.mesh,
            problem.connectivity.clone(),
            &problem.normals,
            problem.creases.as_ref(),
        )
        .map_err(Failure::invalid)?;
        let mut notices = problem.notices.clone();
        notices.extend(found);
        let mut building = Self {
            natural: network.tangents.clone(),
            network,
            tangent_change: 0.0,
            metrics: metrics::ALL
                .iter()
                .map(|metric| (metric.name.to_string(), f64::NAN))
                .collect(),
            counters: COUNTERS.iter().map(|(name, _)| (name.to_string(), 0)).collect(),
            notices,
            stopped: None,
            unmet: None,
        };
        building.count(problem);
        building.set("natural_energy", building.network.bending_energy());
        building.set("enclosure_natural", building.violation());
        Ok(building)
    }

    fn set(&mut self, name: &str, value: f64) {
        self.metrics.insert(name.to_string(), value);
    }

    fn violation(&self) -> f64 {
        let values = enclosure::violations(&self.network);
        values
            .into_iter()
            .fold(0.0, |worst: f64, value| larger(worst, value.abs()))
    }

    /// Counts of the mesh, and how well its curves and chords fit the tangent planes.
    fn count(&mut self, problem: &Problem) {
        let (mesh, connectivity) = problem.whole();
        let valences = connectivity.valences();
        let present = |&valence: &usize| valences[valence] > 0;
        self.set("quads", mesh.quads.len() as f64);
        self.set("vertices", mesh.points.len() as f64);
        self.set("edges", connectivity.edges.len() as f64);
        self.set("boundary_edges", connectivity.boundary_edges() as f64);
        self.set("valence_min", (0..valences.len()).find(present).unwrap_or(0) as f64);
        self.set("valence_max", (0..valences.len()).rfind(present).unwrap_or(0) as f64);
        let even = self.network.even_vertices() as f64;
        self.set("even_vertices", even);
        self.set("normal_rank_expected", 6.0 * self.network.tangents.len() as f64 - even);
        let creases = problem.creases.as_ref();
        self.set("crease_edges", creases.map_or(0, |creases| creases.pairs.len()) as f64);
        self.set("crease_corners", creases.map_or(0, |creases| creases.corners) as f64);
        self.set("crease_darts", creases.map_or(0, |creases| creases.darts) as f64);
        let (mut tangency, mut chords) = (0.0f64, 0.0f64);
        let network = &self.network;
        for (edge, ends) in network.connectivity.edges.iter().enumerate() {
            let [a, b] = ends.map(|vertex| network.points[vertex as usize]);
            let chord = subtract(b, a);
            for (end, &vertex) in ends.iter().enumerate() {
                let normal = network.normals[vertex as usize];
                let tangent = network.tangents[edge][end];
                tangency = larger(tangency, dot(tangent, normal).abs() / length(tangent));
                chords = larger(chords, dot(chord, normal).abs() / length(chord));
            }
        }
        self.set("curve_tangency", tangency);
        self.set("chord_tangency", chords);
    }

    /// Moves the tangents until patches can meet. Slopes of the normals come back where they were found together.
    fn adapt_tangents(&mut self, settings: &Settings, observer: &mut dyn Observer) -> Result<Option<Slopes>, Failure> {
        let (iterations, factorizations, residual, slopes);
        match settings.tangents {
            Tangents::Natural => return Ok(None),
            Tangents::Balanced => {
                let found = balance::balance(&mut self.network, settings.tangent_stiffness, None, observer)
                    .map_err(Failure::invalid)?;
                (iterations, factorizations, residual) = (found.iterations, found.factorizations, found.residual);
                self.tangent_change = found.largest_change;
                slopes = Some(found.slopes);
            }
            Tangents::Enclosing => {
                let found = enclosure::enclose(&mut self.network, observer).map_err(Failure::invalid)?;
                (iterations, factorizations, residual) = (found.iterations, found.factorizations, found.residual);
                self.tangent_change = found.largest_change;
                slopes = None;
            }
        }
        self.counters.insert("iterations".to_string(), iterations);
        self.counters.insert("factorizations".to_string(), factorizations);
        if let Some(why) = observer.stop() {
            self.stopped = Some(match serde_json::to_value(why) {
                Ok(Value::String(word)) => word,
                _ => "cancelled".to_string(),
            });
        } else if !(residual < MET) {
            self.unmet = Some(residual);
        }
        Ok(slopes)
    }

    /// What the curves are like with the tangents in use.
    fn tell_curves(&mut self) {
        self.set("tangent_change", self.tangent_change);
        self.set("curve_energy", self.network.bending_energy());
        self.set("enclosure", self.violation());
    }

    /// Normals along the curves and patches with these normals; patches that fold are repaired.
    fn smooth(
        &mut self,
        balanced: Option<Slopes>,
        settings: &Settings,
        observer: &mut dyn Observer,
    ) -> Result<Vec<Fitted>, Failure> {
        observer.phase("normals");
        let mut rank = None;
        let mut slopes = match (balanced, settings.edge_normals) {
            (Some(slopes), _) => slopes,
            (None, EdgeNormals::LeastSquares) => {
                let solved = least_squares::solve(&self.network, settings.rank_tolerance).map_err(Failure::invalid)?;
                rank = solved.rank;
                if rank.is_none() && settings.rank_tolerance != RANK_TOLERANCE {
                    self.notices.push(format!(
                        "rank_tolerance = {:e} is of no effect on more than {} curves: their normals are found by shifted steps, \
                         which leave out singular values far below 1e-6 of the largest",
                        settings.rank_tolerance,
                        least_squares::DENSE
                    ));
                }
                if let Some(change) = solved.unsettled {
                    self.notices.push(format!(
                        "the least squares for the normals did not settle: the last step changed them by {change:.1e}; \
                         normal_residual and twist_residual tell how far the equations are met"
                    ));
                }
                solved.slopes
            }
            (None, exact) => {
                edge_normals::exact(&self.network, exact == EdgeNormals::Shortest).map_err(Failure::invalid)?
            }
        };
        self.set("normal_rank", rank.map_or(f64::NAN, |rank| rank as f64));
        observer.phase("patches");
        let (solve, reference, operator) = (settings.solve(), settings.reference(), settings.operator());
        let fit = |network: &Network, slopes: &Slopes| -> Vec<Fitted> {
            (0..network.quads.len())
                .into_par_iter()
                .map(|quad| patch::fit(network, slopes, quad, solve, reference, operator))
                .collect()
        };
        let mut fitted = fit(&self.network, &slopes);
        if settings.repair {
            let stiffness = settings.tangent_stiffness;
            let Repaired {
                tries,
                change,
                kept,
                notice,
            } = repair(
                &mut self.network,
                &mut slopes,
                &mut fitted,
                &self.natural,
                stiffness,
                &fit,
                observer,
            );
            self.counters.insert("repairs".to_string(), tries);
            self.tangent_change = self.tangent_change.max(change);
            self.notices.extend(notice);
            if kept {
                self.unmet = None;
            }
        }
        self.tell_curves();
        let residuals = edge_normals::residuals(&self.network, &slopes);
        self.set("normal_residual", residuals.perpendicular);
        self.set("twist_residual", residuals.twist);
        self.set("normal_slope", residuals.largest);
        let most = |value: fn(&Fitted) -> f64| fitted.iter().map(value).fold(0.0, larger);
        self.set("patch_residual", most(|patch| patch.residual));
        self.set("patch_change", most(|patch| patch.change));
        self.set("patch_rank_max", most(|patch| patch.rank as f64));
        let least = fitted.iter().map(|patch| patch.rank).min().unwrap_or(0);
        self.set("patch_rank_min", least as f64);
        Ok(fitted)
    }

    fn finish(mut self, fitted: Vec<Fitted>) -> Built {
        self.set("node_energy_before", fitted.iter().map(|patch| patch.energy[0]).sum());
        self.set("node_energy", fitted.iter().map(|patch| patch.energy[1]).sum());
        self.set(
            "node_change",
            fitted.iter().map(|patch| patch.energy[1] - patch.energy[0]).sum(),
        );
        self.set("chord_distance", chord_distance(&self.network));
        Built {
            network: self.network,
            patches: fitted.into_iter().map(|fitted| fitted.patch).collect(),
            metrics: self.metrics,
            counters: self.counters,
            notices: self.notices,
            stopped: self.stopped,
            unmet: self.unmet,
            stop: "converged".to_string(),
            reason: "the patches are built".to_string(),
        }
    }
}

impl Built {
    /// Says how the construction ended, from what was measured on the patches.
    pub fn judge(&mut self, problem: &Problem, settings: &Settings, shape: &Shape) {
        let end = |built: &mut Self, stop: &str, reason: String| {
            built.stop = stop.to_string();
            built.reason = reason;
        };
        if let Some(word) = self.stopped.clone() {
            let reason = "stopped from outside before tangents and normals met their conditions";
            return end(self, &word, reason.to_string());
        }
        if let Some(first) = shape.first_folded {
            let vertices = problem.whole().0.quads[first];
            let reason = format!(
                "{} of {} patches fold, the first is patch {first} over the quadrilateral with vertices {vertices:?} (counted \
                 from 0): its normal turns against those of its corners; correct the normals there, or refine or smooth the mesh",
                shape.folded,
                self.patches.len()
            );
            return end(self, "folded", reason);
        }
        if settings.geometry != Geometry::G1 {
            return;
        }
        let metric = |name: &str| self.metrics.get(name).copied().unwrap_or(f64::NAN);
        let (angle, normal, twist) = (
            shape.continuity.largest,
            metric("normal_residual"),
            metric("twist_residual"),
        );
        let why = if settings.tangents == Tangents::Natural {
            "tangents of natural cubics do not meet the enclosure condition (tangents = \"enclosing\" do)"
        } else if settings.edge_normals == EdgeNormals::LeastSquares || settings.patches == Patches::Collocation {
            "least squares leave a part of the conditions open"
        } else {
            "smoother normals or fewer extreme corners would help"
        };
        if let Some(residual) = self.unmet {
            let reason = format!(
                "tangents and normals meet their conditions only to {residual:.1e}; normals of neighbouring patches differ by up \
                 to {angle:.1e} degrees; {why}"
            );
            end(self, "stalled", reason);
        } else if !(angle <= AGREEING && normal <= MET && twist <= MET) {
            let reason = format!(
                "normals of neighbouring patches differ by up to {angle:.1e} degrees; residual of the normals {normal:.1e}, of \
                 the twists {twist:.1e}; {why}"
            );
            end(self, "stalled", reason);
        }
    }
}

/// Bilinear patches.
fn facets(problem: &Problem) -> Vec<Fitted> {
    let fitted = |&quad: &[u32; 4]| Fitted {
        patch: patch::bilinear(problem.mesh.corners(quad)),
        rank: 0,
        residual: f64::NAN,
        change: f64::NAN,
        energy: [f64::NAN; 2],
    };
    problem.mesh.quads.iter().map(fitted).collect()
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
        away.fold(0.0, larger) / square.sqrt()
    };
    (0..network.tangents.len()).map(of_edge).fold(0.0, larger)
}
