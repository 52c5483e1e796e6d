//! Comparisons: the cells whose times stand on one axis, and what they share.

use super::event::CellRef;
use super::plan::{Cell, Plan};
use crate::value::Value;

/// What all cells of one comparison have to share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Affinity {
    /// One device: times are compared, and two devices of one model are not equally cool.
    #[default]
    Device,
    /// One model of device.
    Model,
    /// Nothing: times are of no interest.
    None,
}

impl Affinity {
    /// Every one.
    pub const ALL: [Affinity; 3] = [Affinity::Device, Affinity::Model, Affinity::None];

    /// The name on the command line.
    pub fn word(self) -> &'static str {
        match self {
            Affinity::Device => "device",
            Affinity::Model => "model",
            Affinity::None => "none",
        }
    }
}

/// The comparison that a cell belongs to, as 16 hex digits: cells that show the same scene in the same size to the same
/// depth on the same backend are compared with one another, whatever their technique and its parameters.
pub fn group(cell: &Cell) -> String {
    let nothing = Value::Nil;
    let of = |key: &str| cell.identity.as_map().and_then(|map| map.get(key)).unwrap_or(&nothing);
    let mut hasher = blake3::Hasher::new();
    for key in ["scene", "resolution", "max_depth", "backend"] {
        of(key).hash_into(&mut hasher);
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

/// Where one of many workers begins, so that they do not all ask for the same cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// With a whole comparison, whose cells keep their order.
    Group(u64),
    /// With any cell.
    Cell(u64),
}

impl Begin {
    /// An order of references and of cells that are rendered together, begun elsewhere and gone through in a circle. References stay first; each kind
    /// begins at its own place.
    pub fn turn(self, plan: &Plan, order: Vec<Vec<CellRef>>) -> Vec<Vec<CellRef>> {
        let (mut references, mut cells): (Vec<_>, Vec<_>) =
            order.into_iter().partition(|heat| matches!(heat.first(), Some(CellRef::Reference(_))));
        let (Begin::Group(turn) | Begin::Cell(turn)) = self;
        let at = |places: usize| usize::try_from(turn % places.max(1) as u64).unwrap_or(0);
        let first = at(references.len());
        references.rotate_left(first);
        let first = match self {
            Begin::Cell(_) => at(cells.len()),
            Begin::Group(_) => {
                let name = |heat: &Vec<CellRef>| match heat.first() {
                    Some(CellRef::Cell(i)) => group(&plan.cells[*i]),
                    Some(CellRef::Reference(_)) | None => String::new(),
                };
                let names: Vec<String> = cells.iter().map(name).collect();
                // Where runs of cells of one group begin; a group may have several.
                let starts: Vec<usize> = (0..names.len()).filter(|i| *i == 0 || names[*i] != names[i - 1]).collect();
                starts.get(at(starts.len())).copied().unwrap_or(0)
            }
        };
        cells.rotate_left(first);
        references.into_iter().chain(cells).collect()
    }
}
