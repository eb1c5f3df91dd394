//! Gives up what takes long, for something smaller: others are waiting.

use std::time::{Duration, Instant};
use surfel::progress::Progress;

/// Work that ends when `progress` says so, and after a while.
pub struct Hurry<'p> {
    progress: &'p dyn Progress,
    until: Option<Instant>,
}

/// Of a draft, or a piece of a finished picture.
pub const LONG: Duration = Duration::from_millis(150);

impl<'p> Hurry<'p> {
    /// What is already as small as can be takes what it takes.
    pub fn new(progress: &'p dyn Progress, is_least: bool) -> Self {
        Self { progress, until: (!is_least).then(|| Instant::now() + LONG) }
    }
}

impl Progress for Hurry<'_> {
    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled() || self.until.is_some_and(|until| until < Instant::now())
    }
}
