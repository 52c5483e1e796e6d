//! A vector that clones share, so that the cells of a sweep hold one copy of what they do not
//! change.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// A vector that clones share until one of them changes it.
#[derive(Clone, Debug, PartialEq)]
pub struct CowVec<T>(Arc<Vec<T>>);

impl<T> Default for CowVec<T> {
    fn default() -> CowVec<T> {
        Vec::new().into()
    }
}

impl<T> From<Vec<T>> for CowVec<T> {
    fn from(vec: Vec<T>) -> CowVec<T> {
        CowVec(Arc::new(vec))
    }
}

impl<T> FromIterator<T> for CowVec<T> {
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> CowVec<T> {
        items.into_iter().collect::<Vec<T>>().into()
    }
}

impl<T> Deref for CowVec<T> {
    type Target = Vec<T>;

    fn deref(&self) -> &Vec<T> {
        &self.0
    }
}

impl<T: Clone> DerefMut for CowVec<T> {
    fn deref_mut(&mut self) -> &mut Vec<T> {
        Arc::make_mut(&mut self.0)
    }
}

impl<T: Clone> IntoIterator for CowVec<T> {
    type Item = T;
    type IntoIter = std::vec::IntoIter<T>;

    fn into_iter(self) -> Self::IntoIter {
        Arc::unwrap_or_clone(self.0).into_iter()
    }
}

impl<'a, T> IntoIterator for &'a CowVec<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a, T: Clone> IntoIterator for &'a mut CowVec<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clones_are_shared_until_one_changes() {
        let first: CowVec<i32> = (0..3).collect();
        let mut second = first.clone();
        assert!(std::ptr::eq(first.as_slice(), second.as_slice()));
        for item in &mut second {
            *item += 1;
        }
        assert_eq!((&first[..], &second[..]), (&[0, 1, 2][..], &[1, 2, 3][..]));
        assert_eq!((&first).into_iter().sum::<i32>(), 3);
        assert_eq!(second.into_iter().sum::<i32>(), 6);
        assert!(CowVec::<i32>::default().is_empty());
    }
}
