//! Ctrl-C and a job scheduler's SIGTERM: the first cancels the work, a second one ends the program.

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Makes the first signal set `cancelled`; a second one ends the program, even if the work does not check.
pub fn listen(cancelled: &Arc<AtomicBool>) -> anyhow::Result<()> {
    for signal in [SIGINT, SIGTERM] {
        // In this order: otherwise the first signal would find the flag that it has just set.
        flag::register_conditional_default(signal, cancelled.clone())
            .and_then(|_| flag::register(signal, cancelled.clone()))
            .context("the handler of Ctrl-C cannot be installed")?;
    }
    Ok(())
}
