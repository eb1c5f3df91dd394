//! The program `surfel` inside the package.

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the program with these words, the first of which is its name; returns its exit code.
#[pyfunction]
pub fn run_program(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| surfel_cli::run_program(words))
}
