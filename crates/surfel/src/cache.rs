//! A cache of the last two results of long work, shared by threads.

use crate::error::Result;
use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;
use surfel_core::progress::Progress;

/// The last two results, by the hashes of what they were made from: people who compare settings go back and forth.
#[derive(Debug)]
pub struct Lru2<T>(Mutex<Entries<T>>);

type Entries<T> = VecDeque<(u64, Arc<T>)>;

const CAPACITY: usize = 2;

/// Time between two looks at a lock that another thread holds.
const LOCK_POLL_INTERVAL: Duration = Duration::from_millis(2);

impl<T> Default for Lru2<T> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<T> Lru2<T> {
    /// Returns the result for `key`, made now unless it is known. One result is made at a time: several callers that
    /// want the same wait for one of them.
    pub fn get_or_make(
        &self,
        key: u64,
        progress: &dyn Progress,
        make: impl FnOnce() -> Result<T>,
    ) -> Result<Arc<T>> {
        let mut entries = self.lock(progress)?;
        if let Some(i) = entries.iter().position(|(other, _)| *other == key)
            && let Some(found) = entries.remove(i)
        {
            entries.push_back(found.clone());
            return Ok(found.1);
        }
        // Before the new one takes as much memory.
        while CAPACITY <= entries.len() {
            entries.pop_front();
        }
        let made = Arc::new(make()?);
        entries.push_back((key, made.clone()));
        Ok(made)
    }

    /// Forgets all results but one that is being made.
    pub fn clear(&self) {
        match self.0.try_lock() {
            Ok(mut entries) => entries.clear(),
            Err(TryLockError::Poisoned(error)) => error.into_inner().clear(),
            Err(TryLockError::WouldBlock) => {}
        }
    }

    /// Returns true if the result for `key` is known, false too while another is made.
    pub fn contains(&self, key: u64) -> bool {
        let entries = match self.0.try_lock() {
            Ok(entries) => entries,
            Err(TryLockError::Poisoned(error)) => PoisonError::into_inner(error),
            Err(TryLockError::WouldBlock) => return false,
        };
        entries.iter().any(|(known, _)| *known == key)
    }

    /// Unlike `Mutex::lock`, stops waiting when the caller is cancelled.
    fn lock(&self, progress: &dyn Progress) -> Result<MutexGuard<'_, Entries<T>>> {
        loop {
            match self.0.try_lock() {
                Ok(entries) => return Ok(entries),
                Err(TryLockError::Poisoned(error)) => return Ok(PoisonError::into_inner(error)),
                Err(TryLockError::WouldBlock) => {
                    progress.check()?;
                    std::thread::sleep(LOCK_POLL_INTERVAL);
                }
            }
        }
    }
}

/// Returns a hash of a value's text, the same for equal values within a run of the program.
pub fn hash_of(value: &serde_json::Value) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.to_string().hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    //! The last two results are kept, older ones dropped.

    use super::*;
    use surfel_core::progress::NoProgress;

    #[test]
    fn the_last_two_results_are_kept() {
        let (cache, mut n_made) = (Lru2::default(), 0);
        for key in [1, 2, 1, 2, 3, 2, 1] {
            let made = cache.get_or_make(key, &NoProgress, || {
                n_made += 1;
                Ok(key)
            });
            assert_eq!(*made.unwrap(), key);
        }
        assert_eq!([1, 2, 3].map(|key| cache.contains(key)), [true, true, false]);
        assert_eq!(n_made, 4);
        cache.clear();
        assert!(!cache.contains(1) && !cache.contains(2));
    }
}
