//! Objects of a scene: content with a name, a place, a material and settings of its own.

use crate::cloud::{PyCloud, PyMesh, mesh_columns, to_cloud};
use crate::errors::{invalid_array, invalid_setting, to_exception};
use crate::paths::file_name;
use crate::value::{table, to_value};
use crate::work;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use surfel::SceneDescription;
use surfel::description::Invalid;
use surfel::memory_files::MemoryContent;

/// An object that is about to be added to a scene.
#[derive(Clone)]
pub struct NewObject {
    /// Content in memory; none if it is in a file.
    content: Option<MemoryContent>,
    /// The object as a scene file has it, but for content in memory.
    table: Map<String, Value>,
}

impl NewObject {
    /// Reads what is added and how.
    pub fn new(
        what: &Bound<'_, PyAny>,
        name: Option<&Bound<'_, PyAny>>,
        material: Option<&Bound<'_, PyAny>>,
        transform: Option<&Bound<'_, PyAny>>,
        keys: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut table = table(keys)?;
        for (key, value) in [("name", name), ("material", material)] {
            if let Some(value) = value {
                table.insert(key.into(), to_value(key, value)?);
            }
        }
        if let Some(transform) = transform {
            table.insert("matrix".into(), matrix(transform)?);
        }
        if let Some(path) = file_name(what)? {
            table.insert("file".into(), json!(path.display().to_string()));
            return Ok(Self { content: None, table });
        }
        Ok(Self { content: Some(content(what)?), table })
    }

    /// Looks at the files of the object as the last one of a description.
    ///
    /// # Errors
    ///
    /// Fails as `added_to`, and for files that are missing or none that surfel reads.
    pub fn inspect(self, py: Python<'_>, description: &SceneDescription) -> PyResult<()> {
        let description = self.added_to(py, description)?;
        let added = description.objects.last().into_iter().flat_map(|object| &object.files);
        let files: Vec<&PathBuf> =
            added.filter(|file| !description.memory.contains(file)).collect();
        let look_at = |file: &&PathBuf| surfel_formats::inspect(file).map(drop);
        let inspected = work::detached(py, || files.iter().try_for_each(look_at))?;
        inspected.map_err(|error| to_exception(py, &error.into()))
    }

    /// Returns a description with the object at its end.
    pub fn added_to(
        mut self,
        py: Python<'_>,
        description: &SceneDescription,
    ) -> PyResult<SceneDescription> {
        let mut description = description.clone();
        let is_taken = |name: &str| {
            description.objects.iter().any(|object| object.name.as_deref() == Some(name))
        };
        if let Some(name) = self.table.get("name").and_then(Value::as_str)
            && is_taken(name)
        {
            let message = format!("another object is `{name}` already; choose another name");
            return Err(invalid_setting(py, Invalid::at("name", message)));
        }
        if let Some(content) = self.content {
            let mut names = (description.objects.len()..).map(|i| format!("object {i}"));
            let free = names.find(|name| !is_taken(name)).unwrap_or_default();
            let name = self.table.entry("name").or_insert_with(|| json!(free));
            // Messages say it as they say names of files.
            let own = format!("<{}>", name.as_str().unwrap_or_default());
            let known = description.memory.name_of(&content).map(|name| name.display().to_string());
            let file = known.unwrap_or(own);
            description.memory.insert(&file, content);
            self.table.insert("file".into(), json!(file));
        }
        let added = description.add_object(&self.table, Path::new(""));
        added.map_err(|error| invalid(py, error))?;
        Ok(description)
    }
}

/// The exception for a wrong key, without the table of the scene file that it would stand in.
fn invalid(py: Python<'_>, error: Invalid) -> PyErr {
    let path = error.path.split_once("].").map_or(&error.path[..], |(_, key)| key).to_owned();
    invalid_setting(py, Invalid { path, ..error })
}

/// Reads a 4x4 matrix as 16 numbers, row by row.
fn matrix(transform: &Bound<'_, PyAny>) -> PyResult<Value> {
    let rows = transform.call_method0("tolist").unwrap_or(transform.clone());
    let rows: Vec<Vec<f64>> = rows.extract().unwrap_or_default();
    let invalid = |message| Err(invalid_array(transform.py(), message));
    if rows.len() != 4 || rows.iter().any(|row| row.len() != 4) {
        return invalid("transform: expected a 4x4 matrix, row by row");
    }
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return invalid(
            "transform: expected 0, 0, 0, 1 as the last row; projections are not shown",
        );
    }
    to_value("transform", &rows.concat().into_pyobject(transform.py())?)
}

/// Returns the content of a cloud or mesh, of ours or of another package.
fn content(what: &Bound<'_, PyAny>) -> PyResult<MemoryContent> {
    let py = what.py();
    if let Ok(mesh) = what.cast::<PyMesh>() {
        return Ok(MemoryContent::Triangles(mesh.get().mesh.clone()));
    }
    if !what.is_instance_of::<PyCloud>() && mesh_columns(py, what)?.is_some() {
        let mesh = py.get_type::<PyMesh>().call1((what,))?.cast_into::<PyMesh>()?;
        return Ok(MemoryContent::Triangles(mesh.get().mesh.clone()));
    }
    Ok(to_cloud(what)?.get().content())
}
