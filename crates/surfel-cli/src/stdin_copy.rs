//! The file to which standard input was copied, as messages name it.

use std::borrow::Cow;
use std::path::Path;
use std::sync::{PoisonError, RwLock};

static COPY: RwLock<Option<String>> = RwLock::new(None);

/// Remembers the file for [`with_stdin_named`].
pub fn remember(copy: &Path) {
    *COPY.write().unwrap_or_else(PoisonError::into_inner) = Some(copy.display().to_string());
}

/// Returns `message` with the path of the copy replaced by `standard input`.
pub fn with_stdin_named(message: &str) -> Cow<'_, str> {
    match COPY.read().unwrap_or_else(PoisonError::into_inner).as_deref() {
        Some(copy) if message.contains(copy) => message.replace(copy, "standard input").into(),
        _ => message.into(),
    }
}
