//! Values of Python as those of scene files.

use crate::errors::invalid_setting;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyMapping, PyString};
use serde_json::{Map, Number, Value, json};
use std::path::{Path, absolute};
use surfel::SceneDescription;
use surfel::description::Invalid;

/// Maximum number of levels of values that a keyword may have, half of those that a JSON file may have.
const MAX_DEPTH: usize = 64;

/// Reads keywords as a table of keys. One that is a word of the language, as `class`, has an underscore at its end.
pub fn table(keys: Option<&Bound<'_, PyDict>>) -> PyResult<Map<String, Value>> {
    table_within(keys, MAX_DEPTH)
}

fn table_within(keys: Option<&Bound<'_, PyDict>>, depth: usize) -> PyResult<Map<String, Value>> {
    let mut table = Map::new();
    for (key, value) in keys.into_iter().flatten() {
        let name: String = key.extract()?;
        let key = name.strip_suffix('_').unwrap_or(&name);
        if table.insert(key.to_owned(), value_within(key, &value, depth)?).is_some() {
            let message = format!("is given twice, also as {key}_");
            return Err(invalid_setting(value.py(), Invalid::at(key, message)));
        }
    }
    Ok(table)
}

/// Lays keywords over a description: `None` makes a key automatic again.
pub fn with_keys(
    py: Python<'_>,
    description: &SceneDescription,
    keys: Option<&Bound<'_, PyDict>>,
) -> PyResult<SceneDescription> {
    let mut description = description.clone();
    let layer = layer(py, table(keys)?, &mut description)?;
    description.overlay(layer);
    description.check().map_err(|error| invalid_setting(py, error))?;
    Ok(description)
}

/// Reads keys as a description of its own; those that are `None` become automatic in `below`.
fn layer(
    py: Python<'_>,
    keys: Map<String, Value>,
    below: &mut SceneDescription,
) -> PyResult<SceneDescription> {
    let (unset, set) = keys.into_iter().partition(|(_, value)| value.is_null());
    let mut layer = SceneDescription::default();
    let merged = layer.merge(&set).and_then(|()| below.merge(&unset));
    merged.map_err(|error| invalid_setting(py, error))?;
    Ok(layer)
}

/// Returns keywords as a dict of plain values, with files named from the root: it means the same in another process.
///
/// Raises `InvalidSetting` for unknown keys and wrong values.
#[pyfunction]
#[pyo3(signature = (**keys))]
pub fn _plain<'py>(
    py: Python<'py>,
    keys: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut table = table(keys)?;
    let mut settings = table.clone();
    // The text of a scene file is no key.
    settings.remove("_scene");
    layer(py, settings, &mut SceneDescription::default())?;
    table.iter_mut().for_each(|(key, value)| name_from_root(key, value));
    to_python(py, &Value::Object(table))
}

/// Names the files among the values of a key from the root.
fn name_from_root(path: &str, value: &mut Value) {
    match value {
        Value::Object(inner) => {
            inner
                .iter_mut()
                .for_each(|(key, value)| name_from_root(&format!("{path}.{key}"), value));
        }
        Value::String(text) => {
            let Ok(from_root) = absolute(&*text) else { return };
            let from_root = from_root.display().to_string();
            let mut read = SceneDescription::default();
            let is_read = read.set(path, &json!(text), Path::new("")).is_ok();
            // Names of files alone are written from the root.
            if is_read && read.non_default().iter().any(|(_, written)| *written == from_root) {
                *text = from_root;
            }
        }
        _ => {}
    }
}

/// Converts a value; `key` is the path that an error names.
///
/// # Errors
///
/// Fails for what no scene file can hold, and for values within values without end, as a list that holds itself.
pub fn to_value(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Value> {
    value_within(key, value, MAX_DEPTH)
}

/// Converts a value that may hold others, `depth` levels of them.
fn value_within(key: &str, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    if value.is_none() {
        return Ok(Value::Null);
    }
    if let Ok(flag) = value.cast::<PyBool>() {
        return Ok(Value::Bool(flag.is_true()));
    }
    if value.is_instance_of::<PyInt>() {
        return integer(key, value);
    }
    if value.is_instance_of::<PyFloat>() {
        return number(key, value);
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::String(text.to_str()?.to_owned()));
    }
    if let Ok(dict) = value.cast::<PyDict>() {
        let table = table_within(Some(dict), deeper(key, value, depth)?);
        return Ok(Value::Object(table.map_err(|error| within(key, value, error))?));
    }
    // Paths, dates, arrays and numbers of numpy: each says itself what it is.
    for method in ["__fspath__", "isoformat", "tolist"] {
        if value.hasattr(method)? {
            return value_within(key, &value.call_method0(method)?, deeper(key, value, depth)?);
        }
    }
    if let Ok(mapping) = value.cast::<PyMapping>() {
        let dict = PyDict::new(value.py());
        dict.update(mapping)?;
        return value_within(key, &dict, depth);
    }
    let items = value.try_iter().map_err(|error| within(key, value, error))?;
    let depth = deeper(key, value, depth)?;
    let item_of = |(i, item): (usize, PyResult<Bound<'_, PyAny>>)| {
        value_within(&format!("{key}[{i}]"), &item?, depth)
    };
    Ok(Value::Array(items.enumerate().map(item_of).collect::<PyResult<_>>()?))
}

/// Returns the number of levels of values that a value within a value may hold.
fn deeper(key: &str, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<usize> {
    depth.checked_sub(1).ok_or_else(|| {
        // The path has a part for each level.
        let key = key.split(['[', '.']).next().unwrap_or(key);
        let message = format!("holds more than {MAX_DEPTH} levels of lists and dicts");
        invalid_setting(value.py(), Invalid::at(key, message))
    })
}

fn integer(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if let Ok(integer) = value.extract::<i64>() {
        return Ok(integer.into());
    }
    value.extract::<u64>().map(Value::from).or_else(|_| number(key, value))
}

fn number(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Value> {
    let number: f64 = value.extract()?;
    let finite = Number::from_f64(number).map(Value::Number);
    finite.ok_or_else(|| {
        let message = format!("found {number}, expected a number");
        invalid_setting(value.py(), Invalid::at(key, message))
    })
}

/// An error about a value that no scene file can hold.
fn within(key: &str, value: &Bound<'_, PyAny>, error: PyErr) -> PyErr {
    if !error.is_instance_of::<PyTypeError>(value.py()) {
        return error;
    }
    let found = value.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
    let message = format!("found an object of type {found}, expected a number, text, list or dict");
    invalid_setting(value.py(), Invalid::at(key, message))
}

/// Converts a value of a scene file.
pub fn to_python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (value.to_string(),))
}
