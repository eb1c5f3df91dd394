//! Names of files, as Python hands them over.

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::path::PathBuf;

/// Reads the names of files that `function` was called with.
///
/// # Errors
///
/// Fails for what is no name, and for URLs.
pub fn file_names(function: &str, paths: &Bound<'_, PyTuple>) -> PyResult<Vec<PathBuf>> {
    paths.py().import("surfel._paths")?.call_method1("file_names", (function, paths))?.extract()
}

/// Reads the name of a file; none if a value is no name.
///
/// # Errors
///
/// Fails for URLs.
pub fn file_name(value: &Bound<'_, PyAny>) -> PyResult<Option<PathBuf>> {
    if value.extract::<PathBuf>().is_err() {
        return Ok(None);
    }
    let name = value.py().import("surfel._paths")?.call_method1("local_name", (value,))?;
    name.extract().map(Some)
}
