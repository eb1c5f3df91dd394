//! Reading scene files.

use crate::description::SceneDescription;
use crate::error::{Error, Result};
use std::path::Path;

/// Bytes of the largest scene file: it names data and does not hold them.
const MAX_BYTES: usize = 64 << 20;

impl SceneDescription {
    /// Reads a scene file in TOML or JSON; the files that it names are found from where it lies.
    ///
    /// # Errors
    ///
    /// Fails if the file cannot be read, and for unknown keys and wrong values, with file and path.
    pub fn read(path: &Path) -> Result<Self> {
        let text = surfel_formats::load_text(path, MAX_BYTES)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        Self::parse(&text, is_json, folder).map_err(|error| Error::Invalid(error.in_file(path)))
    }
}
