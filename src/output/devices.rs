//! Devices that the cells of a night were rendered on. Times of different devices are compared only
//! if the script requests it.

use std::collections::{BTreeMap, BTreeSet};

use crate::experiment::plan::Plan;
use crate::experiment::{CellRef, CellResult};

/// Name of the additional facet of figures and tables of several devices.
pub const DEVICE: &str = "device";

/// Device model of every cell, as far as it is known. Empty if the devices need not be told apart.
#[derive(Clone, Debug, Default)]
pub struct Devices(BTreeMap<usize, String>);

impl Devices {
    /// Collects the devices of rendered cells; `name` returns the device of a result. Returns an
    /// empty map if every backend that the script sweeps has a single device: the comparison of
    /// devices is then intended.
    pub fn new(
        plan: &Plan,
        results: &[CellResult],
        name: impl Fn(&CellResult) -> Option<String>,
    ) -> Devices {
        let one = |result: &CellResult| match result.cell {
            CellRef::Cell(cell) => Some((cell, name(result)?)),
            CellRef::Reference(_) => None,
        };
        let known: BTreeMap<usize, String> = results.iter().filter_map(one).collect();
        let of_backends: BTreeSet<(&str, &str)> = known
            .iter()
            .filter_map(|(cell, device)| {
                Some((
                    plan.cells.get(*cell)?.config.backend.as_str(),
                    device.as_str(),
                ))
            })
            .collect();
        let backends: BTreeSet<&str> = of_backends.iter().map(|(backend, _)| *backend).collect();
        if backends.len() == of_backends.len() {
            Devices::default()
        } else {
            Devices(known)
        }
    }

    /// Returns the device of a cell, or `unknown`.
    pub fn device_of(&self, cell: usize) -> &str {
        self.0.get(&cell).map_or("unknown", String::as_str)
    }

    /// Returns the distinct device names in alphabetical order.
    pub fn names(&self) -> BTreeSet<&str> {
        self.0.values().map(String::as_str).collect()
    }

    /// Returns whether there is more than one device.
    pub fn is_mixed(&self) -> bool {
        self.names().len() > 1
    }
}
