//! Checks of the paths that outputs are written to.

use std::path::Path;

use super::atomic_write::{check_writable, parent_folder, write_error};
use crate::error::{Error, Result};

/// Checks that a file of any format can be written to `path`.
///
/// # Errors
///
/// Fails if the folder of `path` does not exist or takes no new files, if `path` is a folder itself or ends as the name
/// of one, and if it is a pipe or a device.
pub fn check_output_path(path: &Path) -> Result<()> {
    let folder = parent_folder(path);
    let ends_as_folder = path.to_string_lossy().ends_with(std::path::is_separator);
    let problem = if path.is_dir() || ends_as_folder {
        std::io::ErrorKind::IsADirectory
    } else if !folder.exists() {
        std::io::ErrorKind::NotFound
    } else if !folder.is_dir() {
        std::io::ErrorKind::NotADirectory
    } else {
        // A finished file is renamed to its name, and would replace a pipe or a device there.
        if path.metadata().is_ok_and(|found| !found.is_file()) {
            return Err(Error::Unsupported {
                file: path.display().to_string(),
                action: "write",
                found: "a pipe or device, not a regular file".into(),
                advice: "name a file",
            });
        }
        return check_writable(path);
    };
    Err(write_error(path, problem.into()))
}

/// Returns the lower-case extension, without the dot.
pub(crate) fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Returns the error of an output whose extension belongs to no format.
pub(crate) fn unsupported_extension(path: &Path, advice: &'static str) -> Error {
    let found = match extension(path).as_str() {
        "" => "a name without extension".into(),
        extension => format!("the extension `.{extension}`"),
    };
    Error::Unsupported { file: path.display().to_string(), action: "write", found, advice }
}
