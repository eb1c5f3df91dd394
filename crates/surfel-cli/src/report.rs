//! Progress, choices, notes and errors on stderr.

use crate::stdin_copy::with_stdin_named;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::Instant;
use surfel::SceneDescription;
use surfel::description::{Invalid, option_name};
use surfel_core::progress::{Progress, with_keys};

/// The amount of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    /// Errors alone.
    Quiet,
    /// Progress and choices too.
    Normal,
    /// The time of each stage too.
    Verbose,
}

/// Shows bars on a terminal; elsewhere, as in a log, only lines.
pub struct Report<'l> {
    verbosity: Verbosity,
    cancelled: Arc<AtomicBool>,
    stage: Mutex<Option<(String, Instant)>>,
    bar: RwLock<ProgressBar>,
    /// Receives everything too, and may cancel too.
    listener: Option<&'l dyn Progress>,
}

impl<'l> Report<'l> {
    /// A report that nothing has happened in yet.
    pub fn new(verbosity: Verbosity) -> Self {
        Self {
            verbosity,
            cancelled: Arc::default(),
            stage: Mutex::default(),
            bar: RwLock::new(ProgressBar::hidden()),
            listener: None,
        }
    }

    /// Passes everything on to `listener` too.
    pub fn with_listener(self, listener: &dyn Progress) -> Report<'_> {
        Report {
            listener: Some(listener),
            cancelled: self.cancelled,
            ..Report::new(self.verbosity)
        }
    }

    /// Another report of the same kind, for another thread; both are cancelled together.
    pub fn for_thread<'o>(&self) -> Report<'o> {
        Report { cancelled: self.cancellation(), ..Report::new(self.verbosity) }
    }

    /// The flag that stops the work once it is set.
    pub fn cancellation(&self) -> Arc<AtomicBool> {
        self.cancelled.clone()
    }

    /// Reports an error as the last line.
    pub fn error(&self, error: &anyhow::Error) {
        self.close_stage();
        let text = match invalid_option(error) {
            Some(text) => text,
            None => format!("{error:#}"),
        };
        say(&format!("error: {}", with_options(&text.replace('\n', " "))));
    }

    /// Takes the bar away and, if asked for, shows how long the stage took.
    fn close_stage(&self) {
        let bar = self.bar.read().unwrap_or_else(PoisonError::into_inner);
        bar.finish_and_clear();
        let ended = self.stage.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let (Some((stage, start)), Verbosity::Verbose) = (ended, self.verbosity) {
            say(&format!("{stage}: {:.2} s", start.elapsed().as_secs_f64()));
        }
    }

    /// Shows a line beside the bar, unless errors alone are shown.
    fn show(&self, line: &str) {
        if self.verbosity != Verbosity::Quiet {
            self.bar.read().unwrap_or_else(PoisonError::into_inner).suspend(|| say(line));
        }
    }

    fn shows_bars(&self) -> bool {
        self.verbosity != Verbosity::Quiet && std::io::stderr().is_terminal()
    }
}

impl Progress for Report<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.close_stage();
        self.listener.inspect(|listener| listener.begin(stage, total));
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) =
            Some((stage.to_owned(), Instant::now()));
        if self.shows_bars() {
            *self.bar.write().unwrap_or_else(PoisonError::into_inner) = new_bar(stage, total);
        }
    }

    fn advance(&self, units: u64) {
        self.listener.inspect(|listener| listener.advance(units));
        self.bar.read().unwrap_or_else(PoisonError::into_inner).inc(units);
    }

    fn note(&self, line: &str) {
        self.listener.inspect(|listener| listener.note(line));
        self.show(&with_options(line));
    }

    fn choice(&self, line: &str, keys: &[&str]) {
        self.listener.inspect(|listener| listener.choice(line, keys));
        self.show(&with_keys(line, &options(keys)));
    }

    fn warning(&self, line: &str, keys: &[&str]) {
        self.listener.inspect(|listener| listener.warning(line, keys));
        self.show(&format!("warning: {}", with_keys(line, &options(keys))));
    }

    fn end(&self) {
        self.listener.inspect(|listener| listener.end());
        self.close_stage();
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
            || self.listener.is_some_and(|listener| listener.is_cancelled())
    }
}

/// Returns the options of keys.
fn options(keys: &[&str]) -> Vec<String> {
    keys.iter().map(|key| format!("--{}", option_name(key))).collect()
}

