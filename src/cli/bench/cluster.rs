//! What many workers cost the folder that they share.

use std::path::Path;

use serde_json::{Value as Json, json};

use crate::store::rehearsal::{Rehearsal, Rehearsed, rehearse};

/// The night that is rehearsed: ten thousand cells of two minutes, a thousand workers, every fiftieth cell the death of
/// its worker, every two-hundredth a pause that is longer than a lease, and a folder that answers in half a millisecond.
const NIGHT: Rehearsal = Rehearsal {
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

/// Operations in a second that a shared folder is taken to stand: what one common file server does with small files.
const SERVER: f64 = 10_000.0;

/// What was found, and of what.
pub struct Cluster {
    plan: Rehearsal,
    found: Rehearsed,
}

impl Cluster {
    /// Rehearses the night in a folder of its own below another.
    ///
    /// # Errors
    /// When files cannot be written there.
    pub fn measure(out: &Path) -> Result<Cluster, String> {
        let folder = tempfile::Builder::new().prefix("rehearsal-").tempdir_in(out).map_err(|e| e.to_string())?;
        let found = rehearse(folder.path(), NIGHT).map_err(|e| e.to_string())?;
        Ok(Cluster { plan: NIGHT, found })
    }

    /// Operations of one cell, all included.
    fn operations_per_cell(&self) -> f64 {
        self.found.operations as f64 / self.plan.cells as f64
    }

    /// Seconds of a cell below which a server of [`SERVER`] operations is the limit.
    fn limit_s(&self) -> f64 {
        self.operations_per_cell() * self.plan.workers as f64 / SERVER
    }

    /// For people.
    pub fn table(&self) -> String {
        let Cluster { plan, found } = self;
        let share = |part: f64, whole: f64| part / whole.max(1e-9) * 100.0;
        format!(
            "cells, workers                     {:>9} {:>9}\n\
             mean cell                          {:>9.0} s\n\
             time to finish                     {:>9.0} s\n\
             ideal                              {:>9.0} s   ({:.0} % of it)\n\
             died, stood still                  {:>9} {:>9}\n\
             rendered for nothing               {:>9.2} %\n\
             waited for others' last cells      {:>9.2} % of all workers' time\n\
             finished twice                     {:>9}\n\
             claims asked for, got              {:>9} {:>9}\n\
             claims a second, one process       {:>9.0}\n\
             operations for each cell           {:>9.1}\n\
             operations a second, mean, most    {:>9.0} {:>9}\n\
             a folder of {SERVER} operations a second is the limit where cells take less than {:.1} s\n",
            plan.cells,
            plan.workers,
            plan.cell_s,
            found.night_s,
            found.ideal_s,
            share(found.ideal_s, found.night_s),
            found.deaths,
            found.stalls,
            share(found.wasted_s, found.work_s),
            share(found.idle_s, found.night_s * plan.workers as f64),
            found.twice,
            found.asked,
            found.got,
            found.claims_per_s(),
            self.operations_per_cell(),
            found.operations as f64 / found.night_s.max(1e-9),
            found.busiest,
            self.limit_s(),
        )
    }

    /// For programs.
    pub fn to_json(&self) -> Json {
        let Cluster { plan, found } = self;
        json!({
            "cells": plan.cells, "workers": plan.workers, "cell_s": plan.cell_s, "operation_s": plan.operation_s,
            "night_s": found.night_s, "ideal_s": found.ideal_s, "work_s": found.work_s, "wasted_s": found.wasted_s,
            "idle_s": found.idle_s, "deaths": found.deaths, "stalls": found.stalls, "twice": found.twice,
            "claims_asked": found.asked, "claims_got": found.got, "claims_per_s": found.claims_per_s(),
            "operations": found.operations, "operations_busiest_s": found.busiest, "limit_cell_s": self.limit_s(),
        })
    }
}
