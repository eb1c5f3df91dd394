//! Progress of long work as updates for a page: the fraction done, and an estimate of the time left.

use crate::lock::lock;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use surfel_core::progress::Progress;

/// The progress of long work at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgressUpdate {
    /// The name of the work's current stage.
    pub stage: String,
    /// The fraction of the stage that is done, from 0 to 1, if it is known.
    pub done: Option<f64>,
    /// The estimated time until the stage ends, in seconds, if there is enough to estimate it from.
    pub left_secs: Option<f64>,
}

/// Passes progress to `report` a few times a second, and cancels the work when `is_cancelled` returns true.
pub struct ProgressReporter<R, C, N = fn() -> Instant> {
    report: R,
    is_cancelled: C,
    now: N,
    stage: Mutex<Option<Stage>>,
    n_done: AtomicU64,
}

struct Stage {
    name: String,
    n_total: u64,
    start: Instant,
    last_update: Instant,
}

/// Minimum duration between two updates of one stage.
const UPDATE_INTERVAL: Duration = Duration::from_millis(100);
/// Minimum fraction done from which the time left is estimated.
const MIN_DONE_TO_ESTIMATE: f64 = 0.02;

impl<R: Fn(ProgressUpdate) + Sync, C: Fn() -> bool + Sync> ProgressReporter<R, C> {
    /// A reporter that reads the system's clock.
    pub fn new(report: R, is_cancelled: C) -> Self {
        Self::with_clock(report, is_cancelled, Instant::now)
    }
}

impl<R, C, N> ProgressReporter<R, C, N> {
    /// A reporter that takes the time from `now`.
    pub fn with_clock(report: R, is_cancelled: C, now: N) -> Self {
        Self { report, is_cancelled, now, stage: Mutex::default(), n_done: AtomicU64::new(0) }
    }
}

impl<R, C, N> Progress for ProgressReporter<R, C, N>
where
    R: Fn(ProgressUpdate) + Sync,
    C: Fn() -> bool + Sync,
    N: Fn() -> Instant + Sync,
{
    fn begin(&self, name: &str, total: u64) {
        let now = (self.now)();
        let stage = Stage { name: name.to_owned(), n_total: total, start: now, last_update: now };
        self.n_done.store(0, Ordering::Relaxed);
        (self.report)(stage.update(0, now));
        *lock(&self.stage) = Some(stage);
    }

    fn advance(&self, units: u64) {
        let n_done = units + self.n_done.fetch_add(units, Ordering::Relaxed);
        // A thread that does not get the lock skips its update: another one is reporting.
        let Ok(mut stage) = self.stage.try_lock() else { return };
        let now = (self.now)();
        let due = stage.as_mut().filter(|stage| UPDATE_INTERVAL <= now - stage.last_update);
        if let Some(stage) = due {
            stage.last_update = now;
            (self.report)(stage.update(n_done, now));
        }
    }

    fn is_cancelled(&self) -> bool {
        (self.is_cancelled)()
    }
}

impl Stage {
    fn update(&self, n_done: u64, now: Instant) -> ProgressUpdate {
        let done = (0 < self.n_total).then(|| (n_done as f64 / self.n_total as f64).min(1.0));
        let secs = (now - self.start).as_secs_f64();
        let known = done.filter(|done| MIN_DONE_TO_ESTIMATE < *done);
        let left_secs = known.map(|done| secs * (1.0 - done) / done);
        ProgressUpdate { stage: self.name.clone(), done, left_secs }
    }
}

#[cfg(test)]
mod tests {
    //! The content of progress updates, and the interval between them.

    use super::*;

    #[test]
    fn updates_carry_stage_fraction_and_time_left_at_most_once_an_interval() {
        let updates = Mutex::new(Vec::new());
        let now = Mutex::new(Instant::now());
        let pass = |duration: Duration| *now.lock().unwrap() += duration;
        let report = |update| updates.lock().unwrap().push(update);
        let reporter = ProgressReporter::with_clock(report, || false, || *now.lock().unwrap());
        reporter.begin("load", 10);
        pass(UPDATE_INTERVAL - Duration::from_millis(1));
        reporter.advance(4);
        pass(Duration::from_millis(1));
        reporter.advance(1);
        reporter.advance(1);
        reporter.begin("normals", 0);
        let update = |stage: &str, done, left_secs| ProgressUpdate {
            stage: stage.to_owned(),
            done,
            left_secs,
        };
        let expected = [
            update("load", Some(0.0), None),
            update("load", Some(0.5), Some(UPDATE_INTERVAL.as_secs_f64())),
            update("normals", None, None),
        ];
        assert_eq!(*updates.lock().unwrap(), expected);
    }
}
