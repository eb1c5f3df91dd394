//! Clouds that are prepared and kept.

use crate::cloud::{PyCloud, to_cloud};
use crate::errors::invalid_setting;
use crate::threads::{on_threads, own_threads};
use crate::value::with_keys;
use crate::work;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::CString;
use std::path::PathBuf;
use std::sync::Arc;
use surfel::description::Invalid;
use surfel::prepare::{PrepareOptions, prepare_files, prepare_points};
use surfel::progress_log::ProgressLog;
use surfel::{Choice, SceneDescription};
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_formats::{ColumnChoice, FileInfo, LoadOptions, Loaded, SaveOptions, merge_loaded};

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
    let description = with_keys(py, &SceneDescription::default(), keys)?;
    check_keys(&description).map_err(|error| invalid_setting(py, error))?;
    let options = PrepareOptions { normals, keep_variation };
    let sources = sources.iter().map(Source::new).collect::<PyResult<Vec<_>>>()?;
    let (prepared, choices) = work::run(py, progress, |progress| {
        let threads = own_threads(&description.run)?;
        let log = ProgressLog::new(progress);
        let prepared = on_threads(threads.as_ref(), || match files(&sources) {
            Some(files) => prepare_files(&files, &description, options, &log),
            None => {
                let loaded = merged(sources, &description, &log)?;
                prepare_points(loaded, &description, options, &log)
            }
        })?;
        Ok((prepared, log.into_choices()))
    })?;
    warn(py, &choices)?;
    let Loaded { cloud, info } = prepared;
    Ok(PyCloud::new(cloud, SaveOptions::from_source(&info)))
}

/// Raises a `UserWarning` for each choice that is a warning.
fn warn(py: Python<'_>, choices: &[Choice]) -> PyResult<()> {
    for Choice { reason, keys } in choices {
        if let Some(text) = reason.strip_prefix("warning: ") {
            let text = CString::new(format!("{text} [{}]", keys.join(", ")))?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
    }
    Ok(())
}

/// Points that are prepared: a cloud, or those of a file.
enum Source {
    Cloud(Arc<PointCloud>, Box<FileInfo>),
    File(PathBuf),
}

impl Source {
    fn new(source: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(path) = source.extract::<PathBuf>() {
            return Ok(Self::File(path));
        }
        let cloud = to_cloud(source)?;
        let cloud = cloud.get();
        Ok(Self::Cloud(cloud.cloud.clone(), Box::new(info(&cloud.options))))
    }
}

/// Returns the files, if all sources are files.
fn files(sources: &[Source]) -> Option<Vec<PathBuf>> {
    let file = |source: &Source| match source {
        Source::File(file) => Some(file.clone()),
        Source::Cloud(..) => None,
    };
    sources.iter().map(file).collect()
}

/// Reads sources as one cloud, with all points: they are filtered when they are prepared.
fn merged(
    sources: Vec<Source>,
    description: &SceneDescription,
    progress: &dyn Progress,
) -> surfel::Result<Loaded> {
    let preparation = &description.objects_default.preparation;
    let options = preparation.load_options(ColumnChoice::All)?;
    let options = LoadOptions { filter: None, ..options };
    let (mut parts, mut names) = (Vec::new(), Vec::new());
    for source in sources {
        match source {
            Source::Cloud(cloud, info) => {
                names.push(PathBuf::from(format!("cloud {}", names.len())));
                parts.push(Loaded { cloud: Arc::unwrap_or_clone(cloud), info: *info });
            }
            Source::File(file) => {
                parts.push(surfel_formats::load(&file, &options, progress)?);
                names.push(file);
            }
        }
    }
    Ok(merge_loaded(parts, &names, progress))
}

/// Returns what the properties of a saved cloud tell about the file that it came from.
fn info(options: &SaveOptions) -> FileInfo {
    let SaveOptions { resolution, coordinate_system, las } = options.clone();
    FileInfo { resolution, coordinate_system, las, ..FileInfo::default() }
}

/// Fails for keys that do not concern points.
fn check_keys(description: &SceneDescription) -> Result<(), Invalid> {
    const OTHERS: [&str; 3] = ["seed", "threads", "memory_limit"];
    for part in description.parts().iter().filter(|part| part.heading != "Preparation") {
        let set = |name: &str| part.settings.get(name).is_some() && !OTHERS.contains(&name);
        if let Some(key) = part.settings.keys().iter().find(|key| set(key.name)) {
            let path = format!("{}{}", part.prefix, key.name);
            return Err(Invalid::at(path, "is no key of preparation; give it to load or render"));
        }
    }
    Ok(())
}
