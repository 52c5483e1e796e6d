//! Axes that move together, as zipped ones do: what follows from an axis tells nothing apart along it.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Whether the second follows from the first in all pairs: wherever the first is the same, so is the second.
pub fn follows<A: Ord, B: PartialEq>(pairs: impl IntoIterator<Item = (A, B)>) -> bool {
    let mut known: BTreeMap<A, B> = BTreeMap::new();
    pairs.into_iter().all(|(a, b)| match known.entry(a) {
        Entry::Vacant(place) => {
            place.insert(b);
            true
        }
        Entry::Occupied(place) => *place.get() == b,
    })
}

/// `radius changes` or `radius and samples change`; `None` without names.
pub fn change(names: &[String]) -> Option<String> {
    let (last, others) = names.split_last()?;
    Some(if others.is_empty() { format!("{last} changes") } else { format!("{} and {last} change", others.join(", ")) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_follows_has_one_value_for_each() {
        assert!(follows([(1, 'a'), (2, 'a'), (1, 'a'), (3, 'b')]));
        assert!(!follows([('a', 1), ('b', 3), ('a', 2)]), "two values where the first is the same");
        assert!(follows::<u8, u8>([]));
        assert_eq!(change(&[]), None);
        assert_eq!(change(&["a".to_owned()]).unwrap(), "a changes");
        assert_eq!(change(&["a", "b", "c"].map(str::to_owned)).unwrap(), "a, b and c change");
    }
}
