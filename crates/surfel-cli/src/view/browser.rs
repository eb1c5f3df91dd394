//! Starts the user's browser.

use std::process::{Command, Stdio};

/// Programs that open a link, of the systems that surfel runs on.
const OPENERS: [&str; 3] = ["xdg-open", "open", "explorer"];

/// Opens a link; returns true if a browser was started.
pub fn open(link: &str) -> bool {
    OPENERS.iter().any(|opener| {
        let mut command = Command::new(opener);
        command.arg(link).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().is_ok()
    })
}
