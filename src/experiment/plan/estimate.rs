//! What a plan will cost, as far as its stop rules tell.

use super::{Plan, ReferenceSource};
use crate::experiment::event::CellRef;
use crate::experiment::memory::{beside_bytes, run_bytes};
use crate::experiment::spec::CellConfig;
use crate::experiment::stop::StopRule;

/// Bounds on the work of a plan. Every run is counted in exactly one of the three counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Runs that a limit on render time ends at the latest.
    pub by_time: usize,
    /// The sum of those limits in seconds: an upper bound, reached where nothing else ends a run first.
    pub seconds: f64,
    /// Runs that no time but a number of samples ends at the latest.
    pub by_samples: usize,
    /// Camera paths that those runs trace at most; divided by a machine's paths per second this is a time.
    pub paths: f64,
    /// Runs whose stop rules bound neither.
    pub unbounded: usize,
    /// The most bytes of memory that the layers and bins of one of those runs take.
    pub layer_bytes: u64,
    /// The most runs that are rendered in turns; 0 where none are.
    pub heat_runs: usize,
    /// The most bytes of memory that runs take together which are rendered in turns.
    pub heat_bytes: u64,
}

impl Plan {
    /// What rendering costs of the cells and references for which `counts` is true. References from files cost
    /// nothing.
    pub fn estimate(&self, counts: &dyn Fn(CellRef) -> bool) -> Estimate {
        let mut estimate = Estimate::default();
        for (_, reference) in self.references.iter().enumerate().filter(|(i, _)| counts(CellRef::Reference(*i))) {
            if let ReferenceSource::Render { config, stop, .. } = &reference.source {
                estimate.add(config, stop);
            }
        }
        for (_, cell) in self.cells.iter().enumerate().filter(|(i, _)| counts(CellRef::Cell(*i))) {
            estimate.add(&cell.config, &cell.stop);
        }
        for heat in self.heats(false) {
            let runs = heat.iter().filter(|i| counts(CellRef::Cell(**i)));
            let bytes: Vec<u64> = runs.map(|i| run_bytes(&self.cells[*i].config)).collect();
            if bytes.len() > 1 {
                estimate.heat_runs = estimate.heat_runs.max(bytes.len());
                estimate.heat_bytes = estimate.heat_bytes.max(bytes.iter().sum());
            }
        }
        estimate
    }
}

impl Estimate {
    fn add(&mut self, config: &CellConfig, stop: &StopRule) {
        let [width, height] = config.resolution.unwrap_or_default();
        let pixels = f64::from(width) * f64::from(height);
        self.layer_bytes = self.layer_bytes.max(beside_bytes(config));
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
