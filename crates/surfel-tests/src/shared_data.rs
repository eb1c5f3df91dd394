//! The test data that lies beside a checkout and is no part of it.

use crate::skipped::report_skipped;
use std::path::{Path, PathBuf};

/// Returns the folder of test data beside the checkout or above it, or reports that it is absent and returns `None`.
pub fn shared_data() -> Option<PathBuf> {
    let ancestors = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let mut folders = ancestors.map(|ancestor| ancestor.join("shared/data"));
    let found = folders.find(|folder| folder.is_dir());
    if found.is_none() {
        report_skipped("../shared/data is absent");
    }
    found
}
