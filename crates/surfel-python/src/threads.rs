//! Threads of work that has a number of its own.

use rayon::ThreadPool;
use surfel::description::RunSettings;

/// Starts the threads that settings ask for; none if those of all work will do.
pub fn own_threads(settings: &RunSettings) -> surfel::Result<Option<ThreadPool>> {
    settings.threads.map(|_| surfel::start_threads(settings, |_| ())).transpose()
}

/// Runs `work` on these threads, or on those of all work.
pub fn on_threads<T: Send>(threads: Option<&ThreadPool>, work: impl FnOnce() -> T + Send) -> T {
    match threads {
        Some(threads) => threads.install(work),
        None => work(),
    }
}
