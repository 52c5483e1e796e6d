//! Names that nothing else has.

use std::collections::{BTreeMap, BTreeSet};

/// Names that are taken, and how far the counters behind them are.
#[derive(Debug, Default)]
pub struct Names {
    taken: BTreeSet<String>,
    counters: BTreeMap<String, usize>,
}

impl Names {
    /// The stem where it is free, else the stem with the first free number from 2 on: `lamp`, `lamp_2`.
    pub fn give(&mut self, stem: &str) -> String {
        if self.taken.insert(stem.to_owned()) { stem.to_owned() } else { self.numbered(stem, 2) }
    }

    /// The stem with the first free number from `first` on, for things that nobody named: `part_1`.
    pub fn numbered(&mut self, stem: &str, first: usize) -> String {
        let counter = self.counters.entry(stem.to_owned()).or_insert(first);
        loop {
            let name = format!("{stem}_{counter}");
            *counter += 1;
            if self.taken.insert(name.clone()) {
                return name;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_given_once() {
        let mut names = Names::default();
        let given = ["a", "a", "a_2", "a", "b"].map(|stem| names.give(stem));
        assert_eq!(given, ["a", "a_2", "a_2_2", "a_3", "b"]);
        assert_eq!([names.numbered("c", 1), names.numbered("c", 1), names.give("c_2")], ["c_1", "c_2", "c_2_2"]);
    }
}
