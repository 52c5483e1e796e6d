//! Cells from coarse to fine, for nights that may end before all is done.

use std::collections::BTreeMap;

use super::Plan;
use crate::value::Value;

impl Plan {
    /// Every cell once, in an order whose finished part is a complete smaller grid as often as possible.
    ///
    /// The values of an axis of numbers come as its two ends, then what halves the largest gaps, and so on; a cell comes
    /// in the round of its latest value. Repeats count as such an axis, one round each. Axes of words or truths, such
    /// as techniques, are there to be compared, so all of their values belong to every round. Cells of one round keep
    /// the plan's order.
    pub fn coarse_to_fine(&self) -> Vec<usize> {
        let axes = self.cells.first().map_or(0, |cell| cell.point.len());
        let rounds: Vec<BTreeMap<String, u32>> = (0..axes).map(|axis| self.rounds_of(axis)).collect();
        let round = |index: usize| {
            let cell = &self.cells[index];
            let latest =
                cell.point.iter().zip(&rounds).filter_map(|((_, value), rounds)| rounds.get(&value.to_string()));
            latest.copied().max().unwrap_or(0).max(cell.repeat)
        };
        let mut order: Vec<usize> = (0..self.cells.len()).collect();
        order.sort_by_key(|index| round(*index));
        order
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
