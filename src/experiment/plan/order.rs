//! In which order cells are rendered: as the plan has them, shuffled, in turns, or from coarse to fine for nights that
//! may end before all is done.

use std::collections::{BTreeMap, BTreeSet};

use super::{Cell, Plan};
use crate::experiment::spec::Order;
use crate::value::Value;

impl Plan {
    /// Every cell once, in the order in which they are rendered; those in one heat are rendered together, in turns.
    ///
    /// Only [`Order::Interleave`] has heats of more than one: the cells that render the same picture (scene, size, depth,
    /// filter, backend, repeat) with different techniques, which are integrators with their parameters, roulette and
    /// samplers. A cell and its double of the A/A check are in one heat, too. A run that stands twice in the plan is
    /// rendered once, so its second cell has a heat of its own.
    ///
    /// With `coarse_first` the cells come from coarse to fine, and the order concerns cells of one round. The values of an
    /// axis of numbers come as its two ends, then what halves the largest gaps, and so on; a cell comes in the round of
    /// its latest value. Repeats count as such an axis, one round each. Axes of words or truths, such as techniques, are
    /// there to be compared, so all of their values belong to every round. So what is finished at any time is a complete
    /// smaller grid as often as possible.
    pub fn heats(&self, coarse_first: bool) -> Vec<Vec<usize>> {
        let mut order: Vec<usize> = (0..self.cells.len()).collect();
        if self.night.order == Order::Shuffled {
            order.sort_by_cached_key(|index| self.lot(*index));
        }
        if coarse_first {
            let rounds = self.rounds();
            order.sort_by_key(|index| rounds[*index]);
        }
        if self.night.order != Order::Interleave {
            return order.into_iter().map(|index| vec![index]).collect();
        }
        let mut places: BTreeMap<Picture<'_>, usize> = BTreeMap::new();
        let mut heats: Vec<Vec<usize>> = Vec::new();
        let mut seen = BTreeSet::new();
        for index in order {
            let cell = &self.cells[index];
            if !seen.insert(&cell.id) {
                heats.push(vec![index]);
                continue;
            }
            let place = *places.entry(picture(cell)).or_insert_with(|| {
                heats.push(Vec::new());
                heats.len() - 1
            });
            heats[place].push(index);
        }
        heats
    }

    /// Every cell once, from coarse to fine: see [`Plan::heats`].
    pub fn coarse_to_fine(&self) -> Vec<usize> {
        self.heats(true).into_iter().flatten().collect()
    }

    /// A number drawn for a cell, the same in every launch.
    fn lot(&self, index: usize) -> [u8; 32] {
        let mut material = self.seed.to_le_bytes().to_vec();
        material.extend(self.cells[index].id.0.as_bytes());
        material.extend((index as u64).to_le_bytes());
        blake3::derive_key("lumbre 1 order of cells", &material)
    }

    /// The round of every cell.
    fn rounds(&self) -> Vec<u32> {
        let axes = self.cells.first().map_or(0, |cell| cell.point.len());
        let rounds: Vec<BTreeMap<String, u32>> = (0..axes).map(|axis| self.rounds_of(axis)).collect();
        let round = |cell: &Cell| {
            let latest =
                cell.point.iter().zip(&rounds).filter_map(|((_, value), rounds)| rounds.get(&value.to_string()));
            latest.copied().max().unwrap_or(0).max(cell.pair())
        };
        self.cells.iter().map(round).collect()
    }

    /// The round of every value of an axis of numbers; nothing for others.
    fn rounds_of(&self, axis: usize) -> BTreeMap<String, u32> {
        let mut values: Vec<&Value> = Vec::new();
        for cell in &self.cells {
            if !values.contains(&&cell.point[axis].1) {
                values.push(&cell.point[axis].1);
            }
        }
        if !values.iter().all(|value| value.as_f64().is_some()) {
            return BTreeMap::new();
        }
        values.iter().map(|v| v.to_string()).zip(halvings(values.len())).collect()
    }
}

/// What techniques are compared on: scene, size, depth, filter, backend, repeat.
pub(super) type Picture<'a> = (usize, Option<[u32; 2]>, Option<u32>, (&'static str, u32), &'a str, u32);

/// The picture that a cell renders, whatever its technique.
pub(super) fn picture(cell: &Cell) -> Picture<'_> {
    let config = &cell.config;
    let filter = (config.filter.kind.name(), config.filter.radius.to_bits());
    // Cells with the same file and changes share their scene.
    let scene = std::sync::Arc::as_ptr(&cell.scene) as usize;
    (scene, config.resolution, config.max_depth, filter, &config.backend, cell.pair())
}

/// For each of `n` places in a row the round in which it is reached: the ends in round 0, then middles of gaps.
fn halvings(n: usize) -> Vec<u32> {
    let mut rounds = vec![0; n];
    let mut gaps = vec![(0, n.saturating_sub(1), 1)];
    while let Some((low, high, round)) = gaps.pop() {
        if high > low + 1 {
            let middle = low + (high - low) / 2;
            rounds[middle] = round;
            gaps.extend([(low, middle, round + 1), (middle, high, round + 1)]);
        }
    }
    rounds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_come_first_and_gaps_are_halved() {
        assert_eq!(halvings(9), [0, 3, 2, 3, 1, 3, 2, 3, 0]);
        assert_eq!(halvings(4), [0, 1, 2, 0]);
        assert_eq!((halvings(0), halvings(1), halvings(2)), (vec![], vec![0], vec![0, 0]));
    }
}
