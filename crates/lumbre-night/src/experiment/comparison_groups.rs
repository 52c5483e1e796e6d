//! Comparison groups: cells whose render times are compared with each other, and the device that
//! they share.

use super::outcome::CellRef;
use super::plan::{Cell, Plan};

lumbre_light::named! {
    /// Device affinity: what all cells of one comparison group must share.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Affinity {
        /// The same device. Two devices of the same model can differ in clock rate and temperature.
        #[default]
        Device = "device",
        /// The same model of device.
        Model = "model",
        /// Nothing; for experiments whose times are of no interest.
        None = "none",
    }
}

/// Returns the comparison group of a cell as 16 hex digits. Cells with the same scene, resolution,
/// path depth and backend are in the same group, whatever their technique and its parameters.
pub fn comparison_group(cell: &Cell) -> String {
    let mut hasher = blake3::Hasher::new();
    for key in ["scene", "resolution", "max_depth", "backend"] {
        cell.identity.field(key).hash_into(&mut hasher);
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

/// Offset at which one of many workers starts, so that they do not all claim the same cell first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartOffset {
    /// At the start of a comparison group, chosen by this number modulo their count.
    Group(u64),
    /// At a cell, chosen by this number modulo their count.
    Cell(u64),
}

impl StartOffset {
    /// Rotates the order of references and interleave groups. References stay first; references and
    /// cells are rotated separately.
    pub fn rotate(self, plan: &Plan, order: Vec<Vec<CellRef>>) -> Vec<Vec<CellRef>> {
        let (mut references, mut cells): (Vec<_>, Vec<_>) = order
            .into_iter()
            .partition(|group| matches!(group.first(), Some(CellRef::Reference(_))));
        let (StartOffset::Group(offset) | StartOffset::Cell(offset)) = self;
        let at = |count: usize| usize::try_from(offset % count.max(1) as u64).unwrap_or(0);
        let first = at(references.len());
        references.rotate_left(first);
        let first = match self {
            StartOffset::Cell(_) => at(cells.len()),
            StartOffset::Group(_) => {
                let name = |group: &Vec<CellRef>| match group.first() {
                    Some(CellRef::Cell(i)) => comparison_group(&plan.cells[*i]),
                    Some(CellRef::Reference(_)) | None => String::new(),
                };
                let names: Vec<String> = cells.iter().map(name).collect();
                // Where the comparison group changes; a group may be split into several stretches.
                let starts: Vec<usize> = (0..names.len())
                    .filter(|i| *i == 0 || names[*i] != names[i - 1])
                    .collect();
                starts.get(at(starts.len())).copied().unwrap_or(0)
            }
        };
        cells.rotate_left(first);
        references.into_iter().chain(cells).collect()
    }
}
