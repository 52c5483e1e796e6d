//! Bounds on the cost of a plan from its stop rules.

use std::collections::BTreeSet;

use super::{Plan, ReferenceSource};
use crate::experiment::memory::{layer_and_bin_bytes, run_bytes};
use crate::experiment::outcome::CellRef;
use crate::experiment::stop::StopRule;
use lumbre_render::Settings;

/// Bounds on the work of a plan. Every run is in exactly one of `by_time`, `by_samples` and
/// `unbounded`.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Number of runs with a limit on render time.
    pub by_time: usize,
    /// Sum of those limits in seconds: an upper bound of the render time.
    pub seconds: f64,
    /// Number of runs with a sample limit but no time limit.
    pub by_samples: usize,
    /// Upper bound of the camera paths of those runs. Dividing by a machine's paths per second
    /// gives a time.
    pub paths: f64,
    /// Number of runs without either limit.
    pub unbounded: usize,
    /// Greatest number of bytes of the layers and time bins of one run.
    pub layer_bytes: u64,
    /// Greatest number of bytes of one run: film, layers, time bins and buffers of measuring.
    pub run_bytes: u64,
    /// Greatest number of interleaved runs; 0 if none are.
    pub interleaved_runs: usize,
    /// Greatest total number of bytes of interleaved runs.
    pub interleaved_bytes: u64,
}

impl Plan {
    /// Settings and stop rules of the cells and references for which `counts` is true, each run
    /// once, without references from files.
    pub(crate) fn runs(
        &self,
        counts: &dyn Fn(CellRef) -> bool,
    ) -> impl Iterator<Item = (&Settings, &StopRule)> {
        let references = self.references.iter().enumerate();
        let references = references.filter(|(i, _)| counts(CellRef::Reference(*i)));
        let rendered = references.filter_map(|(_, reference)| match &reference.source {
            ReferenceSource::Render { config, stop, .. } => Some((&**config, stop)),
            ReferenceSource::File { .. } => None,
        });
        let mut seen = BTreeSet::new();
        let cells = self.cells.iter().enumerate();
        let cells =
            cells.filter(move |(i, cell)| counts(CellRef::Cell(*i)) && seen.insert(cell.first));
        rendered.chain(cells.map(|(_, cell)| (&*cell.config, &cell.stop)))
    }

    /// Estimates the cost of the cells and references for which `counts` is true. References from
    /// files cost nothing, and cells that are one run cost one run.
    pub fn estimate(&self, counts: &dyn Fn(CellRef) -> bool) -> Estimate {
        let mut estimate = Estimate::default();
        for (config, stop) in self.runs(counts) {
            estimate.add(config, stop);
        }
        for group in self.interleave_groups(false) {
            let runs = group.iter().filter(|i| counts(CellRef::Cell(**i)));
            let bytes: Vec<u64> = runs.map(|i| run_bytes(&self.cells[*i].config)).collect();
            if bytes.len() > 1 {
                estimate.interleaved_runs = estimate.interleaved_runs.max(bytes.len());
                estimate.interleaved_bytes = estimate.interleaved_bytes.max(bytes.iter().sum());
            }
        }
        estimate
    }
}

impl Estimate {
    fn add(&mut self, config: &Settings, stop: &StopRule) {
        let [width, height] = config.resolution.unwrap_or_default();
        let pixels = f64::from(width) * f64::from(height);
        self.run_bytes = self.run_bytes.max(run_bytes(config));
        self.layer_bytes = self.layer_bytes.max(layer_and_bin_bytes(config));
        match (stop.time_limit_s(), stop.sample_limit()) {
            (Some(seconds), _) => {
                self.by_time += 1;
                self.seconds += seconds;
            }
            (None, Some(samples)) => {
                self.by_samples += 1;
                self.paths += samples as f64 * pixels;
            }
            (None, None) => self.unbounded += 1,
        }
    }
}
