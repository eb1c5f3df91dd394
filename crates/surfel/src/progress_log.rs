//! Records of the choices that were made from the data, and of the notes about files.

use std::sync::{Mutex, PoisonError};
use surfel_core::progress::Progress;

/// A choice made from the data, because the description left it open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The choice and its reason, as in `up is +Z, as in survey files`.
    pub reason: String,
    /// Paths of the keys that override it, as in `camera.position`.
    pub keys: Vec<String>,
}

/// Passes progress on, and records the choices and the notes.
pub struct ProgressLog<'p> {
    progress: &'p dyn Progress,
    choices: Mutex<Vec<Choice>>,
    notes: Mutex<Vec<String>>,
}

impl<'p> ProgressLog<'p> {
    /// An empty record; `progress` hears everything too.
    pub fn new(progress: &'p dyn Progress) -> Self {
        Self { progress, choices: Mutex::default(), notes: Mutex::default() }
    }

    /// Returns the choices so far, in their order.
    pub fn into_choices(self) -> Vec<Choice> {
        self.choices.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the notes so far, in their order.
    pub fn into_notes(self) -> Vec<String> {
        self.notes.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for ProgressLog<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.progress.begin(stage, total);
    }

    fn advance(&self, units: u64) {
        self.progress.advance(units);
    }

    fn note(&self, line: &str) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(line.to_owned());
        self.progress.note(line);
    }

    fn choice(&self, line: &str, keys: &[&str]) {
        let keys_owned = keys.iter().map(|key| (*key).to_owned()).collect();
        let choice = Choice { reason: line.to_owned(), keys: keys_owned };
        self.choices.lock().unwrap_or_else(PoisonError::into_inner).push(choice);
        self.progress.choice(line, keys);
    }

    fn end(&self) {
        self.progress.end();
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled()
    }
}

/// Reports each note as a choice that these keys override.
pub(crate) struct NotesAsChoices<'p> {
    /// Receives everything.
    pub progress: &'p dyn Progress,
    /// Keys that override the choices.
    pub keys: &'static [&'static str],
}

impl Progress for NotesAsChoices<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.progress.begin(stage, total);
    }

    fn advance(&self, units: u64) {
        self.progress.advance(units);
    }

    fn note(&self, line: &str) {
        self.progress.choice(line, self.keys);
    }

    fn choice(&self, line: &str, keys: &[&str]) {
        self.progress.choice(line, keys);
    }

    fn end(&self) {
        self.progress.end();
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled()
    }
}

/// Passes on cancellation alone, for work that the user need not know of.
pub(crate) struct CancelOnly<'p>(pub &'p dyn Progress);

impl Progress for CancelOnly<'_> {
    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}
