//! Time as benchmarks count it: processor time, which other programs do not disturb, and wall time.

use cpu_time::ProcessTime;
use std::time::Instant;

/// A duration in seconds.
#[derive(Clone, Copy, Debug)]
pub struct Elapsed {
    /// Processor time of all threads together.
    pub cpu: f64,
    /// Wall time.
    pub wall: f64,
}

impl Elapsed {
    /// Returns the least of both times.
    pub fn least(self, other: Self) -> Self {
        Self { cpu: self.cpu.min(other.cpu), wall: self.wall.min(other.wall) }
    }
}

/// Returns the result of `work` and its duration.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, Elapsed) {
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let result = work();
    let elapsed = Elapsed { cpu: cpu.elapsed().as_secs_f64(), wall: wall.elapsed().as_secs_f64() };
    (result, elapsed)
}
