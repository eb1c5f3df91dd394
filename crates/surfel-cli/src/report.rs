//! What the user sees of the work: progress, notes and errors, all on stderr.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::Instant;
use surfel::progress::Progress;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    Quiet,
    Normal,
    Verbose,
}

/// Shows bars on a terminal; elsewhere, as in a log, only lines.
pub struct Report<'l> {
    verbosity: Verbosity,
    cancelled: Arc<AtomicBool>,
    stage: Mutex<Option<(String, Instant)>>,
    bar: RwLock<ProgressBar>,
    /// Hears all of it, and may cancel, too.
    pub listener: Option<&'l dyn Progress>,
}

impl<'l> Report<'l> {
    pub fn new(verbosity: Verbosity) -> Self {
        Self {
            verbosity,
            cancelled: Arc::default(),
            stage: Mutex::default(),
            bar: RwLock::new(ProgressBar::hidden()),
            listener: None,
        }
    }

    /// One that tells nothing but what `listener` hears.
    pub fn heard_by(listener: &'l dyn Progress) -> Self {
        Self { listener: Some(listener), ..Self::new(Verbosity::Quiet) }
    }

    /// The same as this one, for another thread's work.
    pub fn for_thread<'o>(&self) -> Report<'o> {
        Report { cancelled: self.cancellation(), ..Report::new(self.verbosity) }
    }

    /// Set from outside, it stops the work.
    pub fn cancellation(&self) -> Arc<AtomicBool> {
        self.cancelled.clone()
    }

    /// One that tells nothing, for work that the user need not know of; both are cancelled together.
    pub fn muted(&self) -> Self {
        Self { cancelled: self.cancellation(), ..Self::new(Verbosity::Quiet) }
    }

    /// An automatic choice with the flag that makes it.
    pub fn choice(&self, line: &str, flag: &str) {
        self.note(&format!("{line} [{flag}]"));
    }

    /// Passes notes on with the flag that changes what they tell.
    pub fn with_flag<'a>(&'a self, flag: &'a str) -> WithFlag<'a> {
        WithFlag { report: self, flag }
    }

    pub fn error(&self, error: &anyhow::Error) {
        self.end_stage();
        let text = format!("{error:#}").replace('\n', " ");
        say(&format!("error: {text}"));
    }

    /// Takes the bar away and, if asked for, tells how long the last stage took.
    pub fn end_stage(&self) {
        let bar = self.bar.read().unwrap_or_else(PoisonError::into_inner);
        bar.finish_and_clear();
        let ended = self.stage.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let (Some((stage, start)), Verbosity::Verbose) = (ended, self.verbosity) {
            say(&format!("{stage}: {:.2} s", start.elapsed().as_secs_f64()));
        }
    }

    fn shows_bars(&self) -> bool {
        self.verbosity != Verbosity::Quiet && std::io::stderr().is_terminal()
    }
}

impl Progress for Report<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.end_stage();
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
        if self.verbosity == Verbosity::Quiet {
            return;
        }
        self.bar.read().unwrap_or_else(PoisonError::into_inner).suspend(|| say(line));
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
            || self.listener.is_some_and(|listener| listener.is_cancelled())
    }
}

/// Adds a flag to each note.
pub struct WithFlag<'a> {
    report: &'a Report<'a>,
    flag: &'a str,
}

impl Progress for WithFlag<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.report.begin(stage, total);
    }

    fn advance(&self, units: u64) {
        self.report.advance(units);
    }

    fn note(&self, line: &str) {
        self.report.choice(line, self.flag);
    }

    fn is_cancelled(&self) -> bool {
        self.report.is_cancelled()
    }
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
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Results on stdout; no error if nobody reads any more, as after `| head`.
pub fn print(line: &str) -> std::io::Result<()> {
    let mut stdout = std::io::stdout().lock();
    match writeln!(stdout, "{line}").and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}