/// Replaces the keys that messages of libraries name in brackets at the end of a sentence by their options. Brackets in
/// names of files and columns stay.
fn with_options(text: &str) -> String {
    let known = SceneDescription::keys();
    // Movies are continued by an option that is no key.
    let is_known = |key: &&str| *key == "resume" || known.iter().any(|(path, ..)| path == key);
    let replaced = |part: &str| {
        let (keys, rest) = part.split_once(']')?;
        let keys: Vec<&str> = keys.split(", ").collect();
        let ends = rest.is_empty() || [": ", "; ", ", "].iter().any(|next| rest.starts_with(next));
        let are_keys = ends && keys.iter().all(is_known);
        are_keys.then(|| format!(" [{}]{rest}", options(&keys).join(", ")))
    };
    let mut parts = text.split(" [");
    let start = parts.next().unwrap_or_default().to_owned();
    let others = parts.map(|part| replaced(part).unwrap_or_else(|| format!(" [{part}")));
    others.fold(start, |text, part| text + &part)
}

/// Names the option of a value that is not valid, unless a scene file has it.
fn invalid_option(error: &anyhow::Error) -> Option<String> {
    let invalid = match error.downcast_ref() {
        Some(surfel::Error::Invalid(invalid)) => invalid,
        _ => error.downcast_ref()?,
    };
    let Invalid { file: None, path, .. } = invalid else { return None };
    let (path, property) = match path.strip_prefix("material.") {
        Some(property) => ("material", format!("{property}: ")),
        None => (path.as_str(), String::new()),
    };
    let known = SceneDescription::keys();
    let keys: Vec<&str> = path.split(", ").collect();
    if !keys.iter().all(|key| known.iter().any(|(path, ..)| path == key)) {
        return None;
    }
    let reason = invalid.reason();
    let excluded = reason.strip_prefix("excludes ").and_then(|rest| rest.split_once(';'));
    let reason = match excluded {
        Some((other, advice)) => format!("excludes --{};{advice}", option_name(other)),
        None => reason,
    };
    Some(format!("{}: {property}{reason}", options(&keys).join(", ")))
}

fn new_bar(stage: &str, total: u64) -> ProgressBar {
    let (bar, template) = if 0 < total {
        let template = "{msg:>12} [{bar:32}] {percent:>3} %, {eta} left";
        (ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr()), template)
    } else {
        (ProgressBar::new_spinner(), "{msg:>12} {spinner} {elapsed}")
    };
    let style =
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.with_style(style.progress_chars("=> ")).with_message(stage.to_owned())
}

/// A line on stderr; nobody is left to tell if stderr is closed.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", with_stdin_named(line));
}

/// Results on stdout; no error if nobody reads any more, as after `| head`.
pub fn print(line: &str) -> std::io::Result<()> {
    let mut stdout = std::io::stdout().lock();
    match writeln!(stdout, "{line}").and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}

#[cfg(test)]
mod tests {
    //! Keys in messages, and reports that are passed on.

    use super::*;
    use surfel::progress_log::{ProgressLog, Records};
    use surfel_core::progress::NoProgress;

    #[test]
    fn keys_in_brackets_become_options() {
        for (text, expected) in [
            ("cut short; what is whole can be read [salvage]", "can be read [--salvage]"),
            (
                "stopped [resume]: too large [resolution, memory_limit]",
                "[--resolution, --memory-limit]",
            ),
            ("stopped [resume]: no", "stopped [--resume]: no"),
            ("two numbers as in [0, 255]", "as in [0, 255]"),
            ("object[2].file: no [salvage", "object[2].file: no [salvage"),
            ("all [color, colour]", "all [color, colour]"),
            ("scan[color].laz: 9 points", "scan[color].laz: 9 points"),
            ("a [filter].laz: 9 points", "a [filter].laz: 9 points"),
        ] {
            assert!(with_options(text).ends_with(expected), "{}", with_options(text));
        }
    }

    #[test]
    fn listeners_hear_of_notes_choices_and_warnings() {
        let log = ProgressLog::new(&NoProgress);
        let report = Report::new(Verbosity::Quiet).with_listener(&log);
        report.note("one point");
        report.choice("up is +Z", &["up"]);
        report.warning("no effect", &["reach"]);
        let Records { choices, notes, warnings } = log.into_records();
        let lines = [notes[0].clone(), choices[0].to_string(), warnings[0].to_string()];
        assert_eq!(lines, ["one point", "up is +Z [up]", "no effect [reach]"]);
    }
}
