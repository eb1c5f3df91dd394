//! A cache of the last two results of long work, shared by threads.

use crate::error::Result;
use crate::progress_log::{ProgressLog, Records};
use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use surfel_core::locks::lock_unless_cancelled;
use surfel_core::progress::Progress;

/// The last two results, by the hashes of what they were made from: people who compare settings go back and forth.
#[derive(Debug)]
pub struct Lru2<T> {
    /// The results, the latest last. Held for moments only, so that known results are returned while another is made.
    entries: Mutex<Entries<T>>,
    /// Held while a result is made.
    making: Mutex<()>,
}

type Entries<T> = VecDeque<Entry<T>>;

#[derive(Debug)]
struct Entry<T> {
    key: u64,
    value: Arc<T>,
    /// The lines that were reported while the result was made.
    records: Arc<Records>,
}

const CAPACITY: usize = 2;

impl<T> Default for Lru2<T> {
    fn default() -> Self {
        Self { entries: Mutex::default(), making: Mutex::default() }
    }
}

impl<T> Lru2<T> {
    /// Returns the result for `key`, made now unless it is known. One result is made at a time: several callers that
    /// want the same wait for one of them. Each caller hears what was reported while it was made.
    pub fn get_or_make(
        &self,
        key: u64,
        progress: &dyn Progress,
        make: impl FnOnce(&dyn Progress) -> Result<T>,
    ) -> Result<Arc<T>> {
        if let Some(known) = self.find(key, progress) {
            return Ok(known);
        }
        let _making = lock_unless_cancelled(&self.making, progress)?;
        // Another caller may have made it in the meantime.
        if let Some(known) = self.find(key, progress) {
            return Ok(known);
        }
        // Before the new one takes as much memory.
        self.drop_oldest();
        let log = ProgressLog::new(progress);
        let value = Arc::new(make(&log)?);
        let records = log.into_records().into();
        self.entries().push_back(Entry { key, value: value.clone(), records });
        Ok(value)
    }

    /// Forgets all results but one that is being made.
    pub fn clear(&self) {
        let all = std::mem::take(&mut *self.entries());
        drop(all);
    }

    /// Returns true if the result for `key` is known.
    pub fn contains(&self, key: u64) -> bool {
        self.entries().iter().any(|entry| entry.key == key)
    }

    /// Returns the result for `key` if it is known, which is the latest then, and reports its lines.
    fn find(&self, key: u64, progress: &dyn Progress) -> Option<Arc<T>> {
        let mut entries = self.entries();
        let i = entries.iter().position(|entry| entry.key == key)?;
        let found = entries.remove(i)?;
        let (value, records) = (found.value.clone(), found.records.clone());
        entries.push_back(found);
        drop(entries);
        records.report(progress);
        Some(value)
    }

    /// Drops the oldest results, so that another fits.
    fn drop_oldest(&self) {
        let mut entries = self.entries();
        let n_surplus = (entries.len() + 1).saturating_sub(CAPACITY);
        let surplus: Entries<T> = entries.drain(..n_surplus).collect();
        // Freeing takes long: without the lock.
        drop(entries);
        drop(surplus);
    }

    fn entries(&self) -> MutexGuard<'_, Entries<T>> {
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
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
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;
    use surfel_core::progress::NoProgress;

    struct Cancelled;

    impl Progress for Cancelled {
        fn is_cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn the_last_two_results_are_kept() {
        let (cache, mut n_computed) = (Lru2::default(), 0);
        for key in [1, 2, 1, 2, 3, 2, 1] {
            let value = cache.get_or_make(key, &NoProgress, |_| {
                n_computed += 1;
                Ok(key)
            });
            assert_eq!(*value.unwrap(), key);
        }
        assert_eq!([1, 2, 3].map(|key| cache.contains(key)), [true, true, false]);
        assert_eq!(n_computed, 4);
        cache.clear();
        assert!(!cache.contains(1) && !cache.contains(2));
    }

    #[test]
    fn known_results_are_returned_while_another_is_made() {
        let cache = Lru2::<i32>::default();
        cache.get_or_make(1, &NoProgress, |_| Ok(10)).unwrap();
        let value = cache.get_or_make(2, &NoProgress, |_| {
            assert!(cache.contains(1) && !cache.contains(2));
            // A cancelled caller does not wait.
            assert!(cache.get_or_make(3, &Cancelled, |_| Ok(30)).is_err());
            Ok(2 * *cache.get_or_make(1, &Cancelled, |_| Ok(11))?)
        });
        assert_eq!(*value.unwrap(), 20);
        assert!(cache.contains(1) && cache.contains(2));
    }

    #[test]
    fn known_results_come_with_the_lines_that_were_reported_with_them() {
        let (inner, outer) = (Lru2::<i32>::default(), Lru2::<i32>::default());
        let lines = |key: u64| {
            let log = ProgressLog::new(&NoProgress);
            let make_inner = |progress: &dyn Progress| {
                progress.choice("radii of 12 neighbours", &["radius"]);
                progress.warning("has no effect", &["normals"]);
                Ok(1)
            };
            let make_outer = |progress: &dyn Progress| {
                let inner = inner.get_or_make(1, progress, make_inner)?;
                progress.choice(&format!("tree {key}"), &[]);
                Ok(*inner)
            };
            outer.get_or_make(key, &log, make_outer).unwrap();
            log.into_records().into_lines()
        };
        for key in [1, 1, 2, 2, 1] {
            let tree = format!("tree {key}");
            let expected = ["radii of 12 neighbours [radius]", &tree, "has no effect [normals]"];
            assert_eq!(lines(key), expected);
        }
    }

    #[test]
    fn two_callers_of_one_key_make_it_once() {
        let cache = Lru2::default();
        let (n_computed, start) = (AtomicUsize::new(0), Barrier::new(2));
        let call = || {
            start.wait();
            let value = cache.get_or_make(1, &NoProgress, |_| {
                std::thread::sleep(Duration::from_millis(20));
                Ok(n_computed.fetch_add(1, Ordering::Relaxed))
            });
            *value.unwrap()
        };
        std::thread::scope(|scope| {
            let calls = [scope.spawn(call), scope.spawn(call)];
            assert_eq!(calls.map(|call| call.join().unwrap()), [0, 0]);
        });
        assert_eq!(n_computed.into_inner(), 1);
    }
}
