//! Exceptions: each has the words of the program's message.

use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::io::ErrorKind;
use surfel::Error;
use surfel::description::{Invalid, nearest_if_any};
use surfel_formats::Error as FileError;

/// Name of the exception for an error: a class of the module `surfel`.
fn class_name(error: &Error) -> &'static str {
    match error {
        Error::Invalid(_) => "InvalidSetting",
        Error::File(error) => file_class_name(error),
        Error::OutOfMemory(_) => "OutOfMemory",
        Error::Unfinished { cause, .. } => class_name(cause),
        _ => "InvalidScene",
    }
}

fn file_class_name(error: &FileError) -> &'static str {
    match error {
        FileError::Io { cause, .. } if cause.kind() == ErrorKind::NotFound => "MissingFile",
        FileError::Io { .. } | FileError::FolderNotFound { .. } => "InaccessibleFile",
        FileError::OutOfMemory { .. } => "OutOfMemory",
        FileError::EncoderNotFound { .. } | FileError::EncoderFailed { .. } => "EncoderError",
        FileError::Core(_) => "InvalidScene",
        _ => "InvalidFile",
    }
}

/// Converts an error of the library. Cancelled work raises `KeyboardInterrupt`, unless the caller knows a better cause.
pub fn to_exception(py: Python<'_>, error: &Error) -> PyErr {
    if error.is_cancelled() {
        return PyKeyboardInterrupt::new_err(());
    }
    exception(py, class_name(error), &error.to_string())
}

/// The exception for a value that is not valid.
pub fn invalid_setting(py: Python<'_>, invalid: Invalid) -> PyErr {
    to_exception(py, &Error::Invalid(invalid))
}

/// The exception for an array that cannot be taken.
pub fn invalid_array(py: Python<'_>, message: &str) -> PyErr {
    exception(py, "InvalidArray", message)
}

/// Makes an exception of a class of the module `surfel`.
pub fn exception(py: Python<'_>, class: &str, message: &str) -> PyErr {
    let build = || py.import("surfel._errors")?.getattr(class)?.call1((message,));
    build().map_or_else(|error| error, PyErr::from_value)
}

/// The exception for an object of a class that other processes cannot get.
pub fn unpicklable(class: &str) -> PyErr {
    PyTypeError::new_err(format!(
        "surfel.{class} stays in its process and cannot be pickled; a surfel.dask.Recipe of files and keywords can be, \
         and so can arrays"
    ))
}

/// Fails for keywords that a function does not have, with the nearest of those that it has.
pub fn refuse_others(
    function: &str,
    others: Option<&Bound<'_, PyDict>>,
    known: &[&str],
) -> PyResult<()> {
    let Some((other, _)) = others.and_then(|others| others.iter().next()) else { return Ok(()) };
    let advice = nearest_if_any(&other.to_string(), known.iter().copied());
    let message = format!("{function}() got an unexpected keyword argument '{other}'{advice}");
    Err(PyTypeError::new_err(message))
}

/// The exception for work that panicked, which is a fault of surfel.
pub fn panicked() -> PyErr {
    PyRuntimeError::new_err("surfel failed; the message above says where: please report it")
}
