//! A deadline for one slice of rendering: a slice that takes longer is cancelled, as other clients wait.

use std::time::{Duration, Instant};
use surfel_core::progress::Progress;

/// Cancels a render slice at its deadline, or when `progress` is cancelled.
pub struct Deadline<'p> {
    progress: &'p dyn Progress,
    end: Option<Instant>,
}

/// Maximum duration of a draft, or of a slice of a finished picture.
pub const SLICE_TIMEOUT: Duration = Duration::from_millis(150);

impl<'p> Deadline<'p> {
    /// A deadline that begins now. A slice of the minimum size has none, as no smaller one can replace it.
    pub fn new(progress: &'p dyn Progress, is_min_size: bool) -> Self {
        Self { progress, end: (!is_min_size).then(|| Instant::now() + SLICE_TIMEOUT) }
    }
}

impl Progress for Deadline<'_> {
    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled() || self.end.is_some_and(|end| end < Instant::now())
    }
}
