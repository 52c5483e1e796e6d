//! Axes whose values are determined by another axis, as those of zipped axes are. Such an axis does
//! not distinguish runs along the other one.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Returns whether the first element of a pair determines the second: pairs with equal first
/// elements have equal second ones.
pub fn is_determined<A: Ord, B: PartialEq>(pairs: impl IntoIterator<Item = (A, B)>) -> bool {
    let mut known: BTreeMap<A, B> = BTreeMap::new();
    pairs.into_iter().all(|(a, b)| match known.entry(a) {
        Entry::Vacant(slot) => {
            slot.insert(b);
            true
        }
        Entry::Occupied(slot) => *slot.get() == b,
    })
}

/// Formats axis names with their verb: `radius changes` or `radius and samples change`. Returns
/// `None` if there are no names.
pub fn change_phrase(names: &[String]) -> Option<String> {
    let (last, others) = names.split_last()?;
    Some(if others.is_empty() {
        format!("{last} changes")
    } else {
        format!("{} and {last} change", others.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use crate::dependent_axes::*;

    #[test]
    fn a_determined_value_is_the_same_for_equal_keys() {
        assert!(is_determined([(1, 'a'), (2, 'a'), (1, 'a'), (3, 'b')]));
        assert!(
            !is_determined([('a', 1), ('b', 3), ('a', 2)]),
            "two values for the same key"
        );
        assert!(is_determined::<u8, u8>([]));
        assert_eq!(change_phrase(&[]), None);
        assert_eq!(change_phrase(&["a".to_owned()]).unwrap(), "a changes");
        assert_eq!(
            change_phrase(&["a", "b", "c"].map(str::to_owned)).unwrap(),
            "a, b and c change"
        );
    }
}
