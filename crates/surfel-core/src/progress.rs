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

    /// Reports in one line what was found or done, as a number of repairs.
    fn note(&self, _line: &str) {}

    /// Reports in one line a choice made from the data, with the keys of the settings that override it.
    fn choice(&self, line: &str, keys: &[&str]) {
        self.note(&with_keys(line, keys));
    }

    /// Reports in one line what is probably not meant, with the keys of the settings that concern it, if there are any.
    fn warning(&self, line: &str, keys: &[&str]) {
        self.note(&format!("warning: {}", with_keys(line, keys)));
    }

    /// Ends the current stage.
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

/// Returns a line with the keys of settings behind it, in brackets; without any, the line.
pub fn with_keys(line: &str, keys: &[impl AsRef<str>]) -> String {
    let names: Vec<&str> = keys.iter().map(AsRef::as_ref).collect();
    if names.is_empty() { line.to_owned() } else { format!("{line} [{}]", names.join(", ")) }
}

/// Ignores all reports and never cancels.
pub struct NoProgress;

impl Progress for NoProgress {}
