//! Progress reports, notes and cancellation of long work.

use crate::error::{Error, Result};

/// Receives the progress of long work. All threads of that work share it.
///
/// The library neither prints nor exits: a program, a page or a notebook implements this trait.
pub trait Progress: Sync {
    /// Begins a stage of `total` units of work; 0 means that the number is unknown.
    fn begin(&self, _stage: &str, _total: u64) {}

    /// Adds `units` to the finished work of the current stage.
    fn advance(&self, _units: u64) {}

    /// Reports an automatic choice or a number of repairs in one line.
    fn note(&self, _line: &str) {}

    /// One line about a choice made from the data, with the keys of the settings that override it.
    fn choice(&self, line: &str, keys: &[&str]) {
        self.note(&format!("{line} [{}]", keys.join(", ")));
    }

    /// The current stage has ended.
    fn end(&self) {}

    /// Returns true once the work should stop. The work asks many times a second.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// Checks for cancellation, so that work can stop with `?`.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`] once the work should stop.
    fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

/// Ignores all reports and never cancels.
pub struct NoProgress;

impl Progress for NoProgress {}
