//! Locks that are waited for until the work is cancelled.

use crate::error::Result;
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::thread;
use std::time::Duration;
use surfel_core::progress::Progress;

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
        match mutex.try_lock() {
            Ok(guard) => return Ok(guard),
            Err(TryLockError::Poisoned(error)) => return Ok(error.into_inner()),
            Err(TryLockError::WouldBlock) => {
                progress.check()?;
                thread::sleep(POLL_INTERVAL);
            }
        }
    }
}
