//! Time as benchmarks count it: of the processor, which other programs do not disturb, and of the wall.

use cpu_time::ProcessTime;
use std::time::Instant;

/// Seconds.
#[derive(Clone, Copy, Debug)]
pub struct Spent {
    /// Of the processor, all threads together.
    pub cpu: f64,
    pub wall: f64,
}

impl Spent {
    pub fn least(self, other: Self) -> Self {
        Self { cpu: self.cpu.min(other.cpu), wall: self.wall.min(other.wall) }
    }
}

pub fn timed<T>(work: impl FnOnce() -> T) -> (T, Spent) {
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let result = work();
    let spent = Spent { cpu: cpu.elapsed().as_secs_f64(), wall: wall.elapsed().as_secs_f64() };
    (result, spent)
}
