//! Pools of threads beside those that draw.

use crate::error::{Error, Result};
use rayon::ThreadPool;
use thread_priority::ThreadPriority;

/// Starts as many threads as the current pool has; each begins with `start`.
///
/// # Errors
///
/// Fails if the system denies them.
pub fn start_threads(start: fn(usize)) -> Result<ThreadPool> {
    let n_threads = rayon::current_num_threads();
    let threads =
        rayon::ThreadPoolBuilder::new().num_threads(n_threads).start_handler(start).build();
    let advice = "the threads cannot be started; ask for fewer with --threads";
    threads.map_err(|error| Error::Unfit(format!("{advice}: {error}")))
}

/// Gives the current thread the processor time that others leave. A system that denies this shares time evenly.
pub fn lower_priority() {
    let _ = ThreadPriority::Min.set_for_current();
}
