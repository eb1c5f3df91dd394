//! Temporary files that are removed when the program ends.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

static FILES: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Remembers a file for [`remove_files`].
pub fn remove_at_exit(path: PathBuf) {
    FILES.lock().unwrap_or_else(PoisonError::into_inner).push(path);
}

/// Removes the files.
pub fn remove_files() {
    for path in FILES.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
        // Nothing can be done about one that is gone.
        let _ = std::fs::remove_file(path);
    }
}
