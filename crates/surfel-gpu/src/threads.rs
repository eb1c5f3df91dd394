//! Work in several threads that are none of rayon's: one of those that waits for its tasks may begin another picture on
//! this device, which would wait for the first one without end.

use std::sync::{Mutex, PoisonError};
use std::thread;

/// Maximum number of threads. Few of them copy as many bytes as a bus transfers.
const MAX_THREADS: usize = 8;

/// Does `work` on each piece, in this thread and in others, at most one a piece. If the system starts no more threads, those
/// that run do the rest.
pub fn for_each<T: Send>(pieces: Vec<T>, work: impl Fn(T) + Sync) {
    let n_threads = pieces.len().min(rayon::current_num_threads()).min(MAX_THREADS);
    let pieces = Mutex::new(pieces.into_iter());
    let next = || pieces.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work_off = || {
        while let Some(piece) = next() {
            work(piece);
        }
    };
    thread::scope(|scope| {
        for _ in 1..n_threads {
            // Without the thread the others do its work.
            let _ = thread::Builder::new().spawn_scoped(scope, work_off);
        }
        work_off();
    });
}

#[cfg(test)]
mod tests {
    //! Each piece is worked on once.

    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    #[test]
    fn each_piece_is_worked_on_once() {
        for n in [0, 1, 5, 100] {
            let counts: Vec<AtomicU32> = (0..n).map(|_| AtomicU32::new(0)).collect();
            for_each(counts.iter().collect(), |count: &AtomicU32| {
                count.fetch_add(1, Ordering::Relaxed);
            });
            assert!(counts.iter().all(|count| count.load(Ordering::Relaxed) == 1));
        }
    }
}
