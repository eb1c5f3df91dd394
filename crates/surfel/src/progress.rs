//! Progress, notes and cancellation of long work: the one way out of the library besides its results.

use crate::error::{Error, Result};

/// Receives what long work has to tell; shared by all threads of that work.
///
/// The library neither prints nor exits: a program, a page or a notebook implements this.
pub trait Progress: Sync {
    /// A stage of the work begins, `total` units long (0 = not known).
    fn begin(&self, _stage: &str, _total: u64) {}

    /// `units` more of the current stage are done.
    fn advance(&self, _units: u64) {}

    /// One line about an automatic choice or a counted repair.
    fn note(&self, _line: &str) {}

    /// True once the work should stop; asked many times a second.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// `Err(Error::Cancelled)` once the work should stop, to be left with `?`.
    fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

/// Listens to nothing and never cancels.
pub struct Silent;

impl Progress for Silent {}
