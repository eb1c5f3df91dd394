//! Progress of long work as messages: how much is done, and how long the rest takes.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use surfel::progress::Progress;

/// Where long work is.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    pub stage: String,
    /// From 0 to 1, where it is known.
    pub done: Option<f64>,
    pub left_secs: Option<f64>,
}

/// Passes progress on to `tell`, a few times a second, and stops when `is_cancelled` says so.
pub struct Telling<T, C> {
    pub tell: T,
    pub is_cancelled: C,
    stage: Mutex<Option<Stage>>,
    n_done: AtomicU64,
}

struct Stage {
    name: String,
    total: u64,
    start: Instant,
    told: Instant,
}

const EVERY: Duration = Duration::from_millis(100);

impl<T: Fn(Told) + Sync, C: Fn() -> bool + Sync> Telling<T, C> {
    pub fn new(tell: T, is_cancelled: C) -> Self {
        Self { tell, is_cancelled, stage: Mutex::default(), n_done: AtomicU64::new(0) }
    }
}

impl<T: Fn(Told) + Sync, C: Fn() -> bool + Sync> Progress for Telling<T, C> {
    fn begin(&self, name: &str, total: u64) {
        let now = Instant::now();
        let stage = Stage { name: name.to_owned(), total, start: now, told: now };
        self.n_done.store(0, Ordering::Relaxed);
        (self.tell)(stage.told(0, now));
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = Some(stage);
    }

    fn advance(&self, units: u64) {
        let n_done = units + self.n_done.fetch_add(units, Ordering::Relaxed);
        // Whoever does not get the lock leaves telling to the one who has it.
        let Ok(mut stage) = self.stage.try_lock() else { return };
        let now = Instant::now();
        if let Some(stage) = stage.as_mut().filter(|stage| EVERY <= now - stage.told) {
            stage.told = now;
            (self.tell)(stage.told(n_done, now));
        }
    }

    fn is_cancelled(&self) -> bool {
        (self.is_cancelled)()
    }
}

impl Stage {
    fn told(&self, n_done: u64, now: Instant) -> Told {
        let done = (0 < self.total).then(|| (n_done as f64 / self.total as f64).min(1.0));
        let secs = (now - self.start).as_secs_f64();
        let left_secs = done.filter(|done| 0.02 < *done).map(|done| secs * (1.0 - done) / done);
        Told { stage: self.name.clone(), done, left_secs }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_and_shares_are_told() {
        let told = Mutex::new(Vec::new());
        let telling = Telling::new(|line| told.lock().unwrap().push(line), || false);
        telling.begin("load", 10);
        std::thread::sleep(EVERY);
        telling.advance(5);
        telling.advance(1);
        telling.begin("normals", 0);
        let told = told.lock().unwrap();
        let names: Vec<&str> = told.iter().map(|line| line.stage.as_str()).collect();
        assert_eq!(names, ["load", "load", "normals"]);
        assert_eq!((told[1].done, told[2].done), (Some(0.5), None));
        assert!((told[1].left_secs.unwrap() - EVERY.as_secs_f64()).abs() < 0.1);
    }
}
