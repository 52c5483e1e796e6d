//! Allocation of unique names, and names in messages.

use std::collections::{BTreeMap, BTreeSet};

/// Returns the beginning of a text, for messages.
pub fn truncated(text: &str) -> String {
    let mut out: String = text.chars().take(32).collect();
    if out.len() < text.len() {
        out.push_str("...");
    }
    out
}

/// Allocator of unique names: the names in use and the next number for each stem.
#[derive(Debug, Default)]
pub struct UniqueNames {
    taken: BTreeSet<String>,
    counters: BTreeMap<String, usize>,
}

impl UniqueNames {
    /// Returns the stem if it is free, else the stem with the first free number from 2 on: `chair`,
    /// `chair_2`.
    pub fn allocate(&mut self, stem: &str) -> String {
        if self.taken.insert(stem.to_owned()) {
            stem.to_owned()
        } else {
            self.allocate_numbered(stem, 2)
        }
    }

    /// Returns the stem with the first free number from `first` on, for objects without a name:
    /// `part_1`.
    pub fn allocate_numbered(&mut self, stem: &str, first: usize) -> String {
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
    fn names_are_allocated_once() {
        let mut names = UniqueNames::default();
        let allocated = ["a", "a", "a_2", "a", "b"].map(|stem| names.allocate(stem));
        assert_eq!(allocated, ["a", "a_2", "a_2_2", "a_3", "b"]);
        assert_eq!(
            [
                names.allocate_numbered("c", 1),
                names.allocate_numbered("c", 1),
                names.allocate("c_2")
            ],
            ["c_1", "c_2", "c_2_2"]
        );
    }
}
