//! Scene files in TOML and JSON.

use super::{Crop, Invalid, SceneDescription};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// The key of the table as which the parser of TOML hands over a date.
const TOML_DATE: &str = "$__toml_private_datetime";

/// Returns true if a path has the extension of a scene file, `.toml` or `.json`.
pub fn is_scene_file(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    ["toml", "json"].contains(&extension.as_str())
}

impl SceneDescription {
    /// Parses the text of a scene file; the files that it names are found from `folder`.
    ///
    /// # Errors
    ///
    /// Fails for unknown keys and wrong values, with their path.
    pub fn parse(text: &str, is_json: bool, folder: &Path) -> Result<Self, Invalid> {
        Self::from_table(&parse_table(text, is_json)?, folder)
    }

    /// Returns the files that the description names: those of points, meshes and scenes, environment maps, and areas whose
    /// points are kept.
    pub fn named_files(&self) -> impl Iterator<Item = &PathBuf> {
        let of_objects = self.objects.iter().flat_map(|object| &object.files);
        let settings = self.objects.iter().map(|object| &object.settings);
        let areas = settings.chain([&self.objects_default]).filter_map(|settings| match &settings
            .preparation
            .crop
        {
            Some(Crop::File(path)) => Some(path),
            _ => None,
        });
        self.files.iter().chain(of_objects).chain(&self.light.environment).chain(areas)
    }
}

/// Parses TOML or JSON into a table of keys and values.
///
/// # Errors
///
/// Fails with line and column.
pub fn parse_table(text: &str, is_json: bool) -> Result<Map<String, Value>, Invalid> {
    let mut value: Value = if is_json {
        serde_json::from_str(text).map_err(|error| Invalid::new(error.to_string()))?
    } else {
        toml::from_str(text).map_err(|error| toml_error(text, &error))?
    };
    // TOML has no null: it stands for numbers that JSON does not know.
    if !is_json && let Some(path) = path_of_null(&value) {
        return Err(Invalid::at(path, "found nan or inf, expected a number"));
    }
    if !is_json {
        dates_as_text(&mut value);
    }
    match value {
        Value::Object(table) => Ok(table),
        _ => Err(Invalid::new("expected keys and values")),
    }
}

/// Replaces dates of TOML, which its parser hands over as tables of one key, by their text.
fn dates_as_text(value: &mut Value) {
    match value {
        Value::Object(table) if table.contains_key(TOML_DATE) => {
            *value = table.remove(TOML_DATE).unwrap_or_default();
        }
        Value::Object(table) => table.values_mut().for_each(dates_as_text),
        Value::Array(values) => values.iter_mut().for_each(dates_as_text),
        _ => {}
    }
}

/// Returns the error of the TOML parser in one line, with its place.
fn toml_error(text: &str, error: &toml::de::Error) -> Invalid {
    let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
    let Some(span) = error.span() else { return Invalid::new(message) };
    let Some((before, found)) = text.get(..span.start).zip(text.get(span)) else {
        return Invalid::new(message);
    };
    let line = 1 + before.matches('\n').count();
    let column = 1 + before.chars().rev().take_while(|c| *c != '\n').count();
    let is_short = !found.is_empty() && found.len() < 40 && !found.contains('\n');
    let found = if is_short { format!(" at `{found}`") } else { String::new() };
    Invalid::new(format!("line {line}, column {column}: {message}{found}"))
}

/// The path that leads to a null.
fn path_of_null(value: &Value) -> Option<String> {
    let join = |step: String, path: String| {
        let dot = if path.is_empty() || path.starts_with('[') { "" } else { "." };
        format!("{step}{dot}{path}")
    };
    match value {
        Value::Null => Some(String::new()),
        Value::Array(values) => {
            let mut values = values.iter().enumerate();
            values.find_map(|(i, value)| Some(join(format!("[{i}]"), path_of_null(value)?)))
        }
        Value::Object(map) => {
            map.iter().find_map(|(key, value)| Some(join(key.clone(), path_of_null(value)?)))
        }
        _ => None,
    }
}
