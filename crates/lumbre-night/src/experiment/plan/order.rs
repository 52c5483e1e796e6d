//! Order in which cells are rendered: sequential, shuffled, interleaved, or from coarse to fine for
//! nights that may end before all cells are done.

use std::collections::{BTreeMap, BTreeSet};

use super::{Cell, Plan};
use crate::experiment::spec::Order;
use lumbre_light::value::Value;

impl Plan {
    /// Returns every cell once, in the order in which they are rendered, as interleave groups. The
    /// cells of a group are rendered together and take turns.
    ///
    /// Only [`Order::Interleave`] has groups of more than one cell: those that render the same
    /// picture (scene, size, depth, filter, backend, repeat) with different techniques (integrator
    /// with parameters, Russian roulette, sampler). A cell and its double of the A/A check share a
    /// group. If two cells have the same run id, the second has a group of its own, since the run
    /// is rendered only once.
    ///
    /// With `coarse_first`, cells are sorted into rounds from coarse to fine, and [`Order`] applies
    /// within a round. The values of a numeric axis are visited ends first, then repeatedly the
    /// middles of the largest gaps. A cell belongs to the round of its latest value. Repeats count
    /// as such an axis with one round each. Values of other axes, such as techniques, are meant to
    /// be compared, so all of them belong to every round. What is finished at any time is thus a
    /// complete coarser grid as often as possible.
    pub fn interleave_groups(&self, coarse_first: bool) -> Vec<Vec<usize>> {
        let mut order: Vec<usize> = (0..self.cells.len()).collect();
        if self.night.order == Order::Shuffled {
            order.sort_by_cached_key(|index| self.shuffle_key(*index));
        }
        if coarse_first {
            let rounds = self.rounds();
            order.sort_by_key(|index| rounds[*index]);
        }
        if self.night.order != Order::Interleave {
            return order.into_iter().map(|index| vec![index]).collect();
        }
        let mut group_of: BTreeMap<PictureKey<'_>, usize> = BTreeMap::new();
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut seen = BTreeSet::new();
        for index in order {
            let cell = &self.cells[index];
            if !seen.insert(cell.first) {
                groups.push(vec![index]);
                continue;
            }
            let group = *group_of.entry(picture_key(cell)).or_insert_with(|| {
                groups.push(Vec::new());
                groups.len() - 1
            });
            groups[group].push(index);
        }
        groups
    }

    /// Returns every cell once, from coarse to fine: see [`Plan::interleave_groups`].
    pub fn coarse_to_fine(&self) -> Vec<usize> {
        self.interleave_groups(true).into_iter().flatten().collect()
    }

    /// Pseudorandom sort key of a cell, the same at every launch.
    fn shuffle_key(&self, index: usize) -> [u8; 32] {
        let mut material = self.seed.to_le_bytes().to_vec();
        material.extend(self.cells[index].id.0.as_bytes());
        material.extend((index as u64).to_le_bytes());
        blake3::derive_key("lumbre 1 order of cells", &material)
    }

    /// Returns the round of every cell.
    fn rounds(&self) -> Vec<u32> {
        let axes = self.cells.first().map_or(0, |cell| cell.point.len());
        let rounds: Vec<BTreeMap<String, u32>> =
            (0..axes).map(|axis| self.axis_rounds(axis)).collect();
        let round = |cell: &Cell| {
            let latest = cell
                .point
                .iter()
                .zip(&rounds)
                .filter_map(|((_, value), rounds)| rounds.get(&value.to_string()));
            latest.copied().max().unwrap_or(0).max(cell.paired_repeat())
        };
        self.cells.iter().map(round).collect()
    }

    /// Returns the round of every value of a numeric axis; empty for other axes.
    fn axis_rounds(&self, axis: usize) -> BTreeMap<String, u32> {
        let values = self.cells.iter().map(|cell| &cell.point[axis].1);
        if !values.clone().all(|value| value.as_f64().is_some()) {
            return BTreeMap::new();
        }
        let mut seen = BTreeSet::new();
        let texts = values.map(Value::to_string);
        let texts: Vec<String> = texts.filter(|text| seen.insert(text.clone())).collect();
        let rounds = halvings(texts.len());
        texts.into_iter().zip(rounds).collect()
    }
}

/// Identifies a picture whatever the technique: scene, size, depth, filter, backend and repeat.
pub(super) type PictureKey<'a> = (
    usize,
    Option<[u32; 2]>,
    Option<u32>,
    (&'static str, u32),
    &'a str,
    u32,
);

/// Returns the key of the picture that a cell renders.
pub(super) fn picture_key(cell: &Cell) -> PictureKey<'_> {
    let config = &cell.config;
    let filter = (config.filter.kind.name(), config.filter.radius.to_bits());
    // Cells with the same file and changes share one scene.
    let scene = std::sync::Arc::as_ptr(&cell.scene) as usize;
    (
        scene,
        config.resolution,
        config.max_depth,
        filter,
        &config.backend,
        cell.paired_repeat(),
    )
}

/// Returns, for each of `n` consecutive values, the round in which it is visited: the ends in round
/// 0, then the middles of gaps.
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
        assert_eq!(
            (halvings(0), halvings(1), halvings(2)),
            (vec![], vec![0], vec![0, 0])
        );
    }
}
