//! Devices that the cells of a night were rendered on. Times of different devices are compared only
//! if the script requests it.

use std::collections::{BTreeMap, BTreeSet};

use crate::experiment::plan::Plan;
use crate::experiment::{CellRef, CellResult};

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

    /// Returns the device of a cell, if it is known and has to be told apart from others.
    pub fn device_of(&self, cell: usize) -> Option<&str> {
        self.0.get(&cell).map(String::as_str)
    }
}
