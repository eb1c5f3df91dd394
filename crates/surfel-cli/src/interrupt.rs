//! Ctrl-C and a job scheduler's SIGTERM: the first asks the work to stop, a second one ends the program.

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// From the second on, signals do what they do by default: work that does not ask cannot hold them up.
pub fn listen(cancelled: &Arc<AtomicBool>) -> anyhow::Result<()> {
    for signal in [SIGINT, SIGTERM] {
        // In this order: otherwise the first signal would find the flag that it has just set.
        flag::register_conditional_default(signal, cancelled.clone())
            .and_then(|_| flag::register(signal, cancelled.clone()))
            .context("Ctrl-C cannot be listened to")?;
    }
    Ok(())
}
