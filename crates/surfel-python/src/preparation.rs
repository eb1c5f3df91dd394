//! Clouds that are prepared and kept.

use crate::cloud::PyCloud;
use crate::errors::invalid_setting;
use crate::threads::{on_threads, start_threads};
use crate::value::with_keys;
use crate::work;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;
use surfel::SceneDescription;
use surfel::description::Invalid;
use surfel::prepare::{PrepareOptions, prepare_files, prepare_points};
use surfel_core::points::PointCloud;
use surfel_formats::{Loaded, SaveOptions};

/// Cleans a cloud, and adds normals and radii: of a file, of several that become one, or of a `Cloud`.
///
/// Keywords are the keys of preparation in scene files: `filter`, `crop`, `subsample`, `remove_outliers`, `denoise`, `orient`,
/// `normals_k`, `radius` and others, besides `seed`, `threads` and `memory_limit`. Without any, normals and radii are added;
/// with some, those steps alone are taken, and `normals=True` adds normals. `keep_variation=True` adds the column
/// `surface_variation`. `progress` is called as `progress(stage, done, total)`.
///
/// Raises `InvalidSetting`, `MissingFile`, `InvalidFile`, `InvalidScene`.
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
    let source = Source::new(&sources)?;
    work::run(py, progress, |progress| {
        let threads = start_threads(&description.run)?;
        on_threads(threads.as_ref(), || match source {
            Source::Cloud(cloud, options_of_file) => {
                let cloud = Arc::unwrap_or_clone(cloud);
                let cloud = prepare_points(cloud, &description, options, progress)?;
                Ok(PyCloud::new(cloud, *options_of_file))
            }
            Source::Files(files) => {
                let Loaded { cloud, info } =
                    prepare_files(&files, &description, options, progress)?;
                Ok(PyCloud::new(cloud, SaveOptions::from_source(&info)))
            }
        })
    })
}

/// The points that are prepared: a cloud, or those of files.
enum Source {
    Cloud(Arc<PointCloud>, Box<SaveOptions>),
    Files(Vec<PathBuf>),
}

impl Source {
    fn new(sources: &[Bound<'_, PyAny>]) -> PyResult<Self> {
        if let [only] = sources
            && let Ok(cloud) = only.cast::<PyCloud>()
        {
            let cloud = cloud.get();
            return Ok(Self::Cloud(cloud.cloud.clone(), Box::new(cloud.options.clone())));
        }
        let files = sources.iter().map(|source| source.extract::<PathBuf>());
        Ok(Self::Files(files.collect::<PyResult<_>>()?))
    }
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
