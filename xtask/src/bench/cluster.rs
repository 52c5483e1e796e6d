//! Cost of many workers for the folder they share, from a simulated night.

use std::path::Path;

use super::cluster_simulation::{ClusterSimulation, SimulationResult, simulate};

/// The simulated night: 10,000 cells of two minutes on 1,000 workers. Every fiftieth cell kills its
/// worker, every two-hundredth stalls for longer than a lease, and a file operation takes 0.5 ms.
const NIGHT: ClusterSimulation = ClusterSimulation {
    cells: 10_000,
    workers: 1_000,
    cell_s: 120.0,
    death: 0.02,
    stall: 0.005,
    requeue_s: 120.0,
    checkpoint_s: 60.0,
    operation_s: 0.5e-3,
    seed: 20_260_427,
};

/// Assumed capacity of a shared folder in operations per second: one common file server with
/// small files.
const SERVER: f64 = 10_000.0;

/// Parameters and result of the simulation.
pub struct ClusterCost {
    plan: ClusterSimulation,
    result: SimulationResult,
}

impl ClusterCost {
    /// Simulates the night in a temporary folder below `out`.
    ///
    /// # Errors
    /// If files cannot be written there.
    pub fn measure(out: &Path) -> Result<ClusterCost, String> {
        let folder = tempfile::Builder::new()
            .prefix("rehearsal-")
            .tempdir_in(out)
            .map_err(|e| e.to_string())?;
        let result = simulate(folder.path(), NIGHT).map_err(|e| e.to_string())?;
        Ok(ClusterCost {
            plan: NIGHT,
            result,
        })
    }

    /// Number of file operations per cell.
    fn operations_per_cell(&self) -> f64 {
        self.result.operations as f64 / self.plan.cells as f64
    }

    /// Cell duration in seconds below which a server of [`SERVER`] operations per second is
    /// saturated.
    fn limit_s(&self) -> f64 {
        self.operations_per_cell() * self.plan.workers as f64 / SERVER
    }

    /// Formats the result as text.
    pub fn table(&self) -> String {
        let ClusterCost { plan, result } = self;
        let share = |part: f64, total: f64| part / total.max(1e-9) * 100.0;
        format!(
            "cells, workers                     {:>9} {:>9}\n\
             mean duration of a cell            {:>9.0} s\n\
             duration of the night              {:>9.0} s\n\
             ideal duration                     {:>9.0} s   ({:.0} % of the actual one)\n\
             workers died, stalled              {:>9} {:>9}\n\
             discarded work                     {:>9.2} %\n\
             idle at the end of the night       {:>9.2} % of worker time\n\
             cells finished twice               {:>9}\n\
             claims tried, acquired             {:>9} {:>9}\n\
             claims per second, one process     {:>9.0}\n\
             file operations per cell           {:>9.1}\n\
             operations per second, mean, peak  {:>9.0} {:>9}\n\
             a folder of {SERVER} operations per second is saturated if cells take less \
             than {:.1} s\n",
            plan.cells,
            plan.workers,
            plan.cell_s,
            result.night_s,
            result.ideal_s,
            share(result.ideal_s, result.night_s),
            result.deaths,
            result.stalls,
            share(result.wasted_s, result.work_s),
            share(result.idle_s, result.night_s * plan.workers as f64),
            result.finished_twice,
            result.claims_requested,
            result.claims_granted,
            result.claims_per_s(),
            self.operations_per_cell(),
            result.operations as f64 / result.night_s.max(1e-9),
            result.busiest,
            self.limit_s(),
        )
    }
}
