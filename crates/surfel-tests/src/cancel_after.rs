//! Work that is cancelled at one of its checks.

use std::sync::atomic::{AtomicU64, Ordering};
use surfel_core::progress::Progress;

/// Cancels work when it has checked a number of times whether it is cancelled.
pub struct CancelAfter {
    n_left: AtomicU64,
}

impl CancelAfter {
    /// Lets `n_checks` checks pass.
    pub fn new(n_checks: u64) -> Self {
        Self { n_left: AtomicU64::new(n_checks) }
    }

    /// Returns the number of checks that may still pass.
    pub fn n_left(&self) -> u64 {
        self.n_left.load(Ordering::Relaxed)
    }
}

impl Progress for CancelAfter {
    fn is_cancelled(&self) -> bool {
        let pass = |n_left: u64| n_left.checked_sub(1);
        self.n_left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, pass).is_err()
    }
}
