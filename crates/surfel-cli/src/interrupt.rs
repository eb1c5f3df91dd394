//! Ctrl-C and a job scheduler's SIGTERM: the first cancels the work, a second one ends the program.

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, OnceLock};

/// The signal that came last, or that of Ctrl-C if none has come.
static SIGNAL: LazyLock<Arc<AtomicUsize>> =
    LazyLock::new(|| Arc::new(AtomicUsize::new(SIGINT as usize)));

/// The flag that the first signal sets.
static CANCELLED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Makes the first signal set `cancelled`; a second one ends the program, even if the work does not check.
pub fn listen(cancelled: &Arc<AtomicBool>) -> anyhow::Result<()> {
    for signal in [SIGINT, SIGTERM] {
        // In this order: otherwise the first signal would find the flag that it has just set.
        flag::register_conditional_default(signal, cancelled.clone())
            .and_then(|_| flag::register_usize(signal, SIGNAL.clone(), signal as usize))
            .and_then(|_| flag::register(signal, cancelled.clone()))
            .context("the handler of Ctrl-C cannot be installed")?;
    }
    let _ = CANCELLED.set(cancelled.clone());
    Ok(())
}

/// Returns whether a signal has cancelled the run.
pub fn is_cancelled() -> bool {
    CANCELLED.get().is_some_and(|cancelled| cancelled.load(Ordering::Relaxed))
}

/// Returns the exit code of a cancelled run, as of programs that the signal ends: 130 for Ctrl-C, 143 for SIGTERM.
pub fn exit_code() -> u8 {
    128 + SIGNAL.load(Ordering::Relaxed) as u8
}
