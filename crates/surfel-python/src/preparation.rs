//! Clouds that are read, or prepared, and kept.

use crate::cloud::{PyCloud, to_cloud};
use crate::errors::invalid_setting;
use crate::paths::{file_name, file_names};
use crate::threads::{on_threads, own_threads};
use crate::value::with_keys;
use crate::work;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use surfel::SceneDescription;
use surfel::description::{Invalid, KeyedSettings, Part, Section};
use surfel::prepare::{PointSource, PrepareOptions, prepare_points, read_points};
use surfel_core::progress::Progress;
use surfel_formats::{FileInfo, Loaded, SaveOptions};

/// Reads the points of a file, or of several that become one cloud, with all columns: of a mesh its vertices.
///
/// Keywords are the keys of reading in scene files: `filter`, `class_`, `returns`, `crop`, `columns`, `salvage` and `reproject`,
/// besides `threads` and `memory_limit`. Coordinates in degrees of longitude and latitude stay, with a warning, unless
/// `reproject=True` moves them to metres. `progress` is called as `progress(stage, done, total)`.
///
/// Raises `MissingFile`, `InvalidFile`, also for URLs, `InvalidSetting`, `InvalidScene` if no point is kept, `OutOfMemory`.
#[pyfunction]
#[pyo3(signature = (*paths, progress = None, **keys))]
pub fn read_cloud(
    py: Python<'_>,
    paths: &Bound<'_, PyTuple>,
    progress: Option<&Bound<'_, PyAny>>,
    keys: Option<&Bound<'_, PyDict>>,
) -> PyResult<PyCloud> {
    const KEYS: [&str; 9] = [
        "filter",
        "class",
        "returns",
        "crop",
        "columns",
        "salvage",
        "reproject",
        "threads",
        "memory_limit",
    ];
    let description = with_keys(py, &SceneDescription::default(), keys)?;
    check_keys(&description, |_, name| KEYS.contains(&name), "reading; give it to prepare or load")
        .map_err(|error| invalid_setting(py, error))?;
    let paths = file_names("surfel.read_cloud", paths)?;
    let sources = paths.into_iter().map(PointSource::File).collect();
    made(py, progress, &description, |progress| read_points(sources, &description, progress))
}

/// Cleans a cloud, and adds normals and radii: of a file, of a `Cloud` or what it takes, or of several that become one.
///
/// Keywords are the keys of preparation in scene files: `filter`, `crop`, `subsample`, `remove_outliers`, `denoise`, `orient`,
/// `normals_k`, `radius` and others, besides `seed`, `threads` and `memory_limit`. Without any, normals and radii are added;
/// with some, those steps alone are taken, and `normals=True` adds normals. `keep_variation=True` adds the column
/// `surface_variation`. Coordinates in degrees of longitude and latitude stay, with a warning, unless `reproject=True` moves
/// them to metres. `progress` is called as `progress(stage, done, total)`.
///
/// Raises `InvalidSetting`, `InvalidArray`, `MissingFile`, `InvalidFile`, `InvalidScene`.
#[pyfunction]
#[pyo3(signature = (*sources, normals = false, keep_variation = false, progress = None, **keys))]
pub fn prepare(
    py: Python<'_>,
    sources: Vec<Bound<'_, PyAny>>,
    normals: bool,
    keep_variation: bool,
    progress: Option<&Bound<'_, PyAny>>,
    keys: Option<&Bound<'_, PyDict>>,
) -> PyResult<PyCloud> {
    const OTHERS: [&str; 3] = ["seed", "threads", "memory_limit"];
    let description = with_keys(py, &SceneDescription::default(), keys)?;
    let is_known = |part: &Part<&dyn KeyedSettings>, name: &str| {
        part.section == Section::Preparation || OTHERS.contains(&name)
    };
    check_keys(&description, is_known, "preparation; give it to load or render")
        .map_err(|error| invalid_setting(py, error))?;
    let options = PrepareOptions { normals, keep_variation };
    let sources = sources.iter().map(source).collect::<PyResult<Vec<_>>>()?;
    made(py, progress, &description, |progress| {
        prepare_points(sources, &description, options, progress)
    })
}

/// Returns the cloud that `work` makes on the threads of a description.
fn made(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    description: &SceneDescription,
    work: impl FnOnce(&dyn Progress) -> surfel::Result<Loaded> + Send,
) -> PyResult<PyCloud> {
    let Loaded { cloud, info } = work::run(py, progress, |progress| {
        let threads = own_threads(&description.run)?;
        on_threads(threads.as_ref(), || work(progress))
    })?;
    Ok(PyCloud::new(cloud, SaveOptions::from_source(&info)))
}

/// Returns the points of a file, of a cloud, or of what becomes a cloud.
fn source(source: &Bound<'_, PyAny>) -> PyResult<PointSource> {
    if let Some(path) = file_name(source)? {
        return Ok(PointSource::File(path));
    }
    let cloud = to_cloud(source)?;
    let cloud = cloud.get();
    Ok(PointSource::Cloud(cloud.cloud.clone(), Box::new(info(&cloud.options))))
}

/// Returns what the properties of a saved cloud tell about the file that it came from.
fn info(options: &SaveOptions) -> FileInfo {
    let SaveOptions { resolution, coordinate_system, las } = options.clone();
    let format = "in memory".to_owned();
    FileInfo { format, resolution, coordinate_system, las, ..FileInfo::default() }
}

/// Fails for keys that `is_known` does not accept, by the part and the name of each. `advice` says what for they are none, and
/// where they belong.
fn check_keys(
    description: &SceneDescription,
    is_known: impl Fn(&Part<&dyn KeyedSettings>, &str) -> bool,
    advice: &str,
) -> Result<(), Invalid> {
    for part in description.parts() {
        let is_set = |name: &str| part.settings.get(name).is_some();
        let unknown = |name: &str| is_set(name) && !is_known(&part, name);
        if let Some(key) = part.settings.keys().iter().find(|key| unknown(key.name)) {
            let path = format!("{}{}", part.prefix, key.name);
            return Err(Invalid::at(path, format!("is no key of {advice}")));
        }
    }
    Ok(())
}
