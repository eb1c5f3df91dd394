//! Locks that are waited for until the work is cancelled.

use crate::error::Result;
use crate::progress::Progress;
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::thread;
use std::time::Duration;

/// Time between two looks at a lock that another thread holds.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Waits for what another thread has locked. Unlike `Mutex::lock`, stops waiting when the caller is cancelled, and takes
/// what a thread that panicked has left.
///
/// # Errors
///
/// Fails if cancelled.
pub fn lock_unless_cancelled<'a, T>(
    mutex: &'a Mutex<T>,
    progress: &dyn Progress,
) -> Result<MutexGuard<'a, T>> {
    loop {
        progress.check()?;
        match mutex.try_lock() {
            Ok(guard) => return Ok(guard),
            Err(TryLockError::Poisoned(error)) => return Ok(error.into_inner()),
            Err(TryLockError::WouldBlock) => thread::sleep(POLL_INTERVAL),
        }
    }
}

#[cfg(test)]
mod tests {
    //! A wait ends with the lock, a panic or cancellation.

    use super::*;
    use crate::error::Error;
    use crate::progress::NoProgress;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Cancels work when it has checked three times.
    #[derive(Default)]
    struct CancelledThird(AtomicU32);

    impl Progress for CancelledThird {
        fn is_cancelled(&self) -> bool {
            2 < self.0.fetch_add(1, Ordering::Relaxed)
        }
    }

    #[test]
    fn a_wait_can_be_cancelled() {
        let mutex = Mutex::new(5);
        let guard = mutex.lock().unwrap();
        let found = lock_unless_cancelled(&mutex, &CancelledThird::default()).map(|guard| *guard);
        assert_eq!(found, Err(Error::Cancelled));
        drop(guard);
        assert_eq!(*lock_unless_cancelled(&mutex, &NoProgress).unwrap(), 5);
    }

    #[test]
    fn what_a_panic_leaves_is_taken() {
        let mutex = Mutex::new(5);
        let work = AssertUnwindSafe(|| {
            let _guard = mutex.lock();
            std::panic::resume_unwind(Box::new(()));
        });
        assert!(catch_unwind(work).is_err());
        assert_eq!(*lock_unless_cancelled(&mutex, &NoProgress).unwrap(), 5);
    }
}
