//! Threads of work that has a number of its own.

use rayon::{ThreadPool, ThreadPoolBuilder};
use surfel::Error;
use surfel::description::RunSettings;

/// Starts the threads that settings ask for; none if those of all work will do.
pub fn start_threads(settings: &RunSettings) -> surfel::Result<Option<ThreadPool>> {
    let Some(n_threads) = settings.threads else { return Ok(None) };
    let threads = ThreadPoolBuilder::new().num_threads(n_threads as usize).build();
    threads.map(Some).map_err(|error| {
        Error::Unfit(format!("the threads cannot be started; ask for fewer with threads: {error}"))
    })
}

/// Runs `work` on these threads, or on those of all work.
pub fn on_threads<T: Send>(threads: Option<&ThreadPool>, work: impl FnOnce() -> T + Send) -> T {
    match threads {
        Some(threads) => threads.install(work),
        None => work(),
    }
}
