//! What is reported of a fit: metrics, traces, the picture and the files.

use super::fit::Fit;
use super::validity::Certificates;
use super::{TRACES, distances, picture, quality, shell};
use crate::fem::space::Space;
use crate::method::{Failure, Outcome, Traces};
use crate::optimize::{Observer, StopReason};
use std::collections::BTreeMap;

/// Distances from here on, in per cent of the diagonal, are told.
const POOR: f64 = 3.0;

impl Fit<'_> {
    pub(super) fn finish(
        &mut self,
        stop: StopReason,
        reason: String,
        inverted_at_start: usize,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, Failure> {
        observer.phase("measure");
        let quality = quality::quality(&self.space, &self.references, &self.x)?;
        let mut metrics = BTreeMap::new();
        distances::measure_boundary(
            &self.volume,
            &self.topology,
            &self.space,
            &self.x,
            &self.target,
            &mut metrics,
            &|| observer.stop().is_some(),
        )?;
        for name in ["thickness_error_mean", "thickness_error_rms", "thickness_error_max"] {
            metrics.insert(name.to_string(), f64::NAN);
        }
        if let Some(shell) = &self.shell {
            shell::measure(shell, &self.x, &mut metrics);
        }
        let cells = self.volume.cells();
        let flags: Vec<bool> = quality.least_determinant.iter().map(|det| !(*det > 0.0)).collect();
        let certificates = match self.certificates.take() {
            Some(known) => known,
            None => Certificates::of_all(&self.space, &self.references, &self.x, observer),
        };
        let mut set = |name: &str, value: f64| {
            metrics.insert(name.to_string(), value);
        };
        let flags: Vec<bool> = flags
            .iter()
            .enumerate()
            .map(|(cell, flag)| *flag || certificates.fails(cell))
            .collect();
        set("scaled_jacobian_mean", mean(&quality.scaled_jacobian_mean));
        set("scaled_jacobian_min", least(&quality.scaled_jacobian_min));
        set("inverted", flags.iter().filter(|flag| **flag).count() as f64);
        set("min_determinant", least(&quality.least_determinant));
        set(
            "max_determinant",
            -least(&quality.largest_determinant.iter().map(|det| -det).collect::<Vec<_>>()),
        );
        set("determinant_spread", quality.spread);
        let [certified, _, undecided] = certificates.counts();
        set("certified", certified as f64);
        set("undecided", undecided as f64);
        set("certified_determinant", certificates.bound());
        let ever = self.rows.iter().map(|row| row[7]).fold(f64::INFINITY, f64::min);
        set("least_determinant_ever", if ever.is_finite() { ever } else { f64::NAN });
        set("energy_surface", self.last.surface);
        set("energy_volume", self.last.volume);
        set("energy", self.last.total(self.lambda));
        set("increases", self.increases as f64);
        set("nodes", self.space.nodes as f64);
        let highest = self.space.highest_order();
        let most = self.settings.adaptive.map_or(highest, |adaptive| adaptive.most);
        let full = Space::new(&self.volume, &self.topology, self.settings.basis, &vec![most; cells])
            .map_err(Failure::invalid)?;
        set("node_share", 100.0 * self.space.nodes as f64 / full.nodes as f64);
        set(
            "order_mean",
            self.space.orders.iter().sum::<usize>() as f64 / cells as f64,
        );
        set("order_max", highest as f64);
        set("elements", cells as f64);
        set("hexahedra", self.volume.hexahedra.len() as f64);
        set("prisms", self.volume.prisms.len() as f64);
        set("tetrahedra", self.volume.tetrahedra.len() as f64);
        set("stages", self.stages as f64);
        set("inverted_at_start", inverted_at_start as f64);
        self.notices.extend(certificates.notices());
        let hausdorff = metrics["hausdorff"];
        if hausdorff > POOR && self.shell.is_none() {
            let far = match self.settings.stages.first() {
                Some(stage) if stage.lambda > 10.0 => ", lower lambda in the far phase",
                _ => "",
            };
            self.notices.push(format!(
                "the fitted boundary and the target are up to {hausdorff:.1} % of the diagonal apart; raise the order or \
                 iteration_limit{far}, or use more elements or a template more like it"
            ));
        }
        let given: Vec<f64> = self
            .x
            .chunks_exact(3)
            .enumerate()
            .flat_map(|(node, values)| {
                let middle = if node < self.space.vertices {
                    self.middle
                } else {
                    [0.0; 3]
                };
                [0, 1, 2].map(|axis| values[axis] * self.unit + middle[axis])
            })
            .collect();
        let fields = [
            ("scaled_jacobian", quality.scaled_jacobian_mean.clone()),
            ("scaled_jacobian_min", quality.scaled_jacobian_min.clone()),
            ("order", self.space.orders.iter().map(|&order| order as f64).collect()),
            ("determinant_min", quality.least_determinant.clone()),
            (
                "inverted",
                flags.iter().map(|&flag| f64::from(u8::from(flag))).collect(),
            ),
            ("element", (0..cells).map(|cell| cell as f64).collect()),
        ];
        let files = self.files(&given, &fields)?;
        let picture = picture::picture(&self.space, &self.references, &given, &self.volume, &fields)?;
        let traces: Traces = TRACES
            .iter()
            .enumerate()
            .map(|(column, (name, _))| (name.to_string(), self.rows.iter().map(|row| row[column]).collect()))
            .collect();
        let stop = serde_json::to_value(stop)
            .ok()
            .and_then(|word| word.as_str().map(str::to_owned))
            .unwrap_or_default();
        Ok(Outcome {
            stop,
            reason,
            metrics,
            traces,
            counters: std::mem::take(&mut self.counters),
            notices: std::mem::take(&mut self.notices),
            mesh: Some(picture),
            files,
        })
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}
