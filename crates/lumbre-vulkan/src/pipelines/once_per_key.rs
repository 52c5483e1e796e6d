//! Values that are created once for each key, different ones at the same time.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Key: a hash.
type Key = [u8; 32];

/// Value that may not be created yet; locked while it is created.
type Slot<V> = Arc<Mutex<Option<V>>>;

/// Values by key. A value is created by the first thread that asks for it, while others that ask
/// for the same one wait and those that ask for another one do not.
pub struct OncePerKey<V>(Mutex<BTreeMap<Key, Slot<V>>>);

impl<V> Default for OncePerKey<V> {
    fn default() -> Self {
        OncePerKey(Mutex::default())
    }
}

/// Locks a mutex, also one whose owner panicked.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<V: Copy> OncePerKey<V> {
    /// Returns the value of a key, created by `create` unless it exists.
    ///
    /// # Errors
    /// Returns the error of `create`; the next call creates the value.
    pub fn get_or_create<E>(
        &self,
        key: Key,
        create: impl FnOnce() -> Result<V, E>,
    ) -> Result<V, E> {
        let slot = Arc::clone(lock(&self.0).entry(key).or_default());
        let mut value = lock(&slot);
        if let Some(value) = *value {
            return Ok(value);
        }
        let made = create()?;
        *value = Some(made);
        Ok(made)
    }

    /// Returns all values that exist; waits for those that are being created.
    pub fn values(&self) -> Vec<V> {
        let slots: Vec<Slot<V>> = lock(&self.0).values().cloned().collect();
        slots.iter().filter_map(|slot| *lock(slot)).collect()
    }

    /// Removes all values.
    pub fn clear(&self) {
        lock(&self.0).clear();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    #[test]
    fn different_values_are_created_at_the_same_time_and_equal_ones_once() {
        let (values, both, created) = (
            OncePerKey::<u8>::default(),
            Barrier::new(2),
            AtomicU32::new(0),
        );
        std::thread::scope(|scope| {
            for key in [1, 2, 1, 2] {
                let (values, both, created) = (&values, &both, &created);
                scope.spawn(move || {
                    let made = values.get_or_create([key; 32], || {
                        // Returns only while the other value is created as well.
                        both.wait();
                        created.fetch_add(1, Ordering::Relaxed);
                        Ok::<_, ()>(key)
                    });
                    assert_eq!(made, Ok(key));
                });
            }
        });
        assert_eq!(created.load(Ordering::Relaxed), 2);
        assert_eq!(values.values(), [1, 2]);
        assert_eq!(
            values.get_or_create([3; 32], || Err("refused")),
            Err("refused")
        );
        assert_eq!(values.get_or_create([3; 32], || Ok::<_, &str>(3)), Ok(3));
        values.clear();
        assert!(values.values().is_empty());
    }
}
