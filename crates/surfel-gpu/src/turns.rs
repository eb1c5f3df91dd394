//! Turns at a device: a picture waits until those before it are rendered, and can be cancelled meanwhile.

use std::ops::{Deref, DerefMut};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;
use surfel_core::progress::Progress;

/// Time between two checks for cancellation.
const CHECK_INTERVAL: Duration = Duration::from_millis(10);

/// A value that one thread at a time uses.
#[derive(Debug)]
pub struct Turns<T> {
    value: Mutex<T>,
    end: End,
}

/// The end of a turn, of which one that waits is told.
#[derive(Debug, Default)]
struct End {
    gate: Mutex<()>,
    has_come: Condvar,
}

/// A turn with the value.
pub struct Turn<'a, T> {
    // Fields are dropped in this order: the value is free when the end is told.
    value: MutexGuard<'a, T>,
    _teller: Teller<'a>,
}

/// Tells the end of a turn when it is dropped.
struct Teller<'a>(&'a End);

impl Drop for Teller<'_> {
    fn drop(&mut self) {
        let _gate = self.0.gate.lock().unwrap_or_else(PoisonError::into_inner);
        self.0.has_come.notify_one();
    }
}

impl<T> Turns<T> {
    /// Makes the turns with a value.
    pub fn new(value: T) -> Self {
        Self { value: Mutex::new(value), end: End::default() }
    }

    /// Waits for a turn.
    pub fn wait(&self) -> Turn<'_, T> {
        loop {
            if let Some(turn) = self.wait_shortly() {
                return turn;
            }
        }
    }

    /// Waits for a turn.
    ///
    /// # Errors
    ///
    /// Fails once `progress` is cancelled.
    pub fn wait_with(&self, progress: &dyn Progress) -> surfel_core::Result<Turn<'_, T>> {
        loop {
            progress.check()?;
            if let Some(turn) = self.wait_shortly() {
                return Ok(turn);
            }
        }
    }

    /// Returns a turn, or none after the end of another or after `CHECK_INTERVAL`.
    fn wait_shortly(&self) -> Option<Turn<'_, T>> {
        let End { gate, has_come } = &self.end;
        // No turn ends between the look at the value and the wait.
        let gate = gate.lock().unwrap_or_else(PoisonError::into_inner);
        let value = match self.value.try_lock() {
            Ok(value) => value,
            // A panic leaves a value that can be used, by the promise of those who take turns.
            Err(TryLockError::Poisoned(error)) => error.into_inner(),
            Err(TryLockError::WouldBlock) => {
                drop(has_come.wait_timeout(gate, CHECK_INTERVAL));
                return None;
            }
        };
        Some(Turn { value, _teller: Teller(&self.end) })
    }
}

impl<T> Deref for Turn<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Turn<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

#[cfg(test)]
mod tests {
    //! One thread at a time has its turn, and a wait can be cancelled.

    use super::*;
    use crate::test_support::CancelledAfter;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::thread;
    use surfel_core::Error;
    use surfel_core::progress::NoProgress;

    #[test]
    fn a_wait_can_be_cancelled() {
        let turns = Turns::new(5);
        let turn = turns.wait();
        for n in [0, 3] {
            let found = turns.wait_with(&CancelledAfter::new(n)).map(|turn| *turn);
            assert_eq!(found, Err(Error::Cancelled));
        }
        drop(turn);
        assert_eq!(turns.wait_with(&NoProgress).map(|turn| *turn), Ok(5));
    }

    #[test]
    fn one_thread_at_a_time_has_its_turn() {
        let turns = &Turns::new(0);
        let count = || {
            for _ in 0..100 {
                let mut turn = turns.wait();
                let before = *turn;
                thread::yield_now();
                *turn = before + 1;
            }
        };
        thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(count))));
        assert_eq!(*turns.wait(), 400);
    }

    #[test]
    fn a_panic_ends_a_turn() {
        let turns = Turns::new(5);
        let work = AssertUnwindSafe(|| {
            let _turn = turns.wait();
            std::panic::resume_unwind(Box::new(()));
        });
        assert!(catch_unwind(work).is_err());
        assert_eq!(*turns.wait(), 5);
    }
}
