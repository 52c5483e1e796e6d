//! Tables of the benchmark: a quantity by scene, technique and device, and rates relative to those
//! of the first device, as tables 5.2 and 5.3 of thesis S0.

use std::collections::BTreeMap;

use super::provenance::Provenance;
use super::quantity::{Bound, RunValue};
pub use super::table::ranking::Ranking;
use super::table::{Digits, Table, TableCell, TableKind};

/// A quantity of the benchmark.
pub struct Quantity {
    /// Name of the table's files without extension.
    pub name: String,
    /// Short title of the table.
    pub title: String,
    /// Description of the numbers.
    pub caption: String,
    /// Unit of the numbers; empty if there is none.
    pub unit: &'static str,
    /// Scale on which runs are averaged.
    pub ranking: Ranking,
}

/// Values of a quantity for one technique on one scene and device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Value of each run.
    pub runs: Vec<RunValue>,
    /// Whether a value is dominated by the noise of its reference.
    pub at_floor: bool,
}

/// Values of a quantity on one backend of one machine.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceValues {
    /// Heading of its columns.
    pub label: String,
    /// Values by scene and technique.
    pub values: BTreeMap<(String, String), Measured>,
}

impl DeviceValues {
    fn get(&self, scene: &str, technique: &str) -> Option<&Measured> {
        self.values.get(&(scene.to_owned(), technique.to_owned()))
    }

    fn cell(&self, scene: &str, technique: &str, ranking: Ranking) -> TableCell {
        let Some(measured) = self.get(scene, technique) else {
            return TableCell::default();
        };
        TableCell {
            at_floor: measured.at_floor && !measured.runs.is_empty(),
            ..TableCell::mean(&measured.runs, ranking)
        }
    }

    /// Returns those of some techniques of which any scene has a value.
    fn techniques<'a>(&self, all: &'a [String]) -> Vec<&'a String> {
        let has = |technique: &&String| self.values.keys().any(|(_, own)| own == *technique);
        all.iter().filter(has).collect()
    }
}

/// Returns the table of a quantity with these scenes as rows, and a group of columns for each
/// device.
pub fn table(
    quantity: &Quantity,
    devices: &[DeviceValues],
    scenes: &[String],
    techniques: &[String],
) -> Table {
    let shown: Vec<(&DeviceValues, Vec<&String>)> = devices
        .iter()
        .map(|device| (device, device.techniques(techniques)))
        .collect();
    let cell = |scene: &String, device: &DeviceValues, technique: &String| {
        device.cell(scene, technique, quantity.ranking)
    };
    let mut table = build(quantity, Digits::Significant(4), &shown, scenes, &cell);
    let bounds: Vec<Bound> = table.cells().iter().map(|cell| cell.bound).collect();
    let mut notes = vec![Bound::explanations(&bounds)];
    if table.cells().iter().any(|cell| cell.at_floor) {
        notes.push("†: at least half of the squared error can be noise of the reference.".into());
    }
    for note in notes.iter().filter(|note| !note.is_empty()) {
        table.caption += " ";
        table.caption += note;
    }
    table
}

/// Returns the table of the quotients of a quantity and that of the first device, or `None` for a
/// single device.
pub fn relative(
    quantity: &Quantity,
    devices: &[DeviceValues],
    scenes: &[String],
    techniques: &[String],
) -> Option<Table> {
    let [base, others @ ..] = devices else {
        return None;
    };
    if others.is_empty() {
        return None;
    }
    let own = base.techniques(techniques);
    let shared = |device: &DeviceValues| {
        let both = device.techniques(techniques).into_iter();
        both.filter(|technique| own.contains(technique)).collect()
    };
    let shown: Vec<(&DeviceValues, Vec<&String>)> = others
        .iter()
        .map(|device| (device, shared(device)))
        .collect();
    let cell = |scene: &String, device: &DeviceValues, technique: &String| {
        let [a, b] = [device, base].map(|d| d.cell(scene, technique, quantity.ranking));
        TableCell {
            value: a.value.zip(b.value).map(|(a, b)| a / b),
            runs: a.runs.min(b.runs),
            ..TableCell::default()
        }
    };
    let caption = format!("{} Relative to {}.", quantity.caption, base.label);
    Some(Table {
        caption,
        unit: "1".to_owned(),
        ..build(quantity, Digits::Percent, &shown, scenes, &cell)
    })
}

/// Builds the table of a quantity for devices with their techniques.
fn build(
    quantity: &Quantity,
    digits: Digits,
    shown: &[(&DeviceValues, Vec<&String>)],
    scenes: &[String],
    cell: &dyn Fn(&String, &DeviceValues, &String) -> TableCell,
) -> Table {
    let row = |scene: &String| {
        let cells = shown.iter().flat_map(|(device, techniques)| {
            techniques
                .iter()
                .map(|technique| cell(scene, device, technique))
        });
        (vec![scene.clone()], cells.collect())
    };
    let columns = shown.iter().flat_map(|(_, techniques)| techniques);
    Table {
        name: quantity.name.clone(),
        kind: TableKind::Other,
        section: String::new(),
        title: quantity.title.clone(),
        caption: quantity.caption.clone(),
        unit: quantity.unit.to_owned(),
        label_headers: vec!["scene".to_owned()],
        groups: shown
            .iter()
            .map(|(device, techniques)| (device.label.clone(), techniques.len()))
            .collect(),
        columns: columns.map(|technique| (*technique).clone()).collect(),
        rows: scenes.iter().map(row).collect(),
        digits,
        provenance: Provenance::default(),
    }
}
