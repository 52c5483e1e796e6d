//! The devices that the cells of a night were rendered on: times of different ones are not compared unasked.

use std::collections::{BTreeMap, BTreeSet};

use crate::experiment::plan::Plan;
use crate::experiment::{CellRef, CellResult};

/// What tells figures and tables of several devices apart.
pub const DEVICE: &str = "device";

/// The model of the device of every cell, as far as it is known.
#[derive(Clone, Debug, Default)]
pub struct Devices(BTreeMap<usize, String>);

impl Devices {
    /// The devices of what was rendered, as `name` tells them. Where the script sweeps backends and each of them has one
    /// device, it has asked for the comparison, and they count as one.
    pub fn new(plan: &Plan, results: &[CellResult], name: impl Fn(&CellResult) -> Option<String>) -> Devices {
        let one = |result: &CellResult| match result.cell {
            CellRef::Cell(cell) => Some((cell, name(result)?)),
            CellRef::Reference(_) => None,
        };
        let known: BTreeMap<usize, String> = results.iter().filter_map(one).collect();
        let of_backends: BTreeSet<(&str, &str)> = known
            .iter()
            .filter_map(|(cell, device)| Some((plan.cells.get(*cell)?.config.backend.as_str(), device.as_str())))
            .collect();
        let backends: BTreeSet<&str> = of_backends.iter().map(|(backend, _)| *backend).collect();
        if backends.len() == of_backends.len() { Devices::default() } else { Devices(known) }
    }

    /// The device of a cell, in words.
    pub fn of(&self, cell: usize) -> &str {
        self.0.get(&cell).map_or("unknown", String::as_str)
    }

    /// Every one of them, once, in alphabetical order.
    pub fn all(&self) -> BTreeSet<&str> {
        self.0.values().map(String::as_str).collect()
    }

    /// Whether there is more than one.
    pub fn several(&self) -> bool {
        self.all().len() > 1
    }
}
