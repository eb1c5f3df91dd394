//! Scenes: what is shown, and the queries about it.

use crate::errors::to_exception;
use crate::image::PyImage;
use crate::value::{to_python, with_keys};
use crate::work;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPool;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError, TryLockError};
use std::time::Duration;
use surfel::description::{Backend, Invalid, is_scene_file};
use surfel::live_scene::{LiveScene, LiveView, UseCase};
use surfel::progress_log::{Choice, ProgressLog};
use surfel::{Error, RenderedImage, SceneDescription};
use surfel_core::progress::Progress;

/// A scene of files and clouds. Threads may share it.
#[pyclass(frozen, module = "surfel", name = "Scene")]
pub struct PyScene {
    state: Mutex<State>,
}

struct State {
    description: SceneDescription,
    /// The scene as it was read; none until it is needed, and after something was added.
    opened: Slot,
}

type Slot = Arc<Mutex<Option<Arc<OpenScene>>>>;

/// A scene whose files are read.
struct OpenScene {
    scene: LiveScene,
    /// Threads of the scene, if it has a number of its own.
    threads: Option<ThreadPool>,
}

/// Time between two looks at a scene that another thread reads.
const LOCK_POLL_INTERVAL: Duration = Duration::from_millis(2);

impl OpenScene {
    fn open(description: &SceneDescription, progress: &dyn Progress) -> surfel::Result<Self> {
        if description.run.backend() == Backend::Gpu {
            return Err(Invalid::at("backend", "gpu is not in this build; use cpu").into());
        }
        let threads = description.run.threads.map(start_threads).transpose()?;
        let open = || LiveScene::open(description, UseCase::Pictures, progress);
        let scene = threads.as_ref().map_or_else(open, |threads| threads.install(open))?;
        Ok(Self { scene, threads })
    }

    /// Runs `work` on the scene's threads.
    fn install<T: Send>(&self, work: impl FnOnce(&LiveScene) -> T + Send) -> T {
        match &self.threads {
            Some(threads) => threads.install(|| work(&self.scene)),
            None => work(&self.scene),
        }
    }
}

fn start_threads(n_threads: u32) -> surfel::Result<ThreadPool> {
    let threads = rayon::ThreadPoolBuilder::new().num_threads(n_threads as usize).build();
    threads.map_err(|error| {
        Error::Unfit(format!("the threads cannot be started; ask for fewer with threads: {error}"))
    })
}

/// Returns the scene of a description, which is read unless it is there.
fn opened(
    slot: &Slot,
    description: &SceneDescription,
    progress: &dyn Progress,
) -> surfel::Result<Arc<OpenScene>> {
    let mut slot = loop {
        match slot.try_lock() {
            Ok(slot) => break slot,
            Err(TryLockError::Poisoned(error)) => break error.into_inner(),
            Err(TryLockError::WouldBlock) => {
                progress.check()?;
                std::thread::sleep(LOCK_POLL_INTERVAL);
            }
        }
    };
    if let Some(scene) = &*slot {
        return Ok(scene.clone());
    }
    let scene = Arc::new(OpenScene::open(description, progress)?);
    *slot = Some(scene.clone());
    Ok(scene)
}

impl PyScene {
    fn new(description: SceneDescription) -> Self {
        Self { state: Mutex::new(State { description, opened: Slot::default() }) }
    }

    /// Returns the description and the slot of what was read of it.
    fn state(&self) -> (SceneDescription, Slot) {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        (state.description.clone(), state.opened.clone())
    }

    /// Runs `work` about the scene under a description, with the choices that were made for it.
    fn with_view<T: Send>(
        &self,
        py: Python<'_>,
        keys: Option<&Bound<'_, PyDict>>,
        progress: Option<&Bound<'_, PyAny>>,
        work: impl FnOnce(&LiveScene, LiveView, &dyn Progress) -> surfel::Result<T> + Send,
    ) -> PyResult<(T, Vec<Choice>)> {
        let (startup, slot) = self.state();
        let description = with_keys(py, &startup, keys)?;
        work::run(py, progress, |progress| {
            let log = ProgressLog::new(progress);
            let scene = opened(&slot, &startup, &log)?;
            let result = scene.install(|scene| {
                let view = scene.view(&description, &log)?;
                work(scene, view, &log)
            })?;
            Ok((result, log.into_choices()))
        })
    }
}

#[pymethods]
impl PyScene {
    /// Renders a picture. Keywords are keys of scene files; they count for this picture alone.
    ///
    /// `layers=False` leaves out all layers but the colour. `progress` is called as `progress(stage, done, total)`.
    ///
    /// Raises `InvalidSetting` for unknown keys and wrong values, `InvalidScene` for settings that do not fit the data.
    #[pyo3(signature = (*, layers = true, progress = None, **keys))]
    fn render(
        &self,
        py: Python<'_>,
        layers: bool,
        progress: Option<&Bound<'_, PyAny>>,
        keys: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyImage> {
        let ((image, origin, point_ids), choices) =
            self.with_view(py, keys, progress, |scene, mut view, progress| {
                view.settings.with_aovs = layers;
                let (image, _) = scene.picture(&view, progress)?;
                let point_ids = point_ids(&view, &image);
                Ok((image, view.flat.origin, point_ids))
            })?;
        let line = |choice: Choice| format!("{} [{}]", choice.reason, choice.keys.join(", "));
        Ok(PyImage::new(image, origin, point_ids, choices.into_iter().map(line).collect()))
    }

    /// Returns all keys of the scene as a scene file has them, with those that are chosen from the data.
    #[pyo3(signature = (**keys))]
    fn describe<'py>(
        &self,
        py: Python<'py>,
        keys: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (table, _) =
            self.with_view(py, keys, None, |_, view, _| Ok(view.description.to_table()))?;
        to_python(py, &Value::Object(table))
    }

    fn __repr__(&self) -> String {
        let (description, _) = self.state();
        let n_files = description.files.len();
        format!("<surfel.Scene of {n_files} files and {} objects>", description.objects.len())
    }
}

/// Returns the index that each pixel's point had when it was read.
fn point_ids(view: &LiveView, image: &RenderedImage) -> Vec<u32> {
    let Some(aovs) = &image.aovs else { return Vec::new() };
    let sources = view.sources();
    let pixels = aovs.instance_id.iter().zip(&aovs.point_id);
    let source = |(instance, id): (&u32, &u32)| {
        let source = || sources.get(*instance as usize)?.get(*id as usize).copied();
        source().unwrap_or(*id)
    };
    pixels.map(source).collect()
}

/// Opens a file, or several: point clouds, meshes, glTF scenes, scene files (.toml, .json).
///
/// Keywords are keys of scene files: a dot is an underscore, or a dict: `camera_position=(1, 2, 3)` or
/// `camera={"position": (1, 2, 3)}`. What they leave open is chosen from the data.
///
/// Raises `MissingFile`, `InvalidFile`, `InvalidSetting`.
#[pyfunction]
#[pyo3(signature = (*paths, progress = None, **keys))]
pub fn load(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
    keys: Option<&Bound<'_, PyDict>>,
) -> PyResult<PyScene> {
    let mut description = SceneDescription::default();
    for path in paths {
        if is_scene_file(&path) {
            let read = SceneDescription::read(&path).map_err(|error| to_exception(py, &error))?;
            description.overlay(read);
        } else {
            description.files.push(path);
        }
    }
    let scene = PyScene::new(with_keys(py, &description, keys)?);
    let (description, slot) = scene.state();
    work::run(py, progress, |progress| opened(&slot, &description, progress).map(drop))?;
    Ok(scene)
}
