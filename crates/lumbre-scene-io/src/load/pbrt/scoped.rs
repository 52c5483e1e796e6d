//! Values by name that can be taken back.

use std::collections::BTreeMap;

/// Values by name, of which those since a mark can be taken back.
#[derive(Debug)]
pub(super) struct Scoped<T> {
    values: BTreeMap<String, T>,
    /// Names that were set, each with its value before.
    changes: Vec<(String, Option<T>)>,
}

impl<T> Default for Scoped<T> {
    fn default() -> Scoped<T> {
        Scoped {
            values: BTreeMap::new(),
            changes: Vec::new(),
        }
    }
}

impl<T> Scoped<T> {
    /// Returns the value of a name.
    pub fn get(&self, name: &str) -> Option<&T> {
        self.values.get(name)
    }

    /// Sets the value of a name.
    pub fn insert(&mut self, name: String, value: T) {
        let before = self.values.insert(name.clone(), value);
        self.changes.push((name, before));
    }

    /// Returns a mark for [`Scoped::restore`].
    pub fn mark(&self) -> usize {
        self.changes.len()
    }

    /// Restores the values of all names to those at a mark.
    pub fn restore(&mut self, mark: usize) {
        for (name, before) in self.changes.drain(mark.min(self.changes.len())..).rev() {
            match before {
                Some(value) => self.values.insert(name, value),
                None => self.values.remove(&name),
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_set_since_a_mark_are_taken_back() {
        let mut names = Scoped::default();
        names.insert("a".to_owned(), 1);
        let outer = names.mark();
        names.insert("a".to_owned(), 2);
        let inner = names.mark();
        names.insert("b".to_owned(), 3);
        names.insert("a".to_owned(), 4);
        names.restore(inner);
        assert_eq!((names.get("a"), names.get("b")), (Some(&2), None));
        names.restore(outer);
        assert_eq!(names.get("a"), Some(&1));
        names.restore(0);
        assert_eq!(names.get("a"), None);
    }
}
