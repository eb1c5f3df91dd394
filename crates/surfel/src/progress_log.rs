//! Records of the choices that were made from the data, and of notes and warnings.

use std::fmt;
use std::sync::{Mutex, MutexGuard, PoisonError};
use surfel_core::progress::{Progress, with_keys};

/// A choice made from the data, because the description left it open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The choice and its reason, as in `up is +Z, as in survey files`.
    pub reason: String,
    /// Paths of the keys that override it, as in `camera.position`.
    pub keys: Vec<String>,
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&with_keys(&self.reason, &self.keys))
    }
}

/// A hint at what is probably not meant, as a setting that has no effect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The hint in one line.
    pub line: String,
    /// Paths of the keys that concern it; there may be none.
    pub keys: Vec<String>,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&with_keys(&self.line, &self.keys))
    }
}

/// The lines that were reported during work, each kind in its order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Records {
    /// The choices; one that is made again, as for a second cloud, is listed once.
    pub choices: Vec<Choice>,
    /// The notes.
    pub notes: Vec<String>,
    /// The warnings; each is listed once.
    pub warnings: Vec<Warning>,
}

impl Records {
    /// Reports all lines to those who did not hear them when they were reported first.
    pub(crate) fn report(&self, progress: &dyn Progress) {
        fn texts(keys: &[String]) -> Vec<&str> {
            keys.iter().map(String::as_str).collect()
        }
        for line in &self.notes {
            progress.note(line);
        }
        for Choice { reason, keys } in &self.choices {
            progress.choice(reason, &texts(keys));
        }
        for Warning { line, keys } in &self.warnings {
            progress.warning(line, &texts(keys));
        }
    }

    /// Returns all lines: notes, choices, then warnings.
    pub fn into_lines(self) -> Vec<String> {
        let choices = self.choices.iter().map(ToString::to_string);
        let warnings = self.warnings.iter().map(ToString::to_string);
        self.notes.into_iter().chain(choices).chain(warnings).collect()
    }
}

/// Passes progress on, and records choices, notes and warnings.
pub struct ProgressLog<'p> {
    progress: &'p dyn Progress,
    records: Mutex<Records>,
}

impl<'p> ProgressLog<'p> {
    /// An empty record; `progress` hears everything too.
    pub fn new(progress: &'p dyn Progress) -> Self {
        Self { progress, records: Mutex::default() }
    }

    /// A record that goes on behind choices that were made before.
    pub fn after(choices: Vec<Choice>, progress: &'p dyn Progress) -> Self {
        Self { progress, records: Mutex::new(Records { choices, ..Records::default() }) }
    }

    /// Returns the records so far.
    pub fn into_records(self) -> Records {
        self.records.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    fn records(&self) -> MutexGuard<'_, Records> {
        self.records.lock().unwrap_or_else(PoisonError::into_inner)
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
        self.records().notes.push(line.to_owned());
        self.progress.note(line);
    }

    fn choice(&self, line: &str, keys: &[&str]) {
        push_new(&mut self.records().choices, Choice { reason: line.into(), keys: owned(keys) });
        self.progress.choice(line, keys);
    }

    fn warning(&self, line: &str, keys: &[&str]) {
        push_new(&mut self.records().warnings, Warning { line: line.into(), keys: owned(keys) });
        self.progress.warning(line, keys);
    }

    fn end(&self) {
        self.progress.end();
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled()
    }
}

fn owned(keys: &[&str]) -> Vec<String> {
    keys.iter().map(|key| (*key).to_owned()).collect()
}

/// Adds an item unless the list has it.
fn push_new<T: PartialEq>(list: &mut Vec<T>, item: T) {
    if !list.contains(&item) {
        list.push(item);
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

    fn warning(&self, line: &str, keys: &[&str]) {
        self.progress.warning(line, keys);
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
