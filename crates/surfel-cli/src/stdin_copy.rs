//! The file to which standard input was copied, as messages name it.

use std::borrow::Cow;
use std::path::Path;
use std::sync::OnceLock;

static COPY: OnceLock<String> = OnceLock::new();

/// Remembers the file for [`with_stdin_named`].
pub fn remember(copy: &Path) {
    COPY.get_or_init(|| copy.display().to_string());
}

/// Returns a message that calls the file what it is: standard input.
pub fn with_stdin_named(message: &str) -> Cow<'_, str> {
    match COPY.get() {
        Some(copy) if message.contains(copy) => message.replace(copy, "standard input").into(),
        _ => message.into(),
    }
}
